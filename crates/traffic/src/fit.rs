//! Fit of a naturalness model to recordings.

use brakecheck_driver_model::{
    AccelerationModel, BRAKING_MPS2, Domain, EventTail, Exposure, ModelError, SourceFile,
    TrafficModel,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::analysis::Analysis;
use crate::calibration::calibrate;
use crate::driving_data::{CUT_IN_MPS2, DrivingData, VehicleData};
use crate::start_table::start_table;

/// Loss of speed from which its tail is fitted.
const LOSS_MPS: f64 = 2.0;
/// Draws of vehicles for an interval.
const RESAMPLED: usize = 400;

/// Fits a model to recordings, with its calibration between halves of the data.
///
/// # Errors
/// The recordings have too few events.
pub fn fit_traffic(
    name: &str,
    sources: Vec<SourceFile>,
    analyses: &[Analysis],
) -> Result<TrafficModel, ModelError> {
    let data = DrivingData::of(analyses);
    let vehicles = &data.vehicles;
    let peaks: Vec<Vec<f64>> = vehicles.iter().map(VehicleData::peaks).collect();
    let exposure = Exposure {
        vehicles: vehicles.len(),
        vehicle_km: 1000.0 * vehicles.iter().map(VehicleData::thousand_km).sum::<f64>(),
        braking_events: peaks.iter().map(Vec::len).sum(),
        cut_ins: vehicles.iter().map(|it| it.cut_ins.len()).sum(),
    };
    let too_few = || ModelError::TooFew {
        vehicle_km: exposure.vehicle_km,
        events: exposure.braking_events,
    };
    let series: Vec<Vec<f64>> = vehicles
        .iter()
        .flat_map(VehicleData::accelerations)
        .collect();
    let driver = AccelerationModel::fit(&series).ok_or_else(too_few)?;
    // One set of draws for all tails, so that their intervals are comparable.
    let draws = draws(vehicles.len());
    let thousands: Vec<f64> = vehicles.iter().map(VehicleData::thousand_km).collect();
    // 1 to 4 m/s² in quarters, then 5 to 8 m/s², where events are rare.
    let peak_sizes: Vec<f64> = (4..=16)
        .chain([20, 24, 28, 32])
        .map(|i| 0.25 * f64::from(i))
        .collect();
    let peak = EventTail::fit(&peaks, &thousands, BRAKING_MPS2, &peak_sizes, &draws);
    let accelerations: Vec<Vec<f64>> = vehicles
        .iter()
        .map(VehicleData::acceleration_peaks)
        .collect();
    let losses: Vec<Vec<f64>> = vehicles.iter().map(VehicleData::losses).collect();
    let loss_sizes: Vec<f64> = (1..=20).chain([25, 30]).map(f64::from).collect();
    let loss = EventTail::fit(&losses, &thousands, LOSS_MPS, &loss_sizes, &draws);
    let cut_ins: Vec<Vec<f64>> = vehicles.iter().map(|it| it.cut_ins.clone()).collect();
    // Counted per cut-in instead of per distance, so that rates are shares of them.
    let each: Vec<f64> = cut_ins.iter().map(|it| it.len() as f64).collect();
    let need_sizes = [
        0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0,
    ];
    Ok(TrafficModel {
        name: name.to_owned(),
        sources,
        exposure,
        domain: domain(&data, &series),
        driver,
        braking_peak: peak.ok_or_else(too_few)?,
        // May be missing, unlike the tails of braking, without which there is
        // no model.
        acceleration_peak: EventTail::fit(
            &accelerations,
            &thousands,
            BRAKING_MPS2,
            &peak_sizes,
            &draws,
        ),
        braking_loss: loss.ok_or_else(too_few)?,
        cut_in_need: EventTail::fit(&cut_ins, &each, CUT_IN_MPS2, &need_sizes, &draws),
        starts: start_table(analyses),
        calibration: calibrate(&data),
    })
}

/// Draws vehicles with replacement, for intervals.
fn draws(vehicles: usize) -> Vec<Vec<usize>> {
    // A fixed seed: equal recordings give equal intervals.
    let mut rng = ChaCha8Rng::seed_from_u64(48);
    (0..RESAMPLED)
        .map(|_| {
            (0..vehicles)
                // Whole vehicles are drawn, because the events of one driver
                // are not independent.
                .map(|_| rng.random_range(0..vehicles))
                .collect()
        })
        .collect()
}

fn domain(data: &DrivingData, accelerations: &[Vec<f64>]) -> Domain {
    let series = data.vehicles.iter().flat_map(|it| &it.series);
    let speeds = series.flat_map(|it| it.speeds_mps.iter().copied());
    let lateral = data.vehicles.iter().map(|it| it.lateral_mps);
    Domain {
        speed_mps: range(speeds),
        accel_mps2: range(accelerations.iter().flatten().copied()),
        cut_in_lateral_mps: lateral.fold(0.0, f64::max),
    }
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], it| {
        [least.min(it), most.max(it)]
    })
}
