//! Driving of an ado: its cut-ins, accelerations and start.

use brakecheck::trace::Trace;
use brakecheck::world::Scenario;
use brakecheck_scene::natural::behaviour::behaviours;
use brakecheck_scene::natural::{SuccessRarity, motorway};
use brakecheck_traffic::{CUT_IN_GAP_M, CutInState, DrivingBehaviour};

/// Driving of an ado beside an ego, which both move between two lanes in 2 s.
struct Passage {
    ego_lanes: [usize; 2],
    ado_lanes: [usize; 2],
    /// Distance of the ado's front from the ego's front, which stays.
    ahead_m: f64,
    /// Distance of the ado from the middle of its lane, to the left.
    aside_m: f64,
    /// Speeds that the signals state, of the ego and of the ado at each sample.
    ego_mps: f64,
    ado_mps: fn(u32) -> f64,
}

impl Passage {
    fn of_lanes(ego_lanes: [usize; 2], ado_lanes: [usize; 2]) -> Passage {
        Passage {
            ego_lanes,
            ado_lanes,
            ahead_m: 20.0,
            aside_m: 0.0,
            ego_mps: 20.0,
            ado_mps: |_| 20.0,
        }
    }

    /// Returns the driving of the ado over some samples, with the lengths of ego and ado.
    fn driven(&self, samples: usize) -> (Option<DrivingBehaviour>, [f64; 2]) {
        let world = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let driving = world.drive().expect("a road").world();
        let road = &driving.spec().road;
        let bench = world.bench();
        let mut trace = Trace::new(std::sync::Arc::clone(bench.schema()));
        let column = |name: &str| bench.schema().position(name).expect("published");
        for sample in 0..SAMPLES {
            let mut row = vec![0.0; bench.schema().len()];
            let share = f64::from(sample) / f64::from(SAMPLES - 1);
            let ado_m = [self.ahead_m, self.aside_m];
            for (name, [ahead_m, aside_m], [from, to], speed_mps) in [
                ("ego", [0.0; 2], self.ego_lanes, self.ego_mps),
                ("ado", ado_m, self.ado_lanes, (self.ado_mps)(sample)),
            ] {
                let [from_m, to_m] = [from, to].map(|lane| road.lane_middle_m(lane));
                row[column(&format!("{name}.x"))] = ahead_m + f64::from(sample);
                row[column(&format!("{name}.y"))] = from_m + share * (to_m - from_m) + aside_m;
                row[column(&format!("{name}.speed"))] = speed_mps;
            }
            trace.push(&row).expect("finite");
        }
        let agents = &driving.spec().agents;
        let length_m = |name: &str| {
            let agent = agents.iter().find(|it| it.name == name).expect("an agent");
            agent.body.length_m
        };
        let mut all = behaviours(driving, &trace, samples).into_iter();
        let found = all.find(|(name, _)| name == "ado").map(|(_, it)| it);
        (found, ["ego", "ado"].map(length_m))
    }

    fn cut_ins(&self) -> Vec<CutInState> {
        self.driven(SAMPLES as usize).0.expect("it").cut_ins
    }
}

const SAMPLES: u32 = 40;

#[test]
fn only_the_ado_s_own_change_of_lane_is_a_cut_in() {
    let found = Passage::of_lanes([0, 0], [1, 0]).cut_ins();
    assert_eq!(found.len(), 1, "{found:?}");
    // The ego changes into the lane of the ado.
    assert_eq!(Passage::of_lanes([1, 0], [0, 0]).cut_ins(), []);
    assert_eq!(Passage::of_lanes([0, 0], [0, 1]).cut_ins(), []);
}

#[test]
fn a_cut_in_has_the_clearance_the_closing_and_the_sideways_speed() {
    let passage = Passage {
        ado_mps: |_| 17.5,
        ..Passage::of_lanes([0, 0], [1, 0])
    };
    let (driven, [ego_m, ado_m]) = passage.driven(SAMPLES as usize);
    let cut_in = driven.expect("it").cut_ins[0];
    assert!((cut_in.gap_m - (20.0 - ado_m)).abs() < 1e-9, "{cut_in:?}");
    assert!((cut_in.closing_mps - 2.5).abs() < 1e-9, "{cut_in:?}");
    // A lane of 3.5 m in 39 samples of 0.05 s.
    let aside_mps = 3.5 / (39.0 * 0.05);
    assert!(
        (cut_in.lateral_mps + aside_mps).abs() < 1e-6,
        "from the left lane to the right: {cut_in:?}"
    );
    let at = |ahead_m: f64| {
        let passage = Passage {
            ahead_m,
            ..Passage::of_lanes([0, 0], [1, 0])
        };
        let gaps = passage.cut_ins().into_iter().map(|it| it.gap_m);
        gaps.collect::<Vec<f64>>()
    };
    // Alongside there is no clearance, and behind the ego nobody is cut in on.
    assert_eq!(at(-0.5 * ego_m), [0.0]);
    assert_eq!(at(-ego_m - 0.1), [0.0; 0]);
    assert_eq!(at(CUT_IN_GAP_M + ado_m - 0.1).len(), 1);
    assert_eq!(at(CUT_IN_GAP_M + ado_m + 0.1), [0.0; 0]);
}

