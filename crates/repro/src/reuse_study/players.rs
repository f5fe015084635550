//! Ados that play against an ego of the reuse study.

use super::{CONDITIONAL, CONDITIONAL_TRIES, HELD_BUDGETS, SeedPolicies, held_word};
use brakecheck::adversary::{
    Ado, BestOfN, EvalRequest, Heuristic, best_constant, eval, other_members,
};
use brakecheck::experiment::{TestStarts, Watch};
use brakecheck::rl::Policy;
use brakecheck::run_dir::{Row, RunDir, RunError, Stored};
use brakecheck::search::{
    Hold, Method, Mutate, SWITCHES, SearchRequest, Searched, Switches, search,
};
use brakecheck::world::{EgoSample, Family, Scenario};

/// Ego with the starts on which all ados play.
pub(super) struct Player<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) ego: &'a str,
    pub(super) starts: &'a TestStarts,
    pub(super) watch: &'a Watch<'a>,
}

impl Player<'_> {
    /// Returns the rows of a training seed.
    pub(super) fn ados(
        &self,
        trio: &SeedPolicies,
        family: &Family,
        (member, told): (&EgoSample, &str),
        tries: u64,
    ) -> Result<Vec<Row>, RunError> {
        let seed = trio.conditional.manifest().seed;
        let policy = trio.conditional.conditioned_policy(member)?;
        let others = other_members(&trio.conditional, family, member.plant)?;
        // Later tries may use other members, in case the identified member is wrong.
        let tried = BestOfN {
            request: self.request(Ado::Trained(&*policy, seed)),
            policy: &*policy,
            others: &others,
            tries,
        };
        let mut rows = vec![
            self.trained("nominal ado", &*trio.nominal.policy()?, seed),
            self.trained("wide", &*trio.wide.policy()?, seed),
            self.conditional(CONDITIONAL, trio, (member, told))?,
            Row {
                context: Some(told.to_owned()),
                ..called(CONDITIONAL_TRIES, tried.run(self.watch).evaluated.row)
            },
        ];
        // The wide ado has the same learner as the nominal ado and would look the same.
        rows[1].method = "dqn, wide".to_owned();
        Ok(rows)
    }

    /// Returns the row of a conditional ado with the parameters of a member.
    pub(super) fn conditional(
        &self,
        word: &str,
        trio: &SeedPolicies,
        (member, told): (&EgoSample, &str),
    ) -> Result<Row, RunError> {
        let seed = trio.conditional.manifest().seed;
        let policy = trio.conditional.conditioned_policy(member)?;
        Ok(Row {
            context: Some(told.to_owned()),
            ..self.trained(word, &*policy, seed)
        })
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
        ados.extend([Ado::Held, Ado::Random]);
        let rows = ados.into_iter();
        let mut rows: Vec<Row> = rows
            .map(|ado| eval(&self.request(ado), self.watch).row)
            .collect();
        rows.push(best_constant(self.scenario, self.ego, self.starts, self.watch).row);
        let most = HELD_BUDGETS[HELD_BUDGETS.len() - 1];
        // One search with the largest budget contains the smaller ones.
        let held = self.searched(Hold.into(), most);
        for budget in HELD_BUDGETS {
            rows.push(called(
                &held_word(budget),
                held.row_within(&Hold.into(), budget),
            ));
        }
        // Mutation gets as many runs per start as the ado with several tries.
        let mutated = self.searched(Mutate(&stored).into(), tries);
        rows.push(called(&format!("mutate, {tries}"), mutated.row));
        // The search comes last, as `ReuseStudy::meet` expects.
        rows.push(self.searched(Switches(SWITCHES).into(), 0).row);
        Ok(rows)
    }

    fn request<'b>(&'b self, ado: Ado<'b>) -> EvalRequest<'b> {
        EvalRequest {
            scenario: self.scenario,
            ego: self.ego,
            ado,
            starts: self.starts,
        }
    }

    fn trained(&self, word: &str, policy: &dyn Policy, seed: u64) -> Row {
        let request = self.request(Ado::Trained(policy, seed));
        called(word, eval(&request, self.watch).row)
    }

    fn searched(&self, method: Method<'_>, budget: u64) -> Searched {
        let request = SearchRequest {
            scenario: self.scenario,
            ego: self.ego,
            method,
            budget,
            starts: self.starts,
        };
        search(&request, self.watch)
    }
}

/// Returns the row under another name of the ado.
pub(super) fn called(word: &str, row: Row) -> Row {
    Row {
        ado: word.into(),
        ..row
    }
}
