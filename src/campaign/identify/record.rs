//! Runs of an ego as seen from outside, and how far a model strays from them.

use crate::campaign::eval::HOLD_DECISIONS;
use crate::scenario::Scenario;
use crate::scene::{Flow, Scene, Start};
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Actor, Held};

/// Position along x and y and speed of the ego.
type Seen = [f64; 3];

/// One run of an ego: what led to it, and where the ego was.
pub(super) struct Recording {
    start: Start,
    actions: Vec<usize>,
    seen: Vec<Seen>,
    /// The same run under other noise.
    again: Vec<Seen>,
}

/// Records runs of an ego under held random actions, to contact or T.
///
/// Starts are of the calibration stream: never those that are reported. Runs
/// in which the ego fails at once are left out.
pub(super) fn record(ego: &Scenario, runs: usize, seed: u64) -> Vec<Recording> {
    let mut scene = ego.world().scene();
    let bench = ego.bench();
    let columns = columns(ego);
    let recorded = (0..runs as u64).map(|index| {
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed,
            index,
        };
        let start = bench.draw(key);
        let noise = bench.noise_of(key);
        let mut actor = Held::new(bench.spaces().actions, HOLD_DECISIONS);
        actor.begin(noise, &start);
        let actions = (0..bench.clock().decisions()).map(|_| actor.act(&[]));
        let actions: Vec<usize> = actions.collect();
        Recording {
            seen: run(&mut *scene, &start, noise, &actions, columns),
            again: run(&mut *scene, &start, !noise, &actions, columns),
            start,
            actions,
        }
    });
    recorded.filter(|run| 1 < run.seen.len()).collect()
}

/// Root mean square distance of a model from the recordings.
///
/// Where the model's run is the shorter one, the model stays where it ended.
pub(super) fn residual_m(scene: &mut dyn Scene, world: &Scenario, runs: &[Recording]) -> f64 {
    let columns = columns(world);
    let pairs = runs.iter().map(|recording| {
        let model = run(scene, &recording.start, 0, &recording.actions, columns);
        (&recording.seen[..], model)
    });
    let (mut sum, mut count) = (0.0, 0usize);
    for (seen, model) in pairs {
        sum += squares(seen, &model);
        count += seen.len();
    }
    (sum / count.max(1) as f64).sqrt()
}

/// How far an ego strays from itself under other noise, as one run from the mean.
pub(super) fn noise_m(runs: &[Recording]) -> f64 {
    let sums = runs.iter().map(|run| squares(&run.seen, &run.again));
    let count: usize = runs.iter().map(|run| run.seen.len()).sum();
    let apart_m = (sums.sum::<f64>() / count.max(1) as f64).sqrt();
    // Two noisy runs differ by √2 of what one differs from the mean.
    apart_m / core::f64::consts::SQRT_2
}

fn squares(seen: &[Seen], model: &[Seen]) -> f64 {
    let Some(&last) = model.last() else {
        return f64::INFINITY;
    };
    let rest = std::iter::repeat(&last);
    let pairs = seen.iter().zip(model.iter().chain(rest));
    let square =
        |(a, b): (&Seen, &Seen)| -> f64 { a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum() };
    pairs.map(square).sum()
}

/// Where a row holds the ego's x, y and speed.
fn columns(scenario: &Scenario) -> [usize; 3] {
    let schema = scenario.world().schema();
    let spec = scenario.drive();
    let ego = spec.and_then(|spec| Some(&spec.agents[spec.egos().next()?.0].name));
    let name = ego.map_or("", String::as_str);
    // Invariant: every trace holds these three of every road user.
    ["x", "y", "speed"].map(|field| schema.position(&format!("{name}.{field}")).unwrap_or(0))
}

fn run(
    scene: &mut dyn Scene,
    start: &Start,
    noise: u64,
    actions: &[usize],
    columns: [usize; 3],
) -> Vec<Seen> {
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
                return seen;
            }
            let flow = scene.advance();
            if matches!(flow, Flow::Fault(_)) {
                return seen;
            }
            scene.publish(&mut row);
            seen.push(columns.map(|column| row[column]));
            if matches!(flow, Flow::Contact(_)) {
                return seen;
            }
        }
    }
    seen
}
