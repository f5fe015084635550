//! Trainings that look for severe and for distinct failures.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use brakecheck::experiment::Watch;
use brakecheck::rl::{Demonstration, End, Env};
use brakecheck::rulebook::TrainingGoal::{self, Distinct, Severe};
use brakecheck::run_dir::RunDir;
use brakecheck::seed::{Purpose, generator};
use brakecheck::training::{SessionError, TrainRequest, TrainSession};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_training::training::goals::GoalTracker;
use brakecheck_training::training::training_egos::TrainingGym;
use rand::RngExt;

/// The ACC world on the kinematic plant, with a learner and goals in its file.
fn acc(learner: &str, goals: &str) -> Scenario {
    acc_of(learner, goals, |text| text)
}

/// The same, changed.
fn acc_of(learner: &str, goals: &str, change: impl Fn(String) -> String) -> Scenario {
    let text = include_str!("../../worlds/acc.ron");
    let line = text.lines().find(|line| line.contains("learner: Dqn("));
    let lines = format!("    learner: {learner},\n    {goals}");
    let text = text.replacen(line.expect("a learner"), &lines, 1);
    let world = Scenario::parse("acc.ron", &change(text)).unwrap_or_else(|error| panic!("{error}"));
    world.on(PlantKind::Kinematic)
}

const BOTH: &str = "goals: [Severe, Distinct],";

/// A world's training starts, paid by its goals.
fn gym(world: &Scenario) -> TrainingGym<'_> {
    let mut gym = TrainingGym::new(world, Purpose::Train, 5);
    if let Some(goals) = GoalTracker::of(world, None).expect("no checkpoint") {
        gym.reward_by(goals);
    }
    gym
}

/// Plays an episode with actions of which the last one is held; how it was paid,
/// and the contact: its closing speed and whether the rules held up to it.
fn played(
    gym: &mut TrainingGym<'_>,
    index: u64,
    mut actions: impl FnMut(usize) -> usize,
) -> (f32, bool, Option<f64>, bool) {
    let mut obs = vec![0.0; gym.spaces().observation];
    gym.reset(index, &mut obs);
    for decision in 0.. {
        let step = gym.step(actions(decision), &mut obs);
        if step.end.is_some() {
            assert_eq!(step.end, Some(End::Terminated));
            let bench = gym.inner().bench();
            let closing_mps = bench.contact().map(|touch| touch.closing_speed_mps);
            let kept = bench.rules_until_contact();
            return (
                step.reward,
                bench.verdict().is_some_and(|verdict| verdict.is_success()),
                closing_mps,
                kept.is_none_or(|kept| kept.is_kept()),
            );
        }
        assert_eq!(step.reward, 0.0);
    }
    unreachable!("episodes end")
}

/// Random actions, each held for some decisions, the same for every gym.
fn random(index: u64) -> impl FnMut(usize) -> usize {
    let mut dice = generator("goals", &[index]);
    let mut action = 0;
    move |decision| {
        if decision % 4 == 0 {
            action = dice.random_range(0..3);
        }
        action
    }
}

/// Without goals nothing is paid otherwise; with goals nothing but successes is,
/// each above all that is none, and none for a rule broken before the contact.
#[test]
fn goals_pay_successes_alone() {
    // Far from a contact, so that there is time to break a rule before it.
    let far = |goals| {
        let world = acc_of("Dqn()", goals, |text| {
            text.replacen("\"d_safe\": 4.7", "\"d_safe\": 7.5", 1)
        });
        assert!(world.text().contains("7.5"));
        world
    };
    let (plain, both) = (far(""), far(BOTH));
    let severe = both.training_towards(&[Severe]).expect("a goal");
    let (mut successes, mut late_fouls, mut most_else) = (0, 0, f32::MIN);
    let (mut without, mut with, mut only) = (gym(&plain), gym(&both), gym(&severe));
    for index in 0..400 {
        let (paid, success, _, _) = played(&mut without, index, random(index));
        let (goals, same, _, kept) = played(&mut with, index, random(index));
        let (severe, _, closing_mps, _) = played(&mut only, index, random(index));
        assert_eq!(success, same);
        if !success {
            assert_eq!((goals, severe), (paid, paid));
            most_else = most_else.max(paid);
            continue;
        }
        successes += 1;
        late_fouls += u32::from(!kept);
        assert!(paid > 0.0 && paid <= goals && paid <= severe && goals < 1.0);
        match closing_mps {
            // Paid by its closing speed alone, at most.
            Some(mps) if kept => {
                let share = (severe - paid) / (1.0 - paid);
                let expected = TrainingGoal::severe_share(mps) as f32;
                assert!((share - expected).abs() < 1e-4, "{share} {expected}");
            }
            _ => assert_eq!(severe, paid),
        }
        if !kept {
            assert_eq!(goals, paid);
        }
    }
    assert!(most_else < 0.0 && successes > 20, "{most_else} {successes}");
    assert!(late_fouls > 0, "no rule broken between failure and contact");
}

