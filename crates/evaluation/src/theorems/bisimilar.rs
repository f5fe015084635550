//! Definition 5 and Theorem 3 on a grid.
//!
//! A bisimulation relates starts of two grids. A counterexample from one start is then a
//! counterexample from the other.

use std::collections::HashMap;

use serde::Serialize;

use super::TheoremsError;
use super::compare::Witness;
use super::nearby::TheoremOutcome;
use super::plays::{ROUNDING, not_solved};
use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::grid_solver::bisimulation::{Bisimulation, coarse};
use crate::grid_solver::exact::Game;
use crate::grid_solver::game_graph::{Depth, GameGraph};
use crate::grid_solver::values::ValueTable;
use crate::rl::{LearnerRng, Policy};
use crate::scene::grid::{GridWorld, Position, start_of};
use crate::testbench::{Actor, Aftermath, Episode, PolicyActor, Replay, Testbench, play};
use crate::world::GridScenario;

/// Largest number of start pairs played inside and outside the relation.
const MOST_PLAYED: usize = 900;
/// Seed of the selection if there are more start pairs.
const CHOICE: u64 = 5;

/// Result of Theorem 3 between a grid and a changed grid.
#[derive(Clone, Debug, Serialize)]
pub struct Theorem3 {
    /// Name of the change.
    pub changed: String,
    /// ε of the relation.
    pub epsilon: f64,
    /// Pairs of states within ε.
    pub candidates: usize,
    /// Pairs of states in the relation.
    pub related: usize,
    /// Sweeps of the fixpoint iteration.
    pub sweeps: usize,
    /// Smallest ε that relates a start pair. `None`: none, or not computed.
    pub least_epsilon: Option<f64>,
    /// Start pairs: a start of the changed grid and the coarse start that contains it.
    pub starts: usize,
    /// Related start pairs.
    pub related_starts: usize,
    /// Starts of the unchanged grid from which the optimal ado makes the ego fail.
    pub(crate) capturable: usize,
    /// Such starts from which the trained ado found a counterexample.
    ///
    /// The ado has converged if both numbers are equal.
    pub found: usize,
    /// Smallest τ of the trained ado's counterexamples on the unchanged grid.
    pub tau: Option<f64>,
    /// Related start pairs with a counterexample from the unchanged start and ε < τ.
    pub inside: ReplayedOnGrid,
    /// Unrelated start pairs with a counterexample from the unchanged start.
    pub outside: ReplayedOnGrid,
    /// Broken promises of the theorem, each of which is a bug.
    pub misses: usize,
    /// Overall result of the check.
    pub outcome: TheoremOutcome,
}

/// Counterexamples that were played on the changed grid.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct ReplayedOnGrid {
    /// Start pairs played.
    pub pairs: usize,
    /// Runs in which the ego failed under the same actions (Definition 5).
    pub replayed: usize,
    /// Runs in which the ego failed against the policy acting on the unchanged cells.
    pub by_cell: usize,
    /// Runs in which the ego failed against the policy observing the changed grid.
    pub own_view: usize,
}

/// Returns the relations on which Theorem 3 is tested: by ε, below `tau`.
///
/// Distances are multiples of a fine cell, or of half of one, so no other ε gives another
/// relation. `None`: the grids differ in size, horizon or the ado's moves.
pub fn bisimulations(
    nominal: GridScenario<'_>,
    changed: GridScenario<'_>,
    tau: f64,
) -> Option<Vec<Bisimulation>> {
    let games = [nominal, changed].map(|grid| Game::of(grid.world()));
    let [first, second] = &games;
    let comparable = first.arena.size == second.arena.size
        && first.steps == second.steps
        // Equal moves are needed, because a relation pairs equal actions.
        && first.moves == second.moves;
    // Both grids are multiples of this common fine cell.
    let refine = first.arena.refine * second.arena.refine;
    // Centres of cells that are cut into an even and an odd number are half of it apart.
    let parts = if (first.arena.refine + second.arena.refine).is_multiple_of(2) {
        refine
    } else {
        2 * refine
    };
    let epsilons = (0..).map(|steps| f64::from(steps) / f64::from(parts));
    // Below τ alone: Theorem 3 promises nothing for a greater distance.
    let below = epsilons.take_while(|epsilon| *epsilon < tau);
    let greatest = below.map(|epsilon| Bisimulation::greatest(first, second, epsilon));
    // The relations are lazy, so nothing is computed for incomparable grids.
    comparable.then(|| greatest.collect())
}

