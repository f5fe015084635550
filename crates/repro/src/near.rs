//! Failures at starts with a value similar to that of a failing start.
//!
//! The paper's remark on generalisation (Sec. V-B) finds failing starts with smaller and
//! larger distances and speeds around a failing start. Several of them were never seen in
//! training. The distance between starts is that of the ado's own value V.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use brakecheck::experiment::{TestStarts, Watch};
use brakecheck::rl::Policy;
use brakecheck::scene::{Axis, Start};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stats::wilson;
use brakecheck::testbench::{Aftermath, NoisyStart, PolicyActor, Testbench};
use brakecheck::world::Scenario;
use brakecheck_experiment::experiment::episode_loop::EpisodeLoop;

/// Difference up to which two starts count as equal, as a share of each range.
const SAME: f64 = 0.01;

/// Trained ado with its training starts.
#[derive(Clone, Copy)]
pub struct TrainedPolicy<'a> {
    /// Policy of the ado.
    pub policy: &'a dyn Policy,
    /// Seed of its training.
    pub seed: u64,
    /// Number of training episodes.
    pub episodes: u64,
}

/// Neighbourhood of a failing start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearFailing {
    /// Name of the world.
    pub world: String,
    /// Start by axis.
    pub around: Vec<(String, f64)>,
    /// Value V of the ado there.
    pub value: f64,
    /// True if the ado makes the ego fail from it.
    pub fails: bool,
    /// Number of evaluated starts, without trivial starts.
    pub starts: usize,
    /// A row per δ.
    pub rows: Vec<NearRow>,
}

/// Starts x with |V(x) − V(x0)| < δ.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NearRow {
    /// Value of δ.
    pub delta: f64,
    /// Number of such starts.
    pub near: usize,
    /// Number of such starts from which the ego fails.
    pub failing: usize,
    /// Wilson's 95 % interval of that share.
    pub ci95: [f64; 2],
    /// Per axis, failing starts with a smaller and with a larger value than x0.
    pub below_above: Vec<(String, [usize; 2])>,
    /// Failing starts that are similar to no training start.
    pub never_seen: usize,
}

/// Evaluates all `starts` that are δ-near `around`, for each δ.
///
/// Every training start counts as seen, even if training did not reach it, so `never_seen`
/// is a lower bound. `None`: stopped.
pub fn near_starts(
    scenario: &Scenario,
    trained: TrainedPolicy<'_>,
    around: &Start,
    starts: &TestStarts,
    deltas: &[f64],
    watch: &Watch<'_>,
) -> Option<NearFailing> {
    let axes = scenario.axes();
    let look = |bench: &mut Testbench, from: NoisyStart<'_>, index: usize| {
        let mut obs = vec![0.0; bench.spaces().observation];
        // The value is read at the first observation, before the ado acts.
        bench.begin(from.start, from.noise, Aftermath::Skip);
        bench.observe(&mut obs);
        let value = f64::from(trained.policy.value(&obs));
        let mut ado = PolicyActor(trained.policy);
        let episode = watch.play(bench, from, index, &mut ado, Aftermath::Skip);
        (value, episode.verdict.is_success())
    };
    // The failing start itself is evaluated first, as the centre of the neighbourhoods.
    let mut bench = scenario.bench();
    // The paper's start has no index, so it gets the noise seed 0 and the index 0.
    let centre = NoisyStart {
        start: around,
        noise: 0,
    };
    let (value, fails) = look(&mut bench, centre, 0);
    // Starts follow from their keys, so those of a training need no file.
    let training_starts: Vec<Start> = (0..trained.episodes)
        .map(|index| {
            bench.draw(StartKey {
                purpose: Purpose::Train,
                seed: trained.seed,
                index,
            })
        })
        .collect();
    // Faults are reported by the position among all starts.
    let untried: Vec<usize> = (0..starts.starts.len())
        .filter(|index| !starts.trivial[*index])
        .collect();
    let all = EpisodeLoop::uncounted(watch);
    let evaluated = all.each(
        &untried,
        || scenario.bench(),
        |bench, &index, _| {
            let from = NoisyStart::from(&starts.starts[index]);
            let (value, fails) = look(bench, from, index);
            Some((from.start, value, fails))
        },
    );
    // A stopped evaluation has gaps and would bias the shares.
    let looked: Vec<(&Start, f64, bool)> = evaluated.into_iter().collect::<Option<_>>()?;
    let row = |delta: f64| {
        // Near in the ado's own estimate, as in the paper.
        let near: Vec<_> = looked
            .iter()
            .filter(|(_, v, _)| (v - value).abs() < delta)
            .collect();
        let failing: Vec<&Start> = near.iter().filter(|n| n.2).map(|n| n.0).collect();
        let sides = axes.iter().enumerate().map(|(i, axis)| {
            let count = |test: &dyn Fn(f64) -> bool| {
                failing.iter().filter(|start| test(start.0[i])).count()
            };
            // Starts with exactly the same value count on neither side.
            let below_above = [count(&|v| v < around.0[i]), count(&|v| around.0[i] < v)];
            (axis.name.clone(), below_above)
        });
        // Every start is compared with all training starts, so this runs in parallel.
        let unseen = failing.par_iter().filter(|start| {
            training_starts
                .iter()
                .all(|other| !are_same(&axes, start, other))
        });
        NearRow {
            delta,
            near: near.len(),
            failing: failing.len(),
            ci95: wilson(failing.len(), near.len()),
            below_above: sides.collect(),
            never_seen: unseen.count(),
        }
    };
    Some(NearFailing {
        world: scenario.name().to_owned(),
        around: axes
            .iter()
            .map(|a| a.name.clone())
            .zip(around.0.clone())
            .collect(),
        value,
        fails,
        starts: looked.len(),
        rows: deltas.iter().map(|delta| row(*delta)).collect(),
    })
}

