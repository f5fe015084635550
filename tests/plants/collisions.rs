//! Collisions after the first contact, as rapier resolves them.

use brakecheck_sim::sim::Collision;

use super::*;

/// Slippery enough that no tyre force disturbs a balance of momentum.
const ICE: Ground = Ground { friction: 0.01 };

/// Advances two bodies to their contact and lets them collide for a time.
struct Crash {
    plant: Box<dyn Plant>,
    bodies: [(BodyId, Body); 2],
    before: [Motion2; 2],
    contact: Contact,
}

/// Velocity of the centre of mass and yaw rate.
#[derive(Clone, Copy, Debug)]
struct Motion2 {
    x_mps: f64,
    y_mps: f64,
    yaw_rad_per_s: f64,
}

fn motion(plant: &dyn Plant, (id, body): &(BodyId, Body)) -> Motion2 {
    let state = plant.state(*id);
    let (sin, cos) = libm::sincos(state.pose.heading_rad);
    // From the front bumper back to the centre of mass.
    let back_m = body.half_length_m() - body.com_ahead_m;
    let left_mps = state.lateral_mps - state.yaw_rate_rad_per_s * back_m;
    Motion2 {
        x_mps: state.speed_mps * cos - left_mps * sin,
        y_mps: state.speed_mps * sin + left_mps * cos,
        yaw_rad_per_s: state.yaw_rate_rad_per_s,
    }
}

fn energy_j(body: &Body, motion: &Motion2) -> f64 {
    let inertia = body.mass_kg / 12.0 * (body.length_m.powi(2) + body.width_m.powi(2));
    0.5 * body.mass_kg * (motion.x_mps.powi(2) + motion.y_mps.powi(2))
        + 0.5 * inertia * motion.yaw_rad_per_s.powi(2)
}

impl Crash {
    /// Two bodies with their front bumpers' poses and speeds. `None` if they miss.
    fn of(bodies: [(Body, Pose, f64); 2]) -> Option<Crash> {
        let mut plant = plant(PlantKind::Rigid, ICE);
        let bodies = bodies.map(|(body, pose, speed_mps)| {
            let id = plant.spawn(&body, pose, speed_mps);
            (id, body)
        });
        let contact = (0..80).find_map(|_| plant.advance(SAMPLE_S, 4))?;
        let before = [0, 1].map(|side: usize| motion(&*plant, &bodies[side]));
        assert!(plant.collide(contact.pair));
        Some(Crash {
            plant,
            bodies,
            before,
            contact,
        })
    }

    fn go_on(&mut self, samples: u32) {
        for _ in 0..samples {
            assert_eq!(self.plant.advance(SAMPLE_S, 4), None);
        }
    }

    fn now(&self) -> [Motion2; 2] {
        [0, 1].map(|side: usize| motion(&*self.plant, &self.bodies[side]))
    }

    fn momentum(&self, motions: &[Motion2; 2]) -> (f64, f64) {
        let of = |side: usize| {
            let mass_kg = self.bodies[side].1.mass_kg;
            (mass_kg * motions[side].x_mps, mass_kg * motions[side].y_mps)
        };
        (of(0).0 + of(1).0, of(0).1 + of(1).1)
    }

    fn energy_j(&self, motions: &[Motion2; 2]) -> f64 {
        let of = |side: usize| energy_j(&self.bodies[side].1, &motions[side]);
        of(0) + of(1)
    }
}

/// A collision through both centres of mass, which are as high as the faces' middle.
fn central(restitution: f64, masses_kg: (f64, f64), speeds_mps: (f64, f64)) -> Crash {
    let car = |mass_kg| Body {
        mass_kg,
        restitution,
        com_height_m: 0.8,
        ..body("sedan")
    };
    let behind = (car(masses_kg.0), at(0.0, 0.0, 0.0), speeds_mps.0);
    let ahead = (car(masses_kg.1), at(10.0, 0.0, 0.0), speeds_mps.1);
    Crash::of([behind, ahead]).expect("a contact")
}

