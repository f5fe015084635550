//! Learner of the traffic that fails an ego: the law of actions, given a success.
//!
//! Actions follow a declared law p. The learner estimates V, the probability of a success
//! from here on, and plays p V: as the traffic drives in those episodes that succeed. A
//! power below 1 weakens p, in V as well as in p V ([`TrafficSettings::prior`]). It is deep
//! Q-learning from demonstrations ([`super::dqfd`]) with another backup
//! ([`super::soft_backup`]), and its policy draws its actions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bundle::{BundleError, TensorFile};
use super::demonstrations::Imitation;
use super::dqn::{Dqn, DqnSettings};
use super::learner::{
    Built, Choice, ConfigError, Demonstration, EpisodePlan, Learner, LearnerKind, Seeding, Shaped,
    TrainingCounters, expect_sizes, within,
};
use super::nn::Mlp;
use super::soft_backup::{SoftBackup, drawn, likeliest};
use super::traffic_law::TrafficLaw;
use super::{ActionOdds, End, Env, Losses, Policy, Spaces, Step};

/// Kind of a kept policy.
const POLICY: &str = "brakecheck traffic policy 1";
/// Kind of a checkpoint.
const CHECKPOINT: &str = "brakecheck traffic checkpoint 1";
const KINDS: [&str; 2] = [POLICY, CHECKPOINT];

/// Settings of the learner of traffic that fails.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "TrafficConfig", deny_unknown_fields, default)]
pub struct TrafficSettings {
    /// Decisions to train for (300000).
    pub decisions: u64,
    /// Widths of the hidden ReLU layers ([96, 96, 96]).
    pub hidden: Vec<usize>,
    /// Temperature at which the policy draws its actions (1).
    ///
    /// At 1, it drives as the traffic does, given that it succeeds. Towards 0, it takes the
    /// possible action of the greatest V, where errors of V count more.
    pub temperature: f64,
    /// Power to which the law is raised, in the backup of V and in the policy (1).
    ///
    /// At 1, the ado drives as the traffic does, given that it succeeds. Towards 0, rare
    /// actions cost less, and at 0 all possible actions are equally likely: V is then that of
    /// an adversary that keeps to what the law allows.
    #[serde(skip_serializing_if = "is_whole")]
    pub prior: f64,
    /// Least −ln V (50): a success that is rarer than e⁻⁵⁰ per episode is none.
    pub floor: f64,
    /// Law of the ados' actions, which `train --traffic` writes (all equally likely).
    pub law: TrafficLaw,
    /// Share of every batch drawn from successes alone (0.25).
    pub share: f64,
    /// Search for the first successes.
    pub seeding: Seeding,
}

/// Leaves the power of an unchanged law out of the text of a world.
///
/// A run directory of an earlier version then still names the same learner.
fn is_whole(prior: &f64) -> bool {
    *prior == 1.0
}

impl Default for TrafficSettings {
    fn default() -> Self {
        TrafficSettings {
            decisions: 300_000,
            hidden: vec![96, 96, 96],
            temperature: 1.0,
            prior: 1.0,
            floor: 50.0,
            law: TrafficLaw::default(),
            share: Imitation::default().share,
            seeding: Seeding::default(),
        }
    }
}

impl TrafficSettings {
    fn soft(&self) -> SoftBackup {
        SoftBackup { floor: self.floor }
    }

    fn reader(&self, actions: usize) -> LawReader {
        LawReader {
            law: self.law.clone(),
            prior: self.prior,
            actions,
        }
    }

    fn dqn(&self) -> DqnSettings {
        DqnSettings {
            decisions: self.decisions,
            hidden: self.hidden.clone(),
            ..DqnSettings::default()
        }
    }

    /// Returns the spaces of the network, whose inputs are the features of an observation.
    fn inner(&self, spaces: &Spaces) -> Spaces {
        Spaces {
            observation: spaces.observation + self.law.memory() + spaces.actions,
            ..spaces.clone()
        }
    }

    fn around(&self, spaces: &Spaces, dqn: Dqn) -> TrafficLearner {
        let imitation = Imitation {
            share: self.share,
            ..Imitation::default()
        };
        TrafficLearner {
            law: self.reader(spaces.actions),
            temperature: self.temperature,
            soft: self.soft(),
            observation: spaces.observation,
            dqn: dqn.learning_from(&imitation, KINDS).under_law(self.soft()),
        }
    }

    /// Refuses a law for other observations or actions.
    pub fn fits(&self, spaces: &Spaces) -> Result<(), BundleError> {
        let own = if self.law.factors.is_empty() {
            spaces.actions
        } else {
            self.law.actions()
        };
        expect_sizes("the law's number of actions", &[own], &[spaces.actions])?;
        // An observation may have more signals than the law reads.
        let read = self.law.observed().max(spaces.observation);
        expect_sizes("the law's observation", &[read], &[spaces.observation])
    }
}

