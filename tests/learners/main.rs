//! Every learner: solves a tiny problem, repeats itself bit for bit, resumes;
//! its updates are held to numbers computed elsewhere.

mod bits;
mod bounds;
mod golden;
mod letter;
mod lived;
mod per_ado;
mod schedules;
mod scripted;
mod shown;
mod starts;

use brakecheck::rl::{
    BundleError, Control, End, Env, Learner, LearnerConfig, LearnerRng, LearnerSettings, Spaces,
    Step, TensorFile,
};
use brakecheck_rl::rl::adam::Adam;
use brakecheck_rl::rl::list::{load_policy, load_policy_for};
use brakecheck_rl::rl::nn::Mlp;
use brakecheck_rl::rl::replay::{Batch, EpisodeBuffer, ReplayBuffer, Tail, Transition};
use brakecheck_rl::rl::sum_tree::SumTree;
use proptest::prelude::*;

/// A configuration as a world file would write it.
fn config(ron: &str) -> LearnerConfig {
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    options.from_str(ron).unwrap()
}

fn go_on(learner: &mut dyn Learner, env: &mut dyn Env) {
    learner.train(env, &mut |_| Control::Continue);
}

/// A corridor of five cells: +1 at the right end, −1 at the left one, −0.1 per
/// decision. The best return from cell p is 1 − 0.1 (4 − p).
struct Corridor {
    spaces: Spaces,
    cell: usize,
}

impl Corridor {
    fn new() -> Corridor {
        Corridor {
            spaces: Spaces {
                observation: 1,
                actions: 3,
                neutral: 1,
                parts: Vec::new(),
            },
            cell: 0,
        }
    }

    fn observation(cell: usize) -> [f32; 1] {
        [cell as f32 / 2.0 - 1.0]
    }
}

impl Env for Corridor {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.cell = 1 + (index % 3) as usize;
        obs.copy_from_slice(&Corridor::observation(self.cell));
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.cell = self.cell + action - 1;
        obs.copy_from_slice(&Corridor::observation(self.cell));
        match self.cell {
            0 => Step {
                reward: -1.1,
                end: Some(End::Terminated),
            },
            4 => Step {
                reward: 0.9,
                end: Some(End::Terminated),
            },
            _ => Step {
                reward: -0.1,
                end: None,
            },
        }
    }
}

/// One decision worth 1, ended in a given way; some indices end otherwise.
struct OneStep {
    spaces: Spaces,
    end: End,
    aborts: bool,
}

impl OneStep {
    fn new(end: End) -> OneStep {
        let spaces = Spaces {
            observation: 1,
            actions: 2,
            neutral: 0,
            parts: Vec::new(),
        };
        OneStep {
            spaces,
            end,
            aborts: false,
        }
    }
}

impl Env for OneStep {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.aborts = self.end == End::Aborted && index % 2 == 1;
        obs.fill(0.5);
    }

    fn step(&mut self, _: usize, obs: &mut [f32]) -> Step {
        obs.fill(0.5);
        match (self.end, self.aborts) {
            (End::Aborted, true) => Step {
                reward: 1e6,
                end: Some(End::Aborted),
            },
            (End::Aborted, false) => Step {
                reward: 1.0,
                end: Some(End::Terminated),
            },
            (end, _) => Step {
                reward: 1.0,
                end: Some(end),
            },
        }
    }
}

const LEARNERS: [&str; 3] = [
    "Dqn(decisions: 6_000)",
    "QTable(decisions: 20_000)",
    "Ppo(decisions: 30_000, horizon: 256, entropy: 0.001)",
];

/// The paper's settings, as in `acc_letter`, but for γ: the corridor pays its way.
const LETTER: [&str; 2] = [
    "Dqn(decisions: 12_000, loss: Squared, exploration: 0.2, final_exploration: 0.2, hold: 1, \
     update_every: 1, newest: true, learning_starts: 1, steps: 1, polyak: 1.0, restart: 0.0, \
     priority: 0.0)",
    "QTable(decisions: 20_000, initial_spread: 0.5, backward: false, exploration: 0.2, \
     final_exploration: 0.2, hold: 1)",
];

