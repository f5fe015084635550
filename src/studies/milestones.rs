//! Success against episodes and time, along one training (Sec. V-B and the appendix).
//!
//! The paper reports its driving scenes so: 75.76 % after 371 episodes of the
//! merge, 64 % after 247 of the yellow light. Here the learner is stopped at
//! given numbers of episodes, its greedy policy is played on test starts, and
//! it goes on as if nothing had happened.

use cpu_time::ThreadTime;
use serde::Serialize;

use crate::adversary::{Ado, EvalRequest, eval};
use crate::experiment::{TestStarts, Watch};
use crate::rl::Control;
use crate::run_dir::Row;
use crate::seed::Purpose;
use crate::testbench::Gym;
use crate::world::Scenario;

/// A policy on the way.
#[derive(Clone, Debug, Serialize)]
pub struct Milestone {
    /// Episodes of training behind it.
    pub episodes: u64,
    /// Decisions in them.
    pub decisions: u64,
    /// Processor time spent in training, evaluations left out.
    pub cpu_s: f64,
    /// What it does on the test starts.
    pub row: Row,
}

/// Trains in memory with the world's learner; one milestone per number of
/// episodes that is reached, in rising order, and one at the end.
///
/// The policies are those of one training with its own schedules: an early one
/// is not what a training of that length would give, since exploration and
/// step size are still high. `None`: stopped from outside.
pub fn milestones(
    scenario: &Scenario,
    seed: u64,
    episodes: &[u64],
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<Vec<Milestone>> {
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
    let spaces = scenario.world().spaces();
    let mut learner = scenario.learner.build(spaces, seed);
    let asked = scenario.learner.decisions();
    let mut reached = Vec::new();
    let (mut played, mut cpu_s) = (0, 0.0);
    let mut targets = episodes.iter().copied().filter(|&target| 0 < target);
    let mut target = targets.next();
    while !learner.finished() {
        let clock = ThreadTime::now();
        learner.train(&mut gym, &mut |progress| {
            played = progress.episodes;
            (watch.progress)(progress.decisions.min(asked), asked);
            match watch.stopped() || target.is_some_and(|target| target <= played) {
                true => Control::Stop,
                false => Control::Continue,
            }
        });
        cpu_s += clock.elapsed().as_secs_f64();
        if watch.stopped() {
            return None;
        }
        let policy = learner.policy();
        let request = EvalRequest {
            scenario,
            ego: "nominal",
            ado: Ado::Trained(&*policy, seed),
            starts,
        };
        reached.push(Milestone {
            episodes: played,
            decisions: learner.decisions(),
            cpu_s,
            row: eval(&request, watch).row,
        });
        while target.is_some_and(|target| target <= played) {
            target = targets.next();
        }
    }
    // Stopped within the last evaluation, its row is not whole.
    (!watch.stopped()).then_some(reached)
}
