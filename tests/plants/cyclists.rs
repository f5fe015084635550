//! Bicyclists: speeds, brakes, lean, balance and contacts, on both plants.

use brakecheck_sim::sim::Push;

use super::*;

/// From the rear axle, which follows the path, to the front.
const LEVER_M: f64 = 1.4;
const LEAN_RATE_MPS3: f64 = 6.0;
const MOST_LATERAL_MPS2: f64 = 3.0;
const BALANCE_MPS: f64 = 1.5;

fn rider(kind: PlantKind, speed_mps: f64) -> Alone {
    Alone::new(kind, DRY, "bicyclist", speed_mps)
}

/// Lateral place of the rear axle.
fn aside_m(state: &BodyState) -> f64 {
    state.pose.y_m - LEVER_M * state.pose.heading_rad.sin()
}

fn lateral_mps2(state: &BodyState) -> f64 {
    state.speed_mps * state.yaw_rate_rad_per_s
}

#[test]
fn a_bicyclist_reaches_20_kmh_in_6_3_s_and_its_top_speed() {
    // 1 m/s² up to 300 W / (90 kg · 1 m/s²) = 3.33 m/s, in 3.33 s. Then v² grows by
    // 2 · 3.33 W/kg · t: (5.56² − 3.33²) / 6.67 = 2.96 s.
    for kind in KINDS {
        let mut cyclist = rider(kind, 0.0);
        let states = cyclist.run(drive(5.0, 0.0), 30.0);
        let slower = |state: &&BodyState| state.speed_mps < 20.0 / 3.6;
        let count = states.iter().take_while(slower).count();
        close(count as f64 * SAMPLE_S, 6.296, SAMPLE_S, "0-20 km/h");
        close(cyclist.state().speed_mps, 10.0, 1e-9, "top speed");
        let last = states[states.len() - 2];
        assert_eq!(last.speed_mps, cyclist.state().speed_mps);
    }
}

#[test]
fn braking_from_25_kmh_takes_the_textbook_distance() {
    let want_m = (25.0_f64 / 3.6).powi(2) / (2.0 * 4.0);
    for kind in KINDS {
        let mut cyclist = rider(kind, 25.0 / 3.6);
        cyclist.run(drive(-9.0, 0.0), 3.0);
        close(cyclist.state().pose.x_m, want_m, 0.01 * want_m, "distance");
        assert_eq!(cyclist.state().speed_mps, 0.0);
    }
}

#[test]
fn on_ice_neither_brakes_nor_lean_exceed_the_grip() {
    let ice = Ground { friction: 0.1 };
    let grip_mps2 = 0.1 * GRAVITY_MPS2;
    for kind in KINDS {
        let mut cyclist = Alone::new(kind, ice, "bicyclist", 6.0);
        let braking = cyclist.run(drive(-4.0, 0.0), 2.0);
        close(braking[9].accel_mps2, -grip_mps2, 1e-6, "deceleration");
        let mut cyclist = Alone::new(kind, ice, "bicyclist", 6.0);
        let leaning = cyclist.run(drive(0.0, 1.0), 2.0);
        close(lateral_mps2(&leaning[30]), grip_mps2, 1e-6, "lean");
    }
}

#[test]
fn a_changed_ground_changes_the_grip_of_a_bicyclist() {
    for kind in KINDS {
        for (first, second) in [(1.0, 0.1), (0.1, 0.2), (0.2, 0.05)] {
            let mut cyclist = Alone::new(kind, Ground { friction: first }, "bicyclist", 8.0);
            // On a slope, on which the load share of the push remains.
            let load_share = 0.9;
            let push = Push {
                load_share,
                ..Push::NONE
            };
            cyclist.plant.push(BodyId(0), push);
            cyclist.run(drive(0.0, 0.0), 0.5);
            cyclist.plant.set_ground(Ground { friction: second });
            let braking = cyclist.run(drive(-4.0, 0.0), 1.0);
            let grip_mps2 = second * load_share * GRAVITY_MPS2;
            close(braking[9].accel_mps2, -grip_mps2, 1e-6, "deceleration");
        }
    }
}

/// Offset of a motion whose acceleration grows at the lean rate up to the limit.
fn jerk_limited_m(after_s: f64) -> f64 {
    let build_s = MOST_LATERAL_MPS2 / LEAN_RATE_MPS3;
    let growing_s = after_s.min(build_s);
    let full_s = after_s - growing_s;
    LEAN_RATE_MPS3 * growing_s.powi(3) / 6.0
        + 0.5 * LEAN_RATE_MPS3 * growing_s.powi(2) * full_s
        + 0.5 * MOST_LATERAL_MPS2 * full_s.powi(2)
}

