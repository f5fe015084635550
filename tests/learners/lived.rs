//! What an episode leaves behind: transitions, advantages, table entries.

use std::collections::BTreeSet;

use brakecheck::rl::{Bins, End, LearnerConfig, LearnerRng, QTableSettings, Spaces, TensorFile};
use brakecheck_rl::rl::replay::{Batch, ReplayBuffer, Transition};

use crate::config;
use crate::scripted::{Episode, Scripted, level};

fn spaces(actions: usize) -> Spaces {
    Spaces {
        observation: 1,
        actions,
        neutral: 0,
        parts: Vec::new(),
    }
}

// Deep Q-learning: the memory.

#[test]
fn what_dqn_remembers_ends_before_the_next_exploratory_action() {
    let (n, greedy) = (400, 2);
    for (end, steps) in [
        (End::Terminated, 3),
        (End::Truncated, 3),
        (End::Truncated, 1),
    ] {
        let learner = config(&format!(
            "Dqn(hidden: [1], learning_starts: 1000000, steps: {steps}, discount: 0.5, hold: 2)"
        ));
        let mut checkpoint = learner.build(&spaces(3), 4).checkpoint();
        level(&mut checkpoint, "online", &[0.25, -1.0, 0.5]);
        let mut learner = learner.restore(&spaces(3), &checkpoint).unwrap();
        let reward = |t: usize| (t % 7) as f32 - 3.0;
        let mut env = Scripted::new(&spaces(3), |_| Episode {
            observations: (0..=n).map(|t| vec![t as f32]).collect(),
            rewards: (0..n).map(reward).collect(),
            end,
        });
        learner.episode(&mut env);
        let found = learner.checkpoint();
        let rows = found.get::<f32>("replay/rows", &[n, 4]).unwrap();
        let mut lengths = BTreeSet::new();
        for (t, row) in rows.chunks_exact(4).enumerate() {
            let later = (t + 1..n).take(steps - 1);
            let k = 1 + later.take_while(|i| env.actions[*i] == greedy).count();
            lengths.insert(k);
            let sum = (0..k).map(|i| 0.5f32.powi(i as i32) * reward(t + i)).sum();
            let over = t + k == n && end == End::Terminated;
            let discount = if over { 0.0 } else { 0.5f32.powi(k as i32) };
            assert_eq!(row, [t as f32, (t + k) as f32, sum, discount]);
        }
        assert_eq!(
            lengths.into_iter().collect::<Vec<_>>(),
            (1..=steps).collect::<Vec<_>>()
        );
    }
}

#[test]
fn draws_are_as_the_errors_to_the_power_of_alpha_and_weights_undo_it_by_beta() {
    // With the floor of 0.001 the sizes of the errors are 9, 1 and 4; to the
    // power of ½ they are 3, 1 and 2.
    let errors = [8.999f32, 0.999, -3.999];
    for (alpha, shares) in [
        (1.0, [9.0 / 14.0, 1.0 / 14.0, 4.0 / 14.0]),
        (0.5, [3.0 / 6.0, 1.0 / 6.0, 2.0 / 6.0]),
        (0.0, [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0]),
    ] {
        for beta in [0.0, 0.3, 0.5, 1.0] {
            let mut replay = ReplayBuffer::new(1, 10, alpha);
            for (slot, error) in errors.into_iter().enumerate() {
                let (observation, next) = (&[0.0], &[0.0]);
                replay.push(Transition {
                    observation,
                    action: slot,
                    reward: 0.0,
                    next,
                    discount: 0.0,
                });
                replay.prioritise(slot, error);
            }
            let mut batch = Batch::default();
            replay.sample(1000, beta, &mut LearnerRng::new(1), &mut batch);
            for (slot, share) in shares.into_iter().enumerate() {
                // Stratified: only the two strata at the ends are left to chance.
                let count = batch.slots.iter().filter(|s| **s == slot).count();
                assert!(
                    (count as f64 - 1000.0 * share).abs() <= 2.0,
                    "{slot}: {count}"
                );
            }
            for (slot, weight) in batch.slots.iter().zip(&batch.weights) {
                let expected = (shares[1] / shares[*slot]).powf(beta);
                assert!(
                    (f64::from(*weight) - expected).abs() < 1e-5,
                    "{alpha} {beta} {slot}"
                );
            }
        }
    }
}

#[test]
fn a_new_transition_has_the_largest_priority_ever_seen() {
    let mut replay = ReplayBuffer::new(1, 10, 0.5);
    let push = |replay: &mut ReplayBuffer, action| {
        replay.push(Transition {
            observation: &[0.0],
            action,
            reward: 0.0,
            next: &[0.0],
            discount: 0.0,
        });
    };
    push(&mut replay, 0);
    push(&mut replay, 1);
    // 8.999 → √9 = 3, seen once; then both fall to 1.
    for (slot, error) in [(0, 8.999), (0, 0.999), (1, 0.999)] {
        replay.prioritise(slot, error);
    }
    push(&mut replay, 2);
    let (mut batch, mut counts) = (Batch::default(), [0i32; 3]);
    replay.sample(1000, 0.5, &mut LearnerRng::new(1), &mut batch);
    batch.actions.iter().for_each(|action| counts[*action] += 1);
    for (count, expected) in counts.into_iter().zip([200, 200, 600]) {
        assert!((count - expected).abs() <= 2, "{counts:?}");
    }
}

