//! Storyboards with the meaning of OpenSCENARIO 1.3, checked and interpreted.
//!
//! [`values`] has the storyboard as data, [`check`] resolves its names, and [`run`]
//! interprets it sample by sample. The scene supplies motion and actions ([`view`]).
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

pub mod axis;
pub mod check;
mod condition;
pub mod robustness;
pub mod run;
mod tree;
mod trigger;
pub mod values;
pub mod view;

pub use tree::ElementKind;

use brakecheck_files::ron_file;
use brakecheck_road::{pose, road, trajectory};
