//! Motion after the first contact.

use brakecheck::crashes::Regressions;
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, FilmAfterContact, film_beyond, play};
use brakecheck::world::{Change, PlantKind, Scenario};

/// A row of standing cars, into the first of which a fast ego drives.
const ROW: &str = r#"Scenario(
    name: "row",
    question: "Does the ego drive into a row of standing cars?",
    clock: (horizon_s: 6.0, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    AFTER
    judge: UntilContact,
    road: Straight(lanes: 2, lane_width_m: 3.5, friction: 0.9),
    agents: [
        Vehicle(
            name: "ego", body: "sedan", lane: 0,
            start: At(x_m: 0.0, speed_mps: (15.0, 20.0)),
            drive: Ego(Acc(
                kp_per_s2: 0.0, kd_per_s: 0.0,
                standstill_headway_m: 5.7, time_gap_s: 0.5,
                max_brake_mps2: 0.1, max_accel_mps2: 0.1, lag_s: 0.0,
            )),
        ),
        Vehicle(
            name: "ado", body: "sedan", lane: 0, offset_m: OFFSET,
            start: Ahead(of: "ego", headway_m: 40.0, speed_mps: 0.0),
            drive: Ado(
                actions: Accelerations([0.0, 1.0]), neutral: 0, observe: ["headway"],
                rulebook: [Rule(name: "is slow", stl: "always[0, T] (ado.speed <= 20)")],
            ),
        ),
        Vehicle(
            name: "front", body: "sedan", lane: 0, offset_m: OFFSET,
            start: Ahead(of: "ado", headway_m: 6.0, speed_mps: 0.0),
            drive: Scripted(Stand),
        ),
    ],
    signals: { "headway": "ado.x - ego.x" },
    ego_spec: "always[0, T] (headway >= 4.6)",
)"#;

fn row(after: &str, offset_m: &str) -> Scenario {
    let text = ROW.replace("AFTER", after).replace("OFFSET", offset_m);
    Scenario::parse("row.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

fn crash(world: &Scenario) -> Episode {
    let start = Start(vec![20.0]);
    play(
        &mut world.bench(),
        &start,
        0,
        &mut Constant(0),
        Aftermath::Play,
    )
}

#[test]
fn a_pile_up_is_played_and_changes_no_verdict() {
    let without = crash(&row("", "0.0"));
    let with = crash(&row("after_contact_s: 2.0,", "0.0"));
    let after = with.after_contact.clone().expect("played");
    assert_eq!(without.after_contact, None);
    // All else is equal to the bit.
    let stripped = Episode {
        after_contact: None,
        ..with.clone()
    };
    assert_eq!(stripped, without);
    let pairs: Vec<_> = after
        .collisions
        .iter()
        .map(|one| (one.between.0.as_str(), one.between.1.as_str()))
        .collect();
    assert_eq!(pairs[..2], [("ego", "ado"), ("ado", "front")]);
    let (first, second) = (&after.collisions[0], &after.collisions[1]);
    let contact = with.contact.expect("a contact");
    assert!((first.time_s - contact.time_s).abs() < 0.01);
    assert!(second.time_s > first.time_s);
    // Equal masses: both change their speed by about half of the closing speed.
    let impact = contact.impact.expect("of the ego");
    let solver_mps = first.delta_v_mps.0;
    assert!((solver_mps - impact.ego_delta_v_mps).abs() < 0.2 * impact.ego_delta_v_mps);
    assert!(after.sentences()[1].starts_with("ado and front then collide at "));
    assert!((after.duration_s - 2.0).abs() < 1e-9);
}

#[test]
fn a_car_that_is_hit_at_its_corner_is_pushed_over_the_lanes_edge() {
    let after = crash(&row("after_contact_s: 5.0,", "1.2"))
        .after_contact
        .expect("played");
    let pushed: Vec<&str> = after
        .pushed
        .iter()
        .map(|push| push.agent.as_str())
        .collect();
    assert!(!pushed.is_empty(), "{after:?}");
    for push in &after.pushed {
        assert_ne!(push.from, push.to);
        assert!(push.time_s > after.collisions[0].time_s);
    }
}

#[test]
fn nothing_is_played_where_nothing_collides() {
    // The second car is beside the ego's way.
    let beside = crash(&row("after_contact_s: 2.0,", "3.4"));
    assert_eq!((beside.contact, beside.after_contact), (None, None));
}

#[test]
fn a_crash_of_the_kinematic_plant_is_played_on_by_rapier() {
    let rigid = row("", "0.0");
    let kinematic = rigid.on(PlantKind::Kinematic);
    let after = |world: &Scenario| {
        let episode = crash(world);
        assert_eq!(episode.after_contact, None);
        let film = film_beyond(&mut world.bench(), &episode);
        (film.after.expect("played on"), episode)
    };
    let ((hard, _), (flat, episode)) = (after(&rigid), after(&kinematic));
    assert_eq!(flat.frames.len(), 40);
    let pairs = |after: &FilmAfterContact| -> Vec<(String, String)> {
        let collisions = after.motion.collisions.iter();
        collisions.map(|one| one.between.clone()).collect()
    };
    assert_eq!(pairs(&flat)[..2], pairs(&hard)[..2]);
    let (first, same) = (&flat.motion.collisions[0], &hard.motion.collisions[0]);
    assert!((first.delta_v_mps.0 - same.delta_v_mps.0).abs() < 0.1 * same.delta_v_mps.0);
    // The first frame continues the motion at the contact.
    let touch = episode.contact.expect("a contact");
    let ahead_m = flat.frames[0].placements[0].centre_m[0] - touch.point_m[0];
    assert!((-2.3..-1.0).contains(&ahead_m), "{ahead_m}");
}

#[test]
fn a_world_may_end_at_the_contact() {
    let world = row("after_contact_s: 0.0,", "0.0");
    let episode = crash(&world);
    assert!(episode.contact.is_some());
    assert_eq!(film_beyond(&mut world.bench(), &episode).after, None);
}

#[test]
fn a_kept_crash_has_the_motion_after_the_contact() {
    let world = row("", "0.0");
    let episode = crash(&world);
    let film = film_beyond(&mut world.bench(), &episode);
    let motion = film.after.expect("played on").motion;
    assert!((motion.duration_s - 2.0).abs() < 1e-9);
    let dir = tempfile::tempdir().expect("a directory");
    let mut kept =
        Counterexample::record(&world, "nominal", &Change::default(), "search", &episode);
    kept.about = Some(brakecheck_crashes::crashes::save_crashes::description(
        &world, &episode,
    ));
    let file = dir.path().join("row.ron");
    kept.save(&file, &episode.trace).expect("written");
    let read = Regressions::load(&file).expect("a file");
    let about = read.kept()[0].counterexample.about.clone().expect("labels");
    assert_eq!(about.after_contact.as_ref(), Some(&motion));
    let table = &read.kept()[0].counterexample.motion_after_contact;
    assert_eq!(table.lines().count(), 41);
    read.reproduce().unwrap_or_else(|error| panic!("{error}"));
    let text = about.to_string();
    assert!(text.contains("ado and front then collide at "), "{text}");
}

#[test]
fn a_time_that_cannot_be_played_is_refused_at_its_place() {
    let refused = |after: &str| {
        let text = ROW.replace("AFTER", after).replace("OFFSET", "0.0");
        let error = Scenario::parse("row.ron", &text).expect_err("refused");
        error.to_string()
    };
    let negative = refused("after_contact_s: -1.0,");
    assert!(
        negative.contains("-1 s is outside of 0 ..= 20"),
        "{negative}"
    );
}
