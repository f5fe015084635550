//! Quantities of the environment that starts draw: the road and the sensors.

use std::sync::Arc;

use super::layout::DriveLayout;
use super::motion::DriveScene;
use super::range::Range;
use super::sensors::Sensing;
use super::spec::DriveSpec;
use super::world::DriveWorld;
use crate::scene::{Axis, Start};

/// Quantity of the environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentQuantity {
    /// Coefficient of friction μ of the road.
    Friction,
    /// Delay of the ego's sensors, a multiple of the sample.
    SensorDelay,
    /// Standard deviation of perceived positions.
    PositionNoise,
    /// Standard deviation of perceived speeds.
    SpeedNoise,
}

/// Quantity of the environment with its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentRange {
    /// Quantity that starts draw.
    pub quantity: EnvironmentQuantity,
    /// Range from which it is drawn.
    pub range: Range,
    /// Value in [`DriveSpec`], for code that has no start.
    pub nominal: f64,
    /// False if a changed ego replaces the drawn value by its own.
    pub applies: bool,
}

impl EnvironmentQuantity {
    /// Returns whether it belongs to the ego's sensors.
    pub fn is_of_sensors(self) -> bool {
        self != EnvironmentQuantity::Friction
    }

    /// Returns the name and the unit of its axis.
    fn axis(self) -> (&'static str, &'static str) {
        match self {
            EnvironmentQuantity::Friction => ("road.friction", ""),
            EnvironmentQuantity::SensorDelay => ("sensors.delay", "s"),
            EnvironmentQuantity::PositionNoise => ("sensors.position_sd", "m"),
            EnvironmentQuantity::SpeedNoise => ("sensors.speed_sd", "m/s"),
        }
    }

    /// Returns the value in a spec.
    pub fn read(self, spec: &DriveSpec) -> f64 {
        match self {
            EnvironmentQuantity::Friction => spec.road.friction(),
            EnvironmentQuantity::SensorDelay => spec.sensors.delay_s,
            EnvironmentQuantity::PositionNoise => spec.sensors.position_sd_m,
            EnvironmentQuantity::SpeedNoise => spec.sensors.speed_sd_mps,
        }
    }

    /// Sets the value in a spec. A delay is rounded to a multiple of the sample.
    pub fn set(self, spec: &mut DriveSpec, value: f64) {
        match self {
            EnvironmentQuantity::Friction => spec.road.set_friction(value),
            EnvironmentQuantity::SensorDelay => {
                let sample_s = spec.clock.sample_s;
                spec.sensors.delay_s = (value / sample_s).round().max(0.0) * sample_s;
            }
            // Perturbed starts may leave their range, and noise is never
            // negative.
            EnvironmentQuantity::PositionNoise => spec.sensors.position_sd_m = value.max(0.0),
            EnvironmentQuantity::SpeedNoise => spec.sensors.speed_sd_mps = value.max(0.0),
        }
    }
}

impl EnvironmentRange {
    /// Returns the value at a share of the range, from 0 to 1.
    ///
    /// Delays are multiples of the sample, and each is equally likely.
    pub(super) fn at(&self, share: f64, sample_s: f64) -> f64 {
        let Range { lo, hi } = self.range;
        if self.quantity == EnvironmentQuantity::SensorDelay {
            let steps = ((hi - lo) / sample_s).round();
            let step = (share * (steps + 1.0)).floor().min(steps);
            // The last step is the end itself, which a sum could exceed by
            // rounding.
            if step == steps {
                hi
            } else {
                lo + step * sample_s
            }
        } else {
            lo + (hi - lo) * share
        }
    }

    /// Returns the axis of X_init.
    pub(super) fn axis(&self) -> Axis {
        let (name, unit) = self.quantity.axis();
        Axis {
            name: name.to_owned(),
            unit,
            lo: self.range.lo,
            hi: self.range.hi,
        }
    }
}

impl DriveSpec {
    /// Sets the environment that a start draws.
    fn set_environment(&mut self, start: &Start) {
        // The environment has the last values of a start.
        let from = start.0.len().saturating_sub(self.environment.len());
        let drawn: Vec<_> = self
            .environment
            .iter()
            .copied()
            .zip(&start.0[from..])
            .filter(|(it, _)| it.applies)
            .collect();
        for (it, &value) in drawn {
            it.quantity.set(self, value);
        }
    }

    /// Keeps the present values of some quantities, whatever a start draws.
    pub(crate) fn fix_environment(&mut self, fixes: impl Fn(EnvironmentRange) -> bool) {
        for it in &mut self.environment {
            it.applies &= !fixes(*it);
        }
    }
}

impl DriveLayout {
    /// Returns the layout in the environment of a start.
    pub(super) fn at_start(self: &Arc<DriveLayout>, start: &Start) -> Arc<DriveLayout> {
        if self.spec.environment.is_empty() {
            return Arc::clone(self);
        }
        // Signals, formulas and courses depend on none of these quantities.
        let mut layout = DriveLayout::clone(self);
        Arc::make_mut(&mut layout.spec).set_environment(start);
        Arc::new(layout)
    }
}

impl DriveScene {
    /// Begins the environment that a start draws.
    pub(super) fn set_environment(&mut self, start: &Start) {
        let layout = self.layout.at_start(start);
        if Arc::ptr_eq(&layout, &self.layout) {
            return;
        }
        self.state.spec = Arc::clone(&layout.spec);
        self.sensing = Sensing::new(layout.spec.sensors, layout.spec.clock.sample_s);
        self.layout = layout;
    }
}

impl DriveWorld {
    /// Returns the same world in the environment that a start draws.
    ///
    /// Its axes are those of this world. Without ranges in the environment, it is
    /// this world.
    pub fn at_start(&self, start: &Start) -> DriveWorld {
        DriveWorld(self.0.at_start(start))
    }
}
