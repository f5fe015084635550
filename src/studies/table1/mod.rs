//! Table I of the paper, beside what can be achieved at all.
//!
//! RQ1 to RQ5 on one grid world: the learners of its file, each with several
//! seeds, random ados, a two-line chaser, and the exact optimum.

mod maps;
mod refined;
mod text;
mod transfer;
mod value;

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use refined::RefinedMap;
pub use text::table1_markdown;
pub use transfer::OpenLoop;
pub use value::NearStarts;

use maps::{Map, maps};

use crate::adversary::{Ado, EvalRequest, eval};
use crate::experiment::{TestStarts, Watch};
use crate::rl::{Control, Dice, LearnerConfig, Policy};
use crate::run_dir::Row;
use crate::scene::Start;
use crate::scene::grid::exact::{Game, chase};
use crate::scene::grid::{AtWall, Position, position_of};
use crate::seed::{Purpose, Seeds, StartKey};
use crate::stats::{Outcomes, StartOutcome, seeds_interval, wilson};
use crate::testbench::{Gym, Success};
use crate::theorems::TheoremsError;
use crate::training::TrainError;
use crate::world::{ChangeError, Scenario};

/// Random tables behind every mean of them.
const TABLES: usize = 20;

/// What to reproduce.
#[derive(Clone, Copy, Debug)]
pub struct Table1 {
    /// Trainings per learner; the stream of the test starts is also the seed of
    /// random ados.
    pub seeds: Seeds,
}

/// Table I could not be made.
#[derive(Debug, thiserror::Error)]
pub enum Table1Error {
    /// It is about grids.
    #[error("`{world}` is no grid world")]
    NotAGrid {
        /// Name of the world.
        world: String,
    },
    /// A map of the table does not fit the world.
    #[error("a map of Table I does not fit the world: {0}")]
    Change(#[from] ChangeError),
    /// Training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A theorem does not apply to a map.
    #[error(transparent)]
    Theorems(#[from] TheoremsError),
}

/// Table I on one grid world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridStudy {
    /// Name of the world.
    pub world: String,
    /// A or B, in the words of docs/grid.md.
    pub reading: char,
    /// Names of the learners, in the order of all lists here.
    pub learners: Vec<String>,
    /// Training seeds.
    pub seeds: Vec<u64>,
    /// Decisions per training, by learner.
    pub decisions: Vec<u64>,
    /// Mean processor time of a training, by learner.
    pub train_cpu_s: Vec<f64>,
    /// RQ1: 10 and 20 random ados on the training map.
    pub random_ados: Vec<RandomAdos>,
    /// RQ1, RQ2 and RQ3: captures per map.
    pub cells: Vec<MapResult>,
    /// RQ4: starts of nearly the same value.
    pub near_starts: NearStarts,
    /// RQ5: captures on refined maps.
    pub refined: Vec<RefinedMap>,
    /// Fig. 1: action sequences against policies.
    pub open_loop: Vec<OpenLoop>,
    /// The rows behind the cells: every learner, seed and map.
    pub rows: Vec<Row>,
}

/// RQ1: several random ados.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RandomAdos {
    /// Random ados that were tried.
    pub ados: usize,
    /// The paper's mean share of captured starts.
    pub paper: f64,
    /// Uniformly random actions: mean share, and Wilson's interval.
    pub actions: (f64, [f64; 2]),
    /// One random action fixed per position: mean share, and its interval over
    /// tables and starts.
    pub tables: (f64, [f64; 2]),
}

/// Captures on one map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MapResult {
    /// RQ1, RQ2 or RQ3.
    pub question: String,
    /// The map in words.
    pub map: String,
    /// Starts evaluated: all there are.
    pub starts: usize,
    /// The paper's share for its trained ado.
    pub paper: f64,
    /// The paper's share for its random ado, where it has one.
    pub paper_random: Option<f64>,
    /// What is captured without learning.
    pub references: References,
    /// What trained ados capture, a learner each.
    pub trained: Vec<LearnerOnMap>,
}

/// One learner on one map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LearnerOnMap {
    /// Median over seeds of the share of captured starts.
    pub median: f64,
    /// Mean over seeds.
    pub mean: f64,
    /// Interval of the mean over trainings and starts (docs/intervals.md).
    pub ci95: [f64; 2],
    /// The worst seed.
    pub min: f64,
}

