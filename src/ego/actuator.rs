//! The actuator between a command and the vehicle: a first-order lag.

/// A first-order lag, discretised exactly: a' = u + (a − u) e^(−dt/τ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    decay: f64,
    value: f64,
}

impl Actuator {
    /// A lag of time constant `lag_s` (0 is none), stepped every `sample_s`.
    pub fn new(lag_s: f64, sample_s: f64) -> Actuator {
        let decay = if 0.0 < lag_s {
            libm::exp(-sample_s / lag_s)
        } else {
            0.0
        };
        Actuator { decay, value: 0.0 }
    }

    /// Begins at rest.
    pub fn reset(&mut self) {
        self.value = 0.0;
    }

    /// What arrives at the vehicle when `wish` is asked for over the sample.
    pub fn step(&mut self, wish: f64) -> f64 {
        self.value = wish + (self.value - wish) * self.decay;
        self.value
    }
}