// Proximal policy optimisation: the rollout.

/// An actor with the probabilities 1/8, 1/4, 5/8 and a critic that says
/// V(s) = 2 s + ½ for s ≥ 0, playing this episode `times` times.
fn rollout(ron: &str, episode: &Episode, times: usize) -> (TensorFile, Vec<usize>, f64) {
    let learner = config(&format!("Ppo(hidden: [1], horizon: 1000000, {ron})"));
    let mut checkpoint = learner.build(&spaces(3), 4).checkpoint();
    let logits = [1.0, 2.0, 5.0].map(|share: f64| share.ln() as f32);
    level(&mut checkpoint, "actor", &logits);
    level(&mut checkpoint, "critic", &[0.5]);
    checkpoint.put("critic/0/weight", &[1, 1], vec![1.0f32]);
    checkpoint.put("critic/1/weight", &[1, 1], vec![2.0f32]);
    let mut learner = learner.restore(&spaces(3), &checkpoint).unwrap();
    let mut env = Scripted::new(&spaces(3), |_| episode.clone());
    for _ in 0..times {
        learner.episode(&mut env);
    }
    (learner.checkpoint(), env.actions, learner.exploration())
}

#[test]
fn advantages_and_returns_are_those_computed_by_hand() {
    // V = ½, 1, 3/2 and then 5/2. With γ = ½ the one-step errors are 1, −9/4,
    // and −1 at an end or ¼ with what follows; with γ = 1 they are 3/2, −3/2,
    // and −1 or 3/2.
    use End::{Terminated, Truncated};
    for (discount, trace, end, advantages) in [
        (0.5, 0.5, Terminated, [0.375, -2.5, -1.0]),
        (0.5, 0.5, Truncated, [0.453_125, -2.187_5, 0.25]),
        (0.5, 0.0, Terminated, [1.0, -2.25, -1.0]),
        (0.5, 0.0, Truncated, [1.0, -2.25, 0.25]),
        (0.5, 1.0, Terminated, [-0.375, -2.75, -1.0]),
        (1.0, 0.0, Truncated, [1.5, -1.5, 1.5]),
        (1.0, 0.5, Terminated, [0.5, -2.0, -1.0]),
        (1.0, 1.0, Terminated, [-1.0, -2.5, -1.0]),
        (1.0, 1.0, Truncated, [1.5, 0.0, 1.5]),
    ] {
        let episode = Episode {
            observations: [0.0, 0.25, 0.5, 1.0].map(|s| vec![s]).to_vec(),
            rewards: vec![1.0, -2.0, 0.5],
            end,
        };
        // Nothing goes from one episode into the other.
        let ron = format!("discount: {discount}, trace: {trace}");
        let (found, _, _) = rollout(&ron, &episode, 2);
        let floats = |name| found.get::<f32>(name, &[6]).unwrap();
        let twice: Vec<f32> = [advantages, advantages].concat();
        assert_eq!(floats("rollout/advantages"), twice, "{ron} {end:?}");
        let values = [0.5, 1.0, 1.5, 0.5, 1.0, 1.5];
        let returns: Vec<f32> = twice.iter().zip(values).map(|(a, v)| a + v).collect();
        assert_eq!(floats("rollout/returns"), returns, "{ron} {end:?}");
    }
}

#[test]
fn ppo_draws_its_actions_with_the_probabilities_of_the_actor() {
    let n = 8000;
    let (found, actions, explored) = rollout("discount: 1", &Episode::still(n), 1);
    let shares = [0.125f64, 0.25, 0.625];
    for (action, share) in shares.into_iter().enumerate() {
        let count = actions.iter().filter(|a| **a == action).count();
        let drawn = count as f64 / n as f64;
        assert!((drawn - share).abs() < 0.02, "{action}: {drawn}");
    }
    let logs = found.get::<f32>("rollout/log_probabilities", &[n]).unwrap();
    for (log, action) in logs.iter().zip(&actions) {
        assert!((f64::from(*log) - shares[*action].ln()).abs() < 1e-6);
    }
    let others = actions.iter().filter(|action| **action != 2).count();
    assert!((explored - others as f64 / n as f64).abs() < 1e-6);
}

// The table.