#[test]
fn every_learner_solves_the_corridor_to_its_known_value() {
    for ron in LEARNERS.into_iter().chain(LETTER) {
        let mut learner = config(ron).build(Corridor::new().spaces(), 1);
        go_on(&mut *learner, &mut Corridor::new());
        let policy = learner.policy();
        for cell in 1..4 {
            let obs = Corridor::observation(cell);
            let best = 1.0 - 0.1 * (4 - cell) as f32;
            assert_eq!(policy.act(&obs), 2, "{ron}: cell {cell}");
            let value = policy.value(&obs);
            assert!(
                (value - best).abs() < 0.05,
                "{ron}: V({cell}) = {value}, not {best}"
            );
        }
    }
}

#[test]
fn a_truncated_episode_is_bootstrapped_and_a_terminated_one_is_not() {
    // With γ = ½ and reward 1: V = 1 after an end, V = 1 + V/2 = 2 without.
    for (learner, extra) in [
        ("Dqn", "learning_starts: 100"),
        ("QTable", ""),
        ("Ppo", "trace: 0.0, horizon: 256"),
    ] {
        let ron = format!("{learner}(decisions: 8_000, discount: 0.5, {extra})");
        for (end, expected) in [(End::Terminated, 1.0), (End::Truncated, 2.0)] {
            let mut env = OneStep::new(end);
            let mut learner = config(&ron).build(env.spaces(), 1);
            go_on(&mut *learner, &mut env);
            let value = learner.policy().value(&[0.5]);
            assert!(
                (value - expected).abs() < 0.05,
                "{ron}: {end:?} has value {value}"
            );
        }
    }
}

#[test]
fn an_aborted_episode_is_dropped_whole_and_counted() {
    for ron in LEARNERS {
        let mut env = OneStep::new(End::Aborted);
        let mut learner = config(ron).build(env.spaces(), 1);
        let (mut aborted, mut episodes) = (0, 0);
        learner.train(&mut env, &mut |progress| {
            (aborted, episodes) = (progress.aborted, progress.episodes);
            Control::Continue
        });
        assert!(
            aborted > 1000 && aborted + episodes == learner.decisions(),
            "{ron}"
        );
        let value = learner.policy().value(&[0.5]);
        assert!((value - 1.0).abs() < 0.1, "{ron}: {value}");
    }
}

#[test]
fn equal_seeds_give_equal_bytes_and_others_do_not() {
    for ron in LEARNERS.into_iter().chain(LETTER) {
        let bytes = |seed| {
            let config = config(ron).with_decisions(3000).expect("in range");
            let mut learner = config.build(Corridor::new().spaces(), seed);
            go_on(&mut *learner, &mut Corridor::new());
            let policy = learner.policy_bundle().to_bytes().unwrap();
            (policy, learner.checkpoint().to_bytes().unwrap())
        };
        let first = bytes(1);
        assert_eq!(first, bytes(1), "{ron}");
        assert_ne!(first, bytes(2), "{ron}");
    }
}

#[test]
fn training_in_pieces_equals_training_in_one_go_byte_for_byte() {
    for ron in LEARNERS.into_iter().chain(LETTER) {
        let config = config(ron).with_decisions(6000).expect("in range");
        let mut whole = config.build(Corridor::new().spaces(), 3);
        go_on(&mut *whole, &mut Corridor::new());

        let mut pieces = config.build(Corridor::new().spaces(), 3);
        let mut breaks = 0;
        while !pieces.finished() {
            let until = pieces.decisions() + 1717;
            pieces.train(&mut Corridor::new(), &mut |progress| {
                if progress.decisions < until {
                    Control::Continue
                } else {
                    Control::Stop
                }
            });
            let bytes = pieces.checkpoint().to_bytes().unwrap();
            let checkpoint = TensorFile::from_bytes(&bytes).unwrap();
            pieces = config
                .restore(Corridor::new().spaces(), &checkpoint)
                .unwrap();
            breaks += 1;
        }
        assert!(breaks >= 3);
        let bytes = |learner: &dyn Learner| learner.checkpoint().to_bytes().unwrap();
        assert_eq!(bytes(&*whole), bytes(&*pieces), "{ron}");
    }
}

