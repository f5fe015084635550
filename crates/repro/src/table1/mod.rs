//! Table I of the paper, beside the best achievable results.
//!
//! RQ1 to RQ5 on a grid world: the learners of its file with several seeds each, random
//! ados, a two-line chaser, and the exact optimum.

mod maps;
mod refined;
mod text;
mod transfer;
mod value;

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub(crate) use refined::RefinedMap;
pub use text::table1_markdown;
pub(crate) use transfer::OpenLoop;
pub(crate) use value::NearStarts;

use maps::{Map, maps};

use brakecheck::adversary::{Ado, NotSolvable};
use brakecheck::experiment::{TestStarts, Watch};
use brakecheck::rl::{Control, LearnerConfig, LearnerRng, Policy};
use brakecheck::run_dir::Row;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, Seeds, StartKey};
use brakecheck::stats::{Outcomes, StartOutcome, seeds_interval, wilson};
use brakecheck::testbench::{Gym, Success};
use brakecheck::training::TrainError;
use brakecheck::world::AtWall;
use brakecheck::world::NotAGrid;
use brakecheck::world::{ChangeError, Scenario};
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};
use brakecheck_experiment::grid_solver::exact::{Game, chase};
use brakecheck_experiment::grid_solver::game_graph::{Depth, GameGraph};
use brakecheck_experiment::grid_solver::values::ValueTable;
use brakecheck_scene::scene::grid::{Position, position_of};
use brakecheck_world::world::scenario_kind::GridScenario;

/// Number of random tables behind every mean.
const TABLES: usize = 20;

/// Request of Table I.
#[derive(Clone, Copy, Debug)]
pub struct Table1 {
    /// Training seeds per learner.
    ///
    /// The stream of the test starts is also the seed of the random ados.
    pub seeds: Seeds,
    /// Extent of the study.
    pub scale: PaperScale,
}

/// Extent of Table I.
#[derive(Clone, Copy, Debug)]
pub struct PaperScale {
    /// Side of the map of RQ4 and RQ5. Larger maps of RQ2 are left out.
    pub large: u32,
    /// Values of ε of RQ5, with the paper's shares.
    pub refinements: &'static [(u32, f64)],
    /// Number of starts on refined maps.
    pub refined_starts: usize,
}

impl PaperScale {
    /// The paper's own extent.
    pub const PAPER: PaperScale = PaperScale {
        large: 10,
        refinements: &[(3, 0.89), (5, 0.78)],
        // Three times 300.
        refined_starts: 900,
    };
}

/// Error of Table I.
#[derive(Debug, thiserror::Error)]
pub enum Table1Error {
    /// The world is not a grid.
    #[error(transparent)]
    NotAGrid(#[from] NotAGrid),
    /// A map of the table does not fit the world.
    #[error("a map of Table I does not fit the world: {0}")]
    Change(#[from] ChangeError),
    /// The optimum of a map cannot be computed.
    #[error("a map of Table I has no exact solution: {0}")]
    NotSolvable(#[from] NotSolvable),
    /// A refined map has another size, horizon or moves than its coarse map.
    #[error("a refined map of Table I has no relation to its coarse map")]
    Unrelated,
    /// A training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// Results of Table I on a grid world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridStudy {
    /// Name of the world.
    pub world: String,
    /// Reading A or B of docs/background/paper.md.
    pub reading: char,
    /// Names of the learners, in the order of all lists here.
    pub learners: Vec<String>,
    /// Training seeds.
    pub seeds: Vec<u64>,
    /// Decisions per training, by learner.
    pub decisions: Vec<u64>,
    /// Mean processor time of a training by learner, s.
    pub train_cpu_s: Vec<f64>,
    /// Results of RQ1: 10 and 20 random ados on the training map.
    pub random_ados: Vec<RandomAdos>,
    /// Results of RQ1, RQ2 and RQ3: captures per map.
    pub cells: Vec<MapResult>,
    /// Results of RQ4: starts of similar value.
    pub near_starts: NearStarts,
    /// Results of RQ5: captures on refined maps.
    pub refined: Vec<RefinedMap>,
    /// Results of Fig. 1: action sequences compared with policies.
    pub open_loop: Vec<OpenLoop>,
    /// Rows behind the cells: every learner, seed and map.
    pub rows: Vec<Row>,
}

/// Results of several random ados in RQ1.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RandomAdos {
    /// Number of random ados.
    pub ados: usize,
    /// Mean share of captured starts in the paper.
    pub paper: f64,
    /// Mean share for uniformly random actions, with Wilson's interval.
    pub actions: (f64, [f64; 2]),
    /// Mean share for a random action fixed per position.
    ///
    /// Its interval covers tables and starts.
    pub tables: (f64, [f64; 2]),
}

/// Captures of Table I on the page.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridCaptures {
    /// Name of the world.
    pub world: String,
    /// Names of the learners, in the order of all lists.
    pub learners: Vec<String>,
    /// Mean processor time of a training by learner, s.
    pub train_cpu_s: Vec<f64>,
    /// Captures per map.
    pub cells: Vec<MapResult>,
}

impl GridStudy {
    /// Returns what the page shows of it.
    pub(crate) fn captures(&self) -> GridCaptures {
        GridCaptures {
            world: self.world.clone(),
            learners: self.learners.clone(),
            train_cpu_s: self.train_cpu_s.clone(),
            cells: self.cells.clone(),
        }
    }
}

/// Captures on a map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MapResult {
    /// Question: RQ1, RQ2 or RQ3.
    pub question: String,
    /// Description of the map.
    pub map: String,
    /// Number of evaluated starts, which are all starts of the map.
    pub starts: usize,
    /// Share of the paper's trained ado.
    pub paper: f64,
    /// Share of the paper's random ado, if the paper has it.
    pub paper_random: Option<f64>,
    /// Captures without learning.
    pub references: References,
    /// Captures of the trained ados, by learner.
    pub trained: Vec<LearnerOnMap>,
}

