//! Progress of a command: a bar on terminals, and regular lines elsewhere.
//!
//! Every phase of a command counts by itself. The remaining time is that of the current
//! phase, estimated from its finished part.

use std::fmt::Write;
use std::io::{self, IsTerminal};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use super::display::is_quiet;
use super::terminal::{self, Common};
use crate::experiment::{Remark, StepPlace, TrainingIntervals, Watch};
use crate::testbench::FaultLog;
use crate::visible::visible_line;

/// Between two lines of progress, where there is no terminal.
const EVERY: Duration = Duration::from_secs(30);
/// Between two looks whether a new phase is long enough to be announced.
const LOOK: Duration = Duration::from_secs(2);
/// Remaining seconds from which a phase is announced before [`EVERY`] is over.
const LONG_S: u64 = 10;
/// Share of a phase below which its rate is unreliable.
// The divisor of a share: one twentieth is 5 %.
const TELLING: u64 = 20;

/// State of the current phase.
#[derive(Clone, Debug, Default, PartialEq)]
struct ProgressPhase {
    /// Title of the bar, empty if the phases suffice.
    title: String,
    what: String,
    step: Option<(usize, usize)>,
    /// Details of the phase besides counts.
    detail: String,
    /// Counted when the phase began.
    first: u64,
    done: u64,
    /// `None`: nothing was counted so far.
    total: Option<u64>,
}

/// Time of an event, in seconds.
#[derive(Clone, Copy, Debug)]
struct PhaseTime {
    /// Since the phase began.
    elapsed_s: u64,
    /// Since something was last done of it.
    idle_s: u64,
}

impl ProgressPhase {
    /// Returns the current step, such as `2/4 training (decisions)`.
    fn label(&self) -> String {
        let mut label = String::new();
        // "1/1" says nothing.
        let step = self
            .step
            .filter(|(_, of)| *of > 1)
            .map(|(at, of)| format!("{at}/{of} "));
        let what = format!("{}{}", step.unwrap_or_default(), self.what);
        let parts = [&self.title, &what, &self.detail];
        for (part, between) in parts.into_iter().zip(["", ": ", ", "]) {
            if !part.is_empty() {
                label.push_str(if label.is_empty() { "" } else { between });
                label.push_str(part);
            }
        }
        // Labels contain names from world files.
        visible_line(&label).into_owned()
    }

    /// Returns the remaining seconds, if they can be estimated.
    ///
    /// Running items have an unknown end. Without waiting items there is no estimate. A
    /// long item counts as taking as long again.
    fn left_s(&self, spent: PhaseTime, at_once: u64) -> Option<u64> {
        let total = self.total?;
        let (here, left) = (
            self.done.saturating_sub(self.first),
            total.saturating_sub(self.done),
        );
        let all = total.saturating_sub(self.first);
        // At the end all remaining items are running, and their rate is unknown.
        if here == 0 || left <= at_once || here.saturating_mul(TELLING) < all {
            return None;
        }
        let by_rate_s = spent.elapsed_s.saturating_mul(left) / here;
        // After a long silence the rate of the earlier items is too optimistic.
        Some(by_rate_s.max(spent.idle_s))
    }

    /// A line for those who have no terminal.
    fn line(&self, spent: PhaseTime, at_once: u64) -> String {
        let mut line = self.label();
        let elapsed_s = spent.elapsed_s;
        // Writing into a string cannot fail.
        let _ = match self.total {
            Some(total) => write!(line, ": {} of {total} after {elapsed_s} s", self.done),
            None => write!(line, ": {elapsed_s} s so far"),
        };
        if let Some(left_s) = self.left_s(spent, at_once) {
            let _ = write!(line, ", about {left_s} s left");
        }
        line
    }
}

/// The present phase and its clocks.
#[derive(Debug)]
struct Present {
    phase: ProgressPhase,
    began: Instant,
    last: Instant,
    /// True if the phase has a line already.
    announced: bool,
    ended: bool,
}

impl Present {
    fn new(title: &str) -> Present {
        Present {
            phase: ProgressPhase {
                title: title.to_owned(),
                ..ProgressPhase::default()
            },
            began: Instant::now(),
            last: Instant::now(),
            announced: false,
            ended: false,
        }
    }

    fn spent(&self) -> PhaseTime {
        PhaseTime {
            elapsed_s: self.began.elapsed().as_secs(),
            idle_s: self.last.elapsed().as_secs(),
        }
    }

    fn begin(&mut self, what: &str, step: Option<(usize, usize)>) {
        self.phase = ProgressPhase {
            // The title is that of the command, so it outlives the phase.
            title: std::mem::take(&mut self.phase.title),
            what: what.to_owned(),
            step,
            ..ProgressPhase::default()
        };
        (self.began, self.last) = (Instant::now(), Instant::now());
        // A new phase may announce itself again, once its length can be estimated.
        self.announced = false;
    }

