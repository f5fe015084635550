//! Success over episodes and time along a training (Sec. V-B and the appendix).
//!
//! The paper reports its driving scenes in this form: 75.76 % after 371 episodes of the
//! merge, 64 % after 247 of the yellow light.
//! The learner is stopped at given numbers of episodes, its greedy policy plays the test
//! starts, and the training continues unaffected.

use cpu_time::ThreadTime;
use serde::Serialize;

use brakecheck::adversary::Ado;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch};
use brakecheck::rl::Control;
use brakecheck::run_dir::Row;
use brakecheck::seed::Purpose;
use brakecheck::testbench::Gym;
use brakecheck::world::Scenario;
use brakecheck_experiment::adversary::rollout::eval;

/// Policy of an unfinished training.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Milestone {
    /// Number of training episodes so far.
    pub episodes: u64,
    /// Number of decisions in them.
    pub decisions: u64,
    /// Processor time of the training without evaluations, s.
    pub cpu_s: f64,
    /// Evaluation on the test starts.
    pub row: Row,
}

/// Trains in memory with the world's learner and evaluates milestones.
///
/// There is a milestone per reached number of `episodes`, which must rise, and a last one
/// at the end.
/// All policies come from one training with its own schedules. An early policy differs
/// from that of a short training, because exploration and step size are still high.
/// `None`: stopped from outside.
pub(crate) fn milestones(
    scenario: &Scenario,
    seed: u64,
    episodes: &[u64],
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<Vec<Milestone>> {
    let mut gym = Gym::new(scenario.bench(), Purpose::Train, seed);
    let spaces = scenario.world().spaces();
    let mut learner = scenario.learner().build(spaces, seed);
    let requested = scenario.learner().decisions();
    let ego = EgoUnderTest::nominal(scenario);
    let mut reached = Vec::new();
    let (mut played, mut cpu_s) = (0, 0.0);
    // A milestone at 0 would stop the training before it begins.
    let mut targets = episodes.iter().copied().filter(|&target| target > 0);
    let mut target = targets.next();
    while !learner.finished() {
        let clock = ThreadTime::now();
        learner.train(&mut gym, &mut |progress| {
            // The last report before a stop gives the number of finished episodes.
            played = progress.episodes;
            // A learner ends with a whole step, so it may take more than was requested.
            (watch.progress)(progress.decisions.min(requested), requested);
            if watch.stopped() || target.is_some_and(|target| target <= played) {
                Control::Stop
            } else {
                Control::Continue
            }
        });
        // Only the training is timed, and the evaluation below is not.
        cpu_s += clock.elapsed().as_secs_f64();
        // A stop ends the training as a milestone does, and is none.
        if watch.stopped() {
            return None;
        }
        // The policy is a copy, so the evaluation cannot disturb the training.
        let policy = learner.policy();
        let request = ego.against(Ado::Trained(&*policy, seed), starts);
        reached.push(Milestone {
            episodes: played,
            decisions: learner.decisions(),
            cpu_s,
            row: eval(&request, watch).row,
        });
        // An episode may pass several targets at once.
        while target.is_some_and(|target| target <= played) {
            target = targets.next();
        }
    }
    // A stop during the last evaluation leaves its row incomplete.
    (!watch.stopped()).then_some(reached)
}
