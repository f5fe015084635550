//! Naturalness models, the rarity of behaviours, and the mask.

use std::sync::LazyLock;

use brakecheck_traffic::{
    Analysis, CutInState, DrivingBehaviour, MotionMeter, NaturalLimit, Outside, RateSource,
    SourceFile, StartState, TrafficModel, fit_traffic, start_table,
};

use crate::situations::recorded;
use crate::synthetic;

/// Model of synthetic traffic.
static FITTED: LazyLock<TrafficModel> = LazyLock::new(|| {
    let analyses: Vec<Analysis> = (10..13)
        .map(|seed| Analysis::of(recorded(&synthetic::traffic(seed, 25, 90.0).0)))
        .collect();
    let source = SourceFile {
        name: "synthetic".to_owned(),
        sha256: None,
    };
    fit_traffic("synthetic", vec![source], &analyses).unwrap_or_else(|it| panic!("{it}"))
});

/// Braking by `accel_mps2` for a number of decisions from 30 m/s.
fn braking(accel_mps2: f64, decisions: usize) -> DrivingBehaviour {
    let mut accelerations_mps2 = vec![0.0; 2];
    accelerations_mps2.extend(vec![accel_mps2; decisions]);
    accelerations_mps2.push(0.0);
    DrivingBehaviour {
        speed_mps: 30.0,
        decision_s: 0.5,
        accelerations_mps2,
        ..DrivingBehaviour::default()
    }
}

#[test]
fn counts_and_exposure_are_those_of_the_recordings() {
    let model = &*FITTED;
    assert!(model.exposure.vehicle_km > 100.0, "{:?}", model.exposure);
    let counted = f64::from(model.braking_peak.points[0].count);
    assert_eq!(counted, model.exposure.braking_events as f64);
    let rate = model.braking_peak.rate_of(1.0).rate;
    assert!((rate - 1000.0 * counted / model.exposure.vehicle_km).abs() < 1e-6 * rate);
    assert!((model.supported_per_1000_km() - 3000.0 / model.exposure.vehicle_km).abs() < 1e-9);
}

#[test]
fn shares_of_starts_are_those_of_a_count_by_hand() {
    let analysis = Analysis::of(recorded(&synthetic::traffic(14, 15, 40.0).0));
    let table = start_table(std::slice::from_ref(&analysis));
    let (mut all, mut tight) = (0, 0);
    for (track, leads) in analysis.recording.tracks.iter().zip(&analysis.leads.of) {
        for (lead, speed_mps) in leads.iter().zip(&track.speed_mps) {
            let Some(lead) = lead.filter(|it| it.gap_m >= 0.0) else {
                continue;
            };
            all += 1;
            tight += usize::from(lead.gap_m <= 2.0 * speed_mps && lead.closing_mps >= 1.0);
        }
    }
    assert!(tight > 50 && tight < all / 3, "{tight} of {all}");
    let start = StartState {
        speed_mps: 30.0,
        gap_m: 60.0,
        closing_mps: 1.0,
    };
    let share = table.rarity_of(&start).share;
    assert!((share - tight as f64 / all as f64).abs() < 1e-12, "{share}");
    // Closing faster, or nearer, is rarer.
    let tighter = StartState {
        gap_m: 40.0,
        ..start
    };
    assert!(table.rarity_of(&tighter).share < share);
}

#[test]
fn a_model_survives_its_file() {
    let text = FITTED.to_ron();
    let back = TrafficModel::parse(&text).unwrap_or_else(|it| panic!("{it}"));
    assert_eq!(back, *FITTED);
}

#[test]
fn one_half_of_the_vehicles_predicts_the_other() {
    let rows = &FITTED.calibration;
    let halves = rows
        .iter()
        .filter(|row| row.tested_on.contains("half of the vehicles"));
    let (mut judged, mut refused) = (0, 0);
    for row in halves.filter(|row| row.events >= 20) {
        if row.quantity.starts_with("worst") {
            // The simulated drivers brake for a lead for seconds. The family of the model
            // has no lead, and the calibration must show it.
            assert!(row.ratio() < 0.5, "{row}");
            assert!(
                row.to_string().contains("off by more than a factor of two"),
                "{row}"
            );
            refused += 1;
        } else {
            assert!((0.5..=2.0).contains(&row.ratio()), "{row}");
            judged += 1;
        }
    }
    assert_eq!((judged, refused), (6, 2), "{rows:#?}");
}

