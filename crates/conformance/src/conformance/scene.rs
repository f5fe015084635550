//! Conformance check of a scene.

use super::env::{observed, shapes, unscaled};
use super::recorded::{StepNumbers, Subject, action, examine};
use super::{Nonconformities, Promise};
use crate::scene::{Scene, Start, StepOutcome};
use crate::seed::{Purpose, StartKey};

/// Largest number of samples of an episode that is played.
const MOST_SAMPLES: usize = 60;

/// Checks the promises of a scene.
///
/// Its starts must lie within its axes. It must publish and observe as stated.
/// It must depend on start, noise and actions only, and copy itself in `fork`.
/// `make` must return an unused scene, of which the first 60 samples are
/// played.
///
/// # Errors
/// The broken promises, each with the first sample that shows it.
pub fn check_scene(make: &(dyn Fn() -> Box<dyn Scene> + Sync)) -> Result<(), Nonconformities> {
    examine(|| PlayedScene {
        scene: make(),
        over: false,
        fault: None,
    })
}

struct PlayedScene {
    scene: Box<dyn Scene>,
    over: bool,
    fault: Option<(Promise, String)>,
}

impl PlayedScene {
    fn start(&self, episode: u64) -> Start {
        self.scene.draw(StartKey {
            purpose: Purpose::Train,
            seed: 3,
            index: episode,
        })
    }

    fn row(&mut self) -> StepNumbers {
        // Numbers that the scene does not write remain NaN and are reported.
        let mut row = vec![f64::NAN; self.scene.schema().len()];
        let mut obs = vec![f32::NAN; self.scene.spaces().observation];
        self.scene.publish(&mut row);
        self.scene.observe(&row, &mut obs);
        let obs = obs.iter().map(|value| f64::from(*value));
        row.into_iter().chain(obs).collect()
    }

    /// Returns a problem with a start.
    fn misplaced(&self, start: &Start) -> Option<String> {
        let axes = self.scene.axes();
        if start.0.len() != axes.len() {
            let (found, expected) = (start.0.len(), axes.len());
            return Some(format!("a start has {found} numbers for {expected} axes"));
        }
        let mut pairs = start.0.iter().zip(axes);
        let outside = pairs.find(|(value, axis)| !(axis.lo..=axis.hi).contains(*value));
        outside.map(|(value, axis)| {
            let (name, lo, hi) = (&axis.name, axis.lo, axis.hi);
            format!("a start has {name} = {value}, outside of {lo} to {hi}")
        })
    }
}

impl Subject for PlayedScene {
    fn names(&self) -> Vec<String> {
        let signals = self
            .scene
            .schema()
            .signals()
            .iter()
            .map(|signal| signal.name.to_string());
        signals.chain(observed(self.scene.spaces())).collect()
    }

    fn shapes(&self) -> Option<String> {
        let clock = self.scene.clock();
        let still = (clock.samples() == 0 || clock.samples_per_decision() == 0)
            .then(|| "an episode without samples".to_owned());
        shapes(self.scene.spaces()).or(still)
    }

    fn begin(&mut self, episode: u64) -> StepNumbers {
        let start = self.start(episode);
        let misplaced = self.misplaced(&start);
        self.fault = misplaced.map(|what| (Promise::Spaces, what));
        self.over = false;
        self.scene.reset(&start, 11 + episode);
        self.row()
    }

    fn step(&mut self, episode: u64, step: usize) -> Option<StepNumbers> {
        let clock = self.scene.clock();
        // External egos wait for the next sample until the episode is finished.
        if self.over || clock.samples().min(MOST_SAMPLES) <= step {
            self.scene.finish();
            return None;
        }
        // Step 1 is the first advance, so decisions are due at steps 1, 1 + n,
        // and so on.
        if (step - 1).is_multiple_of(clock.samples_per_decision()) {
            let actions = self.scene.spaces().actions;
            self.scene.decide(action(episode, step, actions));
        }
        let flow = self.scene.advance();
        self.over = flow != StepOutcome::Going;
        self.fault = match flow {
            StepOutcome::Fault(fault) => Some((Promise::Finite, format!("a fault: {fault}"))),
            StepOutcome::Going | StepOutcome::Contact(_) => None,
        };
        Some(self.row())
    }

    fn flaw(&self, at: usize, value: f64) -> Option<String> {
        // Only the observation has a scale. Signals have units and any size.
        unscaled(value).filter(|_| self.scene.schema().len() <= at)
    }

    fn fault(&self) -> Option<(Promise, String)> {
        self.fault.clone()
    }

    fn fork(&self) -> Option<Self> {
        Some(PlayedScene {
            scene: self.scene.fork()?,
            over: self.over,
            // A fault belongs to the step that the original took.
            fault: None,
        })
    }
}
