//! Records of runs under declared traffic.

use serde::{Deserialize, Serialize};

use crate::ego::Fault;
use crate::scene::Start;

/// Record of a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RiskRun {
    /// Uniform numbers behind the start.
    pub(super) shares: Vec<f64>,
    /// Seed of the noise.
    pub(super) noise: u64,
    /// Joint actions up to the verdict.
    pub(super) actions: Vec<u32>,
    /// Inputs of V, `[decisions, inputs]`.
    pub(super) inputs: Vec<f32>,
    /// Law of every decision, `[decisions, actions]`.
    pub(super) laws: Vec<f32>,
    /// Component that drew the run.
    pub(super) component: usize,
    /// Density ratio q / p of every component.
    pub(super) ratios: Vec<f64>,
    /// End of the run.
    pub(super) end: RunEnd,
}

/// End of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum RunEnd {
    /// The start is outside X_init, so nothing was played.
    Outside,
    /// The ego kept ψ_ego. `lawful` if it was determined.
    Held { lawful: Option<bool> },
    /// The ego violated ψ_ego.
    Failed(EgoFailure),
    /// The ego or the physics failed. Without its fault, the ego might have failed too.
    Invalid { fault: Fault },
    /// The traffic model gives an action of the run the probability 0.
    Impossible,
}

/// Failure of the ego.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct EgoFailure {
    /// Kind of failure: contact, and the state of the rules.
    pub(super) mode: String,
    /// True if every rule was kept up to the failure.
    pub(super) lawful: bool,
    /// Answer of the reference drivers. `None`: they were not asked.
    pub(super) preventable: Option<DriverAnswer>,
}

/// Answer of the driver models of UN R157 to a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum DriverAnswer {
    /// At least one model has no contact in the ego's place.
    Avoids,
    /// Every model has a contact.
    Fails,
    /// No model applies to such a failure.
    NoAnswer,
}

/// Start, noise and joint actions of a counterexample from elsewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownFailure {
    /// Start in the order of the axes.
    pub start: Start,
    /// Seed of the noise.
    pub noise: u64,
    /// Joint actions, of which the last one is held.
    pub actions: Vec<usize>,
}

impl RiskRun {
    /// Returns the inputs of V at a decision.
    pub(super) fn input(&self, decision: usize) -> &[f32] {
        // A run without decisions has no row, and must not divide.
        let width = self.inputs.len() / self.actions.len().max(1);
        &self.inputs[decision * width..][..width]
    }

    /// Returns the law at a decision.
    pub(super) fn law(&self, decision: usize) -> &[f32] {
        let width = self.laws.len() / self.actions.len().max(1);
        &self.laws[decision * width..][..width]
    }

    /// Returns a natural run without decisions.
    #[cfg(test)]
    pub(super) fn ending(end: RunEnd) -> RiskRun {
        RiskRun {
            shares: Vec::new(),
            noise: 0,
            actions: Vec::new(),
            inputs: Vec::new(),
            laws: Vec::new(),
            component: 0,
            ratios: vec![1.0],
            end,
        }
    }

    /// Returns whether the law of the actions can produce the run.
    pub(super) fn is_possible(&self) -> bool {
        // Component 0 has the ratio 1 as long as the law allows every action.
        self.end != RunEnd::Impossible && self.ratios.first().is_some_and(|it| *it > 0.0)
    }

    /// Returns the fault, if the run is invalid by one.
    pub(super) fn fault(&self) -> Option<&Fault> {
        match &self.end {
            RunEnd::Invalid { fault } => Some(fault),
            _ => None,
        }
    }

    /// Returns the failure, if the run is one.
    pub(super) fn failure(&self) -> Option<&EgoFailure> {
        match &self.end {
            RunEnd::Failed(failure) => Some(failure),
            _ => None,
        }
    }
}

/// Multiplies density ratios by those of an action.
pub(super) fn multiply(ratios: &mut [f64], proposals: &[Vec<f64>], law: &[f64], action: usize) {
    for (ratio, proposal) in ratios.iter_mut().zip(proposals) {
        // No proposal takes an action that the law excludes.
        *ratio = if law[action] > 0.0 {
            *ratio * proposal[action] / law[action]
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_runs_that_the_law_can_produce_are_possible() {
        let with = |ratios: Vec<f64>, end: RunEnd| RiskRun {
            ratios,
            ..RiskRun::ending(end)
        };
        let held = || RunEnd::Held { lawful: None };
        assert!(with(vec![1.0, 0.0], held()).is_possible());
        assert!(!with(vec![0.0, 1.0], held()).is_possible());
        assert!(!with(Vec::new(), held()).is_possible());
        assert!(!with(vec![1.0], RunEnd::Impossible).is_possible());
    }

    #[test]
    fn ratios_are_multiplied_by_what_each_proposal_prefers() {
        let proposals = [vec![0.5, 0.5], vec![0.9, 0.1]];
        let mut ratios = vec![1.0, 2.0];
        multiply(&mut ratios, &proposals, &[0.5, 0.5], 1);
        assert_eq!((ratios[0], (ratios[1] * 10.0).round()), (1.0, 4.0));
        // An action of probability 0 was not taken by nature.
        multiply(&mut ratios, &proposals, &[1.0, 0.0], 1);
        assert_eq!(ratios, [0.0, 0.0]);
    }

    #[test]
    fn inputs_and_laws_of_a_decision_are_its_own() {
        let run = RiskRun {
            actions: vec![0, 1],
            inputs: vec![1.0, 2.0, 3.0, 4.0],
            laws: vec![0.1, 0.2, 0.7, 0.3, 0.3, 0.4],
            ..RiskRun::ending(RunEnd::Outside)
        };
        assert_eq!(
            (run.input(0), run.input(1)),
            (&[1.0, 2.0][..], &[3.0, 4.0][..])
        );
        assert_eq!(run.law(1), [0.3, 0.3, 0.4]);
    }
}
