#![doc = include_str!("../README.md")]

mod column_map;
mod error;
mod following;
mod grid;
mod lane_frame;
mod path;
mod read;
mod recording;
mod rules;
mod situations;
mod timestamp;

pub use column_map::{
    AngleColumn, AngleUnit, ClassColumns, ColumnMap, LengthUnit, Reference, SizeColumns,
    TimeColumn, VectorColumns, YAxis,
};
pub use error::ReadError;
pub use following::{LEAD_GAP_M, Lead, Leads, TTC_MAX_S};
pub use lane_frame::{Carriageway, Lane, LaneFrame, PlacedTrack};
pub use path::{Path, PathPlace};
pub use read::{read_csv, read_file, read_file_guessed};
pub use recording::{Class, HOLE_S, ReadCounts, Recording, Track};
pub use rules::{BoundRules, Rule, RuleFile, RuleResult, RulesError, WorstRow};
pub use situations::{CUT_IN_GAP_M, CutIn, Following, LaneChange, Situations, WINDOW_S};
