//! Viewer of work in progress, on a thread of its own.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use cpu_time::{ProcessTime, ThreadTime};

use super::error::ViewError;
use super::stream::EpisodeStream;
use crate::experiment::{Audience, ShownEpisode};
use crate::run_dir::{Calibration, Progress};
use crate::testbench::Episode;
use crate::world::Scenario;

/// Share of the command's processor time that showing episodes may take.
const SHARE: f64 = 0.03;
/// Processor time that the first episodes may take in any case, in seconds.
const HEAD_START_S: f64 = 0.05;
/// Messages that may wait. Episodes never wait.
// So many reports are written within `PATIENCE` on a slow machine, too.
const WAITING: usize = 1024;
/// Time to write what is left when the command ends.
const PATIENCE: Duration = Duration::from_secs(10);

/// Message to the viewer's thread.
enum Message {
    Episode(Box<OwnedEpisode>),
    Progress(Progress),
    Calibration(u64, Calibration),
}

struct OwnedEpisode {
    scenario: Scenario,
    episode: Episode,
    caption: String,
    decisions: Option<(u64, u64)>,
}

/// State that both threads see.
#[derive(Default)]
struct Shared {
    /// True while an episode is being recorded, or waits, or is being written.
    busy: AtomicBool,
    shown: AtomicU64,
    spent_ns: AtomicU64,
    closed: AtomicBool,
}

/// Choice of the episodes that a viewer shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShownShare {
    /// As many as the viewer shows without delaying the work.
    #[default]
    InTime,
    /// All of them. The work waits while too many are left to write.
    All,
}

/// Viewer of work in progress.
///
/// Episodes are evaluated and written on a thread of its own. If it is still at work, or
/// has taken its share of the processor time, an episode is left out. So it never delays
/// the work, even if the viewer at the other end reads nothing. With [`ShownShare::All`]
/// no episode is left out, and the work waits instead.
pub struct LiveView {
    share: ShownShare,
    shared: Arc<Shared>,
    work: ProcessTime,
    sender: Mutex<Option<SyncSender<Message>>>,
    ended: Mutex<Option<Receiver<Result<(), ViewError>>>>,
    left_out: AtomicU64,
}

/// End of a stream.
#[derive(Debug)]
pub struct LiveEnd {
    /// Episodes shown.
    pub shown: u64,
    /// Episodes left out for lack of time.
    pub left_out: u64,
    /// Reason for which the stream ended early.
    pub error: Option<ViewError>,
}

impl LiveView {
    /// Starts the thread that writes to `stream`.
    ///
    /// # Errors
    ///
    /// Returns an error if the system starts no thread.
    pub fn start(stream: EpisodeStream, share: ShownShare) -> std::io::Result<LiveView> {
        let shared = Arc::new(Shared::default());
        let (sender, messages) = sync_channel(WAITING);
        // Room for the one result, so that the thread ends even without a
        // receiver.
        let (end, ended) = sync_channel(1);
        let seen = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("viewer".to_owned());
        thread.spawn(move || {
            let written = write(stream, &messages, &seen);
            // Before the result, so that no episode is recorded for a stream
            // that has ended.
            seen.closed.store(true, Ordering::Relaxed);
            // The command may have ended without the rest.
            let _ = end.send(written);
        })?;
        Ok(LiveView {
            share,
            shared,
            work: ProcessTime::now(),
            sender: Mutex::new(Some(sender)),
            ended: Mutex::new(Some(ended)),
            left_out: AtomicU64::new(0),
        })
    }

