//! Actions that a limit on the naturalness of ados leaves.

use brakecheck::scene::{Scene, Start};
use brakecheck::testbench::{Aftermath, Testbench};
use brakecheck::world::{PlantKind, Scenario};
use brakecheck_scene::natural::limited_scene::{LimitedScene, LimitedVehicle};
use brakecheck_scene::natural::vehicle_meter::VehicleMeter;
use brakecheck_scene::natural::{AdoLimit, SuccessRarity, motorway};
use brakecheck_traffic::CUT_IN_GAP_M;

/// World `cut_in` with the ado in the left lane, at its first sample.
fn scene(per_1000_km: f64) -> LimitedScene {
    let world = Scenario::shipped("cut_in")
        .expect("shipped")
        .expect("sound");
    let driving = world.drive().expect("a road").world().clone();
    let mut scene = LimitedScene {
        scene: world.world().scene(),
        limit: AdoLimit {
            model: motorway(),
            per_1000_km,
        },
        world: driving,
        ados: Vec::new(),
        bodies: Vec::new(),
    };
    scene.reset(&Start(vec![30.0, 10.0]), 0);
    scene
}

#[test]
fn a_cut_in_is_rated_by_the_worst_state_of_its_decision() {
    let mut scene = scene(1.0);
    let spec = scene.world.spec();
    let [ego_m, ado_m] = [0, 1].map(|agent| spec.agents[agent].body.length_m);
    let lane_m = spec.road.lane_middle_m(0);
    // Off the middle of the ego's lane, ahead of its front, and speeds of ego and ado.
    let mut found = |[off_m, ahead_m]: [f64; 2], [ego, ado]: [f64; 2], motion: (f64, f64)| {
        let front_m = scene.bodies[0].state.pose.x_m;
        scene.bodies[0].state.speed_mps = ego;
        scene.bodies[1].state.speed_mps = ado;
        scene.bodies[1].state.pose.x_m = front_m + ahead_m;
        scene.bodies[1].state.pose.y_m = lane_m + off_m;
        scene.cut_in(1, motion, 0.5)
    };
    let right = (0.0, -1.2);
    let plain = found([2.0, 30.0], [16.0, 10.0], right).expect("crosses");
    assert!((plain.closing_mps - 6.0).abs() < 1e-9, "{plain:?}");
    assert!(
        (plain.gap_m - (30.0 - ado_m - 3.0)).abs() < 1e-6,
        "{plain:?}"
    );
    assert_eq!(plain.lateral_mps, -1.2);
    // Braking closes the gap further, and speeding up comes too late to help.
    let braking = found([2.0, 30.0], [16.0, 10.0], (-4.0, -1.2)).expect("crosses");
    assert!((braking.closing_mps - 8.0).abs() < 1e-9, "{braking:?}");
    assert!(
        (braking.gap_m - (30.0 - ado_m - 4.0)).abs() < 1e-6,
        "{braking:?}"
    );
    let faster = found([2.0, 30.0], [16.0, 10.0], (4.0, -1.2)).expect("crosses");
    assert_eq!(faster, plain);
    // A faster ado opens the gap, which is then that of the beginning.
    let opening = found([2.0, 30.0], [10.0, 16.0], right).expect("crosses");
    assert!((opening.gap_m - (30.0 - ado_m)).abs() < 1e-6, "{opening:?}");
    // Alongside there is no gap.
    let beside = found([2.0, 1.0], [16.0, 10.0], right).expect("crosses");
    assert_eq!(beside.gap_m, 0.0);
    // From the right, by symmetry.
    assert!(found([-2.0, 30.0], [16.0, 10.0], (0.0, 1.2)).is_some());
    let half_m = 1.75;
    for (place, motion) in [
        // No motion to the side, one away, one that ends before the line, and one
        // that began behind it.
        ([2.0, 30.0], (0.0, 0.0)),
        ([2.0, 30.0], (0.0, 1.2)),
        ([half_m + 0.61, 30.0], right),
        ([half_m - 0.01, 30.0], right),
        // Behind the ego, and too far ahead.
        ([2.0, -ego_m - 0.1], right),
        ([2.0, CUT_IN_GAP_M + ado_m + 0.1], right),
    ] {
        assert_eq!(
            found(place, [16.0, 10.0], motion),
            None,
            "{place:?}, {motion:?}"
        );
    }
    for place in [
        [half_m + 0.59, 30.0],
        [half_m + 0.01, 30.0],
        [2.0, -ego_m + 0.1],
        [2.0, CUT_IN_GAP_M + ado_m - 0.1],
    ] {
        assert!(found(place, [16.0, 10.0], right).is_some(), "{place:?}");
    }
}

#[test]
fn a_limit_leaves_the_neutral_action_and_what_is_frequent_enough() {
    // Braking, keeping the speed and speeding up, in the lane and to the right.
    let allowed = |per_1000_km| scene(per_1000_km).allowed().expect("a mask");
    assert_eq!(allowed(1e-12), [true; 6]);
    // From the middle of the left lane, no decision reaches the line.
    assert_eq!(allowed(1e12), [false, true, false, false, true, false]);
    // Just left of the line, a cut-in in front of the ego is too rare.
    let at_line = |per_1000_km| {
        let mut scene = scene(per_1000_km);
        let lane_m = scene.world.spec().road.lane_middle_m(0);
        scene.bodies[1].state.pose.y_m = lane_m + 1.8;
        scene.allowed().expect("a mask")
    };
    assert_eq!(at_line(1e-12), [true; 6]);
    assert_eq!(at_line(1e12), [false, true, false, false, false, false]);
}

