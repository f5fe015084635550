//! Statistics of rates over starts and trainings, and the fits that use them.

mod distributions;
mod interval;
mod matrix_game;
mod optimization;
mod outcomes;
mod species;

pub use distributions::{
    clopper_pearson_upper, normal_cdf, normal_quantile, pareto_shape, poisson_tail, student_cdf,
    student_quantile,
};
pub use interval::predicted;
pub use interval::{
    at_most, mcnemar, mean_difference, paired_difference, runs_interval, seeds_interval, wilson,
};
pub use matrix_game::{Equilibrium, row_gains};
pub use optimization::{CrossEntropySearch, SMALL_WEIGHTS, add_equation, descend, logistic, pick};
pub use outcomes::Flips;
pub use outcomes::{Outcomes, StartOutcome};
pub use species::{Incidence, KindsEstimate, NewKinds};