#[test]
fn stop_ends_training_after_the_episode() {
    for ron in LEARNERS {
        let mut learner = config(ron).build(Corridor::new().spaces(), 1);
        let mut calls = 0;
        learner.train(&mut Corridor::new(), &mut |progress| {
            calls += 1;
            assert_eq!(progress.episodes, calls);
            if calls < 5 {
                Control::Continue
            } else {
                Control::Stop
            }
        });
        assert_eq!(calls, 5);
        assert!(!learner.finished());
    }
}

#[test]
fn a_kept_policy_acts_like_the_learner_and_can_be_trained_on() {
    for ron in LEARNERS.into_iter().chain(LETTER) {
        let config = config(ron).with_decisions(1500).expect("in range");
        let mut learner = config.build(Corridor::new().spaces(), 1);
        go_on(&mut *learner, &mut Corridor::new());
        let bytes = learner.policy_bundle().to_bytes().unwrap();
        let bundle = TensorFile::from_bytes(&bytes).unwrap();
        let kept = load_policy(&bundle).unwrap();
        let tuned = config
            .build_from(Corridor::new().spaces(), 9, &bundle)
            .unwrap()
            .policy();
        for x in [-1.0, -0.5, 0.0, 0.31, 0.5, 1.0, 7.0] {
            for policy in [&kept, &tuned] {
                assert_eq!(policy.act(&[x]), learner.policy().act(&[x]));
                assert_eq!(
                    policy.value(&[x]).to_bits(),
                    learner.policy().value(&[x]).to_bits()
                );
            }
        }
    }
}

#[test]
fn a_checkpoint_of_another_learner_or_shape_is_refused() {
    let wider = Spaces {
        observation: 2,
        actions: 3,
        neutral: 1,
        parts: Vec::new(),
    };
    for ron in LEARNERS {
        let short = config(ron).with_decisions(1500).expect("in range");
        let mut learner = short.build(Corridor::new().spaces(), 1);
        go_on(&mut *learner, &mut Corridor::new());
        let (policy, checkpoint) = (learner.policy_bundle(), learner.checkpoint());
        for other in LEARNERS {
            let restored = config(other).restore(Corridor::new().spaces(), &checkpoint);
            assert_eq!(restored.is_ok(), ron == other);
            assert!(
                config(other)
                    .restore(Corridor::new().spaces(), &policy)
                    .is_err()
            );
            assert!(config(other).restore(&wider, &checkpoint).is_err());
            assert!(config(other).build_from(&wider, 1, &policy).is_err());
        }
        assert!(load_policy(&checkpoint).is_err());
        assert!(load_policy_for(Corridor::new().spaces(), &policy).is_ok());
        assert!(load_policy_for(&wider, &policy).is_err());
    }
}

// Adaptive cruise control of point masses, set D: a lead car with three
// accelerations makes its follower come closer than 4.7 m, and keeps its own
// speed within 0.1 and 30 m/s.

#[derive(Clone)]
struct Acc {
    spaces: Spaces,
    stream: u64,
    headway_m: f64,
    ego_mps: f64,
    ego_mps2: f64,
    ado_mps: f64,
    least_m: f64,
    decision: u32,
}

#[derive(Clone, Copy, PartialEq)]
enum Outcome {
    Success,
    Foul,
    Held,
}

impl Acc {
    const DECISIONS: u32 = 30;
    const ACTIONS_MPS2: [f64; 3] = [-3.0, 0.0, 3.0];
    const SAMPLE_S: f64 = 0.05;

    /// Streams have different starts.
    fn new(stream: u64) -> Acc {
        Acc {
            spaces: Spaces {
                observation: 5,
                actions: 3,
                neutral: 1,
                parts: Vec::new(),
            },
            stream,
            headway_m: 0.0,
            ego_mps: 0.0,
            ego_mps2: 0.0,
            ado_mps: 0.0,
            least_m: 0.0,
            decision: 0,
        }
    }

