//! Ados that were trained apart, together against one ego, with their rules judged.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use brakecheck::evaluation::untrained;
use brakecheck::experiment::{EgoUnderTest, Watch};
use brakecheck::rulebook::Verdict;
use brakecheck::run_dir::{AdversaryId, RunDir};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::{Scenario, ScenarioError};
use brakecheck_training::training::train_loop::train;
use brakecheck_world::world::RunsOnDisk;

use super::trained::{PLACED, quick_acc, trained};

const SANDWICH: &str = include_str!("../../worlds/sandwich.ron");

/// `PLACED` without its ado that learns: all adversaries are placed.
fn together(rules: &str) -> String {
    let placed = PLACED.replace(
        r#"names: {"ego": "car"})"#,
        &format!(r#"names: {{"ego": "car"}}, {rules})"#),
    );
    let ado = placed.find("drive: Ado(").expect("an ado");
    let end = placed[ado..].find("])),").expect("its end") + ado;
    format!(
        "{}drive: Scripted(ConstantSpeed)),{}",
        &placed[..ado],
        &placed[end + 4..]
    )
}

fn read(dir: &Path, text: &str) -> Result<Scenario, ScenarioError> {
    let file = dir.join("together.ron").display().to_string();
    Scenario::parse_with(&file, text, &RunsOnDisk)
}

fn episodes(world: &Scenario, count: u64, noise: u64) -> Vec<Episode> {
    let mut bench = world.bench();
    let episode = |index| {
        let start = bench.draw(StartKey {
            purpose: Purpose::Test,
            seed: 5,
            index,
        });
        let mut neutral = Constant(world.spaces().neutral);
        play(&mut bench, &start, noise, &mut neutral, Aftermath::Skip)
    };
    (0..count).map(episode).collect()
}

/// A run in which the ado must not fall below 4.9 m/s, which it does by braking.
fn strict(dir: &Path) -> RunDir {
    static GO: AtomicBool = AtomicBool::new(false);
    let text = quick_acc()
        .text()
        .replace("\"v_min\": 0.1", "\"v_min\": 4.9");
    let world = Scenario::parse("acc.ron", &text).expect("a world");
    let mut run = RunDir::create(&dir.join("acc"), &world, 3).expect("a new directory");
    train(&world, &mut run, &Watch::new(&|_, _| {}, &GO)).expect("trained");
    run
}

#[test]
fn rules_of_a_placed_ado_are_judged_in_the_words_of_its_new_world() {
    let dir = tempfile::tempdir().expect("a directory");
    strict(dir.path());
    let traffic = read(dir.path(), &together("rules: Unjudged")).expect("a world");
    assert!(traffic.rulebook().rules.is_empty() && traffic.judged_ados().is_empty());
    // At this temperature all actions are about equally likely.
    let text = together("rules: Judged, temperature: 1000.0");
    let world = read(dir.path(), &text).expect("a world");
    assert_eq!(world.judged_ados(), ["blocker"]);
    let rules: Vec<String> = world
        .rules()
        .iter()
        .map(|rule| format!("{}, {}: {}", rule.ado, rule.name, rule.formula))
        .collect();
    assert_eq!(
        rules,
        [
            "blocker, never stops or reverses: always[0, T] (blocker.speed >= blocker.rule.v_min)",
            "blocker, keeps the speed limit: always[0, T] (blocker.speed <= blocker.rule.v_lim)",
        ]
    );
    let mut seen = [0; 2];
    for episode in episodes(&world, 30, 1) {
        // Computed here from the trace alone: the bounds are those of its own world.
        let speeds = episode.trace.signal("blocker.speed").expect("published");
        let slow = speeds.iter().any(|speed| *speed <= 4.9);
        let fast = speeds.iter().any(|speed| *speed >= 30.0);
        let broken: Vec<usize> = [slow, fast]
            .iter()
            .enumerate()
            .filter_map(|(rule, broken)| broken.then_some(rule))
            .collect();
        assert_eq!(episode.broken_rules, broken);
        let foul = matches!(episode.verdict, Verdict::Foul { .. });
        assert_eq!(foul, slow || fast, "{:?}", episode.verdict);
        seen[usize::from(foul)] += 1;
    }
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
}

#[test]
fn placed_ados_are_evaluated_together_and_without_each() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = trained(dir.path());
    let world = read(dir.path(), &together("rules: Judged")).expect("a world");
    // The text holds the run, so the world is whole without it.
    std::fs::remove_dir_all(run.path()).expect("removed");
    let world = Scenario::parse("elsewhere.ron", world.text()).expect("self-contained");
    let idle = world.with_idle_ados(|_| true);
    for episode in episodes(&idle, 5, 1) {
        let speeds = episode.trace.signal("blocker.speed").expect("published");
        assert!(speeds.iter().all(|speed| (speed - speeds[0]).abs() < 0.2));
    }
    let egos = [EgoUnderTest::nominal(&world)];
    let watch = Watch::unwatched();
    let table = untrained(&world, &egos, 7, 40, 1, &watch);
    let rows = table.expect("it runs").expect("not stopped").rows;
    let captions: Vec<&str> = rows.iter().map(|row| row.ado.caption()).collect();
    assert_eq!(captions, ["composed"]);
    assert_eq!(rows[0].ado, AdversaryId::Composed);
    // Starts on which the ego fails beside an idle ado are left out, not those on which
    // the placed ado makes it fail.
    let fails = episodes(&idle, 40, 1);
    let alone = fails.iter().filter(|it| it.verdict.is_success()).count();
    assert!(rows[0].trivial < 40 && alone < 40);
    assert_eq!(rows[0].starts + rows[0].trivial, 40);

    let two = together("rules: Judged").replace(
        "drive: Scripted(ConstantSpeed)),",
        "drive: Scripted(ConstantSpeed)),\n        Vehicle(name: \"second\", body: \"sedan\", lane: 1, \
         start: Ahead(of: \"car\", headway_m: 200.0, speed_mps: 15.0), \
         drive: Trained(run: \"acc\", names: {\"ego\": \"car\"}, rules: Judged)),",
    );
    trained(dir.path());
    let world = read(dir.path(), &two).expect("a world");
    let egos = [EgoUnderTest::nominal(&world)];
    let table = untrained(&world, &egos, 7, 40, 1, &watch);
    let rows = table.expect("it runs").expect("not stopped").rows;
    let captions: Vec<&str> = rows.iter().map(|row| row.ado.caption()).collect();
    assert_eq!(captions, ["composed", "without blocker", "without second"]);
    assert_eq!(rows[1].successes, 0, "the second is too far ahead");
    assert_eq!(rows[2].solved, rows[0].solved);
}

