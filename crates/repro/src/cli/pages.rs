//! Recorded rows, and the pages that are made from them.

use super::{Exit, Failure, ReproduceArgs};
use crate::page::{README, RESULTS, ResultPages};
use crate::record::{NewRow, RecordError, Results};
use brakecheck::cli::terminal;
use brakecheck::run_dir::write_file;

/// Refuses a directory without the pages.
pub(super) fn require_root(args: &ReproduceArgs) -> Result<(), Failure> {
    if args.root.join(README).is_file() && args.root.join(RESULTS).is_file() {
        return Ok(());
    }
    Err(Failure::input(
        format!("`{}` has no {RESULTS}", args.root.display()),
        "run the command in a copy of the repository, or name it with `--root`",
    ))
}

/// Records rows of a study.
pub(super) fn record(args: &ReproduceArgs, study: &str, rows: Vec<NewRow>) -> Result<(), Failure> {
    // The figures record nothing, and their study has no file.
    if rows.is_empty() {
        return Ok(());
    }
    // Read from the disk for each study, because the one before has written to it.
    let mut results = Results::read(&args.root)?;
    Ok(results.record(&args.root, study, rows)?)
}

/// Writes the pages from the recorded rows, or checks them.
pub(super) fn write(args: &ReproduceArgs) -> Result<Exit, Failure> {
    require_root(args)?;
    let results = Results::read(&args.root)?;
    let digests = results.digests()?;
    let pages = ResultPages::of(&args.root, &results, &digests)?;
    for row in &pages.outdated {
        terminal::note(&format!("of an earlier version: {row}"));
    }
    if args.check {
        return check(args, &pages);
    }
    // Both pages are made before the first is written, so a mistake in a row changes
    // none.
    for (file, text) in pages.files() {
        write_file(&args.root.join(file), text.as_bytes())?;
    }
    Ok(Exit::Done)
}

/// Refuses pages that differ from their rows, and rows of an earlier version.
fn check(args: &ReproduceArgs, pages: &ResultPages) -> Result<Exit, Failure> {
    for (file, text) in pages.files() {
        // A page that cannot be read differs as well.
        let found = std::fs::read_to_string(args.root.join(file)).unwrap_or_default();
        if found != text {
            return Err(Failure::input(
                format!("`{file}` is not made from `results/`"),
                "run `repro page`",
            ));
        }
    }
    match pages.outdated.first() {
        Some(row) => Err(Failure::input(
            format!("a row is of an earlier version: {row}"),
            "measure it again with `--record`",
        )),
        None => Ok(Exit::Done),
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Failure {
        match error {
            RecordError::Disk(error) => error.into(),
            other => Failure::input(
                other.to_string(),
                "restore the file, or measure its rows again",
            ),
        }
    }
}
