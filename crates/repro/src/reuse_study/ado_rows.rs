//! Ados that play against an ego of the reuse study.

use super::{HELD_BUDGETS, SeedPolicies, WIDE, WIDE_TRIES, held_word};
use brakecheck::adversary::Ado;
use brakecheck::adversary::Heuristic;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch};
use brakecheck::rl::Policy;
use brakecheck::run_dir::Stored;
use brakecheck::run_dir::{Row, RunDir, RunError};
use brakecheck::search::{
    Adversary, BASELINES, Experiment, Guided, GuidingPolicy, Hold, Mutate, SWITCHES, Search,
    SearchRequest, search,
};
use brakecheck_experiment::adversary::rollout::eval;

/// Ego with the starts on which all ados play.
pub(super) struct EgoOnStarts<'a> {
    pub(super) ego: &'a EgoUnderTest,
    pub(super) starts: &'a TestStarts,
    pub(super) watch: &'a Watch<'a>,
}

impl EgoOnStarts<'_> {
    /// Returns the rows of a training seed.
    pub(super) fn ados(&self, policies: &SeedPolicies, tries: u64) -> Result<Vec<Row>, RunError> {
        // Both ados of the pair are trained with this seed.
        let seed = policies.wide.manifest().seed;
        let policy = policies.wide.policy()?;
        let tried = Search {
            method: Guided(GuidingPolicy(&*policy)).into(),
            budget: tries,
        };
        let mut rows = vec![
            self.trained("nominal ado", &*policies.nominal.policy()?, seed),
            self.trained(WIDE, &*policy, seed),
        ];
        // The wide ado has the same learner as the nominal ado and would look the same.
        rows[1].method = format!("{}, {WIDE}", rows[0].method);
        let tried = self.rows(vec![&tried]).into_iter();
        rows.extend(tried.map(|row| Row {
            // A search names no training, although this one plays a trained policy.
            train_seed: Some(seed),
            ..called(WIDE_TRIES, row)
        }));
        Ok(rows)
    }

    /// Returns the rows of all untrained ados and searches.
    pub(super) fn rivals(
        &self,
        run: &RunDir,
        heuristic: Option<&Heuristic>,
        tries: u64,
    ) -> Result<Vec<Row>, RunError> {
        let stored: Stored = run.counterexamples()?;
        let mut ados = vec![Ado::Replays(&stored, 1), Ado::Replays(&stored, 10)];
        ados.extend(heuristic.map(Ado::Heuristic));
        let ados = ados.iter().map(|ado| ado as &dyn Adversary);
        let mut rows = self.rows(ados.chain(BASELINES).collect());
        // The budgets rise, so the last one is the largest.
        let most = HELD_BUDGETS[HELD_BUDGETS.len() - 1];
        // One search with the largest budget contains the smaller ones.
        let request = SearchRequest {
            scenario: self.ego.scenario(),
            ego: self.ego.name(),
            method: Hold.into(),
            budget: most,
            starts: self.starts,
        };
        let held = search(&request, self.watch);
        for budget in HELD_BUDGETS {
            rows.push(called(
                &held_word(budget),
                held.row_within(&request, budget),
            ));
        }
        // Mutation gets as many runs per start as the ado with several tries.
        let mutated = self.rows(vec![&Search {
            method: Mutate(&stored).into(),
            budget: tries,
        }]);
        let name = format!("mutate, {tries}");
        rows.extend(mutated.into_iter().map(|row| called(&name, row)));
        // The search comes last, because the other rows are compared with it.
        rows.extend(self.rows(vec![&Search::switches(SWITCHES)]));
        Ok(rows)
    }

    fn rows(&self, adversaries: Vec<&dyn Adversary>) -> Vec<Row> {
        let experiment = Experiment {
            ego: self.ego,
            adversaries,
            starts: self.starts,
        };
        experiment.rows(self.watch)
    }

    fn trained(&self, word: &str, policy: &dyn Policy, seed: u64) -> Row {
        let request = self.ego.against(Ado::Trained(policy, seed), self.starts);
        called(word, eval(&request, self.watch).row)
    }
}

/// Returns the row under another name of the ado.
fn called(word: &str, row: Row) -> Row {
    Row {
        ado: word.into(),
        ..row
    }
}
