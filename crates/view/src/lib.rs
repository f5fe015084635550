//! Recordings and live streams for the rerun viewer.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck), which re-exports its public items.
//! This crate makes no semver promise: any release may change or remove an item.

#![cfg(feature = "rerun")]
#![warn(
    clippy::dbg_macro,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::todo,
    clippy::unimplemented,
    clippy::unwrap_used
)]
#![cfg_attr(test, allow(clippy::expect_used, clippy::unwrap_used))]

pub mod view;

use brakecheck_ego::ego;
use brakecheck_experiment::{experiment, run_dir};
use brakecheck_road::road;
use brakecheck_scene::{rulebook, scene, testbench};
use brakecheck_sim::sim;
use brakecheck_stl as stl;
use brakecheck_stl::trace;
use brakecheck_world::world;
