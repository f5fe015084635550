//! Families of egos: what is drawn, covered, tuned and learned.

use std::sync::atomic::{AtomicBool, Ordering};

use brakecheck::adversary::Ado;
use brakecheck::cli::{Failure, plain_theme};
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::rl::{Control, Policy};
use brakecheck::run_dir::RunDir;
use brakecheck::scene::Dynamics;
use brakecheck::search::{Guided, GuidingPolicy, SearchRequest, SearchResult, search};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stats::StartOutcome::Solved;
use brakecheck::testbench::{Aftermath, Gym, HeldRandom, Replay, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario, TrainingEgos};
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};
use brakecheck_scene::scene::drive::DriveSpec;
use brakecheck_training::training::train_loop::train;
use brakecheck_world::world::family::{EgoSample, Family};

use super::acc;

static GO: AtomicBool = AtomicBool::new(false);

pub fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

pub fn key(index: u64) -> StartKey {
    StartKey {
        purpose: Purpose::Train,
        seed: 3,
        index,
    }
}

pub fn family(world: &Scenario) -> &Family {
    world.family().expect("acc has a family")
}

#[test]
fn members_are_drawn_as_documented_and_depend_on_their_key_alone() {
    let world = acc();
    let family = family(&world);
    let count = 20_000;
    let draws: Vec<_> = (0..count).map(|i| family.draw("acc", key(i))).collect();
    let share = |test: &dyn Fn(usize) -> bool| {
        (0..draws.len()).filter(|&i| test(i)).count() as f64 / count as f64
    };
    let rigid = share(&|i| draws[i].plant == PlantKind::Rigid);
    assert!((rigid - 0.1).abs() < 0.015, "{rigid}");
    let nominal = family.nominal(PlantKind::Rigid).values;
    let pure = share(&|i| draws[i].values == nominal);
    let often = family.nominal_share;
    let chance = often.powi(5) * (often + (1.0 - often) / 5.0);
    assert!((pure - (0.15 + 0.85 * chance)).abs() < 0.015, "{pure}");
    for (q, quantity) in family.quantities.iter().enumerate() {
        let values: Vec<f64> = draws.iter().map(|draw| draw.values[q]).collect();
        assert!(values.iter().all(|value| quantity.contains(*value)));
        // Of five delays one is the nominal one.
        let also = if quantity.step == 0.0 { 0.0 } else { 0.2 };
        let expected = 0.15 + 0.85 * (often + (1.0 - often) * also);
        let same = share(&|i| values[i] == quantity.nominal);
        assert!((same - expected).abs() < 0.015, "{quantity:?}: {same}");
        let others: Vec<f64> = values
            .into_iter()
            .filter(|v| *v != quantity.nominal)
            .collect();
        let mean = others.iter().sum::<f64>() / others.len() as f64;
        let middle = if quantity.step == 0.0 {
            0.5 * (quantity.lo + quantity.hi)
        } else {
            0.125
        };
        let width = quantity.hi - quantity.lo;
        assert!((mean - middle).abs() < 0.02 * width, "{quantity:?}: {mean}");
    }
    // Backwards, and in other streams.
    for i in (0..200).rev() {
        assert_eq!(family.draw("acc", key(i)), draws[i as usize]);
    }
    let differ = (0..200).filter(|&i| family.draw("mine", key(i)) != draws[i as usize]);
    assert!(differ.count() > 150);
}

#[test]
fn inside_and_outside_are_computed_from_the_change() {
    let world = acc();
    let family = family(&world);
    let inside = [
        "softer brakes",
        "longer gap",
        "2D plant",
        "soft gains",
        "firm gains",
        "high kp",
        "strong brakes",
        "short gap",
        "roomy gap",
        "quick brakes",
        "slow brakes",
        "late sensors",
        "sporty",
        "tired",
        "careful",
    ];
    for (name, change) in world.reuse() {
        let covered = family.covers(change);
        assert_eq!(covered, inside.contains(&name.as_str()), "{name}");
    }
    assert!(family.covers(&Change::default()));
    let same = Change {
        controller: world.controller(),
        friction: Some(0.9),
        ..Change::default()
    };
    assert!(family.covers(&same), "nothing is altered");
    let mut standstill = Change::default();
    standstill
        .ego
        .0
        .insert("standstill_headway_m".to_owned(), 6.0);
    assert!(!family.covers(&standstill), "not a quantity of the family");
    standstill
        .ego
        .0
        .insert("standstill_headway_m".to_owned(), 5.7);
    assert!(family.covers(&standstill));
}

