//! Ados trained in one world are traffic in another.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use brakecheck::crashes::Regressions;
use brakecheck::experiment::Watch;
use brakecheck::run_dir::{Counterexample, RunDir};
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, PolicyActor, Testbench, play};
use brakecheck::world::{Change, Scenario, ScenarioError};
use brakecheck_training::training::train_loop::train;
use brakecheck_world::world::RunsOnDisk;
use sha2::{Digest, Sha256};

const ACC: &str = include_str!("../../worlds/acc.ron");
const LIGHT: &str = include_str!("../../worlds/light_ado.ron");
const SANDWICH: &str = include_str!("../../worlds/sandwich.ron");
const GRID: &str = include_str!("../../worlds/grid.ron");

/// The ado of `acc` ahead of a car; the one that learns is far behind.
pub(super) const PLACED: &str = r#"Scenario(
    name: "placed",
    question: "Does a trained ado do in another world what it did in its own?",
    clock: (horizon_s: 15.0, decision_s: 0.25, sample_s: 0.05, substeps: 4),
    plant: Kinematic,
    judge: WholeRun,
    road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9),
    agents: [
        Vehicle(name: "car", body: "sedan", lane: 0, start: At(x_m: 0.0, speed_mps: (5.0, 25.0)),
            drive: Ego(Acc(kp_per_s2: 0.3, kd_per_s: 1.2, standstill_headway_m: 5.7, time_gap_s: 0.5,
                max_brake_mps2: 6.0, max_accel_mps2: 2.5, lag_s: 0.4))),
        Vehicle(name: "blocker", body: "sedan", lane: 0,
            start: Ahead(of: "car", headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)),
            drive: Trained(run: "acc", names: {"ego": "car"})),
        Vehicle(name: "other", body: "van", lane: 1, start: Ahead(of: "car", headway_m: -300.0, speed_mps: 5.0),
            drive: Ado(actions: Accelerations([-1.0, 0.0, 1.0]), neutral: 1, observe: ["car.speed"],
                rulebook: [Rule(name: "goes on", stl: "always (other.speed >= -1)")])),
        Light(name: "light", line_m: 900.0, drive: Schedule([])),
    ],
    ego_spec: "always (car.blocker.headway >= 4.7)",
)"#;

pub(super) fn quick_acc() -> Scenario {
    let text = ACC
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("decisions: 300_000", "decisions: 2_000");
    Scenario::parse("acc.ron", &text).expect("a world")
}

pub(super) fn trained(dir: &Path) -> RunDir {
    static GO: AtomicBool = AtomicBool::new(false);
    let watch = Watch::new(&|_, _| {}, &GO);
    let world = quick_acc();
    let mut run = RunDir::create(&dir.join("acc"), &world, 3).expect("a new directory");
    train(&world, &mut run, &watch).expect("trained");
    run
}

fn placed(dir: &Path, text: &str) -> Result<Scenario, ScenarioError> {
    let file = dir.join("placed.ron").display().to_string();
    Scenario::parse_with(&file, text, &RunsOnDisk)
}

fn test_start(bench: &Testbench, index: u64) -> Start {
    bench.draw(StartKey {
        purpose: Purpose::Test,
        seed: 5,
        index,
    })
}

