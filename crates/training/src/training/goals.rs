//! Degree to which a success reaches the goals of its training.
//!
//! `Severe` uses the closing speed of the contact. `Distinct` counts over the whole
//! training the successes of each group of [`clusters`](crate::experiment::clusters), and
//! gives less for a group with more successes. This is fitness sharing (Goldberg and
//! Richardson, "Genetic algorithms with sharing for multimodal function optimization",
//! ICGA 1987) with counts in place of a population.

use std::collections::BTreeMap;

use crate::crashes::CellFinder;
use crate::experiment::{CrashFeatures, FailureKind};
use crate::rl::{BundleError, TensorFile};
use crate::run_dir::{CellCount, FailureCell, KnownFailures};
use crate::testbench::Episode;
use crate::world::{Scenario, TrainingGoal};

/// Goals of a training, and the groups of its successes.
pub struct GoalTracker {
    goals: Vec<TrainingGoal>,
    /// First success of each group, with the number of its successes.
    groups: Vec<(CrashFeatures, u64)>,
    successes: u64,
    /// Rarity among the failures that a population knows, as a further goal.
    rarity: Option<CellRarity>,
}

/// Counts of the failures that are known, of this training and of those before it.
struct CellRarity {
    cells: BTreeMap<FailureCell, u64>,
    failures: u64,
    finder: CellFinder,
}

impl CellRarity {
    fn of(scenario: &Scenario, cells: &[CellCount]) -> CellRarity {
        let cells: BTreeMap<FailureCell, u64> = cells
            .iter()
            .map(|one| (one.cell.clone(), one.failures))
            .collect();
        CellRarity {
            failures: cells.values().sum(),
            cells,
            finder: CellFinder::new(scenario),
        }
    }

    /// Counts a failure in its cell and returns the share of the goal.
    fn share(&mut self, cell: FailureCell) -> f64 {
        let seen = self.cells.entry(cell).or_default();
        *seen += 1;
        let seen = *seen;
        self.failures += 1;
        TrainingGoal::distinct_share(seen, self.failures as f64 / self.cells.len() as f64)
    }

    fn counts(&self) -> Vec<CellCount> {
        let counts = self.cells.iter().map(|(cell, failures)| CellCount {
            cell: cell.clone(),
            failures: *failures,
        });
        counts.collect()
    }
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
        GoalTracker::beyond(scenario, None, checkpoint)
    }

    /// Creates the goals as [`GoalTracker::of`], with the rarity among known failures as
    /// a further goal.
    ///
    /// # Errors
    /// The checkpoint holds no counts, or damaged ones.
    pub fn beyond(
        scenario: &Scenario,
        known: Option<&KnownFailures>,
        checkpoint: Option<&TensorFile>,
    ) -> Result<Option<GoalTracker>, BundleError> {
        if scenario.goals().is_empty() && known.is_none() {
            return Ok(None);
        }
        let mut tracker = GoalTracker {
            goals: scenario.goals().to_vec(),
            groups: Vec::new(),
            successes: 0,
            rarity: known.map(|known| CellRarity::of(scenario, &known.cells)),
        };
        if let Some(checkpoint) = checkpoint {
            tracker.restore(checkpoint)?;
            // The checkpoint also counts what was known before the training.
            if tracker.rarity.is_some() {
                let counts: Vec<CellCount> = from_json(checkpoint.rows::<u8>("goals/cells", &[])?)?;
                tracker.rarity = Some(CellRarity::of(scenario, &counts));
            }
        }
        Ok(Some(tracker))
    }

    /// Returns the physics steps of replays since the last call.
    pub fn take_physics_steps(&mut self) -> u64 {
        let finder = self.rarity.as_mut().map(|rarity| &mut rarity.finder);
        finder.map_or(0, |finder| std::mem::take(&mut finder.physics_steps))
    }

    /// Counts a success and returns its mean share of the goals, in [0, 1].
    ///
    /// A success reaches no goal if a rule was broken between it and the contact, because
    /// the contact then needs a rule violation.
    pub fn share(&mut self, scenario: &Scenario, episode: &Episode) -> f64 {
        if episode.is_foul_before_contact() {
            return 0.0;
        }
        // Copied, because `distinct` changes the tracker.
        let goals = self.goals.clone();
        let shares = goals.iter().map(|goal| match goal {
            TrainingGoal::Severe => severe(episode),
            TrainingGoal::Distinct => self.distinct(CrashFeatures::of(scenario, episode)),
        });
        let sum: f64 = shares.sum();
        let Some(rarity) = &mut self.rarity else {
            // Not by 0, because without goals and rarity no tracker is made.
            return sum / goals.len() as f64;
        };
        let cell = rarity.finder.cell(scenario, episode);
        (sum + rarity.share(cell)) / (goals.len() + 1) as f64
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
        let shapes = self.groups.iter().map(|(shape, _)| &shape.kind);
        // Invariant: a story is text and words, which serde_json always writes.
        let classes = serde_json::to_vec(&shapes.collect::<Vec<_>>()).unwrap_or_default();
        bundle.put("goals/stories", &[classes.len()], classes);
        let signals: Vec<f64> = self
            .groups
            .iter()
            .flat_map(|(shape, _)| &shape.signals)
            .copied()
            .collect();
        let width = signals.len() / n.max(1);
        bundle.put("goals/signals", &[n, width], signals);
        let counts = self.groups.iter().map(|(_, count)| *count).collect();
        bundle.put::<u64>("goals/counts", &[n], counts);
        if let Some(rarity) = &self.rarity {
            // Invariant: cells are words and numbers, which serde_json always writes.
            let cells = serde_json::to_vec(&rarity.counts()).unwrap_or_default();
            bundle.put("goals/cells", &[cells.len()], cells);
        }
    }

    fn restore(&mut self, bundle: &TensorFile) -> Result<(), BundleError> {
        let kinds: Vec<FailureKind> = from_json(bundle.rows::<u8>("goals/stories", &[])?)?;
        let n = kinds.len();
        let counts = bundle.get::<u64>("goals/counts", &[n])?;
        // Without groups, there are no rows that state a width.
        let width = match bundle.shape("goals/signals") {
            Some([_, width]) => *width,
            _ => 0,
        };
        let signals = bundle.get::<f64>("goals/signals", &[n, width])?;
        for (i, kind) in kinds.into_iter().enumerate() {
            let signals = signals[i * width..(i + 1) * width].to_vec();
            self.groups
                .push((CrashFeatures { kind, signals }, counts[i]));
        }
        // Every success is in one group, so their number is not stored.
        self.successes = counts.iter().sum();
        Ok(())
    }
}

