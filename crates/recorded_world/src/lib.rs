//! Recorded situations as world files.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck), which re-exports its public items.
//! This crate makes no semver promise: any release may change or remove an item.

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

pub mod commonroad;
pub mod recorded_world;

use brakecheck_ego::ego;
use brakecheck_files::ron_file;
use brakecheck_road::{opendrive, pose, road};
use brakecheck_scene::{rulebook, scene};
use brakecheck_sim::sim;
use brakecheck_traffic as traffic;
use brakecheck_world_file::world_file;
