//! Deep Q-learning, as measured to work on adversarial driving (recipe R).
//!
//! - Mnih et al., "Human-level control through deep reinforcement learning",
//!   Nature 2015: replay, target network.
//! - van Hasselt, Guez, Silver, "Deep Reinforcement Learning with Double
//!   Q-learning", AAAI 2016: the online network selects the action, the target
//!   network evaluates it.
//! - Schaul et al. 2016 and Watkins 1989: see [`super::replay`].
//! - Qin et al., "Automatic Testing With Reusable Adversarial Agents", Sec. II:
//!   squared loss, an update per decision on the newest transition and a batch.
//! - Dabney, Ostrovski, Barreto, "Temporally-Extended ε-Greedy Exploration",
//!   ICLR 2021: exploratory actions are held.
//!
//! Deviations: docs/background/learners.md.

mod lawful;
mod settings;
mod update;

use lawful::{LawfulEpisode, logs};
pub use settings::{DqnSettings, Loss};

use super::adam::Adam;
use super::bundle::{BundleError, TensorFile};
use super::demonstrations::{self, Demonstrations, Imitation};
use super::dice::LearnerRng;
use super::learner::{
    Built, Choice, ConfigError, Demonstration, EpisodePlan, Learner, LearnerKind, Shaped,
    TrainingCounters, epsilon, expect_sizes, layers,
};
use super::nn::{Mlp, Tape, argmax, argmax_among, sample};
use super::replay::{Batch, EpisodeBuffer, ReplayBuffer, Tail, Transition};
use super::soft_backup::{self, SoftBackup};
use super::starts::{EpisodeStart, StartPool};
use super::traffic_law::log_of;
use super::{End, Env, Losses, Policy, Spaces, Step};

/// Temperatures of the episodes of a training under a law.
///
/// Half of them follow the law given a success, and the others find likelier successes or
/// surer ones.
const TEMPERATURES: [f64; 4] = [1.0, 1.0, 0.5, 0.1];

/// Kind of a kept policy.
pub(super) const POLICY: &str = "brakecheck dqn policy 1";
/// Kind of a checkpoint.
const CHECKPOINT: &str = "brakecheck dqn checkpoint 1";

impl LearnerKind for DqnSettings {
    fn bundles(&self) -> [&'static str; 2] {
        [POLICY, CHECKPOINT]
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.bounds()
    }

    fn discount(&self) -> f64 {
        self.discount
    }

    fn space_updates(&mut self, times: u64) {
        // Saturating, as a spacing beyond all decisions means no update at all.
        self.update_every = self.update_every.saturating_mul(times);
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        Box::new(Dqn::new(self, spaces, seed))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        Ok(Box::new(Dqn::from_policy(self, spaces, seed, policy)?))
    }

    fn restore(&self, spaces: &Spaces, bundle: &TensorFile) -> Built {
        Ok(Box::new(Dqn::restored(self, spaces, bundle)?))
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let net = Mlp::load("q", policy)?;
        let shape = net.ends();
        Ok((Box::new(QPolicy { net }), shape))
    }
}

/// Learner state: everything that changes during training.
pub(super) struct Dqn {
    kinds: [&'static str; 2],
    config: DqnSettings,
    online: Mlp,
    target: Mlp,
    adam: Adam,
    replay: ReplayBuffer,
    /// Successes, kept apart by learners from demonstrations.
    shown: Option<Demonstrations>,
    /// Backup under the law of the actions, with which every observation then ends.
    law: Option<SoftBackup>,
    starts: StartPool,
    dice: LearnerRng,
    tally: TrainingCounters,
    /// Decision at which the schedule of step sizes restarts.
    since: u64,
    losses: Losses,
    running: RunningEpisode,
    room: DqnWorkspace,
}

/// State of the running episode, empty between episodes.
#[derive(Default)]
struct RunningEpisode {
    start: EpisodeStart,
    /// Exploratory action, and the decisions for which it is still held.
    held: usize,
    holding: usize,
    /// Last action, and the greedy action in its place.
    last: (usize, usize),
    /// Temperature at which actions are drawn under a law.
    temperature: f64,
}

/// Refuses a network for other observations or actions.
fn fits(spaces: &Spaces, net: &Mlp, what: &'static str) -> Result<(), BundleError> {
    expect_sizes(what, &net.ends(), &[spaces.observation, spaces.actions])
}

/// Reusable buffers without meaning between updates.
struct DqnWorkspace {
    batch: Batch,
    here: Tape,
    there: Tape,
    gradient: Vec<f32>,
    buffer: EpisodeBuffer,
    /// Probabilities of actions under a law.
    tilted: Vec<f64>,
}

impl Dqn {
    /// Creates an untrained learner.
    pub(super) fn new(config: &DqnSettings, spaces: &Spaces, seed: u64) -> Dqn {
        let mut dice = LearnerRng::new(seed);
        let sizes = layers(spaces.observation, &config.hidden, spaces.actions);
        let online = Mlp::orthogonal(&sizes, config.last_gain as f32, &mut dice);
        Dqn::around(config, spaces, online, dice)
    }

