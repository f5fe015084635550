//! World files, checked, with the place and the fix of each mistake.
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

pub mod world;

use brakecheck_ego::ego;
use brakecheck_files::{ron_file, run_files};
use brakecheck_rl::rl;
use brakecheck_road::{opendrive, road};
use brakecheck_scene::{natural, preventability, rulebook, scene, testbench};
use brakecheck_sim::sim;
use brakecheck_stats::{seed, stats};
use brakecheck_stl as stl;
use brakecheck_stl::trace;
use brakecheck_story as story;
use brakecheck_world_file::world_file;
