//! The actuator between a command and the vehicle: a first-order lag.
//!
//! It belongs to the car and not to its driver. Every controller in the same
//! car has the same lag, including a user's own Rust type. World files write it
//! as `lag_s` among the controller's parameters.

/// A controller with the lag of the actuator behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuated<C> {
    /// Controller whose command the actuator follows.
    pub controller: C,
    /// Time constant of the first-order lag behind the command, 0 for none.
    pub lag_s: f64,
}

impl<C> Actuated<C> {
    /// Returns the same actuator behind a different form of the controller.
    pub fn map<D>(self, form: impl FnOnce(C) -> D) -> Actuated<D> {
        Actuated {
            controller: form(self.controller),
            lag_s: self.lag_s,
        }
    }
}

/// Reads, writes and describes `Actuated<$of>` in the form `$file`.
///
/// The form holds the lag among the controller's own fields.
macro_rules! written_as {
    ($of:ty, $file:ty) => {
        impl serde::Serialize for $crate::ego::Actuated<$of> {
            fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                <$file>::from(self.clone()).serialize(to)
            }
        }

        impl<'de> serde::Deserialize<'de> for $crate::ego::Actuated<$of> {
            fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                <$file>::deserialize(from).map(Self::from)
            }
        }

        impl schemars::JsonSchema for $crate::ego::Actuated<$of> {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                <$file as schemars::JsonSchema>::schema_name()
            }

            fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
                <$file as schemars::JsonSchema>::json_schema(generator)
            }
        }
    };
}

pub(super) use written_as;

/// A first-order lag, discretised exactly: a' = u + (a − u) e^(−dt/τ).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    decay: f64,
    value: f64,
}

impl Actuator {
    /// Creates a lag of time constant `lag_s` (0 for none), stepped every `sample_s`.
    pub fn new(lag_s: f64, sample_s: f64) -> Actuator {
        let decay = if lag_s > 0.0 {
            libm::exp(-sample_s / lag_s)
        } else {
            0.0
        };
        Actuator { decay, value: 0.0 }
    }

    /// Returns the same lag with the initial output `value`.
    pub fn from(self, value: f64) -> Actuator {
        Actuator { value, ..self }
    }

    /// Returns the vehicle's acceleration while `wish` is commanded for a sample.
    #[inline]
    pub fn step(&mut self, wish: f64) -> f64 {
        // A convex combination: with decay 0 the output equals the wish, bit
        // for bit.
        self.value = wish + (self.value - wish) * self.decay;
        self.value
    }
}