#[test]
fn drawn_actions_depend_on_the_noise_of_an_episode_alone() {
    let dir = tempfile::tempdir().expect("a directory");
    trained(dir.path());
    let text = together("rules: Judged, temperature: 0.2");
    let world = read(dir.path(), &text).expect("a world");
    let speeds = |noise| -> Vec<Vec<f64>> {
        let all = episodes(&world, 6, noise);
        let speed = |it: &Episode| {
            let speed = it.trace.signal("blocker.speed");
            speed.expect("published").to_vec()
        };
        all.iter().map(speed).collect()
    };
    let (first, again, other) = (speeds(1), speeds(1), speeds(2));
    assert_eq!(first, again);
    let differ = first.iter().zip(&other).filter(|(a, b)| a != b).count();
    assert!(differ >= 4, "{differ} of 6 differ");
    let hot = read(dir.path(), &together("rules: Judged, temperature: 0.0"));
    let refused = hot.expect_err("refused").to_string();
    assert!(refused.contains("0 is outside of"), "{refused}");
}

#[test]
fn an_ado_of_several_is_placed_by_its_part_if_it_has_a_policy_of_its_own() {
    static GO: AtomicBool = AtomicBool::new(false);
    let dir = tempfile::tempdir().expect("a directory");
    let run = |name: &str, learner: &str| {
        let text = SANDWICH.replace("plant: Rigid", "plant: Kinematic");
        let end = text.rfind(')').expect("an end");
        let text = format!("{}learner: {learner},\n)", &text[..end]);
        let world = Scenario::parse("sandwich.ron", &text).expect("a world");
        let mut run = RunDir::create(&dir.path().join(name), &world, 3).expect("new");
        train(&world, &mut run, &Watch::new(&|_, _| {}, &GO)).expect("trained");
    };
    run(
        "apart",
        "PerAdo(decisions: 300, longest: 1, observe: Own, seeding: (starts: 0))",
    );
    run("common", "Dqn(decisions: 300)");
    let placed = |run: &str, part: &str| {
        let text = PLACED
            .replace("Trained(run: \"acc\", names: {\"ego\": \"car\"})", &format!(
                "Trained(run: \"{run}\", {part}names: {{\"ego\": \"car\", \"lead\": \"other\"}}, rules: Judged)"
            ))
            .replace("decision_s: 0.25", "decision_s: 0.5")
            .replace("headway_m: (8.0, 60.0)", "headway_m: (-60.0, -8.0)")
            .replace("car.blocker.headway >= 4.7", "car.speed >= 1");
        read(dir.path(), &text)
    };
    let world = placed("apart", "part: \"tail\", ").expect("a world");
    let rules: Vec<String> = world
        .rules()
        .iter()
        .filter(|rule| rule.ado == "blocker")
        .map(|rule| rule.formula.to_string())
        .collect();
    assert_eq!(
        rules,
        [
            "always[0, T] (blocker.rule.rear >= 6.5)",
            "always[0, T] (blocker.speed <= blocker.rule.v_lim)",
            "always[0, T] (blocker.speed >= -0.1)",
        ]
    );
    let rear = world.bench();
    let rear = rear
        .schema()
        .signals()
        .iter()
        .find(|it| *it.name == *"blocker.rule.rear");
    assert!(rear.is_some());
    for (run, part, what, help) in [
        (
            "apart",
            "",
            "has 2 ados",
            "`part: \"lead\"` or `part: \"tail\"`",
        ),
        (
            "apart",
            "part: \"nobody\", ",
            "no ado `nobody`",
            "`part: \"lead\"`",
        ),
        (
            "common",
            "part: \"tail\", ",
            "one common policy",
            "--per-ado independent",
        ),
    ] {
        let refused = placed(run, part).expect_err("refused").to_string();
        assert!(
            refused.contains(what) && refused.contains(help),
            "{refused}"
        );
    }
}

