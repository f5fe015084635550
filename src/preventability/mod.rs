//! Would a careful driver have avoided it?
//!
//! A counterexample is worth a developer's time if somebody careful in the
//! ego's place would have come away from it. Each [reference
//! driver](crate::ego::reference) takes the ego's place on the ego's body, while
//! everybody else repeats the recorded motion; [`assess`] says who avoids the
//! contact, and sums it up as a [`Label`]. What is assumed, and what a label
//! does not say, is in `docs/preventability.md`.
//!
//! ```
//! use brakecheck::preventability::{Label, assess};
//! use brakecheck::scenario::Scenario;
//! use brakecheck::seed::{Purpose, StartKey};
//! use brakecheck::testbench::{Aftermath, Constant, play};
//!
//! let world = Scenario::parse("acc.ron", include_str!("../../worlds/acc.ron"))?;
//! let mut bench = world.bench();
//! let start = bench.draw(StartKey { purpose: Purpose::Train, seed: 0, index: 0 });
//! let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Skip);
//! // Nobody was hit: there is nothing to prevent.
//! assert_eq!(assess(&world, &episode).label, Label::NotApplicable);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Architecture Invariant: nothing here changes an episode, a verdict or a file.

mod contact;
mod moments;
mod outcome;
mod replayer;
mod stint;

pub use moments::CutIn;
pub use outcome::{
    Band, DriverOutcome, Exoneration, Label, NotApplicable, Preventability, ReplayContact, Struck,
};
pub use replayer::{Case, Replayer, Seat};

use crate::ego::reference::ReferenceDriver;
use crate::scenario::Scenario;
use crate::scene::Motion;
use crate::testbench::{Episode, motion_of};

/// The drivers whose outcomes make the labels and are reported, in this order.
pub const PANEL: [ReferenceDriver; 6] = [
    ReferenceDriver::Cc,
    ReferenceDriver::CcLane,
    ReferenceDriver::CcLatched,
    ReferenceDriver::Reg,
    ReferenceDriver::Rss,
    ReferenceDriver::Fsm,
];

/// Which drivers would have avoided the contact of an episode of `scenario`.
///
/// The episode is played again for everybody's motion; what an ego that nobody
/// here wrote commanded is repeated, so that no program is started.
pub fn assess(scenario: &Scenario, episode: &Episode) -> Preventability {
    let again = match episode.commands.is_empty() {
        true => scenario.clone(),
        false => scenario.with_commands(&episode.commands.clone().into()),
    };
    if episode.contact.is_none() {
        return Preventability::not_applicable(NotApplicable::NoContact);
    }
    let motion = motion_of(&mut again.bench(), episode).filter(|motion| !motion.is_empty());
    match (motion, Replayer::new(scenario)) {
        (Some(motion), Some(mut replayer)) => replayer.assess(&motion, Some(&episode.trace)),
        _ => Preventability::not_applicable(NotApplicable::NotDriven),
    }
}

/// Whether any of `drivers` avoids the contact in which `motion` ended, from
/// the handover on.
///
/// Stops at the first who does; those who avoid most are asked first. Without a
/// contact to which the drivers apply it is `false`. Whoever asks often keeps a
/// [`Replayer`] instead, which this one makes anew.
pub fn preventable_by(scenario: &Scenario, motion: &Motion, drivers: &[ReferenceDriver]) -> bool {
    let replayer = Replayer::new(scenario);
    replayer.is_some_and(|mut replayer| replayer.preventable_by(motion, drivers))
}
