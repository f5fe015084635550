//! World files in editors: diagnostics, hover and completion over the language server protocol.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck), which re-exports its public items.
//! This crate makes no semver promise: any release may change or remove an item.
//!
//! Architecture Invariant: it knows the notation of world files and no world.
//! [`WorldLanguage`] gives it checks, shapes and names, and starts no program.

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

mod cursor;
mod document;
mod expansion;
mod frame;
mod items;
mod language;
mod messages;
mod names;
mod outline;
mod session;
mod shapes;
#[cfg(test)]
mod tests;
mod uri;

pub use language::{CheckedText, KnownName, WorldLanguage, WorldProblem};
pub use session::{SessionEnd, serve};
