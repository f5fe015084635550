//! Evaluating an ado: frozen policy or baseline × ego × test starts → a row.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use cpu_time::ThreadTime;
use rayon::prelude::*;

use super::Watch;
use super::heuristic::Heuristic;
use super::replays::{NearestReplay, replay_nearest};
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::run::{
    ClosingSpeed, Counterexample, KeptError, Row, RunError, Stored, file_name, wilson,
};
use crate::scenario::{Against, Change, Scenario};
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::stl::Explanation;
use crate::testbench::{
    Actor, Aftermath, Constant, Episode, Held, PolicyActor, Random, Testbench, play,
};

/// Decisions for which the held-random baseline keeps an action.
pub const HOLD_DECISIONS: usize = 5;

/// Test starts, with those on which the nominal ego fails by itself.
#[derive(Clone, Debug)]
pub struct TestStarts {
    /// Seed of the stream.
    pub seed: u64,
    /// Each start with the seed of its noise.
    pub starts: Vec<(Start, u64)>,
    /// Whether the nominal ego fails without an adversary, all rules kept.
    pub trivial: Vec<bool>,
}

/// Draws `count` test starts and plays each with coasting ados.
///
/// A finite world of no more than `count` starts gives each of them once.
///
/// `scenario` must be the nominal one on the plant its file names: what is
/// trivial is fixed once and carried to all egos and plants. `None`: stopped.
pub fn test_starts(
    scenario: &Scenario,
    seed: u64,
    count: usize,
    watch: &Watch<'_>,
) -> Option<TestStarts> {
    let bench = scenario.bench();
    let key = |index: usize| StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    };
    let listed = scenario.starts().filter(|all| all.len() <= count);
    let starts: Vec<(Start, u64)> = match listed {
        Some(all) => {
            let starts = all.into_iter().enumerate();
            starts
                .map(|(i, start)| (start, bench.noise_of(key(i))))
                .collect()
        }
        None => {
            let keys = (0..count).map(key);
            keys.map(|key| (bench.draw(key), bench.noise_of(key)))
                .collect()
        }
    };
    let neutral = bench.spaces().neutral;
    let trivial = starts
        .par_iter()
        .map_init(
            || scenario.bench(),
            |bench, (start, noise)| {
                if watch.stopped() {
                    return false;
                }
                let mut coasting = Constant(neutral);
                play(bench, start, *noise, &mut coasting, Aftermath::Skip)
                    .verdict
                    .is_success()
            },
        )
        .collect();
    (!watch.stopped()).then_some(TestStarts {
        seed,
        starts,
        trivial,
    })
}

/// Who plays the ado.
#[derive(Clone, Copy)]
pub enum Ado<'a> {
    /// A trained policy and the seed of its training.
    Trained(&'a dyn Policy, u64),
    /// A uniformly random action at each decision.
    Random,
    /// A uniformly random action, held for five decisions.
    Held,
    /// The same action all the time.
    Constant(usize),
    /// A rule that nobody trained: its word and its method in rows.
    Rule(&'a dyn Policy, &'static str, &'static str),
    /// A hand-made rule, tuned once.
    Heuristic(&'a Heuristic),
    /// So many of the nearest stored counterexamples, until one succeeds.
    Replays(&'a Stored, usize),
}

impl Ado<'_> {
    /// The word in rows.
    pub fn word(&self) -> &'static str {
        match self {
            Ado::Trained(..) => "trained",
            Ado::Random => "random",
            Ado::Held => "hold",
            Ado::Constant(_) => "constant",
            Ado::Rule(_, word, _) => word,
            Ado::Heuristic(_) => "heuristic",
            Ado::Replays(_, 1) => "replay",
            Ado::Replays(..) => "replays",
        }
    }

    fn method(&self, scenario: &Scenario) -> String {
        match self {
            Ado::Trained(..) => match scenario.against {
                Against::Nominal => scenario.learner.name().to_lowercase(),
                family => format!("{}, {family}", scenario.learner.name().to_lowercase()),
            },
            Ado::Random => "random".to_owned(),
            Ado::Held => format!("random, held {HOLD_DECISIONS} decisions"),
            Ado::Constant(action) => scenario.action_label(*action),
            Ado::Rule(_, _, method) => (*method).to_owned(),
            Ado::Heuristic(heuristic) => heuristic.text.clone(),
            Ado::Replays(_, nearest) => format!("open loop, the {nearest} nearest"),
        }
    }

    /// Somebody who acts so.
    pub fn actor(&self, actions: usize) -> Box<dyn Actor + '_> {
        match *self {
            Ado::Trained(policy, _) | Ado::Rule(policy, ..) => Box::new(PolicyActor(policy)),
            Ado::Random => Box::new(Random::new(actions)),
            Ado::Held => Box::new(Held::new(actions, HOLD_DECISIONS)),
            Ado::Constant(action) => Box::new(Constant(action)),
            Ado::Heuristic(heuristic) => Box::new(PolicyActor(heuristic)),
            Ado::Replays(stored, _) => Box::new(NearestReplay::new(stored, 0)),
        }
    }
}

