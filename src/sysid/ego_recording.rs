//! Recorded runs of an ego, and the deviations of a model from them.

use crate::ego::Fault;
use crate::experiment::Watch;
use crate::scene::{Scene, Start, StepOutcome};
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Actor, HOLD_DECISIONS, HeldRandom};
use crate::world::DriveScenario;

/// Position x, y and speed of the ego.
type EgoState = [f64; 3];

/// Runs from one start under the same actions, with the ego's mean motion.
pub(super) struct EgoRecording {
    start: Start,
    actions: Vec<usize>,
    seen: Vec<EgoState>,
    /// Sum of squared differences between two runs under different noise.
    apart: f64,
}

/// Recordings and the number of runs that they took.
pub(super) struct RecordedRuns {
    pub recordings: Vec<EgoRecording>,
    pub runs: u64,
}

/// Records runs of an ego under held random actions, to contact or T.
///
/// `most` limits the runs of the ego.
/// The starts come from the calibration stream and are never reported.
/// The first start is run twice under different noise. If the runs differ, every start is
/// run twice and the two runs are averaged.
/// A start is left out if the ego fails at once or if too few runs are left.
pub(super) fn record(
    ego: DriveScenario<'_>,
    (starts, most, seed): (usize, Option<u64>, u64),
    watch: &Watch<'_>,
) -> RecordedRuns {
    let mut scene = ego.world().scene();
    let bench = ego.bench();
    let columns = ego.ego_columns();
    let mut recorded = RecordedRuns {
        recordings: Vec::with_capacity(starts),
        runs: 0,
    };
    let mut noisy = false;
    for index in 0..starts as u64 {
        let left = most.map_or(u64::MAX, |most| most - recorded.runs);
        // A noisy ego needs two runs per start, and a single run would bias the fit.
        if watch.stopped() || left < 1 + u64::from(noisy) {
            break;
        }
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed,
            index,
        };
        let start = bench.draw(key);
        let noise = bench.noise_of(key);
        let mut actor = HeldRandom::new(bench.spaces().actions, HOLD_DECISIONS);
        actor.begin(noise, &start);
        // The actions are fixed in advance, so members can repeat them exactly.
        let actions = (0..bench.clock().decisions()).map(|_| actor.act(&[]));
        let actions: Vec<usize> = actions.collect();
        let first = run(&mut scene, &start, noise, &actions, columns);
        recorded.runs += 1;
        watch.faults.note(index, first.as_ref().err());
        let Ok(mut seen) = first else {
            continue;
        };
        let mut apart = 0.0;
        if noisy || (index == 0 && 1 < left) {
            // Inverted bits give the second run another noise seed.
            let again = run(&mut scene, &start, !noise, &actions, columns);
            recorded.runs += 1;
            watch.faults.note(index, again.as_ref().err());
            let Ok(again) = again else {
                continue;
            };
            noisy = noisy || again != seen;
            // One of the runs may have ended in contact earlier.
            seen.truncate(again.len());
            apart = squares(&seen, &again);
            seen = mean(&seen, &again);
        }
        // A single sample contains no motion.
        if 1 < seen.len() {
            recorded.recordings.push(EgoRecording {
                start,
                actions,
                seen,
                apart,
            });
        }
    }
    recorded
}

fn mean(one: &[EgoState], other: &[EgoState]) -> Vec<EgoState> {
    let pairs = one.iter().zip(other);
    pairs
        .map(|(a, b)| [0, 1, 2].map(|i| 0.5 * (a[i] + b[i])))
        .collect()
}

/// Returns the deviations of a model from the recordings, number by number.
///
/// If the model's run ends first, its last sample is repeated.
pub(super) fn deviations(
    scene: &mut dyn Scene,
    columns: [usize; 3],
    recordings: &[EgoRecording],
) -> Vec<f64> {
    let mut all = Vec::new();
    for recording in recordings {
        // A member with a fault stays at its first sample, which is a poor fit.
        let model = run(scene, &recording.start, 0, &recording.actions, columns);
        let model = model.unwrap_or_else(|_| recording.seen[..1].to_vec());
        let pairs = pairs(&recording.seen, &model);
        all.extend(pairs.flat_map(|(seen, model)| [0, 1, 2].map(|i| model[i] - seen[i])));
    }
    all
}

/// Pairs the samples of a recording with those of a run, extended by its last sample.
fn pairs<'a>(
    seen: &'a [EgoState],
    run: &'a [EgoState],
) -> impl Iterator<Item = (&'a EgoState, &'a EgoState)> {
    // Invariant: every run has a first sample.
    let rest = run.last().into_iter().cycle();
    seen.iter().zip(run.iter().chain(rest))
}

/// Returns the error of an ego's averaged runs due to its noise, m.
pub(super) fn noise_m(runs: &[EgoRecording]) -> f64 {
    let sum: f64 = runs.iter().map(|run| run.apart).sum();
    let count: usize = runs.iter().map(|run| run.seen.len()).sum();
    // Two runs differ by √2 σ, and their mean differs from the true mean by σ/√2.
    0.5 * (sum / count.max(1) as f64).sqrt()
}

fn squares(one: &[EgoState], other: &[EgoState]) -> f64 {
    let square = |(a, b): (&EgoState, &EgoState)| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    pairs(one, other).map(square).sum()
}

fn run(
    scene: &mut dyn Scene,
    start: &Start,
    noise: u64,
    actions: &[usize],
    columns: [usize; 3],
) -> Result<Vec<EgoState>, Fault> {
    let clock = *scene.clock();
    let mut row = vec![0.0; scene.schema().len()];
    let mut seen = Vec::with_capacity(clock.samples());
    scene.reset(start, noise);
    scene.publish(&mut row);
    seen.push(columns.map(|column| row[column]));
    for &action in actions {
        scene.decide(action);
        for _ in 0..clock.samples_per_decision() {
            if seen.len() == clock.samples() {
                return Ok(seen);
            }
            let flow = scene.advance();
            if let StepOutcome::Fault(fault) = flow {
                return Err(fault);
            }
            scene.publish(&mut row);
            seen.push(columns.map(|column| row[column]));
            if matches!(flow, StepOutcome::Contact(_)) {
                return Ok(seen);
            }
        }
    }
    Ok(seen)
}
