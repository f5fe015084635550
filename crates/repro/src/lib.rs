//! Tables and figures of "Automatic Testing With Reusable Adversarial Agents".
//!
//! The program `repro` trains, evaluates and searches with the public functions of
//! `brakecheck` only. `README.md` names the command of every table.

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

mod behaviours;
mod case_studies;
mod cli;
mod crashes;
mod extreme;
mod letter;
mod milestones;
mod near;
mod page;
mod paper_rows;
mod record;
mod reuse_study;
mod structures;
mod table1;
#[cfg(test)]
mod tests;

pub use behaviours::{
    FigureError, Shown, start_with, three_merges, two_at_the_light, two_behaviours,
};
pub use case_studies::{
    CaseStudies, CaseStudy, DeeperSearch, TrainedContacts, WorldResult, case_study, deeper_search,
    trained_contacts, trained_run,
};
pub use cli::main;
pub use crashes::{CrashStudyError, crash_study, crashes_markdown};
pub use letter::{
    JUDGES, LETTER_PATHS, LetterBaselines, LetterEnds, LetterError, LetterPath, LetterRow,
    LetterStudy, LetterStudyError, letter_baselines, letter_markdown, letter_row,
};
pub use near::{NearFailing, TrainedPolicy, near_starts, near_starts_markdown};
pub use page::case_studies_markdown;
pub use paper_rows::{PaperRow, measure_paper_row, paper_rows_markdown};
pub use reuse_study::{ReuseError, ReuseStudy, ReuseStudyConfig, reuse_markdown};
pub use structures::{
    RUNS, StructureMeans, StructureRow, StructureStudy, other_structures, structures_markdown,
};
pub use table1::{PaperScale, Table1, Table1Error, table1, table1_markdown};
