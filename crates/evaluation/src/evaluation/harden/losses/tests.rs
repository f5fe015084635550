//! Values of losses, of runs and of nothing.

use super::*;
use crate::trace::Signal;

#[test]
fn a_limit_is_a_value_a_share_of_the_ego_or_more_than_it() {
    let limit = |text: &str| DrivingLoss::parse(text).expect(text).limit;
    assert_eq!(limit("braking=0.3"), LossLimit::Below(0.3));
    assert_eq!(limit("braking=110%"), LossLimit::TimesOwn(1.1));
    assert_eq!(limit("false-braking=+0.05"), LossLimit::AboveOwn(0.05));
    assert_eq!(limit("max(0, ego.speed - 30)=0.1"), LossLimit::Below(0.1));
    let formula = DrivingLoss::parse("always (ego.speed >= 3)=0.2").expect("a formula");
    assert_eq!(formula.name, "always (ego.speed >= 3)");
    assert!(matches!(formula.measure, Measure::Violations(_)));
    for text in [
        "braking",
        "braking=",
        "braking=x",
        "braking=-5%",
        "x >= 3",
        "(=1",
    ] {
        DrivingLoss::parse(text).expect_err(text);
    }
    assert_eq!(LossLimit::TimesOwn(1.1).of(2.0), 2.2);
    assert_eq!(LossLimit::AboveOwn(0.5).of(2.0), 2.5);
}

#[test]
fn a_given_limit_replaces_the_usual_one_of_its_measure() {
    let given = ["braking=120%".to_owned(), "ego.speed=20".to_owned()];
    let all = DrivingLoss::with_given(&given).expect("limits");
    let names: Vec<&str> = all.iter().map(|loss| loss.name.as_str()).collect();
    assert_eq!(
        names,
        ["braking", "travel-time", "false-braking", "ego.speed"]
    );
    assert_eq!(all[0].limit, LossLimit::TimesOwn(1.2));
}

#[test]
fn the_interval_of_a_ratio_contains_it_and_is_a_point_without_noise() {
    let usual = DrivingLoss::usual();
    let own = [1.0, 2.0, 3.0, 4.0];
    let twice = own.map(|value| 2.0 * value);
    assert_eq!(usual[0].ratio_between(&twice, &own), Some([2.0, 2.0]));
    // Twice the speed is half the time.
    assert_eq!(usual[1].ratio_between(&twice, &own), Some([0.5, 0.5]));
    let [lo, hi] = usual[0]
        .ratio_between(&[2.0, 3.0, 7.0, 9.0], &own)
        .expect("it");
    assert!(lo < 2.1 && 2.1 < hi && hi - lo > 0.1, "{lo} {hi}");
    assert_eq!(usual[0].ratio_between(&own, &[0.0; 4]), None);
    assert_eq!(usual[1].value(&[10.0, 30.0]), Some(50.0));
}

#[test]
fn nothing_observed_is_no_value() {
    for loss in DrivingLoss::usual() {
        assert_eq!(loss.value(&[]), None, "{}", loss.name);
        assert_eq!(loss.ratio_between(&[], &[]), None, "{}", loss.name);
    }
    // An ego that never moves needs no finite time.
    assert_eq!(DrivingLoss::usual()[1].value(&[0.0, 0.0]), None);
    let schema = Schema::new(0.1, [Signal::real("ego.speed", "m/s", "speed")]);
    let mut trace = Trace::new(schema.expect("a schema").into());
    let formula: Formula = "always (ego.speed >= 3)".parse().expect("a formula");
    let speed: Expr = "ego.speed".parse().expect("an expression");
    let measures = [
        BoundMeasure::Braking,
        BoundMeasure::Speed,
        BoundMeasure::HardBraking,
        BoundMeasure::Mean(
            speed
                .bind(trace.schema(), &Default::default())
                .expect("bound"),
        ),
        BoundMeasure::Violations(Box::new(
            formula
                .bind(trace.schema(), &Default::default())
                .expect("bound"),
        )),
    ];
    let values = |trace: &Trace| measures.each_ref().map(|it| it.of(trace, 0));
    assert_eq!(values(&trace), [None; 5]);
    // Decelerations need two samples.
    trace.push(&[10.0]).expect("finite");
    assert_eq!(
        values(&trace),
        [None, Some(10.0), None, Some(10.0), Some(0.0)]
    );
    trace.push(&[9.0]).expect("finite");
    assert_eq!(values(&trace)[2], Some(1.0));
}

/// Driving of `acc` behind cars that hardly brake.
#[test]
fn a_nervous_ego_brakes_more_and_where_it_need_not() {
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    let world = world.on(crate::world::PlantKind::Kinematic);
    let text = include_str!("../../../../../../examples/traffic/acc.ron");
    let traffic = RiskTraffic::parse(&world, "acc.ron", text).expect("sound");
    let watch = Watch::unwatched();
    let losses = DrivingLoss::usual();
    let driving = NaturalDriving::new(&world, &traffic, &losses, 60, 1, &watch);
    let driving = driving.expect("it fits").expect("not stopped");
    let values = |change: &Change| {
        let ego = EgoUnderTest::changed(&world, "ego", change, "").expect("it fits");
        let runs = driving.measure(ego.scenario(), 0..60, &watch).expect("all");
        let runs: Vec<Vec<f64>> = runs.into_iter().flatten().collect();
        let of = |nth: usize| runs.iter().map(|run| run[nth]).collect::<Vec<f64>>();
        [0, 1, 2].map(|nth| losses[nth].value(&of(nth)).expect("runs"))
    };
    let own = values(&Change::default());
    let mut change = Change::default();
    change.ego.0.insert("kd_per_s".to_owned(), 6.0);
    change.ego.0.insert("time_gap_s".to_owned(), 2.5);
    let nervous = values(&change);
    assert!(own[0] > 0.0 && own[0] < nervous[0], "{own:?}, {nervous:?}");
    assert!(own[1] < nervous[1], "{own:?}, {nervous:?}");
    assert!(own[2] < nervous[2], "{own:?}, {nervous:?}");
    // Nothing is measured twice differently.
    assert_eq!(values(&Change::default()), own);
}
