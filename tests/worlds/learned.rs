//! Trainings out of the box: what is looked for first, and what is said at the end.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use brakecheck::adversary::Ado;
use brakecheck::experiment::{Remark, Watch, test_starts};
use brakecheck::run_dir::{RunDir, TrainingEnd};
use brakecheck::training::{TrainRequest, TrainSession, TrainingOutcome};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};

/// The ACC world on the kinematic plant, its `learner` another one or left out.
fn acc(learner: Option<&str>) -> Scenario {
    let text = include_str!("../../worlds/acc.ron");
    let line = text
        .lines()
        .find(|line| line.contains("learner: Dqn("))
        .expect("a learner");
    let learner = learner.map_or(String::new(), |learner| format!("    learner: {learner},"));
    let world = Scenario::parse("acc.ron", &text.replacen(line, &learner, 1));
    world.expect("a world").on(PlantKind::Kinematic)
}

fn trained(world: &Scenario, path: &Path, request: &TrainRequest<'_>) -> TrainingOutcome {
    let mut session = TrainSession::begin(world, path, request).expect("a run");
    session.train(&Watch::unwatched()).expect("trained")
}

#[test]
fn a_world_without_a_learner_is_searched_first_and_the_search_is_paid_for() {
    let dir = tempfile::tempdir().expect("scratch");
    let world = acc(None);
    assert_eq!(world.learner().name(), "Dqfd");
    let request = TrainRequest {
        decisions: Some(6000),
        ..TrainRequest::default()
    };
    let path = dir.path().join("run");
    let outcome = trained(&world, &path, &request);
    let run = RunDir::open(&path).expect("a run");
    let manifest = run.manifest();
    let sought = manifest.sought.expect("a search");
    assert!(
        sought.solved > 0 && sought.solved <= sought.starts,
        "{sought:?}"
    );
    assert!(sought.simulations <= 2 * 6000 + 6000, "{sought:?}");
    let calibration = manifest.calibration.expect("a calibration");
    assert_eq!(outcome.done.calibration, Some(calibration));
    assert_eq!(calibration.starts, 10);
    assert!(calibration.searched > 0, "{calibration:?}");
    assert_eq!(manifest.ended, Some(TrainingEnd::Asked));
    let once = manifest.episodes + sought.simulations + calibration.simulations;
    assert_eq!(
        brakecheck::experiment::Cost::of_training(manifest).simulations,
        once
    );
    assert!(sought.physics_steps < manifest.physics_steps);
}

#[test]
fn a_training_that_misses_what_search_finds_goes_on_and_says_so() {
    let dir = tempfile::tempdir().expect("scratch");
    // Far too short, with nothing shown.
    let learner = "Dqfd(decisions: 400, longest: 2.0, seeding: (starts: 0))";
    let path = dir.path().join("run");
    let outcome = trained(&acc(Some(learner)), &path, &TrainRequest::default());
    assert!(outcome.done.decisions >= 600, "{outcome:?}");
    assert!(
        matches!(
            outcome.done.ended,
            Some(TrainingEnd::Settled | TrainingEnd::Longest)
        ),
        "{outcome:?}"
    );
    let calibration = outcome.done.calibration.expect("a calibration");
    let warning = calibration.warning().expect("a warning");
    assert!(
        warning.what.contains("learned this world"),
        "{}",
        warning.what
    );
    // What is asked for outright is not exceeded by more than an episode.
    let request = TrainRequest {
        decisions: Some(400),
        ..TrainRequest::default()
    };
    let path = dir.path().join("asked");
    let outcome = trained(&acc(Some(learner)), &path, &request);
    assert!(outcome.done.decisions < 440, "{outcome:?}");
    assert_eq!(outcome.done.ended, Some(TrainingEnd::Asked));
}

#[test]
fn a_training_that_adapts_resumes_to_the_same_bytes() {
    let dir = tempfile::tempdir().expect("scratch");
    let world = acc(Some("Dqfd(decisions: 1000, longest: 2.0, hidden: [16])"));
    let whole = dir.path().join("whole");
    trained(&world, &whole, &TrainRequest::default());
    for until in [0, 200, 700, 1200] {
        let cut = dir.path().join(format!("cut-{until}"));
        let mut session =
            TrainSession::begin(&world, &cut, &TrainRequest::default()).expect("a run");
        let stop = AtomicBool::new(false);
        let at = |done, _| stop.store(until <= done, Ordering::Relaxed);
        session.train(&Watch::new(&at, &stop)).expect("begun");
        drop(session);
        let mut session =
            TrainSession::resume(&world, &cut, &TrainRequest::default()).expect("a run");
        session.train(&Watch::unwatched()).expect("trained");
        for file in [
            "policy.safetensors",
            "manifest.json",
            "counterexamples.jsonl",
        ] {
            let read = |run: &Path| std::fs::read(run.join(file)).expect("a file");
            assert_eq!(read(&whole), read(&cut), "{file}, stopped after {until}");
        }
    }
}

