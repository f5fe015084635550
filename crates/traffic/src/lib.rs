#![doc = include_str!("../README.md")]
//!
//! # First steps
//!
//! Read a CSV file with [`read_csv`] and a [`ColumnMap`], OpenSCENARIO trajectories with
//! [`read_xosc`], or an OSI trace with [`read_osi`] or [`read_mcap`]. [`write_osi`] writes one. [`Analysis::of`] fits lanes
//! without a map and finds leads, followings, cut-ins and crossings. A [`TrafficRuleFile`] evaluates
//! formulas on all vehicles. [`RecordedWorlds::of`] groups situations that can
//! share a world. [`fit_traffic`] measures how
//! often drivers brake and cut in. The model itself, and the limits on actions that it
//! gives, are those of `brakecheck-driver-model`, whose items this crate re-exports.
//!
//! Architecture Invariant: knows no file, no clock, no scene and no ego.

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

mod agreement;
mod analysis;
mod calibration;
mod column_map;
mod columns;
mod commonroad;
mod crossing_plan;
mod crossing_roads;
mod crossings;
mod csv_rows;
mod driving_data;
mod error;
mod fcd;
mod fit;
mod following;
mod grid;
mod lane_change_plan;
mod lane_frame;
mod lane_road;
mod lanelet;
mod lanes;
mod lead;
mod mcap;
mod median;
mod named_map;
mod osi;
mod osi_message;
mod osi_schema;
mod osi_writer;
mod other_plan;
mod parts;
mod path;
mod path_leads;
mod picture;
mod plan;
mod positions;
mod problem;
mod raw;
mod read;
mod recording;
mod recording_meta;
mod reference_line;
mod road_fit;
mod rules;
mod situation_plan;
mod situations;
mod sizes;
mod speed_series;
mod start_table;
mod stock_body;
mod summary;
mod svg;
mod world;
mod xml_lines;
mod xosc;
mod xosc_entity;

pub use analysis::Analysis;
pub use brakecheck_driver_model::*;
pub use brakecheck_road::road::Course;
pub use column_map::{
    AngleColumn, AngleUnit, ClassColumns, ColumnMap, LengthUnit, Reference, SizeColumns, SpeedUnit,
    TimeColumn, VectorColumns, YAxis,
};
pub use columns::RecordingColumns;
pub use commonroad::read_commonroad;
pub use crossing_roads::CrossingRoads;
pub use crossings::{CROSSING_PET_S, CROSSING_RAD, PathCrossing};
pub use error::ReadError;
pub use fcd::{is_commonroad, read_fcd, read_xml};
pub use fit::fit_traffic;
pub use following::Leads;
pub use lane_change_plan::LaneChangePlan;
pub use lane_frame::{Carriageway, LaneFrame, MappedCarriageway, NoLanes};
pub use lanelet::{centre_line, read_lanelets};
pub use lanes::{Lane, PlacedTrack};
pub use lead::{LEAD_GAP_M, Lead, TTC_MAX_S};
pub use mcap::read_mcap;
pub use osi::read_osi;
pub use osi_writer::{OsiAxles, OsiBody, OsiFrame, OsiState, OsiTrace, write_osi};
pub use other_plan::{OtherPlan, RecordedMotion};
pub use path::{Path, PathPlace};
pub use picture::{svg_instant, svg_overview};
pub use plan::{PIECE_S, SpeedPlan, rounded};
pub use problem::{FilePlace, FileProblem};
pub use read::{CsvColumns, read_csv, read_csv_guessed, read_csv_timed};
pub use recording::{Class, HOLE_S, ReadCounts, RoadUserTrack, TrafficRecording};
pub use recording_meta::RecordingMeta;
pub use road_fit::FittedRoad;
pub use rules::{BoundRules, EvaluatedRows};
pub use situation_plan::{
    AcrossPlan, LANE_CHANGE_AT_S, LANE_WIDTH_M, LanePlace, RecordedPlace, SituationPlan,
    SituationRoad,
};
pub use situations::{
    LaneChange, RecordedCutIn, RecordedFollowing, SituationKind, Situations, WINDOW_S,
};
pub use speed_series::speed_series;
pub use start_table::start_table;
pub use stock_body::StockBody;
pub use summary::{CarriagewaySummary, CrossingSummary, LaneSummary, RecordingSummary};
pub use world::{RecordedWorld, RecordedWorlds};
pub use xosc::read_xosc;
