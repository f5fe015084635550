//! Recorded situations as plans of world files.

use brakecheck_traffic::{
    Analysis, LANE_CHANGE_AT_S, LaneChangePlan, RecordedWorlds, RoadUserTrack, SituationKind,
    SpeedPlan,
};

use crate::situations::recorded;
use crate::synthetic;

/// Positions of a hard braking, with a recorder's noise of 2 cm.
fn positions() -> Vec<f64> {
    let mut draws = synthetic::Draws(7);
    let (mut s_m, mut speed_mps) = (100.0, 25.0);
    (0..=200)
        .map(|i| {
            let t = f64::from(i) * 0.05;
            let accel = -3.0 * (-(t - 4.0) * (t - 4.0)).exp();
            speed_mps += accel * 0.05;
            s_m += speed_mps * 0.05;
            s_m + 0.02 * draws.normal()
        })
        .collect()
}

#[test]
fn a_plan_stays_within_a_decimetre_of_the_positions() {
    let positions = positions();
    let plan = SpeedPlan::fit(&positions, 0.05).expect("ten seconds");
    assert_eq!(plan.to_mps.len(), 20);
    assert!(plan.worst_m < 0.1, "{}", plan.worst_m);
    assert!((plan.start_mps - 25.0).abs() < 0.2, "{}", plan.start_mps);
}

#[test]
fn integrated_speeds_would_miss_the_positions() {
    // Recorded speeds that are 0.3 % off, as those of the synthetic recorder.
    let positions = positions();
    let mut s_m = positions[0];
    let mut worst: f64 = 0.0;
    for pair in positions.windows(2) {
        s_m += 1.003 * (pair[1] - pair[0]);
        worst = worst.max((s_m - pair[1]).abs());
    }
    assert!(worst > 0.3, "{worst}");
}

/// Positions of a track in the recording's frame.
fn positions_of<'a>(analysis: &'a Analysis, id: &str) -> (&'a RoadUserTrack, Vec<[f64; 2]>) {
    let mut tracks = analysis.recording.tracks.iter();
    let track = tracks.find(|track| track.id == id).expect("a track");
    let places = track.x_m.iter().zip(&track.y_m);
    (track, places.map(|(x, y)| [*x, *y]).collect())
}

#[test]
fn followings_are_the_hardest_windows_first_and_stay_near_their_positions() {
    let (rows, _) = synthetic::traffic(21, 25, 60.0);
    let analyses = [Analysis::of(recorded(&rows))];
    let recorded = RecordedWorlds::of("follow", SituationKind::Following, &analyses, 24);
    assert_eq!(recorded.situations().count(), 24);
    assert_eq!(
        recorded.found,
        analyses[0].situations.windows(&analyses[0].recording).len()
    );
    let hardest = recorded.situations().map(|it| it.hardness);
    assert!(hardest.fold(0.0, f64::max) > 1.0);
    for world in &recorded.worlds {
        let hardness: Vec<f64> = world.situations.iter().map(|it| it.hardness).collect();
        assert!(hardness.is_sorted_by(|a, b| b <= a), "{hardness:?}");
        // The same body in all points.
        let bodies = world.situations.iter().map(|it| it.body);
        assert!(bodies.clone().all(|it| Some(it) == bodies.clone().next()));
    }
    for situation in recorded.situations() {
        let plan = &situation.speed;
        assert!(plan.worst_m < 0.1, "{} m", plan.worst_m);
        assert_eq!(plan.to_mps.len(), 20);
        let (track, places) = positions_of(&analyses[0], &situation.planned);
        let start = (situation.time_s / 0.05).round() as usize - track.first_sample;
        // Along the lead's own path, which in a bend is not as long as the right lane.
        let (mut way_m, mut worst): (f64, f64) = (0.0, 0.0);
        for i in (10..200).step_by(10) {
            let [a, b] = [places[start + i - 10], places[start + i]];
            way_m += (b[0] - a[0]).hypot(b[1] - a[1]);
            let time_s = i as f64 * 0.05;
            worst = worst.max((plan.position_m(time_s) - plan.start_m - way_m).abs());
        }
        // The first position may be off by as much as any other.
        assert!(worst < 0.12, "{}: {worst} m", situation.planned);
    }
}

#[test]
fn cut_ins_have_the_begin_the_duration_and_the_width_that_were_simulated() {
    let (rows, made) = synthetic::traffic(3, 25, 90.0);
    let analyses = [Analysis::of(recorded(&rows))];
    let recorded = RecordedWorlds::of("cut", SituationKind::CutIn, &analyses, 100);
    let planned = recorded.situations().count();
    assert!(planned >= 10 && planned <= made, "{planned} of {made}");
    assert_eq!(recorded.found, planned + recorded.left_out);
    let mut first = rows.first().map_or(0, |row| row.sample) as f64;
    first *= 0.05;
    for situation in recorded.situations() {
        let across = situation.across.expect("a lane change");
        let change = across.change;
        assert!(situation.is_from_left());
        assert!((change.duration_s - 4.0).abs() < 0.2, "{change:?}");
        assert!(
            (change.from_m - change.to_m - 3.75).abs() < 0.1,
            "{change:?}"
        );
        assert!(
            across.worst_m < 0.1 && across.ego_m.abs() < 0.1,
            "{across:?}"
        );
        assert!(situation.speed.worst_m < 0.1);
        // Changes begin every 2 s, and the plan's rear axle is less than 0.1 s later.
        let begins_s = first + situation.time_s + LANE_CHANGE_AT_S;
        let off_s = begins_s - 2.0 * (begins_s / 2.0).round();
        assert!((-0.1..0.2).contains(&off_s), "{begins_s}");
    }
}

#[test]
fn a_lane_change_is_fitted_although_the_vehicle_sways() {
    let lateral_m: Vec<f64> = (0..300)
        .map(|i| {
            let t = f64::from(i) * 0.05;
            let share = ((t - 5.0) / 6.0).clamp(0.0, 1.0);
            3.6 - 1.7 * (1.0 - (std::f64::consts::PI * share).cos()) + 0.05 * (2.0 * t).sin()
        })
        .collect();
    let plan = LaneChangePlan::fit(&lateral_m, 160, 0.05).expect("a change");
    assert!(
        (plan.first_sample as f64 * 0.05 - 5.0).abs() < 0.3,
        "{plan:?}"
    );
    assert!((plan.duration_s - 6.0).abs() < 0.5, "{plan:?}");
    assert!((plan.from_m - 3.6).abs() < 0.05 && (plan.to_m - 0.2).abs() < 0.05);
    // Too short for any change.
    assert_eq!(LaneChangePlan::fit(&lateral_m[..10], 5, 0.05), None);
}

#[test]
fn a_standing_lead_has_rates_that_world_files_accept() {
    let standing = vec![7.0; 201];
    let plan = SpeedPlan::fit(&standing, 0.05).expect("ten seconds");
    let rates = plan.rates_mps2();
    assert!(rates.iter().all(|rate| *rate >= 1e-3), "{rates:?}");
    assert!(
        plan.to_mps.iter().all(|to| (0.0..0.01).contains(to)),
        "{plan:?}"
    );
    assert!(plan.worst_m < 0.01, "{}", plan.worst_m);
}
