//! A learner per ado: each with its own policy, observation and reward.
//!
//! - Tan, "Multi-Agent Reinforcement Learning: Independent vs. Cooperative
//!   Agents", ICML 1993: independent learners, to which the others are a part of
//!   the environment.
//! - Alternating training lets one ado learn a best response while the others
//!   play their best actions.
//!
//! All ados play the same episodes. A joint action of a hundred is then a choice
//! of five and a choice of twenty, and each policy is one of its own ado.

mod one_part;
mod policy;

use self::one_part::OnePart;
pub use self::policy::policy_of_part;
use self::policy::{POLICY, PerAdoPolicy};
use super::bundle::{BundleError, TensorFile};
use super::demonstrations::{self, GuideMemory};
use super::dice::LearnerRng;
use super::learner::{
    Built, Choice, ConfigError, Demonstration, EpisodePlan, Learner, LearnerKind, Seeding, Shaped,
    TrainingCounters, within,
};
use super::list::{LearnerSettings, PerAdoSettings, PerAdoTraining};
use super::starts::{EpisodeStart, StartPool};
use super::{End, Env, Losses, PartSpaces, Policy, Spaces, Step};

/// Kind of a checkpoint.
const CHECKPOINT: &str = "brakecheck per-ado checkpoint 1";

/// Failed starts that are played again: share of the episodes, number kept, retries.
const RESTART: (f64, usize, u32) = (0.5, 400, 4);

/// Returns the spaces of an ado's own decision problem.
fn own_spaces(part: &PartSpaces) -> Spaces {
    Spaces {
        observation: part.observed.len(),
        actions: part.actions,
        neutral: part.neutral,
        parts: Vec::new(),
    }
}