/// The member with the parameters and the delay of a spec.
fn member_of(family: &Family, spec: &DriveSpec) -> EgoSample {
    let parameters = spec.ego.stock().expect("a stock ego").parameters();
    let values = family.quantities.iter().map(|quantity| {
        let mut named = parameters.iter();
        match named.find(|parameter| parameter.name == quantity.varied.name()) {
            Some(parameter) => parameter.value,
            None => spec.sensors.delay_s,
        }
    });
    EgoSample {
        values: values.collect(),
        plant: spec.plant,
        controller: None,
    }
}

#[test]
fn a_tuned_scene_drives_like_the_changed_world() {
    let world = acc();
    let driving = world.drive().expect("a driving world");
    let family = family(&world);
    for name in ["sporty", "tired", "2D plant", "late sensors"] {
        let changed = world.with(&world.reuse()[name]).expect("it fits");
        let spec = changed.drive().expect("a driving world").spec();
        let member = member_of(family, spec);
        let mut tuned = world.bench();
        tuned.replace_scene(driving.scene_of(&family.variant(&member)));
        let mut bench = changed.bench();
        let actions = bench.spaces().actions;
        for index in 0..4 {
            let start = bench.draw(key(index));
            let one = |bench: &mut _| {
                play(
                    bench,
                    &start,
                    index,
                    &mut HeldRandom::new(actions, 3),
                    Aftermath::Play,
                )
            };
            assert_eq!(one(&mut bench), one(&mut tuned), "{name} {index}");
        }
    }
}

#[test]
fn nominal_training_is_what_it_was_without_a_family() {
    // The same decisions on a plain gym: nothing of the family leaks in.
    let world = acc().on(PlantKind::Kinematic);
    let config = world
        .learner()
        .clone()
        .with_decisions(1500)
        .expect("in range");
    let mut plain = config.build(world.world().spaces(), 5);
    let mut gym = Gym::new(world.bench(), Purpose::Train, 5);
    plain.train(&mut gym, &mut |_| Control::Continue);
    let dir = tempfile::tempdir().expect("scratch");
    let mut short = world.clone();
    short = short.learning_with(config);
    let mut run = RunDir::create(&dir.path().join("run"), &short, 5).expect("a run");
    train(&short, &mut run, &quiet()).expect("trained");
    let kept = run.policy_bundle().expect("a policy");
    assert_eq!(kept, plain.policy_bundle());
    let manifest = std::fs::read_to_string(run.path().join("manifest.json")).expect("a manifest");
    assert!(!manifest.contains("against") && !manifest.contains("told"));
}

#[test]
fn training_against_a_family_is_deterministic_and_resumes_to_the_same_bytes() {
    let dir = tempfile::tempdir().expect("scratch");
    let against = TrainingEgos::Randomized;
    let world = acc()
        .training_against(against)
        .expect("a family")
        .training_for(5000)
        .expect("in range");
    let path = |name: &str| dir.path().join(name);
    let mut whole = RunDir::create(&path("whole"), &world, 7).expect("a run");
    train(&world, &mut whole, &quiet()).expect("trained");
    let mut cut = RunDir::create(&path("cut"), &world, 7).expect("a run");
    let stop = AtomicBool::new(false);
    let until = |done, _| stop.store(done >= 2500, Ordering::Relaxed);
    let halfway = Watch::new(&until, &stop);
    assert!(
        train(&world, &mut cut, &halfway)
            .expect("begun")
            .interrupted
    );
    drop(cut);
    let mut cut = RunDir::resume(&path("cut")).expect("a run");
    assert_eq!(cut.manifest().against, against);
    let kept = cut
        .scenario()
        .expect("its world")
        .training_for(5000)
        .expect("in range");
    assert_eq!(
        (kept.against(), &kept.learner()),
        (against, &world.learner())
    );
    train(&kept, &mut cut, &quiet()).expect("trained");
    let bytes = |run: &RunDir| std::fs::read(run.path().join("policy.safetensors")).expect("p");
    assert_eq!(bytes(&whole), bytes(&cut));
    assert!(whole.policy().is_ok());
}

/// Brakes whenever the ego is nearer than 30 m: solves some starts.
struct Near;

