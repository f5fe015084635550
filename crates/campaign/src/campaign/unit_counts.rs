//! Counts of a unit of a campaign, over the rows of its starts.

use std::collections::BTreeMap;

use super::dir::PlanDir;
use super::plan::Unit;
use super::row::SummaryFields;
use crate::evaluation::{GateContact, GateEgo};
use crate::preventability::Avoidability;
use crate::scene::Dynamics;
use crate::stats::{Outcomes, StartOutcome};

/// Counts over the rows of a unit.
pub(super) struct UnitCounts {
    /// Outcome per start.
    pub(super) outcomes: Vec<StartOutcome>,
    /// Avoidability of the failure per start.
    pub(super) avoidability: Vec<Avoidability>,
    /// Contacts of the successes, by position of the start.
    pub(super) success_contacts: BTreeMap<usize, GateContact>,
    pub(super) contacts: usize,
    pub(super) simulations: u64,
    pub(super) physics_steps: u64,
}

impl UnitCounts {
    /// Returns an empty tally.
    pub(super) fn of(unit: &Unit) -> UnitCounts {
        UnitCounts {
            outcomes: vec![StartOutcome::NotReached; unit.starts],
            avoidability: vec![Avoidability::Unknown; unit.starts],
            success_contacts: BTreeMap::new(),
            contacts: 0,
            simulations: 0,
            physics_steps: 0,
        }
    }

    /// Counts a row.
    pub(super) fn count(&mut self, row: &SummaryFields) {
        let start = row.start as usize;
        if let Some(one) = self.outcomes.get_mut(start) {
            *one = row.outcome;
        }
        if let Some(one) = self.avoidability.get_mut(start) {
            *one = Avoidability::of_row(row.preventable, row.unavoidable);
        }
        // Contacts without a success, such as those of a foul, have no part in the statistics.
        if let Some(closing_mps) = row.closing_mps
            && row.outcome == StartOutcome::Solved
        {
            let contact = GateContact {
                closing_mps,
                ego_delta_v_mps: row.ego_delta_v_mps,
            };
            self.success_contacts.insert(start, contact);
        }
        self.physics_steps += row.physics_steps;
        // As in rows of other verbs, no rate counts an invalid start.
        if row.outcome != StartOutcome::Invalid {
            self.contacts += usize::from(row.contact);
            self.simulations += row.simulations;
        }
    }

    pub(super) fn of_kind(&self, kind: StartOutcome) -> usize {
        let outcomes = self.outcomes.iter();
        outcomes.filter(|one| **one == kind).count()
    }

    /// Returns the results in the form of a gate.
    pub(super) fn gated<'a>(&'a self, name: &'a str) -> GateEgo<'a> {
        GateEgo {
            name,
            outcomes: &self.outcomes,
            contacts: &self.success_contacts,
        }
    }

    /// Returns the outcomes in the form of rows of other verbs.
    pub(super) fn marks(&self) -> Outcomes {
        self.outcomes.iter().copied().collect()
    }
}

/// Returns the plant of a unit, as in rows.
pub(super) fn plant(dir: &PlanDir, unit: &Unit) -> Dynamics {
    match unit.ego.change.plant {
        // A changed ego may name its own plant.
        Some(plant) => plant.into(),
        None => dir.played(unit).plant(),
    }
}
