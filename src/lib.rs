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

#![warn(unreachable_pub)]

pub mod adversary;
pub mod campaign;
pub mod cli;
pub mod conformance;
mod content_hash;
pub mod crashes;
pub mod doc_pages;
pub mod ego;
pub mod evaluation;
pub mod experiment;
mod grid_solver;
pub mod natural;
// Not part of the API: it has no stability promise.
#[doc(hidden)]
pub mod internals;
mod opendrive;
pub mod openx;
pub mod population;
mod pose;
pub mod preventability;
pub mod report;
pub mod risk;
pub mod rl;
mod road;
mod ron_file;
pub mod rulebook;
pub mod run_dir;
mod run_files;
pub mod scene;
pub mod search;
pub mod seed;
pub mod serving;
mod severity;
mod sim;
pub mod stats;
mod surrogate;
pub mod testbench;
mod theorems;
pub mod training;
pub mod vector_env;
#[cfg(feature = "rerun")]
pub mod view;
mod visible;
pub mod world;

#[doc(inline)]
pub use cli::Report;

#[doc(inline)]
pub use brakecheck_stl as stl;
#[doc(inline)]
pub use brakecheck_stl::trace;
