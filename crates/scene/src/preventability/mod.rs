//! Assessment of a contact by reference drivers in the ego's place.
//!
//! A developer needs a counterexample that another driver would have avoided. Each
//! [reference driver](crate::ego::ReferenceDriver) takes the ego's place on the ego's body. All
//! other agents repeat the recorded motion. [`Replayer::assess`] reports the drivers that
//! avoid the contact and derives a [`Label`]. `docs/background/preventability.md` lists the
//! assumptions and the limits of a label, and has an example.
//!
//! Architecture Invariant: nothing here changes an episode, a verdict or a file.

mod avoidability;
mod contact;
mod moments;
mod outcome;
mod reference_drive;
mod replayer;

pub use avoidability::Avoidability;
pub use outcome::{DriverOutcome, Label, NotApplicable, Preventability, ReplayContact, Struck};
pub use reference_drive::Seat;
pub use replayer::{BrakingReplays, FilmedDriver, RecordedEpisode, Replayer};

use crate::ego::reference::ReferenceDriver;

/// Drivers that determine the labels and are reported, in this order.
pub const PANEL: [ReferenceDriver; 6] = [
    ReferenceDriver::Cc,
    ReferenceDriver::CcLane,
    ReferenceDriver::CcLatched,
    ReferenceDriver::Reg,
    ReferenceDriver::Rss,
    ReferenceDriver::Fsm,
];

/// Human models of UN R157, which decide whether a crash counts as preventable.
pub const HUMAN_MODELS: [ReferenceDriver; 2] = [ReferenceDriver::CcLatched, ReferenceDriver::Fsm];
