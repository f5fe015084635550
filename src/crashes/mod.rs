//! Crashes: saved, minimized, explained, replayed, exported and drawn.

mod export;
mod highlights;
mod minimize;
mod perturbation_robustness;
mod picture;
mod replay;
mod reruns;
mod root_cause;
mod save_crashes;
mod view_kind;

pub use export::{ExportRefusal, Exports, NotExported, export, openx, write_openx};
pub use highlights::{Highlight, highlights};
pub use minimize::{CLOSING, effort, shrink};
pub use perturbation_robustness::{FRICTION, START, persistence};
pub use picture::{Inapplicable, picture};
pub use replay::Difference;
pub use replay::FindError;
pub use replay::SavedCounterexample;
pub use replay::{RegressionError, Regressions, Replayed, replay};
pub use reruns::KEEP_RUNS;
pub(crate) use reruns::copies;
pub use root_cause::{SubstituteDriver, decisive, last_chance, why};
pub use save_crashes::{
    Again, CrashSelection, CrashWriter, Form, KeepSettings, KeptFiles, PERSISTENT, about, file_stem,
};
pub use view_kind::{UnknownViewKind, ViewKind};
