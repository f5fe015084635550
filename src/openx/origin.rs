//! What every file says of where it comes from.

/// Who wrote it; the properties of a scenario begin with it, too.
pub(super) const AUTHOR: &str = "brakecheck";
/// Files are not dated, so that equal crashes give equal bytes.
pub(super) const DATE: &str = "2020-01-01T00:00:00";