/// Results of a learner on a map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LearnerOnMap {
    /// Median over seeds of the share of captured starts.
    pub median: f64,
    /// Mean over seeds.
    pub mean: f64,
    /// Interval of the mean over trainings and starts (docs/background/intervals.md).
    pub ci95: [f64; 2],
    /// Share of the worst seed.
    pub min: f64,
}

/// Trained ado.
struct Learned {
    learner: usize,
    seed: u64,
    policy: Box<dyn Policy>,
    /// First counterexample from every start on which training found any.
    counterexamples: Vec<Success>,
    cpu_s: f64,
}

/// Trains on the world's own map and evaluates on every map.
///
/// Results do not depend on the number of threads. `None`: stopped from outside.
///
/// # Errors
/// Returns an error if the world is not a grid or the maps of Table I do not fit it.
pub fn table1(
    scenario: &Scenario,
    request: &Table1,
    watch: &Watch<'_>,
) -> Result<Option<GridStudy>, Table1Error> {
    let grid = scenario.require_grid()?;
    let learners = learners(scenario);
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    // A world that does not fit is reported before the long trainings begin.
    let large = value::LargeMap::new(scenario, request)?;
    let own: u64 = learners
        .iter()
        .map(|(_, learner)| learner.decisions())
        .sum();
    // RQ4 and RQ5 train every learner again, for longer, on the large map.
    let total = request.seeds.count * (own + 2 * own * value::LONGER);
    let progress = TrainingProgress {
        done: AtomicU64::new(0),
        total,
        watch,
    };
    let jobs: Vec<(usize, u64)> = (0..learners.len())
        .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
        .collect();
    // Trainings are independent, and `collect` keeps the order of the jobs.
    let learned: Option<Vec<Learned>> = jobs
        .par_iter()
        .map(|&(learner, seed)| learn(scenario, &learners[learner].1, learner, seed, &progress))
        .collect();
    let Some(learned) = learned else {
        return Ok(None);
    };
    let mut rows = Vec::new();
    let mut cells = Vec::new();
    for map in maps(request.scale.large) {
        let Some(cell) = measure(
            scenario, &map, &learners, &learned, request, &mut rows, watch,
        )?
        else {
            return Ok(None);
        };
        cells.push(cell);
    }
    let open_loop = transfer::open_loop(grid, learners.len(), &learned)?;
    let Some(near_starts) = large.near_starts(&learners, &seeds, &progress) else {
        return Ok(None);
    };
    let Some(refined) = refined::refined(&large, &learners, &seeds, &progress)? else {
        return Ok(None);
    };
    let cpu = |learner: usize| {
        let of = learned.iter().filter(|learned| learned.learner == learner);
        of.map(|learned| learned.cpu_s).sum::<f64>() / seeds.len().max(1) as f64
    };
    Ok(Some(GridStudy {
        world: scenario.name().to_owned(),
        reading: grid.world().spec().arena.at_wall.reading(),
        train_cpu_s: (0..learners.len()).map(cpu).collect(),
        decisions: learners.iter().map(|(_, l)| l.decisions()).collect(),
        learners: learners.into_iter().map(|(name, _)| name).collect(),
        random_ados: random_ados(&Game::of(grid.world()), request),
        seeds,
        cells,
        near_starts,
        refined,
        open_loop,
        rows,
    }))
}

/// Returns the world's learner and its further learners, with their names in the table.
fn learners(scenario: &Scenario) -> Vec<(String, LearnerConfig)> {
    let own = (
        // The table names learners as the paper does, in capitals.
        scenario.learner().name().to_uppercase(),
        scenario.learner().clone(),
    );
    let others = scenario
        .learners()
        .iter()
        .map(|(name, learner)| (name.to_uppercase(), learner.clone()));
    [own].into_iter().chain(others).collect()
}

