//! Origin that every file states.

/// Author of the files, and prefix of the properties of a scenario.
pub(super) const AUTHOR: &str = "brakecheck";
/// Date of every file, constant so that equal crashes give equal bytes.
pub(super) const DATE: &str = "2020-01-01T00:00:00";