/// Returns the seed of an ado's learner.
fn seed_of(seed: u64, part: usize) -> u64 {
    // Neighbouring seeds of a training must not share a learner's seed.
    seed.wrapping_add((part as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}

// Updates at every second decision of each ado took 1.3 to 2 times as long and gained nothing,
// so all ados together make the updates of one learner. With `observe: Own` the ados solved
// 24 % of the starts of `sandwich` instead of 88 %, so `Shared` is the default.
impl LearnerKind for PerAdoSettings {
    fn bundles(&self) -> [&'static str; 2] {
        [POLICY, CHECKPOINT]
    }

    fn check(&self) -> Result<(), ConfigError> {
        within("longest", self.longest, 1.0, 100.0)?;
        within("guided", self.guided, 0.0, 1.0)?;
        within("remembered", self.remembered as f64, 1.0, 1e9)?;
        within("starts", self.seeding.starts as f64, 0.0, 1e6)?;
        within("simulations", self.seeding.simulations as f64, 0.0, 1e12)?;
        if let PerAdoTraining::Alternating { rounds } = self.training {
            within("rounds", f64::from(rounds), 1.0, 1e6)?;
        }
        for learner in std::iter::once(&*self.learner).chain(self.ados.values()) {
            if let LearnerSettings::PerAdo(_) | LearnerSettings::Traffic(_) = learner {
                return Err(ConfigError {
                    field: "learner",
                    why: format!("is `{}` inside `PerAdo`", learner.name()),
                    help: "give the learner of one ado, such as `Dqn()`".to_owned(),
                });
            }
            learner.kind().check()?;
        }
        Ok(())
    }

    fn discount(&self) -> f64 {
        self.learner.kind().discount()
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        let parts = self.parts_of(spaces);
        let ados = parts.len();
        let parts = parts.into_iter().enumerate().map(|(i, part)| {
            let learner = self
                .learner_of(&part, ados)
                .kind()
                .build(&own_spaces(&part), seed_of(seed, i));
            AdoLearner::new(part, learner)
        });
        Box::new(PerAdo::of(
            self,
            spaces,
            parts.collect(),
            LearnerRng::new(seed),
        ))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        let parts = self.parts_of(spaces);
        let ados = parts.len();
        let bundles = policy::bundles(policy, &parts)?;
        let learners = parts
            .into_iter()
            .zip(bundles)
            .enumerate()
            .map(|(i, (part, bundle))| {
                let settings = self.learner_of(&part, ados);
                let kind = settings.kind();
                super::learner::expect_kind(&bundle, kind.bundles()[0])?;
                let learner = kind.build_from(&own_spaces(&part), seed_of(seed, i), &bundle)?;
                Ok(AdoLearner::new(part, learner))
            })
            .collect::<Result<Vec<AdoLearner>, BundleError>>()?;
        Ok(Box::new(PerAdo::of(
            self,
            spaces,
            learners,
            LearnerRng::new(seed),
        )))
    }

    fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built {
        let parts = self.parts_of(spaces);
        let ados = parts.len();
        let bundles = policy::bundles(checkpoint, &parts)?;
        let learners = parts
            .into_iter()
            .zip(bundles)
            .map(|(part, bundle)| {
                let settings = self.learner_of(&part, ados);
                let kind = settings.kind();
                super::learner::expect_kind(&bundle, kind.bundles()[1])?;
                let learner = kind.restore(&own_spaces(&part), &bundle)?;
                Ok(AdoLearner::new(part, learner))
            })
            .collect::<Result<Vec<AdoLearner>, BundleError>>()?;
        let mut learner = PerAdo::of(self, spaces, learners, LearnerRng::restore(checkpoint)?);
        learner.starts.restore(checkpoint)?;
        learner.guides.restore(checkpoint, spaces.actions)?;
        learner.tally.restore(checkpoint)?;
        // An extension is not in the settings, so it is read from here.
        learner.tally.requested = checkpoint.one::<u64>("asked")?;
        Ok(Box::new(learner))
    }

    fn seeding(&self) -> Option<&Seeding> {
        Some(&self.seeding)
    }

    fn longest(&self) -> f64 {
        self.longest
    }

    // An explicit number of decisions is a budget, so no extension applies.
    fn fix(&mut self) {
        self.longest = 1.0;
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let policy = PerAdoPolicy::load(policy)?;
        let shape = policy.shape();
        Ok((Box::new(policy), shape))
    }
}

/// One ado with its learner.
struct AdoLearner {
    spaces: PartSpaces,
    learner: Box<dyn Learner>,
    /// Its observation of the current state.
    obs: Vec<f32>,
    /// Whether it learns from the running episode.
    learns: bool,
}

impl AdoLearner {
    fn new(spaces: PartSpaces, learner: Box<dyn Learner>) -> AdoLearner {
        AdoLearner {
            obs: vec![0.0; spaces.observed.len()],
            spaces,
            learner,
            learns: true,
        }
    }

    fn see(&mut self, joint: &[f32]) {
        for (own, &at) in self.obs.iter_mut().zip(&self.spaces.observed) {
            *own = joint[at];
        }
    }
}

/// Learner state: everything that changes during training.
struct PerAdo {
    training: PerAdoTraining,
    observation: usize,
    actions: usize,
    parts: Vec<AdoLearner>,
    starts: StartPool,
    guides: GuideMemory,
    dice: LearnerRng,
    tally: TrainingCounters,
    running: JointEpisode,
}

/// State of the running episode, empty between episodes.
#[derive(Default)]
struct JointEpisode {
    start: EpisodeStart,
    actions: Vec<usize>,
    /// Reward of each part for the last decision.
    rewards: Vec<f32>,
    total: f32,
}

impl PerAdo {
    fn of(
        settings: &PerAdoSettings,
        spaces: &Spaces,
        parts: Vec<AdoLearner>,
        dice: LearnerRng,
    ) -> PerAdo {
        let (restart, pool, tries) = RESTART;
        PerAdo {
            training: settings.training,
            observation: spaces.observation,
            actions: spaces.actions,
            running: JointEpisode {
                rewards: vec![0.0; parts.len()],
                ..JointEpisode::default()
            },
            parts,
            starts: StartPool::new(restart, pool, tries),
            guides: GuideMemory::new(settings.guided, settings.remembered),
            dice,
            tally: TrainingCounters::new(settings.decisions),
        }
    }

    /// Returns whether a part learns now.
    fn learns(&self, part: usize) -> bool {
        match self.training {
            PerAdoTraining::Independent => true,
            PerAdoTraining::Alternating { rounds } => {
                // Every ado has a turn in each round, and the decisions are shared evenly.
                let turns = u64::from(rounds) * self.parts.len() as u64;
                // More turns than decisions would divide by 0 below.
                let turn = (self.tally.requested / turns).max(1);
                self.tally.decisions / turn % self.parts.len() as u64 == part as u64
            }
        }
    }

    /// Returns whether a demonstration succeeds in `env`.
    fn succeeds(&self, env: &mut dyn Env, shown: &Demonstration) -> bool {
        let mut obs = vec![0.0; self.observation];
        env.reset(shown.index, &mut obs);
        let mut total = 0.0;
        for &action in &shown.actions {
            let step = env.step(action, &mut obs);
            total += step.reward;
            if let Some(end) = step.end {
                // A truncated play shows no success, even if it was paid on the way.
                return end == End::Terminated && total > 0.0;
            }
        }
        false
    }

    /// Writes the bundles of all parts, made by `of`.
    fn save_parts(&self, bundle: &mut TensorFile, of: impl Fn(&dyn Learner) -> TensorFile) {
        let parts = self
            .parts
            .iter()
            .map(|part| (part.spaces.clone(), of(&*part.learner)));
        policy::save(bundle, self.observation, self.actions, parts.collect());
    }
}

impl Learner for PerAdo {
    fn plan(&mut self) -> EpisodePlan {
        demonstrations::plan(Some(&self.guides), &mut self.starts, &mut self.dice)
    }

    fn begin(&mut self, plan: &EpisodePlan, obs: &[f32]) {
        self.running.start = plan.start;
        self.running.actions.clear();
        self.running.total = 0.0;
        for i in 0..self.parts.len() {
            let learns = self.learns(i);
            let part = &mut self.parts[i];
            part.learns = learns;
            part.see(obs);
            // A frozen learner that saw this beginning would wait for its end.
            if learns {
                part.learner.begin(plan, &part.obs);
            }
        }
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        let (mut joint, mut unit) = (0, 1);
        let mut given = match choice {
            Choice::Given(action) => action,
            Choice::Own | Choice::Greedy => 0,
        };
        for part in &mut self.parts {
            part.see(obs);
            let actions = part.spaces.actions;
            let own = match choice {
                Choice::Given(_) => Choice::Given(given % actions),
                Choice::Own if !part.learns => Choice::Greedy,
                Choice::Own | Choice::Greedy => choice,
            };
            // The digits of a joint action count the first ado fastest.
            given /= actions;
            let action = match own {
                // A part that does not learn keeps no record of the episode.
                Choice::Given(action) if !part.learns => action,
                _ => part.learner.act(&part.obs, own),
            };
            joint += unit * action;
            unit *= actions;
        }
        self.running.actions.push(joint);
        // An environment that fills in no rewards must not repeat the last ones.
        self.running.rewards.fill(0.0);
        joint
    }

    fn part_rewards(&mut self) -> Option<&mut [f32]> {
        Some(&mut self.running.rewards)
    }

    fn learn(&mut self, step: Step, obs: &[f32]) {
        self.tally.decisions += 1;
        self.running.total += step.reward;
        for (part, &reward) in self.parts.iter_mut().zip(&self.running.rewards) {
            if part.learns {
                part.see(obs);
                let own = Step { reward, ..step };
                part.learner.learn(own, &part.obs);
            }
        }
        match step.end {
            None => {}
            Some(End::Aborted) => self.tally.aborted += 1,
            Some(End::Terminated | End::Truncated) => {
                self.tally.episodes += 1;
                // The common return decides: a success is one of all ados or of none.
                if self.running.total <= 0.0 {
                    self.starts.failed(self.running.start);
                } else {
                    self.guides.remember(Demonstration {
                        index: self.running.start.index,
                        actions: self.running.actions.clone(),
                    });
                }
            }
        }
    }

    fn demonstrate(&mut self, env: &mut dyn Env, shown: &[Demonstration]) -> usize {
        // Played once for all: a learner that keeps no demonstrations cannot tell.
        let succeed: Vec<Demonstration> = shown
            .iter()
            .filter(|shown| self.succeeds(env, shown))
            .cloned()
            .collect();
        let (mut unit, parts) = (1, self.parts.len());
        for (at, part) in self.parts.iter_mut().enumerate() {
            let mut own = OnePart {
                observed: part.spaces.observed.clone(),
                rewards: vec![0.0; parts],
                joint: vec![0.0; self.observation],
                actions: Vec::new(),
                at: 0,
                part: at,
                spaces: own_spaces(&part.spaces),
                env: &mut *env,
            };
            for shown in &succeed {
                own.actions.clone_from(&shown.actions);
                let joint = shown.actions.iter();
                // Joint actions count the first ado fastest.
                let own_actions = joint.map(|joint| joint / unit % part.spaces.actions);
                let own_share = Demonstration {
                    index: shown.index,
                    actions: own_actions.collect(),
                };
                part.learner.demonstrate(&mut own, &[own_share]);
            }
            unit *= part.spaces.actions;
        }
        let count = succeed.len();
        succeed
            .into_iter()
            .for_each(|shown| self.guides.remember(shown));
        count
    }

    fn extend(&mut self, decisions: u64) {
        self.tally.requested += decisions;
        for part in &mut self.parts {
            part.learner.extend(decisions);
        }
    }

    fn tally(&self) -> &TrainingCounters {
        &self.tally
    }

    fn take_losses(&mut self) -> Losses {
        let mut sum = Losses::default();
        for part in &mut self.parts {
            let own = part.learner.take_losses();
            sum.sum += own.sum;
            sum.updates += own.updates;
        }
        sum
    }

    /// The exploration of the first ado.
    fn exploration(&self) -> f64 {
        let first = self.parts.first();
        first.map_or(0.0, |part| part.learner.exploration())
    }

    fn policy(&self) -> Box<dyn Policy> {
        let parts = self
            .parts
            .iter()
            .map(|part| (part.spaces.clone(), part.learner.policy()));
        Box::new(PerAdoPolicy::new(self.observation, parts))
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = TensorFile::new(POLICY);
        self.save_parts(&mut bundle, |learner| learner.policy_bundle());
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        let mut bundle = TensorFile::new(CHECKPOINT);
        self.save_parts(&mut bundle, |learner| learner.checkpoint());
        self.guides.save(&mut bundle);
        self.starts.save(&mut bundle);
        self.dice.save(&mut bundle);
        self.tally.save(&mut bundle);
        bundle.put("asked", &[1], vec![self.tally.requested]);
        bundle
    }
}