#[test]
fn deviations_are_rated_with_the_plan_to_which_they_add() {
    let mut scene = scene(20.0);
    let ado = |added_mps2| LimitedVehicle {
        agent: 1,
        meter: VehicleMeter::new(20.0, 0.05),
        added_mps2,
    };
    // Without a plan, what the body does now is no part of an action.
    scene.bodies[1].state.accel_mps2 = -6.0;
    assert!(scene.allows(&ado(0.0), (0.0, 0.0)));
    assert!(!scene.allows(&ado(0.0), (-6.0, 0.0)));
    let world = include_str!("../../worlds/ncap/cbla.ron");
    let world = Scenario::parse("cbla.ron", world).expect("sound");
    let driving = world.drive().expect("a road").world().clone();
    let agents = &driving.spec().agents;
    let planned = agents.iter().position(|it| it.plan().is_some());
    let planned = planned.expect("an agent with a plan");
    scene.world = driving;
    let body = scene.bodies[0];
    scene.bodies.resize(planned + 1, body);
    scene.bodies[planned].state.accel_mps2 = -6.0;
    let ado = |added_mps2| LimitedVehicle {
        agent: planned,
        ..ado(added_mps2)
    };
    // The plan brakes with 6 m/s², or the last action did.
    assert!(!scene.allows(&ado(0.0), (0.0, 0.0)));
    assert!(scene.allows(&ado(0.0), (6.0, 0.0)));
    assert!(scene.allows(&ado(-6.0), (0.0, 0.0)));
    assert!(!scene.allows(&ado(-6.0), (-6.0, 0.0)));
}

fn acc() -> Scenario {
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    world.on(PlantKind::Kinematic)
}

/// Rarest driving of an ado that brakes as long and as hard as it may.
fn braked(world: &Scenario) -> SuccessRarity {
    let mut bench: Testbench = world.bench();
    let axes = world.axes().into_iter();
    // Far ahead and fast, so that nothing ends the episode early.
    let start = Start(axes.map(|axis| axis.hi).collect());
    bench.begin(&start, 0, Aftermath::Skip);
    while !bench.is_done() && bench.decisions() < 4 {
        bench.decide(0);
    }
    let driving = world.drive().expect("a road").world();
    let trace = bench.trace();
    let found = SuccessRarity::of(&motorway(), driving, trace, trace.len());
    found.expect("a vehicle")
}

#[test]
fn ados_within_a_limit_brake_as_often_as_the_limit_says() {
    let rate = |rarity: &SuccessRarity| {
        let found = rarity.naturalness(&motorway());
        found.per_1000_km.unwrap_or(f64::INFINITY)
    };
    let free = rate(&braked(&acc()));
    assert!(free < 20.0, "{free}");
    for limit in [20.0, 100.0] {
        let found = rate(&braked(&acc().naturally(limit)));
        assert!(limit <= found && free < found, "{found} for {limit}");
    }
}

/// Scene of a world within a limit, at its lowest start but with one axis at a share.
fn begun(text: &str, axis: &str, share: f64) -> LimitedScene {
    let world = Scenario::parse("other.ron", text).unwrap_or_else(|error| panic!("{error}"));
    let driving = world.drive().expect("a road").world().clone();
    let mut scene = LimitedScene {
        scene: world.world().scene(),
        limit: AdoLimit {
            model: motorway(),
            per_1000_km: 20.0,
        },
        world: driving,
        ados: Vec::new(),
        bodies: Vec::new(),
    };
    let values = world.axes().into_iter().map(|it| {
        let share = if it.name == axis { share } else { 0.0 };
        it.lo + share * (it.hi - it.lo)
    });
    scene.reset(&Start(values.collect()), 0);
    scene
}

#[test]
fn every_ado_with_a_plan_has_its_own_part_of_a_joint_action() {
    let text = include_str!("../../worlds/r157/lead_brakes.ron");
    let first = text
        .find("        Vehicle(\n            name: \"lead_vehicle\"")
        .expect("an ado");
    let last = text
        .find("    ],\n    ego_spec")
        .expect("the end of the agents");
    let second = text[first..last]
        .replace("lead_vehicle", "second")
        .replace("x_m: 47.233333333", "x_m: 90.0");
    let both = format!("{}{second}{}", &text[..last], &text[last..]);
    let mut scene = begun(&both, "", 0.0);
    let added =
        |scene: &LimitedScene| -> Vec<f64> { scene.ados.iter().map(|it| it.added_mps2).collect() };
    assert_eq!(added(&scene), [0.0; 2]);
    // Nine actions each, of which three in a row have one acceleration.
    let acceleration = |action: usize| [-1.0, 0.0, 1.0][action % 3];
    for (one, two) in [(0, 8), (8, 0), (4, 2), (2, 1)] {
        scene.decide(one + 9 * two);
        assert_eq!(
            added(&scene),
            [acceleration(one), acceleration(two)],
            "{one}, {two}"
        );
    }
}