/// Progress over the decisions of all trainings.
struct TrainingProgress<'a> {
    done: AtomicU64,
    total: u64,
    watch: &'a Watch<'a>,
}

/// Trains an ado on the world's training starts. `None`: stopped.
fn learn(
    scenario: &Scenario,
    learner: &LearnerConfig,
    index: usize,
    seed: u64,
    progress: &TrainingProgress<'_>,
) -> Option<Learned> {
    let clock = cpu_time::ThreadTime::now();
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
    // RQ4 selects its counterexamples among those that training found.
    gym.keep_successes();
    let mut learner = learner.build(scenario.world().spaces(), seed);
    let mut before = 0;
    learner.train(&mut gym, &mut |report| {
        // The learner reports totals, so only the difference is added.
        let new = report.decisions - before;
        before = report.decisions;
        // The addition returns the number before it, which lacks these decisions.
        let done = progress.done.fetch_add(new, Ordering::Relaxed) + new;
        // A learner ends with a whole step, so the sum may exceed the plan.
        (progress.watch.progress)(done.min(progress.total), progress.total);
        if progress.watch.stopped() {
            Control::Stop
        } else {
            Control::Continue
        }
    });
    let mut counterexamples = gym.take_successes();
    // Bits are hashed, because floating-point numbers have no equality for sets.
    let at = |success: &Success| success.start.0.iter().map(|x| x.to_bits()).collect();
    let mut seen: HashSet<Vec<u64>> = HashSet::new();
    counterexamples.retain(|success| seen.insert(at(success)));
    // A stopped learner has the policy of a part of its training, which is no result.
    learner.finished().then(|| Learned {
        learner: index,
        seed,
        policy: learner.policy(),
        counterexamples,
        cpu_s: clock.elapsed().as_secs_f64(),
    })
}

/// Returns the starts of a map.
///
/// Trivial starts are kept, because the paper counts all starts. If the map has no list,
/// `drawn` starts are drawn.
fn starts_of(scenario: &Scenario, seed: u64, drawn: usize) -> TestStarts {
    let bench = scenario.bench();
    let key = |index: usize| StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    };
    let listed = scenario.starts();
    let draw = || (0..drawn).map(|index| bench.draw(key(index))).collect();
    let starts: Vec<(Start, u64)> = listed
        .unwrap_or_else(draw)
        .into_iter()
        .enumerate()
        .map(|(index, start)| (start, bench.noise_of(key(index))))
        .collect();
    // Without this the evaluation would leave out starts that the paper counts.
    let trivial = vec![false; starts.len()];
    TestStarts {
        seed,
        starts,
        trivial,
    }
}

fn measure(
    scenario: &Scenario,
    map: &Map,
    learners: &[(String, LearnerConfig)],
    learned: &[Learned],
    request: &Table1,
    rows: &mut Vec<Row>,
    watch: &Watch<'_>,
) -> Result<Option<MapResult>, Table1Error> {
    let mut changed = scenario.with(&map.change.clone().into())?;
    // The maps of Table I list their starts, so none is drawn.
    let starts = starts_of(&changed, request.seeds.starts, 0);
    // An evaluation is a part of the table, and its own phases would hide those.
    let quiet = watch.quiet();
    let mut trained = Vec::new();
    for (learner, (_, config)) in learners.iter().enumerate() {
        // The learner is named in the rows, so the world carries it.
        changed = changed.learning_with(config.clone());
        let of = learned.iter().filter(|learned| learned.learner == learner);
        let own: Vec<Row> = of
            .map(|learned| {
                let request = EvalRequest {
                    scenario: &changed,
                    ego: &map.words,
                    ado: Ado::Trained(&*learned.policy, learned.seed),
                    starts: &starts,
                };
                eval(&request, &quiet).row
            })
            .collect();
        if watch.stopped() {
            return Ok(None);
        }
        let solved: Vec<&Outcomes> = own.iter().map(|row| &row.solved).collect();
        let shares: Vec<f64> = own.iter().map(|row| row.success_rate).collect();
        trained.push(LearnerOnMap {
            ci95: seeds_interval(&solved),
            ..spread(&shares)
        });
        rows.extend(own);
    }
    let grid = changed.require_grid()?;
    let arena = grid.world().spec().arena;
    let positions: Vec<Position> = starts
        .starts
        .iter()
        .map(|(start, _)| position_of(start, &arena))
        .collect();
    Ok(Some(MapResult {
        question: map.question.to_owned(),
        map: map.words.clone(),
        starts: positions.len(),
        paper: map.paper,
        paper_random: map.paper_random,
        references: References::of(grid, &positions, request.seeds.starts)?,
        trained,
    }))
}