/// What to evaluate.
#[derive(Clone, Copy)]
pub struct EvalRequest<'a> {
    /// The world, with the ego to be tested.
    pub scenario: &'a Scenario,
    /// What rows call that ego.
    pub ego: &'a str,
    /// Who plays the ado.
    pub ado: Ado<'a>,
    /// The test starts.
    pub starts: &'a TestStarts,
}

/// How one episode of an evaluation went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// How it was judged.
    pub verdict: Verdict,
    /// Closing speed, if the agents touched.
    pub closing_speed_mps: Option<f64>,
    /// Episodes run; only `Ado::Replays` may take more than one.
    pub simulations: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
}

/// A row and the outcomes behind it.
#[derive(Clone, Debug)]
pub struct Evaluated {
    /// The row.
    pub row: Row,
    /// Per start; `None` for trivial ones and for those not reached.
    pub outcomes: Vec<Option<Outcome>>,
}

/// Plays every start once and counts.
pub fn eval(request: &EvalRequest<'_>, watch: &Watch<'_>) -> Evaluated {
    let starts = request.starts;
    let done = AtomicU64::new(0);
    let total = starts.starts.len() as u64;
    let outcomes: Vec<Option<Outcome>> = (0..starts.starts.len())
        .into_par_iter()
        .map_init(
            || request.scenario.bench(),
            |bench, index| {
                (watch.progress)(done.fetch_add(1, Ordering::Relaxed), total);
                if starts.trivial[index] || watch.stopped() {
                    return None;
                }
                let clock = ThreadTime::now();
                let (episode, simulations, physics_steps) = request.attempt(bench, index);
                Some(Outcome {
                    verdict: episode.verdict,
                    closing_speed_mps: episode.contact.map(|touch| touch.closing_speed_mps),
                    simulations,
                    physics_steps,
                    cpu_s: clock.elapsed().as_secs_f64(),
                })
            },
        )
        .collect();
    Evaluated {
        row: request.row(&outcomes),
        outcomes,
    }
}

impl EvalRequest<'_> {
    /// Plays one start, to contact or the horizon after a success.
    pub fn play(&self, bench: &mut Testbench, index: usize) -> Episode {
        self.attempt(bench, index).0
    }

    /// The same with the simulations and physics steps it took.
    fn attempt(&self, bench: &mut Testbench, index: usize) -> (Episode, u64, u64) {
        let (start, noise) = &self.starts.starts[index];
        if let Ado::Replays(stored, nearest) = self.ado {
            return replay_nearest(bench, (start, *noise), stored, nearest);
        }
        let mut actor = self.ado.actor(bench.spaces().actions);
        let episode = play(bench, start, *noise, &mut *actor, Aftermath::Play);
        let physics_steps = episode.physics_steps;
        (episode, 1, physics_steps)
    }

    pub(super) fn row(&self, outcomes: &[Option<Outcome>]) -> Row {
        let mut row = blank_row(self.scenario, self.ego, self.starts);
        row.ado = self.ado.word().to_owned();
        row.method = self.ado.method(self.scenario);
        if let Ado::Trained(_, seed) = self.ado {
            row.train_seed = Some(seed);
        }
        let played = outcomes.iter().flatten();
        let simulations: u64 = played.clone().map(|outcome| outcome.simulations).sum();
        let count = |test: fn(&Verdict) -> bool| {
            let verdicts = played.clone().map(|outcome| &outcome.verdict);
            verdicts.filter(|verdict| test(verdict)).count()
        };
        let fouls = count(|verdict| matches!(verdict, Verdict::Foul { .. }));
        row.invalid = count(|verdict| matches!(verdict, Verdict::Invalid));
        row.physics_steps = played.clone().map(|outcome| outcome.physics_steps).sum();
        row.cpu_s = played.clone().map(|outcome| outcome.cpu_s).sum();
        let contacts: Vec<f64> = played.filter_map(|o| o.closing_speed_mps).collect();
        let solved = outcomes.iter().zip(&self.starts.trivial);
        row.solved = solved
            .map(|(outcome, trivial)| match (outcome, trivial) {
                (_, true) => 't',
                (Some(outcome), _) if outcome.verdict.is_success() => '1',
                (Some(_), _) => '0',
                (None, _) => '-',
            })
            .collect();
        count_solved(&mut row);
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        row.foul_rate = share(fouls, row.starts);
        row.contact_rate = share(contacts.len(), row.starts);
        row.closing_speed_mps = ClosingSpeed::of(contacts);
        row
    }
}

