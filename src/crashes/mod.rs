//! Crashes: saved, minimized, explained, replayed, exported and drawn.

pub(crate) mod export;
mod failure_cell;
mod find;
mod highlights;
pub(crate) mod minimize;
mod osi_trace;
pub(crate) mod perturbation_robustness;
mod picture;
mod regressions;
pub(crate) mod replay;
mod reruns;
pub(crate) mod root_cause;
pub(crate) mod save_crashes;

pub use export::{ExportRefusal, ExportSettings, Exports, NotExported, export, export_with};
pub(crate) use export::{openx, write_openx};
pub use failure_cell::CellFinder;
pub use find::FindError;
pub(crate) use highlights::highlights;
pub use picture::{Inapplicable, UnknownViewKind, ViewKind, picture};
pub use regressions::{RegressionError, Regressions};
pub(crate) use replay::newest_of_training;
pub use replay::{Difference, Replayed, SavedCounterexample};
pub(crate) use reruns::{KEEP_RUNS, copies};
pub use save_crashes::{CrashSelection, Form, KeepSettings, KeptFiles};
pub(crate) use save_crashes::{description, file_stem, keep_cells, labels_of_contact};