    /// To a start from which a coasting ado does not succeed.
    fn begin(&mut self, index: u64) {
        let mut dice = LearnerRng::new(self.stream << 32 | index);
        loop {
            self.ego_mps = 5.0 + 20.0 * dice.unit();
            self.ado_mps = 5.0 + 20.0 * dice.unit();
            self.headway_m = 8.0 + 52.0 * dice.unit();
            (self.ego_mps2, self.least_m, self.decision) = (0.0, self.headway_m, 0);
            if self.clone().play(|_| 1) != Outcome::Success {
                return;
            }
        }
    }

    fn play(mut self, mut act: impl FnMut(&Acc) -> usize) -> Outcome {
        loop {
            let action = act(&self);
            if let Some(outcome) = self.advance(action) {
                return outcome;
            }
        }
    }

    fn advance(&mut self, action: usize) -> Option<Outcome> {
        for _ in 0..10 {
            let error_m = self.headway_m - 5.7 - 0.5 * self.ego_mps;
            let wanted = 0.3 * error_m + 1.2 * (self.ado_mps - self.ego_mps);
            self.ego_mps2 += (wanted.clamp(-6.0, 2.5) - self.ego_mps2) * Acc::SAMPLE_S / 0.4;
            let before = self.ado_mps - self.ego_mps;
            self.ego_mps = (self.ego_mps + self.ego_mps2 * Acc::SAMPLE_S).max(0.0);
            self.ado_mps += Acc::ACTIONS_MPS2[action] * Acc::SAMPLE_S;
            self.headway_m += 0.5 * Acc::SAMPLE_S * (before + self.ado_mps - self.ego_mps);
            self.least_m = self.least_m.min(self.headway_m);
            if self.ado_mps <= 0.1 || self.ado_mps >= 30.0 {
                return Some(Outcome::Foul);
            }
            if self.headway_m < 4.7 {
                return Some(Outcome::Success);
            }
        }
        self.decision += 1;
        (self.decision == Acc::DECISIONS).then_some(Outcome::Held)
    }

    fn observe(&self) -> [f32; 5] {
        let left = f64::from(Acc::DECISIONS - self.decision) / f64::from(Acc::DECISIONS);
        let speeds = [self.ego_mps / 15.0 - 1.0, self.ado_mps / 15.0 - 1.0];
        [
            self.headway_m / 30.0 - 1.0,
            speeds[0],
            speeds[1],
            self.ego_mps2 / 6.0,
            2.0 * left - 1.0,
        ]
        .map(|x| x as f32)
    }

    /// Whether some sequence with at most this many switches succeeds.
    fn solvable(&self, last: Option<usize>, switches: u32) -> bool {
        (0..3).any(|action| {
            let switched = last.is_some_and(|last| last != action);
            if switched && switches == 0 {
                return false;
            }
            let mut next = self.clone();
            match next.advance(action) {
                Some(outcome) => outcome == Outcome::Success,
                None => next.solvable(Some(action), switches - u32::from(switched)),
            }
        })
    }

    /// The share of 200 fresh starts on which `act` succeeds.
    fn success(mut act: impl FnMut(&[f32]) -> usize) -> f64 {
        let mut won = 0;
        for index in 0..200 {
            let mut env = Acc::new(2);
            env.begin(index);
            won += u32::from(env.play(|acc| act(&acc.observe())) == Outcome::Success);
        }
        f64::from(won) / 200.0
    }

    /// The same, trained.
    fn success_of(ron: &str) -> f64 {
        let mut learner = config(ron).build(Acc::new(1).spaces(), 1);
        go_on(&mut *learner, &mut Acc::new(1));
        let policy = learner.policy();
        Acc::success(|obs| policy.act(obs))
    }

    /// The best of the ados that need no training: random, held, constant.
    fn baseline() -> f64 {
        let mut dice = LearnerRng::new(5);
        let random = Acc::success(|_| dice.below(3));
        let (mut held, mut left) = (0, 0);
        let held_random = Acc::success(|_| {
            (held, left) = if left == 0 {
                (dice.below(3), 4)
            } else {
                (held, left - 1)
            };
            held
        });
        let constant = (0..3).map(|action| Acc::success(|_| action));
        constant.fold(random.max(held_random), f64::max)
    }
}

