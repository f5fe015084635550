//! Crashes: saved, minimized, explained, replayed, exported and drawn.

mod export;
mod find;
mod highlights;
mod minimize;
mod perturbation_robustness;
mod picture;
mod regressions;
mod replay;
mod reruns;
mod root_cause;
mod save_crashes;

pub(crate) use export::write_openx;
pub use export::{ExportRefusal, Exports, NotExported, export, openx};
pub use find::FindError;
pub(crate) use highlights::highlights;
pub use minimize::{CLOSING, effort, shrink};
pub use perturbation_robustness::persistence;
pub use picture::{Inapplicable, UnknownViewKind, ViewKind, picture};
pub use regressions::{RegressionError, Regressions};
pub(crate) use replay::newest_of_training;
pub use replay::{Difference, Replayed, SavedCounterexample, replay};
pub(crate) use reruns::KEEP_RUNS;
pub(crate) use reruns::copies;
pub use root_cause::{SubstituteDriver, decisive, last_chance, why};
pub(crate) use save_crashes::file_stem;
pub(crate) use save_crashes::keep_cells;
pub use save_crashes::{
    CrashSelection, CrashWriter, Form, KeepSettings, KeptFiles, PERSISTENT, description,
};
