//! The documentation that is not of single items: how to write a world, bring an
//! ego, read a report, and what was measured.

/// Every verb of the command line, from Rust.
#[doc = include_str!("../docs/library.md")]
pub mod library {}

/// Writing a world, from an empty file to a trained ado.
#[doc = include_str!("../docs/worlds.md")]
pub mod worlds {}

/// The world file, field by field.
#[doc = include_str!("../docs/world-file.md")]
pub mod world_file {}

/// Oncoming traffic, roads that cross, parked cars, what hides.
#[doc = include_str!("../docs/roads.md")]
pub mod roads {}

/// Scripts by laws, meetings, ados that stray from them, start tables.
#[doc = include_str!("../docs/plans.md")]
pub mod plans {}

/// Euro NCAP and UN R157 from OpenSCENARIO as worlds.
#[doc = include_str!("../docs/protocols.md")]
pub mod protocols {}

/// Stock egos, sensors, changed egos.
#[doc = include_str!("../docs/egos.md")]
pub mod egos {}

/// What formulas speak of, and how to derive more.
#[doc = include_str!("../docs/signals.md")]
pub mod signals {}

/// Bringing an ego in any language.
#[doc = include_str!("../docs/ego-protocol.md")]
pub mod ego_protocol {}

/// A trained ado in another simulator.
#[doc = include_str!("../docs/ado-protocol.md")]
pub mod ado_protocol {}

/// Training out of the box: what happens, how long, what is said at the end.
#[doc = include_str!("../docs/training.md")]
pub mod training {}

/// Reusing an ado on changed egos.
#[doc = include_str!("../docs/reuse.md")]
pub mod reuse {}

/// An ado that learns an ego of another structure from runs of it.
#[doc = include_str!("../docs/adapting.md")]
pub mod adapting {}

/// Searching without learning.
#[doc = include_str!("../docs/search.md")]
pub mod search {}

/// Many worlds, egos, ados and starts in pieces that can die.
#[doc = include_str!("../docs/campaigns.md")]
pub mod campaigns {}

/// Every hyperparameter with its reason.
#[doc = include_str!("../docs/learners.md")]
pub mod learners {}

/// What the plants model and what not.
#[doc = include_str!("../docs/physics.md")]
pub mod physics {}

/// Which reference drivers avoid a crash.
#[doc = include_str!("../docs/preventability.md")]
pub mod preventability {}

/// Run directories and kept files.
#[doc = include_str!("../docs/files.md")]
pub mod files {}

/// Kept crashes: how severe, how small, why, whether they persist.
#[doc = include_str!("../docs/crashes.md")]
pub mod crashes {}

/// Crashes as OpenSCENARIO and OpenDRIVE.
#[doc = include_str!("../docs/export.md")]
pub mod export {}

/// What may and may not be said of a result.
#[doc = include_str!("../docs/claims.md")]
pub mod claims {}

/// The page and the JUnit file of a run.
#[doc = include_str!("../docs/report.md")]
pub mod report {}

/// The paper's theorems as checks.
#[doc = include_str!("../docs/theorems.md")]
pub mod theorems {}

/// Of what the intervals speak.
#[doc = include_str!("../docs/intervals.md")]
pub mod intervals {}

/// Equation, function, deviation.
#[doc = include_str!("../docs/paper.md")]
pub mod paper {}