impl Env for Acc {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.begin(index);
        obs.copy_from_slice(&self.observe());
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        let Some(outcome) = self.advance(action) else {
            obs.copy_from_slice(&self.observe());
            return Step {
                reward: 0.0,
                end: None,
            };
        };
        obs.copy_from_slice(&self.observe());
        let depth = 0.5 * libm::tanh((4.7 - self.least_m) / 10.0);
        let reward = match outcome {
            Outcome::Success => 0.5 + depth,
            Outcome::Held => depth - 0.5,
            Outcome::Foul if self.ado_mps <= 0.1 => -1.5,
            Outcome::Foul => -1.0,
        };
        Step {
            reward: reward as f32,
            end: Some(End::Terminated),
        }
    }
}

#[test]
fn dqn_finds_nearly_all_that_search_finds_on_cruise_control() {
    let mut env = Acc::new(2);
    let solvable = |index: &u64| {
        env.begin(*index);
        env.solvable(None, 2)
    };
    let reachable = (0..200).filter(solvable).count() as f64 / 200.0;
    let success = Acc::success_of("Dqn(decisions: 50_000)");
    println!(
        "success {success}, reachable {reachable}, untrained {}",
        Acc::baseline()
    );
    assert!(0.9 * reachable < success && Acc::baseline() + 0.4 < success);
}

#[test]
fn ppo_beats_untrained_ados_on_cruise_control() {
    let success = Acc::success_of("Ppo(decisions: 100_000)");
    assert!(Acc::baseline() + 0.4 < success, "{success}");
}

#[test]
fn the_q_table_beats_untrained_ados_on_cruise_control() {
    let bins = "[Bins(count: 30), Bins(), Bins(), Bins(count: 5), Bins(count: 30)]";
    let success = Acc::success_of(&format!("QTable(decisions: 2_000_000, bins: {bins})"));
    assert!(Acc::baseline() + 0.05 < success, "{success}");
}

// Networks.

#[test]
fn gradients_agree_with_finite_differences() {
    let mut dice = LearnerRng::new(4);
    let mut normal = |n: usize| (0..n).map(|_| dice.normal() as f32).collect::<Vec<_>>();
    for sizes in [&[3, 7, 5, 2][..], &[4, 20, 1], &[2, 3], &[6, 33, 9, 12, 4]] {
        let (inputs, outputs) = (sizes[0], sizes[sizes.len() - 1]);
        for batch in [1, 2, 7] {
            let mut net = Mlp::orthogonal(sizes, 1.0, &mut LearnerRng::new(batch as u64));
            let (x, pull) = (normal(batch * inputs), normal(batch * outputs));
            let mut tape = net.tape(8);
            let stride = net.output_stride();
            // The loss is Σ pull · output.
            let loss = |net: &Mlp, tape: &mut _| -> f64 {
                let rows = net.forward(&x, batch, tape).chunks_exact(stride);
                let pairs = rows.zip(pull.chunks_exact(outputs));
                pairs
                    .flat_map(|(row, p)| row.iter().zip(p))
                    .map(|(o, p)| f64::from(o * p))
                    .sum()
            };
            loss(&net, &mut tape);
            let (_, gradient) = net.output_and_gradient(batch, &mut tape);
            gradient.fill(0.0);
            for (row, p) in gradient
                .chunks_exact_mut(stride)
                .zip(pull.chunks_exact(outputs))
            {
                row[..outputs].copy_from_slice(p);
            }
            let mut analytic = vec![f32::NAN; net.parameters().len()];
            net.backward(&x, batch, &mut tape, &mut analytic);
            for (at, analytic) in analytic.iter().enumerate() {
                if net.parameters()[at] == 0.0 && *analytic == 0.0 {
                    continue; // padding, or a bias of a unit that is off
                }
                // The loss is piecewise linear in a single parameter, so one of
                // the two one-sided differences is exact even beside a kink.
                let (kept, here) = (net.parameters()[at], loss(&net, &mut tape));
                let error = [1e-3f32, -1e-3].map(|h| {
                    net.parameters_mut()[at] = kept + h;
                    let numeric = (loss(&net, &mut tape) - here) / f64::from(h);
                    (numeric - f64::from(*analytic)).abs() / (1.0 + numeric.abs())
                });
                net.parameters_mut()[at] = kept;
                assert!(
                    error[0].min(error[1]) < 5e-3,
                    "{sizes:?} {batch} {at}: {error:?}"
                );
            }
        }
    }
}

