//! What changes while training goes on: exploration, rates, corrections.

use brakecheck::rl::{Learner, Spaces, TensorFile};

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

/// A learner with this many decisions behind it, whose greedy action is 0.
fn after(decisions: u64, ron: &str, actions: usize) -> Box<dyn Learner> {
    let learner = config(ron);
    let mut checkpoint = learner.build(&spaces(actions), 5).checkpoint();
    checkpoint.put("counters", &[3], vec![decisions, 0, 0]);
    learner.restore(&spaces(actions), &checkpoint).unwrap()
}

/// The actions of one long episode from the beginning, without any learning.
fn played(ron: &str, actions: usize, decisions: usize) -> Vec<usize> {
    let mut learner = after(0, ron, actions);
    let mut env = Scripted::new(&spaces(actions), |_| Episode::still(decisions));
    learner.episode(&mut env);
    env.actions
}

/// Learners that explore, as equals: a network that is flat, an empty table.
fn explorers(fields: &str) -> [String; 2] {
    [
        format!("Dqn({fields}, hidden: [1], last_gain: 0, learning_starts: 1000000)"),
        format!("QTable({fields})"),
    ]
}

#[test]
fn exploration_falls_in_a_straight_line_and_then_stays() {
    for (fraction, decisions, expected) in [
        (0.5, 0, 0.8),
        (0.5, 100, 0.68),
        (0.5, 250, 0.5),
        (0.5, 499, 0.2012),
        (0.5, 500, 0.2),
        (0.5, 900, 0.2),
        (1.0, 250, 0.65),
        (1.0, 1000, 0.2),
        (0.0, 0, 0.2),
    ] {
        for ron in explorers(&format!(
            "decisions: 1000, exploration: 0.8, final_exploration: 0.2, \
             exploration_fraction: {fraction}"
        )) {
            let found = after(decisions, &ron, 3).exploration();
            assert!(
                (found - expected).abs() < 1e-9,
                "{found}, {decisions}: {ron}"
            );
        }
    }
}

#[test]
fn as_many_actions_explore_as_the_schedule_says() {
    for ron in explorers(
        "decisions: 20000, exploration: 0.9, final_exploration: 0.1, \
         exploration_fraction: 0.5, hold: 1",
    ) {
        let actions = played(&ron, 10, 20_000);
        // ε in the middle of each tenth; one exploratory action in ten is 0.
        let middles = [0.82, 0.66, 0.5, 0.34, 0.18, 0.1, 0.1, 0.1, 0.1, 0.1];
        for (tenth, middle) in actions.chunks(2000).zip(middles) {
            let others = tenth.iter().filter(|action| **action != 0).count();
            let share = others as f64 / 2000.0;
            assert!((share - 0.9 * middle).abs() < 0.04, "{share}, ε = {middle}");
        }
        let count = |wanted| actions.iter().filter(|action| **action == wanted).count();
        let explored = 20_000 - count(0);
        for action in 1..10 {
            let share = count(action) as f64 / explored as f64;
            assert!((share - 1.0 / 9.0).abs() < 0.02, "{action}: {share}");
        }
    }
}

#[test]
fn exploratory_actions_are_held_one_to_hold_decisions_each_equally_often() {
    // The greedy action, 0, stands between some; two of the 1000 actions in a
    // row are hardly ever the same. Of a cycle with ε = 0.3 that holds 2 on
    // average, 0.7/0.3 decisions are greedy: 2 / (2 + 7/3) explore.
    for (epsilon, hold, exploring) in [
        (1.0, 1, 1.0),
        (1.0, 4, 1.0),
        (1.0, 7, 1.0),
        (0.3, 3, 6.0 / 13.0),
    ] {
        for ron in explorers(&format!(
            "decisions: 40000, exploration: {epsilon}, final_exploration: {epsilon}, hold: {hold}"
        )) {
            let actions = played(&ron, 1000, 40_000);
            let mut lengths = vec![0; 2 * hold];
            for run in actions.chunk_by(|a, b| a == b).filter(|run| run[0] != 0) {
                lengths[run.len().min(2 * hold) - 1] += 1;
            }
            let runs: usize = lengths.iter().sum();
            for (length, count) in (1..).zip(lengths) {
                let share = count as f64 / runs as f64;
                let expected = if length <= hold {
                    1.0 / hold as f64
                } else {
                    0.0
                };
                assert!((share - expected).abs() < 0.02, "{length}: {share}: {ron}");
            }
            let share = actions.iter().filter(|action| **action != 0).count() as f64 / 40_000.0;
            assert!((share - exploring).abs() < 0.02, "{share}: {ron}");
        }
    }
}

