//! Table I of the paper, beside what can be achieved at all.
//!
//! RQ1 to RQ5 on one grid world: the learners of its file, each with several
//! seeds, random ados, a two-line chaser, and the exact optimum.

mod maps;
mod text;
mod transfer;
mod value;

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use text::table1_markdown;
pub use transfer::OpenLoop;
pub use value::DeltaNear;

use maps::{Map, maps};

use crate::campaign::{Ado, EvalRequest, TestStarts, TrainError, Watch, eval};
use crate::rl::{Control, Dice, LearnerConfig, Policy};
use crate::run::{Outcomes, Row, StartOutcome, seeds_interval, wilson};
use crate::scenario::{ChangeError, Scenario};
use crate::scene::Start;
use crate::scene::grid::exact::{Game, chase};
use crate::scene::grid::{AtWall, position_of};
use crate::seed::{Purpose, Seeds, StartKey};
use crate::testbench::Gym;

/// Random tables behind every mean of them.
const TABLES: usize = 20;
/// Starts drawn on refined maps: three times 300, as in the paper.
const REFINED_STARTS: usize = 900;

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
    /// RQ1, RQ2, RQ3 and RQ5: captures per map.
    pub cells: Vec<MapResult>,
    /// RQ4: starts of nearly the same value.
    pub delta_near: Vec<DeltaNear>,
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
    /// RQ1, RQ2, RQ3 or RQ5.
    pub question: String,
    /// The map in words.
    pub map: String,
    /// Starts evaluated.
    pub starts: usize,
    /// Whether these are all starts there are.
    pub all_starts: bool,
    /// The paper's share for its trained ado.
    pub paper: f64,
    /// The paper's share for its random ado, where it has one.
    pub paper_random: Option<f64>,
    /// Share that the best ado captures, exactly.
    pub optimum: f64,
    /// Share that uniformly random actions capture in expectation, exactly.
    pub random: f64,
    /// Mean share of random fixed tables.
    pub random_tables: f64,
    /// Share that the two-line chaser captures.
    pub chaser: f64,
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
pub(super) struct Learned {
    pub(super) learner: usize,
    pub(super) seed: u64,
    pub(super) policy: Box<dyn Policy>,
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
    let near = value::Plan::new(scenario, request)?;
    let own: u64 = learners
        .iter()
        .map(|(_, learner)| learner.decisions())
        .sum();
    let total = request.seeds.count * (own + own * value::LONGER);
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
    let Some(delta_near) = near.study(&learners, &seeds, &progress) else {
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
        delta_near,
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
pub(super) struct Progress<'a> {
    done: AtomicU64,
    total: u64,
    pub(super) watch: &'a Watch<'a>,
}

/// Trains one ado on the world's training starts; `None` when stopped.
pub(super) fn learn(
    scenario: &Scenario,
    learner: &LearnerConfig,
    (index, seed): (usize, u64),
    progress: &Progress<'_>,
) -> Option<Learned> {
    let clock = cpu_time::ThreadTime::now();
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
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
    learner.finished().then(|| Learned {
        learner: index,
        seed,
        policy: learner.policy(),
        cpu_s: clock.elapsed().as_secs_f64(),
    })
}

/// The starts of a map, none of them left out as trivial: the paper counts all.
fn starts_of(scenario: &Scenario, seed: u64, drawn: usize) -> (TestStarts, bool) {
    let bench = scenario.bench();
    let key = |index: usize| StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    };
    let listed = scenario.starts();
    let all = listed.is_some();
    let draw = || (0..drawn).map(|index| bench.draw(key(index))).collect();
    let starts: Vec<Start> = listed.unwrap_or_else(draw);
    let starts: Vec<(Start, u64)> = starts
        .into_iter()
        .enumerate()
        .map(|(index, start)| (start, bench.noise_of(key(index))))
        .collect();
    let trivial = vec![false; starts.len()];
    (
        TestStarts {
            seed,
            starts,
            trivial,
        },
        all,
    )
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
    let (starts, all_starts) = starts_of(&changed, request.seeds.starts, REFINED_STARTS);
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
    let solution = game.solve();
    let chance = game.random_chances();
    let positions = starts.starts.iter();
    let positions: Vec<_> = positions
        .map(|(start, _)| position_of(start, &game.arena))
        .collect();
    let share = |of: &dyn Fn(&crate::scene::grid::Position) -> f64| {
        positions.iter().map(of).sum::<f64>() / positions.len().max(1) as f64
    };
    let caught = |yes: bool| f64::from(u8::from(yes));
    let mut tables = 0.0;
    for table in 0..TABLES {
        let table = random_table(&game, request.seeds.starts, table);
        tables += share(&|both| caught(game.captures(*both, |at| table[game.pair(at)])));
    }
    Ok(Some(MapResult {
        question: map.question.to_owned(),
        map: map.words.clone(),
        starts: positions.len(),
        all_starts,
        paper: map.paper,
        paper_random: map.paper_random,
        optimum: share(&|both| caught(solution.capture_in(*both).is_some())),
        random: share(&|both| chance[game.pair(*both)]),
        random_tables: tables / TABLES as f64,
        chaser: share(&|both| caught(game.captures(*both, |at| chase(at, &game.moves)))),
        trained,
    }))
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
            let caught = |start: &&crate::scene::grid::Position| {
                game.captures(**start, |_| dice.below(game.moves.len()))
            };
            captured += starts.iter().filter(caught).count();
        }
        let n = ados * starts.len();
        let solved: Vec<Outcomes> = (0..ados)
            .map(|index| {
                let table = random_table(game, request.seeds.starts, index);
                let mark = |start: &crate::scene::grid::Position| match game
                    .captures(*start, |at| table[game.pair(at)])
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