#[test]
fn acting_and_training_agree_to_the_last_bit() {
    let mut dice = LearnerRng::new(8);
    for sizes in [&[5, 64, 64, 3][..], &[1, 9, 17], &[40, 200, 100, 30]] {
        let net = Mlp::orthogonal(sizes, 1.0, &mut dice);
        let mut tape = net.tape(64);
        let x: Vec<f32> = (0..61 * sizes[0]).map(|_| dice.normal() as f32).collect();
        let rows = net
            .forward(&x, 61, &mut tape)
            .chunks_exact(net.output_stride());
        for (row, x) in rows.zip(x.chunks_exact(sizes[0])) {
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&row[..net.outputs()]), net.evaluate(x, bits));
        }
    }
}

#[test]
fn the_first_step_of_adam_has_the_length_of_the_learning_rate() {
    let (mut parameters, gradient) = (vec![1.0, 1.0, 1.0], [3.0, -0.02, 0.0]);
    Adam::new(3).step(&mut parameters, &gradient, 0.1);
    for (parameter, expected) in parameters.iter().zip([0.9, 1.1, 1.0]) {
        assert!((parameter - expected).abs() < 1e-5);
    }
}

#[test]
fn orthogonal_weights_keep_lengths() {
    let net = Mlp::orthogonal(&[8, 8], 1.0, &mut LearnerRng::new(2));
    let x = [0.3, -0.1, 0.9, 0.2, 0.0, -0.7, 0.4, 0.5];
    let square = |v: &[f32]| v.iter().map(|x| x * x).sum::<f32>();
    assert!((net.evaluate(&x, square) - square(&x)).abs() < 1e-5);
}

// Replay.

