//! Stream of episodes and learning curves, for a viewer that is open meanwhile.

use std::io::{self, Write};

use re_log_encoding::rrd::CrateVersion;
use re_log_encoding::{EncodeError, Encoder, EncodingOptions};
use re_log_types::{BlueprintActivationCommand, EntityPath, LogMsg, StoreKind};
use re_sdk_types::archetypes::{Clear, RecordingInfo, TextLog};

use super::error::ViewError;
use super::learning;
use super::log_writer::{LogWriter, StreamPlace, nanos};
use super::panels;
use super::viewed_episode::ViewedEpisode;
use crate::experiment::ShownEpisode;
use crate::run_dir::{Calibration, Progress};

/// Pause between two episodes on the timeline `shown_time`, in seconds.
const PAUSE_S: f64 = 0.5;

/// Room of a report of the learner on the timeline `shown_time`, in seconds.
const REPORT_S: f64 = 0.05;

/// Entities of an episode, which the next episode replaces.
///
/// The plots are not among them: a cleared plot would lose its zero line between two
/// episodes. The log of events goes on, too.
const REPLACED: [&str; 6] = [
    "world",
    "trails",
    "contact",
    "verdict/mark",
    "map",
    "follow",
];

/// Stream of episodes for the viewer, one after another on common timelines.
///
/// `shown_time` plays the episodes one after another, `episode` counts them, and
/// `decisions`, in a training, has them and the learning curves.
///
/// Each call writes and flushes its data, so that a growing file or a pipe shows it.
pub struct EpisodeStream {
    sink: Sink,
    recording: LogWriter,
    /// Kinds of worlds that the layout covers: roads and grids.
    laid_out: (bool, bool),
    shows_learning: bool,
    shown_ns: i64,
    episodes: i64,
}

/// Receiver of the messages.
enum Sink {
    Bytes(Box<Encoder<Box<dyn Write + Send>>>),
    #[cfg(feature = "connect")]
    Viewer(super::connection::Connection),
}

impl EpisodeStream {
    /// Begins a stream of bytes, in the format of `.rrd` files.
    ///
    /// `shows_learning` makes room for the curves of a training.
    ///
    /// # Errors
    ///
    /// Returns an error if `out` refuses the data.
    pub fn new(
        out: Box<dyn Write + Send>,
        name: &str,
        shows_learning: bool,
    ) -> Result<EpisodeStream, ViewError> {
        let options = EncodingOptions::PROTOBUF_COMPRESSED;
        // Eager, so that the header is written before the first episode.
        let encoder = Encoder::new_eager(CrateVersion::LOCAL, options, out).map_err(refused)?;
        EpisodeStream::through(Sink::Bytes(Box::new(encoder)), name, shows_learning)
    }

    /// Begins a stream to a viewer that runs already, at the SDK's usual address.
    ///
    /// # Errors
    ///
    /// Returns an error if no viewer answers.
    #[cfg(feature = "connect")]
    pub fn connect(name: &str, shows_learning: bool) -> Result<EpisodeStream, ViewError> {
        let viewer = super::connection::Connection::open()?;
        EpisodeStream::through(Sink::Viewer(viewer), name, shows_learning)
    }

    fn through(sink: Sink, name: &str, shows_learning: bool) -> Result<EpisodeStream, ViewError> {
        let mut stream = EpisodeStream {
            sink,
            recording: LogWriter::new(StoreKind::Recording),
            laid_out: (false, false),
            shows_learning,
            shown_ns: 0,
            episodes: 0,
        };
        let about = RecordingInfo::update_fields().with_name(name);
        let properties = EntityPath::properties();
        stream.recording.throughout(properties, &[&about])?;
        if shows_learning {
            learning::log_pens(&mut stream.recording)?;
        }
        stream.send()?;
        Ok(stream)
    }