impl Policy for Near {
    fn act(&self, obs: &[f32]) -> usize {
        usize::from(obs[0] > -0.4)
    }

    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

#[test]
fn more_tries_never_solve_less_and_are_counted() {
    let world = acc().on(PlantKind::Kinematic);
    let starts = test_starts(&acc(), 9, 60, &quiet()).expect("not stopped");
    let request = EvalRequest {
        scenario: &world,
        ego: "nominal",
        ado: Ado::Trained(&Near, 0),
        starts: &starts,
    };
    let once = eval(&request, &quiet());
    let tries = |budget| {
        let request = SearchRequest {
            scenario: &world,
            ego: "nominal",
            method: Guided(GuidingPolicy(&Near)).into(),
            budget,
            starts: &starts,
        };
        search(&request, &quiet())
    };
    let one = tries(1);
    assert_eq!(one.row.solved, once.row.solved);
    assert_eq!(one.row.sims_per_start, 1.0);
    assert_eq!(one.row.physics_steps, once.row.physics_steps);
    let mut before = one;
    for budget in [3, 10, 30] {
        let after = tries(budget);
        for (old, new) in before.row.solved.iter().zip(after.row.solved.iter()) {
            assert!(*old != Solved || *new == Solved);
        }
        let found = after.found.iter().flatten();
        let unsolved = found.clone().filter(|found| found.actions.is_none());
        assert!(
            unsolved
                .map(|found| found.simulations)
                .all(|spent| spent == budget)
        );
        let spent: u64 = found.map(|found| found.simulations).sum();
        assert_eq!(
            after.row.sims_per_start,
            spent as f64 / after.row.starts as f64
        );
        assert_eq!(after.row.max_sims_per_start, Some(budget));
        before = after;
    }
    let (few, many) = (once.row.successes, before.row.successes);
    assert!(few + 5 < many, "{few} {many}");
    // A later run is played again bit for bit.
    let later = |found: &Option<SearchResult>| {
        let found = found.as_ref().filter(|found| found.simulations > 1)?;
        found.actions.clone()
    };
    let found = before.found.iter().enumerate();
    let (index, actions) = found
        .filter_map(|(index, found)| Some((index, later(found)?)))
        .next()
        .expect("one");
    let (start, noise) = &starts.starts[index];
    let mut actor = Replay::holding(&actions);
    let again = play(
        &mut world.bench(),
        start,
        *noise,
        &mut actor,
        Aftermath::Skip,
    );
    assert!(again.verdict.is_success());
}

#[test]
fn mistakes_in_a_family_have_a_place_a_reason_and_a_cure() {
    const ACC: &str = include_str!("../../worlds/acc.ron");
    let with = |from: &str, to: &str| {
        assert!(ACC.contains(from), "acc.ron no longer contains {from}");
        ACC.replacen(from, to, 1)
    };
    let mistakes = [
        ("an unknown parameter", with("\"kd_per_s\": (", "\"kd\": (")),
        ("a reversed range", with("(4.0, 8.0)", "(8.0, 4.0)")),
        ("an empty range", with("(4.0, 8.0)", "(6.0, 6.0)")),
        (
            "a range without the nominal value",
            with("(4.0, 8.0)", "(7.0, 8.0)"),
        ),
        (
            "a value below the least one",
            with("\"lag_s\": (0.2", "\"lag_s\": (-0.2"),
        ),
        (
            "a delay between samples",
            with("delay_s: (0.0, 0.2)", "delay_s: (0.0, 0.12)"),
        ),
        (
            "a negative delay",
            with("delay_s: (0.0, 0.2)", "delay_s: (-0.1, 0.2)"),
        ),
        ("a plant that is none", with("Kinematic: 9", "Cinematic: 4")),
        (
            "a plant without weight",
            with("Kinematic: 9", "Kinematic: 0"),
        ),
        ("a range of three", with("(4.0, 8.0)", "(4.0, 6.0, 8.0)")),
        (
            "a learner that makes no sense",
            with("decisions: 8_000_000,", "decisions: 0,"),
        ),
        ("a family in which nothing varies", {
            let from = ACC.find("train_against").expect("a family");
            format!("{}train_against: Family(),\n)\n", &ACC[..from])
        }),
    ];
    let mut shown = String::new();
    for (what, text) in mistakes {
        let Err(error) = Scenario::parse("acc.ron", &text) else {
            panic!("{what}: accepted");
        };
        let rendered = Failure::from(error).render(plain_theme(), 100);
        shown.push_str(&format!("=== {what}\n{rendered}\n"));
    }
    insta::assert_snapshot!("family_mistakes", shown);
}

#[test]
fn a_grid_has_no_family() {
    let text = include_str!("../../worlds/grid.ron");
    let world = Scenario::parse("grid.ron", text).expect("a sound world");
    assert!(world.family().is_none() && world.training_against(TrainingEgos::Randomized).is_none());
    assert_eq!(world.plant(), Dynamics::Cells);
}

#[test]
fn every_member_of_a_shipped_family_is_within_it() {
    let acc = include_str!("../../worlds/acc.ron");
    let merge = include_str!("../../worlds/merge.ron");
    let yellow = include_str!("../../worlds/yellow_light.ron");
    for (name, text) in [("acc", acc), ("merge", merge), ("yellow_light", yellow)] {
        let world = Scenario::parse(name, text).expect("a world");
        let family = family(&world);
        for index in 0..2_000 {
            let member = family.draw(name, key(index));
            for (quantity, value) in family.quantities.iter().zip(&member.values) {
                assert!(quantity.contains(*value), "{name}: {quantity:?}: {value}");
            }
        }
    }
}
