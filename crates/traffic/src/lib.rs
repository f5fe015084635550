#![doc = include_str!("../README.md")]
//!
//! # First steps
//!
//! Read a CSV file with [`read_csv`] and a [`ColumnMap`]. [`Analysis::of`] fits lanes
//! without a map and finds leads, followings and cut-ins. A [`TrafficRuleFile`] evaluates
//! formulas on all vehicles. [`TrafficModel::fit`] measures how often drivers brake
//! and cut in, [`TrafficModel::rarity`] rates a [`DrivingBehaviour`], and [`NaturalLimit`]
//! masks actions that would make an event too rare.
//!
//! Architecture Invariant: knows no file, no clock, no scene and no ego.

mod acceleration_model;
mod analysis;
mod braking;
mod calibration;
mod column_map;
mod driving_data;
mod error;
mod following;
mod grid;
mod lane_frame;
mod limit;
mod model;
mod path;
mod plan;
mod rarity;
mod read;
mod recording;
mod rules;
mod simplex;
mod situations;
mod starts;
mod tail;
mod timestamp;
mod world;

pub use acceleration_model::AccelerationModel;
pub use analysis::Analysis;
pub use braking::{
    BRAKING_MPS2, BrakingEvent, BrakingMeter, DECISION_S, SpeedSeries, speed_series,
};
pub use calibration::CalibrationRow;
pub use column_map::{
    AngleColumn, AngleUnit, ClassColumns, ColumnMap, LengthUnit, Reference, SizeColumns,
    TimeColumn, VectorColumns, YAxis,
};
pub use error::ReadError;
pub use following::{LEAD_GAP_M, Lead, Leads, TTC_MAX_S};
pub use lane_frame::{Carriageway, Lane, LaneFrame, MappedCarriageway, PlacedTrack};
pub use limit::NaturalLimit;
pub use model::{Domain, Exposure, ModelError, SourceFile, TrafficModel};
pub use path::{Path, PathPlace};
pub use plan::{PIECE_S, SpeedPlan};
pub use rarity::{CutInState, DrivingBehaviour, Outside, RareEvent, Rarity, RatedEvent, Surprise};
pub use read::{read_csv, read_csv_guessed};
pub use recording::{Class, HOLE_S, ReadCounts, RoadUserTrack, TrafficRecording};
pub use rules::{BoundRules, RuleResult, RulesError, TrafficRule, TrafficRuleFile, WorstRow};
pub use situations::{
    CUT_IN_GAP_M, LaneChange, RecordedCutIn, RecordedFollowing, Situations, WINDOW_S,
};
pub use starts::{StartRarity, StartState, StartTable};
pub use tail::{COUNTED_FROM, EventRate, EventTail, Pareto, RateSource, TailPoint};
pub use world::{RecordedWorld, following_worlds};
