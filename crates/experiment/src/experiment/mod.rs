//! An experiment: an ego under test, its test starts, and the loop that plays them.
//!
//! Everything here runs in parallel per episode and gives the same rows for any
//! number of threads: starts, noise and actors are pure functions of their keys.

mod audience;
pub mod clustering;
mod cost;
mod ego_under_test;
mod episode_frames;
pub mod episode_loop;
mod error;
mod failed_leaf;
mod failure_kind;
mod neutral_rule;
mod progress;
mod repeatability;
mod running_robustness;
mod test_starts;
mod traffic;
mod trivial_starts;

pub use crate::scene::drive::ControllerFactory;
pub use audience::{Audience, ShownEpisode};
pub use clustering::{CrashFeatures, badness, clusters, descending, worse_first};
pub use cost::Cost;
pub use ego_under_test::{EgoUnderTest, consent, on_plant};
pub use ego_under_test::{consent_to, consent_to_family};
pub use episode_frames::{ActionRun, EpisodeFrames, ShownFrame, action_runs, ego_of, phase_word};
pub use episode_loop::{EpisodeLoop, WorkItem};
pub use error::{EgoError, unknown_ego_help};
pub use failed_leaf::{leaf, violated};
pub use failure_kind::FailureKind;
pub use neutral_rule::NeutralRule;
pub use progress::{Remark, StepPlace, TrainingIntervals, Watch};
pub use repeatability::{check_repeatability, unrepeatable};
pub use running_robustness::{
    RunningRobustness, SampleInstant, decided, ending_at, verdict_instant,
};
pub use test_starts::{TestStarts, test_starts};
pub use test_starts::{drawn_starts, test_noise, test_start, untried_starts};
pub use traffic::traffic_model;
pub use traffic::{TrafficError, in_named_traffic};
pub use trivial_starts::TrivialStarts;