fn from_json<T: serde::de::DeserializeOwned>(text: &[u8]) -> Result<T, BundleError> {
    serde_json::from_slice(text).map_err(|error| BundleError::Format {
        why: error.to_string(),
    })
}

/// Returns the share of `Severe`, 0 without a contact of the ego.
fn severe(episode: &Episode) -> f64 {
    let touch = episode.contact.as_ref();
    // A contact between two ados says nothing about what the ego suffers.
    let of_ego = touch.filter(|touch| touch.impact.is_some_and(|impact| impact.concerns_ego()));
    of_ego.map_or(0.0, |touch| {
        TrainingGoal::severe_share(touch.closing_speed_mps)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::CellFailure;
    use crate::seed::{Purpose, StartKey};
    use crate::sim::PlantKind;
    use crate::testbench::{Aftermath, Constant, play};

    /// A success in which the lead brakes hardest throughout.
    fn success(world: &Scenario) -> Episode {
        let mut bench = world.bench();
        let key = |index| StartKey {
            purpose: Purpose::Train,
            seed: 5,
            index,
        };
        let mut episodes = (0..200).map(|index| {
            let (start, noise) = (bench.draw(key(index)), bench.noise_of(key(index)));
            play(&mut bench, &start, noise, &mut Constant(0), Aftermath::Play)
        });
        let found = episodes.find(|it| it.verdict.is_success() && !it.is_foul_before_contact());
        found.expect("the lead's braking fails the ego from some start")
    }

    #[test]
    fn a_failure_of_a_rare_cell_earns_more_and_less_each_time() {
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(PlantKind::Kinematic);
        let episode = success(&world);
        let cell = CellFinder::new(&world).cell(&world, &episode);
        let other = FailureCell {
            failure: CellFailure::Violation {
                leaf: "another".to_owned(),
            },
            necessary: None,
        };
        let tracker = |own: u64, others: u64| {
            let count = |cell: &FailureCell, failures| CellCount {
                cell: cell.clone(),
                failures,
            };
            let known = KnownFailures {
                cells: vec![count(&cell, own), count(&other, others)],
                demonstrations: Vec::new(),
            };
            let tracker = GoalTracker::beyond(&world, Some(&known), None);
            tracker.expect("no checkpoint").expect("a goal")
        };
        let (mut rare, mut frequent) = (tracker(1, 1000), tracker(1000, 1));
        let shares: Vec<f64> = (0..20).map(|_| rare.share(&world, &episode)).collect();
        assert!(shares.is_sorted_by(|a, b| b < a), "{shares:?}");
        let frequent = frequent.share(&world, &episode);
        assert!(
            shares[0] > 0.99 && frequent < 0.34,
            "{} {frequent}",
            shares[0]
        );
        assert!(rare.take_physics_steps() > 0, "the cell takes replays");
        // A resumed training continues the counts.
        let mut checkpoint = TensorFile::new("goals");
        rare.save(&mut checkpoint);
        let known = KnownFailures::default();
        let mut resumed = GoalTracker::beyond(&world, Some(&known), Some(&checkpoint))
            .expect("sound")
            .expect("a goal");
        assert_eq!(
            resumed.share(&world, &episode),
            rare.share(&world, &episode)
        );
    }
}
