//! The law that is learned, against the exact law of a small world.
//!
//! A gap shrinks while a car ahead brakes, and a success is a gap of 0. Braking for four
//! decisions breaks a rule. All 2187 sequences of actions are enumerated.

use super::list::{LearnerConfig, load_policy};
use super::traffic::TrafficSettings;
use super::traffic_law::{LawFactor, LawOnset, TrafficLaw};
use super::{End, Env, Policy, Spaces, Step};

const DECISIONS: usize = 7;
/// Gaps of the starts. A gap of 7 can only be closed by breaking the rule.
const GAPS: [i32; 4] = [2, 3, 6, 7];

struct FollowingEnv {
    spaces: Spaces,
    gap: i32,
    last: usize,
    braked: usize,
    decisions: usize,
}

impl FollowingEnv {
    fn new() -> FollowingEnv {
        FollowingEnv {
            spaces: Spaces {
                observation: 5,
                actions: 3,
                neutral: 1,
                parts: Vec::new(),
            },
            gap: 0,
            last: 1,
            braked: 0,
            decisions: 0,
        }
    }

    fn observe(&self, obs: &mut [f32]) {
        let left = (DECISIONS - self.decisions) as f32 / DECISIONS as f32;
        let (gap, braked) = (self.gap as f32, self.braked as f32);
        // Braking begins the less often, the smaller the gap is.
        let rate = 0.01 * gap.max(0.0);
        obs.copy_from_slice(&[gap / 4.0, left, braked / 3.0, self.last as f32, rate]);
    }
}

impl Env for FollowingEnv {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        *self = FollowingEnv {
            gap: GAPS[index as usize % GAPS.len()],
            ..FollowingEnv::new()
        };
        self.observe(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.gap += action as i32 - 1;
        self.braked = if action == 0 { self.braked + 1 } else { 0 };
        (self.last, self.decisions) = (action, self.decisions + 1);
        self.observe(obs);
        let (reward, over) = match () {
            () if self.braked > 3 => (-1.0, true),
            () if self.gap <= 0 => (1.0, true),
            () => (0.0, self.decisions == DECISIONS),
        };
        Step {
            reward,
            end: over.then_some(End::Terminated),
        }
    }
}

fn law() -> TrafficLaw {
    TrafficLaw {
        decision_s: 0.5,
        factors: vec![LawFactor {
            actions: 3,
            unit: 1,
            last: 3,
            before: None,
            // Braking ends in holding, and begins by an onset only.
            transitions: vec![
                vec![0.6, 0.4, 0.0],
                vec![0.0, 0.9, 0.1],
                vec![0.0, 0.5, 0.5],
            ],
            onsets: vec![LawOnset {
                rate: 4,
                to: vec![1.0, 0.0, 0.0],
            }],
        }],
    }
}

/// Probabilities of a sequence of actions from a start.
struct Sequence {
    law: f64,
    /// Under the law raised to a power.
    weakened: f64,
    own: f64,
    succeeds: bool,
}

/// Sequence that may go on.
struct OpenSequence {
    actions: Vec<usize>,
    sequence: Sequence,
}

/// Returns all sequences from a start, up to their ends.
fn sequences(policy: &dyn Policy, index: u64, prior: f64) -> Vec<Sequence> {
    let mut all = Vec::new();
    let mut open = vec![OpenSequence {
        actions: Vec::new(),
        sequence: Sequence {
            law: 1.0,
            weakened: 1.0,
            own: 1.0,
            succeeds: false,
        },
    }];
    while let Some(OpenSequence { actions, sequence }) = open.pop() {
        let mut env = FollowingEnv::new();
        let mut obs = vec![0.0; 5];
        env.reset(index, &mut obs);
        let mut last = None;
        for action in &actions {
            last = Some(env.step(*action, &mut obs));
        }
        if let Some(Step {
            reward,
            end: Some(_),
        }) = last
        {
            let succeeds = reward > 0.0;
            all.push(Sequence {
                succeeds,
                ..sequence
            });
            continue;
        }
        let odds = policy.odds(&obs).expect("a policy of traffic");
        // Written apart from the learner, whose law it checks.
        let power = |p: &f64| if *p > 0.0 { libm::pow(*p, prior) } else { 0.0 };
        let powers: Vec<f64> = odds.law.iter().map(power).collect();
        let sum: f64 = powers.iter().sum();
        for (action, share) in powers.iter().enumerate() {
            open.push(OpenSequence {
                actions: [&actions[..], &[action]].concat(),
                sequence: Sequence {
                    law: sequence.law * odds.law[action],
                    weakened: sequence.weakened * share / sum,
                    own: sequence.own * odds.own[action],
                    succeeds: false,
                },
            });
        }
    }
    all
}

fn trained(prior: f64) -> Box<dyn Policy> {
    let settings = TrafficSettings {
        decisions: 60_000,
        hidden: vec![48, 48],
        law: law(),
        prior,
        ..TrafficSettings::default()
    };
    let mut env = FollowingEnv::new();
    let config = LearnerConfig::new(settings).expect("in range");
    let mut learner = config.build(env.spaces(), 5);
    while !learner.finished() {
        learner.episode(&mut env);
    }
    load_policy(&learner.policy_bundle()).expect("a policy")
}

