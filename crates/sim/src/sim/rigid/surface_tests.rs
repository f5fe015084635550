//! Cars on the surface of a road, against answers by hand.

use crate::road::{
    Bank, Course, Grade, Piece, PlacedRoad, Priority, Road, RoadPlace, RoadProfile, SurfaceExtent,
    SurfaceMesh,
};
use crate::sim::rigid::{GroundSurface, Rigid};
use crate::sim::{Body, BodyCommand, BodyId, GRAVITY_MPS2, Ground, Plant, Pose, Push};

/// Error that the answers allow.
const WITHIN: f64 = 0.03;
const SAMPLE_S: f64 = 0.05;
const SUBSTEPS: u32 = 4;
const FRICTION: f64 = 0.8;
const CAR: BodyId = BodyId(0);

fn sedan() -> Body {
    Body::shipped("sedan").expect("shipped").expect("valid")
}

fn near(value: f64, expected: f64, of: f64, what: &str) {
    let error = (value - expected).abs();
    assert!(error <= WITHIN * of, "{what}: {value}, by hand {expected}");
}

/// Grades that meet at station 0.
fn hill([before, after]: [f64; 2]) -> [Grade; 2] {
    [
        Grade {
            from_s_m: -1e3,
            rise: before,
        },
        Grade {
            from_s_m: 0.0,
            rise: after,
        },
    ]
}

/// Plant with one sedan on a road.
struct OnRoad<'a> {
    plant: Rigid,
    course: Course,
    profile: RoadProfile<'a>,
}

impl<'a> OnRoad<'a> {
    fn new(course: Course, profile: RoadProfile<'a>) -> OnRoad<'a> {
        let extent = SurfaceExtent {
            stations_m: -500.0..500.0,
            borders_m: -1.75..1.75,
        };
        let mut mesh = SurfaceMesh::default();
        mesh.add(&course, &profile, &extent);
        let mut plant = Rigid::new(Ground { friction: FRICTION });
        plant.lay(GroundSurface::of(&mesh).as_ref());
        OnRoad {
            plant,
            course,
            profile,
        }
    }

    fn spawn(&mut self, s_m: f64, speed_mps: f64) -> BodyId {
        let pose = self.course.pose(s_m, 0.0);
        self.plant.spawn(&sedan(), pose, speed_mps)
    }

    fn s_m(&self) -> f64 {
        self.course.locate(&self.plant.state(CAR).pose).s_m
    }

    /// Advances by a sample, with the push of a grade as a scene gives it.
    fn go(&mut self, accel_mps2: f64, curvature_per_m: f64, has_push: bool) {
        let command = BodyCommand::Drive {
            accel_mps2,
            curvature_per_m,
        };
        self.plant.command(CAR, command);
        if has_push {
            let (sin, cos) = crate::road::slope_direction(self.profile.rise(self.s_m()));
            let along_mps2 = -GRAVITY_MPS2 * sin;
            let push = Push {
                along_mps2,
                left_mps2: 0.0,
                grade_mps2: [along_mps2, 0.0],
                load_share: cos,
            };
            self.plant.push(CAR, push);
        }
        self.plant.advance(SAMPLE_S, SUBSTEPS);
    }

    fn loads_n(&self) -> f64 {
        let wheels = self.plant.movers[CAR.0].motor.wheels().iter();
        wheels
            .map(|wheel| f64::from(wheel.wheel_suspension_force))
            .sum()
    }

    fn side_force_n(&self) -> f64 {
        let wheels = self.plant.movers[CAR.0].motor.wheels().iter();
        let impulses = wheels.map(|wheel| f64::from(wheel.side_impulse));
        // Axles point to the right.
        -impulses.sum::<f64>() / (SAMPLE_S / f64::from(SUBSTEPS))
    }
}

fn profile(grades: &[Grade], vertical_curve_m: f64) -> RoadProfile<'_> {
    RoadProfile {
        grades,
        vertical_curve_m,
        ..RoadProfile::default()
    }
}