/// Turns are actions: the placed ado acts in its own, and coasts in those of others.
#[test]
fn an_ado_gives_turns_to_the_placed_ones() {
    let dir = tempfile::tempdir().expect("a directory");
    trained(dir.path());
    let turns = r#"Turns(name: "turns", drive: Ado(
        actions: Turns([Idle, Only("blocker"), All]), neutral: 0, rulebook: [],
    )),
        Light(name: "light""#;
    let text = together("rules: Judged").replace("Light(name: \"light\"", turns);
    let world = read(dir.path(), &text).expect("a world");
    assert_eq!(world.spaces().actions, 3);
    assert_eq!(world.action_label(1), "only blocker");
    let alone = read(dir.path(), &together("rules: Judged")).expect("a world");
    let speeds = |world: &Scenario, actions: &[usize]| -> Vec<Vec<f64>> {
        let mut bench = world.bench();
        let episode = |index| {
            let start = bench.draw(StartKey {
                purpose: Purpose::Test,
                seed: 5,
                index,
            });
            let mut actor = brakecheck::testbench::Replay::holding(actions);
            let episode = play(&mut bench, &start, 1, &mut actor, Aftermath::Skip);
            let speed = episode.trace.signal("blocker.speed");
            speed.expect("published").to_vec()
        };
        (0..4).map(episode).collect()
    };
    let acts = speeds(&alone, &[0]);
    let idle = speeds(&alone.with_idle_ados(|_| true), &[0]);
    assert_ne!(acts, idle);
    assert_eq!(speeds(&world, &[0]), idle);
    assert_eq!(speeds(&world, &[1]), acts);
    assert_eq!(speeds(&world, &[2]), acts);
    // A turn that ends after some decisions: the same until then, and coasting after.
    let ends = speeds(&world, &[1, 1, 1, 1, 0]);
    for (ends, acts) in ends.iter().zip(&acts) {
        // Four decisions of 0.25 s are 20 samples.
        assert_eq!(ends[..21], acts[..21]);
        let last = ends[ends.len() - 1];
        assert!(ends[40..].iter().all(|speed| (speed - last).abs() < 0.2));
    }
    for (turns, what) in [
        ("Only(\"nobody\")", "no placed ado `nobody`"),
        ("Only(\"other\")", "no placed ado `other`"),
    ] {
        let text = text.replace("Only(\"blocker\")", turns);
        let refused = read(dir.path(), &text).expect_err("refused").to_string();
        assert!(refused.contains(what), "{refused}");
    }
    let none = text.replace("Trained(run: \"acc\"", "Trained(run: \"gone\"");
    assert!(read(dir.path(), &none).is_err());
}