/// A row of which only the headings are filled in.
pub(super) fn blank_row(scenario: &Scenario, ego: &str, starts: &TestStarts) -> Row {
    Row {
        world: scenario.name.clone(),
        plant: scenario.plant(),
        judge: scenario.rulebook().judge,
        ego: ego.to_owned(),
        ado: String::new(),
        method: String::new(),
        train_seed: None,
        told: None,
        start_seed: starts.seed,
        starts: 0,
        trivial: 0,
        successes: 0,
        success_rate: 0.0,
        ci95: [0.0, 1.0],
        recall: None,
        beyond_search: None,
        foul_rate: 0.0,
        contact_rate: 0.0,
        closing_speed_mps: None,
        invalid: 0,
        sims_per_start: 0.0,
        physics_steps: 0,
        cpu_s: 0.0,
        anytime: Vec::new(),
        unconfirmed: None,
        solved: String::new(),
    }
}

/// Fills the counts of a row from its `solved`.
pub(super) fn count_solved(row: &mut Row) {
    let count = |mark: u8| row.solved.bytes().filter(|b| *b == mark).count();
    row.successes = count(b'1');
    row.starts = row.successes + count(b'0');
    row.trivial = count(b't');
    row.success_rate = share(row.successes, row.starts);
    row.ci95 = wilson(row.successes, row.starts);
}

fn share(part: usize, whole: usize) -> f64 {
    match whole {
        0 => 0.0,
        _ => part as f64 / whole as f64,
    }
}

/// The constant ado that succeeds most often; ties go to the lower action.
pub fn best_constant(
    scenario: &Scenario,
    ego: &str,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Evaluated {
    let constant = |action| {
        let request = EvalRequest {
            scenario,
            ego,
            ado: Ado::Constant(action),
            starts,
        };
        eval(&request, watch)
    };
    let actions = scenario.world().spaces().actions;
    let mut best = constant(0);
    for action in 1..actions {
        let other = constant(action);
        if best.row.successes < other.row.successes {
            best = other;
        }
    }
    best.row.method = format!("{}, the best of {actions}", best.row.method);
    best
}

/// Why the ego fails in the first counterexample of an evaluation.
///
/// Gives the position of its start and the explanation of ρ(ψ_ego) on the
/// judged samples; `None` when nothing was solved.
pub fn explain_first(
    request: &EvalRequest<'_>,
    evaluated: &Evaluated,
) -> Option<(usize, Explanation)> {
    let index = evaluated.row.solved.bytes().position(|mark| mark == b'1')?;
    let episode = request.play(&mut request.scenario.bench(), index);
    let mut judged = episode.trace;
    judged.truncate(episode.judged);
    Some((index, request.scenario.rulebook().spec.explain(&judged)))
}

/// Writes the first `most` counterexamples of an evaluation into a directory.
///
/// Each is played again (episodes are pure functions of their start) and
/// written as `WORLD-EGO-INDEX.ron` with its samples as `.csv` beside it.
///
/// # Errors
/// The disk refuses.
pub fn keep(
    request: &EvalRequest<'_>,
    change: &Change,
    evaluated: &Evaluated,
    dir: &Path,
    most: usize,
) -> Result<Vec<PathBuf>, KeptError> {
    let mut again = |bench: &mut Testbench, index| request.play(bench, index);
    keep_played(request, change, evaluated, dir, most, &mut again)
}

/// The same, for starts whose solution `again` plays.
///
/// # Errors
/// The disk refuses.
pub fn keep_played(
    request: &EvalRequest<'_>,
    change: &Change,
    evaluated: &Evaluated,
    dir: &Path,
    most: usize,
    again: &mut dyn FnMut(&mut Testbench, usize) -> Episode,
) -> Result<Vec<PathBuf>, KeptError> {
    std::fs::create_dir_all(dir).map_err(|source| RunError::Io {
        verb: "creating",
        path: dir.into(),
        source,
    })?;
    let mut bench = request.scenario.bench();
    let solved = evaluated.outcomes.iter().enumerate();
    let solved = solved
        .filter(|(_, outcome)| outcome.is_some_and(|outcome| outcome.verdict.is_success()))
        .take(most);
    let mut files = Vec::new();
    for (index, _) in solved {
        let episode = again(&mut bench, index);
        let ado = request.ado.word();
        let kept = Counterexample::record(request.scenario, request.ego, change, ado, &episode);
        let stem = file_stem(request, index);
        files.push(kept.save_as(dir, &stem, &episode.trace)?);
    }
    Ok(files)
}

/// `WORLD-EGO-PLANT-SEED-INDEX`, with whatever could disturb a path replaced.
fn file_stem(request: &EvalRequest<'_>, index: usize) -> String {
    let plant = format!("{:?}", request.scenario.plant()).to_lowercase();
    format!(
        "{}-{}-{plant}-{}-{index:04}",
        file_name(&request.scenario.name),
        file_name(request.ego),
        request.starts.seed
    )
}
