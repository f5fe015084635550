//! Brakes that need time and tyres that slip, as data of a body file.
//!
//! Only the rigid plant reads them. A body without them obeys its commands at once,
//! and the kinematic plant is the ideal of every body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::body_model::{InvalidBody, within};

/// Speed at which a wet road has its stated friction: 50 km/h.
const WET_REFERENCE_MPS: f64 = 50.0 / 3.6;
/// Greatest share of its friction that a tyre loses to a film of water.
const MOST_WET_LOSS: f64 = 0.8;

/// Brakes whose force builds up.
///
/// A command to brake has no effect for [`Brakes::delay_s`]. The deceleration then
/// grows at a constant rate. Brakes release at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Brakes {
    /// Time from the command to the first deceleration.
    #[serde(default)]
    pub delay_s: f64,
    /// Time from the first deceleration to the greatest one of a dry road.
    pub build_up_s: f64,
    /// Share of the braking force on the front axle, as long as no wheel slips.
    pub front_share: f64,
}

/// Tyres with slip angles and a friction ellipse.
///
/// A wheel's force follows the magic formula in the combined slip of both directions
/// (Pacejka, Tire and Vehicle Dynamics, Sect. 4.3). Antilock brakes keep the wheel at
/// its peak.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tyres {
    /// Greatest force along the wheel, as a share of its load, on a road of friction 1.
    pub mu_along: f64,
    /// Greatest force across the wheel, as a share of its load, on a road of friction 1.
    pub mu_across: f64,
    /// Side force of the front and the rear axle, per load and slip angle.
    pub cornering_per_rad: (f64, f64),
    /// Shape factor of the magic formula.
    #[serde(default = "shape")]
    pub shape: f64,
    /// Share of its friction that a wheel loses at twice its static load.
    #[serde(default)]
    pub load_loss: f64,
    /// Share of its friction that a wet tyre loses per m/s above 50 km/h.
    #[serde(default)]
    pub wet_loss_s_per_m: f64,
}

impl Brakes {
    /// Checks that every value is in its range.
    pub(super) fn validate(&self) -> Result<(), InvalidBody> {
        within("delay_s", self.delay_s, 0.0, 2.0)?;
        within("build_up_s", self.build_up_s, 0.0, 3.0)?;
        within("front_share", self.front_share, 0.0, 1.0)
    }
}

impl Tyres {
    /// Checks that every value is in its range.
    pub(super) fn validate(&self) -> Result<(), InvalidBody> {
        within("mu_along", self.mu_along, 0.05, 3.0)?;
        within("mu_across", self.mu_across, 0.05, 3.0)?;
        let (front, rear) = self.cornering_per_rad;
        within("cornering_per_rad", front, 1.0, 100.0)?;
        within("cornering_per_rad", rear, 1.0, 100.0)?;
        // The peak lies at a finite slip only for shapes above 1.
        within("shape", self.shape, 1.05, 1.95)?;
        within("load_loss", self.load_loss, 0.0, 0.5)?;
        within("wet_loss_s_per_m", self.wet_loss_s_per_m, 0.0, 0.05)
    }

    /// Returns the share of its friction that a tyre keeps at a speed.
    ///
    /// A road is wet from a friction of 0.8 down to 0.4. It is dry at 1, and snow or ice
    /// at 0.2 and below. The loss is interpolated between these.
    pub(super) fn wet_share(&self, friction: f64, speed_mps: f64) -> f64 {
        // Two lines that meet above 1: from 0.8 down to 0.4 the cut below decides.
        let wetness = (5.0 * (1.0 - friction)).min(5.0 * (friction - 0.2));
        let above_mps = (speed_mps.abs() - WET_REFERENCE_MPS).max(0.0);
        let loss = wetness.clamp(0.0, 1.0) * self.wet_loss_s_per_m * above_mps;
        // Far above 50 km/h the linear loss would exceed all of the friction.
        1.0 - loss.min(MOST_WET_LOSS)
    }
}

/// Shape factor of a passenger car's tyre across the wheel.
fn shape() -> f64 {
    1.35
}

#[cfg(test)]
mod tests {
    use super::*;

    const TYRES: Tyres = Tyres {
        mu_along: 1.0,
        mu_across: 1.0,
        cornering_per_rad: (20.0, 20.0),
        shape: 1.35,
        load_loss: 0.0,
        wet_loss_s_per_m: 0.01,
    };

    #[test]
    fn only_wet_roads_lose_friction_with_speed() {
        let share = |friction, above_mps| TYRES.wet_share(friction, WET_REFERENCE_MPS + above_mps);
        for (friction, above_mps, want) in [
            (1.0, 10.0, 1.0),
            (0.9, 10.0, 0.95),
            (0.7, 10.0, 0.9),
            (0.4, 10.0, 0.9),
            (0.3, 10.0, 0.95),
            (0.1, 10.0, 1.0),
            (0.7, -10.0, 1.0),
            (0.7, 200.0, 0.2),
        ] {
            let got = share(friction, above_mps);
            assert!((got - want).abs() < 1e-12, "{friction} {above_mps}: {got}");
        }
    }

    #[test]
    fn each_value_out_of_range_is_named() {
        let brakes = |delay_s, build_up_s, front_share| Brakes {
            delay_s,
            build_up_s,
            front_share,
        };
        let mut cases = vec![
            ("delay_s", brakes(-0.1, 0.2, 0.6).validate()),
            ("build_up_s", brakes(0.0, f64::NAN, 0.6).validate()),
            ("front_share", brakes(0.0, 0.2, 1.1).validate()),
        ];
        let mut with = |field, change: fn(&mut Tyres)| {
            let mut tyres = TYRES;
            change(&mut tyres);
            cases.push((field, tyres.validate()));
        };
        with("mu_along", |tyres| tyres.mu_along = 0.0);
        with("mu_across", |tyres| tyres.mu_across = 4.0);
        with("cornering_per_rad", |tyres| tyres.cornering_per_rad.0 = 0.5);
        with("cornering_per_rad", |tyres| {
            tyres.cornering_per_rad.1 = 500.0
        });
        with("shape", |tyres| tyres.shape = 1.0);
        with("load_loss", |tyres| tyres.load_loss = 0.6);
        with("wet_loss_s_per_m", |tyres| tyres.wet_loss_s_per_m = -0.01);
        for (field, result) in cases {
            assert_eq!(result.map_err(|error| error.field), Err(field));
        }
        assert_eq!(TYRES.validate(), Ok(()));
    }
}
