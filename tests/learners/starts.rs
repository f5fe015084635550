//! Failed starts are played again: which, how often, and how many are kept.

use std::collections::BTreeMap;

use brakecheck::rl::{End, LearnerRng, Spaces};

use crate::config;
use crate::scripted::{Episode, Scripted};

fn spaces() -> Spaces {
    Spaces {
        observation: 1,
        actions: 2,
        neutral: 0,
        parts: Vec::new(),
    }
}

fn learner(restart: &str) -> String {
    format!("Dqn(hidden: [1], learning_starts: 1000000, {restart})")
}

#[test]
fn a_failed_start_is_played_again_until_it_succeeds_or_had_its_tries() {
    // Rewards of each start's episodes in turn, the last repeating; other
    // starts succeed. Then the starts as they must come.
    type Case = (&'static str, &'static [(u64, &'static [f32])], [u64; 7]);
    let cases: [Case; 9] = [
        ("restart: 1", &[], [0, 1, 2, 3, 4, 5, 6]),
        ("restart: 0", &[(0, &[-1.0])], [0, 1, 2, 3, 4, 5, 6]),
        (
            "restart: 1, restart_tries: 0",
            &[(0, &[-1.0])],
            [0, 1, 2, 3, 4, 5, 6],
        ),
        (
            "restart: 1, restart_tries: 1",
            &[(0, &[-1.0])],
            [0, 0, 1, 2, 3, 4, 5],
        ),
        (
            "restart: 1, restart_tries: 3",
            &[(0, &[-1.0])],
            [0, 0, 0, 0, 1, 2, 3],
        ),
        (
            "restart: 1, restart_tries: 3",
            &[(1, &[-1.0, -1.0, 1.0])],
            [0, 1, 1, 1, 2, 3, 4],
        ),
        (
            "restart: 1, restart_tries: 2",
            &[(0, &[-1.0]), (2, &[-1.0, 1.0])],
            [0, 0, 0, 1, 2, 2, 3],
        ),
        // A return of 0 is a failure, any above it none.
        (
            "restart: 1, restart_tries: 1",
            &[(0, &[1e-6]), (1, &[0.0])],
            [0, 1, 1, 2, 3, 4, 5],
        ),
        // NaN stands for an abort: neither a success nor a failure.
        (
            "restart: 1, restart_tries: 1",
            &[(1, &[f32::NAN])],
            [0, 1, 2, 3, 4, 5, 6],
        ),
    ];
    for (restart, script, expected) in cases {
        let mut played = BTreeMap::new();
        let mut env = Scripted::new(&spaces(), |index| {
            let turn = played.entry(index).or_insert(0);
            let rewards = script.iter().find(|(start, _)| *start == index);
            let reward = rewards.map_or(1.0, |(_, r)| r[(*turn).min(r.len() - 1)]);
            *turn += 1;
            if reward.is_nan() {
                Episode {
                    end: End::Aborted,
                    ..Episode::paying(-1.0)
                }
            } else {
                Episode::paying(reward)
            }
        });
        let mut learner = config(&learner(restart)).build(&spaces(), 3);
        for _ in 0..7 {
            learner.episode(&mut env);
        }
        assert_eq!(env.starts, expected, "{restart} {script:?}");
    }
}

#[test]
fn the_configured_share_of_episodes_restarts() {
    for share in [0.1, 0.3, 0.5, 0.9] {
        let config = config(&learner(&format!(
            "restart: {share}, restart_tries: 1000000"
        )));
        let mut env = Scripted::new(&spaces(), |_| Episode::paying(-1.0));
        let mut learner = config.build(&spaces(), 3);
        for _ in 0..5000 {
            learner.episode(&mut env);
        }
        let fresh = env.starts.iter().max().unwrap() + 1;
        let again = 1.0 - fresh as f64 / 5000.0;
        assert!((again - share).abs() < 0.02, "{again}, not {share}");
    }
}

#[test]
fn no_start_is_tried_again_more_often_than_allowed_and_the_pool_is_bounded() {
    // At nine restarts in ten every start has its three retries before a new
    // one comes; at three in ten the pool of twenty is full.
    for (share, full) in [(0.9, false), (0.3, true)] {
        let config = config(&learner(&format!(
            "restart: {share}, restart_tries: 3, restart_pool: 20"
        )));
        let mut env = Scripted::new(&spaces(), |_| Episode::paying(-1.0));
        let mut learner = config.build(&spaces(), 3);
        let mut longest = 0;
        for _ in 0..2000 {
            learner.episode(&mut env);
            longest = longest.max(learner.checkpoint().shape("starts/failed").unwrap()[0]);
        }
        assert!(longest <= 20 && full == (longest == 20), "{longest}");
        let mut times = BTreeMap::new();
        for start in env.starts {
            *times.entry(start).or_insert(0) += 1;
        }
        assert_eq!(times.values().max(), Some(&4));
        let had_all = times.values().filter(|n| **n == 4).count();
        assert!(full || times.len() <= had_all + longest, "{had_all}");
    }
}

#[test]
fn in_a_full_pool_the_oldest_failed_start_makes_room() {
    let config = config(&learner("restart: 0, restart_pool: 3"));
    let mut learner = config.build(&spaces(), 3);
    // Starts 2 and 4 succeed.
    let mut env = Scripted::new(&spaces(), |index| {
        Episode::paying(if index == 2 || index == 4 { 1.0 } else { -1.0 })
    });
    for pool in [
        &[0][..],
        &[0, 1],
        &[0, 1],
        &[0, 1, 3],
        &[0, 1, 3],
        &[1, 3, 5],
        &[3, 5, 6],
    ] {
        learner.episode(&mut env);
        let found = learner.checkpoint();
        assert_eq!(found.rows::<u64>("starts/failed", &[]).unwrap(), pool);
        let tries = found.rows::<u32>("starts/tries", &[]).unwrap();
        assert!(tries.iter().all(|tries| *tries == 0));
    }
}

#[test]
fn every_failed_start_of_the_pool_is_as_likely_as_the_others() {
    let config = config(&learner("restart: 1, restart_tries: 5"));
    let mut checkpoint = config.build(&spaces(), 3).checkpoint();
    checkpoint.put("starts/failed", &[4], vec![11u64, 12, 13, 14]);
    checkpoint.put("starts/tries", &[4], vec![0u32, 1, 2, 3]);
    checkpoint.put("starts/fresh", &[1], vec![20u64]);
    let mut times = BTreeMap::new();
    for seed in 0..2000 {
        LearnerRng::new(seed).save(&mut checkpoint);
        let mut learner = config.restore(&spaces(), &checkpoint).unwrap();
        let mut env = Scripted::new(&spaces(), |_| Episode::paying(1.0));
        learner.episode(&mut env);
        *times.entry(env.starts[0]).or_insert(0) += 1;
        // It has left the pool; the others are as they were.
        let found = learner.checkpoint();
        let left = found.get::<u64>("starts/failed", &[3]).unwrap();
        let tries = found.get::<u32>("starts/tries", &[3]).unwrap();
        let pairs: Vec<_> = left.iter().zip(tries).collect();
        assert!(
            pairs
                .iter()
                .all(|(index, tries)| **index == u64::from(**tries) + 11)
        );
        assert!(!left.contains(&env.starts[0]));
    }
    assert_eq!(times.keys().copied().collect::<Vec<_>>(), [11, 12, 13, 14]);
    assert!(times.values().all(|n| (400..600).contains(n)), "{times:?}");
}