/// A trained ado.
struct Learned {
    learner: usize,
    seed: u64,
    policy: Box<dyn Policy>,
    /// The first counterexample from every start that training met one from.
    met: Vec<Success>,
    cpu_s: f64,
}

/// Trains on the world's own map and measures everywhere else.
///
/// Equal for any number of threads. `None`: stopped from outside.
///
/// # Errors
/// The world is no grid, or the maps of Table I do not fit it.
pub fn table1(
    scenario: &Scenario,
    request: &Table1,
    watch: &Watch<'_>,
) -> Result<Option<GridStudy>, Table1Error> {
    let Some(grid) = scenario.grid() else {
        return Err(Table1Error::NotAGrid {
            world: scenario.name.clone(),
        });
    };
    let learners = learners(scenario);
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    let large = value::LargeMap::new(scenario, request)?;
    let own: u64 = learners
        .iter()
        .map(|(_, learner)| learner.decisions())
        .sum();
    let total = request.seeds.count * (own + 2 * own * value::LONGER);
    let progress = Progress {
        done: AtomicU64::new(0),
        total,
        watch,
    };
    let jobs: Vec<(usize, u64)> = (0..learners.len())
        .flat_map(|learner| seeds.iter().map(move |seed| (learner, *seed)))
        .collect();
    let learned: Option<Vec<Learned>> = jobs
        .par_iter()
        .map(|&(learner, seed)| learn(scenario, &learners[learner].1, (learner, seed), &progress))
        .collect();
    let Some(learned) = learned else {
        return Ok(None);
    };
    let mut rows = Vec::new();
    let mut cells = Vec::new();
    for map in maps() {
        let Some(cell) = measure(
            scenario, &map, &learners, &learned, request, &mut rows, watch,
        )?
        else {
            return Ok(None);
        };
        cells.push(cell);
    }
    let open_loop = transfer::open_loop(scenario, learners.len(), &learned)?;
    let Some(near_starts) = large.near_starts(&learners, &seeds, &progress)? else {
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
        world: scenario.name.clone(),
        reading: grid.spec().arena.at_wall.reading(),
        train_cpu_s: (0..learners.len()).map(cpu).collect(),
        decisions: learners.iter().map(|(_, l)| l.decisions()).collect(),
        learners: learners.into_iter().map(|(name, _)| name).collect(),
        random_ados: random_ados(&Game::of(grid), request),
        seeds,
        cells,
        near_starts,
        refined,
        open_loop,
        rows,
    }))
}

/// The world's learner and its others, by the names of the table.
fn learners(scenario: &Scenario) -> Vec<(String, LearnerConfig)> {
    let own = (
        scenario.learner.name().to_uppercase(),
        scenario.learner.clone(),
    );
    let others = scenario.learners.iter();
    let others = others.map(|(name, learner)| (name.to_uppercase(), learner.clone()));
    [own].into_iter().chain(others).collect()
}

/// Counts decisions of all trainings.
struct Progress<'a> {
    done: AtomicU64,
    total: u64,
    watch: &'a Watch<'a>,
}

/// Trains one ado on the world's training starts; `None` when stopped.
fn learn(
    scenario: &Scenario,
    learner: &LearnerConfig,
    (index, seed): (usize, u64),
    progress: &Progress<'_>,
) -> Option<Learned> {
    let clock = cpu_time::ThreadTime::now();
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
    gym.keep_successes();
    let mut learner = learner.build(scenario.world().spaces(), seed);
    let mut before = 0;
    learner.train(&mut gym, &mut |report| {
        let new = report.decisions - before;
        before = report.decisions;
        let done = progress.done.fetch_add(new, Ordering::Relaxed) + new;
        (progress.watch.progress)(done.min(progress.total), progress.total);
        match progress.watch.stopped() {
            true => Control::Stop,
            false => Control::Continue,
        }
    });
    let mut met = gym.take_successes();
    let at = |success: &Success| success.start.0.iter().map(|x| x.to_bits()).collect();
    let mut seen: HashSet<Vec<u64>> = HashSet::new();
    met.retain(|success| seen.insert(at(success)));
    learner.finished().then(|| Learned {
        learner: index,
        seed,
        policy: learner.policy(),
        met,
        cpu_s: clock.elapsed().as_secs_f64(),
    })
}