#[test]
fn a_trained_ado_acts_as_at_home_and_needs_its_directory_only_once() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = trained(dir.path());
    let policy = run.policy().expect("a policy");
    let (home, here) = (quick_acc(), placed(dir.path(), PLACED).expect("a world"));
    let second = dir.path().join("second");
    RunDir::create(&second, &here, 1).expect("a new directory");
    std::fs::remove_dir_all(run.path()).expect("removed");
    let again = Scenario::parse("elsewhere.ron", here.text()).expect("self-contained");
    assert_eq!(again.text(), here.text());

    let benches = [&home, &here, &again].map(Scenario::bench);
    let [mut home_bench, mut here_bench, mut again_bench] = benches;
    let (mut samples, mut changes) = (0, 0);
    for index in 0..12 {
        let start = test_start(&home_bench, index);
        let mut actor = PolicyActor(&*policy);
        let own = play(&mut home_bench, &start, 0, &mut actor, Aftermath::Skip);
        let new = play(
            &mut here_bench,
            &start,
            0,
            &mut Constant(1),
            Aftermath::Play,
        );
        let common = own.trace.len().min(new.trace.len());
        for (there, now) in [("ego", "car"), ("ado", "blocker")] {
            for field in ["x", "speed", "accel"] {
                let own = own
                    .trace
                    .signal(&format!("{there}.{field}"))
                    .expect("published");
                let new = new
                    .trace
                    .signal(&format!("{now}.{field}"))
                    .expect("published");
                assert_eq!(
                    own[..common],
                    new[..common],
                    "{now}.{field} of start {index}"
                );
            }
        }
        samples += common;
        changes += own
            .actions
            .windows(2)
            .filter(|pair| pair[0] != pair[1])
            .count();
        let repeated = play(
            &mut again_bench,
            &start,
            0,
            &mut Constant(1),
            Aftermath::Play,
        );
        assert_eq!(repeated.trace, new.trace);
    }
    assert!(samples > 1_000, "{samples} samples");
    assert!(changes > 0, "the policy should do different things");
    assert_eq!(
        RunDir::open(&second)
            .expect("a run")
            .scenario()
            .expect("a world")
            .text(),
        here.text()
    );
}

#[test]
fn forks_and_kept_counterexamples_go_on_bit_for_bit() {
    let dir = tempfile::tempdir().expect("a directory");
    trained(dir.path());
    let here = placed(dir.path(), &PLACED.replace(">= 4.7", ">= 7.0")).expect("a world");
    std::fs::remove_dir_all(dir.path().join("acc")).expect("removed");
    let mut bench = here.bench();
    let start = test_start(&bench, 1);
    bench.begin(&start, 0, Aftermath::Play);
    // 3 decisions of 0.25 s end in the middle of one of the trained ado.
    (0..3).for_each(|_| bench.decide(2));
    let mut fork = bench.fork().expect("a stock ego");
    for bench in [&mut bench, &mut fork] {
        while !bench.is_done() {
            bench.decide(0);
        }
    }
    assert_eq!(bench.trace(), fork.trace());

    let crash = (0..40)
        .find_map(|index| {
            let start = test_start(&bench, index);
            let played = play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Play);
            played.verdict.is_success().then_some(played)
        })
        .expect("7 m is too close for some start");
    let kept = Counterexample::record(&here, "nominal", &Change::default(), "constant", &crash);
    let file = dir.path().join("kept").join("crash.ron");
    std::fs::create_dir(dir.path().join("kept")).expect("a directory");
    kept.save(&file, &crash.trace).expect("written");
    let regressions = Regressions::load(dir.path().join("kept")).expect("kept");
    let replayed = regressions.replay().expect("replayed");
    assert!(replayed.len() == 1 && replayed[0].identical);
}

