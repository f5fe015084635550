//! How rare a driver's behaviour is, limits on it, and rule files of recorded traffic.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck), which re-exports its public items.
//! This crate makes no semver promise: any release may change or remove an item.
//!
//! [`TrafficModel::rarity`] rates a [`DrivingBehaviour`], and [`NaturalLimit`] masks
//! actions that would make an event too rare. `brakecheck-traffic` fits the model to
//! recordings and evaluates a [`TrafficRuleFile`] on them.
//!
//! Architecture Invariant: knows no recording, no file, no clock, no scene and no ego.

#![warn(
    clippy::dbg_macro,
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::todo,
    clippy::unimplemented,
    clippy::unwrap_used
)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, clippy::expect_used, clippy::unwrap_used)
)]

mod acceleration_model;
mod braking;
mod calibration_row;
mod limit;
mod model;
mod rarity;
mod rule_file;
mod rule_result;
mod simplex;
mod starts;
mod tail;

pub use acceleration_model::AccelerationModel;
pub use braking::{BRAKING_MPS2, BrakingEvent, DECISION_S, MotionMeter, SpeedSeries};
pub use calibration_row::CalibrationRow;
pub use limit::NaturalLimit;
pub use model::{Domain, Exposure, ModelError, SourceFile, TrafficModel};
pub use rarity::{
    CUT_IN_GAP_M, CutInState, DrivingBehaviour, Outside, RareEvent, Rarity, RatedEvent, Surprise,
    needed_mps2,
};
pub use rule_file::{RulesError, TrafficRule, TrafficRuleFile};
pub use rule_result::{RuleResult, WorstRow};
pub use starts::{StartRarity, StartState, StartTable};
pub use tail::{COUNTED_FROM, EventRate, EventTail, Pareto, RateSource, TailPoint};
