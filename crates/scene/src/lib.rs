//! Scenes with an ego and ados, the rules that judge them, and the bench that plays them.
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

pub mod natural;
pub mod preventability;
pub mod rulebook;
pub mod scene;
pub mod testbench;

use brakecheck_ego::ego;
use brakecheck_files::{content_hash, ron_file};
use brakecheck_rl::rl;
use brakecheck_road::{road, trajectory};
use brakecheck_sim::{severity, sim};
use brakecheck_stats::{seed, stats};
use brakecheck_stl as stl;
use brakecheck_stl::trace;
use brakecheck_story as story;