/// The same failure pays less each time, and another one more.
#[test]
fn the_same_failure_over_and_over_pays_less_and_another_one_more() {
    let world = acc("Dqn()", "goals: [Distinct],");
    let mut gym = gym(&world);
    let brakes = |_| 0;
    let success = |gym: &mut TrainingGym<'_>, index| played(gym, index, brakes).1;
    let found: Vec<u64> = (0..200).filter(|&index| success(&mut gym, index)).collect();
    let paid: Vec<f32> = (0..30)
        .map(|_| played(&mut gym, found[0], brakes).0)
        .collect();
    assert!(paid.is_sorted_by(|a, b| b < a), "{paid:?}");
    let others = found.iter().map(|&index| played(&mut gym, index, brakes).0);
    let most = others.fold(0.0, f32::max);
    assert!(paid[29] + 0.05 < most, "{paid:?} {most}");
}

/// What a search found is paid as a learner's own successes are.
#[test]
fn demonstrations_are_paid_by_the_goals() {
    let (plain, both) = (acc("Dqfd()", ""), acc("Dqfd()", BOTH));
    let mut gym_of_plain = gym(&plain);
    let shown: Vec<Demonstration> = (0..100)
        .filter_map(|index| {
            let mut taken = 0;
            let brakes = |decision| {
                taken = decision + 1;
                0
            };
            let (_, success, _, _) = played(&mut gym_of_plain, index, brakes);
            let actions = vec![0; taken];
            success.then_some(Demonstration { index, actions })
        })
        .collect();
    assert!(shown.len() > 5);
    for world in [&plain, &both] {
        let mut learner = world.learner().build(world.spaces(), 3);
        let kept = learner.demonstrate(&mut gym(world), &shown);
        assert_eq!(kept, shown.len());
    }
}

/// Every learner takes goals, its manifest says which, and other goals are refused.
#[test]
fn every_learner_trains_towards_goals_and_goes_on_with_the_same_ones_only() {
    let learners = [
        "Dqn(hidden: [16], learning_starts: 100)",
        "Dqfd(hidden: [16], seeding: (starts: 20))",
        "Ppo(hidden: [16])",
        "QTable(bins: [Bins(count: 3)])",
    ];
    for learner in learners {
        let world = acc(learner, "");
        let dir = tempfile::tempdir().expect("scratch");
        let (whole, broken) = (dir.path().join("whole"), dir.path().join("broken"));
        let request = TrainRequest {
            decisions: Some(3000),
            goals: Some(&[Severe, Distinct]),
            ..TrainRequest::default()
        };
        train(TrainSession::begin(&world, &whole, &request), u64::MAX);
        train(TrainSession::begin(&world, &broken, &request), 1500);
        let begun = RunDir::open(&broken).expect("a run");
        let manifest = begun.manifest();
        assert_eq!(manifest.goals, [Severe, Distinct]);
        assert!(!manifest.is_finished() && manifest.decisions_done > 0);
        let other = TrainRequest {
            goals: Some(&[Severe]),
            ..request
        };
        let refused = TrainSession::resume(&world, &broken, &other)
            .err()
            .expect("other goals")
            .to_string();
        let said = "training goals: severe and distinct, now severe";
        assert!(refused.contains(said), "{refused}");
        // Left out they are those it was begun with, and what was counted goes on.
        let same = TrainRequest {
            goals: None,
            ..request
        };
        train(TrainSession::resume(&world, &broken, &same), u64::MAX);
        for file in ["policy.safetensors", "manifest.json"] {
            let read = |run: &Path| std::fs::read(run.join(file)).expect("a file");
            assert!(read(&whole) == read(&broken), "{learner}, {file}");
        }
        let scenario = RunDir::open(&whole).expect("a run").scenario();
        assert_eq!(scenario.expect("a world").goals(), [Severe, Distinct]);
    }
}