#[test]
fn the_load_on_a_crest_and_in_a_dip_is_that_of_its_radius() {
    const RADIUS_M: f64 = 400.0;
    for (sign, speed_mps) in [(1.0, 15.0), (1.0, 25.0), (-1.0, 20.0)] {
        let grades = hill([0.2 * sign, -0.2 * sign]);
        let mut road = OnRoad::new(Course::straight(), profile(&grades, 0.4 * RADIUS_M));
        road.spawn(-70.0, speed_mps);
        let mut loads_n = Vec::new();
        while road.s_m() < 25.0 {
            road.go(0.0, 0.0, false);
            if road.s_m() > -15.0 {
                loads_n.push(road.loads_n());
            }
        }
        let mean_n = loads_n.iter().sum::<f64>() / loads_n.len() as f64;
        let weight_n = sedan().mass_kg * GRAVITY_MPS2;
        let by_hand_n = weight_n - sign * sedan().mass_kg * speed_mps * speed_mps / RADIUS_M;
        near(mean_n, by_hand_n, by_hand_n, "load");
    }
}

#[test]
fn wheels_leave_the_ground_above_the_root_of_g_r() {
    const RADIUS_M: f64 = 60.0;
    let grades = hill([0.25, -0.25]);
    let flies = |speed_mps: f64| {
        let mut road = OnRoad::new(Course::straight(), profile(&grades, 0.5 * RADIUS_M));
        road.spawn(-40.0, speed_mps);
        let mut least_n = f64::INFINITY;
        while road.s_m() < 12.0 {
            road.go(0.0, 0.0, false);
            least_n = least_n.min(road.loads_n());
        }
        least_n == 0.0
    };
    let limit_mps = (GRAVITY_MPS2 * RADIUS_M).sqrt();
    assert!(!flies(0.7 * limit_mps));
    assert!(flies(1.25 * limit_mps));
}

#[test]
fn no_side_force_acts_in_a_banked_bend_at_its_speed() {
    const RADIUS_M: f64 = 100.0;
    const SLOPE: f64 = 0.12;
    // The right side, outside of this left bend, is higher.
    let banks = [Bank {
        s_m: 0.0,
        slope: -SLOPE,
    }];
    let bent = PlacedRoad {
        at: RoadPlace::default(),
        road: Road::Straight {
            lanes: 1,
            lane_width_m: 3.5,
            friction: FRICTION,
            speed_limit_mps: None,
        },
        shares_lane_width: true,
        pieces: vec![Piece::Arc {
            length_m: 300.0,
            radius_m: RADIUS_M,
        }],
        priority: Priority::Equal,
        grades: Vec::new(),
        vertical_curve_m: 0.0,
        banks: banks.to_vec(),
    };
    let neutral_mps = (GRAVITY_MPS2 * RADIUS_M * SLOPE).sqrt();
    let (sin, cos) = crate::road::slope_direction(SLOPE);
    for share in [0.6, 1.0, 1.3] {
        let speed_mps = share * neutral_mps;
        let mut road = OnRoad::new(bent.course().expect("a course"), bent.profile());
        road.spawn(20.0, speed_mps);
        let (mut forces_n, mut expected_n) = (Vec::new(), Vec::new());
        for sample in 0..160 {
            road.go(0.0, 1.0 / RADIUS_M, false);
            if sample >= 100 {
                let state = road.plant.state(CAR);
                let towards_mps2 = state.speed_mps * state.yaw_rate_rad_per_s;
                forces_n.push(road.side_force_n());
                expected_n.push(sedan().mass_kg * (towards_mps2 * cos - GRAVITY_MPS2 * sin));
            }
        }
        let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
        let whole_n = sedan().mass_kg * speed_mps * speed_mps / RADIUS_M;
        near(mean(&forces_n), mean(&expected_n), whole_n, "side force");
        if share == 1.0 {
            near(mean(&forces_n), 0.0, whole_n, "at the speed of the bank");
        }
    }
}

#[test]
fn stops_up_and_down_a_grade_have_the_length_of_friction_and_grade() {
    for rise in [0.08, 0.0, -0.08] {
        let grades = hill([rise, rise]);
        let mut road = OnRoad::new(Course::straight(), profile(&grades, 0.0));
        road.spawn(0.0, 20.0);
        let begun_m = road.s_m();
        while road.plant.state(CAR).speed_mps > 0.0 {
            road.go(-20.0, 0.0, true);
        }
        let (sin, cos) = crate::road::slope_direction(rise);
        let way_m = (road.s_m() - begun_m) / cos;
        let friction = FRICTION * sedan().vehicle().expect("a car").grip;
        let by_hand_m = 20.0 * 20.0 / (2.0 * GRAVITY_MPS2 * (friction * cos + sin));
        near(way_m, by_hand_m, by_hand_m, "way");
    }
}