#[test]
fn the_shipped_model_has_the_published_rates() {
    let model = TrafficModel::motorway();
    for (size, least, most) in [
        (2.0, 16.0, 45.0),
        (3.0, 2.8, 9.0),
        (4.0, 0.6, 3.7),
        (6.0, 0.06, 1.1),
    ] {
        let rate = model.braking_peak.rate_of(size).rate;
        assert!((least..=most).contains(&rate), "{size} m/s²: {rate}");
    }
    let need = model.cut_in_need.as_ref().expect("cut-ins");
    assert!((0.03..0.07).contains(&need.rate_of(0.3).rate));
    assert!(need.rate_of(2.0).rate < 2e-3);
    assert!((2.0..3.5).contains(&model.supported_per_1000_km()));
}

#[test]
fn a_harder_or_longer_braking_is_rarer() {
    let model = TrafficModel::motorway();
    let rate = |behaviour: &DrivingBehaviour| {
        let rarity = model.rarity(behaviour);
        rarity
            .rarest()
            .map_or(f64::INFINITY, |it| it.per_1000_km.rate)
    };
    assert_eq!(rate(&braking(-0.5, 6)), f64::INFINITY);
    let rates = [-1.5, -2.0, -3.0, -4.0, -6.0, -8.0].map(|it| rate(&braking(it, 3)));
    assert!(rates.windows(2).all(|it| it[1] < it[0]), "{rates:?}");
    let rates = [2, 4, 6, 10, 14].map(|it| rate(&braking(-2.0, it)));
    assert!(rates.windows(2).all(|it| it[1] <= it[0]), "{rates:?}");
    assert!(rates[4] < 0.5 * rates[0], "{rates:?}");
}

#[test]
fn the_source_of_a_rate_is_named() {
    let model = TrafficModel::motorway();
    let source = |accel| {
        let rarity = model.rarity(&braking(accel, 3));
        let braking = *rarity
            .events
            .iter()
            .find(|it| it.to_string().starts_with("braking of"))
            .expect("an event");
        (braking.per_1000_km.source, braking.to_string())
    };
    assert_eq!(source(-2.0).0, RateSource::Counted);
    let (unseen, text) = source(-6.0);
    assert_eq!(unseen, RateSource::NeverSeen);
    assert!(
        text.starts_with("braking of 6.0 m/s² for 2.0 s: 0."),
        "{text}"
    );
    assert!(
        text.contains("extrapolated") && text.contains("never seen: below 2.7"),
        "{text}"
    );
}

#[test]
fn half_of_the_decision_time_gives_the_same_event() {
    let model = TrafficModel::motorway();
    let coarse = braking(-3.0, 4);
    let mut fine = coarse.clone();
    fine.decision_s = 0.25;
    fine.accelerations_mps2 = coarse
        .accelerations_mps2
        .iter()
        .flat_map(|it| [*it, *it])
        .collect();
    assert_eq!(model.rarity(&fine).events, model.rarity(&coarse).events);
}

#[test]
fn a_cut_in_is_rated_by_what_its_follower_needs() {
    let model = TrafficModel::motorway();
    let behaviour = |gap_m: f64, closing_mps: f64| DrivingBehaviour {
        cut_ins: vec![CutInState {
            gap_m,
            closing_mps,
            lateral_mps: 1.0,
        }],
        ..braking(0.0, 2)
    };
    let rate = |gap_m, closing_mps| {
        let rarity = model.rarity(&behaviour(gap_m, closing_mps));
        rarity
            .rarest()
            .map(|it| it.per_1000_km.rate)
            .expect("a cut-in")
    };
    // 8² / (2 · 10) = 3.2 m/s², 2² / (2 · 50) = 0.04 m/s².
    assert!(rate(10.0, 8.0) < 1.0);
    let all = model.exposure.cut_ins_per_1000_km();
    assert!((rate(50.0, 2.0) - all).abs() < 1e-9);
    assert!((rate(10.0, -2.0) - all).abs() < 1e-9);
    let wild = DrivingBehaviour {
        cut_ins: vec![CutInState {
            gap_m: 50.0,
            closing_mps: 0.0,
            lateral_mps: 3.0,
        }],
        ..braking(0.0, 2)
    };
    assert_eq!(model.rarity(&wild).outside, [Outside::LateralSpeed(3.0)]);
}