/// Captures without learning, from the same starts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct References {
    /// Exact share of the optimal ado.
    pub optimum: f64,
    /// Exact expected share of uniformly random actions.
    pub random: f64,
    /// Mean share of random fixed tables.
    pub random_tables: f64,
    /// Share of the two-line chaser.
    pub chaser: f64,
}

impl References {
    fn of(
        grid: GridScenario<'_>,
        positions: &[Position],
        seed: u64,
    ) -> Result<References, NotSolvable> {
        let world = grid.world();
        let starts = positions.iter().copied();
        // Only the sign of a value is read below, which the smaller graph keeps.
        let graph = GameGraph::explore_from(world, grid.rulebook(), Depth::Sign, starts)?;
        let best = ValueTable::soonest(graph);
        let game = &Game::of(world);
        let chance = game.random_chances();
        let share = |of: &dyn Fn(&Position) -> f64| {
            positions.iter().map(of).sum::<f64>() / positions.len().max(1) as f64
        };
        let caught = |yes: bool| f64::from(u8::from(yes));
        let mut tables = 0.0;
        for table in 0..TABLES {
            let table = random_table(game, seed, table);
            tables += share(&|both| caught(game.captures(*both, |at| table[game.pair(at)])));
        }
        Ok(References {
            optimum: share(&|both| caught(best.at(*both).is_some_and(|value| value > 0.0))),
            random: share(&|both| chance[game.pair(*both)]),
            random_tables: tables / TABLES as f64,
            chaser: share(&|both| caught(game.captures(*both, |at| chase(at, &game.moves)))),
        })
    }
}

/// Returns mean, median and minimum of the shares of all seeds, without an interval.
fn spread(shares: &[f64]) -> LearnerOnMap {
    let mut sorted = shares.to_vec();
    sorted.sort_by(f64::total_cmp);
    LearnerOnMap {
        // The upper one of two in the middle, so that it belongs to a training.
        median: sorted.get(sorted.len() / 2).copied().unwrap_or(0.0),
        mean: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
        // The widest interval, until the caller replaces it.
        ci95: [0.0, 1.0],
        min: sorted.first().copied().unwrap_or(0.0),
    }
}

/// Returns a table with a random action per position.
fn random_table(game: &Game, seed: u64, index: usize) -> Vec<usize> {
    // The factor keeps the streams of neighbouring seeds apart.
    let mut dice = LearnerRng::new(seed.wrapping_mul(1_000_003) + index as u64);
    (0..game.pairs())
        .map(|_| dice.below(game.moves.len()))
        .collect()
}

/// Evaluates RQ1's baselines: several ados, each from every start.
fn random_ados(game: &Game, request: &Table1) -> Vec<RandomAdos> {
    let starts: Vec<_> = game.arena.starts().collect();
    let one = |ados: usize, paper: f64| {
        // Both lines start from the same seed, so the first 10 ados are the same.
        let mut dice = LearnerRng::new(request.seeds.starts);
        let mut captured = 0;
        for _ in 0..ados {
            let caught =
                |start: &&Position| game.captures(**start, |_| dice.below(game.moves.len()));
            captured += starts.iter().filter(caught).count();
        }
        let n = ados * starts.len();
        let solved: Vec<Outcomes> = (0..ados)
            .map(|index| {
                let table = random_table(game, request.seeds.starts, index);
                let mark = |start: &Position| {
                    if game.captures(*start, |at| table[game.pair(at)]) {
                        StartOutcome::Solved
                    } else {
                        StartOutcome::Unsolved
                    }
                };
                starts.iter().map(mark).collect()
            })
            .collect();
        let ones: usize = solved.iter().map(|s| s.count(StartOutcome::Solved)).sum();
        let solved: Vec<&Outcomes> = solved.iter().collect();
        RandomAdos {
            ados,
            paper,
            // Random actions are drawn anew in each run, so every run is a trial of its
            // own. A table serves all starts, so its runs depend on each other.
            actions: (captured as f64 / n as f64, wilson(captured, n)),
            tables: (ones as f64 / n as f64, seeds_interval(&solved)),
        }
    };
    // The two lines of random ados that the paper has for RQ1.
    vec![one(10, 0.0983), one(20, 0.1023)]
}

/// Returns the sentence that must accompany a reading.
pub(super) fn verdict_on(wall: AtWall) -> &'static str {
    match wall {
        AtWall::Stays => {
            "Under this reading a two-line chaser (move along the larger axis) captures exactly what \
             the best ado captures, on every map: it shows nothing about learning."
        }
        AtWall::FirstInMap => {
            "Under this reading the best ado captures everything and running after the ego does not: \
             this is the headline."
        }
    }
}
