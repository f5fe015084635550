//! Recorded runs of an ego, and the samples that a surrogate is fitted to.

use std::sync::Arc;

use rand::RngExt;

use super::ego_motion::MotionReader;
use super::emergency_brake::Situation;
use super::features::ModelInputs;
use super::fitted_model::FittedModel;
use super::model_fit::LabelledRun;
use super::plan::Planner;
use super::strategy::{Earlier, Strategy};
use super::surrogate_fit::FitSamples;
use super::surrogate_sim::{ModelBench, RunPrefix, VARIATIONS};
use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::rl::Policy;
use crate::scene::Start;
use crate::seed;
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;
use crate::testbench::{
    Actor, Aftermath, Constant, HOLD_DECISIONS, HeldRandom, NoisyStart, PolicyActor, Replay,
    Testbench, play,
};
use crate::world::{DriveScenario, Scenario};

/// First index of the calibration starts reserved for this module.
const FIRST_START: u64 = 1 << 33;

/// Run of the real ego from a calibration start.
#[derive(Clone, Debug)]
pub(super) struct RecordedRun {
    pub start: Start,
    pub noise: u64,
    pub so_far: RunPrefix,
    pub is_success: bool,
    /// Whether the ado followed its trained policy.
    pub as_trained: bool,
}

impl RecordedRun {
    pub(super) fn from(&self) -> NoisyStart<'_> {
        NoisyStart {
            start: &self.start,
            noise: self.noise,
        }
    }
}

/// Draws calibration starts that the nominal ego does not fail by itself.
///
/// An ego in another process is not run, so its starts are not checked.
pub(super) fn starts(nominal: &Scenario, count: u64, seed: u64) -> Vec<(Start, u64)> {
    let mut bench = nominal.bench();
    let neutral = bench.spaces().neutral;
    // A program would have to run for each start, which costs more than a wasted plan.
    let knows = nominal.program().is_none();
    // Four candidates per start bound the search if most starts are trivial.
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

/// Actor of a recorded run.
enum RecordingActor<'a> {
    /// Random actions, held for some decisions.
    Held,
    /// Trained policy of the ado.
    Policy(&'a dyn Policy),
    /// Fixed actions, the last action held.
    Sequence(Vec<usize>),
}

/// Records runs under mixed actions.
///
/// Half are random and held, a quarter follows the policy, and a quarter switches once
/// from one action to another.
pub(super) fn mixed(
    ego: DriveScenario<'_>,
    policy: &dyn Policy,
    starts: &[(Start, u64)],
    watch: &Watch<'_>,
) -> Vec<RecordedRun> {
    let acting = |bench: &Testbench, noise: u64, turn: &WorkItem| {
        let actions = bench.spaces().actions;
        let decisions = bench.clock().decisions();
        // The noise seed keys the generator, so a run does not depend on thread order.
        let mut dice = seed::generator("surrogate", &[noise]);
        let mut one = || dice.random_range(0..actions);
        let (first, second) = (one(), one());
        // All draws are made for every kind of run, so that the kinds share one stream.
        let switched = dice.random_range(1..decisions.max(2));
        // Half of the runs vary the inputs most, and a quarter shows how well the policy
        // does.
        match turn.index % 4 {
            0 | 1 => RecordingActor::Held,
            2 => RecordingActor::Policy(policy),
            _ => {
                let mut sequence = vec![first; switched];
                sequence.push(second);
                RecordingActor::Sequence(sequence)
            }
        }
    };
    recorded(ego, starts, &acting, watch)
}

/// Records runs under the same actions from every start.
pub(super) fn open_loop_runs(
    ego: DriveScenario<'_>,
    actions: &[usize],
    starts: &[(Start, u64)],
    watch: &Watch<'_>,
) -> Vec<RecordedRun> {
    let acting = |_: &Testbench, _: u64, _: &WorkItem| RecordingActor::Sequence(actions.to_vec());
    recorded(ego, starts, &acting, watch)
}

fn recorded<'a>(
    ego: DriveScenario<'_>,
    starts: &[(Start, u64)],
    acting: &(dyn Fn(&Testbench, u64, &WorkItem) -> RecordingActor<'a> + Sync),
    watch: &Watch<'_>,
) -> Vec<RecordedRun> {
    let reader = MotionReader::of(ego);
    let one = |bench: &mut Testbench, from: &(Start, u64), turn: &WorkItem| {
        let (start, noise) = (&from.0, from.1);
        let acting = acting(bench, noise, turn);
        let mut actor: Box<dyn Actor + '_> = match &acting {
            RecordingActor::Held => {
                Box::new(HeldRandom::new(bench.spaces().actions, HOLD_DECISIONS))
            }
            RecordingActor::Policy(policy) => Box::new(PolicyActor(*policy)),
            RecordingActor::Sequence(actions) => Box::new(Replay::holding(actions)),
        };
        let skip = Aftermath::Skip;
        let episode = watch.play(bench, NoisyStart::from(from), turn.index, &mut *actor, skip);
        let mut motion = Vec::new();
        reader.follow(bench, &mut motion);
        // A fault of the ego says nothing about its behaviour, so the run is dropped.
        episode.fault.is_none().then(|| RecordedRun {
            start: start.clone(),
            noise,
            so_far: RunPrefix {
                actions: episode.actions,
                motion,
            },
            is_success: episode.verdict.is_success(),
            as_trained: matches!(acting, RecordingActor::Policy(_)),
        })
    };
    let all = EpisodeLoop::uncounted(watch);
    let runs = all.run(starts, || ego.bench(), one);
    runs.into_iter().flatten().collect()
}