#[test]
fn a_world_in_which_nothing_can_be_found_is_said_to_be_one() {
    let dir = tempfile::tempdir().expect("scratch");
    let text = include_str!("../../worlds/acc.ron");
    let gentle = text
        .replacen(
            "Accelerations([-3.0, 0.0, 3.0])",
            "Accelerations([-0.05, 0.0, 0.05])",
            1,
        )
        .replacen(
            "headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)",
            "headway_m: (80.0, 90.0), speed_mps: (24.0, 25.0)",
            1,
        );
    assert_ne!(gentle, text);
    let world = Scenario::parse("acc.ron", &gentle)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let request = TrainRequest {
        decisions: Some(500),
        ..TrainRequest::default()
    };
    let outcome = trained(&world, &dir.path().join("run"), &request);
    let warning = outcome
        .done
        .calibration
        .and_then(|calibration| calibration.warning())
        .expect("a warning");
    assert!(
        warning.what.contains("there may be nothing to find"),
        "{}",
        warning.what
    );
}

/// A stop while the ado is looked at must not count as a look.
#[test]
fn a_training_that_was_stopped_while_it_was_looked_at_looks_again() {
    let dir = tempfile::tempdir().expect("scratch");
    let world = acc(Some("Dqfd(decisions: 1000, longest: 2.0, hidden: [16])"));
    let whole = dir.path().join("whole");
    trained(&world, &whole, &TrainRequest::default());
    let sought = RunDir::open(&whole).expect("a run").manifest().sought;
    assert!(
        sought.is_some_and(|it| it.simulations <= 2 * 1000 + 200),
        "{sought:?}"
    );
    for phase in ["calibration starts", "on which the ado fails"] {
        let cut = dir.path().join(phase);
        let request = TrainRequest::default();
        let mut session = TrainSession::begin(&world, &cut, &request).expect("a run");
        let stop = AtomicBool::new(false);
        let remarks = |remark: Remark<'_>| {
            if matches!(remark, Remark::Phase { what, .. } if what.ends_with(phase)) {
                stop.store(true, Ordering::Relaxed);
            }
        };
        let watch = Watch {
            remarks: &remarks,
            ..Watch::new(&|_, _| {}, &stop)
        };
        assert!(session.train(&watch).expect("begun").interrupted);
        drop(session);
        let mut session = TrainSession::resume(&world, &cut, &request).expect("a run");
        session.train(&Watch::unwatched()).expect("trained");
        for file in ["policy.safetensors", "manifest.json"] {
            let read = |run: &Path| std::fs::read(run.join(file)).expect("a file");
            assert_eq!(read(&whole), read(&cut), "{file}, stopped at {phase}");
        }
    }
}

/// A specification with two parts, which a braking lead car breaks each in its
/// own way: failures are counted apart, and none is lost.
#[test]
fn failures_of_different_kinds_are_counted_apart() {
    let text = include_str!("../../worlds/acc.ron");
    let spec = text.lines().find(|line| line.contains("ego_spec:"));
    let two = r#"    ego_spec: "always (headway >= d_safe) and always (ego.speed >= 4)","#;
    let text = text.replacen(spec.expect("a specification"), two, 1);
    let world = Scenario::parse("acc.ron", &text)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let watch = Watch::unwatched();
    let starts = test_starts(&world, 0, 80, &watch).expect("starts");
    let request = EvalRequest {
        scenario: &world,
        ego: "nominal",
        ado: Ado::Constant(0),
        starts: &starts,
    };
    let row = eval(&request, &watch).row;
    let kinds: usize = row.kinds.iter().map(|kind| kind.starts).sum();
    assert_eq!(kinds, row.successes);
    for part in ["headway", "ego.speed"] {
        let mut leaves = row.kinds.iter();
        assert!(
            leaves.any(|kind| kind.leaf.contains(part)),
            "{part}: {:?}",
            row.kinds
        );
    }
    assert!(
        row.kinds.is_sorted_by(|a, b| a.starts >= b.starts),
        "{:?}",
        row.kinds
    );
    let text = serde_json::to_string(&row).expect("a row");
    assert_eq!(
        serde_json::from_str::<brakecheck::run_dir::Row>(&text).expect("a row"),
        row
    );
}
