//! Decisions of 0.5 s, and the braking events in them.

use serde::{Deserialize, Serialize};

/// Length of a decision in seconds. All statistics are of such decisions.
pub const DECISION_S: f64 = 0.5;

/// Deceleration over one second from which a stretch is a braking event, in m/s².
pub const BRAKING_MPS2: f64 = 1.0;

/// Speeds of a vehicle every 0.5 s, without interpolated samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpeedSeries {
    /// Track in the recording.
    pub track: usize,
    /// Carriageway of the track.
    pub carriageway: usize,
    /// Speeds at the ends of decisions, one more than there are decisions.
    pub speeds_mps: Vec<f64>,
}

impl SpeedSeries {
    /// Returns the mean acceleration of each decision in m/s².
    pub fn accelerations_mps2(&self) -> Vec<f64> {
        let change = |pair: &[f64]| (pair[1] - pair[0]) / DECISION_S;
        self.speeds_mps.windows(2).map(change).collect()
    }

    /// Returns the series with reversed speeds, whose braking is acceleration.
    pub fn mirrored(&self) -> SpeedSeries {
        SpeedSeries {
            speeds_mps: self.speeds_mps.iter().map(|speed| -speed).collect(),
            ..self.clone()
        }
    }

    /// Returns the distance in kilometres.
    pub fn distance_km(&self) -> f64 {
        let mean = |pair: &[f64]| 0.5 * (pair[0] + pair[1]) * DECISION_S;
        self.speeds_mps.windows(2).map(mean).sum::<f64>() / 1000.0
    }

    /// Returns the braking events, also one that lasts until the end.
    pub fn braking_events(&self) -> Vec<BrakingEvent> {
        let Some(first_mps) = self.speeds_mps.first() else {
            return Vec::new();
        };
        let mut meter = BrakingMeter::new(*first_mps);
        let accelerations = self.accelerations_mps2();
        let mut events: Vec<BrakingEvent> = Vec::new();
        for accel_mps2 in accelerations {
            // Kept, because the push that ends an event also forgets it.
            let before = meter.event();
            meter.push(accel_mps2);
            if let (Some(event), None) = (before, meter.event()) {
                events.push(event);
            }
        }
        // A run may end while the vehicle still brakes.
        events.extend(meter.event());
        events
    }
}

/// Stretch in which the mean over each second is at or below −1 m/s².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BrakingEvent {
    /// Greatest deceleration as a mean over one second, in m/s².
    pub peak_mps2: f64,
    /// Speed lost from the beginning to the end, in m/s.
    pub speed_lost_mps: f64,
    /// Time for which the mean over the last second is at or below −1 m/s².
    pub duration_s: f64,
}

/// Braking event of a vehicle so far, updated decision by decision.
///
/// Recorded drivers and simulated ados are measured with the same code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BrakingMeter {
    /// Speeds before the last decision and after it.
    speeds_mps: [f64; 2],
    last_mps2: Option<f64>,
    event: Option<OpenEvent>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct OpenEvent {
    from_mps: f64,
    so_far: BrakingEvent,
}

impl BrakingMeter {
    /// Creates a meter of a vehicle with a speed.
    pub fn new(speed_mps: f64) -> BrakingMeter {
        BrakingMeter {
            speeds_mps: [speed_mps; 2],
            last_mps2: None,
            event: None,
        }
    }

    /// Returns the event that is going on after the last decision.
    pub fn event(&self) -> Option<BrakingEvent> {
        self.event.map(|it| it.so_far)
    }

    /// Adds a decision of 0.5 s with its mean acceleration.
    pub fn push(&mut self, accel_mps2: f64) {
        let [from_mps, before_mps] = self.speeds_mps;
        let after_mps = before_mps + accel_mps2 * DECISION_S;
        self.speeds_mps = [before_mps, after_mps];
        let last_mps2 = self.last_mps2.replace(accel_mps2);
        // The first decision has no second to be the mean of.
        let Some(last_mps2) = last_mps2 else { return };
        let mean_mps2 = 0.5 * (last_mps2 + accel_mps2);
        // At the limit itself the event goes on.
        if -BRAKING_MPS2 < mean_mps2 {
            self.event = None;
            return;
        }
        // The event begins with the second that it is the mean of, one
        // decision ago.
        let open = self.event.get_or_insert(OpenEvent {
            from_mps,
            so_far: BrakingEvent {
                peak_mps2: 0.0,
                speed_lost_mps: 0.0,
                duration_s: 0.0,
            },
        });
        open.so_far.peak_mps2 = open.so_far.peak_mps2.max(-mean_mps2);
        open.so_far.speed_lost_mps = open.from_mps - after_mps;
        open.so_far.duration_s += DECISION_S;
    }
}

/// Braking and acceleration events of a vehicle so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionMeter {
    pub(crate) braking: BrakingMeter,
    /// Of the reversed speeds.
    pub(crate) acceleration: BrakingMeter,
}

impl MotionMeter {
    /// Creates a meter of a vehicle with a speed.
    pub fn new(speed_mps: f64) -> MotionMeter {
        MotionMeter {
            braking: BrakingMeter::new(speed_mps),
            acceleration: BrakingMeter::new(-speed_mps),
        }
    }

    /// Adds a decision of 0.5 s with its mean acceleration.
    pub fn push(&mut self, accel_mps2: f64) {
        self.braking.push(accel_mps2);
        self.acceleration.push(-accel_mps2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(accelerations: &[f64]) -> Vec<BrakingEvent> {
        let mut speeds_mps = vec![30.0];
        for accel in accelerations {
            speeds_mps.push(speeds_mps[speeds_mps.len() - 1] + accel * DECISION_S);
        }
        let series = SpeedSeries {
            speeds_mps,
            ..SpeedSeries::default()
        };
        series.braking_events()
    }

    #[test]
    fn an_event_has_the_peak_over_a_second_and_the_speed_lost() {
        let found = events(&[0.0, -3.0, -3.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0]);
        let shown: Vec<_> = found
            .iter()
            .map(|it| (it.peak_mps2, it.speed_lost_mps, it.duration_s))
            .collect();
        assert_eq!(shown, [(3.0, 3.0, 1.5), (1.0, 1.0, 0.5)]);
    }

    #[test]
    fn half_a_second_of_hard_braking_counts_half() {
        assert_eq!(events(&[0.0, -6.0, 0.0, 0.0])[0].peak_mps2, 3.0);
        assert_eq!(events(&[0.0, -1.9, 0.0, 0.0]), []);
    }

    #[test]
    fn an_event_at_the_end_counts() {
        assert_eq!(events(&[0.0, 0.0, -2.0, -2.0]).len(), 1);
    }
}