fn are_same(axes: &[Axis], a: &Start, b: &Start) -> bool {
    let pairs = a.0.iter().zip(&b.0).zip(axes);
    let mut apart = pairs.map(|((a, b), axis)| ((a - b).abs(), SAME * (axis.hi - axis.lo)));
    // Ranges differ by orders of magnitude, so each axis is compared in its own share.
    apart.all(|(apart, same)| apart <= same)
}

/// Explanation of the columns, below the table.
const EXPLAINED: &str = "
- failing start: the paper's; V: its value, as the trained ado sees it
- near starts: test starts whose value differs from V by less than δ
- of those fail: those from which the ado makes the ego fail, with the interval of their share
- failing with less / more: of those that fail, how many have less and more of each quantity
- never met in training: of those that fail, how many are like no start of the training
";

/// Formats the neighbourhoods as a Markdown table.
pub fn near_starts_markdown(all: &[NearFailing]) -> String {
    let lines = all.iter().flat_map(|near| {
        let around = near
            .around
            .iter()
            .map(|(name, v)| format!("{name} {v:.2}"))
            .collect::<Vec<_>>()
            .join(", ");
        let fails = if near.fails {
            ""
        } else {
            " (does not fail here)"
        };
        near.rows.iter().map(move |row| {
            let sides = row
                .below_above
                .iter()
                .map(|(name, [less, more])| format!("{name} {less} / {more}"));
            // Without a near start the share is 0, and its interval from 0 to 1.
            let share = row.failing as f64 / row.near.max(1) as f64;
            let [share, lo, hi] = [share, row.ci95[0], row.ci95[1]].map(|rate| 100.0 * rate);
            [
                near.world.clone(),
                format!("{around}{fails}"),
                format!("{:.3}", near.value),
                row.delta.to_string(),
                format!("{} of {}", row.near, near.starts),
                format!("{} ({share:.1} %) [{lo:.1}, {hi:.1}]", row.failing),
                sides.collect::<Vec<_>>().join("; "),
                row.never_seen.to_string(),
            ]
        })
    });
    let columns = [
        "world",
        "failing start",
        "V",
        "δ",
        "near starts",
        "of those fail [95 %]",
        "failing with less / more",
        "never met in training",
    ];
    let text = brakecheck_report::report::table::TextTable::new(columns, lines).to_markdown();
    text + EXPLAINED
}
