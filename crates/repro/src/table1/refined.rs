//! RQ5: λ = (10, C200, 1) on maps with every cell divided into ε × ε (Theorem 3).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::value::LargeMap;
use super::{
    Learned, LearnerOnMap, References, Table1, Table1Error, TrainingProgress, spread, starts_of,
};
use brakecheck::rl::LearnerConfig;
use brakecheck::scene::Start;
use brakecheck::stats::{Outcomes, StartOutcome, seeds_interval};
use brakecheck::testbench::{Actor, Aftermath, PolicyActor, Replay, Testbench, play};
use brakecheck::world::GridChange;
use brakecheck::world::Starts;
use brakecheck_evaluation::theorems::{bisimulations, lifted};
use brakecheck_experiment::grid_solver::bisimulation::Bisimulation;
use brakecheck_scene::scene::grid::{Position, position_of, start_of};
use brakecheck_world::world::scenario_kind::GridScenario;

/// Number of random training starts, as in the paper.
const TRAINING_STARTS: usize = 200;
/// Margin τ of a capture by unit moves under the shipped rule.
const TAU: f64 = 0.5;

/// Results of RQ5 for a value of ε.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RefinedMap {
    /// Number of fine cells along a cell.
    pub refine: u32,
    /// Share in the paper.
    pub paper: f64,
    /// Number of drawn starts.
    pub starts: usize,
    /// Pairs of states in the greatest bisimulation for the largest ε below τ.
    pub related: usize,
    /// Pairs of states within that ε.
    pub candidates: usize,
    /// Drawn starts related to the coarse start that contains them.
    pub related_starts: usize,
    /// Captures without learning.
    pub references: References,
    /// Results by learner.
    pub trained: Vec<RefinedShare>,
}

/// Results of a learner on a refined map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RefinedShare {
    /// Captures of the ado acting on coarse cells, as in the paper.
    pub by_cell: LearnerOnMap,
    /// Captures of the ado observing the refined map.
    pub own_view: LearnerOnMap,
    /// Related starts with a coarse counterexample, and captures among them.
    ///
    /// Both are summed over seeds. By Theorem 3 they are equal.
    pub related: (usize, usize),
    /// Same counts for unrelated starts.
    pub unrelated: (usize, usize),
}

/// Trains on 200 starts and evaluates on refined maps. `None`: stopped.
pub(super) fn refined(
    large: &LargeMap,
    learners: &[(String, LearnerConfig)],
    seeds: &[u64],
    progress: &TrainingProgress<'_>,
) -> Result<Option<Vec<RefinedMap>>, Table1Error> {
    let jobs: Vec<(usize, u64)> = (0..learners.len())
        .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
        .collect();
    // RQ5 has more training starts than RQ4, so its ados are trained apart.
    let trained: Option<Vec<Learned>> = jobs
        .par_iter()
        .map(|&(index, seed)| {
            large.learn(&learners[index].1, TRAINING_STARTS, index, seed, progress)
        })
        .collect();
    let Some(learned) = trained else {
        return Ok(None);
    };
    let coarse = large.map.require_grid()?;
    let mut all = Vec::new();
    for &(refine, paper) in large.request.scale.refinements {
        if progress.watch.stopped() {
            return Ok(None);
        }
        let step = GridChange {
            refine: Some(refine),
            // The ego moves as far as before, in fine cells.
            ego_step: Some(refine),
            // A fine map has too many pairs of cells to play all, so its starts are
            // drawn.
            starts: Some(Starts::Uniform),
            ..GridChange::default()
        };
        let fine = large.map.with(&step.into())?;
        let reuse = Reuse::of(coarse, fine.require_grid()?, &large.request)?;
        all.push(reuse.map(refine, paper, learners.len(), &learned));
    }
    Ok(Some(all))
}

/// Refined map with its drawn starts and its relation to the coarse map.
struct Reuse<'a> {
    coarse: GridScenario<'a>,
    fine: GridScenario<'a>,
    positions: Vec<Position>,
    relation: Bisimulation,
    references: References,
}

/// Results of an ado from a start.
struct Reused {
    coarse: bool,
    by_cell: bool,
    own_view: bool,
}