impl LearnerKind for TrafficSettings {
    fn bundles(&self) -> [&'static str; 2] {
        KINDS
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.dqn().check()?;
        self.law.check()?;
        within("temperature", self.temperature, 1e-6, 1e6)?;
        within("prior", self.prior, 0.0, 1.0)?;
        within("floor", self.floor, 1.0, 1000.0)?;
        within("share", self.share, 0.0, 0.9)?;
        within("starts", self.seeding.starts as f64, 0.0, 1e6)?;
        within("simulations", self.seeding.simulations as f64, 0.0, 1e12)
    }

    fn discount(&self) -> f64 {
        1.0
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        // Invariant: a world with another law is refused.
        assert!(self.fits(spaces).is_ok(), "a law fits its world");
        let dqn = Dqn::new(&self.dqn(), &self.inner(spaces), seed);
        Box::new(self.around(spaces, dqn))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        self.fits(spaces)?;
        let dqn = Dqn::from_policy(&self.dqn(), &self.inner(spaces), seed, policy)?;
        Ok(Box::new(self.around(spaces, dqn)))
    }

    fn restore(&self, spaces: &Spaces, checkpoint: &TensorFile) -> Built {
        self.fits(spaces)?;
        let dqn = Dqn::restored(&self.dqn(), &self.inner(spaces), checkpoint)?;
        let mut learner = self.around(spaces, dqn);
        learner.dqn = learner.dqn.with_shown(checkpoint)?;
        Ok(Box::new(learner))
    }

    fn seeding(&self) -> Option<&Seeding> {
        Some(&self.seeding)
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let policy = TrafficPolicy::load(policy)?;
        let shape = [policy.observation, policy.law.actions];
        Ok((Box::new(policy), shape))
    }
}

/// Law with its power and the number of joint actions.
#[derive(Clone)]
struct LawReader {
    law: TrafficLaw,
    prior: f64,
    actions: usize,
}

impl LawReader {
    /// Returns the inputs of the network for an observation.
    ///
    /// They end with the weakened law, which the backup and the policy read from there.
    fn features(&self, obs: &[f32]) -> Vec<f32> {
        let mut into = Vec::new();
        self.law.features(obs, self.actions, self.prior, &mut into);
        into
    }
}

/// Learner state: a law, and deep Q-learning under it.
struct TrafficLearner {
    law: LawReader,
    temperature: f64,
    soft: SoftBackup,
    observation: usize,
    dqn: Dqn,
}

/// Environment whose observations are the features of another one.
struct WithLaw<'a> {
    env: &'a mut dyn Env,
    law: &'a LawReader,
    spaces: Spaces,
    obs: Vec<f32>,
}

impl Env for WithLaw<'_> {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.env.reset(index, &mut self.obs);
        obs.copy_from_slice(&self.law.features(&self.obs));
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        let step = self.env.step(action, &mut self.obs);
        obs.copy_from_slice(&self.law.features(&self.obs));
        step
    }
}

impl Learner for TrafficLearner {
    fn plan(&mut self) -> EpisodePlan {
        self.dqn.plan()
    }

    fn begin(&mut self, plan: &EpisodePlan, obs: &[f32]) {
        self.dqn.begin(plan, &self.law.features(obs));
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        self.dqn.act(&self.law.features(obs), choice)
    }

    fn learn(&mut self, step: Step, obs: &[f32]) {
        // A goal adds to the reward of a success, and any success is the same event here.
        let reward = match step.end {
            Some(End::Terminated) if step.reward > 0.0 => 1.0,
            Some(End::Terminated) => -1.0,
            _ => 0.0,
        };
        self.dqn
            .learn(Step { reward, ..step }, &self.law.features(obs));
    }

    fn demonstrate(&mut self, env: &mut dyn Env, shown: &[Demonstration]) -> usize {
        let mut with_law = WithLaw {
            spaces: env.spaces().clone(),
            obs: vec![0.0; self.observation],
            law: &self.law,
            env,
        };
        self.dqn.demonstrate(&mut with_law, shown)
    }

    fn extend(&mut self, decisions: u64) {
        self.dqn.extend(decisions);
    }

    fn tally(&self) -> &TrainingCounters {
        self.dqn.tally()
    }

    fn take_losses(&mut self) -> Losses {
        self.dqn.take_losses()
    }

    fn exploration(&self) -> f64 {
        self.dqn.exploration()
    }