#[test]
fn accelerations_are_means_over_half_a_second() {
    // Braking with 4 m/s² from the tenth sample on, which is half a second.
    let passage = Passage {
        ado_mps: |sample| 30.0 - 0.2 * f64::from(sample.saturating_sub(10)),
        ..Passage::of_lanes([0, 0], [0, 0])
    };
    let driven = |samples| passage.driven(samples).0;
    let all = driven(SAMPLES as usize).expect("it");
    assert_eq!((all.speed_mps, all.decision_s), (30.0, 0.5));
    let rounded = |it: &DrivingBehaviour| {
        let all = it.accelerations_mps2.iter();
        all.map(|it| (it * 1e6).round() / 1e6).collect::<Vec<f64>>()
    };
    assert_eq!(rounded(&all), [0.0, -4.0, -4.0]);
    assert_eq!(rounded(&driven(21).expect("it")), [0.0, -4.0]);
    assert_eq!(rounded(&driven(20).expect("it")), [0.0]);
    // More samples than were recorded.
    assert_eq!(driven(SAMPLES as usize + 1), None);
}

#[test]
fn a_start_is_that_of_an_ego_behind_the_ado_in_its_lane() {
    let start = |ahead_m: f64, ado_lane: usize| {
        let passage = Passage {
            ahead_m,
            ado_mps: |_| 15.0,
            ..Passage::of_lanes([0, 0], [ado_lane; 2])
        };
        let (driven, [_, ado_m]) = passage.driven(SAMPLES as usize);
        (driven.expect("it").start, ado_m)
    };
    let (found, ado_m) = start(20.0, 0);
    let found = found.expect("behind it");
    assert_eq!((found.speed_mps, found.closing_mps), (20.0, 5.0));
    assert!((found.gap_m - (20.0 - ado_m)).abs() < 1e-9, "{found:?}");
    for (ahead_m, lane) in [(20.0, 1), (ado_m - 0.1, 0), (-20.0, 0)] {
        assert_eq!(start(ahead_m, lane).0, None, "{ahead_m} m, lane {lane}");
    }
}

/// Driving of the two ados of `sandwich`, of which one brakes with 3 m/s².
#[test]
fn an_episode_is_as_rare_as_its_rarest_ado() {
    let world = Scenario::shipped("sandwich")
        .expect("shipped")
        .expect("sound");
    let driving = world.drive().expect("a road").world();
    let bench = world.bench();
    for braking in ["lead", "tail"] {
        let mut trace = Trace::new(std::sync::Arc::clone(bench.schema()));
        let column = |name: &str| bench.schema().position(name).expect("published");
        for sample in 0..SAMPLES {
            let mut row = vec![0.0; bench.schema().len()];
            for (name, ahead_m) in [("lead", 30.0), ("ego", 0.0), ("tail", -30.0)] {
                let lost_mps = if name == braking {
                    0.15 * f64::from(sample)
                } else {
                    0.0
                };
                row[column(&format!("{name}.x"))] = ahead_m + f64::from(sample);
                row[column(&format!("{name}.speed"))] = 30.0 - lost_mps;
            }
            trace.push(&row).expect("finite");
        }
        let found = SuccessRarity::of(&motorway(), driving, &trace, SAMPLES as usize);
        let known = found.expect("two vehicles").naturalness(&motorway());
        assert_eq!(known.ado, braking, "{known}");
        assert!(known.per_1000_km.is_some(), "{known}");
    }
}

/// The line between two lanes is in neither of them.
#[test]
fn an_ado_on_the_line_is_not_in_the_lane_of_the_ego() {
    let starts = [1.74, 1.75, 1.76, -1.74, -1.75].map(|aside_m| {
        let passage = Passage {
            aside_m,
            ..Passage::of_lanes([0, 0], [0, 0])
        };
        let (driven, _) = passage.driven(SAMPLES as usize);
        driven.expect("it").start.is_some()
    });
    assert_eq!(starts, [true, false, false, true, false]);
}
