//! Writing counterexamples of an evaluation, once its rows are printed.
//!
//! Rows cost time and files can be refused: a full disk must not take the rows
//! with it.

use std::path::Path;

use super::eval::{EvalArgs, OPTIMAL, optimal};
use super::told::Playing;
use super::{Failure, NamedEgo, talk};
use crate::campaign::{Ado, EvalRequest, Evaluated, TestStarts, Tried, Tries, keep, keep_played};
use crate::testbench::Testbench;

/// Whose counterexamples are written.
pub(super) enum Found {
    /// The trained ado's.
    Trained(Evaluated),
    /// Those of the trained ado with several tries per start.
    ByTries(Tried),
    /// Those of the best ado of a grid world.
    Optimal(Evaluated),
}

/// Counterexamples of one ego that are not yet written.
pub(super) struct Pending<'a> {
    pub ego: &'a NamedEgo,
    pub found: Found,
    pub playing: Playing,
    /// The ego's own starts, where it has others.
    pub starts: Option<TestStarts>,
}

impl Pending<'_> {
    /// Plays them again and writes them into a directory.
    pub(super) fn keep(
        &self,
        dir: &Path,
        args: &EvalArgs,
        starts: &TestStarts,
        train_seed: u64,
    ) -> Result<(), Failure> {
        let ego = self.ego;
        let trained = EvalRequest {
            scenario: &ego.scenario,
            ego: &ego.name,
            ado: Ado::Trained(&*self.playing.policy, train_seed),
            starts: self.starts.as_ref().unwrap_or(starts),
        };
        let most = args.keep_most;
        let (evaluated, files) = match &self.found {
            Found::Trained(evaluated) => {
                let files = keep(&trained, &ego.change, evaluated, dir, most)?;
                (evaluated, files)
            }
            Found::ByTries(Tried { evaluated, winners }) => {
                let tries = Tries {
                    request: trained,
                    policy: &*self.playing.policy,
                    others: &self.playing.others,
                    tries: args.tries,
                };
                let mut again = |bench: &mut Testbench, index: usize| {
                    tries.play(bench, index, winners[index].unwrap_or(0))
                };
                let files = keep_played(&trained, &ego.change, evaluated, dir, most, &mut again)?;
                (evaluated, files)
            }
            Found::Optimal(evaluated) => {
                let whole = ego.scenario.fully_observed();
                let Some((whole, grid)) = whole.as_ref().and_then(|s| Some((s, s.grid()?))) else {
                    return Ok(());
                };
                let policy = optimal(whole, grid);
                let policy = policy.map_err(|error| Failure::fault(error.to_string(), None))?;
                let request = EvalRequest {
                    scenario: whole,
                    ado: Ado::Rule(&policy, OPTIMAL.0, OPTIMAL.1),
                    ..trained
                };
                let files = keep(&request, &ego.change, evaluated, dir, most)?;
                (evaluated, files)
            }
        };
        talk::say(&format!(
            "kept {} of {} counterexamples of `{}` in {}",
            files.len(),
            evaluated.row.successes,
            ego.name,
            dir.display()
        ));
        Ok(())
    }
}
