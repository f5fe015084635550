//! Guide pages: how to write a world, bring an ego, read a report, and the
//! measurements.

/// Every command of the command line, from Rust.
#[doc = include_str!("../docs/guide/library.md")]
pub mod library {}

/// Jobs for GitHub Actions, GitLab CI and pre-commit.
#[doc = include_str!("../docs/guide/ci.md")]
pub mod ci {}

/// Recorded traffic: lanes, rules on it, worlds from it, naturalness models.
#[doc = include_str!("../docs/guide/recordings.md")]
pub mod recordings {}

/// Writing a world, from an empty file to a trained ado.
#[doc = include_str!("../docs/guide/worlds.md")]
pub mod worlds {}

/// Worlds in VS Code, Neovim and Zed.
#[doc = include_str!("../docs/guide/editors.md")]
pub mod editors {}

/// The world file, field by field.
#[doc = include_str!("../docs/reference/world-file.md")]
pub mod world_file {}

/// Oncoming traffic, crossing roads, parked cars and occlusion.
#[doc = include_str!("../docs/guide/roads.md")]
pub mod roads {}

/// Scripted motion by laws, encounters, deviations and start tables.
#[doc = include_str!("../docs/guide/plans.md")]
pub mod plans {}

/// Euro NCAP and UN R157 protocols from OpenSCENARIO as worlds.
#[doc = include_str!("../docs/reference/protocols.md")]
pub mod protocols {}

/// Stock egos, sensors and changed egos.
#[doc = include_str!("../docs/reference/egos.md")]
pub mod egos {}

/// Connecting an ego in any language.
#[doc = include_str!("../docs/reference/ego-protocol.md")]
pub mod ego_protocol {}

/// Running a trained ado in another simulator.
#[doc = include_str!("../docs/reference/ado-protocol.md")]
pub mod ado_protocol {}

/// Training with default settings: steps, duration and the final report.
#[doc = include_str!("../docs/guide/training.md")]
pub mod training {}

/// Rewards for severe or distinct failures.
#[doc = include_str!("../docs/guide/goals.md")]
pub mod goals {}

/// Rules, formula parts and starts that episodes never covered.
#[doc = include_str!("../docs/guide/coverage.md")]
pub mod coverage {}

/// Reusing an ado on changed egos.
#[doc = include_str!("../docs/guide/reuse.md")]
pub mod reuse {}

/// Adapting an ado to an ego of another structure from its runs.
#[doc = include_str!("../docs/guide/adapting.md")]
pub mod adapting {}

/// Probability of a failure in declared traffic.
#[doc = include_str!("../docs/guide/risk.md")]
pub mod risk {}

/// The smallest change of an ego with which it withstands.
#[doc = include_str!("../docs/guide/harden.md")]
pub mod harden {}

/// Search without learning.
#[doc = include_str!("../docs/guide/search.md")]
pub mod search {}

/// Many worlds, egos, ados and starts in resumable shards.
#[doc = include_str!("../docs/guide/campaigns.md")]
pub mod campaigns {}

/// Every hyperparameter with its reason.
#[doc = include_str!("../docs/background/learners.md")]
pub mod learners {}

/// Scope and limits of the physical models.
#[doc = include_str!("../docs/background/physics.md")]
pub mod physics {}

/// Reference drivers and the crashes they avoid.
#[doc = include_str!("../docs/background/preventability.md")]
pub mod preventability {}

/// Run directories and kept files.
#[doc = include_str!("../docs/reference/files.md")]
pub mod files {}

/// Keeping and reading crashes.
#[doc = include_str!("../docs/guide/crashes.md")]
pub mod crashes {}

/// Definitions of severity, minimization, cause, persistence and similarity.
#[doc = include_str!("../docs/reference/crash-labels.md")]
pub mod crash_labels {}

/// Crashes as OpenSCENARIO and OpenDRIVE.
#[doc = include_str!("../docs/guide/export.md")]
pub mod export {}

/// Claims that a result supports, and those it does not.
#[doc = include_str!("../docs/background/claims.md")]
pub mod claims {}

/// HTML page and JUnit file of a run.
#[doc = include_str!("../docs/guide/report.md")]
pub mod report {}

/// A page in the browser to drive in a world.
#[doc = include_str!("../docs/guide/drive.md")]
pub mod drive {}

/// Pictures and recordings of a crash.
#[doc = include_str!("../docs/guide/pictures.md")]
pub mod pictures {}

/// Quantities that the intervals cover.
#[doc = include_str!("../docs/background/intervals.md")]
pub mod intervals {}

/// Map from the paper's equations to functions and deviations.
#[doc = include_str!("../docs/background/paper.md")]
pub mod paper {}