#[test]
fn a_car_at_rest_on_a_grade_stays_and_lies_on_it() {
    for rise in [0.08, -0.08] {
        let grades = hill([rise, rise]);
        let mut road = OnRoad::new(Course::straight(), profile(&grades, 0.0));
        road.spawn(50.0, 0.0);
        let begun_m = road.s_m();
        for _ in 0..100 {
            road.go(0.0, 0.0, true);
        }
        assert!(
            (road.s_m() - begun_m).abs() < 0.02,
            "{}",
            road.s_m() - begun_m
        );
        let ahead = road.plant.placement(CAR).rotation * nalgebra::Vector3::x();
        assert!((ahead.z / ahead.x - rise).abs() < 5e-3, "{ahead}");
        let height_m = road.plant.placement(CAR).centre_m[2] - 0.5 * sedan().height_m;
        let at_m = road.s_m() - sedan().half_length_m();
        assert!((height_m - road.profile.height_m(at_m, 0.0)).abs() < 0.03);
    }
}

#[test]
fn a_coasting_car_gains_and_loses_its_height() {
    let grades = hill([0.0, 0.06]);
    let mut road = OnRoad::new(Course::straight(), profile(&grades, 20.0));
    road.spawn(-30.0, 20.0);
    while road.s_m() < 100.0 {
        road.go(0.0, 0.0, true);
    }
    let height_m = road
        .profile
        .height_m(road.s_m() - sedan().half_length_m(), 0.0);
    let by_hand_mps = (20.0_f64 * 20.0 - 2.0 * GRAVITY_MPS2 * height_m).sqrt();
    near(road.plant.state(CAR).speed_mps, by_hand_mps, 20.0, "speed");
}

#[test]
fn bodies_touch_at_their_true_poses() {
    // Along a grade of 25 % a car is 3 % shorter from above.
    let grades = hill([0.25, 0.25]);
    let mut road = OnRoad::new(Course::straight(), profile(&grades, 0.0));
    road.spawn(0.0, 8.0);
    let parked = road.spawn(20.0, 0.0);
    let contact = (0..200).find_map(|_| {
        road.plant.push(CAR, Push::NONE);
        road.plant.advance(SAMPLE_S, SUBSTEPS)
    });
    assert_eq!(contact.expect("a contact").pair, (CAR, parked));
    let middles = [CAR, parked].map(|id| road.plant.placement(id).centre_m);
    let apart_m = (0..3)
        .map(|axis| (middles[1][axis] - middles[0][axis]).powi(2))
        .sum::<f64>()
        .sqrt();
    assert!((apart_m - sedan().length_m).abs() < 0.03, "{apart_m}");
    assert_eq!(road.plant.gap_m(CAR, parked), 0.0);
}

#[test]
fn a_fork_on_a_surface_continues_bit_for_bit_and_a_clear_ends_the_surface() {
    let grades = hill([0.1, -0.1]);
    let mut road = OnRoad::new(Course::straight(), profile(&grades, 60.0));
    road.spawn(-30.0, 18.0);
    (0..20).for_each(|_| road.go(-1.0, 0.001, true));
    let mut fork = road.plant.fork();
    for _ in 0..20 {
        road.plant.advance(SAMPLE_S, SUBSTEPS);
        fork.advance(SAMPLE_S, SUBSTEPS);
        assert_eq!(road.plant.state(CAR), fork.state(CAR));
    }
    road.plant.clear(Ground { friction: FRICTION });
    let id = road.plant.spawn(&sedan(), Pose::default(), 10.0);
    let mut fresh = Rigid::new(Ground { friction: FRICTION });
    fresh.spawn(&sedan(), Pose::default(), 10.0);
    road.plant.advance(SAMPLE_S, SUBSTEPS);
    fresh.advance(SAMPLE_S, SUBSTEPS);
    assert_eq!(road.plant.state(id), fresh.state(id));
}
