//! Reference drivers by name, with the values of the regulation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray};

use super::{
    CcDriver, CcLaneDriver, CcLatchedDriver, DriverModel, Encounter, FsmDriver, IdealDriver,
    Latching, Pedal, RegDriver, RssDriver,
};

/// A reference driver as named in files and tables.
///
/// It is a [`DriverModel`] with the default parameters of the model.
///
/// ```
/// # use brakecheck_ego as brakecheck;
/// use brakecheck::ego::ReferenceDriver;
/// let asked: Vec<ReferenceDriver> = ron::from_str("[RSS, CC, CC_LATCHED, Ideal]")?;
/// assert_eq!(asked[2].name(), "CC_LATCHED");
/// assert_eq!("FSM".parse(), Ok(ReferenceDriver::Fsm));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    VariantArray,
    EnumString,
    IntoStaticStr,
    JsonSchema,
)]
pub enum ReferenceDriver {
    /// [`CcDriver`].
    #[serde(rename = "CC")]
    #[strum(serialize = "CC")]
    Cc,
    /// [`CcLaneDriver`].
    #[serde(rename = "CC_LANE")]
    #[strum(serialize = "CC_LANE")]
    CcLane,
    /// [`CcLatchedDriver`].
    #[serde(rename = "CC_LATCHED")]
    #[strum(serialize = "CC_LATCHED")]
    CcLatched,
    /// [`RegDriver`].
    #[serde(rename = "REG")]
    #[strum(serialize = "REG")]
    Reg,
    /// [`RssDriver`].
    #[serde(rename = "RSS")]
    #[strum(serialize = "RSS")]
    Rss,
    /// [`FsmDriver`].
    #[serde(rename = "FSM")]
    #[strum(serialize = "FSM")]
    Fsm,
    /// [`IdealDriver`].
    Ideal,
}

impl ReferenceDriver {
    /// Returns the name in files and tables.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Returns a short description.
    pub fn words(self) -> &'static str {
        match self {
            ReferenceDriver::Cc => "the competent driver of UN R157 (CC)",
            ReferenceDriver::CcLane => "the competent driver of UN R157 (CC_LANE)",
            ReferenceDriver::CcLatched => "the competent driver of UN R157 (CC_LATCHED)",
            ReferenceDriver::Reg => "the cut-in formula of UN R157 (REG)",
            ReferenceDriver::Rss => "responsibility-sensitive safety (RSS)",
            ReferenceDriver::Fsm => "the fuzzy safety model of UN R157 (FSM)",
            ReferenceDriver::Ideal => "a driver without delay (Ideal)",
        }
    }

    /// Returns whether its braking builds up like that of a car.
    ///
    /// The lag of the ego's actuator would then count twice.
    pub fn has_build_up(self) -> bool {
        self.pedal().jerk_mps3.is_finite()
    }

    fn ask<T>(self, question: impl FnOnce(&dyn DriverModel) -> T) -> T {
        match self {
            ReferenceDriver::Cc => question(&CcDriver::default()),
            ReferenceDriver::CcLane => question(&CcLaneDriver::default()),
            ReferenceDriver::CcLatched => question(&CcLatchedDriver::default()),
            ReferenceDriver::Reg => question(&RegDriver::default()),
            ReferenceDriver::Rss => question(&RssDriver::default()),
            ReferenceDriver::Fsm => question(&FsmDriver::default()),
            ReferenceDriver::Ideal => question(&IdealDriver::default()),
        }
    }
}

impl DriverModel for ReferenceDriver {
    fn pedal(&self) -> Pedal {
        self.ask(|model| model.pedal())
    }

    fn danger(&self, encounter: &Encounter) -> Option<f64> {
        self.ask(|model| model.danger(encounter))
    }

    fn latching(&self) -> Latching {
        self.ask(|model| model.latching())
    }
}
