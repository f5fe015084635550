//! Minimal example of a learner: this file and one line in `list`.
//!
//! It plays actions at random and keeps the reward of each.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bundle::{BundleError, TensorFile};
use super::dice::LearnerRng;
use super::learner::{
    Built, Choice, ConfigError, EpisodePlan, Learner, LearnerKind, Shaped, TrainingCounters, within,
};
use super::nn::argmax;
use super::{End, Policy, Spaces, Step};

const POLICY: &str = "brakecheck paid policy 1";
const CHECKPOINT: &str = "brakecheck paid checkpoint 1";

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PaidSettings {
    pub decisions: u64,
    /// Share of a new reward in the kept reward.
    rate: f64,
}

impl Default for PaidSettings {
    fn default() -> Self {
        PaidSettings {
            decisions: 1000,
            rate: 0.1,
        }
    }
}

impl LearnerKind for PaidSettings {
    fn bundles(&self) -> [&'static str; 2] {
        [POLICY, CHECKPOINT]
    }

    fn check(&self) -> Result<(), ConfigError> {
        within("rate", self.rate, 1e-6, 1.0)
    }

    fn discount(&self) -> f64 {
        1.0
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        let paid = Paid::knowing(spaces.observation, vec![0.0; spaces.actions]);
        Box::new(PaidLearner::of(self, paid, LearnerRng::new(seed)))
    }

    fn build_from(&self, _: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        let paid = Paid::load(policy)?;
        Ok(Box::new(PaidLearner::of(self, paid, LearnerRng::new(seed))))
    }

    fn restore(&self, _: &Spaces, checkpoint: &TensorFile) -> Built {
        let paid = Paid::load(checkpoint)?;
        let mut learning = PaidLearner::of(self, paid, LearnerRng::restore(checkpoint)?);
        learning.tally.restore(checkpoint)?;
        Ok(Box::new(learning))
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let paid = Paid::load(policy)?;
        let shape = [paid.observation, paid.each.len()];
        Ok((Box::new(paid), shape))
    }
}

#[derive(Clone)]
struct Paid {
    observation: usize,
    each: Vec<f32>,
}

impl Paid {
    fn knowing(observation: usize, each: Vec<f32>) -> Paid {
        Paid { observation, each }
    }

    fn save(&self, bundle: &mut TensorFile) {
        bundle.put("paid", &[self.each.len()], self.each.clone());
        bundle.put("observation", &[1], vec![self.observation as u64]);
    }

    fn load(bundle: &TensorFile) -> Result<Paid, BundleError> {
        let each = bundle.rows::<f32>("paid", &[])?.to_vec();
        Ok(Paid::knowing(
            bundle.one::<u64>("observation")? as usize,
            each,
        ))
    }
}

impl Policy for Paid {
    fn act(&self, _: &[f32]) -> usize {
        argmax(&self.each)
    }

    fn value(&self, _: &[f32]) -> f32 {
        self.each[argmax(&self.each)]
    }
}

struct PaidLearner {
    rate: f32,
    paid: Paid,
    dice: LearnerRng,
    tally: TrainingCounters,
    /// Action of the running episode, and its return so far.
    action: usize,
    total: f32,
}

impl PaidLearner {
    fn of(settings: &PaidSettings, paid: Paid, dice: LearnerRng) -> PaidLearner {
        PaidLearner {
            rate: settings.rate as f32,
            paid,
            dice,
            tally: TrainingCounters::new(settings.decisions),
            action: 0,
            total: 0.0,
        }
    }
}

impl Learner for PaidLearner {
    fn plan(&mut self) -> EpisodePlan {
        EpisodePlan::of(self.tally.begun())
    }

    fn begin(&mut self, _: &EpisodePlan, _: &[f32]) {
        self.total = 0.0;
        self.action = self.dice.below(self.paid.each.len());
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        match choice {
            Choice::Own => self.action,
            Choice::Greedy => self.paid.act(obs),
            Choice::Given(action) => action,
        }
    }

    fn learn(&mut self, step: Step, _: &[f32]) {
        self.tally.decisions += 1;
        self.total += step.reward;
        match step.end {
            None => {}
            // A fault is no result of the action.
            Some(End::Aborted) => self.tally.aborted += 1,
            Some(End::Terminated | End::Truncated) => {
                self.tally.episodes += 1;
                let paid = &mut self.paid.each[self.action];
                *paid += self.rate * (self.total - *paid);
            }
        }
    }

    fn tally(&self) -> &TrainingCounters {
        &self.tally
    }

    fn exploration(&self) -> f64 {
        1.0
    }

    fn policy(&self) -> Box<dyn Policy> {
        Box::new(self.paid.clone())
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = TensorFile::new(POLICY);
        self.paid.save(&mut bundle);
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        let mut bundle = TensorFile::new(CHECKPOINT);
        self.paid.save(&mut bundle);
        self.dice.save(&mut bundle);
        self.tally.save(&mut bundle);
        bundle
    }
}

/// A learner of one file works from its settings to a policy that acts.
#[test]
fn a_learner_is_one_file_and_one_line() {
    use super::list::{LearnerConfig, LearnerSettings, load_policy};

    // As in world files.
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let with = |text: &str| {
        let settings: LearnerSettings = options.from_str(text).expect("settings");
        LearnerConfig::new(settings)
    };
    let wrong = with("Paid(rate: 2.0)")
        .expect_err("out of range")
        .to_string();
    assert!(wrong.contains("`rate` is 2"), "{wrong}");
    let unknown = options
        .from_str::<LearnerSettings>("Pad()")
        .expect_err("unknown");
    assert!(unknown.to_string().contains("Paid"), "{unknown}");

    let config = with("Paid(decisions: 600)").expect("a learner");
    assert_eq!(config.name(), "Paid");
    let spaces = Spaces {
        observation: 1,
        actions: 4,
        neutral: 0,
        parts: Vec::new(),
    };
    let mut learner = config.build(&spaces, 1);
    while !learner.finished() {
        let plan = learner.plan();
        learner.begin(&plan, &[0.0]);
        let action = learner.act(&[0.0], Choice::Own);
        let step = Step {
            reward: if action == 2 { 1.0 } else { -1.0 },
            end: Some(End::Terminated),
        };
        learner.learn(step, &[0.0]);
    }
    let bundle = learner.policy_bundle();
    let policy = load_policy(&bundle).expect("loaded by its kind");
    assert_eq!(policy.act(&[0.0]), 2);
    let tuned = config.build_from(&spaces, 1, &bundle).expect("fine-tuned");
    assert_eq!(tuned.policy().value(&[0.0]), policy.value(&[0.0]));
}