proptest! {
    #[test]
    fn a_sum_tree_finds_what_a_running_sum_finds(
        leaves in prop::collection::vec(0u32..50, 1..70),
        changes in prop::collection::vec((0usize..70, 0u32..50), 0..30),
        draws in prop::collection::vec(0.0f64..1.0, 1..20),
    ) {
        // Whole numbers, so that every sum is exact.
        let mut leaves: Vec<f64> = leaves.into_iter().map(f64::from).collect();
        let mut tree = SumTree::new(&leaves);
        for (leaf, value) in changes {
            if leaf < leaves.len() {
                leaves[leaf] = f64::from(value);
                tree.set(leaf, f64::from(value));
            }
        }
        let total: f64 = leaves.iter().sum();
        prop_assert_eq!(tree.total(), total);
        prop_assert_eq!(&tree, &SumTree::new(&leaves));
        if total == 0.0 {
            return Ok(());
        }
        let mut masses: Vec<f64> = draws.iter().map(|draw| draw * total).collect();
        masses.push(total);
        let expected: Vec<usize> = masses.iter().map(|mass| running(&leaves, *mass)).collect();
        let mut found = vec![0; masses.len()];
        tree.find(&masses, &mut found);
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn a_grown_sum_tree_equals_one_built_at_once(
        leaves in prop::collection::vec(0.0f64..10.0, 1..100),
    ) {
        let mut tree = SumTree::default();
        for (i, leaf) in leaves.iter().enumerate() {
            tree.grow(i + 1);
            tree.set(i, *leaf);
        }
        prop_assert_eq!(tree, SumTree::new(&leaves));
    }
}

/// The leaf in which the running sum passes `mass`, or the last positive one.
fn running(leaves: &[f64], mass: f64) -> usize {
    let mut sum = 0.0;
    let mut last = 0;
    for (i, leaf) in leaves.iter().enumerate() {
        sum += leaf;
        last = if *leaf > 0.0 { i } else { last };
        if mass < sum {
            return i;
        }
    }
    last
}

#[test]
fn a_return_ends_before_the_first_later_action_that_was_not_greedy() {
    let lived = EpisodeBuffer {
        observations: vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        actions: vec![0; 5],
        greedy: vec![false, true, true, false, true],
        rewards: vec![1.0, 2.0, 4.0, 8.0, 16.0],
    };
    let collect = |n, discount, tail| {
        let mut all = Vec::new();
        lived.n_step(1, n, discount, tail, |t| {
            all.push((t.observation[0], t.reward, t.next[0], t.discount));
        });
        all
    };
    // n = 3, γ = ½: the first action may explore; the fourth cuts.
    let expected = [
        (0.0, 1.0 + 1.0 + 1.0, 3.0, 0.125),
        (1.0, 2.0 + 2.0, 3.0, 0.25),
        (2.0, 4.0, 3.0, 0.5),
        (3.0, 8.0 + 8.0, 5.0, 0.0),
        (4.0, 16.0, 5.0, 0.0),
    ];
    assert_eq!(collect(3, 0.5, Tail::Terminal), expected);
    let open = collect(3, 0.5, Tail::Open);
    assert_eq!((open[3].3, open[4].3), (0.25, 0.5));
    assert_eq!(collect(1, 1.0, Tail::Terminal)[1], (1.0, 2.0, 2.0, 1.0));
}

#[test]
fn replay_draws_by_priority_and_corrects_for_it() {
    let mut replay = ReplayBuffer::new(1, 3, 1.0);
    for x in 0..4 {
        let x = x as f32;
        let next = [x + 1.0];
        replay.push(Transition {
            observation: &[x],
            action: x as usize,
            reward: x,
            next: &next,
            discount: 1.0,
        });
    }
    // Room for three: the fourth took the place of the first.
    assert_eq!(replay.len(), 3);
    for (slot, error) in [(0, 6.0), (1, -3.0), (2, 1.0)] {
        replay.prioritise(slot, error);
    }
    let (mut counts, mut batch, mut dice) = ([0; 4], Batch::default(), LearnerRng::new(1));
    for _ in 0..1000 {
        replay.sample(10, 1.0, &mut dice, &mut batch);
        for (i, action) in batch.actions.iter().enumerate() {
            counts[*action] += 1;
            assert_eq!(batch.nexts[i], batch.observations[i] + 1.0);
            let expected = [f32::NAN, 1.0 / 3.0, 1.0, 1.0 / 6.0][*action];
            let largest = batch.weights.iter().copied().fold(0.0, f32::max);
            assert_eq!(largest, 1.0);
            if batch.actions.contains(&2) {
                assert!((batch.weights[i] - expected).abs() < 1e-3);
            }
        }
    }
    assert_eq!(counts[0], 0);
    for (count, share) in counts[1..].iter().zip([0.3, 0.1, 0.6]) {
        assert!(
            (f64::from(*count) / 10_000.0 - share).abs() < 0.01,
            "{counts:?}"
        );
    }
}

// Bundles and configurations: hostile input.

fn kept_policy() -> TensorFile {
    let learner = config("Dqn(hidden: [4])").build(Corridor::new().spaces(), 1);
    learner.policy_bundle()
}

#[test]
fn every_truncation_of_a_bundle_is_refused() {
    let bytes = kept_policy().to_bytes().unwrap();
    for end in 0..bytes.len() {
        assert!(TensorFile::from_bytes(&bytes[..end]).is_err(), "{end}");
    }
    assert_eq!(TensorFile::from_bytes(&bytes).unwrap(), kept_policy());
}

#[test]
fn a_bundle_with_a_flipped_byte_never_panics() {
    let bytes = kept_policy().to_bytes().unwrap();
    for at in 0..bytes.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut bytes = bytes.clone();
            bytes[at] ^= flip;
            if let Ok(policy) =
                TensorFile::from_bytes(&bytes).and_then(|bundle| load_policy(&bundle))
            {
                policy.act(&[0.5]);
            }
        }
    }
}