    /// Creates a learner that starts from a kept policy.
    ///
    /// The policy's network is used instead of the sizes in `hidden`.
    ///
    /// # Errors
    /// The policy is for other observations or actions.
    pub(super) fn from_policy(
        config: &DqnSettings,
        spaces: &Spaces,
        seed: u64,
        policy: &TensorFile,
    ) -> Result<Dqn, BundleError> {
        let net = Mlp::load("q", policy)?;
        fits(spaces, &net, "the policy's observation and actions")?;
        // Only the weights are kept, while Adam and the replay begin anew.
        Ok(Dqn::around(config, spaces, net, LearnerRng::new(seed)))
    }

    /// Restores a learner from a checkpoint, without demonstrations.
    ///
    /// # Errors
    /// The checkpoint is damaged, or for other observations or actions.
    pub(super) fn restored(
        config: &DqnSettings,
        spaces: &Spaces,
        bundle: &TensorFile,
    ) -> Result<Dqn, BundleError> {
        let online = Mlp::load("online", bundle)?;
        fits(spaces, &online, "the checkpoint's observation and actions")?;
        let mut dqn = Dqn::around(config, spaces, online, LearnerRng::restore(bundle)?);
        // Read in the shape of the online network, so that both surely fit each other.
        let target = dqn.online.load_as("target", bundle)?;
        dqn.target.parameters_mut().copy_from_slice(&target);
        dqn.adam = Adam::load(&dqn.online, "adam", bundle)?;
        dqn.replay.restore("replay", bundle, spaces.actions)?;
        dqn.starts.restore(bundle)?;
        dqn.tally.restore(bundle)?;
        Ok(dqn)
    }

