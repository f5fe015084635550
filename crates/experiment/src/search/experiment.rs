//! Experiment: adversaries against an ego, from the same test starts.
//!
//! Policies and searches are adversaries alike. Each gives a cell.

use super::adversary_player::Adversary;
use super::cell::ExperimentCell;
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::Row;

/// Adversaries against an ego, from the same test starts.
#[derive(Clone)]
pub struct Experiment<'a> {
    /// Ego under test, in its world.
    pub ego: &'a EgoUnderTest,
    /// Adversaries, in the order of their cells.
    pub adversaries: Vec<&'a dyn Adversary>,
    /// Test starts.
    pub starts: &'a TestStarts,
}

impl Experiment<'_> {
    /// Plays every adversary in order.
    ///
    /// If `watch` stops, starts that were not reached are marked as such in the rows.
    pub fn run(&self, watch: &Watch<'_>) -> Vec<ExperimentCell> {
        let adversaries = self.adversaries.iter();
        let cells = adversaries.filter_map(|one| one.play(self.ego, self.starts, watch));
        cells.collect()
    }

    /// Plays every adversary in order and returns the rows alone.
    pub fn rows(&self, watch: &Watch<'_>) -> Vec<Row> {
        self.run(watch).into_iter().map(|cell| cell.row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::adversary_player::{BASELINES, BestSwitch, Search};
    use super::super::cell::JUDGED;
    use super::super::list::Uniform;
    use super::*;
    use crate::adversary::Ado;
    use crate::experiment::test_starts;
    use crate::run_dir::AdversaryId;
    use crate::sim::PlantKind;
    use crate::stats::StartOutcome;
    use crate::world::Scenario;

    #[test]
    fn successes_of_policies_and_searches_are_played_again_from_their_cells() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let weak = world.with(&world.reuse()["weak brakes"]).expect("it fits");
        let ego = EgoUnderTest::nominal(&weak.on(PlantKind::Kinematic));
        let watch = Watch::unwatched();
        let starts = test_starts(ego.scenario(), 77, 12, &watch).expect("not stopped");
        let others: [&dyn Adversary; 3] = [&Ado::Neutral, &BestSwitch, &Search::switches(1)];
        let experiment = Experiment {
            ego: &ego,
            adversaries: BASELINES.into_iter().chain(others).collect(),
            starts: &starts,
        };
        let cells = experiment.run(&watch);
        assert_eq!(cells.len(), 6);
        let mut bench = ego.scenario().bench();
        for cell in &cells {
            assert_eq!(cell.solved().len(), cell.row.successes, "{}", cell.row.ado);
            for index in cell.solved() {
                let episode = cell.replay(&mut bench, index);
                assert!(episode.verdict.is_success(), "{} {index}", cell.row.ado);
            }
        }
        let contacts = cells[5].row.success_contacts.as_ref().expect("successes");
        assert!(contacts.judged > 0 && contacts.avoided <= contacts.judged);
        let sample = cells[5].row.successes.min(JUDGED);
        assert_eq!(contacts.judged + contacts.not_judged, sample);
        let neutral = &cells[3];
        assert_eq!(neutral.adversary, AdversaryId::Neutral);
        // Starts on which the ego fails by itself are left out.
        assert!(neutral.solved().is_empty() && neutral.explain_first().is_none());
        assert!(cells[5].row.successes > 0 && cells[5].explain_first().is_some());
    }

    #[test]
    fn a_search_without_a_budget_breaks_no_rule() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let ego = EgoUnderTest::nominal(&world.on(PlantKind::Kinematic));
        let watch = Watch::unwatched();
        let starts = test_starts(ego.scenario(), 77, 6, &watch).expect("not stopped");
        let search = Search {
            method: Uniform.into(),
            budget: 0,
        };
        let cell = search.play(&ego, &starts, &watch).expect("it applies");
        for (outcome, trivial) in cell.outcomes().iter().zip(&starts.trivial) {
            let expected = if *trivial {
                StartOutcome::Trivial
            } else {
                StartOutcome::NotReached
            };
            assert_eq!(*outcome, expected);
        }
    }
}