    /// Returns whether a phase is new and has long to go.
    fn is_long(&self, at_once: u64) -> bool {
        let left_s = self.phase.left_s(self.spent(), at_once);
        !self.announced && left_s.is_some_and(|left_s| left_s > LONG_S)
    }

    fn count(&mut self, done: u64, total: u64) {
        let phase = &mut self.phase;
        // The first count of a phase may come from a resumed work.
        if phase.total.is_none() {
            phase.first = done;
        }
        // Repeated counts are no sign of life.
        if phase.done != done {
            self.last = Instant::now();
        }
        // Several threads report in any order, so a count never decreases.
        phase.done = if phase.total == Some(total) {
            phase.done.max(done)
        } else {
            done
        };
        phase.total = Some(total);
    }
}

/// State shared by all reporting threads.
#[derive(Debug)]
struct SharedProgress {
    present: Mutex<Present>,
    /// Wakes the writer of lines when the bar ends.
    ended: Condvar,
    at_once: u64,
}

impl SharedProgress {
    fn present(&self) -> MutexGuard<'_, Present> {
        // Counts stay valid if another thread panicked.
        self.present.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes a line for each long phase, and now and then, also while nothing is done.
    fn write_lines(&self) {
        let mut present = self.present();
        let mut written = Instant::now();
        // Asked before it is waited for: a short command may be over already.
        while !present.ended {
            let waited = self.ended.wait_timeout(present, LOOK);
            let (now, timeout) = waited.unwrap_or_else(PoisonError::into_inner);
            present = now;
            let is_due = written.elapsed() >= EVERY || present.is_long(self.at_once);
            if timeout.timed_out() && !present.ended && is_due {
                terminal::note(&present.phase.line(present.spent(), self.at_once));
                present.announced = true;
                written = Instant::now();
            }
        }
    }
}

/// Progress of a command, removed when dropped.
pub struct Bar {
    shown: ProgressBar,
    faults: FaultLog,
    intervals: TrainingIntervals,
    shared: Arc<SharedProgress>,
    lines: Option<JoinHandle<()>>,
    progress: Box<dyn Fn(u64, u64) + Send + Sync>,
    remarks: Box<dyn Fn(Remark<'_>) + Send + Sync>,
}

/// Returns the intervals at which trainings write their progress.
fn intervals(common: &Common) -> TrainingIntervals {
    let usual = TrainingIntervals::default();
    TrainingIntervals {
        report_episodes: common.report_every.unwrap_or(usual.report_episodes),
        checkpoint_decisions: common
            .checkpoint_every
            .unwrap_or(usual.checkpoint_decisions),
    }
}

/// Creates a bar whose phases and counts come from the work, after `title`.
pub fn bar(common: &Common, title: &str) -> Bar {
    let shared = Arc::new(SharedProgress {
        present: Mutex::new(Present::new(title)),
        ended: Condvar::new(),
        at_once: rayon::current_num_threads() as u64,
    });
    let (shown, on_terminal) = if is_quiet() {
        (ProgressBar::hidden(), false)
    } else {
        (ProgressBar::new(0), io::stderr().is_terminal())
    };
    if on_terminal {
        shown.set_style(style(&shared));
        let label = shared.present().phase.label();
        shown.set_message(label);
        // Seconds advance also while no item finishes.
        shown.enable_steady_tick(Duration::from_secs(1));
    }
    let writing = Arc::clone(&shared);
    // Without a thread there are no lines, and the work continues.
    let lines = (!on_terminal && !is_quiet()).then(|| {
        let thread = std::thread::Builder::new().name("progress".to_owned());
        thread.spawn(move || writing.write_lines())
    });
    let (moved, counted) = (shown.clone(), Arc::clone(&shared));
    let progress = Box::new(move |done, total| {
        counted.present().count(done, total);
        moved.set_length(total);
        moved.set_position(done);
    });
    let (named, reported) = (shown.clone(), Arc::clone(&shared));
    let remarks = Box::new(move |remark: Remark<'_>| {
        match remark {
            Remark::Phase { what, step } => {
                reported.present().begin(what, step);
                // The counts of the phase before would be wrong under the new label.
                named.set_length(0);
                named.set_position(0);
            }
            Remark::Detail(detail) => reported.present().phase.detail = detail.to_owned(),
            // The bar is removed while a line is written, or both would mix.
            Remark::Line(line) => return named.suspend(|| terminal::note(line)),
        }
        // Not while the lock is held: drawing takes it.
        let label = reported.present().phase.label();
        named.set_message(label);
    });
    Bar {
        shown,
        faults: common.faults(),
        intervals: intervals(common),
        shared,
        lines: lines.and_then(Result::ok),
        progress,
        remarks,
    }
}

