//! Driving of each vehicle: series of speeds, braking events and cut-ins.

use std::collections::BTreeMap;

use brakecheck_driver_model::SpeedSeries;

use crate::analysis::Analysis;
use crate::speed_series::speed_series;

/// Deceleration of a follower from which the tail of cut-ins is fitted.
pub(crate) const CUT_IN_MPS2: f64 = 0.1;

/// Series, events and cut-ins of the vehicles of recordings.
pub(crate) struct DrivingData {
    /// Series per vehicle.
    pub(crate) vehicles: Vec<VehicleData>,
}

/// Data of one vehicle.
#[derive(Default)]
pub(crate) struct VehicleData {
    pub(crate) carriageway: usize,
    pub(crate) series: Vec<SpeedSeries>,
    /// Decelerations that the followers of its cut-ins need, in m/s².
    pub(crate) cut_ins: Vec<f64>,
    /// Greatest lateral speed of its cut-ins in m/s.
    pub(crate) lateral_mps: f64,
}

impl VehicleData {
    pub(crate) fn thousand_km(&self) -> f64 {
        let km: f64 = self.series.iter().map(SpeedSeries::distance_km).sum();
        km / 1000.0
    }

    pub(crate) fn accelerations(&self) -> Vec<Vec<f64>> {
        let series = self.series.iter();
        series.map(SpeedSeries::accelerations_mps2).collect()
    }

    pub(crate) fn peaks(&self) -> Vec<f64> {
        let events = self.series.iter().flat_map(SpeedSeries::braking_events);
        events.map(|it| it.peak_mps2).collect()
    }

    /// Returns the peaks of the acceleration events.
    pub(crate) fn acceleration_peaks(&self) -> Vec<f64> {
        let mirrored = self.series.iter().map(SpeedSeries::mirrored);
        let events = mirrored.flat_map(|series| series.braking_events());
        events.map(|it| it.peak_mps2).collect()
    }

    pub(crate) fn losses(&self) -> Vec<f64> {
        let events = self.series.iter().flat_map(SpeedSeries::braking_events);
        events.map(|it| it.speed_lost_mps).collect()
    }
}

impl DrivingData {
    pub(crate) fn of(analyses: &[Analysis]) -> DrivingData {
        let mut vehicles: BTreeMap<(usize, String), VehicleData> = BTreeMap::new();
        for (file, analysis) in analyses.iter().enumerate() {
            let id = |track: usize| (file, analysis.recording.tracks[track].id.clone());
            for series in speed_series(&analysis.recording, &analysis.frame) {
                let vehicle = vehicles.entry(id(series.track)).or_default();
                vehicle.carriageway = series.carriageway;
                vehicle.series.push(series);
            }
            for cut_in in &analysis.situations.cut_ins {
                // The recorder made these states up.
                if cut_in.is_filled {
                    continue;
                }
                let vehicle = vehicles.entry(id(cut_in.change.track)).or_default();
                vehicle.cut_ins.push(cut_in.at_line.needed_mps2());
                vehicle.lateral_mps = vehicle.lateral_mps.max(cut_in.lateral_mps);
            }
        }
        DrivingData {
            vehicles: vehicles.into_values().collect(),
        }
    }
}
