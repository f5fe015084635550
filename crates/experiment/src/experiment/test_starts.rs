//! Test starts: drawn once, and the same for every ego, ado and method.

use std::ops::Range;
use std::path::Path;

use super::ego_under_test::EgoUnderTest;
use super::episode_loop::{EpisodeLoop, WorkItem};
use super::progress::Watch;
use super::trivial_starts::TrivialStarts;
use crate::run_dir::FailsAlone;
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{FaultLog, Testbench};
use crate::world::Scenario;

/// Test starts, with those on which the nominal ego fails by itself.
///
/// Starts on which the nominal ego fails are left out for every ego, so that all rates
/// refer to the same starts. If the nominal ego does not represent the others, each ego
/// has its own trivial starts.
#[derive(Clone, Debug)]
pub struct TestStarts {
    /// Seed of the stream.
    pub seed: u64,
    /// Each start with the seed of its noise.
    pub starts: Vec<(Start, u64)>,
    /// True if the nominal ego fails without an adversary, with all rules kept.
    ///
    /// A start on which the ego did not run is not trivial. The watch's log of faults
    /// contains it.
    pub trivial: Vec<bool>,
}

/// Draws `count` test starts and plays each with coasting ados.
///
/// A finite world of no more than `count` starts gives each of them once, and a world
/// without ranges gives its only start.
///
/// `scenario` must be the nominal world on the plant of its file, because trivial starts
/// are determined once for all egos and plants. `None`: stopped.
pub fn test_starts(
    scenario: &Scenario,
    seed: u64,
    count: usize,
    watch: &Watch<'_>,
) -> Option<TestStarts> {
    let starts = listed_or_drawn(scenario, seed, count);
    TestStarts::tried(scenario, seed, starts, watch)
}

/// Draws test starts of which none is left out, without playing them.
pub fn untried_starts(scenario: &Scenario, seed: u64, count: usize) -> TestStarts {
    let starts = listed_or_drawn(scenario, seed, count);
    TestStarts {
        seed,
        trivial: vec![false; starts.len()],
        starts,
    }
}

fn listed_or_drawn(scenario: &Scenario, seed: u64, count: usize) -> Vec<(Start, u64)> {
    // A longer list is sampled, because the count bounds the cost.
    let listed = scenario.starts().filter(|all| all.len() <= count);
    match listed {
        Some(all) => with_noise(scenario, seed, all),
        None => {
            let mut drawn = drawn_starts(scenario, seed, 0..count);
            // A world without ranges has a single start. Its copies are no further
            // evidence, so they may not narrow an interval.
            if !has_noise(scenario) && drawn.windows(2).all(|pair| pair[0].0 == pair[1].0) {
                drawn.truncate(1);
            }
            drawn
        }
    }
}

/// Returns true if runs from equal starts differ by the noise of sensors.
fn has_noise(scenario: &Scenario) -> bool {
    let drive = scenario.drive();
    drive.is_some_and(|driving| driving.spec().sensors.is_noisy())
}

/// Returns the `index`th test start of a seed, with the seed of its noise.
///
/// `None`: the world lists its starts and has fewer, as in [`test_starts`] of all of them.
pub fn test_start(scenario: &Scenario, seed: u64, index: usize) -> Option<(Start, u64)> {
    let bench = scenario.bench();
    let start = match scenario.starts() {
        Some(all) => all.get(index)?.clone(),
        None => bench.draw(test_key(seed, index)),
    };
    Some((start, test_noise(&bench, seed, index)))
}

/// Returns some of the test starts of a stream, with the seeds of their noise.
pub fn drawn_starts(scenario: &Scenario, seed: u64, which: Range<usize>) -> Vec<(Start, u64)> {
    let bench = scenario.bench();
    let draw = |index| {
        let key = test_key(seed, index);
        (bench.draw(key), bench.noise_of(key))
    };
    which.map(draw).collect()
}

/// Returns the noise of the `index`th test start.
pub fn test_noise(bench: &Testbench, seed: u64, index: usize) -> u64 {
    bench.noise_of(test_key(seed, index))
}