/// Returns the style of a bar on a terminal.
fn style(shared: &Arc<SharedProgress>) -> ProgressStyle {
    let shared = Arc::clone(shared);
    let counts = move |_: &ProgressState, text: &mut dyn Write| {
        let present = shared.present();
        let PhaseTime { elapsed_s, .. } = present.spent();
        if let Some(total) = present.phase.total {
            let _ = write!(text, "{}/{total}  ", present.phase.done);
        }
        let _ = write!(text, "{elapsed_s} s");
        if let Some(left_s) = present.phase.left_s(present.spent(), shared.at_once) {
            let _ = write!(text, ", about {left_s} s left");
        }
    };
    let parsed = ProgressStyle::with_template("{msg:<32} {wide_bar} {counts}");
    // Invariant: the template is sound.
    let style = parsed.unwrap_or_else(|_| ProgressStyle::default_bar());
    style.with_key("counts", counts)
}

impl Bar {
    /// Returns a watch that shows progress on this bar and stops at Ctrl-C.
    pub fn watch(&self) -> Watch<'_> {
        Watch {
            progress: &*self.progress,
            remarks: &*self.remarks,
            stop: terminal::stop(),
            faults: self.faults.clone(),
            place: StepPlace::Unnumbered,
            audience: None,
            intervals: self.intervals,
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        // Set under the lock, so that the writer cannot miss the wake-up.
        self.shared.present().ended = true;
        self.shared.ended.notify_all();
        if let Some(lines) = self.lines.take() {
            // A thread that panicked wrote its own message.
            let _ = lines.join();
        }
        // A finished bar would stay above the table that follows.
        self.shown.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(present: &Present, elapsed_s: u64, idle_s: u64) -> String {
        let spent = PhaseTime { elapsed_s, idle_s };
        // Two items run at once, as on two threads.
        present.phase.line(spent, 2)
    }

    #[test]
    fn every_phase_has_its_own_label_and_counts() {
        let mut now = Present::new("");
        now.begin("searching training starts", Some((1, 4)));
        assert_eq!(
            line(&now, 30, 30),
            "1/4 searching training starts: 30 s so far"
        );
        now.count(0, 2000);
        now.count(500, 2000);
        // At the rate of 500 in 60 s, the other 1500 take 180 s.
        assert_eq!(
            line(&now, 60, 1),
            "1/4 searching training starts: 500 of 2000 after 60 s, about 180 s left"
        );
        now.begin("training (decisions)", Some((2, 4)));
        now.phase.detail = "solves 34 % exploring".to_owned();
        // A resumed training. Its earlier part has no rate.
        now.count(100_000, 160_000);
        now.count(110_000, 160_000);
        assert_eq!(
            line(&now, 30, 0),
            "2/4 training (decisions), solves 34 % exploring: 110000 of 160000 after 30 s, about 150 s left"
        );
        now.begin("theorems", Some((1, 1)));
        assert_eq!(line(&now, 1, 1), "theorems: 1 s so far");
        let mut titled = Present::new("acc, seed 1");
        assert_eq!(line(&titled, 5, 5), "acc, seed 1: 5 s so far");
        titled.begin("training", Some((2, 4)));
        assert_eq!(line(&titled, 5, 5), "acc, seed 1: 2/4 training: 5 s so far");
        titled.begin("a\u{1b}[2K\nb", None);
        assert_eq!(
            line(&titled, 5, 5),
            "acc, seed 1: a\\u{1b}[2K\\u{a}b: 5 s so far"
        );
    }

    #[test]
    fn the_last_items_and_slow_ones_have_no_rosy_end() {
        let mut now = Present::new("");
        now.begin("searching", None);
        now.count(0, 30);
        now.count(28, 30);
        // Both that are left are under way.
        assert_eq!(line(&now, 65, 0), "searching: 28 of 30 after 65 s");
        now.count(0, 3000);
        now.count(1500, 3000);
        assert!(line(&now, 100, 0).ends_with("about 100 s left"));
        assert!(line(&now, 400, 300).ends_with("about 400 s left"));
        now.count(2900, 3000);
        // Nothing was done for long: as long again is likely.
        assert!(line(&now, 600, 300).ends_with("about 300 s left"));
        now.begin("searching", None);
        now.count(0, 160_000);
        // Three of so many are too small a share for a rate.
        now.count(3, 160_000);
        assert_eq!(line(&now, 250, 0), "searching: 3 of 160000 after 250 s");
    }
}