/// Records runs that are planned in a surrogate.
pub(super) fn planned<'a>(
    ego: DriveScenario<'_>,
    planner: impl Fn() -> Planner<'a> + Sync + Send,
    starts: &[(Start, u64)],
    watch: &Watch<'_>,
) -> Vec<RecordedRun> {
    let worker = || (planner(), ego.bench());
    let one =
        |(planner, bench): &mut (Planner<'a>, Testbench), from: &(Start, u64), turn: &WorkItem| {
            let (start, noise) = (&from.0, from.1);
            let from = NoisyStart { start, noise };
            let run = planner.run(bench, from, Aftermath::Skip, &Earlier::default());
            watch.faults.note(turn.index as u64, bench.fault());
            bench.fault().is_none().then(|| RecordedRun {
                start: start.clone(),
                noise,
                is_success: bench.verdict().is_some_and(|verdict| verdict.is_success()),
                as_trained: run.followed_throughout() == Some(&Strategy::AsTrained),
                so_far: run.so_far,
            })
        };
    let runs = EpisodeLoop::uncounted(watch).run(starts, worker, one);
    runs.into_iter().flatten().collect()
}

/// Returns the inputs of the ego in recorded runs, with its answers.
///
/// The model reads the inputs while the ego repeats its recorded motion, so they match
/// the inputs during planning.
pub(super) fn labelled(world: DriveScenario<'_>, runs: &[RecordedRun]) -> Vec<LabelledRun> {
    let mut model = ModelBench::quick(world);
    let sample_s = model.bench.clock().sample_s;
    let one = |run: &RecordedRun| {
        let inputs = model.percepts(run.from(), &run.so_far);
        let pairs = run.so_far.motion.windows(2);
        let samples = inputs.percepts.iter().zip(pairs);
        let answers = samples
            .map(|(percept, pair)| {
                let next_mps2 = (pair[1].speed_mps - pair[0].speed_mps) / sample_s;
                let lateral_mps = (pair[1].lateral_m - pair[0].lateral_m) / sample_s;
                // The change is learned, because most of the time an ego keeps its
                // acceleration.
                [next_mps2 - percept.own.accel_mps2, lateral_mps]
            })
            .collect();
        LabelledRun { inputs, answers }
    };
    runs.iter().map(one).collect()
}