#[test]
fn the_table_learns_backwards_from_the_best_next_value() {
    // Cell 0 has the values 1 and 2, cell 1 the values 4 and 3; α = γ = ½, the
    // rewards are ½ and −1. By the two actions: the values after an end, and
    // those when cell 0, worth 2, would have followed.
    let cases = [
        ([0, 0], [1.5, 2.0, 1.5, 3.0], [1.5, 2.0, 2.0, 3.0]),
        ([0, 1], [1.75, 2.0, 4.0, 1.0], [1.75, 2.0, 4.0, 1.5]),
        ([1, 0], [1.0, 2.0, 1.5, 3.0], [1.0, 2.0, 2.0, 3.0]),
        ([1, 1], [1.0, 2.25, 4.0, 1.0], [1.0, 2.25, 4.0, 1.5]),
    ];
    let learner = config(
        "QTable(bins: [Bins(count: 2)], learning_rate: Constant(0.5), discount: 0.5, hold: 1)",
    );
    let mut checkpoint = learner.build(&spaces(2), 1).checkpoint();
    checkpoint.put("cells", &[2, 1], vec![0u32, 1]);
    checkpoint.put("values", &[2, 2], vec![1.0f32, 2.0, 4.0, 3.0]);
    checkpoint.put("visits", &[2, 2], vec![7u32; 4]);
    for end in [End::Terminated, End::Truncated] {
        let mut met = BTreeSet::new();
        for seed in 0..40 {
            LearnerRng::new(seed).save(&mut checkpoint);
            let mut learner = learner.restore(&spaces(2), &checkpoint).unwrap();
            let mut env = Scripted::new(&spaces(2), |_| Episode {
                observations: [-0.5, 0.5, -0.25].map(|s| vec![s]).to_vec(),
                rewards: vec![0.5, -1.0],
                end,
            });
            learner.episode(&mut env);
            let (actions, over, cut) = cases.iter().find(|c| env.actions == c.0).unwrap();
            let found = learner.checkpoint();
            let values = found.get::<f32>("values", &[2, 2]).unwrap();
            let expected = if end == End::Terminated { over } else { cut };
            assert_eq!(values, expected, "{actions:?} {end:?}");
            let mut visits = vec![7u32; 4];
            visits[actions[0]] += 1;
            visits[2 + actions[1]] += 1;
            assert_eq!(found.get::<u32>("visits", &[2, 2]).unwrap(), visits);
            met.insert(*actions);
        }
        assert_eq!(met.len(), 4);
    }
}

#[test]
fn the_tables_rate_is_constant_or_a_power_of_the_visits() {
    // Values after the rewards 1, 0, 4 and 3, each the end of an episode.
    for (rate, initial, values) in [
        ("Power(1)", 0.0, [1.0, 0.5, 5.0 / 3.0, 2.0]),
        ("Power(1)", 9.0, [1.0, 0.5, 5.0 / 3.0, 2.0]),
        (
            "Power(0.5)",
            0.0,
            [1.0, 0.292_893_2, 2.433_192_3, 2.716_596_1],
        ),
        ("Power(0)", 0.0, [1.0, 0.0, 4.0, 3.0]),
        (
            "Constant(0.25)",
            0.0,
            [0.25, 0.187_5, 1.140_625, 1.605_468_8],
        ),
        (
            "Constant(0.25)",
            2.0,
            [1.75, 1.312_5, 1.984_375, 2.238_281_2],
        ),
        ("Constant(1)", 2.0, [1.0, 0.0, 4.0, 3.0]),
    ] {
        let learner = config(&format!(
            "QTable(learning_rate: {rate}, initial_value: {initial})"
        ));
        let mut learner = learner.build(&spaces(1), 1);
        for (reward, value) in [1.0, 0.0, 4.0, 3.0].into_iter().zip(values) {
            learner.episode(&mut Scripted::new(&spaces(1), |_| Episode::paying(reward)));
            let found = learner.policy().value(&[0.0]);
            assert!((found - value).abs() < 1e-6, "{rate}: {found}, not {value}");
        }
    }
}

#[test]
fn numbers_fall_into_cells_of_equal_width_and_those_outside_into_the_last() {
    let bins = Bins {
        low: -2.0,
        high: 6.0,
        count: 4,
    };
    let table = QTableSettings {
        bins: vec![bins],
        ..QTableSettings::default()
    };
    let table = LearnerConfig::new(table).expect("in range");
    for (x, cell) in [
        (-9.0, 0),
        (-2.0, 0),
        (-0.1, 0),
        (0.0, 1),
        (1.9, 1),
        (2.0, 2),
        (5.9, 3),
        (6.0, 3),
        (1e9, 3),
    ] {
        let mut learner = table.build(&spaces(2), 1);
        learner.episode(&mut Scripted::new(&spaces(2), |_| Episode {
            observations: vec![vec![x], vec![x]],
            ..Episode::paying(1.0)
        }));
        let found = learner.checkpoint();
        assert_eq!(found.rows::<u32>("cells", &[1]).unwrap(), [cell], "{x}");
    }
}
