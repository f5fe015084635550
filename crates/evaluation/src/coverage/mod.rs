//! Coverage of a specification, its rules and its starts by episodes that were played.
//!
//! Three questions are answered, each from the episodes of a run, a population, a
//! campaign or kept crashes:
//!
//! - which parts of ψ_ego decide a failure,
//! - which rules ever bound an ado,
//! - which cells of start axes × kinds of failure are empty, after how many tries.
//!
//! A claim of absence needs evidence. A part or a rule without an occurrence in 59 episodes
//! occurs in at most 5 % of such episodes (one-sided 95 % bound), and only then it is
//! *never* seen. A cell is empty if its emptiness is no chance, by an exact test over all
//! cells. Everything else is open.

mod episode;
mod measure;
mod sources;
#[cfg(test)]
mod tests;
mod text;

pub use episode::{
    CoveredEpisode, CoveredFailure, EpisodeObserver, EpisodeOrigin, RuleBound, evenly_spread,
};
pub use measure::{
    AXIS_BINS, CellCoverage, Coverage, CoverageState, KindCoverage, PartCoverage, RuleCoverage,
};
pub use sources::{
    RULED_EPISODES, coverage_of_kept, coverage_of_population, coverage_of_run, observed, tries_of,
};
pub use text::COVERAGE_EXPLAINED;