    fn policy(&self) -> Box<dyn Policy> {
        Box::new(TrafficPolicy {
            law: self.law.clone(),
            temperature: self.temperature,
            soft: self.soft,
            observation: self.observation,
            net: self.dqn.network().clone(),
        })
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = self.dqn.policy_bundle();
        put_law(&self.law.law, &mut bundle);
        let sizes = [self.observation, self.law.actions].map(|it| it as u64);
        bundle.put("law/sizes", &[2], sizes.to_vec());
        let numbers = vec![self.temperature, self.soft.floor];
        bundle.put("law/numbers", &[2], numbers);
        if !is_whole(&self.law.prior) {
            bundle.put("law/prior", &[1], vec![self.law.prior]);
        }
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        self.dqn.checkpoint()
    }
}

/// Policy that draws from the law of actions, given a success.
struct TrafficPolicy {
    law: LawReader,
    temperature: f64,
    soft: SoftBackup,
    observation: usize,
    net: Mlp,
}

impl TrafficPolicy {
    fn load(bundle: &TensorFile) -> Result<TrafficPolicy, BundleError> {
        let sizes = bundle.get::<u64>("law/sizes", &[2])?;
        let [observation, actions] = [sizes[0] as usize, sizes[1] as usize];
        let numbers = bundle.get::<f64>("law/numbers", &[2])?;
        // Policies of an unchanged law, as all earlier ones are, have none.
        let prior = match bundle.shape("law/prior") {
            Some(_) => bundle.one::<f64>("law/prior")?,
            None => 1.0,
        };
        let settings = TrafficSettings {
            law: law_of(bundle)?,
            prior,
            temperature: numbers[0],
            floor: numbers[1],
            ..TrafficSettings::default()
        };
        let damaged = |error: ConfigError| BundleError::Mismatch {
            what: "the law of a policy",
            expected: "a sound law".to_owned(),
            found: error.what(),
        };
        settings.check().map_err(damaged)?;
        let spaces = Spaces {
            observation,
            actions,
            neutral: 0,
            parts: Vec::new(),
        };
        settings.fits(&spaces)?;
        let net = Mlp::load("q", bundle)?;
        let inner = settings.inner(&spaces).observation;
        expect_sizes("the policy's network", &net.ends(), &[inner, actions])?;
        Ok(TrafficPolicy {
            law: settings.reader(actions),
            temperature: settings.temperature,
            soft: settings.soft(),
            observation,
            net,
        })
    }

    /// Returns the probabilities of all actions at a temperature.
    fn probabilities(&self, obs: &[f32], temperature: f64) -> Vec<f64> {
        let features = self.law.features(obs);
        let logs = &features[features.len() - self.law.actions..];
        let mut probabilities = Vec::new();
        self.net.evaluate(&features, |values| {
            self.soft
                .tilted(logs, values, temperature, &mut probabilities);
        });
        probabilities
    }
}

impl Policy for TrafficPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        likeliest(&self.probabilities(obs, self.temperature))
    }

    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        let mut probabilities = self.probabilities(obs, self.temperature);
        let pairs = probabilities.iter_mut().zip(allowed);
        pairs.filter(|(_, it)| !**it).for_each(|(p, _)| *p = -1.0);
        likeliest(&probabilities)
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        drawn(&self.probabilities(obs, temperature), units())
    }

    fn drawn_at(&self) -> Option<f64> {
        Some(self.temperature)
    }

    fn odds(&self, obs: &[f32]) -> Option<ActionOdds> {
        let mut law = Vec::new();
        let own = self.probabilities(obs, self.temperature);
        self.law.law.probabilities(obs, self.law.actions, &mut law);
        Some(ActionOdds { law, own })
    }

    fn value(&self, obs: &[f32]) -> f32 {
        let features = self.law.features(obs);
        let logs = &features[features.len() - self.law.actions..];
        let backup = |values: &[f32]| self.soft.backup(logs, values);
        let log = self.soft.log_value(self.net.evaluate(&features, backup));
        // Decades, which a reader compares more easily than a number of many zeros.
        (log / std::f64::consts::LN_10) as f32
    }
}

fn put_law(law: &TrafficLaw, bundle: &mut TensorFile) {
    // Invariant: numbers and lists have a JSON text. A law has no other values.
    let text = serde_json::to_vec(law).unwrap_or_default();
    bundle.put("law/text", &[text.len()], text);
}

fn law_of(bundle: &TensorFile) -> Result<TrafficLaw, BundleError> {
    let text = bundle.rows::<u8>("law/text", &[])?;
    serde_json::from_slice(text).map_err(|error| BundleError::Mismatch {
        what: "the law of a policy",
        expected: "JSON".to_owned(),
        found: error.to_string(),
    })
}
