//! Checks that your implementation keeps the promises of its trait.
//!
//! A line in a test suffices:
//!
//! ```
//! # mod brakecheck {
//! #     pub use brakecheck_conformance::conformance;
//! #     pub use brakecheck_ego::ego;
//! # }
//! use brakecheck::conformance::check_controller;
//! use brakecheck::ego::{Command, Controller, Fault, Percept};
//!
//! /// Brakes harder and harder, and forgets to let go at the next episode.
//! #[derive(Clone, Default)]
//! struct Grumpy(f64);
//!
//! impl Controller for Grumpy {
//!     fn reset(&mut self, _seed: u64) {}
//!     fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
//!         self.0 -= 0.01;
//!         Ok(Command::accelerate(self.0))
//!     }
//!     fn fork(&self) -> Option<Box<dyn Controller>> {
//!         Some(Box::new(self.clone()))
//!     }
//! }
//!
//! let error = check_controller(&|| Box::new(Grumpy::default())).unwrap_err();
//! assert!(error.to_string().starts_with("`reset` forgets what was before: "));
//! ```
//!
//! The promises, in the order in which they are checked:
//!
//! | promise | controller | env | policy | scene |
//! | --- | --- | --- | --- | --- |
//! | spaces: shapes, bounds, everything written | ±20 m/s², ±20 m/s | yes | actions | yes |
//! | finite: no NaN, no infinity, no fault | yes | yes | yes | yes |
//! | episodes end | | yes | | yes |
//! | equal inputs give equal bits | yes | yes | in any order | yes |
//! | `reset` forgets what was before | yes | yes | | yes |
//! | a fork goes on bit for bit, and shares nothing | yes | | | yes |
//! | threads change nothing | yes | yes | yes | yes |
//!
//! All subjects run open loop through the same few episodes. A check thus costs
//! about twenty short episodes and gives the same result each time.

mod controller;
mod env;
mod policy;
mod recorded;
mod scene;

use std::fmt;

pub use controller::check_controller;
pub use env::check_env;
pub use policy::check_policy;
pub use scene::check_scene;

/// Promise of the traits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// Shapes and bounds are as stated, and every number is written.
    Spaces,
    /// No NaN, no infinity, and no fault.
    Finite,
    /// Episodes end.
    Ends,
    /// Equal seeds, percepts, actions and observations give equal bits.
    Deterministic,
    /// Earlier episodes have no effect after a reset.
    PureReset,
    /// A copy continues bit for bit, and neither affects the other.
    Fork,
    /// Instances that run at the same time have no effect.
    Parallel,
}

impl Promise {
    /// Returns advice on how to mend the code that broke it.
    pub fn cure(self) -> &'static str {
        match self {
            Promise::Spaces => "state the shapes that are used, write all of them, and scale them",
            Promise::Finite => "guard divisions and roots, and answer every step",
            Promise::Ends => "end an episode at a horizon",
            Promise::Deterministic => {
                "answer from the inputs, the seed and the steps since the reset alone"
            }
            Promise::PureReset => "set every field that a step changes when an episode begins",
            Promise::Fork => "copy every field that a step changes, and share none of them",
            Promise::Parallel => "keep state in the value itself, in no static and no file",
        }
    }
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Promise::Spaces => "spaces are honoured",
            Promise::Finite => "answers are finite",
            Promise::Ends => "episodes end",
            Promise::Deterministic => "equal inputs give equal bits",
            Promise::PureReset => "`reset` forgets what was before",
            Promise::Fork => "a fork goes on bit for bit",
            Promise::Parallel => "threads change nothing",
        })
    }
}

/// A broken promise with its place and the observation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{promise}: {place}{what}; {}", .promise.cure())]
pub struct Nonconformity {
    /// The broken promise.
    pub promise: Promise,
    /// Episode, step and signal, where they are known.
    pub(crate) place: Place,
    /// Observation.
    pub what: String,
}

/// Place of a broken promise. Steps count from the reset, which is step 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Place {
    /// Episode and step.
    pub step: Option<(u64, usize)>,
    /// Name of the wrong signal or number.
    pub signal: Option<String>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some((episode, step)) = self.step {
            write!(f, "episode {episode}, step {step}: ")?;
        }
        match &self.signal {
            Some(signal) => write!(f, "`{signal}` "),
            None => Ok(()),
        }
    }
}

/// All broken promises, each with the first place.
///
/// `Debug` is `Display`, so that `unwrap` in a test prints a line for each.
#[derive(Clone, PartialEq, Eq, thiserror::Error)]
pub struct Nonconformities(pub Vec<Nonconformity>);

impl fmt::Display for Nonconformities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, one) in self.0.iter().enumerate() {
            let gap = if i == 0 { "" } else { "\n" };
            write!(f, "{gap}{one}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Nonconformities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}
