//! Lags of brakes and steering between a command and the wheels.

use crate::sim::{Brakes, GRAVITY_MPS2, Vehicle};

/// Brakes of one car, with their state.
#[derive(Clone, Copy, Debug)]
pub(super) struct BrakeLag {
    delay_s: f64,
    /// Rate of the deceleration, infinite for brakes without a build-up.
    rise_mps3: f64,
    now: BrakeState,
    /// State at the beginning of the step.
    before: BrakeState,
}

#[derive(Clone, Copy, Debug, Default)]
struct BrakeState {
    /// Time since the command to brake.
    waited_s: f64,
    /// Current deceleration.
    braking_mps2: f64,
}

impl BrakeLag {
    pub(super) fn new(brakes: &Brakes, vehicle: &Vehicle) -> BrakeLag {
        BrakeLag {
            delay_s: brakes.delay_s,
            rise_mps3: vehicle.grip * GRAVITY_MPS2 / brakes.build_up_s,
            now: BrakeState::default(),
            before: BrakeState::default(),
        }
    }

    /// Returns the mean acceleration of a step under a command.
    ///
    /// `most_mps2` is the greatest deceleration of the tyres, so that the brakes
    /// release at once from a command beyond it.
    pub(super) fn step(&mut self, command_mps2: f64, most_mps2: f64, dt_s: f64) -> f64 {
        self.before = self.now;
        if command_mps2 >= 0.0 {
            // Released brakes wait anew before they brake again.
            self.now = BrakeState::default();
            return command_mps2;
        }
        let wanted_mps2 = (-command_mps2).min(most_mps2);
        // A weaker command releases at once, as `Brakes` documents.
        let start_mps2 = self.before.braking_mps2.min(wanted_mps2);
        let waited_s = self.before.waited_s + dt_s;
        let rising_s = (waited_s - self.delay_s).clamp(0.0, dt_s);
        let needed_s = (wanted_mps2 - start_mps2) / self.rise_mps3;
        self.now.waited_s = waited_s;
        // Without a build-up nothing is needed, but no brake answers before its delay.
        let answers = rising_s > 0.0 || wanted_mps2 <= start_mps2;
        if answers && needed_s <= rising_s {
            self.now.braking_mps2 = wanted_mps2;
            // Ramp, then constant, after what is left of the delay.
            let lost = 0.5 * needed_s + (dt_s - rising_s);
            return -(wanted_mps2 - (wanted_mps2 - start_mps2) * lost / dt_s);
        }
        // An infinite rise times no time is no number.
        let gain_mps2 = if answers {
            self.rise_mps3 * rising_s
        } else {
            0.0
        };
        self.now.braking_mps2 = start_mps2 + gain_mps2;
        -(start_mps2 + 0.5 * gain_mps2 * rising_s / dt_s)
    }

    /// Moves back to a share of the last step.
    pub(super) fn rewind(&mut self, share: f64) {
        let (from, to) = (self.before, self.now);
        self.now = BrakeState {
            waited_s: mix(from.waited_s, to.waited_s, share),
            braking_mps2: mix(from.braking_mps2, to.braking_mps2, share),
        };
    }
}

/// Steering of one car, with its state.
#[derive(Clone, Copy, Debug)]
pub(super) struct SteeringLag {
    rate_rad_per_s: f64,
    wheelbase_m: f64,
    now_rad: f64,
    before_rad: f64,
}

impl SteeringLag {
    pub(super) fn new(rate_rad_per_s: f64, wheelbase_m: f64) -> SteeringLag {
        SteeringLag {
            rate_rad_per_s,
            wheelbase_m,
            now_rad: 0.0,
            before_rad: 0.0,
        }
    }

    /// Returns the curvature of the wheels after a step under a command.
    pub(super) fn step(&mut self, curvature_per_m: f64, dt_s: f64) -> f64 {
        self.before_rad = self.now_rad;
        // The rate limits the angle of the wheels and not the curvature.
        let wanted_rad = libm::atan(self.wheelbase_m * curvature_per_m);
        let most_rad = self.rate_rad_per_s * dt_s;
        self.now_rad += (wanted_rad - self.now_rad).clamp(-most_rad, most_rad);
        libm::tan(self.now_rad) / self.wheelbase_m
    }

    /// Moves back to a share of the last step.
    pub(super) fn rewind(&mut self, share: f64) {
        self.now_rad = mix(self.before_rad, self.now_rad, share);
    }
}

fn mix(from: f64, to: f64, share: f64) -> f64 {
    from + share * (to - from)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brakes(delay_s: f64, build_up_s: f64) -> BrakeLag {
        BrakeLag {
            delay_s,
            rise_mps3: 10.0 / build_up_s,
            now: BrakeState::default(),
            before: BrakeState::default(),
        }
    }

    #[test]
    fn the_speed_lost_does_not_depend_on_the_step() {
        // 0.3 s: 0.1 s of delay, 0.15 s up to 7.5 m/s², and 0.05 s at 7.5 m/s².
        let with_rise_mps = 0.5 * 0.15 * 7.5 + 0.05 * 7.5;
        // Without a build-up, the delay alone is lost.
        for (build_up_s, want_mps) in [(0.2, with_rise_mps), (0.0, 0.2 * 7.5)] {
            for steps in [1, 2, 3, 7, 24, 100] {
                let (mut lag, dt_s) = (brakes(0.1, build_up_s), 0.3 / f64::from(steps));
                let lost_mps: f64 = (0..steps).map(|_| -dt_s * lag.step(-7.5, 9.0, dt_s)).sum();
                assert!((lost_mps - want_mps).abs() < 1e-9, "{steps}: {lost_mps}");
            }
        }
    }

    #[test]
    fn brakes_release_at_once_and_wait_again() {
        let mut lag = brakes(0.1, 0.2);
        for _ in 0..40 {
            lag.step(-8.0, 9.0, 0.01);
        }
        assert_eq!(lag.step(-8.0, 9.0, 0.01), -8.0);
        assert_eq!(lag.step(-3.0, 9.0, 0.01), -3.0);
        assert_eq!(lag.step(1.0, 9.0, 0.01), 1.0);
        assert_eq!(lag.step(-8.0, 9.0, 0.01), 0.0);
    }

    #[test]
    fn a_rewound_brake_is_where_it_was() {
        let mut lag = brakes(0.0, 0.2);
        lag.step(-8.0, 9.0, 0.04);
        lag.rewind(0.25);
        assert!((lag.now.braking_mps2 - 0.5).abs() < 1e-12);
        let mut steering = SteeringLag::new(0.4, 2.5);
        steering.step(0.1, 0.1);
        steering.rewind(0.5);
        assert!((steering.now_rad - 0.02).abs() < 1e-12);
    }
}
