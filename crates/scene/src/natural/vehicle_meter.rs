//! Braking of a vehicle so far, and in the next decision.

use brakecheck_driver_model::{DECISION_S, MotionMeter, NaturalLimit};

/// Braking of a vehicle, read sample by sample.
///
/// The statistics of a model are of stretches of 0.5 s, whatever the decisions are.
#[derive(Clone, Debug)]
pub struct VehicleMeter {
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
    pub fn new(speed_mps: f64, sample_s: f64) -> VehicleMeter {
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
        // Only whole stretches are rated, as in the statistics of the model.
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
        // A decision begins within a stretch, whose rest is driven first.
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
            let mut allowed = [-6.0, -4.0, -3.0, -2.0, -1.0, -0.5]
                .into_iter()
                .filter(|it| meter.allows(&limit, *it, decision_s));
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
                let rarity = model.rarity(&brakecheck_driver_model::DrivingBehaviour {
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

    #[test]
    fn times_are_whole_numbers_of_samples() {
        assert_eq!(samples_in(0.5, 0.05), 10);
        assert_eq!(samples_in(0.25, 0.1), 3);
        assert_eq!(samples_in(0.01, 0.05), 1);
    }

    /// Returns the hardest of some decelerations that are allowed.
    fn hardest(meter: &VehicleMeter, per_1000_km: f64, decision_s: f64) -> f64 {
        let model = motorway();
        let limit = NaturalLimit::new(&model, per_1000_km);
        let all = (1..=100).rev().map(|tenths| 0.1 * f64::from(tenths));
        let mut allowed = all.filter(|it| meter.allows(&limit, -it, decision_s));
        allowed.next().unwrap_or(0.0)
    }

    #[test]
    fn longer_decisions_allow_less_braking() {
        let meter = VehicleMeter::new(30.0, 0.05);
        let [half, one, four] = [0.5, 1.0, 4.0].map(|it| hardest(&meter, 20.0, it));
        // A peak is the mean over a second, of which half a second is half.
        assert!((half - 2.0 * one).abs() < 0.25, "{half} and {one}");
        assert!(four > 0.5 && four < one, "{four} and {one}");
        // A part of a stretch is rated as the whole of it.
        assert_eq!(hardest(&meter, 20.0, 0.1), half);
        // Beyond the stretch that has begun, the next one counts as a whole.
        assert_eq!(hardest(&meter, 20.0, 0.55), one);
    }

    #[test]
    fn a_vehicle_that_stands_or_stops_brakes_no_more() {
        for (speed_mps, limited) in [(0.0, false), (0.4, false), (30.0, true)] {
            let meter = VehicleMeter::new(speed_mps, 0.05);
            let hardest = hardest(&meter, 20.0, 1.0);
            assert_eq!(hardest < 9.9, limited, "{speed_mps} m/s: {hardest}");
        }
    }

    #[test]
    fn braking_so_far_counts_with_what_follows() {
        let after = |samples: u32, accel_mps2: f64| {
            let mut meter = VehicleMeter::new(30.0, 0.05);
            (1..=samples).for_each(|it| meter.push(30.0 + 0.05 * f64::from(it) * accel_mps2));
            meter
        };
        let fresh = hardest(&after(0, 0.0), 20.0, 0.05);
        // Speeds that were kept change nothing, whatever part of a stretch they fill.
        for samples in [1, 9, 10, 11, 40] {
            assert!(
                fresh <= hardest(&after(samples, 0.0), 20.0, 0.05),
                "{samples}"
            );
        }
        // A stretch of braking leaves less, and half a stretch still less than none.
        let whole = hardest(&after(10, -2.0), 20.0, 0.5);
        assert!(whole + 1.0 < fresh, "{whole} and {fresh}");
        let meter = after(5, -2.0);
        assert_eq!(meter.speed_mps, 29.5);
        // 0.25 s of 2 m/s² have lost 0.5 m/s of what a stretch may lose.
        let rest = hardest(&meter, 20.0, 0.25);
        assert!(
            (rest - (2.0 * fresh - 2.0)).abs() < 0.15,
            "{rest} and {fresh}"
        );
    }
}