#[test]
fn a_start_outside_of_the_data_is_named() {
    let model = TrafficModel::motorway();
    let start = |speed_mps: f64, gap_m: f64, closing_mps: f64| {
        let behaviour = DrivingBehaviour {
            start: Some(StartState {
                speed_mps,
                gap_m,
                closing_mps,
            }),
            ..braking(0.0, 4)
        };
        model.rarity(&behaviour)
    };
    let slow = start(3.0, 20.0, 0.0);
    assert_eq!(slow.outside, [Outside::Speed(3.0)]);
    let usual = start(30.0, 60.0, 0.0);
    assert_eq!(usual.outside, []);
    let share = usual.start.expect("a start").share;
    assert!((0.1..=1.0).contains(&share), "{share}");
    let tight = start(30.0, 7.0, 14.0).start.expect("a start");
    assert!(tight.share < 1e-4, "{tight:?}");
    assert!(start(30.0, 30.0, 0.0).start.expect("a start").share < share);
}

#[test]
fn a_coarse_step_is_surprising_and_a_median_run_is_not() {
    let model = TrafficModel::motorway();
    let surprise = |it: &DrivingBehaviour| model.surprise(it).expect("decisions");
    let jump = surprise(&braking(-3.0, 4));
    assert!(jump.decades > 5.0 && jump.rank < 1e-3, "{jump:?}");
    let calm = surprise(&braking(0.02, 4));
    assert!(calm.decades < 1.0 && calm.rank > 0.5, "{calm:?}");
    assert_eq!(model.surprise(&DrivingBehaviour::default()), None);
}

/// Brakes as hard as a limit allows, with actions in steps of 0.25 m/s².
fn hardest(limit: &NaturalLimit<'_>, decisions: usize) -> DrivingBehaviour {
    let mut meter = MotionMeter::new(30.0);
    let mut behaviour = braking(0.0, 0);
    for accel in behaviour.accelerations_mps2.drain(..) {
        meter.push(accel);
    }
    behaviour.accelerations_mps2 = vec![0.0; 3];
    for _ in 0..decisions {
        let mut actions = (0..=32).map(|i| -8.0 + 0.25 * f64::from(i));
        let action = actions
            .find(|it| limit.allows_acceleration(&meter, *it))
            .expect("keeping the speed is allowed");
        meter.push(action);
        behaviour.accelerations_mps2.push(action);
    }
    behaviour
}

#[test]
fn the_mask_keeps_every_event_at_least_as_frequent_as_the_limit() {
    let model = TrafficModel::motorway();
    let mut losses = Vec::new();
    for per_1000_km in [0.1, 1.0, 3.0, 10.0, 30.0] {
        let limit = NaturalLimit::new(&model, per_1000_km);
        let behaviour = hardest(&limit, 20);
        let rarity = model.rarity(&behaviour);
        let rarest = rarity.rarest().expect("it brakes").per_1000_km.rate;
        assert!(per_1000_km <= rarest, "{per_1000_km}: {rarest}");
        assert_eq!(limit.is_extrapolated(), per_1000_km < 2.6);
        let hardest = behaviour
            .accelerations_mps2
            .iter()
            .copied()
            .fold(0.0, f64::min);
        assert!(hardest < -1.0, "{per_1000_km}: {hardest}");
        losses.push(-0.5 * behaviour.accelerations_mps2.iter().sum::<f64>());
    }
    assert!(losses.windows(2).all(|it| it[1] < it[0]), "{losses:?}");
}

#[test]
fn the_mask_limits_cut_ins_and_starts() {
    let model = TrafficModel::motorway();
    let limit = NaturalLimit::new(&model, 3.0);
    let state = |gap_m, closing_mps| CutInState {
        gap_m,
        closing_mps,
        lateral_mps: 1.0,
    };
    assert!(limit.allows_cut_in(&state(40.0, 2.0)));
    assert!(!limit.allows_cut_in(&state(10.0, 8.0)));
    let start = |gap_m, closing_mps| StartState {
        speed_mps: 30.0,
        gap_m,
        closing_mps,
    };
    assert!(limit.allows_start(&start(60.0, 0.0), 1000.0));
    assert!(!limit.allows_start(&start(7.0, 14.0), 1000.0));
}