    /// Adds an episode after those before it.
    ///
    /// # Errors
    ///
    /// Returns an error if the stream is closed, or the library rejects the data.
    pub fn episode(&mut self, shown: &ShownEpisode<'_>) -> Result<(), ViewError> {
        let story = ViewedEpisode::new(shown.scenario, shown.episode, shown.caption);
        self.episodes += 1;
        // rerun's sequences are signed.
        let signed = |count: u64| i64::try_from(count).unwrap_or(i64::MAX);
        self.recording.place(StreamPlace {
            from_ns: self.shown_ns,
            episode: self.episodes,
            decisions: shown.decisions.map(|(from, to)| (signed(from), signed(to))),
            samples_per_decision: story.samples_per_decision as i64,
        });
        // Cleared before the new episode, whose data then holds from the same
        // instant.
        for entity in REPLACED {
            self.recording.always(entity, &[&Clear::recursive()])?;
        }
        panels::log(&story, &mut self.recording)?;
        let headline = TextLog::new(format!("episode {}: {}", self.episodes, shown.caption));
        // A line in the log that goes on separates the events of two episodes.
        self.recording.always("verdict/events", &[&headline])?;
        // Episodes lie one after another on the viewer's clock, with a pause between.
        self.shown_ns += nanos(story.motion_end_s() + PAUSE_S);
        self.send()?;
        let is_grid = shown.scenario.grid().is_some();
        // Panels are never taken away again, because earlier episodes still use them.
        let kinds = (self.laid_out.0 || !is_grid, self.laid_out.1 || is_grid);
        // Only then, since each new layout resets what the user has arranged.
        if kinds != self.laid_out {
            self.laid_out = kinds;
            self.lay_out(&story)?;
        }
        self.flush()
    }

    /// Adds a point of the learning curves.
    ///
    /// # Errors
    ///
    /// Returns an error if the stream is closed, or the library rejects the data.
    pub fn progress(&mut self, progress: &Progress) -> Result<(), ViewError> {
        learning::log_progress(&mut self.recording, self.shown_ns, progress)?;
        // Otherwise all reports between two episodes would be at the same place.
        self.shown_ns += nanos(REPORT_S);
        self.send()?;
        self.flush()
    }

    /// Adds a calibration after so many decisions to the learning curves.
    ///
    /// # Errors
    ///
    /// Returns an error if the stream is closed, or the library rejects the data.
    pub fn calibration(
        &mut self,
        decisions: u64,
        calibration: &Calibration,
    ) -> Result<(), ViewError> {
        learning::log_calibration(&mut self.recording, self.shown_ns, decisions, calibration)?;
        self.send()?;
        self.flush()
    }

    /// Sends the views and their arrangement.
    fn lay_out(&mut self, story: &ViewedEpisode<'_>) -> Result<(), ViewError> {
        let mut blueprint = LogWriter::new(StoreKind::Blueprint);
        let is_mixed = self.laid_out == (true, true);
        panels::lay_out_stream(story, &mut blueprint, is_mixed, self.shows_learning)?;
        // A blueprint has no effect until a command activates it.
        let activate = BlueprintActivationCommand::make_active(blueprint.store().clone());
        let mut layout = blueprint.into_messages();
        layout.push(LogMsg::BlueprintActivationCommand(activate));
        self.sink.send(layout)
    }

    fn send(&mut self) -> Result<(), ViewError> {
        self.sink.send(self.recording.take_messages())
    }

    fn flush(&mut self) -> Result<(), ViewError> {
        match &mut self.sink {
            Sink::Bytes(encoder) => encoder.flush_blocking().map_err(refused),
            #[cfg(feature = "connect")]
            Sink::Viewer(viewer) => viewer.check(),
        }
    }

    /// Ends the stream, after all its data is written.
    ///
    /// # Errors
    ///
    /// Returns an error if the stream is closed.
    pub fn finish(mut self) -> Result<(), ViewError> {
        match &mut self.sink {
            Sink::Bytes(encoder) => {
                encoder.finish().map_err(refused)?;
                encoder.flush_blocking().map_err(refused)
            }
            #[cfg(feature = "connect")]
            Sink::Viewer(viewer) => viewer.finish(),
        }
    }
}

impl Sink {
    fn send(&mut self, messages: Vec<LogMsg>) -> Result<(), ViewError> {
        match self {
            Sink::Bytes(encoder) => {
                encoder.extend(messages.iter().map(Ok)).map_err(refused)?;
                Ok(())
            }
            #[cfg(feature = "connect")]
            Sink::Viewer(viewer) => viewer.send(messages),
        }
    }
}

/// Distinguishes a closed stream from data that the library rejects.
fn refused(error: EncodeError) -> ViewError {
    match error {
        // A closed viewer is no error of the training.
        EncodeError::Write(source) if source.kind() == io::ErrorKind::BrokenPipe => {
            ViewError::Closed
        }
        EncodeError::Write(source) => ViewError::Stream { source },
        other => ViewError::Encode {
            what: other.to_string(),
        },
    }
}
