//! Pages, tables, figures and pictures of results.
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

pub mod report;

use brakecheck_ego::ego;
use brakecheck_experiment::{experiment, run_dir};
use brakecheck_road::road;
use brakecheck_scene::{preventability, rulebook, scene, testbench};
use brakecheck_sim::{severity, sim};
#[cfg(test)]
use brakecheck_stats::seed;
use brakecheck_stats::stats;
use brakecheck_stl::trace;
use brakecheck_world::world;
use brakecheck_xml::visible;
