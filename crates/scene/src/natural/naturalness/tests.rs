use super::*;
use crate::natural::motorway;

/// Rarity of an ado that brakes for a second.
fn braking(decelerations_mps2: f64, speed_mps: f64) -> SuccessRarity {
    let behaviour = DrivingBehaviour {
        speed_mps,
        decision_s: 0.5,
        accelerations_mps2: vec![0.0, -decelerations_mps2, -decelerations_mps2, 0.0, 0.0],
        ..DrivingBehaviour::default()
    };
    SuccessRarity {
        ado: format!("ado {decelerations_mps2}"),
        rarity: motorway().rarity(&behaviour),
        behaviour,
    }
}

#[test]
fn the_median_of_some_successes_is_the_rarer_one_in_the_middle() {
    let model = motorway();
    let all = [1.0, 2.5, 1.5, 2.0].map(|it| braking(it, 30.0));
    assert!(all[1].rate() < all[3].rate() && all[3].rate() < all[2].rate());
    let row = |successes: &[&SuccessRarity]| NaturalnessOfRow::of(&model, Some(20.0), successes);
    let median = |successes: &[&SuccessRarity]| row(successes).median.map(|it| it.ado);
    let [a, b, c, d] = &all;
    assert_eq!(median(&[]), None);
    assert_eq!(median(&[a]).as_deref(), Some("ado 1"));
    assert_eq!(median(&[a, b]).as_deref(), Some("ado 2.5"));
    assert_eq!(median(&[a, b, c]).as_deref(), Some("ado 1.5"));
    assert_eq!(median(&[a, b, c, d]).as_deref(), Some("ado 2"));
    let whole = row(&[a, b, c]);
    assert_eq!((whole.successes, whole.outside_data), (3, 0));
    assert_eq!(whole.limit_per_1000_km, Some(20.0));
    // No recorded vehicle was so fast.
    let fast = braking(2.0, 500.0);
    assert_eq!(row(&[a, &fast, &fast]).outside_data, 2);
}

#[test]
fn a_drive_without_an_event_is_the_least_rare() {
    let model = motorway();
    let calm = braking(0.0, 30.0);
    assert_eq!(calm.rate(), f64::INFINITY);
    let hard = braking(2.5, 30.0);
    let rated = hard.naturalness(&model);
    assert_eq!(rated.per_1000_km, Some(hard.rate()));
    assert_eq!(
        (rated.model, rated.ado.as_str()),
        (model.name.clone(), "ado 2.5")
    );
    assert!(rated.rarest.is_some() && rated.surprise_decades.is_some());
    let rated = calm.naturalness(&model);
    assert_eq!((rated.rarest, rated.per_1000_km), (None, None));
}

#[test]
fn the_surprise_grows_with_the_braking_and_is_that_of_the_median() {
    let model = motorway();
    let [soft, hard] = [0.5, 2.5].map(|it| braking(it, 30.0));
    let decades = |it: &SuccessRarity| it.naturalness(&model).surprise_decades;
    assert!(decades(&soft).expect("data") + 1.0 < decades(&hard).expect("data"));
    let row = NaturalnessOfRow::of(&model, None, &[&hard]);
    let median = row.median.expect("a success");
    assert_eq!(median.surprise_decades, decades(&hard));
}

#[test]
fn quantities_without_data_are_named_with_their_values() {
    let model = motorway();
    let words = |outside: Outside| outside_words(&outside, &model);
    assert!(words(Outside::Speed(60.0)).starts_with("a speed of 60.0 m/s, and it covers"));
    let braked = words(Outside::Acceleration(-9.0));
    assert!(braked.starts_with("an acceleration of -9.0 m/s², and it covers -"));
    let aside = words(Outside::LateralSpeed(5.0));
    assert!(aside.starts_with("a cut-in with 5.0 m/s to the side, and it covers"));
    let fast = braking(2.0, 500.0).naturalness(&model);
    // Outside the data there is no answer.
    assert_eq!(
        (fast.rarest, fast.per_1000_km, fast.surprise_decades),
        (None, None, None)
    );
    assert!(
        fast.outside
            .iter()
            .any(|it| it.starts_with("a speed of 500.0 m/s"))
    );
}

#[test]
fn a_line_states_the_rarest_event_and_the_direction_of_the_surprise() {
    let known = Naturalness {
        model: "roads".to_owned(),
        ado: "lead".to_owned(),
        rarest: Some("an event".to_owned()),
        per_1000_km: Some(2.0),
        surprise_decades: Some(1.5),
        outside: Vec::new(),
    };
    assert_eq!(
        known.to_string(),
        "among the drivers of `roads`, an event; 1.5 decades less likely than the median drive"
    );
    let calm = Naturalness {
        rarest: None,
        surprise_decades: Some(-0.5),
        ..known.clone()
    };
    assert_eq!(
        calm.to_string(),
        "`lead` neither brakes hard nor cuts in (drivers of `roads`); 0.5 decades more likely \
         than the median drive"
    );
    let outside = Naturalness {
        outside: vec!["one".to_owned(), "two".to_owned()],
        ..known.clone()
    };
    assert_eq!(
        outside.to_string(),
        "rarity among the drivers of `roads`: no answer: outside the data: one, two"
    );
    let row = |successes, outside_data, median| NaturalnessOfRow {
        limit_per_1000_km: None,
        successes,
        outside_data,
        median,
    };
    let half = format!("in half of 2 successes at least as rare as: {known}");
    assert_eq!(row(2, 0, Some(known.clone())).to_string(), half);
    let some = row(3, 1, Some(known));
    assert_eq!(
        some.to_string(),
        format!("{half}; 1 successes are outside the data")
    );
    assert_eq!(row(0, 0, None).to_string(), "no success");
    let none = "no answer; 2 successes are outside the data";
    assert_eq!(row(2, 2, None).to_string(), none);
}
