//! Gates of a campaign: every other ego against the baseline, under the same ado.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::dir::PlanDir;
use super::plan::Unit;
use super::unit_counts::{UnitCounts, plant};
use crate::evaluation::{DecidedGate, Gate, GateOn, NotRun};
use crate::run_dir::{AdversaryId, adversary_keys};
use crate::scene::Dynamics;

/// Decided gate of an ego in a world, under one ado.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnitGate {
    /// Name of the world.
    pub world: String,
    /// The plant.
    pub plant: Dynamics,
    /// Ado, which JSON has as `adversary` and with its caption as `ado`.
    #[serde(flatten, serialize_with = "adversary_keys::serialize")]
    pub ado: AdversaryId,
    /// Seed of its training.
    pub train_seed: Option<u64>,
    /// Comparison with the baseline ego, and its decision.
    #[serde(flatten)]
    pub decided: DecidedGate,
}

impl UnitGate {
    /// Decides the gate of every unit whose ego is not the baseline.
    pub(super) fn all(
        dir: &PlanDir,
        units: &[(&Unit, &UnitCounts)],
        baseline: &str,
        on: &[GateOn],
    ) -> Vec<UnitGate> {
        let others = units.iter().filter(|(unit, _)| unit.ego.name != baseline);
        others
            .filter_map(|(unit, counts)| {
                let is_before = |(other, _): &&(&Unit, &UnitCounts)| {
                    // The ado contains its training, so each training is compared with
                    // itself.
                    other.ego.name == baseline && other.world == unit.world && other.ado == unit.ado
                };
                let (_, before) = units.iter().find(is_before)?;
                let mut gate = Gate::of(counts.gated(&unit.ego.name), before.gated(baseline));
                // The decision asks for the labels of newly failing starts only.
                let starts: Vec<usize> = gate.newly_failing.iter().map(|it| it.start).collect();
                gate.label(starts.iter().map(|start| counts.avoidability[*start]));
                Some(UnitGate {
                    world: dir.world(unit).name().to_owned(),
                    plant: plant(dir, unit),
                    ado: unit.ado.id.clone(),
                    train_seed: dir.plan().train_seed(&unit.ado),
                    decided: gate.decided(on),
                })
            })
            .collect()
    }

    /// Returns whether no start has a result on both egos with every rule kept.
    pub fn is_unanswered(&self) -> bool {
        self.decided.gate.is_unanswered()
    }

    /// Returns whether an open gate has starts that are no plain comparison.
    pub fn is_noteworthy(&self) -> bool {
        let gate = &self.decided.gate;
        let NotRun { ego, baseline } = gate.not_run;
        let unlike = gate.more_severe.len() + gate.no_answer.len() + ego + baseline;
        unlike > 0 || gate.is_unanswered()
    }
}

impl Display for UnitGate {
    /// Writes the world, the ado, the comparison and the decision in one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "gate: {}, {}", self.world, self.ado)?;
        if let Some(seed) = self.train_seed {
            write!(f, " {seed}")?;
        }
        write!(f, ": {}", self.decided.lines().join("; "))
    }
}