/// Checks Theorem 3 on a relation. `policy` was trained on `nominal`.
///
/// # Errors
/// The unchanged grid cannot be solved.
pub fn theorem_3(
    nominal: GridScenario<'_>,
    name: &str,
    changed: GridScenario<'_>,
    policy: &dyn Policy,
    relation: &Bisimulation,
) -> Result<Theorem3, TheoremsError> {
    let worlds = [nominal.world(), changed.world()];
    let trial = GridComparison {
        nominal: found(nominal, policy),
        worlds,
        games: worlds.map(Game::of),
        changed,
        policy,
        epsilon: relation.epsilon(),
    };
    let (inside, outside): (Vec<Position>, Vec<Position>) = trial
        .starts()
        .partition(|both| relation.relates(trial.coarse(*both), *both));
    let starts = inside.len() + outside.len();
    let related_starts = inside.len();
    // A policy on coarse cells acts alike in both grids only for a relation by cell.
    let (inside, unkept) = trial.carried(inside, relation.is_by_cell(), true);
    // Unrelated pairs are played for comparison, and the theorem promises nothing there.
    let (outside, _) = trial.carried(outside, false, false);
    let taus = trial.nominal.values().map(|found| found.tau);
    let [first, second] = &trial.games;
    let mut checked = Theorem3 {
        changed: name.to_owned(),
        epsilon: relation.epsilon(),
        candidates: relation.candidates(),
        related: relation.len(),
        sweeps: relation.sweeps(),
        // No two cells are farther apart than the grid is wide, so the search ends there.
        least_epsilon: Bisimulation::least_epsilon(first, second, f64::from(first.arena.size)),
        starts,
        related_starts,
        capturable: capturable(nominal)?,
        found: trial.nominal.len(),
        tau: taus.min_by(f64::total_cmp),
        inside,
        outside,
        misses: unkept,
        outcome: TheoremOutcome::Holds,
    };
    checked.outcome = checked.judged();
    Ok(checked)
}

/// Returns the number of all starts from which a lawful ado makes the ego fail.
fn capturable(scenario: GridScenario<'_>) -> Result<usize, TheoremsError> {
    let world = scenario.world();
    let starts = world.spec().arena.starts();
    let graph = GameGraph::explore_from(world, scenario.rulebook(), Depth::Sign, starts)
        .map_err(|error| not_solved(&scenario, error.to_string()))?;
    Ok(ValueTable::soonest(graph).successes())
}

impl Theorem3 {
    fn judged(&self) -> TheoremOutcome {
        let pairs = self.inside.pairs;
        // A broken promise is a bug, whatever the premises, so it is reported first.
        if self.misses > 0 {
            return TheoremOutcome::Refuted {
                why: format!(
                    "{} of {pairs} related counterexamples are not carried over",
                    self.misses
                ),
            };
        }
        let why = match (self.related_starts, pairs) {
            _ if self.found < self.capturable => format!(
                "the ado has not converged: it captures from {} of {} starts from which the best one does",
                self.found, self.capturable
            ),
            (0, _) => "no start pair is related".to_owned(),
            (related, 0) => {
                format!("none of {related} related start pairs is a counterexample with ε < τ")
            }
            _ => return TheoremOutcome::Holds,
        };
        TheoremOutcome::PremiseNotMet { why }
    }
}

/// Counterexample on the unchanged grid.
struct FoundAt {
    tau: f64,
    by: f64,
    actions: Vec<usize>,
}

/// Returns the counterexamples of the trained ado from every start of a map.
fn found(nominal: GridScenario<'_>, policy: &dyn Policy) -> HashMap<Position, FoundAt> {
    let starts: Vec<Position> = nominal.world().spec().arena.starts().collect();
    let horizon = nominal.bench().clock().samples();
    let one = |bench: &mut Testbench, both: &Position, _: &WorkItem| {
        // A grid has no noise, so the seed is 0 everywhere.
        let start = start_of(*both);
        let episode = play(bench, &start, 0, &mut PolicyActor(policy), Aftermath::Skip);
        let witness = Witness::of(nominal.rulebook(), &episode, horizon)?;
        let found = FoundAt {
            tau: witness.tau_at_verdict,
            by: -episode.robustness,
            actions: episode.actions,
        };
        Some((*both, found))
    };
    let unwatched = Watch::unwatched();
    let all = EpisodeLoop::uncounted(&unwatched);
    // Order is lost in the map, which is read by key or as a minimum.
    let found = all.run(&starts, || nominal.bench(), one);
    found.into_iter().flatten().collect()
}

struct GridComparison<'a> {
    nominal: HashMap<Position, FoundAt>,
    worlds: [&'a GridWorld; 2],
    games: [Game; 2],
    changed: GridScenario<'a>,
    policy: &'a dyn Policy,
    epsilon: f64,
}