fn test_key(seed: u64, index: usize) -> StartKey {
    StartKey {
        purpose: Purpose::Test,
        seed,
        index: index as u64,
    }
}

fn with_noise(scenario: &Scenario, seed: u64, starts: Vec<Start>) -> Vec<(Start, u64)> {
    let bench = scenario.bench();
    // The noise follows from the position, as it does for drawn starts, so that a listed
    // start is repeated by its index alone.
    let starts = starts
        .into_iter()
        .enumerate()
        .map(|(index, start)| (start, test_noise(&bench, seed, index)));
    starts.collect()
}

impl TestStarts {
    /// Plays starts without an adversary, to find those on which the nominal ego fails.
    ///
    /// `scenario` is as for [`test_starts`]. `None`: stopped.
    pub fn tried(
        scenario: &Scenario,
        seed: u64,
        starts: Vec<(Start, u64)>,
        watch: &Watch<'_>,
    ) -> Option<TestStarts> {
        let trivial = TrivialStarts::default().play(scenario, &starts, watch)?;
        Some(TestStarts::new(seed, starts, trivial))
    }

    /// Draws the starts of [`test_starts`], of which the trivial ones are stored in `dir`.
    ///
    /// `ego` has the nominal world on the plant of its file. `None`: stopped.
    pub fn stored(
        dir: Option<&Path>,
        ego: &EgoUnderTest,
        count: usize,
        seed: u64,
        watch: &Watch<'_>,
    ) -> Option<TestStarts> {
        let starts = listed_or_drawn(ego.scenario(), seed, count);
        let trivial = TrivialStarts::stored(dir, ego, seed, &starts, watch)?;
        Some(TestStarts::new(seed, starts, trivial))
    }

    /// Returns starts of which the trivial ones were played.
    pub fn new(seed: u64, starts: Vec<(Start, u64)>, trivial: TrivialStarts) -> TestStarts {
        let trivial = trivial.known.into_iter();
        TestStarts {
            seed,
            starts,
            trivial: trivial.map(|known| known == Some(true)).collect(),
        }
    }

    /// Returns whether each ego needs trivial starts of its own.
    ///
    /// The nominal ego of `world` then does not represent the others, by the kind of the
    /// world or because it fails on every start.
    pub fn judges_each_ego(&self, world: &Scenario) -> bool {
        // A nominal ego that fails everywhere would leave no start for any ego.
        world.judges_each_ego() || self.trivial.iter().all(|trivial| *trivial)
    }

    /// Returns the starts for an ego under test, and the number on which it fails by
    /// itself.
    ///
    /// `None`: stopped.
    ///
    /// The ego's own failures are left out, instead of those of the nominal ego of
    /// `world`, if each ego needs trivial starts of its own
    /// ([`TestStarts::judges_each_ego`]). They are stored in `dir`.
    pub fn for_ego(
        &self,
        world: &Scenario,
        ego: &EgoUnderTest,
        dir: Option<&Path>,
        watch: &Watch<'_>,
    ) -> Option<(TestStarts, Option<FailsAlone>)> {
        let left_out = self.judges_each_ego(world);
        // Its trivial starts are those that are left out anyway.
        if ego.is_nominal() && !left_out {
            return Some((self.clone(), None));
        }
        // Faults of an ego that does not run belong to the work that follows.
        let apart = Watch {
            faults: FaultLog::default(),
            // A watch has no `Clone`, and the one that is later by 0 steps is its copy.
            ..watch.later(0)
        };
        let Some(own) = TrivialStarts::stored(dir, ego, self.seed, &self.starts, &apart) else {
            // Without its marks, the work that follows meets the faults on every start.
            let mut all = self.clone();
            if left_out {
                all.trivial.fill(false);
            }
            return (!watch.stopped()).then_some((all, None));
        };
        let own = TestStarts::new(self.seed, self.starts.clone(), own);
        let starts = own.trivial.iter().filter(|trivial| **trivial).count();
        let alone = Some(FailsAlone { starts, left_out });
        if left_out {
            Some((own, alone))
        } else {
            Some((self.clone(), alone))
        }
    }

