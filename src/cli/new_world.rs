//! Worlds that `brakecheck new` writes: the small one, and the problems of others.

use std::path::Path;

use super::failure::Failure;
use super::failure::Note;
use crate::ron_file::ScenarioError;
use crate::world::Scenario;

/// Problems of a scenario that are printed.
pub(super) const MOST_NOTES: usize = 50;
/// Characters of a line of a world that are printed.
const MOST_CHARS: usize = 120;

/// Text of the new world, without its name.
const WORLD: &str = include_str!("new_world.ron");

/// Returns the text of a small world of this name.
///
/// # Errors
/// The name cannot name a world.
pub(super) fn text_named(name: &str) -> Result<String, Failure> {
    // The placeholder is also in the remarks, whose commands then fit the file.
    let text = WORLD.replace("NAME", name);
    // The checks of the world decide on valid names.
    match Scenario::parse(name, &text) {
        Ok(_) => Ok(text),
        Err(_) => Err(Failure::input(
            format!("`{name}` cannot name a world"),
            "at most 64 letters, digits, _ and -: files are named after it",
        )),
    }
}

/// Refuses to write a file that is there already.
///
/// # Errors
/// Something has this name.
pub(super) fn refuse_taken(path: &Path) -> Result<(), Failure> {
    // A dangling link counts as a file, too, because writing would replace it.
    if path.symlink_metadata().is_err() {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "`{}` is there already, and is left as it is",
            path.display()
        ),
        "choose another name, or move the file away",
    ))
}

/// Returns the problems of a world that is made of another file, and so is not written.
///
/// No place in its text helps. `in_file` states the place of the other file that leads
/// to an offset of the text, with the problem.
pub(super) fn refused(error: &ScenarioError, in_file: impl Fn(usize, &str) -> String) -> Vec<Note> {
    let notes = error.problems.iter().map(|problem| {
        let (line, _) = error.line_column(problem.span.start);
        // Lines count from 1.
        let line: String = error
            .text
            .lines()
            .nth(line - 1)
            .unwrap_or_default()
            .trim()
            .chars()
            .take(MOST_CHARS)
            .collect();
        let what = format!(
            "a world does not allow what this leads to: {}, in `{line}`",
            problem.what
        );
        let help = problem
            .help
            .as_deref()
            .unwrap_or("change the numbers that lead to it");
        Note::new(&in_file(problem.span.start, &what), Some(help))
    });
    notes.take(MOST_NOTES).collect()
}
