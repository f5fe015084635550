//! Egos against adversaries on test starts: tables, gates, sweeps and checks of the theorems.
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

pub mod coverage;
pub mod evaluation;
pub mod theorems;

use brakecheck_crashes::crashes;
use brakecheck_ego::ego;
use brakecheck_experiment::{adversary, experiment, grid_solver, run_dir, search};
use brakecheck_files::ron_file;
use brakecheck_report::report;
use brakecheck_risk::risk;
use brakecheck_rl::rl;
use brakecheck_scene::{preventability, rulebook, scene, testbench};
use brakecheck_stats::{seed, stats};
use brakecheck_stl as stl;
use brakecheck_stl::trace;
use brakecheck_surrogate::surrogate;
use brakecheck_training::{population, training};
use brakecheck_world::world;
