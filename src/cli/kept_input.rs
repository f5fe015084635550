//! Kept counterexamples as they are named: a file, a directory, a run, or `-`.

use std::path::Path;

use super::failure::Failure;
use super::input;
use crate::crashes::Regressions;

/// Returns the kept counterexamples, or a single one of them.
///
/// # Errors
/// There is none, or one is damaged.
pub(super) fn find(what: &Path, episode: Option<&str>) -> Result<Regressions, Failure> {
    let is_csv = what.extension().is_some_and(|it| it == "csv");
    let beside = what.with_extension("ron");
    // Both files of a crash share one name, so the wrong one is easily given.
    if is_csv && beside.is_file() {
        return Err(Failure::input(
            format!(
                "`{}` has the samples of a kept counterexample",
                what.display()
            ),
            format!("name its file: `{}`", beside.display()),
        ));
    }
    if !input::is_stdin(what) {
        return Ok(Regressions::find(what, episode)?);
    }
    // Standard input is a single counterexample, of number 0.
    if let Some(other) = episode.filter(|it| *it != "0") {
        return Err(Failure::input(
            format!("standard input has one counterexample, and no `{other}`"),
            "leave the number or name out",
        ));
    }
    let text = input::text(what).map_err(|error| {
        Failure::input(
            format!("cannot read standard input: {error}"),
            "pipe a kept counterexample into it, or name its file",
        )
    })?;
    Ok(Regressions::of_text(
        // Test cases and pictures are named after the file, and `-` names nothing.
        Path::new("standard-input.ron"),
        &text,
    )?)
}
