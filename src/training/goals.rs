//! Degree to which a success reaches the goals of its training.
//!
//! `Severe` uses the closing speed of the contact. `Distinct` counts over the whole
//! training the successes of each group of [`clusters`](crate::experiment::clusters), and
//! gives less for a group with more successes. This is fitness sharing (Goldberg and
//! Richardson, "Genetic algorithms with sharing for multimodal function optimization",
//! ICGA 1987) with counts in place of a population.

use crate::experiment::{CrashClass, CrashFeatures};
use crate::rl::{BundleError, TensorFile};
use crate::rulebook::TrainingGoal;
use crate::testbench::Episode;
use crate::world::Scenario;

/// Goals of a training, and the groups of its successes.
pub struct GoalTracker {
    goals: Vec<TrainingGoal>,
    /// First success of each group, with the number of its successes.
    groups: Vec<(CrashFeatures, u64)>,
    successes: u64,
}

impl GoalTracker {
    /// Creates the goals of a training in `scenario`, with the counts of its checkpoint.
    ///
    /// `None`: the training has no goals.
    ///
    /// # Errors
    /// The checkpoint holds no counts, or damaged ones.
    pub fn of(
        scenario: &Scenario,
        checkpoint: Option<&TensorFile>,
    ) -> Result<Option<GoalTracker>, BundleError> {
        if scenario.goals().is_empty() {
            return Ok(None);
        }
        let mut tracker = GoalTracker {
            goals: scenario.goals().to_vec(),
            groups: Vec::new(),
            successes: 0,
        };
        if let Some(checkpoint) = checkpoint {
            tracker.restore(checkpoint)?;
        }
        Ok(Some(tracker))
    }

    /// Counts a success and returns its mean share of the goals, in [0, 1].
    ///
    /// A success reaches no goal if a rule was broken between it and the contact, because
    /// the contact then needs a rule violation.
    pub fn share(&mut self, scenario: &Scenario, episode: &Episode) -> f64 {
        if episode.is_foul_before_contact() {
            return 0.0;
        }
        let goals = self.goals.clone();
        let shares = goals.iter().map(|goal| match goal {
            TrainingGoal::Severe => severe(episode),
            TrainingGoal::Distinct => self.distinct(CrashFeatures::of(scenario, episode)),
        });
        shares.sum::<f64>() / goals.len() as f64
    }

    fn distinct(&mut self, shape: CrashFeatures) -> f64 {
        self.successes += 1;
        let found = self
            .groups
            .iter()
            .position(|(first, _)| shape.is_like(first));
        let group = found.unwrap_or_else(|| {
            self.groups.push((shape, 0));
            self.groups.len() - 1
        });
        self.groups[group].1 += 1;
        let mean = self.successes as f64 / self.groups.len() as f64;
        TrainingGoal::distinct_share(self.groups[group].1, mean)
    }

    /// Writes the counts into a checkpoint.
    pub fn save(&self, bundle: &mut TensorFile) {
        let n = self.groups.len();
        let classes: Vec<&CrashClass> = self.groups.iter().map(|(shape, _)| &shape.class).collect();
        // Invariant: a story is text and words, which serde_json always writes.
        let classes = serde_json::to_vec(&classes).unwrap_or_default();
        bundle.put("goals/stories", &[classes.len()], classes);
        let signals = self.groups.iter().flat_map(|(shape, _)| &shape.signals);
        let signals: Vec<f64> = signals.copied().collect();
        let width = signals.len() / n.max(1);
        bundle.put("goals/signals", &[n, width], signals);
        let counts = self.groups.iter().map(|(_, count)| *count).collect();
        bundle.put::<u64>("goals/counts", &[n], counts);
    }

    fn restore(&mut self, bundle: &TensorFile) -> Result<(), BundleError> {
        let classes = bundle.rows::<u8>("goals/stories", &[])?;
        let classes: Vec<CrashClass> =
            serde_json::from_slice(classes).map_err(|error| BundleError::Format {
                why: error.to_string(),
            })?;
        let n = classes.len();
        let counts = bundle.get::<u64>("goals/counts", &[n])?;
        let width = match bundle.shape("goals/signals") {
            Some([_, width]) => *width,
            _ => 0,
        };
        let signals = bundle.get::<f64>("goals/signals", &[n, width])?;
        for (i, class) in classes.into_iter().enumerate() {
            let signals = signals[i * width..(i + 1) * width].to_vec();
            self.groups
                .push((CrashFeatures { class, signals }, counts[i]));
        }
        self.successes = counts.iter().sum();
        Ok(())
    }
}

/// Returns the share of `Severe`, 0 without a contact of the ego.
fn severe(episode: &Episode) -> f64 {
    let touch = episode.contact.as_ref();
    let touch = touch.filter(|touch| touch.impact.is_some_and(|impact| impact.concerns_ego()));
    touch.map_or(0.0, |touch| {
        TrainingGoal::severe_share(touch.closing_speed_mps)
    })
}