    /// Returns the first starts that are not trivial.
    pub fn first(&self, most: usize) -> TestStarts {
        let marked = self.starts.iter().zip(&self.trivial);
        let first = marked.filter(|(_, trivial)| !**trivial).take(most);
        let starts: Vec<(Start, u64)> = first.map(|(start, _)| start.clone()).collect();
        TestStarts {
            seed: self.seed,
            trivial: vec![false; starts.len()],
            starts,
        }
    }

    /// Works in parallel on every start that is not trivial, and returns the results in
    /// order.
    ///
    /// A result is `None` for trivial starts and for those not reached.
    ///
    /// `worker` and `work` are as in [`EpisodeLoop::run`].
    pub fn each<W, R: Send>(
        &self,
        watch: &Watch<'_>,
        worker: impl Fn() -> W + Sync + Send,
        work: impl Fn(&mut W, &(Start, u64), &WorkItem) -> Option<R> + Sync + Send,
    ) -> Vec<Option<R>> {
        // Trivial starts count as done, so that the bar reaches its total.
        let all = EpisodeLoop::counted(watch, self.starts.len());
        all.run(&self.starts, worker, |kept, start, turn| {
            if self.trivial[turn.index] {
                None
            } else {
                work(kept, start, turn)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_world_without_ranges_has_a_single_start() {
        let text = |sensors: &str| {
            format!(
                r#"Scenario(
    name: "one", question: "Does a single start count once?",
    clock: (horizon_s: 2.0, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    road: Straight(lanes: 1, lane_width_m: 3.5, friction: 0.9),{sensors}
    agents: [
        Vehicle(name: "ego", body: "sedan", lane: 0, start: At(x_m: 0.0, speed_mps: (20.0, 20.0)), drive: Ego(RssDriver())),
        Vehicle(name: "ado", body: "van", lane: 0, start: Ahead(of: "ego", headway_m: (40.0, 40.0), speed_mps: (20.0, 20.0)),
            drive: Ado(actions: Accelerations([-6.0, 0.0]), neutral: 1, rulebook: [Rule(name: "moves", stl: "always (ado.speed >= 1)")]))],
    ego_spec: "always (ego.ado.gap >= 0.2)")"#
            )
        };
        let starts = |sensors: &str| {
            let world = Scenario::parse("one.ron", &text(sensors)).expect("sound");
            untried_starts(&world, 0, 300).starts.len()
        };
        assert_eq!(starts(""), 1);
        // Noise of sensors makes runs from one start differ.
        assert_eq!(starts("sensors: (position_sd_m: 0.5),"), 300);
    }

    #[test]
    fn one_test_start_is_that_of_all_also_in_a_world_that_lists_them() {
        let text = include_str!("../../../../worlds/acc.ron");
        let drawn = Scenario::parse("acc.ron", text).expect("sound");
        let axes = drawn.axes();
        let rows = [0.25, 0.5, 0.75].map(|share| {
            let values = axes
                .iter()
                .map(|axis| axis.lo + share * (axis.hi - axis.lo));
            format!("{:?}", values.collect::<Vec<f64>>())
        });
        let names: Vec<String> = axes.iter().map(|axis| format!("{:?}", axis.name)).collect();
        let points = format!(
            "points: (axes: [{}], rows: [{}]),\n    agents: [",
            names.join(", "),
            rows.join(", ")
        );
        let listed = text.replacen("agents: [", &points, 1);
        let listed = Scenario::parse("acc.ron", &listed).expect("sound");
        for (world, count) in [(&drawn, 5), (&listed, 3)] {
            let all = untried_starts(world, 7, 5).starts;
            assert_eq!(all.len(), count);
            for (index, start) in all.into_iter().enumerate() {
                assert_eq!(test_start(world, 7, index), Some(start));
            }
        }
        assert_eq!(test_start(&listed, 7, 3), None);
        assert!(test_start(&drawn, 7, usize::MAX).is_some());
    }
}