#[test]
fn bundles_say_what_is_wrong_with_them() {
    type Spoil = Box<dyn Fn(&mut TensorFile)>;
    let cases: [(&str, Spoil); 5] = [
        (
            "tensor `q/1/bias` holds a number that is not finite at index 2",
            Box::new(|b| b.put("q/1/bias", &[3], vec![0.0, 0.0, f32::NAN])),
        ),
        (
            "tensor `q/0/bias` has shape [5], expected [4]",
            Box::new(|b| b.put("q/0/bias", &[5], vec![0.0f32; 5])),
        ),
        (
            "tensor `q/0/bias` holds f64, expected f32",
            Box::new(|b| b.put("q/0/bias", &[4], vec![0.0f64; 4])),
        ),
        (
            "tensor `q/1/weight` has shape [3, 3], expected [4, 3]",
            Box::new(|b| b.put("q/1/weight", &[3, 3], vec![0.0f32; 9])),
        ),
        (
            "tensor `q/2/bias` is missing",
            Box::new(|b| b.put("q/2/weight", &[3, 1], vec![0.0f32; 3])),
        ),
    ];
    for (expected, spoil) in cases {
        let mut bundle = kept_policy();
        spoil(&mut bundle);
        let bytes = bundle.to_bytes().unwrap();
        let loaded =
            TensorFile::from_bytes(&bytes).and_then(|bundle| load_policy(&bundle).map(drop));
        assert_eq!(loaded.unwrap_err().to_string(), expected);
    }
    assert!(load_policy(&TensorFile::new("something else")).is_err());
}

#[test]
fn a_name_given_twice_is_refused() {
    let one = r#""a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}"#;
    let two = r#""a":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}"#;
    for (header, size) in [
        (format!("{{{one},{two}}}"), 8),
        (format!("{{{one},{one}}}"), 4),
    ] {
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header.as_bytes());
        bytes.extend(vec![0; size]);
        match TensorFile::from_bytes(&bytes) {
            Err(BundleError::Duplicate { name }) => assert_eq!(name, "a"),
            Err(BundleError::Format { .. }) if size == 8 => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn hyperparameters_out_of_range_are_named() {
    assert_eq!(LearnerConfig::default(), config("Dqfd()"));
    for learner in LearnerSettings::all() {
        assert_eq!(
            config(&format!("{}()", learner.name())),
            learner.try_into().unwrap()
        );
    }
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let cases = [
        ("Dqn(discount: NaN)", "learner field `discount` is NaN"),
        ("Dqn(decisions: 0)", "learner field `decisions` is 0"),
        ("Dqn(hidden: [])", "learner field `hidden` is 0"),
        (
            "Dqn(learning_rate: inf)",
            "learner field `learning_rate` is inf",
        ),
        (
            "Dqn(exploration: 1.5)",
            "learner field `exploration` is 1.5",
        ),
        ("Dqn(capacity: Some(10))", "learner field `capacity` is 10"),
        ("QTable(bins: [])", "learner field `bins` is 0"),
        (
            "QTable(bins: [Bins(low: 1, high: 1)])",
            "learner field `bins` go from 1 to 1",
        ),
        ("Ppo(clip: -0.2)", "learner field `clip` is -0.2"),
    ];
    for (ron, expected) in cases {
        let settings: LearnerSettings = options.from_str(ron).unwrap();
        let error = LearnerConfig::new(settings).unwrap_err();
        assert_eq!(error.what(), expected);
        // Who reads a configuration at once is told the same, and the cure.
        let told = options
            .from_str::<LearnerConfig>(ron)
            .unwrap_err()
            .to_string();
        assert!(
            told.contains(expected) && told.contains(&error.help),
            "{told}"
        );
    }
    for ron in [
        "Dqn(decision: 5)",
        "Dqn(decisions: -1)",
        "Sarsa()",
        "Ppo(bins: [])",
    ] {
        assert!(options.from_str::<LearnerConfig>(ron).is_err(), "{ron}");
    }
}

#[test]
fn every_learner_has_its_own_words_in_the_docs() {
    let docs = include_str!("../../docs/background/learners.md");
    for learner in LearnerSettings::all() {
        let heading = format!("\n## `{}`", learner.name());
        assert!(
            docs.contains(&heading),
            "docs/background/learners.md lacks{heading}"
        );
    }
}
