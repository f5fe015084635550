//! Recording runs of an ego, and what a surrogate is fitted to.

use rand::RngExt;

use super::again::Earlier;
use super::bench::{ModelBench, Origin, SoFar};
use super::fit::Samples;
use super::motion::MotionReader;
use super::plan::Planner;
use crate::campaign::Watch;
use crate::campaign::episodes::{EpisodeLoop, Turn};
use crate::rl::Policy;
use crate::scenario::Scenario;
use crate::scene::Start;
use crate::seed::{self, Purpose, StartKey};
use crate::testbench::{
    Actor, Aftermath, Constant, HOLD_DECISIONS, HeldRandom, PolicyActor, Replay, Testbench, play,
};

/// Calibration starts from here on are for this alone.
const FIRST_START: u64 = 1 << 33;

/// A run of the real ego from a calibration start.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub start: Start,
    pub noise: u64,
    pub so_far: SoFar,
    pub is_success: bool,
    /// Whether the ado acted as it was trained.
    pub as_trained: bool,
}

impl Run {
    pub fn from(&self) -> Origin<'_> {
        (&self.start, self.noise)
    }
}

/// Calibration starts, none of which the nominal ego fails by itself, as far as
/// that can be known without running a program.
pub(super) fn starts(nominal: &Scenario, count: u64, seed: u64) -> Vec<(Start, u64)> {
    let mut bench = nominal.bench();
    let neutral = bench.spaces().neutral;
    let knows = nominal.program().is_none();
    let keys = (0..4 * count).map(|index| StartKey {
        purpose: Purpose::Calibration,
        seed,
        index: FIRST_START + index,
    });
    let mut starts = Vec::new();
    for key in keys {
        if starts.len() as u64 == count {
            break;
        }
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        let mut coasting = Constant(neutral);
        let skip = Aftermath::Skip;
        let fails = knows
            && play(&mut bench, &start, noise, &mut coasting, skip)
                .verdict
                .is_success();
        if !fails {
            starts.push((start, noise));
        }
    }
    starts
}

/// Runs under a mixture of actions: half of them random and held, a quarter as
/// the policy acts, a quarter one action up to some time and then another.
pub(super) fn mixed(
    ego: &Scenario,
    policy: &dyn Policy,
    starts: &[(Start, u64)],
    watch: &Watch<'_>,
) -> Vec<Run> {
    let Some(reader) = MotionReader::of(ego) else {
        return Vec::new();
    };
    let one = |bench: &mut Testbench, from: &(Start, u64), turn: &Turn| {
        let actions = bench.spaces().actions;
        let decisions = bench.clock().decisions();
        let mut dice = seed::generator("surrogate", &[from.1]);
        let mut one = || dice.random_range(0..actions);
        let (first, second) = (one(), one());
        let switched = dice.random_range(1..decisions.max(2));
        let then = vec![first; switched];
        let mut actor: Box<dyn Actor + '_> = match turn.index % 4 {
            0 | 1 => Box::new(HeldRandom::new(actions, HOLD_DECISIONS)),
            2 => Box::new(PolicyActor(policy)),
            _ => Box::new(Replay::then(&then, second)),
        };
        let (start, noise) = (&from.0, from.1);
        let skip = Aftermath::Skip;
        let episode = watch.play(bench, (start, noise), turn.index, &mut *actor, skip);
        let mut motion = Vec::new();
        reader.follow(bench, &mut motion);
        episode.fault.is_none().then(|| Run {
            start: start.clone(),
            noise,
            so_far: SoFar {
                actions: episode.actions,
                motion,
            },
            is_success: episode.verdict.is_success(),
            as_trained: turn.index % 4 == 2,
        })
    };
    let all = EpisodeLoop::uncounted(watch);
    let runs = all.run(starts, || ego.bench(), one);
    runs.into_iter().flatten().collect()
}

/// Runs that are planned in a surrogate.
pub(super) fn planned<'a>(
    ego: &Scenario,
    planner: impl Fn() -> Option<Planner<'a>> + Sync + Send,
    starts: &[(Start, u64)],
    watch: &Watch<'_>,
) -> Vec<Run> {
    let worker = || (planner(), ego.bench());
    let one = |(planner, bench): &mut (Option<Planner<'a>>, Testbench),
               from: &(Start, u64),
               turn: &Turn| {
        let (start, noise) = (&from.0, from.1);
        let run =
            planner
                .as_mut()?
                .run(bench, (start, noise), Aftermath::Skip, &Earlier::default());
        watch.faults.note(turn.index as u64, bench.fault());
        bench.fault().is_none().then(|| Run {
            start: start.clone(),
            noise,
            is_success: bench.verdict().is_some_and(|verdict| verdict.is_success()),
            as_trained: run.is_as_trained(),
            so_far: run.so_far,
        })
    };
    let runs = EpisodeLoop::uncounted(watch).run(starts, worker, one);
    runs.into_iter().flatten().collect()
}

/// What the ego saw and did in runs, sample by sample.
///
/// What it saw is read in the model, with the ego moved as it was recorded: so
/// inputs are there what they will be in plans. `None`: nobody drives.
pub(super) fn samples(world: &Scenario, runs: &[Run]) -> Option<Samples> {
    let mut model = ModelBench::of(world)?;
    let sample_s = model.bench.clock().sample_s;
    let mut samples = Samples::default();
    for run in runs {
        let heard = model.percepts(run.from(), &run.so_far);
        samples.width = heard.width.max(samples.width);
        let rows = heard.rows.chunks_exact(heard.width.max(1));
        for (row, pair) in rows.zip(run.so_far.motion.windows(2)) {
            let accel_mps2 = f64::from(row[1]);
            let next_mps2 = (pair[1].speed_mps - pair[0].speed_mps) / sample_s;
            let lateral_mps = (pair[1].lateral_m - pair[0].lateral_m) / sample_s;
            samples.inputs.extend_from_slice(row);
            let answer = [accel_mps2, next_mps2 - accel_mps2, lateral_mps];
            samples.answers.push(answer);
        }
    }
    Some(samples)
}
