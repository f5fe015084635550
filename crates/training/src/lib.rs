//! Trainings of ados, alone and as populations.
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

pub mod population;
pub mod training;

use brakecheck_crashes::crashes;
#[cfg(test)]
use brakecheck_ego::ego;
use brakecheck_experiment::{adversary, experiment, run_dir, search};
use brakecheck_files::{content_hash, ron_file, run_files};
use brakecheck_risk::risk;
use brakecheck_rl::rl;
use brakecheck_scene::{rulebook, scene, testbench};
#[cfg(test)]
use brakecheck_sim::severity;
use brakecheck_sim::sim;
use brakecheck_stats::{seed, stats};
use brakecheck_world::world;
