//! Families of egos: what is drawn, covered, tuned, learned and identified.

use std::sync::atomic::{AtomicBool, Ordering};

use brakecheck::adversary::{Ado, BestOfN, EvalRequest, eval};
use brakecheck::cli::{Failure, plain_theme};
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::rl::{Control, Policy};
use brakecheck::run_dir::RunDir;
use brakecheck::scene::Dynamics;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::sim::PlantKind;
use brakecheck::stats::StartOutcome::{Solved, Trivial};
use brakecheck::sysid::{Identified, IdentifyRequest, identify};
use brakecheck::testbench::{Aftermath, Gym, HeldRandom, play};
use brakecheck::training::train;
use brakecheck::world::{Change, Family, Scenario, TrainingEgos};

use super::acc;

static GO: AtomicBool = AtomicBool::new(false);

pub fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

fn identified(request: &IdentifyRequest<'_>) -> Identified {
    let found = identify(request, &quiet()).expect("sound");
    found.expect("not stopped")
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
    assert!(150 < differ.count());
}

#[test]
fn what_is_told_is_scaled_to_the_ranges_whatever_the_plant() {
    let world = acc();
    let family = family(&world);
    let mut member = family.nominal(PlantKind::Rigid);
    member.values = family.quantities.iter().map(|q| q.lo).collect();
    assert_eq!(family.context_of(&member), [-1.0; 6]);
    member.values = family.quantities.iter().map(|q| q.hi).collect();
    assert_eq!(family.context_of(&member), [1.0; 6]);
    member.plant = PlantKind::Kinematic;
    assert_eq!(family.context_of(&member), [1.0; 6]);
    assert_eq!(family.context_width(), family.context_names().len());
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

#[test]
fn a_tuned_scene_drives_like_the_changed_world() {
    let world = acc();
    let driving = world.drive().expect("a driving world");
    let family = family(&world);
    for name in ["sporty", "tired", "2D plant", "late sensors"] {
        let changed = world.with(&world.reuse()[name]).expect("it fits");
        let spec = changed.drive().expect("a driving world").spec();
        let member = family.member_of(spec).expect("a member");
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

/// The ACC world against its family, briefly.
fn brief(against: TrainingEgos, decisions: u64) -> Scenario {
    let mut world = acc().training_against(against).expect("a family");
    world = world.training_for(decisions).expect("in range");
    world
}

#[test]
fn training_against_a_family_is_deterministic_and_resumes_to_the_same_bytes() {
    let dir = tempfile::tempdir().expect("scratch");
    for against in [TrainingEgos::Randomized, TrainingEgos::Conditioned] {
        let world = brief(against, 5000);
        let path = |name: &str| dir.path().join(format!("{against}-{name}"));
        let mut whole = RunDir::create(&path("whole"), &world, 7).expect("a run");
        train(&world, &mut whole, &quiet()).expect("trained");
        let mut cut = RunDir::create(&path("cut"), &world, 7).expect("a run");
        let stop = AtomicBool::new(false);
        let until = |done, _| stop.store(2500 <= done, Ordering::Relaxed);
        let halfway = Watch::new(&until, &stop);
        assert!(
            train(&world, &mut cut, &halfway)
                .expect("begun")
                .interrupted
        );
        drop(cut);
        let mut cut = RunDir::resume(&path("cut")).expect("a run");
        assert_eq!(cut.manifest().against, against);
        let kept = cut.scenario().expect("its world");
        let kept = kept.training_for(5000).expect("in range");
        assert_eq!(
            (kept.against(), &kept.learner()),
            (against, &world.learner())
        );
        train(&kept, &mut cut, &quiet()).expect("trained");
        let bytes = |run: &RunDir| std::fs::read(run.path().join("policy.safetensors")).expect("p");
        assert_eq!(bytes(&whole), bytes(&cut), "{against}");
        assert_eq!(
            whole.policy().is_err(),
            against == TrainingEgos::Conditioned
        );
    }
}

#[test]
fn every_episode_of_a_family_meets_the_ego_of_its_key() {
    // A start that is tried again meets the same ego, whatever came between.
    let dir = tempfile::tempdir().expect("scratch");
    let world = brief(TrainingEgos::Conditioned, 300);
    let mut run = RunDir::create(&dir.path().join("run"), &world, 1).expect("a run");
    train(&world, &mut run, &quiet()).expect("trained");
    let family = family(&world);
    let spec = world.drive().expect("driven").spec();
    let told =
        |member: brakecheck::world::EgoSample| run.conditioned_policy(&member).expect("a policy");
    let nominal = told(family.nominal(spec.plant));
    let sporty = world.with(&world.reuse()["sporty"]).expect("it fits");
    let sporty = told(
        family
            .member_of(sporty.drive().expect("driven").spec())
            .expect("a member"),
    );
    let obs = vec![0.1; world.world().spaces().observation];
    assert_ne!(nominal.value(&obs), sporty.value(&obs));
    assert_eq!(nominal.value(&obs), nominal.value(&obs));
}

#[test]
fn identifying_finds_the_parameters_of_an_ego_seen_only_from_outside() {
    let world = acc().on(PlantKind::Kinematic);
    let family = family(&world);
    let mut change = Change::default();
    let truth = [
        ("kp_per_s2", 0.45),
        ("kd_per_s", 1.5),
        ("time_gap_s", 0.7),
        ("max_brake_mps2", 5.0),
        ("lag_s", 0.6),
    ];
    for (name, value) in truth {
        change.ego.0.insert(name.to_owned(), value);
    }
    change.sensors = Some(brakecheck::scene::drive::Sensors {
        delay_s: 0.1,
        ..Default::default()
    });
    let ego = world.with(&change).expect("it fits");
    let request = IdentifyRequest::new(&world, &ego, 5).seed(4);
    let found = identified(&request);
    assert!(found.explains(), "{found:?}");
    assert!(
        10.0 * found.residual_m < found.nominal_residual_m,
        "{found:?}"
    );
    assert_eq!(found.noise_m, 0.0);
    for (q, quantity) in family.quantities.iter().enumerate() {
        let name = quantity.varied.name();
        let mut known = truth.iter();
        let value = known
            .find(|(n, _)| *n == name)
            .map_or(0.1, |(_, value)| *value);
        let off = (found.member.values[q] - value).abs() / (quantity.hi - quantity.lo);
        assert!(off < 0.1 && !found.hidden[q], "{name}: {found:?}");
    }
    // Equal requests, equal answers; one run is enough to see that.
    let brief = IdentifyRequest::new(&world, &ego, 1).seed(4);
    assert_eq!(identified(&brief), identified(&brief));
    // Without one of its quantities the family explains this ego less well.
    let fixed = ["time_gap_s".to_owned()];
    let poorer = identified(&request.fixed(&fixed));
    assert!(2.0 * found.residual_m < poorer.residual_m, "{poorer:?}");
    assert_eq!(poorer.member.values[2], 0.5, "left out: nominal");
}

#[test]
fn whoever_is_stopped_identifies_nothing() {
    let world = acc().on(PlantKind::Kinematic);
    let request = IdentifyRequest::new(&world, &world, 2);
    for after in 1..=3 {
        let stop = AtomicBool::new(false);
        let progress = |done, _| stop.store(after <= done, Ordering::Relaxed);
        let watch = Watch::new(&progress, &stop);
        let found = identify(&request, &watch).expect("sound");
        assert_eq!(found, None, "after {after} fits");
    }
}

#[test]
fn an_ego_is_never_run_more_often_than_granted() {
    let world = acc().on(PlantKind::Kinematic);
    let noisy = world.with(&brakecheck::world::Change {
        sensors: Some(brakecheck::scene::drive::Sensors {
            position_sd_m: 0.5,
            ..Default::default()
        }),
        ..Change::default()
    });
    let noisy = noisy.expect("it fits");
    let recorded = |ego, at_most: Option<u64>| {
        let request = IdentifyRequest::new(&world, ego, 3);
        let found = identified(&at_most.map_or(request, |runs| request.at_most(runs)));
        (found.recorded, 0.0 < found.noise_m)
    };
    // The first start is run twice; with noise every one is.
    assert_eq!(recorded(&world, None), (4, false));
    assert_eq!(recorded(&world, Some(3)), (3, false));
    assert_eq!(recorded(&noisy, None), (6, true));
    assert_eq!(recorded(&noisy, Some(5)), (4, true));
    assert_eq!(recorded(&noisy, Some(1)), (1, false));
}

#[test]
fn an_ego_that_switches_is_found_where_no_slope_leads() {
    // Its threshold shows in when it brakes: in whole samples.
    let text = include_str!("../../worlds/merge.ron");
    let world = Scenario::parse("merge.ron", text).expect("sound");
    let request = IdentifyRequest::new(&world, &world, 2);
    let found = identified(&request);
    assert!(found.explains(), "{found:?}");
    let nominal = family(&world).nominal(PlantKind::Rigid);
    assert_eq!(found.member, nominal, "{found:?}");
}

#[test]
fn an_ego_of_another_kind_is_not_explained() {
    let world = acc().on(PlantKind::Kinematic);
    let ego = world.with(&world.reuse()["aeb"]).expect("it fits");
    let ego = ego.on(PlantKind::Kinematic);
    let request = IdentifyRequest::new(&world, &ego, 4).seed(4);
    let found = identified(&request);
    assert!(!found.explains(), "{found:?}");
    // Its nearest member says nothing of it: an ado takes it for the nominal ego.
    let family = family(&world);
    assert!(
        0.5 * found.nominal_residual_m < found.residual_m,
        "{found:?}"
    );
    let nominal = family.nominal(PlantKind::Kinematic);
    assert_eq!(found.context(family), (nominal.clone(), "nominal"));
    // One that halves the residual says something, explained or not.
    let mut nearer = found.clone();
    nearer.nominal_residual_m = 2.5 * found.residual_m;
    assert!(!nearer.explains() && nearer.member != nominal);
    assert_eq!(nearer.context(family), (found.member.clone(), "identified"));
    let fixed = ["kp".to_owned()];
    let error = identify(&request.fixed(&fixed), &quiet());
    let error = error.expect_err("no such quantity").to_string();
    assert!(
        error.contains("`kp`") && error.contains("kp_per_s2"),
        "{error}"
    );
}

/// Brakes whenever the ego is nearer than 30 m: solves some starts.
struct Near;

impl Policy for Near {
    fn act(&self, obs: &[f32]) -> usize {
        usize::from(-0.4 < obs[0])
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
    let tries = |tries| {
        let tries = BestOfN {
            request,
            policy: &Near,
            others: &[],
            tries,
        };
        tries.run(&quiet())
    };
    let one = tries(1);
    assert_eq!(one.evaluated.row.solved, once.row.solved);
    assert_eq!(one.evaluated.row.sims_per_start, 1.0);
    assert_eq!(one.evaluated.row.physics_steps, once.row.physics_steps);
    let mut before = one;
    for count in [3, 10, 30] {
        let after = tries(count);
        let (old, new) = (&before.evaluated.row, &after.evaluated.row);
        for (old, new) in old.solved.iter().zip(new.solved.iter()) {
            assert!(*old != Solved || *new == Solved);
        }
        let spent: u64 = after
            .winners
            .iter()
            .zip(new.solved.iter())
            .map(|(winner, mark)| match (winner, mark) {
                (Some(number), _) => number + 1,
                (None, Trivial) => 0,
                (None, _) => count,
            })
            .sum();
        assert_eq!(new.sims_per_start, spent as f64 / new.starts as f64);
        before = after;
    }
    let (few, many) = (once.row.successes, before.evaluated.row.successes);
    assert!(few + 5 < many, "{few} {many}");
    // What a try did is played again bit for bit.
    let all = BestOfN {
        request,
        policy: &Near,
        others: &[],
        tries: 30,
    };
    let later = before
        .winners
        .iter()
        .position(|w| w.is_some_and(|w| 0 < w))
        .expect("one");
    let number = before.winners[later].expect("one");
    let mut bench = world.bench();
    assert!(all.play(&mut bench, later, number).verdict.is_success());
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
        for quantity in &family.quantities {
            for (unit, end) in [(-1.0, quantity.lo), (1.0, quantity.hi)] {
                let value = quantity.at(unit);
                assert!((value - end).abs() < 1e-12, "{name}: {quantity:?}");
                assert!(quantity.contains(value), "{name}: {quantity:?}");
            }
            for unit in quantity.steps() {
                assert!(quantity.contains(quantity.at(unit)), "{name}: {quantity:?}");
            }
        }
        for index in 0..2_000 {
            let member = family.draw(name, key(index));
            let pairs = family.quantities.iter().zip(&member.values);
            let named = pairs.map(|(q, value)| (q.varied.name().to_owned(), *value));
            let again = family.member_named(&named.collect(), member.plant);
            assert_eq!(again.as_ref(), Ok(&member), "{name}");
        }
    }
}