impl<'a> Reuse<'a> {
    fn of(
        coarse: GridScenario<'a>,
        fine: GridScenario<'a>,
        request: &Table1,
    ) -> Result<Reuse<'a>, Table1Error> {
        // The last relation has the largest ε below τ.
        let relations = bisimulations(coarse, fine, TAU);
        let largest = relations.and_then(|mut all| all.pop());
        let relation = largest.ok_or(Table1Error::Unrelated)?;
        let arena = fine.world().spec().arena;
        let seed = request.seeds.starts;
        let starts = starts_of(&fine, seed, request.scale.refined_starts).starts;
        let positions: Vec<Position> = starts
            .iter()
            .map(|(start, _)| position_of(start, &arena))
            .collect();
        Ok(Reuse {
            relation,
            references: References::of(fine, &positions, seed)?,
            coarse,
            fine,
            positions,
        })
    }

    fn is_related(&self, both: &Position) -> bool {
        self.relation.relates(self.relation.coarse(*both), *both)
    }

    fn map(&self, refine: u32, paper: f64, learners: usize, learned: &[Learned]) -> RefinedMap {
        let reused: Vec<Vec<Reused>> = learned.par_iter().map(|ado| self.reused(ado)).collect();
        let of = |learner: usize| {
            let all = learned.iter().zip(&reused);
            all.filter(move |(ado, _)| ado.learner == learner)
                .map(|(_, reused)| reused)
                .collect::<Vec<_>>()
        };
        RefinedMap {
            refine,
            paper,
            starts: self.positions.len(),
            related: self.relation.len(),
            candidates: self.relation.candidates(),
            related_starts: self
                .positions
                .iter()
                .filter(|at| self.is_related(at))
                .count(),
            references: self.references.clone(),
            trained: (0..learners).map(|l| self.share(&of(l))).collect(),
        }
    }

    fn reused(&self, ado: &Learned) -> Vec<Reused> {
        let worlds = [self.coarse.world(), self.fine.world()];
        let mut benches = [self.coarse.bench(), self.fine.bench()];
        let one = |both: &Position| {
            let at = start_of(*both);
            // The coarse policy cannot run on the fine grid, so its actions are computed first.
            let actions = lifted(worlds, *both, &*ado.policy);
            let mut own = PolicyActor(&*ado.policy);
            let mut captures = |bench: usize, start: &Start, actor: &mut dyn Actor| {
                let bench: &mut Testbench = &mut benches[bench];
                // Nothing on a grid draws noise, so its seed is any number.
                let episode = play(bench, start, 0, actor, Aftermath::Skip);
                episode.verdict.is_success()
            };
            let from = self.relation.coarse(*both);
            Reused {
                // Two fine starts in the same cell have no coarse start.
                coarse: from.ego != from.ado && captures(0, &start_of(from), &mut own),
                by_cell: captures(1, &at, &mut Replay::holding(&actions)),
                own_view: captures(1, &at, &mut own),
            }
        };
        self.positions.iter().map(one).collect()
    }

    fn share(&self, seeds: &[&Vec<Reused>]) -> RefinedShare {
        let over = |captured: &dyn Fn(&Reused) -> bool| {
            let mark = |reused: &Reused| {
                if captured(reused) {
                    StartOutcome::Solved
                } else {
                    StartOutcome::Unsolved
                }
            };
            let solved: Vec<Outcomes> = seeds
                .iter()
                .map(|seed| seed.iter().map(mark).collect())
                .collect();
            let shares = solved.iter().map(|seed| {
                seed.count(StartOutcome::Solved) as f64 / self.positions.len().max(1) as f64
            });
            LearnerOnMap {
                ci95: seeds_interval(&solved.iter().collect::<Vec<_>>()),
                ..spread(&shares.collect::<Vec<_>>())
            }
        };
        let (mut related, mut unrelated) = ((0, 0), (0, 0));
        for seed in seeds {
            for (both, reused) in self.positions.iter().zip(*seed) {
                let sum = if self.is_related(both) {
                    &mut related
                } else {
                    &mut unrelated
                };
                // Only counterexamples of the coarse map are covered by the theorem.
                if reused.coarse {
                    sum.0 += 1;
                    sum.1 += usize::from(reused.by_cell);
                }
            }
        }
        RefinedShare {
            by_cell: over(&|reused| reused.by_cell),
            own_view: over(&|reused| reused.own_view),
            related,
            unrelated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PaperScale;
    use brakecheck::seed::Seeds;
    use brakecheck::world::Scenario;

    #[test]
    fn a_map_without_a_relation_is_an_error_and_no_interruption() {
        let text = include_str!("../../../../worlds/grid_hard.ron");
        let world = Scenario::parse("grid_hard.ron", text).expect("a sound world");
        let larger = GridChange {
            size: Some(5),
            ..GridChange::default()
        };
        let larger = world.with(&larger.into()).expect("it fits");
        let request = Table1 {
            seeds: Seeds {
                first: 1,
                count: 1,
                starts: 3,
            },
            scale: PaperScale {
                large: 4,
                refinements: &[],
                refined_starts: 1,
            },
        };
        let [coarse, fine] = [&world, &larger].map(|it| it.require_grid().expect("a grid"));
        let related = Reuse::of(coarse, fine, &request);
        assert!(matches!(related, Err(Table1Error::Unrelated)));
    }
}
