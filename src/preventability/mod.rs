//! Assessment of a contact by reference drivers in the ego's place.
//!
//! A developer needs a counterexample that another driver would have avoided. Each
//! [reference driver](crate::ego::ReferenceDriver) takes the ego's place on the ego's body. All
//! other agents repeat the recorded motion. [`Replayer::assess`] reports the drivers that
//! avoid the contact and derives a [`Label`]. `docs/background/preventability.md` lists the
//! assumptions and the limits of a label.
//!
//! ```
//! use brakecheck::preventability::Label;
//! use brakecheck::world::Scenario;
//! use brakecheck::seed::{Purpose, StartKey};
//! use brakecheck::testbench::{Aftermath, Constant, play};
//!
//! let world = Scenario::parse("acc.ron", include_str!("../../worlds/acc.ron"))?;
//! let mut bench = world.bench();
//! let start = bench.draw(StartKey { purpose: Purpose::Train, seed: 0, index: 0 });
//! let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Skip);
//! // The episode has no contact, so there is nothing to prevent.
//! assert_eq!(world.preventability(&episode).label, Label::NotApplicable);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Architecture Invariant: nothing here changes an episode, a verdict or a file.

mod contact;
mod moments;
mod outcome;
mod reference_drive;
mod replayer;

pub use outcome::{DriverOutcome, Label, NotApplicable, Preventability, ReplayContact, Struck};
pub use reference_drive::Seat;
pub use replayer::{FilmedDriver, RecordedEpisode, Replayer};

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
