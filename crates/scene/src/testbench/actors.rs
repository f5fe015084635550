//! Actors that play the ado: a trained policy, a baseline, or a recording.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::rl::Policy;
use crate::scene::Start;
use crate::seed;

/// Source of the ados' joint action at each decision.
pub trait Actor {
    /// Begins an episode. All randomness must derive from `seed`.
    fn begin(&mut self, seed: u64, start: &Start);
    /// Returns the action at this decision.
    fn act(&mut self, obs: &[f32]) -> usize;
    /// Returns the action at this decision if only some are allowed.
    ///
    /// The bench replaces an action that is not allowed by the most similar allowed one.
    fn act_among(&mut self, obs: &[f32], _allowed: &[bool]) -> usize {
        self.act(obs)
    }
}

/// A trained policy: a pure function of the observation.
pub struct PolicyActor<'a>(pub &'a dyn Policy);

impl Actor for PolicyActor<'_> {
    fn begin(&mut self, _seed: u64, _start: &Start) {}

    fn act(&mut self, obs: &[f32]) -> usize {
        self.0.act(obs)
    }

    fn act_among(&mut self, obs: &[f32], allowed: &[bool]) -> usize {
        self.0.act_among(obs, allowed)
    }
}

/// Returns the actor of a trained policy, which draws its actions if the policy does.
///
/// `draw` is the number of the draw of an episode's actions.
pub fn trained_actor(policy: &dyn Policy, draw: u64) -> Box<dyn Actor + '_> {
    match policy.drawn_at() {
        Some(temperature) => Box::new(SampledPolicy::new(policy, temperature, draw)),
        None => Box::new(PolicyActor(policy)),
    }
}

/// A trained policy whose actions are drawn: the better, the likelier.
pub struct SampledPolicy<'a> {
    policy: &'a dyn Policy,
    temperature: f64,
    draw: u64,
    rng: ChaCha8Rng,
}

impl<'a> SampledPolicy<'a> {
    /// Creates the `draw`-th draw of the actions of every episode.
    ///
    /// See [`Policy::sample`] for the temperature.
    pub fn new(policy: &'a dyn Policy, temperature: f64, draw: u64) -> SampledPolicy<'a> {
        SampledPolicy {
            policy,
            temperature,
            draw,
            // A placeholder until the first episode begins.
            rng: draws(0, draw),
        }
    }
}

impl Actor for SampledPolicy<'_> {
    fn begin(&mut self, seed: u64, _start: &Start) {
        // Draws of one start differ, and are the same on any number of threads.
        self.rng = draws(seed, self.draw);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        let mut units = || self.rng.random::<f64>();
        self.policy.sample(obs, self.temperature, &mut units)
    }

    fn act_among(&mut self, obs: &[f32], allowed: &[bool]) -> usize {
        let mut units = || self.rng.random::<f64>();
        self.policy
            .sample_among(obs, allowed, self.temperature, &mut units)
    }
}

/// Returns the random numbers of a draw of a policy's actions in an episode.
pub fn draws(seed: u64, draw: u64) -> ChaCha8Rng {
    seed::generator("sampled policy", &[seed, draw])
}

/// Drawing of a policy's actions, several times per start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Temperature of the softmax over the values, above 0.
    pub temperature: f64,
    /// Draws per start, at least 1.
    pub draws: u32,
}

impl Sampling {
    /// Drawing of an ado that may know more than its greedy actions show.
    pub const SECOND_LOOK: Sampling = Sampling {
        temperature: 0.1,
        draws: 20,
    };
}

/// A constant action.
pub struct Constant(pub usize);

impl Actor for Constant {
    fn begin(&mut self, _seed: u64, _start: &Start) {}

    fn act(&mut self, _obs: &[f32]) -> usize {
        self.0
    }
}

/// Decisions for which the held-random baseline keeps an action.
pub const HOLD_DECISIONS: usize = 5;

/// Uniformly random actions, each held for a number of decisions.
pub struct HeldRandom {
    actions: usize,
    hold: usize,
    left: usize,
    action: usize,
    rng: ChaCha8Rng,
}