/// The starts of a map, none of them left out as trivial: the paper counts all.
///
/// Where they are not listed, so many are drawn.
fn starts_of(scenario: &Scenario, seed: u64, drawn: usize) -> TestStarts {
    let bench = scenario.bench();
    let key = |index: usize| StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    };
    let listed = scenario.starts();
    let draw = || (0..drawn).map(|index| bench.draw(key(index))).collect();
    let starts: Vec<Start> = listed.unwrap_or_else(draw);
    let starts: Vec<(Start, u64)> = starts
        .into_iter()
        .enumerate()
        .map(|(index, start)| (start, bench.noise_of(key(index))))
        .collect();
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
    let starts = starts_of(&changed, request.seeds.starts, 0);
    let quiet = watch.quiet();
    let mut trained = Vec::new();
    for (learner, (_, config)) in learners.iter().enumerate() {
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
    let Some(grid) = changed.grid() else {
        return Ok(None);
    };
    let game = Game::of(grid);
    let positions = starts.starts.iter();
    let positions: Vec<Position> = positions
        .map(|(start, _)| position_of(start, &game.arena))
        .collect();
    Ok(Some(MapResult {
        question: map.question.to_owned(),
        map: map.words.clone(),
        starts: positions.len(),
        paper: map.paper,
        paper_random: map.paper_random,
        references: References::of(&game, &positions, request.seeds.starts),
        trained,
    }))
}

/// What is captured without learning, from the same starts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct References {
    /// Share that the best ado captures, exactly.
    pub optimum: f64,
    /// Share that uniformly random actions capture in expectation, exactly.
    pub random: f64,
    /// Mean share of random fixed tables.
    pub random_tables: f64,
    /// Share that the two-line chaser captures.
    pub chaser: f64,
}

impl References {
    fn of(game: &Game, positions: &[Position], seed: u64) -> References {
        let (solution, chance) = (game.solve(), game.random_chances());
        let share = |of: &dyn Fn(&Position) -> f64| {
            positions.iter().map(of).sum::<f64>() / positions.len().max(1) as f64
        };
        let caught = |yes: bool| f64::from(u8::from(yes));
        let mut tables = 0.0;
        for table in 0..TABLES {
            let table = random_table(game, seed, table);
            tables += share(&|both| caught(game.captures(*both, |at| table[game.pair(at)])));
        }
        References {
            optimum: share(&|both| caught(solution.capture_in(*both).is_some())),
            random: share(&|both| chance[game.pair(*both)]),
            random_tables: tables / TABLES as f64,
            chaser: share(&|both| caught(game.captures(*both, |at| chase(at, &game.moves)))),
        }
    }
}

/// Mean, median and worst of the shares of all seeds; no interval yet.
fn spread(shares: &[f64]) -> LearnerOnMap {
    let mut sorted = shares.to_vec();
    sorted.sort_by(f64::total_cmp);
    LearnerOnMap {
        median: sorted.get(sorted.len() / 2).copied().unwrap_or(0.0),
        mean: shares.iter().sum::<f64>() / shares.len().max(1) as f64,
        ci95: [0.0, 1.0],
        min: sorted.first().copied().unwrap_or(0.0),
    }
}

/// One action per position, drawn once.
fn random_table(game: &Game, seed: u64, index: usize) -> Vec<usize> {
    let mut dice = Dice::new(seed.wrapping_mul(1_000_003) + index as u64);
    (0..game.pairs())
        .map(|_| dice.below(game.moves.len()))
        .collect()
}

/// RQ1's baselines: several ados, each from every start.
fn random_ados(game: &Game, request: &Table1) -> Vec<RandomAdos> {
    let starts: Vec<_> = game.arena.starts().collect();
    let one = |ados: usize, paper: f64| {
        let mut dice = Dice::new(request.seeds.starts);
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
                let mark = |start: &Position| match game.captures(*start, |at| table[game.pair(at)])
                {
                    true => StartOutcome::Solved,
                    false => StartOutcome::Unsolved,
                };
                starts.iter().map(mark).collect()
            })
            .collect();
        let ones: usize = solved.iter().map(|s| s.count(StartOutcome::Solved)).sum();
        let solved: Vec<&Outcomes> = solved.iter().collect();
        RandomAdos {
            ados,
            paper,
            actions: (captured as f64 / n as f64, wilson(captured, n)),
            tables: (ones as f64 / n as f64, seeds_interval(&solved)),
        }
    };
    vec![one(10, 0.0983), one(20, 0.1023)]
}

/// The sentence that must stand beside a reading.
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