#[test]
fn central_plastic_collisions_have_the_closed_forms_velocity_changes() {
    let cases = [
        ((1500.0, 1500.0), (20.0, 0.0)),
        ((1500.0, 3000.0), (15.0, 5.0)),
        ((900.0, 12_000.0), (10.0, -5.0)),
        ((2500.0, 1000.0), (8.0, 6.0)),
    ];
    for (masses_kg, speeds_mps) in cases {
        let mut crash = central(0.0, masses_kg, speeds_mps);
        crash.go_on(6);
        let closing_mps = speeds_mps.0 - speeds_mps.1;
        let whole_kg = masses_kg.0 + masses_kg.1;
        let want = [
            -closing_mps * masses_kg.1 / whole_kg,
            closing_mps * masses_kg.0 / whole_kg,
        ];
        let collisions = crash.plant.collisions();
        assert_eq!(collisions.len(), 1, "{collisions:?}");
        let Collision {
            pair,
            after_s,
            delta_v_mps,
            ..
        } = collisions[0];
        assert_eq!(pair, crash.contact.pair);
        assert!(after_s < 0.01, "{after_s}");
        for side in 0..2 {
            let error = (delta_v_mps[side][0] - want[side]).abs();
            assert!(error <= 0.02 * want[side].abs(), "{delta_v_mps:?} {want:?}");
            assert!(delta_v_mps[side][1].abs() < 0.02 * want[side].abs());
        }
    }
}

#[test]
fn restitution_returns_its_share_of_the_closing_speed() {
    let parting_mps = |restitution: f64| {
        let mut crash = central(restitution, (1500.0, 1500.0), (20.0, 0.0));
        crash.go_on(4);
        let [behind, ahead] = crash.now();
        ahead.x_mps - behind.x_mps
    };
    close(
        parting_mps(0.0),
        0.0,
        0.5,
        "parting speed of a plastic collision",
    );
    for restitution in [0.1, 0.2, 0.5] {
        // The chassis pitch, which returns a little more.
        let share = parting_mps(restitution) / 20.0;
        let most = 1.3 * restitution + 0.02;
        assert!(
            (restitution..=most).contains(&share),
            "{restitution}: {share}"
        );
    }
}

#[test]
fn five_hundred_collisions_conserve_momentum_and_gain_no_energy() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let names = ["sedan", "compact", "van", "truck", "motorcycle"];
    let strategy = (
        (0..names.len(), 0..names.len()),
        (3.0..25.0_f64, 0.0..25.0_f64),
        (-3.1..3.1_f64, -1.5..1.5_f64),
    );
    let mut seen = 0;
    while seen < 500 {
        let tree = proptest::strategy::Strategy::new_tree(&strategy, &mut runner).expect("a value");
        let ((a, b), (speed_a, speed_b), (heading_rad, offset_m)) =
            proptest::strategy::ValueTree::current(&tree);
        // The second passes the point (20, offset) when the first reaches it.
        let time_s = 20.0 / speed_a;
        let (sin, cos) = libm::sincos(heading_rad);
        let way_m = speed_b * time_s;
        let second = at(20.0 - way_m * cos, offset_m - way_m * sin, heading_rad);
        let first = (body(names[a]), at(0.0, 0.0, 0.0), speed_a);
        let Some(mut crash) = Crash::of([first, (body(names[b]), second, speed_b)]) else {
            continue;
        };
        // Bodies that begin inside each other are no collision.
        if crash.contact.after_s == 0.0 || crash.contact.closing_speed_mps < 0.5 {
            continue;
        }
        seen += 1;
        let before = crash.before;
        crash.go_on(1);
        let now = crash.now();
        let (was, is) = (crash.momentum(&before), crash.momentum(&now));
        // Relative to the momentum that either body brings into the collision.
        let scale = [0, 1].map(|side: usize| {
            let Motion2 { x_mps, y_mps, .. } = before[side];
            crash.bodies[side].1.mass_kg * x_mps.hypot(y_mps)
        });
        let scale = scale[0] + scale[1];
        let error = (is.0 - was.0).hypot(is.1 - was.1) / scale;
        let case = format!(
            "{} {}, {speed_a} {speed_b} {heading_rad} {offset_m}",
            names[a], names[b]
        );
        assert!(error <= 0.01, "{error}: {case}");
        let (energy_before, energy_after) = (crash.energy_j(&before), crash.energy_j(&now));
        assert!(
            energy_after <= energy_before * (1.0 + 1e-3),
            "{energy_before} {energy_after}: {case}"
        );
        assert!(crash.plant.sound(), "{case}");
    }
}