/// Converts runs to rows and answers, including those of stock controllers.
pub(super) fn samples(runs: &[LabelledRun], nearest: &Arc<[FittedModel]>) -> FitSamples {
    let mut samples = FitSamples::default();
    let (mut model_inputs, mut row) = (ModelInputs::default(), Vec::new());
    for run in runs {
        let percepts = &run.inputs.percepts;
        // Models have a memory, which begins anew with every run.
        if let Some(first) = percepts.first() {
            model_inputs.begin(nearest, &run.inputs.briefing, first);
        }
        for (percept, [change_mps2, lateral_mps]) in percepts.iter().zip(&run.answers) {
            model_inputs.read(percept, &mut row);
            samples.width = row.len();
            samples.inputs.extend_from_slice(&row);
            let answer = [percept.own.accel_mps2, *change_mps2, *lateral_mps];
            samples.answers.push(answer);
            samples.situations.push(Situation::of(percept));
        }
    }
    samples
}

/// Largest difference of a coordinate between the plants, m.
const ALIKE_M: f64 = 0.005;

/// Returns the plant on which plans are judged.
///
/// The kinematic plant is many times as fast. It is used if all vehicles move on it
/// as on the world's own plant in these runs.
/// Along a lane both plants agree. A lane change differs by some centimetres on the rigid
/// plant, and centimetres decide whether a rule is kept.
pub(super) fn judged_on(world: DriveScenario<'_>, runs: &[RecordedRun]) -> PlantKind {
    let own = world.spec().plant;
    let columns = places(world);
    let (mut there, mut here) = (ModelBench::on(world, own), ModelBench::quick(world));
    let agrees = |run: &RecordedRun| {
        // Both replay the recorded motion of the ego, so only the others can differ.
        for model in [&mut there, &mut here] {
            model.begin(run.from(), &run.so_far, None, VARIATIONS[0]);
        }
        // Beyond the recorded motion no ego is there to compare with.
        let samples = run.so_far.motion.len();
        columns.iter().all(|&column| {
            let of = |bench: &Testbench| bench.trace().column(column).to_vec();
            let pairs = of(&there.bench).into_iter().zip(of(&here.bench));
            pairs.take(samples).all(|(a, b)| (a - b).abs() <= ALIKE_M)
        })
    };
    let is_own = own == PlantKind::Kinematic;
    if is_own || runs.iter().all(agrees) {
        PlantKind::Kinematic
    } else {
        own
    }
}

/// Returns the columns of all published positions.
fn places(world: DriveScenario<'_>) -> Vec<usize> {
    let schema = world.world().schema();
    let agents = world.spec().agents.iter();
    let names = agents.flat_map(|agent| ["x", "y"].map(|axis| format!("{}.{axis}", agent.name)));
    // Invariant: every trace holds the positions of all agents.
    names.filter_map(|name| schema.position(&name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Watch;

    fn judged(name: &str, plant: PlantKind, actions: &[usize]) -> PlantKind {
        let world = Scenario::shipped(name)
            .expect("shipped")
            .expect("sound")
            .on(plant);
        let from = starts(&world, 6, 8);
        let world = world.drive().expect("driven");
        judged_on(
            world,
            &open_loop_runs(world, actions, &from, &Watch::unwatched()),
        )
    }

    #[test]
    fn only_where_nobody_skids_a_plan_is_judged_on_the_kinematic_plant() {
        use PlantKind::{Kinematic, Rigid};
        assert_eq!(judged("acc", Rigid, &[0, 0, 2, 1]), Kinematic);
        assert_eq!(judged("acc", Kinematic, &[0]), Kinematic);
        let merging = [1, 4, 4];
        assert_eq!(judged("cut_in", Rigid, &merging), Rigid);
        assert_eq!(judged("cut_in", Kinematic, &merging), Kinematic);
    }
}
