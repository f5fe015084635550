//! Ados against which an ego is hardened: trained ones, kept crashes and a search.

use std::path::Path;

use crate::adversary::{Ado, eval};
use crate::experiment::{EgoUnderTest, EpisodeLoop, TestStarts, Watch};
use crate::population::PopulationDir;
use crate::risk::KnownFailure;
use crate::rl::Policy;
use crate::run_dir::{RunDir, RunError};
use crate::search::{SearchRequest, Switches, search};
use crate::stats::{Outcomes, StartOutcome};
use crate::testbench::{Aftermath, NoisyStart, Replay};

/// Trained ado with its name in reports.
pub struct HardeningAdo {
    /// Name in reports.
    pub name: String,
    /// Policy.
    pub policy: Box<dyn Policy>,
    /// Seed of its training.
    pub seed: u64,
}

impl HardeningAdo {
    /// Returns the trained ados of a run, or of all members of a population or a league.
    ///
    /// The directory may start programs if `allowed`.
    ///
    /// # Errors
    /// A training is not finished, or the directory is damaged.
    pub fn of_run(path: &Path, allowed: bool) -> Result<Vec<HardeningAdo>, RunError> {
        let of = |mut run: RunDir, name: String| -> Result<HardeningAdo, RunError> {
            run.allow_programs(allowed);
            Ok(HardeningAdo {
                name,
                policy: run.policy()?,
                seed: run.manifest().seed,
            })
        };
        let shown = path.display();
        if !PopulationDir::is_population(path) {
            return Ok(vec![of(RunDir::open(path)?, shown.to_string())?]);
        }
        let population = PopulationDir::open(path)?;
        let members = population.members(population.manifest().members.len())?;
        let named = members.into_iter().enumerate();
        named
            .map(|(number, run)| of(run, format!("{shown}, member {number:03}")))
            .collect()
    }
}

/// Ados against which an ego is hardened.
#[derive(Default)]
pub struct AdoSet {
    /// Trained ados.
    pub trained: Vec<HardeningAdo>,
    /// Kept crashes, which are played again.
    pub kept: Vec<KnownFailure>,
    /// Most switches of action of a search of every start, if any.
    pub switches: Option<usize>,
}

impl AdoSet {
    /// Returns the outcome of each start against all ados and none. `None`: stopped.
    pub(super) fn outcomes(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Vec<StartOutcome>> {
        let members = [SetMember::NoAdo].into_iter().chain(self.members());
        self.outcomes_against(members, ego, starts, watch)
    }

    /// Returns the outcome of each start against all ados. `None`: stopped.
    ///
    /// A search leaves the ego alone out, which costs as much as an ado and finds less.
    pub(super) fn outcomes_of_search(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Vec<StartOutcome>> {
        self.outcomes_against(self.members(), ego, starts, watch)
    }

    /// Plays members in order, each on the starts that no earlier one solves.
    fn outcomes_against(
        &self,
        members: impl Iterator<Item = SetMember>,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Vec<StartOutcome>> {
        let mut open = starts.clone();
        let mut all = vec![StartOutcome::NotReached; starts.starts.len()];
        for ado in members {
            let row = self.row(ado, ego, &open, watch)?;
            for (at, outcome) in row.iter().enumerate() {
                // A later ado may solve a start, or find that the ego does not run.
                if open.trivial[at] {
                    continue;
                }
                all[at] = merged(all[at], *outcome);
                // The mark keeps later members away from it, of which a search costs
                // most.
                open.trivial[at] = all[at] == StartOutcome::Solved;
            }
        }
        (!watch.stopped()).then_some(all)
    }

    /// Returns the failures against a trained ado alone. `None`: stopped.
    pub(super) fn failing_by(
        &self,
        trained: usize,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<usize> {
        let outcomes = self.row(SetMember::Trained(trained), ego, starts, watch)?;
        Some(outcomes.count(StartOutcome::Solved))
    }

    /// Plays the kept crashes again, and returns their outcomes. `None`: stopped.
    pub(super) fn kept_outcomes(
        &self,
        ego: &EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Option<Vec<StartOutcome>> {
        let bench = || ego.scenario().bench();
        let work = EpisodeLoop::uncounted(watch);
        let outcomes = work.each(&self.kept, bench, |bench, kept, index| {
            let mut ado = Replay::holding(&kept.actions);
            let from = NoisyStart {
                start: &kept.start,
                noise: kept.noise,
            };
            // The motion after the verdict changes no outcome.
            let episode = watch.play(bench, from, index, &mut ado, Aftermath::Skip);
            Some(match StartOutcome::from(&episode.verdict) {
                // An ado that now breaks its rule shows nothing about the ego.
                StartOutcome::RuleViolation => StartOutcome::NotReached,
                other => other,
            })
        });
        (!watch.stopped()).then(|| outcomes.into_iter().flatten().collect())
    }

    fn members(&self) -> impl Iterator<Item = SetMember> + use<> {
        let trained = (0..self.trained.len()).map(SetMember::Trained);
        let search = self.switches.map(SetMember::Search);
        // A trained ado is cheaper than a search.
        trained.chain(search)
    }

    fn row(
        &self,
        player: SetMember,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<Outcomes> {
        // Nothing is left to play where every start is solved.
        if starts.trivial.iter().all(|trivial| *trivial) {
            return Some(
                vec![StartOutcome::Trivial; starts.starts.len()]
                    .into_iter()
                    .collect(),
            );
        }
        let row = match player {
            SetMember::NoAdo => eval(&ego.against(Ado::Neutral, starts), watch).row,
            SetMember::Trained(at) => {
                let ado = &self.trained[at];
                let played = Ado::Trained(&*ado.policy, ado.seed);
                eval(&ego.against(played, starts), watch).row
            }
            SetMember::Search(most) => {
                let request = SearchRequest {
                    scenario: ego.scenario(),
                    ego: ego.name(),
                    method: Switches(most).into(),
                    // This method is limited by its switches alone.
                    budget: 0,
                    starts,
                };
                search(&request, watch).row
            }
        };
        (!watch.stopped()).then_some(row.solved)
    }
}

/// Member of a set.
#[derive(Clone, Copy, Debug)]
enum SetMember {
    NoAdo,
    Trained(usize),
    Search(usize),
}

/// Returns the outcome of a start against two ados.
fn merged(one: StartOutcome, other: StartOutcome) -> StartOutcome {
    use StartOutcome::{Invalid, NotReached, Solved};
    match (one, other) {
        (Solved, _) | (_, Solved) => Solved,
        // An ego that did not run against one ado has not withstood all of them.
        (Invalid, _) | (_, Invalid) => Invalid,
        (NotReached, other) => other,
        (one, _) => one,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_is_kept_only_if_every_ado_fails_on_it() {
        use StartOutcome::{Invalid, NotReached, Solved, Unsolved};
        for (one, other, both) in [
            (NotReached, Unsolved, Unsolved),
            (Unsolved, Unsolved, Unsolved),
            (Unsolved, Solved, Solved),
            (Solved, Invalid, Solved),
            (Unsolved, Invalid, Invalid),
            (Invalid, Unsolved, Invalid),
        ] {
            assert_eq!(merged(one, other), both, "{one:?} {other:?}");
        }
    }
}