/// Transitions of one decision each, ended, in a checkpoint: action, reward
/// and priority.
fn remember(checkpoint: &mut TensorFile, kept: &[(u32, f32, f64)]) {
    let n = kept.len();
    let rows = kept.iter().flat_map(|k| [0.0, 0.0, k.1, 0.0]).collect();
    checkpoint.put("replay/rows", &[n, 4], rows);
    let actions = kept.iter().map(|k| k.0).collect();
    checkpoint.put("replay/actions", &[n], actions);
    let priorities = kept.iter().map(|k| k.2).collect();
    checkpoint.put("replay/priorities", &[n], priorities);
}

/// A checkpoint after one episode from this many decisions on; before it all
/// values were 0 and the memory held `kept`.
fn trained(ron: &str, decisions: u64, kept: &[(u32, f32, f64)], episode: usize) -> TensorFile {
    let (learner, spaces) = (config(ron), spaces(2));
    let mut checkpoint = learner.build(&spaces, 5).checkpoint();
    checkpoint.put("counters", &[3], vec![decisions, 0, 0]);
    if ron.starts_with("Dqn") {
        level(&mut checkpoint, "online", &[0.0, 0.0]);
        level(&mut checkpoint, "target", &[0.0, 0.0]);
        remember(&mut checkpoint, kept);
    } else {
        level(&mut checkpoint, "critic", &[0.0]);
    }
    let mut learner = learner.restore(&spaces, &checkpoint).unwrap();
    let mut env = Scripted::new(&spaces, |_| Episode {
        rewards: vec![1.0; episode],
        ..Episode::still(episode)
    });
    learner.episode(&mut env);
    learner.checkpoint()
}

#[test]
fn the_learning_rate_goes_from_one_end_to_the_other_in_a_straight_line() {
    // Adam's first step has the length of the rate, whatever the gradient; the
    // value of a reward of 1 rises from 0 by just that.
    for (decision, expected) in [
        (1, 0.009_992),
        (250, 0.008),
        (500, 0.006),
        (999, 0.002_008),
        (1000, 0.002),
    ] {
        let rates = "decisions: 1000, hidden: [1], learning_rate: 0.01, final_learning_rate: 0.002";
        for (ron, name) in [
            (
                "Dqn(update_every: 1, learning_starts: 1, batch: 1, ",
                "online",
            ),
            ("Ppo(horizon: 1, epochs: 1, ", "critic"),
        ] {
            let ron = format!("{ron}{rates})");
            let kept = [(0, 1.0, 1.0)];
            let found = trained(&ron, decision - 1, &kept, 1);
            let outputs = if name == "online" { 2 } else { 1 };
            let bias = found
                .get::<f32>(&format!("{name}/1/bias"), &[outputs])
                .unwrap();
            let step = f64::from(bias[0]);
            assert!((step - expected).abs() < 1e-7, "{step}, {decision}: {ron}");
        }
    }
}

#[test]
fn the_correction_of_the_replay_rises_to_one_at_the_end() {
    // Two transitions are drawn once and three times out of four; both errors
    // are beyond the Huber threshold. So their gradients are as w₁ and 3 w₂,
    // which is as 1 to 3^(1 − β).
    for (correction, decision, beta) in [
        (0.4, 1, 0.4006),
        (0.4, 250, 0.55),
        (0.4, 500, 0.7),
        (0.4, 1000, 1.0),
        (0.0, 500, 0.5),
        (1.0, 500, 1.0),
    ] {
        let ron = format!(
            "Dqn(decisions: 1000, hidden: [1], update_every: 1, learning_starts: 2, batch: 4, \
             huber: 0.5, correction: {correction})"
        );
        let kept = [(0, 5.0, 1.0), (1, -5.0, 3.0)];
        let found = trained(&ron, decision - 1, &kept, 1);
        let mean = found.get::<f32>("adam/mean/1/bias", &[2]).unwrap();
        let ratio = f64::from(mean[1] / -mean[0]);
        let expected = 3f64.powf(1.0 - beta);
        assert!(
            (ratio - expected).abs() < 1e-4,
            "{ratio}, not {expected}: {ron}"
        );
    }
}

#[test]
fn updates_come_at_multiples_of_update_every_once_enough_is_remembered() {
    for (every, starts, from, decisions, expected) in [
        (1, 1, 0, 5, 5),
        (1, 2, 0, 5, 5),
        (1, 3, 0, 5, 0),
        (2, 2, 0, 5, 2),
        (2, 2, 1, 5, 3),
        (3, 2, 0, 7, 2),
        (3, 2, 2, 7, 3),
    ] {
        let ron = format!(
            "Dqn(decisions: 1000, hidden: [1], update_every: {every}, learning_starts: {starts})"
        );
        let kept = [(0, 1.0, 1.0), (1, 1.0, 1.0)];
        let found = trained(&ron, from, &kept, decisions);
        let updates: u64 = found.one("adam/steps").unwrap();
        assert_eq!(updates, expected, "{ron} from {from} for {decisions}");
    }
}
