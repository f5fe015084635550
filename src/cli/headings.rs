//! Headings of the options that `--help-all` alone lists.
//!
//! An option without a heading is among the first that you need, and `--help` lists it.

/// The ego under test.
pub(super) const EGO: &str = "Ego";
/// Ados, and the traffic that they belong to.
pub(super) const ADOS: &str = "Ados and traffic";
/// Starts, physics and effort.
pub(super) const TEST: &str = "Test";
/// The learning of an ado.
pub(super) const LEARNING: &str = "Learning";
/// Files that are read besides the first.
pub(super) const INPUT: &str = "Input";
/// Files that are written, and printed text.
pub(super) const OUTPUT: &str = "Output";
/// Threads, programs and faults.
pub(super) const RUNNING: &str = "Running";
