//! Actions that a limit on the naturalness of ados leaves.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::scene::{Scene, Start, StepOutcome};
use brakecheck::testbench::{Aftermath, Testbench};
use brakecheck::world::{PlantKind, Scenario};
use brakecheck_scene::natural::limited_scene::{LimitedScene, LimitedVehicle};
use brakecheck_scene::natural::vehicle_meter::VehicleMeter;
use brakecheck_scene::natural::{AdoLimit, SuccessRarity, motorway};
use brakecheck_traffic::CUT_IN_GAP_M;

fn wish(accel_mps2: f64, lateral_mps: f64) -> Command {
    Command {
        accel_mps2,
        lateral_mps,
    }
}

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
    let mut found = |[off_m, ahead_m]: [f64; 2], [ego, ado]: [f64; 2], motion: Command| {
        let front_m = scene.bodies[0].state.pose.x_m;
        scene.bodies[0].state.speed_mps = ego;
        scene.bodies[1].state.speed_mps = ado;
        scene.bodies[1].state.pose.x_m = front_m + ahead_m;
        scene.bodies[1].state.pose.y_m = lane_m + off_m;
        scene.cut_in(1, motion, 0.5)
    };
    let right = wish(0.0, -1.2);
    let plain = found([2.0, 30.0], [16.0, 10.0], right).expect("crosses");
    assert!((plain.closing_mps - 6.0).abs() < 1e-9, "{plain:?}");
    assert!(
        (plain.gap_m - (30.0 - ado_m - 3.0)).abs() < 1e-6,
        "{plain:?}"
    );
    assert_eq!(plain.lateral_mps, -1.2);
    // Braking closes the gap further, and speeding up comes too late to help.
    let braking = found([2.0, 30.0], [16.0, 10.0], wish(-4.0, -1.2)).expect("crosses");
    assert!((braking.closing_mps - 8.0).abs() < 1e-9, "{braking:?}");
    assert!(
        (braking.gap_m - (30.0 - ado_m - 4.0)).abs() < 1e-6,
        "{braking:?}"
    );
    let faster = found([2.0, 30.0], [16.0, 10.0], wish(4.0, -1.2)).expect("crosses");
    assert_eq!(faster, plain);
    // A faster ado opens the gap, which is then that of the beginning.
    let opening = found([2.0, 30.0], [10.0, 16.0], right).expect("crosses");
    assert!((opening.gap_m - (30.0 - ado_m)).abs() < 1e-6, "{opening:?}");
    // Alongside there is no gap.
    let beside = found([2.0, 1.0], [16.0, 10.0], right).expect("crosses");
    assert_eq!(beside.gap_m, 0.0);
    // From the right, by symmetry.
    assert!(found([-2.0, 30.0], [16.0, 10.0], wish(0.0, 1.2)).is_some());
    let half_m = 1.75;
    for (place, motion) in [
        // No motion to the side, one away, one that ends before the line, and one
        // that began behind it.
        ([2.0, 30.0], wish(0.0, 0.0)),
        ([2.0, 30.0], wish(0.0, 1.2)),
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
    assert!(scene.allows(&ado(0.0), wish(0.0, 0.0)));
    assert!(!scene.allows(&ado(0.0), wish(-6.0, 0.0)));
    let world = include_str!("../../worlds/ncap/cbla.ron");
    let world = Scenario::parse("cbla.ron", world).expect("sound");
    let driving = world.drive().expect("a road").world().clone();
    let agents = &driving.spec().agents;
    let planned = agents
        .iter()
        .position(|it| it.plan().is_some())
        .expect("an agent with a plan");
    scene.world = driving;
    let body = scene.bodies[0];
    scene.bodies.resize(planned + 1, body);
    scene.bodies[planned].state.accel_mps2 = -6.0;
    let ado = |added_mps2| LimitedVehicle {
        agent: planned,
        ..ado(added_mps2)
    };
    // The plan brakes with 6 m/s², or the last action did.
    assert!(!scene.allows(&ado(0.0), wish(0.0, 0.0)));
    assert!(scene.allows(&ado(0.0), wish(6.0, 0.0)));
    assert!(scene.allows(&ado(-6.0), wish(0.0, 0.0)));
    assert!(!scene.allows(&ado(-6.0), wish(-6.0, 0.0)));
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

/// An ego that keeps its speed and counts its finished episodes.
#[derive(Clone)]
struct Coasting(Arc<AtomicUsize>);

impl Controller for Coasting {
    fn reset(&mut self, _: u64) {}

    fn control(&mut self, _: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(0.0))
    }

    fn finish(&mut self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

fn limited(world: &Scenario, per_1000_km: f64) -> Box<dyn Scene> {
    let limit = AdoLimit {
        model: motorway(),
        per_1000_km,
    };
    LimitedScene::around(world.world().scene(), &limit)
}

/// What viewers, judges and programs read of a scene.
fn read(scene: &dyn Scene) -> impl PartialEq + std::fmt::Debug {
    let mut row = vec![0.0; scene.schema().len()];
    scene.publish(&mut row);
    let mut observation = vec![0.0; scene.spaces().observation];
    scene.observe(&row, &mut observation);
    let mut bodies = Vec::new();
    scene.bodies(&mut bodies);
    let viewed = (scene.frame(), scene.stage(), scene.after_contact(1.0));
    let counted = (scene.rapier_steps(), scene.commands().to_vec());
    (row, observation, bodies, viewed, counted)
}

/// A limit takes actions away and changes nothing else of a scene.
#[test]
fn a_limited_scene_is_its_own_scene_but_for_its_actions() {
    let finished = Arc::new(AtomicUsize::new(0));
    for plant in [PlantKind::Kinematic, PlantKind::Rigid] {
        let own = Coasting(Arc::clone(&finished));
        let factory = Arc::new(move || Box::new(own.clone()) as Box<dyn Controller>);
        let world = acc().on(plant).with_ego("coasting", factory);
        let mut both = [world.world().scene(), limited(&world, 20.0)];
        // The lead car is slow and near.
        let near_by = |axis: &str| match axis {
            "ego.speed" => 25.0,
            "ado.headway" => 10.0,
            _ => 5.0,
        };
        let axes = both[1].axes().iter().map(|it| near_by(&it.name));
        let start = Start(axes.collect());
        both.iter_mut().for_each(|scene| {
            scene.reset(&start, 3);
            scene.decide(2);
        });
        let mut ends = [StepOutcome::Going, StepOutcome::Going];
        while ends[0] == StepOutcome::Going {
            ends = [0, 1].map(|at: usize| both[at].advance());
            assert_eq!(ends[0], ends[1]);
            assert!(read(&*both[0]) == read(&*both[1]), "{plant:?}");
        }
        assert!(matches!(ends[0], StepOutcome::Contact(_)), "{ends:?}");
        assert!(both[1].after_contact(1.0).is_some() && both[1].driven().is_some());
        assert_eq!(both[1].rapier_steps() > 0, plant == PlantKind::Rigid);
        assert!(!both[1].commands().is_empty());
        let before = finished.load(Ordering::Relaxed);
        both[1].finish();
        assert_eq!(finished.load(Ordering::Relaxed), before + 1);
    }
}

#[test]
fn what_an_ado_drove_limits_it_in_copies_and_if_others_moved_it() {
    let world = acc();
    let begun = || {
        let mut scene = limited(&world, 20.0);
        scene.reset(&Start(world.axes().iter().map(|it| it.hi).collect()), 0);
        scene
    };
    let allowed = |scene: &dyn Scene| scene.allowed().expect("a mask");
    let fresh = allowed(&*begun());
    // Braking for as long as it may.
    let mut braked = begun();
    while allowed(&*braked)[0] {
        braked.decide(0);
        (0..10).for_each(|_| assert_eq!(braked.advance(), StepOutcome::Going));
    }
    assert_eq!((fresh[0], allowed(&*braked)[1]), (true, true));
    let mut copy = braked.fork().expect("a stock ego");
    assert_eq!(allowed(&*copy), allowed(&*braked));
    copy.decide(1);
    braked.decide(1);
    for _ in 0..10 {
        assert_eq!(copy.advance(), braked.advance());
    }
    assert!(read(&*copy) == read(&*braked) && allowed(&*copy) == allowed(&*braked));
    // Another simulator brakes the ado as hard, which counts as its own driving.
    let mut given = begun();
    let mut plain = world.world().scene();
    plain.reset(&Start(world.axes().iter().map(|it| it.hi).collect()), 0);
    let mut bodies = Vec::new();
    given.bodies(&mut bodies);
    let mut state = bodies[1].state;
    for _ in 0..20 {
        state.pose.x_m += 0.05 * state.speed_mps;
        state.speed_mps -= 0.05 * 5.0;
        let states = [None, Some(state)];
        let ends = [&mut given, &mut plain].map(|scene| scene.advance_given(&states));
        assert_eq!(ends[0], Some(StepOutcome::Going));
        assert_eq!(ends[0], ends[1]);
        assert!(read(&*given) == read(&*plain));
    }
    assert!(!allowed(&*given)[0]);
}

#[test]
fn people_lights_and_surroundings_have_no_limit() {
    for name in ["pedestrian", "light_ado", "wet_bend", "tightening_bend"] {
        let world = Scenario::shipped(name).expect("shipped").expect("sound");
        let mut scene = limited(&world, 1e12);
        scene.reset(&Start(world.axes().iter().map(|it| it.lo).collect()), 0);
        let allowed = scene.allowed().expect("a mask");
        assert_eq!(allowed, vec![true; scene.spaces().actions], "{name}");
    }
}
