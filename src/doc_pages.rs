//! Guide pages: how to write a world, bring an ego, read a report, and the
//! measurements.

/// Every command of the command line, from Rust.
#[doc = include_str!("../docs/library.md")]
pub mod library {}

/// Writing a world, from an empty file to a trained ado.
#[doc = include_str!("../docs/worlds.md")]
pub mod worlds {}

/// The world file, field by field.
#[doc = include_str!("../docs/world-file.md")]
pub mod world_file {}

/// Oncoming traffic, crossing roads, parked cars and occlusion.
#[doc = include_str!("../docs/roads.md")]
pub mod roads {}

/// Scripted motion by laws, encounters, deviations and start tables.
#[doc = include_str!("../docs/plans.md")]
pub mod plans {}

/// Euro NCAP and UN R157 protocols from OpenSCENARIO as worlds.
#[doc = include_str!("../docs/protocols.md")]
pub mod protocols {}

/// Stock egos, sensors and changed egos.
#[doc = include_str!("../docs/egos.md")]
pub mod egos {}

/// Signals for formulas, and how to derive more.
#[doc = include_str!("../docs/signals.md")]
pub mod signals {}

/// Connecting an ego in any language.
#[doc = include_str!("../docs/ego-protocol.md")]
pub mod ego_protocol {}

/// Running a trained ado in another simulator.
#[doc = include_str!("../docs/ado-protocol.md")]
pub mod ado_protocol {}

/// Training with default settings: steps, duration and the final report.
#[doc = include_str!("../docs/training.md")]
pub mod training {}

/// Reusing an ado on changed egos.
#[doc = include_str!("../docs/reuse.md")]
pub mod reuse {}

/// Adapting an ado to an ego of another structure from its runs.
#[doc = include_str!("../docs/adapting.md")]
pub mod adapting {}

/// Search without learning.
#[doc = include_str!("../docs/search.md")]
pub mod search {}

/// Many worlds, egos, ados and starts in resumable shards.
#[doc = include_str!("../docs/campaigns.md")]
pub mod campaigns {}

/// Every hyperparameter with its reason.
#[doc = include_str!("../docs/learners.md")]
pub mod learners {}

/// Scope and limits of the physical models.
#[doc = include_str!("../docs/physics.md")]
pub mod physics {}

/// Reference drivers and the crashes they avoid.
#[doc = include_str!("../docs/preventability.md")]
pub mod preventability {}

/// Run directories and kept files.
#[doc = include_str!("../docs/files.md")]
pub mod files {}

/// Kept crashes: severity, minimization, cause and persistence.
#[doc = include_str!("../docs/crashes.md")]
pub mod crashes {}

/// Crashes as OpenSCENARIO and OpenDRIVE.
#[doc = include_str!("../docs/export.md")]
pub mod export {}

/// Claims that a result supports, and those it does not.
#[doc = include_str!("../docs/claims.md")]
pub mod claims {}

/// HTML page and JUnit file of a run.
#[doc = include_str!("../docs/report.md")]
pub mod report {}

/// The paper's theorems as checks.
#[doc = include_str!("../docs/theorems.md")]
pub mod theorems {}

/// Quantities that the intervals cover.
#[doc = include_str!("../docs/intervals.md")]
pub mod intervals {}

/// Map from the paper's equations to functions and deviations.
#[doc = include_str!("../docs/paper.md")]
pub mod paper {}
