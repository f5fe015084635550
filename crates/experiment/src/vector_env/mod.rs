//! Many environments of one world, stepped together in one call.
//!
//! A [`VectorEnv`] plays the episodes of [`Gym`](crate::testbench::Gym), with the same
//! bits, and keeps no trace of them. Worlds whose road users are vehicles on the
//! kinematic plant are laid out as a structure of arrays, about 1 kB per environment.
//! All other worlds play on a [`Testbench`] each.
//! [`VectorEnv::layout`] says which.
//!
//! ```
//! # mod brakecheck {
//! #     pub use brakecheck_stats::seed;
//! #     pub use brakecheck_experiment::vector_env;
//! #     pub use brakecheck_world::world;
//! # }
//! use brakecheck::seed::{Purpose, StartKey};
//! use brakecheck::vector_env::VectorEnv;
//! use brakecheck::world::{PlantKind, Scenario};
//!
//! let text = include_str!("../../../../worlds/acc.ron");
//! let world = Scenario::parse("acc.ron", text)?.on(PlantKind::Kinematic);
//! let mut env = VectorEnv::new(&world, 4);
//! let width = env.spaces().observation;
//! let mut observations = vec![0.0; 4 * width];
//! for (i, row) in observations.chunks_mut(width).enumerate() {
//!     let key = StartKey { purpose: Purpose::Train, seed: i as u64, index: 0 };
//!     env.begin(i, key, row);
//! }
//! // The ado of environment 3 brakes until it breaks the rule to stay in motion.
//! let (mut rewards, mut ends) = ([0.0; 4], [None; 4]);
//! while ends[3].is_none() {
//!     env.step(&[1, 1, 1, 0], &mut observations, &mut rewards, &mut ends);
//! }
//! assert!(rewards[3] <= -1.0);
//! assert!(env.verdict(3).is_some_and(|verdict| verdict.is_foul()));
//! # Ok::<(), brakecheck::world::ScenarioError>(())
//! ```

mod bench_runs;
mod eligible;
mod lane_runs;
mod run;

use crate::rl::{End, Spaces};
use crate::rulebook::Verdict;
use crate::seed::StartKey;
use crate::testbench::{Aftermath, NoisyStart, Testbench};
use crate::world::Scenario;

use bench_runs::BenchRuns;
use eligible::LaneWorld;
use lane_runs::LaneRuns;
use run::EnvRun;

/// Environments that one structure of arrays holds.
///
/// Its columns then fit into the second cache.
const LANES: usize = 64;

/// How the environments of a [`VectorEnv`] are kept in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvLayout {
    /// Structure of arrays, without traces.
    Lanes,
    /// A test bench each, with its trace.
    Benches,
}

/// Many environments of one world, stepped together.
///
/// Observations are row-major: environment i has the numbers from i · width on, where
/// width is [`Spaces::observation`]. Rewards are those of Definition 4, without unit.
/// An environment whose episode is over stands still until [`VectorEnv::begin`].
/// Environments do not depend on each other, so that several `VectorEnv` on several
/// threads give the same bits as one.
pub struct VectorEnv {
    groups: Vec<Group>,
    spaces: Spaces,
    count: usize,
}

/// Some environments that are played by the same code.
enum Group {
    Lanes(Box<LaneRuns>),
    Benches(BenchRuns),
}

impl VectorEnv {
    /// Creates `count` environments of a world, none of which has begun.
    pub fn new(world: &Scenario, count: usize) -> VectorEnv {
        VectorEnv::build(world, count, None)
    }

    /// Creates environments whose newest rows can be read, in the layout of lanes.
    ///
    /// `signals` has the positions of signals that rows contain besides those that
    /// rules, derived signals and the observation read.
    pub fn with_rows(world: &Scenario, count: usize, signals: &[usize]) -> VectorEnv {
        VectorEnv::build(world, count, Some(signals))
    }

    fn build(world: &Scenario, count: usize, signals: Option<&[usize]>) -> VectorEnv {
        // Only the world decides the layout, so it is found once for all groups.
        let lanes = LaneWorld::of(world, signals.unwrap_or(&[]));
        let group = |first: usize| {
            let runs = LANES.min(count - first);
            let lanes = lanes
                .as_ref()
                .and_then(|it| LaneRuns::new(it, runs, signals.is_some()));
            match lanes {
                Some(lanes) => Group::Lanes(Box::new(lanes)),
                None => Group::Benches(BenchRuns::new(world, runs)),
            }
        };
        VectorEnv {
            groups: (0..count).step_by(LANES).map(group).collect(),
            spaces: world.world().spaces().clone(),
            count,
        }
    }

    /// Returns the number of environments.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether there is no environment.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the shapes of one environment's observation and joint action.
    pub fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    /// Returns how the environments are kept in memory.
    pub fn layout(&self) -> EnvLayout {
        // The world decides the layout, so all groups have the same.
        match self.groups.first() {
            Some(Group::Benches(_)) => EnvLayout::Benches,
            Some(Group::Lanes(_)) | None => EnvLayout::Lanes,
        }
    }

