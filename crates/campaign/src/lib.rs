//! Campaigns of many worlds, egos and ados, in resumable pieces.
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

pub mod campaign;

use brakecheck_evaluation::{coverage, evaluation};
use brakecheck_experiment::{experiment, run_dir, search};
use brakecheck_files::{content_hash, ron_file};
use brakecheck_report::report;
use brakecheck_rl::rl;
use brakecheck_scene::{preventability, rulebook, scene, testbench};
use brakecheck_sim::{severity, sim};
use brakecheck_stats::{seed, stats};
use brakecheck_stl as stl;
use brakecheck_training::training;
use brakecheck_world::world;
