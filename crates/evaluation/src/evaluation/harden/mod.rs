//! Hardening: the smallest change of an ego with which it withstands.
//!
//! A change gives other values to parameters of a stock ego, or to those that a program
//! declares. It is searched against trained ados, kept crashes and, on request, a search
//! of every start, with limits on what it may cost in natural traffic.
//!
//! An ado is then trained against the smallest change. If it makes the ego fail more often
//! than allowed, it joins the others, and the search begins again: counterexample-guided
//! synthesis, with a training as the verifier. The few changes that are left are confirmed
//! on sealed starts and draws that no search and no training has seen.
//!
//! A [`Sweep`](super::Sweep) is the case of one parameter, and begins every search.

mod ado_set;
mod candidate;
mod confirm;
mod ego_parameters;
mod error;
mod files;
mod hardening;
mod losses;
mod optimizer;
mod report;

pub use ado_set::{AdoSet, HardeningAdo};
pub use ego_parameters::{EgoParameter, EgoParameters};
pub use error::HardenError;
pub use hardening::{HardenRequest, HardenSettings};
pub use losses::{DrivingLoss, LossLimit};
pub use report::{
    AdoRun, Confirmation, FrontPoint, HardenReport, HardenVerdict, HardenedEgo, KeptCrashes,
    LossResult, NewAdo, StartCount,
};