#[test]
fn a_swerve_is_the_jerk_limited_motion_of_its_lean() {
    for kind in KINDS {
        for side in [1.0, -1.0] {
            let mut cyclist = rider(kind, 8.0);
            let states = cyclist.run(drive(0.0, side * 5.0), 1.0);
            for (sample, state) in states.iter().enumerate() {
                let after_s = (sample + 1) as f64 * SAMPLE_S;
                let (got_m, most_m) = (side * aside_m(state), jerk_limited_m(after_s));
                let what = format!("{kind:?} {got_m} of {most_m} after {after_s} s");
                assert!(got_m <= most_m + 2e-5, "{what}");
                assert!(got_m >= 0.98 * most_m, "{what}");
            }
            close(states[19].speed_mps, 8.0, 1e-9, "speed");
        }
    }
}

#[test]
fn below_its_balance_speed_a_bicyclist_hardly_turns() {
    for kind in KINDS {
        let mut slow = rider(kind, 1.2);
        for state in slow.run(drive(0.0, 5.0), 3.0) {
            assert!(
                state.yaw_rate_rad_per_s <= 0.12 + 1e-9,
                "{kind:?} {state:?}"
            );
        }
        // At twice the balance speed the lean alone decides: 3 m/s² over 3 m/s.
        let mut fast = rider(kind, 3.0);
        fast.run(drive(0.0, 5.0), 2.0);
        close(fast.state().yaw_rate_rad_per_s, 1.0, 0.01, "yaw rate");
        let mut standing = rider(kind, 0.0);
        for command in [drive(-4.0, 5.0), drive(0.0, -5.0)] {
            standing.run(command, 1.0);
            assert_eq!(standing.state().pose, rider(kind, 0.0).state().pose);
        }
    }
}

#[test]
fn a_bicyclist_starts_within_its_speeds() {
    for kind in KINDS {
        assert_eq!(rider(kind, 30.0).state().speed_mps, 10.0);
        assert_eq!(rider(kind, -3.0).state().speed_mps, 0.0);
    }
}

/// Weaves, brakes to a stop and rides on.
fn weave(plant: &mut dyn Plant, samples: core::ops::Range<usize>, substeps: u32) -> Vec<BodyState> {
    let mut states = Vec::new();
    for sample in samples {
        let time_s = sample as f64 * SAMPLE_S;
        let accel_mps2 = if (2.5..4.2).contains(&time_s) {
            -4.0
        } else {
            1.0
        };
        plant.command(BodyId(0), drive(accel_mps2, 0.15 * (2.0 * time_s).sin()));
        assert_eq!(plant.advance(SAMPLE_S, substeps), None);
        states.push(plant.state(BodyId(0)));
    }
    assert!(plant.sound());
    states
}

fn weaver(kind: PlantKind) -> Box<dyn Plant> {
    let mut plant = plant(kind, DRY);
    plant.spawn(&body("bicyclist"), at(100.0, -20.0, 2.0), 4.0);
    plant
}

#[test]
fn both_plants_agree_on_a_bicyclist() {
    let want = weave(weaver(PlantKind::Kinematic).as_mut(), 0..100, 1);
    let least_mps = want.iter().map(|state| state.speed_mps).fold(9.0, f64::min);
    let most = |states: &[BodyState]| states.iter().map(lateral_mps2).fold(0.0, f64::max);
    assert!(least_mps < 1.0 && most(&want) > 2.0, "it stops and leans");
    for substeps in [3, 4, 7] {
        let got = weave(weaver(PlantKind::Rigid).as_mut(), 0..100, substeps);
        for (got, want) in got.iter().zip(&want) {
            let off_m = (got.pose.x_m - want.pose.x_m).hypot(got.pose.y_m - want.pose.y_m);
            assert!(off_m < 0.01, "{off_m}: {got:?} {want:?}");
            close(got.pose.heading_rad, want.pose.heading_rad, 0.01, "heading");
        }
    }
}

#[test]
fn a_bicyclist_continues_bit_for_bit_on_a_fork() {
    for kind in KINDS {
        let mut plant = weaver(kind);
        // In the middle of a lean.
        weave(plant.as_mut(), 0..13, 4);
        assert!(lateral_mps2(&plant.state(BodyId(0))) > 0.5);
        let mut fork = plant.fork();
        let rest = weave(fork.as_mut(), 13..80, 4);
        assert!(rest == weave(plant.as_mut(), 13..80, 4), "{kind:?}");
    }
}

/// Rides beside or ahead of a sedan until both touch.
fn collide(kind: PlantKind, place: Pose, curvature_per_m: f64) -> (f64, Contact, Box<dyn Plant>) {
    let mut plant = plant(kind, DRY);
    plant.spawn(&body("sedan"), Pose::default(), 15.0);
    let cyclist = plant.spawn(&body("bicyclist"), place, 5.0);
    plant.command(cyclist, drive(0.0, curvature_per_m));
    for sample in 0..100 {
        if let Some(contact) = plant.advance(SAMPLE_S, 4) {
            return (
                f64::from(sample) * SAMPLE_S + contact.after_s,
                contact,
                plant,
            );
        }
    }
    panic!("{kind:?}: no contact")
}

