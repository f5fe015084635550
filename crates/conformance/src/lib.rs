//! Checks that your implementation keeps the promises of its trait.
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

pub mod conformance;

// With these names, paths such as `crate::ego` read as in the main crate.
use brakecheck_ego::ego;
use brakecheck_rl::rl;
use brakecheck_scene::scene;
use brakecheck_stats::seed;
