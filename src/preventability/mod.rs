//! Which reference drivers avoid a contact in the ego's place?
//!
//! A counterexample is worth a developer's time if another driver in the
//! ego's place would have come away from it. Each [reference
//! driver](crate::ego::reference) takes the ego's place on the ego's body, while
//! everybody else repeats the recorded motion; [`Replayer::assess`] says who avoids the
//! contact, and sums it up as a [`Label`]. What is assumed, and what a label
//! does not say, is in `docs/preventability.md`.
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
//! // Nobody was hit: there is nothing to prevent.
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

pub use moments::CutIn;
pub use outcome::{
    DriverOutcome, Exoneration, Label, NotApplicable, Preventability, ReplayContact, Struck,
};
pub use replayer::{FilmedDriver, RecordedEpisode, Replayer, Seat};

use crate::ego::reference::ReferenceDriver;

/// The drivers whose outcomes make the labels and are reported, in this order.
pub const PANEL: [ReferenceDriver; 6] = [
    ReferenceDriver::Cc,
    ReferenceDriver::CcLane,
    ReferenceDriver::CcLatched,
    ReferenceDriver::Reg,
    ReferenceDriver::Rss,
    ReferenceDriver::Fsm,
];
