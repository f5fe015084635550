//! World files as values: their shapes, their schema and their text.
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

pub mod world_file;

// With these names, paths such as `crate::ego` read as in the main crate.
use brakecheck_ego::ego;
use brakecheck_files::ron_file;
use brakecheck_rl::rl;
use brakecheck_road::road;
use brakecheck_scene::{rulebook, scene, testbench};
use brakecheck_sim::sim;
use brakecheck_story as story;
