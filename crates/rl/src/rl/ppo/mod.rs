//! Proximal policy optimisation for finite action sets.
//!
//! - Schulman, Wolski, Dhariwal, Radford, Klimov, "Proximal Policy
//!   Optimization Algorithms", 2017: clipped surrogate, Eq. (7).
//! - Schulman, Moritz, Levine, Jordan, Abbeel, "High-Dimensional Continuous
//!   Control Using Generalized Advantage Estimation", ICLR 2016: Eq. (16).
//!
//! Deviations: docs/background/learners.md.

mod config;
mod policy;

pub use config::PpoSettings;
use policy::ActorCritic;

use crate::rl::adam::Adam;
use crate::rl::bundle::{BundleError, TensorFile};
use crate::rl::dice::LearnerRng;
use crate::rl::learner::{
    Built, Choice, ConfigError, EpisodePlan, Learner, LearnerKind, Shaped, TrainingCounters,
    expect_sizes, layers, linear,
};
use crate::rl::nn::{Mlp, Tape, argmax, draw, softmax};
use crate::rl::replay::check;
use crate::rl::{End, Losses, Policy, Spaces, Step};

/// Kind of a kept policy.
const POLICY: &str = "brakecheck ppo policy 1";
/// Kind of a checkpoint.
const CHECKPOINT: &str = "brakecheck ppo checkpoint 1";

/// Experience since the last update, with its advantages.
#[derive(Clone, Debug, Default, PartialEq)]
struct Rollout {
    observations: Vec<f32>,
    actions: Vec<u32>,
    /// log π(a | s) at the time of the draw.
    log_probabilities: Vec<f32>,
    /// V(s), during an episode only.
    values: Vec<f32>,
    /// Rewards, during an episode only.
    rewards: Vec<f32>,
    advantages: Vec<f32>,
    returns: Vec<f32>,
}

impl Rollout {
    /// Truncates to the last episode boundary.
    fn drop_episode(&mut self, width: usize) {
        // Advantages exist only for closed episodes, so their number is the boundary.
        let kept = self.advantages.len();
        self.observations.truncate(kept * width);
        self.actions.truncate(kept);
        self.log_probabilities.truncate(kept);
        self.values.clear();
        self.rewards.clear();
    }

    /// Computes the advantages of the last episode, Eq. (16) of GAE.
    ///
    /// Â_t = Σ (γλ)^l δ_{t+l}. `after` is the value of the last observation, 0 after
    /// a terminal state.
    fn close_episode(&mut self, after: f32, discount: f32, trace: f32) {
        let start = self.advantages.len();
        let end = start + self.rewards.len();
        self.advantages.resize(end, 0.0);
        self.returns.resize(end, 0.0);
        let (mut next, mut sum) = (after, 0.0);
        for t in (0..self.rewards.len()).rev() {
            let delta = self.rewards[t] + discount * next - self.values[t];
            sum = delta + discount * trace * sum;
            self.advantages[start + t] = sum;
            self.returns[start + t] = sum + self.values[t];
            next = self.values[t];
        }
        self.values.clear();
        self.rewards.clear();
    }

    fn clear(&mut self) {
        // Observations are the largest part, so only their memory is kept.
        *self = Rollout {
            observations: std::mem::take(&mut self.observations),
            ..Rollout::default()
        };
        self.observations.clear();
    }
}

/// Learner state: everything that changes during training.
struct Ppo {
    config: PpoSettings,
    actor: Mlp,
    critic: Mlp,
    actor_adam: Adam,
    critic_adam: Adam,
    rollout: Rollout,
    dice: LearnerRng,
    tally: TrainingCounters,
    /// Share of the last episode's actions that were not the likeliest.
    explored: f32,
    /// Number of actions of the running episode that were not the likeliest.
    unlikely: usize,
    losses: Losses,
    room: PpoWorkspace,
}

/// Reusable buffers without meaning between updates.
struct PpoWorkspace {
    order: Vec<u32>,
    inputs: Vec<f32>,
    probabilities: Vec<f32>,
    actor: Tape,
    critic: Tape,
    actor_gradient: Vec<f32>,
    critic_gradient: Vec<f32>,
}