impl GridComparison<'_> {
    fn coarse(&self, both: Position) -> Position {
        coarse(&self.games[0], &self.games[1], both)
    }

    /// Returns the starts of the changed grid that lie in a start of the unchanged grid.
    fn starts(&self) -> impl Iterator<Item = Position> + '_ {
        let starts = self.games[1].arena.starts();
        // Touching agents are no start, because the episode would end at once.
        starts.filter(|both| !self.games[0].arena.touching(self.coarse(*both)))
    }

    /// Plays counterexamples on the changed grid and counts broken promises.
    ///
    /// `promised` enables the count, and `by_cell` includes the policy on unchanged cells.
    /// At most [`MOST_PLAYED`] pairs are played.
    fn carried(
        &self,
        starts: Vec<Position>,
        by_cell: bool,
        promised: bool,
    ) -> (ReplayedOnGrid, usize) {
        let below = |found: &&FoundAt| !promised || self.epsilon < found.tau;
        let mut pairs: Vec<(Position, &FoundAt)> = starts
            .into_iter()
            .filter_map(|both| {
                let found = self.nominal.get(&self.coarse(both)).filter(below)?;
                Some((both, found))
            })
            .collect();
        if pairs.len() > MOST_PLAYED {
            // The seed is fixed, so equal requests play the same pairs.
            LearnerRng::new(CHOICE).shuffle(&mut pairs);
            pairs.truncate(MOST_PLAYED);
        }
        let unwatched = Watch::unwatched();
        let all = EpisodeLoop::uncounted(&unwatched);
        let one = |bench: &mut Testbench, pair: &(Position, &FoundAt), _: &WorkItem| {
            let (both, found) = *pair;
            let lifted = self.lifted(both);
            let own = &mut PolicyActor(self.policy);
            let start = start_of(both);
            let mut fails = |ado: &mut dyn Actor| play(bench, &start, 0, ado, Aftermath::Skip);
            let runs = [
                fails(&mut Replay::holding(&found.actions)),
                fails(&mut Replay::holding(&lifted)),
                fails(own),
            ];
            Some((runs.map(|run| Fate::of(&run)), found.by))
        };
        let played = all.run(&pairs, || self.changed.bench(), one);
        let mut carried = ReplayedOnGrid::default();
        let mut misses = 0;
        for (runs, by) in played.into_iter().flatten() {
            let [replayed, cell, own] = runs.map(|run| usize::from(run.success));
            carried.pairs += 1;
            carried.replayed += replayed;
            carried.by_cell += cell;
            carried.own_view += own;
            // Lemma 1: the robustness changes by at most ε as well.
            let kept = |run: Fate| run.success && by - self.epsilon - ROUNDING <= run.by;
            misses += usize::from(!kept(runs[0]) || (by_cell && !kept(runs[1])));
        }
        (carried, if promised { misses } else { 0 })
    }

    /// Returns the actions of the policy observing the unchanged grid's cells.
    fn lifted(&self, start: Position) -> Vec<usize> {
        lifted(self.worlds, start, self.policy)
    }
}

/// Returns the actions of a policy that observes the first grid's cells.
///
/// The second grid is played: "the same action as that of the coarser grid cell".
pub fn lifted(worlds: [&GridWorld; 2], start: Position, policy: &dyn Policy) -> Vec<usize> {
    let games = worlds.map(Game::of);
    // The observation comes from the first grid, whatever the second grid looks like.
    let mut scene = worlds[0].scene();
    let mut obs = vec![0.0; worlds[0].spaces().observation];
    games[1].actions(start, |both, step| {
        scene.observe_at(coarse(&games[0], &games[1], both), step, &mut obs);
        policy.act(&obs)
    })
}

/// Result of a run on the changed grid.
#[derive(Clone, Copy)]
struct Fate {
    success: bool,
    by: f64,
}

impl Fate {
    fn of(run: &Episode) -> Fate {
        Fate {
            success: run.verdict.is_success(),
            by: -run.robustness,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(found: usize, related_starts: usize, pairs: usize, misses: usize) -> Theorem3 {
        Theorem3 {
            changed: "other".to_owned(),
            epsilon: 0.0,
            candidates: 9,
            related: 5,
            sweeps: 2,
            least_epsilon: None,
            starts: 9,
            related_starts,
            capturable: 4,
            found,
            tau: Some(0.5),
            inside: ReplayedOnGrid {
                pairs,
                ..ReplayedOnGrid::default()
            },
            outside: ReplayedOnGrid::default(),
            misses,
            outcome: TheoremOutcome::Holds,
        }
    }

    #[test]
    fn theorem_3_is_judged_by_its_misses_and_its_premises() {
        let judged = |row: Theorem3| match row.judged() {
            TheoremOutcome::PremiseNotMet { why } => format!("premise: {why}"),
            TheoremOutcome::Refuted { why } => format!("refuted: {why}"),
            outcome => format!("{outcome:?}"),
        };
        assert_eq!(judged(row(4, 3, 2, 0)), "Holds");
        assert_eq!(judged(row(4, 1, 1, 0)), "Holds");
        // A miss is a bug even of an ado that has not converged.
        for found in [3, 4] {
            assert_eq!(
                judged(row(found, 3, 2, 1)),
                "refuted: 1 of 2 related counterexamples are not carried over"
            );
        }
        assert!(judged(row(3, 3, 2, 0)).contains("it captures from 3 of 4 starts"));
        assert_eq!(judged(row(4, 0, 0, 0)), "premise: no start pair is related");
        let none = judged(row(4, 3, 0, 0));
        assert!(none.contains("none of 3 related start pairs"), "{none}");
    }
}
