//! State of a driver during its drive, and the rows that the drive makes.

use crate::ego::Actuator;
use crate::ego::reference::{ReferenceDriver, Reflexes};
use crate::rulebook::Rulebook;
use crate::scene::drive::DriveScene;
use crate::scene::{ContactEvent, Frame, Scene};
use crate::stl::Scratch;
use crate::trace::Trace;

/// Driver in the ego's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seat {
    /// A reference driver.
    Driver(ReferenceDriver),
    /// The ideal driver, which brakes from its takeover on.
    FullBrakes,
    /// A driver that never brakes and keeps the nominal speed.
    Nominal,
    /// The recorded ego itself.
    Recorded,
}

/// A driver and the actuator behind it.
pub(super) struct ReferenceDriverRun {
    pub driver: Option<Reflexes<ReferenceDriver>>,
    pub actuator: Actuator,
    /// Samples driven so far, and those before the first danger.
    driven: usize,
    reacted: Option<usize>,
}

impl ReferenceDriverRun {
    /// Creates the drive of a driver, with the actuator in its current state.
    pub(super) fn new(
        seat: Seat,
        actuator: Actuator,
        sample_s: f64,
        lane_width_m: f64,
    ) -> ReferenceDriverRun {
        let driver = match seat {
            Seat::Driver(driver) => Some(Reflexes::new(driver, sample_s, lane_width_m)),
            _ => None,
        };
        ReferenceDriverRun {
            driver,
            actuator,
            driven: 0,
            // Full brakes react at once.
            reacted: (seat == Seat::FullBrakes).then_some(0),
        }
    }

    pub(super) fn note(&mut self) {
        let has_reacted = self.driver.as_ref().is_some_and(Reflexes::has_reacted);
        if has_reacted && self.reacted.is_none() {
            self.reacted = Some(self.driven);
        }
        // The reaction belongs to this sample, so the count grows after it.
        self.driven += 1;
    }

    pub(super) fn reacted(&self, from: usize, sample_s: f64) -> Option<f64> {
        self.reacted.map(|after| (from + after) as f64 * sample_s)
    }
}

/// Notes of a replay besides its outcome.
#[derive(Default)]
pub(super) struct Notes {
    /// Trace, if it is judged.
    pub rows: Option<ReplayRows>,
    /// Positions of all agents at each sample, if they are displayed.
    pub frames: Option<Vec<Frame>>,
    /// Contact that ends the replay.
    pub contact: Option<ContactEvent>,
}

impl Notes {
    /// Notes the sample of the takeover, whose row the trace has already.
    pub(super) fn begin(&mut self, scene: &DriveScene) {
        if let Some(frames) = &mut self.frames {
            frames.push(scene.frame());
        }
    }

    /// Notes a sample.
    pub(super) fn push(&mut self, scene: &DriveScene) {
        if let Some(rows) = &mut self.rows {
            rows.push(scene);
        }
        self.begin(scene);
    }
}

/// Rows of a replay, after those of the record up to the takeover.
pub(super) struct ReplayRows {
    trace: Trace,
    row: Vec<f64>,
    /// Samples of a full episode.
    most: usize,
}

impl ReplayRows {
    pub(super) fn begin(recorded: &Trace, from: usize, most: usize) -> ReplayRows {
        let mut trace = recorded.clone();
        // The sample of the takeover is that of the record, and the replay
        // follows it.
        trace.truncate(from + 1);
        ReplayRows {
            row: vec![0.0; trace.schema().signals().len()],
            trace,
            most,
        }
    }

    pub(super) fn push(&mut self, scene: &DriveScene) {
        // A replay may outlast the horizon, behind which nothing is judged.
        if self.trace.len() < self.most {
            scene.publish(&mut self.row);
            // An invalid row ends the part that can be judged.
            if self.trace.push(&self.row).is_err() {
                self.most = 0;
            }
        }
    }

    /// Returns whether all rules are kept, and ρ(ψ_ego).
    pub(super) fn judge(&self, rulebook: &Rulebook) -> (bool, f64) {
        let mut scratch = Scratch::default();
        let mut rules = rulebook.rules.iter();
        let kept = rules.all(|rule| rule.monitor.robustness(&self.trace, &mut scratch) > 0.0);
        (kept, rulebook.spec.robustness(&self.trace, &mut scratch))
    }
}
