//! Adversarial testing of driving controllers: **can a car that keeps every
//! rule still make yours crash?**
//!
//! brakecheck trains adversarial road users ("ados") against a driving
//! controller ("the ego"), in physics, under rules stated in Signal Temporal
//! Logic, and hands over the crashes: watchable, replayable bit for bit, and
//! usable as regression tests against the next version of the ego.
//!
//! It implements "Automatic Testing With Reusable Adversarial Agents" (Qin,
//! Aréchiga, Best, Deshmukh). `docs/background/paper.md` maps its equations to functions.
//!
//! A tour, from the bottom up:
//!
//! ```
//! use brakecheck::world::Scenario;
//! use brakecheck::testbench::{Aftermath, Constant, play};
//! use brakecheck::seed::{Purpose, StartKey};
//!
//! // A world is one RON file: road, agents, what the ego must never do, and
//! // which rules the ado must keep.
//! let world = Scenario::parse("acc.ron", include_str!("../worlds/acc.ron"))?;
//! assert_eq!(world.ego_spec().to_string(), "always[0, T] (headway >= d_safe)");
//!
//! // Play one episode: the ado brakes all the time, which its rules forbid.
//! let mut bench = world.bench();
//! let key = StartKey { purpose: Purpose::Test, seed: 0, index: 0 };
//! let start = bench.draw(key);
//! let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
//! println!("{:?} after {} samples", episode.verdict, episode.judged);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`doc_pages`] has an example for every verb of the command line.

#![warn(
    unreachable_pub,
    clippy::dbg_macro,
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    clippy::todo,
    clippy::unimplemented,
    clippy::unwrap_used
)]
#![cfg_attr(
    test,
    allow(clippy::disallowed_methods, clippy::expect_used, clippy::unwrap_used)
)]

#[doc(inline)]
pub use brakecheck_campaign::campaign;
#[doc(inline)]
pub use brakecheck_experiment::adversary;
pub mod cli;
#[doc(inline)]
pub use brakecheck_conformance::conformance;
#[doc(inline)]
pub use brakecheck_crashes::crashes;
// Users need no hashes, and code here writes `crate::content_hash`.
use brakecheck_files::content_hash;
#[doc(inline)]
pub use brakecheck_recorded_world::commonroad;
pub mod doc_pages;
#[cfg(feature = "drive")]
#[doc(inline)]
pub use brakecheck_drive::drive;
#[doc(inline)]
pub use brakecheck_ego::ego;
#[doc(inline)]
pub use brakecheck_evaluation::coverage;
#[doc(inline)]
pub use brakecheck_evaluation::evaluation;
#[doc(inline)]
pub use brakecheck_experiment::experiment;
#[doc(inline)]
pub use brakecheck_scene::natural;
/// OpenSCENARIO and OpenDRIVE files: export of crashes, and import of test protocols.
// Export and import are in two crates, which users see as one module.
pub mod openx {
    pub use brakecheck_crashes::openx::*;
    #[doc(inline)]
    pub use brakecheck_openx::openx::import;
}
/// Definition 4: from prioritised rules and ψ_ego to a verdict and a reward.
pub mod rulebook {
    #[doc(inline)]
    pub use brakecheck_scene::rulebook::*;
    // Goals change the reward, so they belong here, although worlds define them.
    #[doc(inline)]
    pub use brakecheck_world::world::TrainingGoal;
}
#[doc(inline)]
pub use brakecheck_experiment::run_dir;
#[doc(inline)]
pub use brakecheck_experiment::search;
use brakecheck_files::ron_file;
use brakecheck_files::run_files;
#[cfg(feature = "raster")]
#[doc(inline)]
pub use brakecheck_raster::raster;
#[doc(inline)]
pub use brakecheck_recorded_world::recorded_world;
#[doc(inline)]
pub use brakecheck_report::report;
#[doc(inline)]
pub use brakecheck_risk::risk;
#[doc(inline)]
pub use brakecheck_rl::rl;
#[doc(inline)]
pub use brakecheck_scene::preventability;
#[doc(inline)]
pub use brakecheck_scene::scene;
#[doc(inline)]
pub use brakecheck_stats::seed;
#[doc(inline)]
pub use brakecheck_training::population;
pub mod serving;
use brakecheck_evaluation::theorems;
#[doc(inline)]
pub use brakecheck_experiment::vector_env;
#[doc(inline)]
pub use brakecheck_scene::testbench;
use brakecheck_sim::sim;
#[doc(inline)]
pub use brakecheck_stats::stats;
#[doc(inline)]
pub use brakecheck_story as story;
#[doc(inline)]
pub use brakecheck_training::training;
#[cfg(feature = "rerun")]
#[doc(inline)]
pub use brakecheck_view::view;
#[doc(inline)]
pub use brakecheck_world::world;
#[doc(inline)]
pub use brakecheck_world_file::world_file;
use brakecheck_xml::visible;

#[doc(inline)]
pub use cli::ErrorReport;

#[doc(inline)]
pub use brakecheck_stl as stl;
#[doc(inline)]
pub use brakecheck_stl::trace;