    /// Begins the episode of a key in environment `at` and writes its observation.
    ///
    /// # Panics
    /// There is no such environment.
    pub fn begin(&mut self, at: usize, key: StartKey, observation: &mut [f32]) {
        match &mut self.groups[at / LANES] {
            Group::Lanes(lanes) => lanes.begin(at % LANES, key, observation),
            Group::Benches(benches) => benches.begin(at % LANES, key, observation),
        }
    }

    /// Begins an episode from a start, with the seed of its noise.
    ///
    /// It has no key, so [`VectorEnv::play_again`] cannot play it.
    pub fn begin_at(&mut self, at: usize, from: NoisyStart<'_>, observation: &mut [f32]) {
        match &mut self.groups[at / LANES] {
            Group::Lanes(lanes) => lanes.begin_at(at % LANES, from, observation),
            Group::Benches(benches) => benches.begin_at(at % LANES, from, observation),
        }
    }

    /// Returns the newest row of signals of an environment with rows, else none.
    ///
    /// Signals that nobody reads are 0.
    pub fn row(&self, at: usize) -> &[f64] {
        match &self.groups[at / LANES] {
            Group::Lanes(lanes) => lanes.row(at % LANES),
            Group::Benches(_) => &[],
        }
    }

    /// Takes one joint action in every environment whose episode is not over.
    ///
    /// `observations` is `[len, width]`, row-major. `rewards` is `[len]` and gets 0
    /// while an episode goes on. `ends` is `[len]` and says which episodes this step
    /// ended: [`End::Aborted`] is a fault of the ego or the physics and has no reward.
    /// Environments whose episode was over before keep their observation, get the
    /// reward 0 and no end, whatever the action.
    ///
    /// # Panics
    /// A length is wrong, or an action is beyond [`Spaces::actions`].
    pub fn step(
        &mut self,
        actions: &[usize],
        observations: &mut [f32],
        rewards: &mut [f64],
        ends: &mut [Option<End>],
    ) {
        // A short slice would step some environments and leave out others.
        let lengths = [actions.len(), rewards.len(), ends.len()];
        let width = self.spaces.observation;
        let fit = lengths == [self.count; 3] && observations.len() == self.count * width;
        assert!(
            fit,
            "one entry per environment, and of observations one row"
        );
        assert!(
            actions.iter().all(|action| *action < self.spaces.actions),
            "an action that does not exist"
        );
        for (i, group) in self.groups.iter_mut().enumerate() {
            // The last group may have fewer environments.
            let part = i * LANES..self.count.min((i + 1) * LANES);
            let rows = part.start * width..part.end * width;
            let into = StepInto {
                observations: &mut observations[rows],
                rewards: &mut rewards[part.clone()],
                ends: &mut ends[part.clone()],
            };
            match group {
                Group::Lanes(lanes) => lanes.step(&actions[part], into),
                Group::Benches(benches) => benches.step(&actions[part], into),
            }
        }
    }

    fn run(&self, at: usize) -> &EnvRun {
        match &self.groups[at / LANES] {
            Group::Lanes(lanes) => lanes.run(at % LANES),
            Group::Benches(benches) => benches.run(at % LANES),
        }
    }

    /// Returns whether the episode of environment `at` is over, or none has begun.
    pub fn is_over(&self, at: usize) -> bool {
        self.run(at).is_over
    }

    /// Returns the verdict of the episode of environment `at`, if it is final.
    pub fn verdict(&self, at: usize) -> Option<Verdict> {
        self.run(at).verdict
    }

    /// Returns ρ(ψ_ego) of the episode of environment `at` that is over.
    ///
    /// NaN before that, and after a fault.
    pub fn robustness(&self, at: usize) -> f64 {
        self.run(at).robustness
    }

    /// Returns the key and the joint actions of the episode of environment `at`.
    ///
    /// They are all that its trace and its success need to be played again
    /// ([`VectorEnv::play_again`]). `None` if no episode has begun, or if it began from a
    /// start ([`VectorEnv::begin_at`]).
    pub fn played(&self, at: usize) -> Option<(StartKey, &[u32])> {
        let run = self.run(at);
        Some((run.key?, &run.actions))
    }

    /// Plays the episode of environment `at` again on a bench of the same world.
    ///
    /// The bench then stands where the environment does, with its trace, contact and
    /// fault. Returns false if the episode has no key ([`VectorEnv::played`]).
    pub fn play_again(&self, at: usize, bench: &mut Testbench) -> bool {
        let Some((key, actions)) = self.played(at) else {
            return false;
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        // Environments have no aftermath either.
        bench.begin(&start, noise, Aftermath::Skip);
        for action in actions {
            bench.decide(*action as usize);
        }
        true
    }

    /// Returns the memory of one environment in bytes, as a mean over all of them.
    ///
    /// It counts the capacity of all columns and lists, the controllers, and what the
    /// environments of a group share. Data of the world, of which one copy exists, does
    /// not count. `None` for [`EnvLayout::Benches`], and for formulas that running numbers
    /// do not decide ([`crate::stl::Monitor::running`]).
    pub fn bytes_per_environment(&self) -> Option<usize> {
        let bytes: usize = self
            .groups
            .iter()
            .map(|group| match group {
                Group::Lanes(lanes) => Some(size_of::<Group>() + lanes.bytes()?),
                Group::Benches(_) => None,
            })
            .sum::<Option<usize>>()?;
        Some(bytes.div_ceil(self.count.max(1)))
    }
}

/// Where a step writes its results.
struct StepInto<'a> {
    observations: &'a mut [f32],
    rewards: &'a mut [f64],
    ends: &'a mut [Option<End>],
}