    /// Makes the learner keep successes apart, with checkpoints of `kinds`.
    pub(super) fn learning_from(mut self, imitation: &Imitation, kinds: [&'static str; 2]) -> Dqn {
        let width = self.online.inputs();
        self.shown = Some(Demonstrations::new(imitation, width, self.config.priority));
        Dqn { kinds, ..self }
    }

    /// Makes values follow the law of actions with which every observation ends.
    ///
    /// They are then those of [`soft_backup`], actions are drawn, and a success is worth 0.
    pub(super) fn under_law(self, law: SoftBackup) -> Dqn {
        Dqn {
            law: Some(law),
            ..self
        }
    }

    /// Restores the successes of a checkpoint and the extended budget.
    ///
    /// # Errors
    /// The checkpoint contains no successes, or damaged successes.
    pub(super) fn with_shown(mut self, bundle: &TensorFile) -> Result<Dqn, BundleError> {
        let actions = self.online.outputs();
        if let Some(shown) = &mut self.shown {
            shown.restore(bundle, actions)?;
            let requested = bundle.get::<u64>("asked", &[2])?;
            (self.tally.requested, self.since) = (requested[0], requested[1]);
        }
        Ok(self)
    }

    /// Returns the network of its values.
    pub(super) fn network(&self) -> &Mlp {
        &self.online
    }

    fn around(config: &DqnSettings, spaces: &Spaces, online: Mlp, dice: LearnerRng) -> Dqn {
        let capacity = config.capacity.unwrap_or(usize::MAX - 1);
        let parameters = online.parameters().len();
        Dqn {
            kinds: [POLICY, CHECKPOINT],
            shown: None,
            law: None,
            // Both begin equal, or the first targets would be those of chance.
            target: online.clone(),
            adam: Adam::new(parameters),
            replay: ReplayBuffer::new(spaces.observation, capacity, config.priority),
            starts: StartPool::new(config.restart, config.restart_pool, config.restart_tries),
            dice,
            tally: TrainingCounters::new(config.decisions),
            since: 0,
            losses: Losses::default(),
            running: RunningEpisode::default(),
            room: DqnWorkspace {
                batch: Batch::default(),
                here: online.tape(config.batch),
                there: online.tape(config.batch),
                gradient: vec![0.0; parameters],
                buffer: EpisodeBuffer::default(),
                tilted: Vec::new(),
            },
            config: config.clone(),
            online,
        }
    }

    fn remember(&mut self, buffer: &EpisodeBuffer, end: End) {
        if let Some(law) = self.law {
            let [width, actions] = self.online.ends();
            let replay = &mut self.replay;
            let episode = LawfulEpisode {
                buffer,
                end,
                width,
                actions,
            };
            return episode.transitions(law, |it| replay.push(it));
        }
        // A truncated episode would go on, so its last return bootstraps.
        let tail = if end == End::Truncated {
            Tail::Open
        } else {
            Tail::Terminal
        };
        let discount = self.config.discount as f32;
        buffer.n_step(
            self.online.inputs(),
            self.config.steps,
            discount,
            tail,
            |transition| {
                self.replay.push(transition);
            },
        );
    }

    /// Records the last decision, unless it ended in a fault.
    fn remember_newest(&mut self, buffer: &EpisodeBuffer, end: Option<End>) {
        let width = self.online.inputs();
        // The last two rows: the observations before and after the decision.
        let from = buffer.observations.len() - 2 * width;
        let (observation, next) = buffer.observations[from..].split_at(width);
        let discount = match end {
            // A fault is no transition, since the world after it is unknown.
            Some(End::Aborted) => return,
            Some(End::Terminated) => 0.0,
            Some(End::Truncated) | None => self.config.discount as f32,
        };
        if let (Some(&action), Some(&reward)) = (buffer.actions.last(), buffer.rewards.last()) {
            self.replay.push(Transition {
                observation,
                action,
                reward,
                next,
                discount,
            });
        }
    }

    /// Returns an action drawn from the law given a success.
    fn drawn(&mut self, law: SoftBackup, obs: &[f32]) -> usize {
        let logs = logs(obs, self.online.outputs());
        let (tilted, temperature) = (&mut self.room.tilted, self.running.temperature);
        self.online.evaluate(obs, |values| {
            law.tilted(logs, values, temperature, tilted);
        });
        soft_backup::drawn(tilted, self.dice.unit())
    }

    /// Returns the action of an exploring decision.
    fn explored(&mut self, obs: &[f32], greedy: usize) -> usize {
        let (law, actions) = (self.law, self.online.outputs());
        let cannot = |action: usize| law.is_some() && log_of(logs(obs, actions)[action]).is_none();
        // An action that the law excludes is held no longer.
        if self.running.holding > 0 && cannot(self.running.held) {
            self.running.holding = 0;
        }
        if self.running.holding == 0 && self.dice.unit() < self.exploration() {
            // The greedy action is among them, so a part of this exploration explores
            // nothing.
            self.running.held = self.dice.below(self.online.outputs());
            self.running.holding = 1 + self.dice.below(self.config.hold);
        }
        let RunningEpisode { held, holding, .. } = self.running;
        self.running.holding = holding.saturating_sub(1);
        if holding > 0 && !cannot(held) {
            held
        } else {
            greedy
        }
    }

    /// Records an episode that has ended.
    fn finish(&mut self, buffer: &EpisodeBuffer, end: End) {
        if end == End::Aborted {
            self.tally.aborted += 1;
            return;
        }
        self.tally.episodes += 1;
        if !self.config.newest {
            self.remember(buffer, end);
        }
        // No verdict reaches a learner: a return of at most 0 counts as a failure,
        // which under the default reward is exactly "no success".
        let total: f32 = buffer.rewards.iter().sum();
        if total <= 0.0 {
            self.starts.failed(self.running.start)
        } else {
            self.succeeded(self.running.start.index, buffer)
        }
    }

    /// Records a successful episode as an example, if examples are kept.
    fn succeeded(&mut self, index: u64, buffer: &EpisodeBuffer) {
        let DqnSettings {
            steps, discount, ..
        } = self.config;
        let Some(shown) = &mut self.shown else {
            return;
        };
        if let Some(law) = self.law {
            let [width, actions] = self.online.ends();
            let episode = LawfulEpisode {
                buffer,
                end: End::Terminated,
                width,
                actions,
            };
            shown.remember_with(index, buffer, |replay| {
                episode.transitions(law, |it| replay.push(it));
            });
        } else {
            shown.remember(index, buffer, steps, discount as f32);
        }
    }
}

impl Learner for Dqn {
    fn plan(&mut self) -> EpisodePlan {
        let guides = self.shown.as_ref().map(Demonstrations::guides);
        demonstrations::plan(guides, &mut self.starts, &mut self.dice)
    }

