//! Run directories and changes: refused, or as they say.

use std::path::Path;

use brakecheck::rl::LearnerConfig;
use brakecheck::run_dir::{Done, RunDir};
use brakecheck::world::{LoadError, Scenario};
use proptest::prelude::*;
use proptest::sample::Index;
use serde_json::Value;

use super::corpus::{self, Source};
use super::harness::{Seen, Target};
use super::mutate::mutants;

pub fn world(name: &str) -> Scenario {
    Scenario::load(&corpus::root().join("worlds").join(name)).unwrap_or_else(|e| panic!("{e}"))
}

/// A finished run of an ado that learned nothing.
pub fn run_of(world: &Scenario, dir: &Path) {
    let mut run = RunDir::create(dir, world, 1).expect("a new run");
    let learner = LearnerConfig::default();
    let policy = learner.build(world.spaces(), 1).policy_bundle();
    run.save_policy(&policy, Done::default()).expect("written");
}

#[test]
fn any_run_directory_is_refused_or_says_what_its_files_say() {
    let dir = tempfile::tempdir().expect("a directory");
    run_of(&world("acc.ron"), &dir.path().join("good"));
    let (good, bad) = (dir.path().join("good"), dir.path().join("bad"));
    std::fs::create_dir(&bad).expect("a directory");
    let text = |name: &str| std::fs::read_to_string(good.join(name)).expect("a text");
    let policy = std::fs::read(good.join("policy.safetensors")).expect("a policy");
    let manifest = Source::new("manifest.json", text("manifest.json"));
    let texts = vec![
        manifest.clone(),
        manifest.clone(),
        manifest,
        Source::new("world.ron", text("world.ron")),
    ];
    let target = Target {
        name: "run",
        cases: 60,
        shrinks: 200,
        least_percent: (20, 20),
    };
    let flips = prop_oneof![2 => Just(None), 1 => any::<Index>().prop_map(Some)];
    target.run(&(mutants(texts.into()), flips), |(mutant, flip)| {
        let names = ["manifest.json", "world.ron"];
        for name in names.into_iter().chain(["timing.json"]) {
            std::fs::write(bad.join(name), text(name)).expect("written");
        }
        let mut bytes = policy.clone();
        if let Some(at) = flip {
            let at = at.index(bytes.len());
            bytes[at] ^= 1;
        }
        std::fs::write(bad.join("policy.safetensors"), &bytes).expect("written");
        let spoilt = names.map(|name| Source::new(name, ""));
        let spoilt = spoilt
            .iter()
            .find(|source| mutant.is_of(source))
            .expect("one");
        let spoilt_text = corpus::resealed(&mutant.text);
        std::fs::write(bad.join(&spoilt.name), spoilt_text).expect("written");
        let run = match RunDir::open(&bad) {
            Ok(run) => run,
            Err(error) => {
                assert!(!error.to_string().is_empty());
                return Seen::Refused;
            }
        };
        // The hash leaves a world nothing but what it was.
        let world = std::fs::read_to_string(bad.join("world.ron")).expect("a text");
        assert_eq!(world, text("world.ron"));
        let told = serde_json::to_value(run.manifest()).expect("JSON");
        let said = std::fs::read(bad.join("manifest.json")).expect("a text");
        let said: Value = serde_json::from_slice(&said).expect("JSON");
        for (key, value) in told.as_object().expect("fields") {
            // A field that is left out has its default.
            let written = said.get(key);
            assert!(
                written.is_none_or(|written| same(written, value)),
                "{key}: {value}"
            );
        }
        if let Ok(bundle) = run.policy_bundle() {
            assert_eq!(bundle.to_bytes().expect("bytes"), policy);
        }
        let (scenario, loaded) = (run.scenario(), run.policy());
        assert!(loaded.is_err() || scenario.is_ok());
        let _ = (run.checkpoint(), run.from(), run.counterexamples());
        Seen::Accepted
    });
}

/// Whether two values are one, numbers by what they are.
fn same(a: &Value, b: &Value) -> bool {
    match (a.as_f64(), b.as_f64()) {
        (Some(a), Some(b)) => a == b,
        _ => a == b || a.is_object() || a.is_array(),
    }
}

/// The changes of the shipped worlds, each as a file.
fn changes(kind: &str) -> Vec<Source> {
    let worlds = corpus::worlds().into_iter();
    let worlds = worlds.filter(|world| world.text.contains(&format!("\n{kind}(")));
    let listed = worlds.flat_map(|world| {
        let pieces: Vec<&str> = world.text.split("Change(").skip(1).collect();
        let whole = pieces.into_iter().map(|piece| {
            let mut depth = 1;
            let end = piece.find(|c| {
                depth += i32::from(c == '(') - i32::from(c == ')');
                depth == 0
            });
            format!("Change({})", &piece[..end.expect("its end")])
        });
        whole
            .map(|text| Source::new(world.name.clone(), text))
            .collect::<Vec<_>>()
    });
    let more = match kind {
        "Grid" => {
            vec!["Change(size: 6, refine: 2, ego_step: 1, horizon: PerSize(3), starts: Uniform)"]
        }
        _ => vec![
            "Change(controller: Some(Idm(desired_mps: 25.0)), friction: 0.7, plant: Some(Kinematic))",
            "Change(sensors: (delay_s: 0.1, position_sd_m: 0.5, speed_sd_mps: 0.2), ego_body: \"truck\")",
            "Change(controller: Process(command: [\"ego\"], timeout_s: 2.0, lag_s: 0.1))",
        ],
    };
    listed
        .chain(more.into_iter().map(|text| Source::new("more", text)))
        .collect()
}

fn any_change(name: &'static str, world: &Scenario, texts: Vec<Source>) {
    let target = Target {
        name,
        cases: 120,
        shrinks: 200,
        least_percent: (10, 20),
    };
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("change.ron");
    target.run(&mutants(texts.into()), |mutant| {
        std::fs::write(&file, &mutant.text).expect("written");
        match world.changed_by(&file) {
            Ok((change, changed)) => {
                super::worlds::finite(&mutant.text);
                assert!(change.grid.is_none() || world.grid().is_some());
                let same = world.with(&change).expect("it fitted");
                assert_eq!(same.world().clock(), changed.world().clock());
                if changed.program().is_none() {
                    super::worlds::played(&changed);
                }
                Seen::Accepted
            }
            Err(LoadError::Scenario(error)) => super::worlds::refused(&error, &mutant.text),
            Err(error) => panic!("{error}"),
        }
    });
}

#[test]
fn any_change_of_a_driven_world_is_refused_or_plays() {
    any_change("change", &world("acc.ron"), changes("Scenario"));
}

#[test]
fn any_change_of_a_grid_is_refused_or_plays() {
    any_change("grid", &world("grid.ron"), changes("Grid"));
}
