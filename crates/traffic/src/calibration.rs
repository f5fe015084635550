//! Predictions of one part of the data for the other.

use brakecheck_driver_model::{AccelerationModel, BRAKING_MPS2, CalibrationRow, Pareto};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::driving_data::{CUT_IN_MPS2, DrivingData, VehicleData};

/// Deceleration whose frequency is predicted, in m/s².
const HARD_MPS2: f64 = 2.0;
/// Decisions of the longer horizon.
const FIVE_S: usize = 10;

/// Fits one half of the vehicles, or one direction, and predicts the other.
pub(crate) fn calibrate(data: &DrivingData) -> Vec<CalibrationRow> {
    let vehicles = &data.vehicles;
    // Every other vehicle, since the first half of a recording may have other traffic.
    let is_even = |i: usize| i.is_multiple_of(2);
    let is_main = |i: usize| vehicles[i].carriageway == 0;
    let splits: [(&str, &dyn Fn(usize) -> bool); 4] = [
        ("second half of the vehicles", &is_even),
        ("first half of the vehicles", &|i| !is_even(i)),
        ("other carriageways", &is_main),
        ("first carriageway", &|i| !is_main(i)),
    ];
    let mut rows = Vec::new();
    for (tested_on, is_fitted) in splits {
        let (fitted, tested): (Vec<usize>, Vec<usize>) =
            (0..vehicles.len()).partition(|i| is_fitted(*i));
        let of = |all: Vec<usize>| -> Vec<&VehicleData> {
            all.into_iter().map(|i| &vehicles[i]).collect()
        };
        let (fitted, tested) = (of(fitted), of(tested));
        let mut add = |quantity: &str, predicted: f64, observed: f64, events: usize| {
            rows.push(CalibrationRow {
                tested_on: tested_on.to_owned(),
                quantity: quantity.to_owned(),
                predicted,
                observed,
                events,
            });
        };
        predict_driver(&fitted, &tested, &mut add);
        predict_events(&fitted, &tested, &mut add);
    }
    rows
}

type Add<'a> = &'a mut dyn FnMut(&str, f64, f64, usize);

fn predict_driver(fitted: &[&VehicleData], tested: &[&VehicleData], add: Add<'_>) {
    let series = |it: &[&VehicleData]| -> Vec<Vec<f64>> {
        it.iter().flat_map(|it| it.accelerations()).collect()
    };
    let tested = series(tested);
    // A half with too few rows has no prediction, and no row of the table.
    let Some(driver) = AccelerationModel::fit(&series(fitted)) else {
        return;
    };
    // A fixed seed: equal recordings give an equal table.
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for (quantity, decisions, rollouts) in [
        ("1 s mean of the next second at or below −2 m/s²", 2, 10),
        ("worst 1 s mean of 5 s at or below −2 m/s²", FIVE_S, 2),
    ] {
        let (mut starts, mut seen, mut hits, mut stretches) = (0_usize, 0_usize, 0_usize, 0);
        for series in &tested {
            let before = seen;
            // Every decision is a start, so the windows overlap.
            for at in 2..=series.len().saturating_sub(decisions) {
                starts += 1;
                seen += usize::from(is_hard(&series[at..at + decisions]));
                let last = [series[at - 2], series[at - 1]];
                for _ in 0..rollouts {
                    hits += usize::from(is_hard(&rollout(&driver, last, decisions, &mut rng)));
                }
            }
            // Overlapping windows of one stretch are one event and no
            // independent evidence.
            stretches += usize::from(before < seen);
        }
        let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
        add(
            quantity,
            share(hits, starts * rollouts),
            share(seen, starts),
            stretches,
        );
    }
}

fn is_hard(accelerations: &[f64]) -> bool {
    let mean = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
    accelerations.windows(2).any(|it| mean(it) <= -HARD_MPS2)
}

fn rollout(
    driver: &AccelerationModel,
    mut before: [f64; 2],
    decisions: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<f64> {
    (0..decisions)
        .map(|_| {
            let next = driver.next(before, rng);
            before = [before[1], next];
            next
        })
        .collect()
}

fn predict_events(fitted: &[&VehicleData], tested: &[&VehicleData], add: Add<'_>) {
    let peaks = |it: &[&VehicleData]| -> Vec<f64> { it.iter().flat_map(|it| it.peaks()).collect() };
    let exposure = |it: &[&VehicleData]| it.iter().map(|it| it.thousand_km()).sum::<f64>();
    let excess = |values: &[f64], from: f64| -> Vec<f64> {
        // The Pareto law describes the part beyond the threshold only.
        let above = values.iter().filter(|it| from <= **it);
        above.map(|it| it - from).collect()
    };
    let threshold = BRAKING_MPS2;
    let (from, to) = (peaks(fitted), peaks(tested));
    if let Some(pareto) = Pareto::fit(&excess(&from, threshold)) {
        for size in [2.0, 3.0] {
            let rate = from.len() as f64 / exposure(fitted);
            let events = to.iter().filter(|it| size <= **it).count();
            let quantity = format!("braking events of {size} m/s² per 1,000 km");
            let predicted = rate * pareto.beyond(size - threshold);
            add(
                &quantity,
                predicted,
                events as f64 / exposure(tested),
                events,
            );
        }
    }
    let needs = |it: &[&VehicleData]| -> Vec<f64> {
        it.iter()
            .flat_map(|it| it.cut_ins.iter().copied())
            .collect()
    };
    let (from, to) = (needs(fitted), needs(tested));
    let above = excess(&from, CUT_IN_MPS2);
    if let (Some(pareto), false) = (Pareto::fit(&above), to.is_empty()) {
        let events = to.iter().filter(|it| **it >= 0.3).count();
        let share = above.len() as f64 / from.len() as f64;
        let predicted = share * pareto.beyond(0.3 - CUT_IN_MPS2);
        let observed = events as f64 / to.len() as f64;
        add("cut-ins that need 0.3 m/s²", predicted, observed, events);
    }
}
