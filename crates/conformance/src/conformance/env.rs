//! Conformance check of an environment.

use super::recorded::{StepNumbers, Subject, action, examine};
use super::{Nonconformities, Promise};
use crate::rl::{End, Env, Spaces};

/// Length beyond which an episode counts as endless.
const MOST_STEPS: usize = 10_000;
/// Bound on scaled observations. Learners expect about ±1.
const WIDEST: f64 = 100.0;

/// Checks the promises of an environment.
///
/// It must respect its spaces. Its episodes must end and be pure functions of
/// their index and the actions. `make` must return an unused environment.
///
/// # Errors
/// The broken promises, each with the first step that shows it.
pub fn check_env(make: &(dyn Fn() -> Box<dyn Env> + Sync)) -> Result<(), Nonconformities> {
    examine(|| {
        let env = make();
        Stepped {
            spaces: env.spaces().clone(),
            env,
            over: false,
            endless: false,
        }
    })
}

struct Stepped {
    env: Box<dyn Env>,
    spaces: Spaces,
    over: bool,
    endless: bool,
}

/// Returns a problem with the shapes of a decision problem.
pub(super) fn shapes(spaces: &Spaces) -> Option<String> {
    if spaces.observation == 0 || spaces.actions == 0 {
        return Some("nothing to observe, or nothing to do".to_owned());
    }
    let (neutral, actions) = (spaces.neutral, spaces.actions);
    (actions <= neutral).then(|| format!("the neutral action {neutral} is none of {actions}"))
}

/// Returns the names of an observation's numbers.
pub(super) fn observed(spaces: &Spaces) -> impl Iterator<Item = String> {
    (0..spaces.observation).map(|i| format!("observation[{i}]"))
}

/// Returns a problem with a number of an observation.
pub(super) fn unscaled(value: f64) -> Option<String> {
    (value.abs() > WIDEST).then(|| format!("is {value}, beyond ±{WIDEST}"))
}

impl Subject for Stepped {
    fn names(&self) -> Vec<String> {
        let rest = ["reward", "end"].map(str::to_owned);
        observed(&self.spaces).chain(rest).collect()
    }

    fn shapes(&self) -> Option<String> {
        shapes(&self.spaces)
    }

    fn begin(&mut self, episode: u64) -> StepNumbers {
        (self.over, self.endless) = (false, false);
        // Numbers that `reset` does not write remain NaN and are reported.
        let mut obs = vec![f32::NAN; self.spaces.observation];
        self.env.reset(episode, &mut obs);
        let obs = obs.iter().map(|value| f64::from(*value));
        // A reset has no reward and no end, but all rows have the same columns.
        obs.chain([0.0, 0.0]).collect()
    }

    fn step(&mut self, episode: u64, step: usize) -> Option<StepNumbers> {
        if self.over || self.endless {
            return None;
        }
        // As in `begin`, numbers that are not written remain NaN.
        let mut obs = vec![f32::NAN; self.spaces.observation];
        let action = action(episode, step, self.spaces.actions);
        let taken = self.env.step(action, &mut obs);
        self.over = taken.end.is_some();
        // An episode that ends at the last allowed step is not endless.
        self.endless = !self.over && step >= MOST_STEPS;
        // Encoded as a number, so that rows compare ends as well.
        let end = match taken.end {
            None => 0.0,
            Some(End::Terminated) => 1.0,
            Some(End::Truncated) => 2.0,
            Some(End::Aborted) => 3.0,
        };
        let obs = obs.iter().map(|value| f64::from(*value));
        Some(obs.chain([f64::from(taken.reward), end]).collect())
    }

    fn flaw(&self, at: usize, value: f64) -> Option<String> {
        // No bound holds for the reward and the code of the end, which follow.
        unscaled(value).filter(|_| at < self.spaces.observation)
    }

    fn fault(&self) -> Option<(Promise, String)> {
        let what = format!("no end after {MOST_STEPS} steps");
        self.endless.then_some((Promise::Ends, what))
    }
}