    fn begin(&mut self, plan: &EpisodePlan, obs: &[f32]) {
        self.room.buffer.begin(obs);
        // Drawn only under a law, so that other trainings keep their random numbers.
        let temperature = match self.law {
            Some(_) => TEMPERATURES[self.dice.below(TEMPERATURES.len())],
            None => 0.0,
        };
        self.running = RunningEpisode {
            start: plan.start,
            temperature,
            ..RunningEpisode::default()
        };
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        // Computed while exploring as well: an n-step return may continue over an
        // exploratory action that happens to be the greedy action.
        let greedy = match self.law {
            Some(law) => self.drawn(law, obs),
            None => self.online.evaluate(obs, argmax),
        };
        let action = match choice {
            Choice::Given(action) => action,
            Choice::Greedy => greedy,
            Choice::Own => self.explored(obs, greedy),
        };
        self.running.last = (action, greedy);
        action
    }

    fn learn(&mut self, step: Step, obs: &[f32]) {
        let mut buffer = std::mem::take(&mut self.room.buffer);
        let (action, greedy) = self.running.last;
        buffer.note(action, action == greedy, step.reward, obs);
        self.tally.decisions += 1;
        // Updates run during the episode. Its transitions are kept only at the end,
        // since an aborted episode must leave nothing behind. With `newest` they are
        // kept at once.
        if self.config.newest {
            self.remember_newest(&buffer, step.end);
        }
        if self
            .tally
            .decisions
            .is_multiple_of(self.config.update_every)
            && self.config.learning_starts <= self.replay.len()
        {
            self.update();
        }
        if let Some(end) = step.end {
            self.finish(&buffer, end);
        }
        self.room.buffer = buffer;
    }

    /// Plays every demonstration and keeps those that succeed here as well.
    fn demonstrate(&mut self, env: &mut dyn Env, shown: &[Demonstration]) -> usize {
        if self.shown.is_none() {
            return 0;
        }
        let mut obs = vec![0.0; self.online.inputs()];
        let mut buffer = std::mem::take(&mut self.room.buffer);
        let mut kept = 0;
        for one in shown {
            env.reset(one.index, &mut obs);
            buffer.begin(&obs);
            let (mut total, mut ended) = (0.0, None);
            for &action in &one.actions {
                let step = env.step(action, &mut obs);
                // A demonstrated action counts as wanted: returns continue over it.
                buffer.note(action, true, step.reward, &obs);
                (total, ended) = (total + step.reward, step.end);
                if ended.is_some() {
                    break;
                }
            }
            // Truncated or unfinished plays are no proof of success in this environment.
            if ended == Some(End::Terminated) && total > 0.0 {
                self.succeeded(one.index, &buffer);
                kept += 1;
            }
        }
        self.room.buffer = buffer;
        kept
    }

    fn extend(&mut self, decisions: u64) {
        self.tally.requested += decisions;
        // Step sizes fall again from here, or an extension would learn next to nothing.
        self.since = self.tally.decisions;
    }

    fn tally(&self) -> &TrainingCounters {
        &self.tally
    }

    fn take_losses(&mut self) -> Losses {
        std::mem::take(&mut self.losses)
    }

    fn exploration(&self) -> f64 {
        let ends = (self.config.exploration, self.config.final_exploration);
        // Extensions do not explore more than the end of the configured training.
        let configured = TrainingCounters {
            requested: self.config.decisions,
            ..self.tally
        };
        epsilon(&configured, ends, self.config.exploration_fraction)
    }

    fn policy(&self) -> Box<dyn Policy> {
        Box::new(QPolicy {
            net: self.online.clone(),
        })
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = TensorFile::new(self.kinds[0]);
        self.online.save("q", &mut bundle);
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        let mut bundle = TensorFile::new(self.kinds[1]);
        self.online.save("online", &mut bundle);
        self.target.save("target", &mut bundle);
        self.adam.save(&self.online, "adam", &mut bundle);
        self.replay.save("replay", &mut bundle);
        if let Some(shown) = &self.shown {
            shown.save(&mut bundle);
            // Plain deep Q-learning is never extended, so only this kind stores both.
            bundle.put("asked", &[2], vec![self.tally.requested, self.since]);
        }
        self.dice.save(&mut bundle);
        self.starts.save(&mut bundle);
        self.tally.save(&mut bundle);
        bundle
    }
}

/// Greedy policy in Q, with V(s) = max Q(s, ·).
struct QPolicy {
    net: Mlp,
}

impl Policy for QPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        self.net.evaluate(obs, argmax)
    }

    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        self.net
            .evaluate(obs, |values| argmax_among(values, allowed))
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        self.net
            .evaluate(obs, |values| sample(values, temperature, units))
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.net.evaluate(obs, |values| values[argmax(values)])
    }

    fn action_values(&self, obs: &[f32]) -> Option<Vec<f32>> {
        Some(self.net.evaluate(obs, <[f32]>::to_vec))
    }
}
