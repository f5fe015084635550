//! A page in the browser to drive in a world, live.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck), which re-exports its public items.
//! This crate makes no semver promise: any release may change or remove an item.

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

pub mod drive;

use brakecheck_crashes::crashes;
use brakecheck_ego::ego;
use brakecheck_experiment::{experiment, run_dir, search};
use brakecheck_files::{content_hash, run_files};
use brakecheck_report::report;
use brakecheck_rl::rl;
use brakecheck_scene::{rulebook, scene, testbench};
use brakecheck_world::world;
