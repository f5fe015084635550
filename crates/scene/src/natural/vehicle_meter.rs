//! Braking of a vehicle so far, and in the next decision.

use brakecheck_traffic::{DECISION_S, MotionMeter, NaturalLimit};

/// Braking of a vehicle, read sample by sample.
///
/// The statistics of a model are of stretches of 0.5 s, whatever the decisions are.
#[derive(Clone, Debug)]
pub(super) struct VehicleMeter {
    meter: MotionMeter,
    /// Samples per stretch.
    stretch: usize,
    sample_s: f64,
    /// Speed at the start of the running stretch.
    from_mps: f64,
    /// Samples since then.
    samples: usize,
    pub(super) speed_mps: f64,
}

impl VehicleMeter {
    /// Creates the meter of a vehicle that kept its speed before the start.
    pub(super) fn new(speed_mps: f64, sample_s: f64) -> VehicleMeter {
        let mut meter = MotionMeter::new(speed_mps);
        // Peaks are means over two stretches, so the first one needs a stretch before it.
        meter.push(0.0);
        VehicleMeter {
            meter,
            stretch: samples_in(DECISION_S, sample_s),
            sample_s,
            from_mps: speed_mps,
            samples: 0,
            speed_mps,
        }
    }

    /// Adds a sample.
    pub(super) fn push(&mut self, speed_mps: f64) {
        self.speed_mps = speed_mps;
        self.samples += 1;
        if self.samples == self.stretch {
            self.meter.push((speed_mps - self.from_mps) / DECISION_S);
            (self.from_mps, self.samples) = (speed_mps, 0);
        }
    }

    /// Returns whether an acceleration over the next decision is allowed.
    ///
    /// A stretch that the decision does not complete is completed with the same
    /// acceleration.
    pub(super) fn allows(
        &self,
        limit: &NaturalLimit<'_>,
        accel_mps2: f64,
        decision_s: f64,
    ) -> bool {
        let mut left = samples_in(decision_s, self.sample_s);
        let (mut meter, mut from_mps, mut speed_mps) = (self.meter, self.from_mps, self.speed_mps);
        let mut samples = self.stretch - self.samples;
        loop {
            // A braking vehicle stops and does not reverse.
            let after_mps = speed_mps + accel_mps2 * samples as f64 * self.sample_s;
            speed_mps = after_mps.max(speed_mps.min(0.0));
            let mean_mps2 = (speed_mps - from_mps) / DECISION_S;
            if !limit.allows_acceleration(&meter, mean_mps2) {
                return false;
            }
            meter.push(mean_mps2);
            if left <= samples {
                return true;
            }
            left -= samples;
            (from_mps, samples) = (speed_mps, self.stretch);
        }
    }
}

/// Returns the number of samples in a time, at least one.
pub(super) fn samples_in(time_s: f64, sample_s: f64) -> usize {
    (libm::round(time_s / sample_s) as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::natural::motorway;

    /// Brakes as hard as allowed and returns the decelerations, decision by decision.
    fn braked(per_1000_km: f64, decision_s: f64) -> Vec<f64> {
        let model = motorway();
        let limit = NaturalLimit::new(&model, per_1000_km);
        let (mut meter, mut speed_mps) = (VehicleMeter::new(30.0, 0.05), 30.0);
        let mut all = Vec::new();
        for _ in 0..samples_in(10.0, decision_s) {
            let allowed = [-6.0, -4.0, -3.0, -2.0, -1.0, -0.5];
            let allowed = allowed.into_iter();
            let mut allowed = allowed.filter(|it| meter.allows(&limit, *it, decision_s));
            let accel_mps2 = allowed.next().unwrap_or(0.0);
            let before_mps = speed_mps;
            for _ in 0..samples_in(decision_s, 0.05) {
                speed_mps = f64::max(speed_mps + accel_mps2 * 0.05, 0.0);
                meter.push(speed_mps);
            }
            // A vehicle that has stopped brakes no more.
            all.push((before_mps - speed_mps) / decision_s);
        }
        all
    }

    #[test]
    fn a_rarer_limit_allows_harder_and_longer_braking() {
        for decision_s in [0.1, 0.25, 0.5, 1.0] {
            let lost = [0.01, 1.0, 10.0, 100.0].map(|limit| {
                let all = braked(limit, decision_s);
                all.iter().sum::<f64>() * decision_s
            });
            assert!(lost.is_sorted_by(|a, b| a >= b), "{decision_s} s: {lost:?}");
            assert!(lost[0] > lost[3] + 5.0, "{decision_s} s: {lost:?}");
        }
    }

    #[test]
    fn what_is_allowed_stays_as_frequent_as_the_limit() {
        let model = motorway();
        for decision_s in [0.1, 0.5, 1.0] {
            for per_1000_km in [1.0, 10.0, 100.0] {
                let all = braked(per_1000_km, decision_s);
                let rarity = model.rarity(&brakecheck_traffic::DrivingBehaviour {
                    speed_mps: 30.0,
                    decision_s,
                    accelerations_mps2: all.iter().map(|it| -it).collect(),
                    ..Default::default()
                });
                let rarest = rarity
                    .rarest()
                    .map_or(f64::INFINITY, |it| it.per_1000_km.rate);
                assert!(
                    per_1000_km <= rarest,
                    "{per_1000_km}, {decision_s} s: {rarest}"
                );
            }
        }
    }
}