impl LearnerKind for PpoSettings {
    fn bundles(&self) -> [&'static str; 2] {
        [POLICY, CHECKPOINT]
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.bounds()
    }

    fn discount(&self) -> f64 {
        self.discount
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        let mut dice = LearnerRng::new(seed);
        // A small gain in the last layer: all actions start equally likely.
        let sizes = |outputs| layers(spaces.observation, &self.hidden, outputs);
        let actor = Mlp::orthogonal(&sizes(spaces.actions), 0.01, &mut dice);
        let critic = Mlp::orthogonal(&sizes(1), 1.0, &mut dice);
        Box::new(Ppo::around(self, actor, critic, dice))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        Ok(Box::new(Ppo::with_nets(
            self,
            spaces,
            policy,
            LearnerRng::new(seed),
        )?))
    }

    fn restore(&self, spaces: &Spaces, bundle: &TensorFile) -> Built {
        let mut ppo = Ppo::with_nets(self, spaces, bundle, LearnerRng::restore(bundle)?)?;
        ppo.actor_adam = Adam::load(&ppo.actor, "actor_adam", bundle)?;
        ppo.critic_adam = Adam::load(&ppo.critic, "critic_adam", bundle)?;
        ppo.tally.restore(bundle)?;
        let actions = bundle.rows::<u32>("rollout/actions", &[])?;
        let n = actions.len();
        for action in actions {
            check("action in the rollout", *action as usize, spaces.actions)?;
        }
        let wide = [n, spaces.observation];
        let floats = |name: &str| bundle.get::<f32>(name, &[n]).map(<[f32]>::to_vec);
        ppo.rollout = Rollout {
            observations: bundle.get::<f32>("rollout/observations", &wide)?.to_vec(),
            actions: actions.to_vec(),
            log_probabilities: floats("rollout/log_probabilities")?,
            advantages: floats("rollout/advantages")?,
            returns: floats("rollout/returns")?,
            // A checkpoint lies between episodes, where values and rewards are empty.
            ..Rollout::default()
        };
        Ok(Box::new(ppo))
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let policy = ActorCritic::load(policy)?;
        let shape = policy.actor.ends();
        Ok((Box::new(policy), shape))
    }
}

impl Ppo {
    fn with_nets(
        config: &PpoSettings,
        spaces: &Spaces,
        bundle: &TensorFile,
        dice: LearnerRng,
    ) -> Result<Ppo, BundleError> {
        let (actor, critic) = (Mlp::load("actor", bundle)?, Mlp::load("critic", bundle)?);
        let expected = [spaces.observation, spaces.actions];
        expect_sizes(
            "the actor's observation and actions",
            &actor.ends(),
            &expected,
        )?;
        let expected = [spaces.observation, 1];
        expect_sizes(
            "the critic's observation and values",
            &critic.ends(),
            &expected,
        )?;
        Ok(Ppo::around(config, actor, critic, dice))
    }

    fn around(config: &PpoSettings, actor: Mlp, critic: Mlp, dice: LearnerRng) -> Ppo {
        Ppo {
            config: config.clone(),
            actor_adam: Adam::new(actor.parameters().len()),
            critic_adam: Adam::new(critic.parameters().len()),
            rollout: Rollout::default(),
            dice,
            tally: TrainingCounters::new(config.decisions),
            explored: 1.0,
            unlikely: 0,
            losses: Losses::default(),
            room: PpoWorkspace {
                order: Vec::new(),
                inputs: Vec::new(),
                probabilities: Vec::new(),
                actor: actor.tape(config.batch),
                critic: critic.tape(config.batch),
                actor_gradient: vec![0.0; actor.parameters().len()],
                critic_gradient: vec![0.0; critic.parameters().len()],
            },
            actor,
            critic,
        }
    }

    /// Runs several passes over the rollout in shuffled minibatches.
    fn update(&mut self) {
        let n = self.rollout.actions.len();
        let mut order = std::mem::take(&mut self.room.order);
        order.clear();
        order.extend(0..n as u32);
        // Advantages, returns and old probabilities stay those of the rollout. The
        // ratio then measures the change of the policy over all passes together.
        for _ in 0..self.config.epochs {
            self.dice.shuffle(&mut order);
            for batch in order.chunks(self.config.batch) {
                self.gradient_step(batch);
            }
        }
        self.room.order = order;
    }

