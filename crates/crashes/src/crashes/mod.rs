//! Crashes: saved, minimized, explained, replayed, exported and drawn.

pub mod export;
mod failure_cell;
mod find;
mod highlights;
pub mod minimize;
mod osi_trace;
pub mod perturbation_robustness;
mod picture;
mod regressions;
pub mod replay;
mod replay_difference;
mod replay_page;
mod replay_suite;
mod reruns;
pub mod root_cause;
pub mod save_crashes;

pub use export::{ExportRefusal, ExportSettings, Exports, NotExported, export, export_with};
pub use export::{openx, write_openx};
pub use failure_cell::{AdoDigit, CellFinder};
pub use find::FindError;
pub use highlights::highlights;
pub use picture::{Inapplicable, PictureError, PictureFormat, UnknownViewKind, ViewKind};
pub use picture::{picture, picture_as};
pub use regressions::{RegressionError, Regressions};
pub use replay::newest_of_training;
pub use replay::{BrokenRuleOfReplay, ReplayCounts, ReplayOutcome, Replayed, SavedCounterexample};
pub use replay_difference::Difference;
pub use replay_page::replay_page;
pub use replay_suite::{ReplayQuestion, case_name};
pub use reruns::{KEEP_RUNS, copies};
pub use save_crashes::{CrashSelection, Form, KeepSettings, KeptFiles};
pub use save_crashes::{description, file_stem, keep_cells, labels_of_contact};
