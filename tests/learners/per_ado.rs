//! A learner per ado: own observations, own rewards, turns, files.

use brakecheck::rl::{End, Env, Learner, LearnerConfig, PartSpaces, Policy, Spaces, Step};

use super::{config, go_on};

/// Two ados see a number each and are paid for naming it.
///
/// The common reward is `common`, whatever they do, and each has a reward of its own.
struct TwoNumbers {
    spaces: Spaces,
    common: f32,
    numbers: [usize; 2],
    chosen: [usize; 2],
}

/// Actions of the two ados.
const ACTIONS: [usize; 2] = [3, 2];

impl TwoNumbers {
    fn new(common: f32) -> TwoNumbers {
        let part = |at: usize, name: &str| PartSpaces {
            name: name.to_owned(),
            actions: ACTIONS[at],
            neutral: 0,
            observed: vec![at],
        };
        TwoNumbers {
            spaces: Spaces {
                observation: 2,
                actions: 6,
                neutral: 0,
                parts: vec![part(0, "first"), part(1, "second")],
            },
            common,
            numbers: [0; 2],
            chosen: [0; 2],
        }
    }
}

fn obs_of(numbers: [usize; 2]) -> [f32; 2] {
    numbers.map(|number| number as f32 - 1.0)
}

impl Env for TwoNumbers {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        let index = index as usize;
        self.numbers = [index % ACTIONS[0], index / ACTIONS[0] % ACTIONS[1]];
        obs.copy_from_slice(&obs_of(self.numbers));
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.chosen = [action % ACTIONS[0], action / ACTIONS[0]];
        obs.copy_from_slice(&obs_of(self.numbers));
        Step {
            reward: self.common,
            end: Some(End::Terminated),
        }
    }

    fn part_rewards(&self, _: Step, rewards: &mut [f32]) {
        for (at, reward) in rewards.iter_mut().enumerate() {
            let right = self.chosen[at] == self.numbers[at];
            *reward = if right { 1.0 } else { -1.0 };
        }
    }
}

const SETTINGS: &str = "PerAdo(decisions: 8000, observe: Own, seeding: (starts: 0), \
     learner: Dqn(hidden: [16], batch: 16, learning_starts: 50))";

fn trained(settings: &str, env: &mut TwoNumbers) -> Box<dyn Learner> {
    let config: LearnerConfig = config(settings);
    let mut learner = config.build(&env.spaces.clone(), 4);
    go_on(&mut *learner, env);
    learner
}

/// Number of cases, of six, in which each ado names its number.
fn right(policy: &dyn Policy) -> [usize; 2] {
    let mut right = [0; 2];
    for case in 0..6 {
        let numbers = [case % 3, case / 3];
        let joint = policy.act(&obs_of(numbers));
        let chosen = [joint % ACTIONS[0], joint / ACTIONS[0]];
        for at in 0..2 {
            right[at] += usize::from(chosen[at] == numbers[at]);
        }
    }
    right
}

/// The common reward says nothing here, so only their own can have taught them.
#[test]
fn each_ado_learns_from_its_own_reward() {
    for training in ["Independent", "Alternating(rounds: 3)"] {
        let settings = SETTINGS.replace("observe", &format!("training: {training}, observe"));
        let mut env = TwoNumbers::new(0.0);
        let learner = trained(&settings, &mut env);
        assert_eq!(right(&*learner.policy()), [6, 6], "{training}");
    }
}

/// An ado that sees only its own number acts the same whatever the other one sees.
#[test]
fn an_ado_sees_only_what_it_observes() {
    let mut env = TwoNumbers::new(1.0);
    let policy = trained(SETTINGS, &mut env).policy();
    let first = |obs: [f32; 2]| policy.act(&obs) % ACTIONS[0];
    for own in [-1.0, 0.0, 1.0] {
        let others = [-9.0, 0.0, 9.0].map(|other| first([own, other]));
        assert!(others.iter().all(|action| *action == others[0]));
    }
}

#[test]
fn in_turns_only_one_ado_learns_at_a_time() {
    let settings = SETTINGS.replace("observe", "training: Alternating(rounds: 1), observe");
    let mut env = TwoNumbers::new(1.0);
    let mut learner = config(&settings).build(&env.spaces.clone(), 4);
    let parts = |learner: &dyn Learner| {
        let bundle = learner.policy_bundle();
        [0, 1].map(|at| {
            bundle
                .rows::<u8>(&format!("part/{at}"), &[])
                .unwrap()
                .to_vec()
        })
    };
    let begun = parts(&*learner);
    for _ in 0..3900 {
        learner.episode(&mut env);
    }
    let first = parts(&*learner);
    assert_ne!(begun[0], first[0]);
    assert_eq!(begun[1], first[1]);
    go_on(&mut *learner, &mut env);
    let second = parts(&*learner);
    assert_ne!(first[1], second[1]);
}

#[test]
fn a_training_goes_on_from_its_checkpoint_with_the_same_bytes() {
    let config = config(SETTINGS);
    let mut env = TwoNumbers::new(1.0);
    let spaces = env.spaces.clone();
    let mut through = config.build(&spaces, 9);
    let mut first = config.build(&spaces, 9);
    for _ in 0..700 {
        through.episode(&mut env);
        first.episode(&mut env);
    }
    let kept = first.checkpoint();
    let mut second = config.restore(&spaces, &kept).unwrap();
    for _ in 0..700 {
        through.episode(&mut env);
        second.episode(&mut env);
    }
    let bytes = |learner: &dyn Learner| learner.checkpoint().to_bytes().unwrap();
    assert_eq!(bytes(&*through), bytes(&*second));
}

#[test]
fn a_policy_of_other_ados_is_refused() {
    let mut env = TwoNumbers::new(1.0);
    let bundle = trained(SETTINGS, &mut env).policy_bundle();
    let config = config(SETTINGS);
    assert!(config.build_from(&env.spaces, 1, &bundle).is_ok());
    let mut others = env.spaces.clone();
    others.parts[1].name = "third".to_owned();
    let refused = config
        .build_from(&others, 1, &bundle)
        .map(|_| ())
        .unwrap_err();
    assert!(
        refused.to_string().contains("third of 2 actions"),
        "{refused}"
    );
}

/// Demonstrations are joint: each ado is shown its own part of them.
#[test]
fn a_demonstration_teaches_every_ado_its_part() {
    use brakecheck::rl::Demonstration;
    let settings = SETTINGS
        .replace(
            "Dqn(hidden: [16], batch: 16, learning_starts: 50)",
            "Dqfd()",
        )
        .replace("decisions: 8000", "decisions: 10");
    let mut env = TwoNumbers::new(1.0);
    let mut learner = config(&settings).build(&env.spaces.clone(), 4);
    let shown = |index: u64, action: usize| Demonstration {
        index,
        actions: vec![action],
    };
    // The second has no end that is a success of anybody: too short.
    let none = Demonstration {
        index: 2,
        actions: Vec::new(),
    };
    let kept = learner.demonstrate(&mut env, &[shown(0, 0), none, shown(5, 5)]);
    assert_eq!(kept, 2);
    let checkpoint = learner.checkpoint();
    for at in 0..2 {
        let bytes = checkpoint.rows::<u8>(&format!("part/{at}"), &[]).unwrap();
        let part = brakecheck::rl::TensorFile::from_bytes(bytes).unwrap();
        let own = part.rows::<u32>("shown/followed", &[]).unwrap();
        assert_eq!(own, [0, [2, 1][at]]);
    }
}