    fn gradient_step(&mut self, batch: &[u32]) {
        let PpoWorkspace {
            inputs,
            probabilities,
            actor,
            critic,
            actor_gradient,
            critic_gradient,
            ..
        } = &mut self.room;
        let rollout = &self.rollout;
        let (size, width) = (batch.len(), self.actor.inputs());
        let scale = 1.0 / size as f32;
        inputs.clear();
        for &i in batch {
            let row = i as usize * width..(i as usize + 1) * width;
            inputs.extend_from_slice(&rollout.observations[row]);
        }

        // Actor: −min(r Â, clip(r) Â) − c H, Eq. (7) and (9), by the logits.
        // Normalised per minibatch, so the step does not depend on the reward's scale.
        let (mean, deviation) = moments(batch.iter().map(|&i| rollout.advantages[i as usize]));
        self.actor.forward(inputs, size, actor);
        let (actions, stride) = (self.actor.outputs(), self.actor.output_stride());
        let (logits, gradient) = self.actor.output_and_gradient(size, actor);
        gradient.fill(0.0);
        let rows = logits
            .chunks_exact(stride)
            .zip(gradient.chunks_exact_mut(stride));
        for (&i, (logits, gradient)) in batch.iter().zip(rows) {
            let i = i as usize;
            softmax(&logits[..actions], probabilities);
            let taken = rollout.actions[i] as usize;
            let log = libm::logf(probabilities[taken]);
            let ratio = libm::expf(log - rollout.log_probabilities[i]);
            let advantage = (rollout.advantages[i] - mean) / deviation;
            let clip = self.config.clip as f32;
            // The clipped branch is flat: no gradient once the ratio has moved beyond the
            // clip in the direction of the advantage.
            let flat = if advantage > 0.0 {
                1.0 + clip < ratio
            } else {
                ratio < 1.0 - clip
            };
            let pull = if flat { 0.0 } else { -advantage * ratio };
            let entropy: f32 = probabilities.iter().map(|p| -p * libm::logf(*p)).sum();
            // By the logits z: ∂ ln π(taken) / ∂ z_a = [a = taken] − p_a, and
            // ∂ H / ∂ z_a = −p_a (ln p_a + H). Both sums over a are 0.
            for (a, (p, g)) in probabilities.iter().zip(gradient).enumerate() {
                let one = if a == taken { 1.0 } else { 0.0 };
                let spread = self.config.entropy as f32 * p * (libm::logf(*p) + entropy);
                *g = scale * (pull * (one - p) + spread);
            }
        }
        self.actor.backward(inputs, size, actor, actor_gradient);

        // Critic: ½ (V − R)².
        self.critic.forward(inputs, size, critic);
        let stride = self.critic.output_stride();
        let (values, gradient) = self.critic.output_and_gradient(size, critic);
        gradient.fill(0.0);
        let mut loss = 0.0;
        // Only the first column is an output, the rest of a row is padding.
        for (at, &i) in batch.iter().enumerate() {
            let error = values[at * stride] - rollout.returns[i as usize];
            gradient[at * stride] = scale * error;
            loss += 0.5 * scale * error * error;
        }
        self.losses.add(f64::from(loss));
        self.critic.backward(inputs, size, critic, critic_gradient);

        let rates = (self.config.learning_rate, self.config.final_learning_rate);
        let span = self.config.decisions as f64;
        let rate = linear(rates.0, rates.1, self.tally.decisions, span) as f32;
        let longest = self.config.max_gradient;
        // Net by net: a large error of the critic must not shrink the actor's step.
        shorten(actor_gradient, longest);
        shorten(critic_gradient, longest);
        self.actor_adam
            .step(self.actor.parameters_mut(), actor_gradient, rate);
        self.critic_adam
            .step(self.critic.parameters_mut(), critic_gradient, rate);
    }
}

impl Learner for Ppo {
    fn plan(&mut self) -> EpisodePlan {
        EpisodePlan::of(self.tally.begun())
    }

