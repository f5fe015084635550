//! Stopping rule of a training.
//!
//! A training continues while a cheap search solves calibration starts that the ado
//! misses, and while more training helps.

use super::calibration::Calibrator;
use super::demonstrations::seed_failures;
use super::training_egos::TrainingGym;
use crate::experiment::Watch;
use crate::rl::Learner;
use crate::run_dir::{Calibration, Manifest, Sought, TrainingEnd};
use crate::seed::Purpose;
use crate::world::Scenario;

/// Share of the requested decisions after which starts are searched on which the ado
/// fails. Earlier it is too soon, because good trainings may learn nothing in the first
/// quarter.
const LOOK: f64 = 0.4;
/// Share of the requested decisions by which a training is extended at a time.
const EXTENSION: f64 = 1.0;

/// Rule that decides when a training continues and ends.
pub(super) struct StoppingRule<'a> {
    scenario: &'a Scenario,
    seed: u64,
    watch: &'a Watch<'a>,
    /// Calibration, searched when it is first needed.
    calibrator: Option<Calibrator<'a>>,
    /// Requested decisions, and the decisions after which the training ends in any case.
    pub requested: u64,
    longest: u64,
    /// Decisions at the last check.
    looked: u64,
    /// Calibration when all requested decisions were last taken.
    pub calibration: Option<Calibration>,
    pub ended: Option<TrainingEnd>,
    /// Searches for demonstrations, before and during the training.
    pub sought: Option<Sought>,
    /// Physics steps of searches that are not counted yet.
    uncounted_steps: u64,
    searched_cpu_s: f64,
}

impl<'a> StoppingRule<'a> {
    /// Creates the rule of a training at the state of its manifest.
    pub(super) fn new(
        scenario: &'a Scenario,
        manifest: &Manifest,
        seed: u64,
        watch: &'a Watch<'a>,
    ) -> StoppingRule<'a> {
        StoppingRule {
            scenario,
            seed,
            watch,
            calibrator: None,
            requested: scenario.learner.decisions(),
            longest: scenario.learner.longest(),
            looked: manifest.decisions_done,
            calibration: manifest.calibration,
            ended: None,
            sought: manifest.sought,
            uncounted_steps: 0,
            searched_cpu_s: 0.0,
        }
    }

    /// Returns the decision of the next check.
    pub(super) fn next_look(&self, decisions: u64) -> u64 {
        let look = self.first_look();
        if self.adapts() && decisions < look {
            look
        } else {
            u64::MAX
        }
    }

    fn first_look(&self) -> u64 {
        (LOOK * self.requested as f64) as u64
    }

    fn adapts(&self) -> bool {
        self.requested < self.longest
    }

    /// Shows a learner successes where it fails, once in a training that may continue.
    ///
    /// Returns whether this was done. `None`: stopped, with nothing changed.
    pub(super) fn look(&mut self, learner: &mut dyn Learner) -> Option<bool> {
        let (before, now) = (self.looked, learner.decisions());
        let look = self.first_look();
        // `looked` is that of the checkpoint, so a resumed training looks once as well.
        if !self.adapts() || look <= before || now < look || learner.finished() {
            self.looked = now;
            return Some(false);
        }
        self.study(learner)?;
        self.looked = now;
        Some(true)
    }

    /// Returns whether a training that has taken its decisions ends, or was stopped here.
    ///
    /// Otherwise it is extended.
    pub(super) fn ends(&mut self, learner: &mut dyn Learner) -> bool {
        let before = self.calibration;
        // After a stop nothing is judged, and the training has no end on record.
        let Some(now) = self.calibrate(&*learner) else {
            return true;
        };
        let taken = learner.tally().requested;
        let solved = before.map(|before| before.solved());
        // Where neither search nor ado solves a start, more training has nothing to learn.
        let nothing = now.searched == 0 && now.solved() == 0;
        let ended = if nothing || !self.adapts() {
            Some(TrainingEnd::Asked)
        } else if now.is_complete() {
            Some(TrainingEnd::Learned)
        // Another extension hardly helps after one that did not.
        } else if solved.is_some_and(|solved| now.solved() <= solved) {
            Some(TrainingEnd::Settled)
        } else if self.longest <= taken {
            Some(TrainingEnd::Longest)
        } else {
            None
        };
        // The calibration is recorded below only, or a stopped training would resume as if
        // it had been shown the starts of this look.
        if ended.is_none() && self.study(learner).is_none() {
            return true;
        }
        (self.calibration, self.ended) = (Some(now), ended);
        if ended.is_none() {
            let more = (EXTENSION * self.requested as f64) as u64;
            // At least 1, or the training would never end. The difference is positive
            // here.
            learner.extend(more.max(1).min(self.longest - taken));
            self.watch.note(&format!("going on: {}", now.in_words()));
        }
        ended.is_some()
    }

    /// Searches more training starts on which the ado fails, and shows the learner the
    /// successes.
    ///
    /// `None`: stopped, and nothing was shown.
    fn study(&mut self, learner: &mut dyn Learner) -> Option<()> {
        let Some(seeding) = self.scenario.learner.seeding() else {
            return Some(());
        };
        let mut sought = self.sought.unwrap_or_default();
        self.watch.phase("searching starts on which the ado fails");
        let seeded = seed_failures(
            self.scenario,
            self.seed,
            learner,
            seeding,
            sought.simulations,
            self.watch,
        )?;
        // A separate gym, because shown successes are not results of the training.
        let mut gym = TrainingGym::new(self.scenario, Purpose::Train, self.seed);
        learner.demonstrate(&mut gym, &seeded.demonstrations);
        self.uncounted_steps += seeded.sought.physics_steps + gym.inner().spent().physics_steps;
        self.searched_cpu_s += seeded.cpu_s;
        sought.starts += seeded.sought.starts;
        sought.solved += seeded.sought.solved;
        sought.simulations += seeded.sought.simulations;
        sought.physics_steps += seeded.sought.physics_steps;
        self.sought = Some(sought);
        Some(())
    }

    /// Takes the physics steps of searches since the last call.
    pub(super) fn take_steps(&mut self) -> u64 {
        std::mem::take(&mut self.uncounted_steps)
    }

    fn calibrate(&mut self, learner: &dyn Learner) -> Option<Calibration> {
        // Searched once, because its starts and their solutions stay the same.
        if self.calibrator.is_none() {
            self.watch.phase("searching calibration starts");
            self.calibrator = Calibrator::new(self.scenario, self.seed, self.watch);
        }
        let calibrator = self.calibrator.as_mut()?;
        self.watch.phase("playing calibration starts");
        let calibration = calibrator.of(&*learner.policy(), self.watch)?;
        if let Some(audience) = self.watch.audience {
            audience.calibration(learner.decisions(), &calibration);
        }
        Some(calibration)
    }

    /// Returns the cost of calibration and searches so far.
    pub(super) fn cpu_s(&self) -> f64 {
        let calibrating = self.calibrator.as_ref().map_or(0.0, |used| used.cpu_s);
        self.searched_cpu_s + calibrating
    }

    /// Returns the processor time of a simulation of the calibration search, if it ran.
    pub(super) fn seconds_per_simulation(&self) -> Option<f64> {
        self.calibrator.as_ref()?.seconds_per_simulation()
    }

    /// Returns the cost of one calibration, which does not depend on interruptions.
    pub(super) fn physics_steps(&self) -> u64 {
        self.calibrator
            .as_ref()
            .map_or(0, |used| used.physics_steps)
    }
}
