//! Statistics of rates over starts and trainings, and the fits that use them.

mod cross_entropy;
mod interval;
mod least_squares;
mod logistic;
mod outcomes;

pub(crate) use cross_entropy::{CrossEntropySearch, Fit, pick};
pub use interval::mcnemar;
pub use interval::predicted;
pub use interval::{
    at_most, mean_difference, paired_difference, runs_interval, seeds_interval, wilson,
};
pub(crate) use least_squares::{cost, descend};
pub(crate) use logistic::{SMALL_WEIGHTS, add_equation, logistic};
pub use outcomes::{Flips, Outcomes, StartOutcome, UnknownMark};