    fn begin(&mut self, _: &EpisodePlan, _: &[f32]) {
        self.unlikely = 0;
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        let mut probabilities = std::mem::take(&mut self.room.probabilities);
        self.actor
            .evaluate(obs, |logits| softmax(logits, &mut probabilities));
        let best = argmax(&probabilities);
        let action = match choice {
            Choice::Given(action) => action,
            Choice::Greedy => best,
            Choice::Own => draw(&probabilities, self.dice.unit()),
        };
        if choice != Choice::Greedy {
            self.unlikely += usize::from(action != best);
            self.rollout.observations.extend_from_slice(obs);
            self.rollout.actions.push(action as u32);
            let log = libm::logf(probabilities[action]);
            self.rollout.log_probabilities.push(log);
            let value = self.critic.evaluate(obs, |value| value[0]);
            self.rollout.values.push(value);
        }
        self.room.probabilities = probabilities;
        action
    }

    fn learn(&mut self, step: Step, obs: &[f32]) {
        self.rollout.rewards.push(step.reward);
        self.tally.decisions += 1;
        let Some(end) = step.end else {
            return;
        };
        self.explored = self.unlikely as f32 / self.rollout.rewards.len() as f32;
        // Value after the last decision: 0 at a terminal state, the critic's estimate
        // after a cut by the clock, and unknown after a fault.
        let after = match end {
            End::Terminated => 0.0,
            End::Truncated => self.critic.evaluate(obs, |value| value[0]),
            End::Aborted => {
                self.tally.aborted += 1;
                return self.rollout.drop_episode(obs.len());
            }
        };
        self.tally.episodes += 1;
        let (discount, trace) = (self.config.discount as f32, self.config.trace as f32);
        self.rollout.close_episode(after, discount, trace);
        // Only here, so that a rollout consists of whole episodes.
        if self.config.horizon <= self.rollout.actions.len() {
            self.update();
            self.rollout.clear();
        }
    }

    fn tally(&self) -> &TrainingCounters {
        &self.tally
    }

    /// The losses of the critic: the actor's objective has no level of its own.
    fn take_losses(&mut self) -> Losses {
        std::mem::take(&mut self.losses)
    }

    fn exploration(&self) -> f64 {
        f64::from(self.explored)
    }

    fn policy(&self) -> Box<dyn Policy> {
        Box::new(ActorCritic {
            actor: self.actor.clone(),
            critic: self.critic.clone(),
        })
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = TensorFile::new(POLICY);
        self.actor.save("actor", &mut bundle);
        self.critic.save("critic", &mut bundle);
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        let mut bundle = TensorFile::new(CHECKPOINT);
        self.actor.save("actor", &mut bundle);
        self.critic.save("critic", &mut bundle);
        self.actor_adam.save(&self.actor, "actor_adam", &mut bundle);
        self.critic_adam
            .save(&self.critic, "critic_adam", &mut bundle);
        self.dice.save(&mut bundle);
        self.tally.save(&mut bundle);
        let rollout = &self.rollout;
        let n = rollout.actions.len();
        let wide = [n, self.actor.inputs()];
        bundle.put("rollout/observations", &wide, rollout.observations.clone());
        bundle.put("rollout/actions", &[n], rollout.actions.clone());
        bundle.put(
            "rollout/log_probabilities",
            &[n],
            rollout.log_probabilities.clone(),
        );
        bundle.put("rollout/advantages", &[n], rollout.advantages.clone());
        bundle.put("rollout/returns", &[n], rollout.returns.clone());
        bundle
    }
}

/// Returns the mean and the standard deviation, floored for a division.
fn moments(values: impl Iterator<Item = f32> + Clone) -> (f32, f32) {
    let n = values.clone().count() as f32;
    let mean = values.clone().sum::<f32>() / n;
    let square = values.map(|x| (x - mean) * (x - mean)).sum::<f32>() / n;
    (mean, square.sqrt() + 1e-8)
}

/// Scales a gradient down to at most this length.
fn shorten(gradient: &mut [f32], longest: f64) {
    // In f64, because a sum of many f32 squares loses digits.
    let square: f64 = gradient.iter().map(|g| f64::from(*g) * f64::from(*g)).sum();
    let length = libm::sqrt(square);
    if longest < length {
        let factor = (longest / length) as f32;
        gradient.iter_mut().for_each(|g| *g *= factor);
    }
}
