//! Whether an ado has learned its world: its successes on calibration starts
//! beside those of a cheap search, on starts that nothing is reported on.

use super::training_egos::TrainingGym;
use super::training_search::Scout;
use crate::experiment::{EpisodeLoop, Watch};
use crate::rl::{Env, Policy};
use crate::run_dir::Calibration;
use crate::seed::Purpose;
use crate::world::Scenario;

/// Starts that are searched, once, and played after it: one per thousand
/// decisions of the training, within these bounds.
const STARTS: (u64, u64) = (10, 100);
/// Simulations per decision of the training that the search may spend at most.
const SHARE: u64 = 4;
/// The same per start where the ego cannot be copied.
const WITHOUT_COPIES: u64 = 50;
/// Starts after which it is judged whether one switch is enough.
const TRIED: usize = 20;

/// Calibration starts of a training, and which of them a search solves.
pub(super) struct Calibrator<'a> {
    scenario: &'a Scenario,
    seed: u64,
    solved: Vec<bool>,
    switches: usize,
    /// What the search took.
    simulations: u64,
    searched_steps: u64,
    /// What the search and the last playing took.
    pub physics_steps: u64,
    /// All of it, and all playings.
    pub cpu_s: f64,
}

impl<'a> Calibrator<'a> {
    /// Searches the calibration starts of a training; `None`: stopped.
    ///
    /// With at most one switch of action; two, where one solves none of the
    /// first starts.
    pub fn new(scenario: &'a Scenario, seed: u64, watch: &Watch<'_>) -> Option<Calibrator<'a>> {
        let mut calibrator = Calibrator {
            scenario,
            seed,
            solved: Vec::new(),
            switches: 1,
            simulations: 0,
            searched_steps: 0,
            physics_steps: 0,
            cpu_s: 0.0,
        };
        let scout = Scout::new(scenario, Purpose::Calibration, seed);
        let decisions = scenario.learner.decisions();
        let starts = (decisions / 1000).clamp(STARTS.0, STARTS.1);
        let each = match scout.forks() {
            true => SHARE.saturating_mul(decisions) / starts,
            false => WITHOUT_COPIES,
        };
        let indices: Vec<u64> = (0..starts).collect();
        let (first, rest) = indices.split_at(TRIED.min(indices.len()));
        for (i, part) in [first, rest].into_iter().enumerate() {
            if 0 < i && !calibrator.solved.contains(&true) {
                calibrator.switches = 2;
            }
            let progress = (calibrator.solved.len(), indices.len());
            let asked = (calibrator.switches, each.max(20));
            let found = scout.search(part, asked, progress, watch);
            if watch.stopped() {
                return None;
            }
            for scouted in found {
                let scouted = scouted.unwrap_or_default();
                calibrator.solved.push(scouted.actions.is_some());
                calibrator.simulations += scouted.simulations;
                calibrator.searched_steps += scouted.physics_steps;
                calibrator.cpu_s += scouted.cpu_s;
            }
        }
        Some(calibrator)
    }

    /// What an ado does on them; `None`: stopped.
    pub fn of(&mut self, policy: &dyn Policy, watch: &Watch<'_>) -> Option<Calibration> {
        let indices: Vec<u64> = (0..self.solved.len() as u64).collect();
        let all = EpisodeLoop::counted(watch, indices.len());
        let gym = || TrainingGym::new(self.scenario, Purpose::Calibration, self.seed);
        let played = all.run(&indices, gym, |gym, &index, turn| {
            let before = gym.inner().spent().physics_steps;
            let success = succeeds(gym, index, policy);
            let physics_steps = gym.inner().spent().physics_steps - before;
            Some((success, physics_steps, turn.cpu_s()))
        });
        if watch.stopped() {
            return None;
        }
        let mut calibration = Calibration {
            starts: indices.len() as u64,
            switches: self.switches as u64,
            ..Calibration::default()
        };
        self.physics_steps = self.searched_steps;
        for (played, &searched) in played.into_iter().zip(&self.solved) {
            let (success, physics_steps, cpu_s) = played.unwrap_or_default();
            self.physics_steps += physics_steps;
            self.cpu_s += cpu_s;
            calibration.searched += u64::from(searched);
            calibration.both += u64::from(searched && success);
            calibration.ado_only += u64::from(success && !searched);
        }
        calibration.simulations = self.simulations + calibration.starts;
        Some(calibration)
    }
}

/// Whether the greedy ado makes the ego fail with all rules kept: under
/// Definition 4 just then an episode pays more than 0.
fn succeeds(gym: &mut TrainingGym<'_>, index: u64, policy: &dyn Policy) -> bool {
    let mut obs = vec![0.0; gym.spaces().observation];
    gym.reset(index, &mut obs);
    let mut total = 0.0;
    loop {
        let step = gym.step(policy.act(&obs), &mut obs);
        total += step.reward;
        if step.end.is_some() {
            return 0.0 < total;
        }
    }
}
