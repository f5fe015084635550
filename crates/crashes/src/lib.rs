//! Kept crashes: minimized, explained, replayed, and exported to other tools.
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

pub mod crashes;
pub mod openx;

use brakecheck_ego::ego;
use brakecheck_experiment::{experiment, run_dir, search};
use brakecheck_files::ron_file;
#[cfg(feature = "raster")]
use brakecheck_raster::raster;
use brakecheck_report::report;
use brakecheck_road::road;
use brakecheck_scene::{preventability, rulebook, scene, testbench};
#[cfg(test)]
use brakecheck_sim::severity;
use brakecheck_sim::sim;
use brakecheck_stl as stl;
use brakecheck_stl::trace;
use brakecheck_world::world;
use brakecheck_xml::{visible, xml};