impl HeldRandom {
    /// Creates an actor that holds each action for `hold` ≥ 1 decisions.
    pub fn new(actions: usize, hold: usize) -> HeldRandom {
        HeldRandom {
            actions,
            hold,
            left: 0,
            action: 0,
            rng: seed::generator("held", &[]),
        }
    }
}

impl Actor for HeldRandom {
    fn begin(&mut self, seed: u64, _start: &Start) {
        // The key contains the hold, so baselines of different holds draw
        // independent actions.
        self.rng = seed::generator("held", &[seed, self.hold as u64]);
        self.left = 0;
    }

    fn act(&mut self, _obs: &[f32]) -> usize {
        if self.left == 0 {
            self.action = self.rng.random_range(0..self.actions);
            self.left = self.hold;
        }
        self.left -= 1;
        self.action
    }
}

/// Uniformly random actions, with a new action at each decision.
pub struct Random(HeldRandom);

impl Random {
    /// Creates an actor that draws from `actions` actions.
    pub fn new(actions: usize) -> Random {
        Random(HeldRandom::new(actions, 1))
    }
}

impl Actor for Random {
    fn begin(&mut self, seed: u64, start: &Start) {
        self.0.begin(seed, start);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        self.0.act(obs)
    }
}

/// A recorded action sequence.
pub struct Replay<'a> {
    actions: &'a [usize],
    after: Option<usize>,
    next: usize,
}

impl<'a> Replay<'a> {
    /// Plays `actions` in order and then holds the last action.
    pub fn holding(actions: &'a [usize]) -> Replay<'a> {
        Replay {
            actions,
            after: None,
            next: 0,
        }
    }

    /// Plays `actions` in order and then `after`.
    pub fn then(actions: &'a [usize], after: usize) -> Replay<'a> {
        Replay {
            actions,
            after: Some(after),
            next: 0,
        }
    }
}

impl Actor for Replay<'_> {
    fn begin(&mut self, _seed: u64, _start: &Start) {
        self.next = 0;
    }

    fn act(&mut self, _obs: &[f32]) -> usize {
        let action = self.actions.get(self.next).copied();
        self.next += 1;
        // Without any recorded action, action 0 exists in every world.
        let last = self.after.or(self.actions.last().copied());
        action.or(last).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Policy that draws its four actions alike, and prefers the first.
    struct EvenPolicy;

    impl Policy for EvenPolicy {
        fn act(&self, _obs: &[f32]) -> usize {
            0
        }

        fn act_among(&self, _obs: &[f32], allowed: &[bool]) -> usize {
            allowed.iter().position(|it| *it).unwrap_or(0)
        }

        fn sample(&self, _obs: &[f32], _: f64, units: &mut dyn FnMut() -> f64) -> usize {
            (4.0 * units()) as usize
        }

        fn value(&self, _obs: &[f32]) -> f32 {
            0.0
        }
    }

    #[test]
    fn a_drawn_action_is_one_of_those_allowed() {
        let mut actor = SampledPolicy::new(&EvenPolicy, 1.0, 0);
        actor.begin(7, &Start(Vec::new()));
        let mut counts = [0; 4];
        for _ in 0..600 {
            counts[actor.act_among(&[], &[false, true, false, true])] += 1;
        }
        // Both allowed actions are as likely as they are beside each other.
        let [never, one, nor, other] = counts;
        assert_eq!([never, nor], [0, 0]);
        assert!(one > 240 && other > 240, "{counts:?}");
        // If all are allowed, the draws are those without a limit.
        let mut free = SampledPolicy::new(&EvenPolicy, 1.0, 0);
        for actor in [&mut actor, &mut free] {
            actor.begin(8, &Start(Vec::new()));
        }
        let pairs = (0..50).map(|_| (actor.act_among(&[], &[true; 4]), free.act(&[])));
        assert!(pairs.collect::<Vec<_>>().iter().all(|(a, b)| a == b));
    }
}
