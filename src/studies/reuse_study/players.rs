//! Who plays against one ego of the study of reuse.

use super::{CONDITIONAL, CONDITIONAL_TRIES, HELD_BUDGETS, Trio, held_word};
use crate::adversary::{
    Ado, EvalRequest, Heuristic, Tries, best_constant, count_solved, eval, other_members,
};
use crate::experiment::{TestStarts, Watch};
use crate::rl::Policy;
use crate::run_dir::{Row, RunDir, RunError, Stored};
use crate::search::{
    Found, Hold, Method, Mutate, SWITCHES, SearchRequest, Searched, Switches, count_contacts,
    search,
};
use crate::stats::StartOutcome;
use crate::world::{Family, Member, Scenario};

/// One ego and the starts on which everybody meets it.
pub(super) struct Player<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) ego: &'a str,
    pub(super) starts: &'a TestStarts,
    pub(super) watch: &'a Watch<'a>,
}

impl Player<'_> {
    /// The rows of one training seed.
    pub(super) fn ados(
        &self,
        trio: &Trio,
        family: &Family,
        (member, told): (&Member, &str),
        tries: u64,
    ) -> Result<Vec<Row>, RunError> {
        let seed = trio.conditional.manifest().seed;
        let policy = trio.conditional.policy_told(member)?;
        let others = other_members(&trio.conditional, family, member.plant)?;
        let tried = Tries {
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
        rows[1].method = "dqn, wide".to_owned();
        Ok(rows)
    }

    /// The row of a conditional ado that takes the ego for a member.
    pub(super) fn conditional(
        &self,
        word: &str,
        trio: &Trio,
        (member, told): (&Member, &str),
    ) -> Result<Row, RunError> {
        let seed = trio.conditional.manifest().seed;
        let policy = trio.conditional.policy_told(member)?;
        Ok(Row {
            context: Some(told.to_owned()),
            ..self.trained(word, &*policy, seed)
        })
    }

    /// The rows of everybody who was not trained.
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
        let held = self.searched(Hold.into(), most);
        for budget in HELD_BUDGETS {
            rows.push(called(&held_word(budget), cut(&held, budget)));
        }
        let mutated = self.searched(Mutate(&stored).into(), tries);
        rows.push(called(&format!("mutate, {tries}"), mutated.row));
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

/// A row under another word.
pub(super) fn called(word: &str, row: Row) -> Row {
    Row {
        ado: word.to_owned(),
        ..row
    }
}

/// The row of a search that stopped after fewer simulations per start.
fn cut(searched: &Searched, budget: u64) -> Row {
    let marks = searched.row.solved.iter().zip(&searched.found);
    let within = |found: &Found| found.within(budget);
    let solved = marks.map(|(mark, found)| match (mark, found) {
        (StartOutcome::Solved, Some(found)) if !within(found).1 => StartOutcome::Unsolved,
        (mark, _) => *mark,
    });
    let mut row = searched.row.clone();
    row.solved = solved.collect();
    count_solved(&mut row);
    let spent: u64 = searched.found.iter().flatten().map(|f| within(f).0).sum();
    row.sims_per_start = spent as f64 / row.starts.max(1) as f64;
    let found = searched.found.iter().flatten();
    count_contacts(&mut row, found.filter(|found| within(found).1));
    row.method = Method::from(Hold).text(budget, None);
    row.anytime.clear();
    row
}