    /// Writes the waiting messages, and ends the stream.
    ///
    /// `None`: it has ended already.
    pub fn finish(&self) -> Option<LiveEnd> {
        let take = |sender: &Mutex<Option<SyncSender<Message>>>| {
            sender.lock().unwrap_or_else(PoisonError::into_inner).take()
        };
        // Without a sender the thread ends after the waiting messages.
        drop(take(&self.sender));
        let ended = self
            .ended
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()?;
        let written = match self.share {
            // A viewer that reads nothing must not keep the command from
            // ending.
            ShownShare::InTime => ended.recv_timeout(PATIENCE),
            ShownShare::All => ended.recv().map_err(|_| RecvTimeoutError::Disconnected),
        };
        let error = match written {
            Ok(written) => written.err(),
            Err(RecvTimeoutError::Timeout) => Some(ViewError::Stuck),
            // A panic of the viewer's library has printed its message.
            Err(RecvTimeoutError::Disconnected) => Some(ViewError::Broken),
        };
        Some(LiveEnd {
            shown: self.shared.shown.load(Ordering::Relaxed),
            left_out: self.left_out.load(Ordering::Relaxed),
            error,
        })
    }

    fn send(&self, message: Message) -> bool {
        let sender = self.sender.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = sender.as_ref().map(|sender| sender.try_send(message));
        // A full queue drops the message, as the work never waits here.
        matches!(sent, Some(Ok(())))
    }

    /// Sends an episode, and waits for its place if all are shown.
    fn send_episode(&self, message: Message) -> bool {
        if self.share == ShownShare::InTime {
            return self.send(message);
        }
        // A copy, so that `finish` need not wait for the place.
        let sender = self
            .sender
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        sender.is_some_and(|sender| sender.send(message).is_ok())
    }
}

impl Audience for LiveView {
    fn is_ready(&self) -> bool {
        if self.shared.closed.load(Ordering::Relaxed) {
            return false;
        }
        if self.share == ShownShare::All {
            return true;
        }
        // Processor time on both sides: a busy machine does not change the
        // share.
        let spent_s = 1e-9 * self.shared.spent_ns.load(Ordering::Relaxed) as f64;
        let allowed_s = HEAD_START_S + SHARE * self.work.elapsed().as_secs_f64();
        // The place is taken here, so that of several workers only the first records.
        let ready = spent_s <= allowed_s && !self.shared.busy.swap(true, Ordering::Relaxed);
        if !ready {
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
        ready
    }

    fn episode(&self, shown: &ShownEpisode<'_>) {
        let owned = OwnedEpisode {
            scenario: shown.scenario.clone(),
            episode: shown.episode.clone(),
            caption: shown.caption.to_owned(),
            decisions: shown.decisions,
        };
        if !self.send_episode(Message::Episode(Box::new(owned))) {
            // The place was taken in `is_ready`, and the thread will not
            // release it.
            self.shared.busy.store(false, Ordering::Relaxed);
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn progress(&self, progress: &Progress) {
        self.send(Message::Progress(*progress));
    }

    fn calibration(&self, decisions: u64, calibration: &Calibration) {
        self.send(Message::Calibration(decisions, *calibration));
    }
}

impl Drop for LiveView {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Writes messages until there is no sender any more, or the stream refuses.
fn write(
    mut stream: EpisodeStream,
    messages: &Receiver<Message>,
    shared: &Shared,
) -> Result<(), ViewError> {
    for message in messages {
        let clock = ThreadTime::now();
        match message {
            Message::Episode(owned) => {
                stream.episode(&ShownEpisode {
                    scenario: &owned.scenario,
                    episode: &owned.episode,
                    caption: &owned.caption,
                    decisions: owned.decisions,
                })?;
                shared.shown.fetch_add(1, Ordering::Relaxed);
                // Released after the writing, so that the next episode is
                // recorded only then.
                shared.busy.store(false, Ordering::Relaxed);
            }
            Message::Progress(progress) => stream.progress(&progress)?,
            Message::Calibration(decisions, calibration) => {
                stream.calibration(decisions, &calibration)?;
            }
        }
        let spent_ns = u64::try_from(clock.elapsed().as_nanos()).unwrap_or(u64::MAX);
        shared.spent_ns.fetch_add(spent_ns, Ordering::Relaxed);
    }
    stream.finish()
}