#[test]
fn a_car_that_is_pushed_hits_the_next_one() {
    let mut plant = plant(PlantKind::Rigid, DRY);
    let sedan = body("sedan");
    let behind = plant.spawn(&sedan, at(0.0, 0.0, 0.0), 20.0);
    let middle = plant.spawn(&sedan, at(10.0, 0.0, 0.0), 0.0);
    let front = plant.spawn(&sedan, at(16.0, 0.0, 0.0), 0.0);
    let contact = (0..40)
        .find_map(|_| plant.advance(SAMPLE_S, 4))
        .expect("a contact");
    assert!(plant.collide(contact.pair));
    for _ in 0..20 {
        plant.advance(SAMPLE_S, 4);
    }
    let pairs: Vec<_> = plant.collisions().iter().map(|one| one.pair).collect();
    assert_eq!(pairs[..2], [(behind, middle), (middle, front)]);
    assert!(plant.state(front).speed_mps > 3.0);
}

#[test]
fn a_struck_pedestrian_is_thrown_and_an_untouched_one_walks_on() {
    let mut plant = plant(PlantKind::Rigid, DRY);
    let car = plant.spawn(&body("sedan"), at(0.0, 0.0, 0.0), 15.0);
    let struck = plant.spawn(&body("adult"), at(10.0, 0.0, 0.0), 0.0);
    let beside = plant.spawn(&body("adult"), at(10.0, 6.0, 0.0), 1.5);
    let contact = (0..40)
        .find_map(|_| plant.advance(SAMPLE_S, 4))
        .expect("a contact");
    assert_eq!(contact.pair, (car, struck));
    let before_m = plant.state(beside).pose.x_m;
    assert!(plant.collide(contact.pair));
    for _ in 0..10 {
        plant.advance(SAMPLE_S, 4);
    }
    let collisions = plant.collisions();
    let [of_car, of_struck] = collisions[0].delta_v_mps.map(|[x, y]| x.hypot(y));
    // 75 kg against 1500 kg: the pedestrian takes nearly the car's speed.
    assert!(of_struck > 10.0, "{of_struck}");
    assert!(of_car < 1.5, "{of_car}");
    assert!(plant.placement(struck).centre_m[0] > 12.0);
    close(
        plant.state(beside).pose.x_m - before_m,
        0.75,
        0.02,
        "way of the other",
    );
    assert!(plant.sound());
}

#[test]
fn collisions_give_equal_bits_on_a_fork() {
    let mut crash = central(0.1, (1500.0, 1200.0), (20.0, 3.0));
    let mut fork = crash.plant.fork();
    crash.go_on(10);
    for _ in 0..10 {
        fork.advance(SAMPLE_S, 4);
    }
    for (id, _) in &crash.bodies {
        assert_eq!(crash.plant.state(*id), fork.state(*id));
    }
    assert_eq!(crash.plant.collisions(), fork.collisions());
}

#[test]
fn the_kinematic_plant_resolves_no_collision() {
    let mut plant = plant(PlantKind::Kinematic, DRY);
    let a = plant.spawn(&body("sedan"), at(0.0, 0.0, 0.0), 20.0);
    let b = plant.spawn(&body("sedan"), at(10.0, 0.0, 0.0), 0.0);
    assert!(!plant.collide((a, b)));
    assert!(plant.collisions().is_empty());
}