impl StepInto<'_> {
    fn row(&mut self, run: usize, runs: usize) -> &mut [f32] {
        let width = self.observations.len() / runs;
        &mut self.observations[run * width..][..width]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Purpose;
    use crate::sim::PlantKind;

    fn key(index: u64) -> StartKey {
        StartKey {
            purpose: Purpose::Train,
            seed: 3,
            index,
        }
    }

    /// `acc` with noisy sensors, on the plant of lanes and on that of benches.
    fn noisy_worlds() -> [Scenario; 2] {
        let text = include_str!("../../../../worlds/acc.ron").replacen(
            "judge: UntilViolation,",
            "judge: UntilViolation,\n    sensors: (position_sd_m: 0.5, speed_sd_mps: 0.3),",
            1,
        );
        let rigid = Scenario::parse("acc.ron", &text).expect("sound");
        [rigid.on(PlantKind::Kinematic), rigid]
    }

    #[test]
    fn an_episode_from_a_start_is_that_of_its_key_and_has_none_itself() {
        for world in noisy_worlds() {
            let mut env = VectorEnv::new(&world, 2);
            let width = env.spaces().observation;
            let mut bench = world.bench();
            let start = (bench.draw(key(5)), bench.noise_of(key(5)));
            let mut observations = vec![0.0; 2 * width];
            // An earlier episode with a key leaves nothing behind.
            env.begin(1, key(4), &mut observations[width..]);
            env.begin(0, key(5), &mut observations[..width]);
            env.begin_at(1, NoisyStart::from(&start), &mut observations[width..]);
            assert_eq!(env.played(1), None);
            assert!(!env.play_again(1, &mut bench));
            assert_eq!(observations[..width], observations[width..]);
            let (mut rewards, mut ends) = ([0.0; 2], [None; 2]);
            for _ in 0..8 {
                env.step(&[0; 2], &mut observations, &mut rewards, &mut ends);
                assert_eq!(observations[..width], observations[width..]);
            }
            assert_eq!(env.verdict(0), env.verdict(1));
        }
    }

    #[test]
    fn rows_have_the_newest_sample_of_every_requested_signal() {
        let text = include_str!("../../../../worlds/cut_in.ron");
        let world = Scenario::parse("cut_in.ron", text).expect("sound");
        let [lanes, benches] = [PlantKind::Kinematic, PlantKind::Rigid].map(|it| world.on(it));
        let mut bench = lanes.bench();
        let signals: Vec<usize> = (0..lanes.world().schema().len()).collect();
        let mut env = VectorEnv::with_rows(&lanes, 3, &signals);
        assert_eq!(env.layout(), EnvLayout::Lanes);
        let (width, actions) = (env.spaces().observation, env.spaces().actions);
        let mut observations = vec![0.0; 3 * width];
        for (at, row) in observations.chunks_mut(width).enumerate() {
            env.begin(at, key(at as u64), row);
        }
        let (mut rewards, mut ends) = ([0.0; 3], [None; 3]);
        for step in 0..8 {
            for at in 0..3 {
                assert!(env.play_again(at, &mut bench));
                let trace = bench.trace();
                let newest: Vec<u64> = signals
                    .iter()
                    .map(|signal| trace.column(*signal)[trace.len() - 1].to_bits())
                    .collect();
                let row: Vec<u64> = env.row(at).iter().map(|it| it.to_bits()).collect();
                assert_eq!(row, newest, "environment {at}, step {step}");
            }
            let chosen = [step % actions, actions - 1, 0];
            env.step(&chosen, &mut observations, &mut rewards, &mut ends);
        }
        // Rows are kept on request only, and benches have traces instead.
        assert!(VectorEnv::new(&lanes, 1).row(0).is_empty());
        assert!(
            VectorEnv::with_rows(&benches, 1, &signals)
                .row(0)
                .is_empty()
        );
    }

    #[test]
    fn rows_take_memory_for_every_signal() {
        let [lanes, _] = noisy_worlds();
        let bytes = |env: VectorEnv| env.bytes_per_environment().expect("in lanes");
        let without = bytes(VectorEnv::new(&lanes, LANES));
        let with = bytes(VectorEnv::with_rows(&lanes, LANES, &[]));
        let row = lanes.world().schema().len() * size_of::<f64>();
        assert_eq!(with, without + row);
    }
}