/// A run directory that was never trained in: text and bytes of one's choice.
pub(super) fn fake(dir: &Path, world: &str, policy: &[u8]) {
    let sha256 = |bytes: &[u8]| -> String {
        let digest = Sha256::digest(bytes);
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    };
    std::fs::create_dir(dir).expect("a directory");
    let (world_sha256, policy_sha256) = (sha256(world.as_bytes()), sha256(policy));
    // Each file holds its own hash, taken over zeros in its place.
    let blank = "0".repeat(64);
    let sealed = |text: String| text.replacen(&blank, &sha256(text.as_bytes()), 1);
    let manifest = sealed(format!(
        r#"{{"format": 3, "sha256": "{blank}", "brakecheck": "0.1.0", "target": "", "world": "",
            "plant": "Rigid", "seed": 1, "decisions": 1, "decisions_done": 1, "episodes": 1, "physics_steps": 1, "settings": {{}},
            "world_sha256": "{world_sha256}", "policy_sha256": "{policy_sha256}"}}"#
    ));
    let timing = sealed(format!(r#"{{"cpu_s": 1.0, "seal": "{blank}"}}"#));
    std::fs::write(dir.join("manifest.json"), manifest).expect("written");
    std::fs::write(dir.join("timing.json"), timing).expect("written");
    std::fs::write(dir.join("world.ron"), world).expect("written");
    std::fs::write(dir.join("policy.safetensors"), policy).expect("written");
}

#[test]
fn what_does_not_fit_has_a_place_a_reason_and_a_cure() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = trained(dir.path());
    let policy = std::fs::read(run.path().join("policy.safetensors")).expect("a policy");
    fake(&dir.path().join("grid"), GRID, &policy);
    fake(&dir.path().join("sandwich"), SANDWICH, &policy);
    fake(&dir.path().join("light"), LIGHT, &policy);
    fake(&dir.path().join("broken"), "Scenario(name: 3)", &policy);
    RunDir::create(&dir.path().join("begun"), &quick_acc(), 1).expect("a new directory");
    std::fs::create_dir(dir.path().join("empty")).expect("a directory");
    fake(&dir.path().join("damaged"), ACC, &policy);
    std::fs::write(dir.path().join("damaged/policy.safetensors"), b"other").expect("written");

    let with = |from: &str, to: &str| {
        assert!(PLACED.contains(from), "{from}");
        PLACED.replacen(from, to, 1)
    };
    let names = "{\"ego\": \"car\"}";
    let on_foot = with(
        "Vehicle(name: \"blocker\", body: \"sedan\", lane: 0,",
        "Pedestrian(name: \"blocker\", lateral_m: 0.0,",
    );
    let mistakes = [
        ("no such run", with("\"acc\"", "\"nope\"")),
        ("no run directory", with("\"acc\"", "\"empty\"")),
        ("unfinished", with("\"acc\"", "\"begun\"")),
        ("damaged", with("\"acc\"", "\"damaged\"")),
        ("a world that cannot be read", with("\"acc\"", "\"broken\"")),
        ("of a grid", with("\"acc\"", "\"grid\"")),
        ("several ados", with("\"acc\"", "\"sandwich\"")),
        ("a policy for something else", with("\"acc\"", "\"light\"")),
        (
            "a kept policy that is none",
            with("\"acc\"", "Kept(from: \"acc\", world: \"\", policy: \"?\")"),
        ),
        ("nobody plays a part", with(names, "{}")),
        (
            "a part that is not there",
            with(names, "{\"ego\": \"car\", \"egon\": \"car\"}"),
        ),
        (
            "a player who is not there",
            with(names, "{\"ego\": \"cra\"}"),
        ),
        (
            "its own part given away",
            with(names, "{\"ego\": \"car\", \"ado\": \"other\"}"),
        ),
        ("a light for a car", with(names, "{\"ego\": \"light\"}")),
        (
            "other decision times",
            with(
                "decision_s: 0.25, sample_s: 0.05, substeps: 4",
                "decision_s: 0.3, sample_s: 0.3, substeps: 15",
            ),
        ),
        ("not its actions", on_foot),
        ("an unknown field", with("names:", "name:")),
    ];
    let mut shown = String::new();
    for (what, text) in mistakes {
        let Err(error) = placed(dir.path(), &text) else {
            panic!("{what}: accepted");
        };
        let problem = &error.problems[0];
        // Hashes and the errors of the operating system differ by machine.
        let said = problem
            .what
            .split("SHA-256")
            .next()
            .unwrap_or_default()
            .split(": No such file")
            .next()
            .unwrap_or_default();
        let place = &text[problem.span.clone()];
        let help = problem.help.as_deref().unwrap_or("-");
        shown.push_str(&format!(
            "{what}\n  {said}\n  at {place}: {}\n  help: {help}\n",
            problem.label
        ));
    }
    insta::assert_snapshot!("trained_mistakes", shown);
}

#[test]
fn a_text_without_a_file_finds_no_run_and_says_so() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = trained(dir.path());
    // Were it looked for, it would be found.
    let text = PLACED.replace(
        "\"acc\"",
        &format!("{:?}", run.path().display().to_string()),
    );
    let here = placed(dir.path(), &text).expect("a world");
    let error = Scenario::parse("placed.ron", &text).expect_err("refused");
    let problem = &error.problems[0];
    assert!(
        problem.what.contains("is not looked for"),
        "{}",
        problem.what
    );
    let help = problem.help.as_deref().expect("a cure");
    assert!(help.contains("load the world from its file"), "{help}");
    Scenario::parse("placed.ron", here.text()).expect("a written-out world needs no disk");
}