/// Trains, or goes on, until so many decisions are taken.
fn train(session: Result<TrainSession, SessionError>, most: u64) {
    let stop = AtomicBool::new(false);
    let at = |done, _| stop.store(most <= done, Ordering::Relaxed);
    let mut session = session.unwrap_or_else(|error| panic!("{error}"));
    session.train(&Watch::new(&at, &stop)).expect("trained");
}

#[test]
fn goals_that_cannot_be_reached_are_refused_by_name() {
    let told = |text: &str| {
        Scenario::parse("w.ron", text)
            .expect_err("refused")
            .to_string()
    };
    let text = include_str!("../../worlds/acc.ron");
    let with = |goals: &str| text.replacen("    judge:", &format!("    {goals}\n    judge:"), 1);
    assert!(told(&with("goals: [Severe, Severe],")).contains("named twice"));
    assert!(told(&with("goals: [Sever],")).contains("Sever"));
    // A light and nobody else.
    let light = include_str!("../../worlds/light_ado.ron");
    let lead = light
        .find("        Vehicle(\n            name: \"lead\"")
        .expect("a lead car");
    let end = lead + light[lead..].find("    ],\n    ego_spec").expect("an end");
    let alone = light
        .replacen(&light[lead..end], "", 1)
        .replacen("\"ego.lead.headway\", ", "", 1);
    let towards = |goal: &str| {
        let text = alone.replacen("    road:", &format!("    goals: [{goal}],\n    road:"), 1);
        Scenario::parse("light.ron", &text)
    };
    let refused = towards("Severe").expect_err("nobody to touch").to_string();
    assert!(
        refused.contains("requires an agent that can touch the ego"),
        "{refused}"
    );
    towards("Distinct").unwrap_or_else(|error| panic!("{error}"));
    let grid = Scenario::shipped("grid").expect("shipped").expect("sound");
    let refused = grid.training_towards(&[Distinct]).expect_err("a grid");
    assert!(refused.what.contains("this is a grid"), "{refused}");
}

#[test]
fn the_default_learner_of_a_contact_world_prefers_severe_failures() {
    let goals = |name: &str| {
        let world = Scenario::shipped(name).expect("shipped").expect("sound");
        world.goals().to_vec()
    };
    // `merge_fair` names its learner, and the specification of `acc` is no gap of bodies.
    assert_eq!(goals("cut_in"), [TrainingGoal::Severe]);
    assert_eq!(goals("acc_iso"), [TrainingGoal::Severe]);
    for name in ["acc", "merge_fair", "grid"] {
        assert_eq!(goals(name), [], "{name}");
    }
    let text = include_str!("../../worlds/cut_in.ron");
    let with = |lines: &str| {
        let changed = text.replacen("road: Straight", &format!("{lines} road: Straight"), 1);
        let world = Scenario::parse("cut_in.ron", &changed).expect("sound");
        world.goals().to_vec()
    };
    assert_eq!(with("goals: [],"), []);
    assert_eq!(with("goals: [Distinct],"), [TrainingGoal::Distinct]);
    assert_eq!(with("learner: Dqn(),"), []);
    assert_eq!(
        with("learner: Dqfd(decisions: 9_000),"),
        [TrainingGoal::Severe]
    );
}