/// Learned law from a start, beside the exact ones.
struct LawComparison {
    /// Probability of a success under the weakened law, exact.
    exact: f64,
    /// V of the start.
    found: f64,
    /// Probability of a success under the learned law.
    succeeds: f64,
    /// Distances of the learned law from the weakened one and from the law itself, given a
    /// success.
    distances: [f64; 2],
}

impl LawComparison {
    fn of(policy: &dyn Policy, index: usize, prior: f64) -> LawComparison {
        let all = sequences(policy, index as u64, prior);
        let sum = |of: &dyn Fn(&Sequence) -> f64| all.iter().map(of).sum::<f64>();
        let laws: [fn(&Sequence) -> f64; 3] = [|it| it.weakened, |it| it.law, |it| it.own];
        for law in laws {
            assert!((sum(&law) - 1.0).abs() < 1e-9);
        }
        let success =
            |of: fn(&Sequence) -> f64| move |it: &Sequence| if it.succeeds { of(it) } else { 0.0 };
        let [exact, of_law, succeeds] = laws.map(|law| sum(&success(law)));
        let distance = |law: fn(&Sequence) -> f64, all: f64| {
            0.5 * sum(&|it| (it.own - success(law)(it) / all).abs())
        };
        let mut env = FollowingEnv::new();
        let mut obs = vec![0.0; 5];
        env.reset(index as u64, &mut obs);
        LawComparison {
            exact,
            found: libm::pow(10.0, f64::from(policy.value(&obs))),
            succeeds,
            distances: [distance(laws[0], exact), distance(laws[1], of_law)],
        }
    }

    fn said(&self, gap: i32) -> String {
        let LawComparison {
            exact,
            found,
            succeeds,
            distances: [near, far],
        } = self;
        format!(
            "gap {gap}: P {exact:.2e}, V {found:.2e}, success {succeeds:.3}, distance {near:.3}, \
             from the law itself {far:.3}"
        )
    }
}

#[test]
fn the_learned_law_is_the_law_given_a_success() {
    let policy = trained(1.0);
    for (index, gap) in GAPS.iter().enumerate().take(3) {
        let found = LawComparison::of(&*policy, index, 1.0);
        let said = found.said(*gap);
        // The traffic itself hardly ever succeeds.
        assert!(found.exact < 0.04 && found.succeeds > 0.9, "{said}");
        assert!(found.distances[0] < 0.12, "{said}");
        assert!((found.found / found.exact - 1.0).abs() < 0.3, "{said}");
    }
}

/// The power is in the backup as well. In the policy alone, V would be that of other ways.
#[test]
fn a_weakened_law_is_learned_given_a_success() {
    for prior in [0.25, 0.0] {
        let policy = trained(prior);
        for (index, gap) in GAPS.iter().enumerate().take(3) {
            let found = LawComparison::of(&*policy, index, prior);
            let said = format!("prior {prior}, {}", found.said(*gap));
            assert!(found.succeeds > 0.9 && found.distances[0] < 0.12, "{said}");
            assert!((found.found / found.exact - 1.0).abs() < 0.3, "{said}");
            // It is another law than that of the traffic, unless there is a single way.
            let is_single = *gap == 6;
            assert!(
                is_single || found.distances[0] < 0.5 * found.distances[1],
                "{said}"
            );
        }
    }
}

#[test]
fn a_start_without_a_lawful_success_has_no_value() {
    let policy = trained(1.0);
    let mut obs = vec![0.0; 5];
    let mut env = FollowingEnv::new();
    env.reset(3, &mut obs);
    let v = policy.value(&obs);
    assert!(v < -9.0, "{v}");
    assert_eq!(policy.drawn_at(), Some(1.0));
}

#[test]
fn a_temperature_leads_from_the_law_to_the_surest_action() {
    let policy = trained(1.0);
    let mut obs = vec![0.0; 5];
    let mut env = FollowingEnv::new();
    env.reset(0, &mut obs);
    let share = |temperature: f64| {
        let draws = (0..1000).filter(|it| {
            let unit = (f64::from(*it) + 0.5) / 1000.0;
            policy.sample(&obs, temperature, &mut || unit) == 0
        });
        draws.count()
    };
    // Braking at once is one of several ways, and the surest one.
    let [drawn, sure] = [share(1.0), share(0.05)];
    assert!(drawn < 700 && sure > 950, "{drawn} {sure}");
}

#[test]
fn a_resumed_training_continues_with_the_same_bits() {
    let settings = TrafficSettings {
        decisions: 6_000,
        hidden: vec![16],
        law: law(),
        ..TrafficSettings::default()
    };
    let config = LearnerConfig::new(settings).expect("in range");
    let (mut env, spaces) = (FollowingEnv::new(), FollowingEnv::new().spaces);
    let mut whole = config.build(&spaces, 5);
    while whole.decisions() < 3_000 {
        whole.episode(&mut env);
    }
    let mut again = config.restore(&spaces, &whole.checkpoint()).expect("saved");
    for learner in [&mut whole, &mut again] {
        while !learner.finished() {
            learner.episode(&mut env);
        }
    }
    assert_eq!(whole.checkpoint(), again.checkpoint());
    let other = config.build(&spaces, 6);
    assert_ne!(whole.policy_bundle(), other.policy_bundle());
    let tuned = config.build_from(&spaces, 6, &whole.policy_bundle());
    let obs = [0.5, 1.0, 0.0, 1.0, 0.02];
    let value = tuned.expect("a policy").policy().value(&obs);
    assert_eq!(value, whole.policy().value(&obs));
}