#[test]
fn a_sedan_hits_a_bicyclist_from_behind_and_one_who_swerves() {
    let swerves = KINDS.map(|kind| {
        let (time_s, contact, _) = collide(kind, at(20.0, 0.0, 0.0), 0.0);
        close(time_s, (20.0 - 1.75) / 10.0, 1e-3, "time");
        close(contact.closing_speed_mps, 10.0, 1e-3, "closing speed");
        assert_eq!(contact.pair, (BodyId(0), BodyId(1)));

        // 1.3 m to the right of the sedan's flank, with its rear at the sedan's front.
        let (time_s, _, mut plant) = collide(kind, at(12.0, -2.5, 0.0), 1.0);
        close(plant.gap_m(BodyId(0), BodyId(1)), 0.0, 1e-5, "gap");
        let before = plant.state(BodyId(1)).pose;
        let again = plant.advance(SAMPLE_S, 4).expect("still in contact");
        close(again.after_s, 0.0, 1e-6, "again");
        close(plant.state(BodyId(1)).pose.x_m, before.x_m, 1e-5, "place");
        time_s
    });
    // The body of the rigid plant is narrower than its box, except for the handlebar.
    close(swerves[0], swerves[1], 0.1, "time of the swerve");
    // The box is 1.3 m away, and the front swings out by 1.4 m times the heading.
    assert!((0.5..1.1).contains(&swerves[1]), "{swerves:?}");
}

#[test]
fn a_bicyclist_who_is_hit_is_thrown_and_another_rides_on() {
    let mut plant = plant(PlantKind::Rigid, DRY);
    plant.spawn(&body("sedan"), Pose::default(), 14.0);
    plant.spawn(&body("bicyclist"), at(12.0, 0.0, 0.0), 4.0);
    plant.spawn(&body("bicyclist"), at(12.0, -8.0, 0.0), 5.0);
    let turn = drive(0.0, -0.05);
    plant.command(BodyId(2), turn);
    let contact = (0..80)
        .find_map(|_| plant.advance(SAMPLE_S, 4))
        .expect("a contact");
    assert_eq!(contact.pair, (BodyId(0), BodyId(1)));
    let other = plant.state(BodyId(2));
    assert!(plant.collide(contact.pair));
    for _ in 0..12 {
        plant.advance(SAMPLE_S, 4);
    }
    assert!(plant.sound());
    let collisions = plant.collisions();
    assert!(collisions.iter().any(|it| it.pair == contact.pair));
    let hit = plant.state(BodyId(1));
    let over_ground_mps = hit.speed_mps.hypot(hit.lateral_mps);
    assert!(over_ground_mps > 6.0, "{hit:?}");
    let rides_on = plant.state(BodyId(2));
    close(
        rides_on.pose.heading_rad,
        other.pose.heading_rad,
        0.01,
        "it",
    );
    let way_m = (rides_on.pose.x_m - other.pose.x_m).hypot(rides_on.pose.y_m - other.pose.y_m);
    close(way_m, 5.0 * 0.6, 0.05, "way of the other");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// No command, however large, takes a bicyclist beyond its limits.
    #[test]
    fn a_bicyclist_stays_within_its_limits(
        speed_mps in 0.0..12.0,
        commands in prop::collection::vec(
            ((-1e9..1e9_f64).prop_map(f64::cbrt), (-1e9..1e9_f64).prop_map(f64::cbrt)), 20),
    ) {
        for kind in KINDS {
            let mut cyclist = rider(kind, speed_mps);
            let mut before = cyclist.state();
            for (accel_mps2, curvature_per_m) in &commands {
                // Scaled, so that commands below the limits occur, too.
                for state in cyclist.run(drive(0.01 * accel_mps2, 0.001 * curvature_per_m), 0.2) {
                    prop_assert!((0.0..=10.0 + 1e-9).contains(&state.speed_mps), "{state:?}");
                    let gained_mps2 = (state.speed_mps - before.speed_mps) / SAMPLE_S;
                    prop_assert!((-4.0 - 1e-6..=1.0 + 1e-6).contains(&gained_mps2), "{gained_mps2}");
                    let (was, is) = (lateral_mps2(&before).abs(), lateral_mps2(&state).abs());
                    prop_assert!(is <= MOST_LATERAL_MPS2 + 1e-9, "{state:?}");
                    if before.speed_mps.min(state.speed_mps) >= BALANCE_MPS {
                        prop_assert!(is - was <= LEAN_RATE_MPS3 * SAMPLE_S + 1e-9, "{was} {is}");
                    }
                    before = state;
                }
            }
        }
    }
}

#[test]
fn a_bicyclist_cannot_walk() {
    for kind in KINDS {
        let mut plant = weaver(kind);
        let (x_mps, y_mps) = (1.0, 0.0);
        plant.command(BodyId(0), BodyCommand::Walk { x_mps, y_mps });
        assert!(!plant.sound(), "{kind:?}");
    }
}
