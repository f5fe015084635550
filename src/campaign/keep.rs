//! Keeping the counterexamples of an evaluation as files.

use std::path::{Path, PathBuf};

use super::eval::{EvalRequest, Evaluated};
use crate::run::{Counterexample, KeptError, file_name, make_dir};
use crate::scenario::Change;
use crate::testbench::{Episode, Testbench};

/// Writes the first `most` counterexamples of an evaluation into a directory.
///
/// Each is played again (episodes are pure functions of their start) and
/// written as `WORLD-EGO-INDEX.ron` with its samples as `.csv` beside it.
///
/// # Errors
/// The disk refuses.
pub fn keep(
    request: &EvalRequest<'_>,
    change: &Change,
    evaluated: &Evaluated,
    dir: &Path,
    most: usize,
) -> Result<Vec<PathBuf>, KeptError> {
    let mut again = |bench: &mut Testbench, index| request.play(bench, index);
    keep_played(request, change, evaluated, dir, most, &mut again)
}

/// The same, for starts whose solution `again` plays.
///
/// # Errors
/// The disk refuses.
pub fn keep_played(
    request: &EvalRequest<'_>,
    change: &Change,
    evaluated: &Evaluated,
    dir: &Path,
    most: usize,
    again: &mut dyn FnMut(&mut Testbench, usize) -> Episode,
) -> Result<Vec<PathBuf>, KeptError> {
    make_dir(dir)?;
    let mut bench = request.scenario.bench();
    let solved = evaluated.outcomes.iter().enumerate();
    let solved = solved
        .filter(|(_, outcome)| outcome.is_some_and(|outcome| outcome.verdict.is_success()))
        .take(most);
    let mut files = Vec::new();
    for (index, _) in solved {
        let episode = evaluated.again(request, &mut bench, index, again);
        let ado = request.ado.word();
        let kept = Counterexample::record(request.scenario, request.ego, change, ado, &episode);
        let stem = file_stem(request, index);
        files.push(kept.save_as(dir, &stem, &episode.trace)?);
    }
    Ok(files)
}

/// `WORLD-EGO-PLANT-SEED-INDEX`, with whatever could disturb a path replaced.
fn file_stem(request: &EvalRequest<'_>, index: usize) -> String {
    let plant = format!("{:?}", request.scenario.plant()).to_lowercase();
    format!(
        "{}-{}-{plant}-{}-{index:04}",
        file_name(&request.scenario.name),
        file_name(request.ego),
        request.starts.seed
    )
}
