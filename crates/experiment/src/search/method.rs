//! Interface of a search method: its description and its inputs.

use std::fmt;

use strum::VariantArray;

use super::found::SearchResult;
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::Policy;
use crate::run_dir::{Stored, Unconfirmed};
use crate::scene::Start;
use crate::scene::drive::EgoDrive;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// Default number of simulations per start of sampling methods.
pub const BUDGET: u64 = 100;

/// The same default if a trained policy proposes the sequences.
pub const GUIDED_BUDGET: u64 = 20;

/// Default of the largest number of action switches of [`super::list::Switches`].
///
/// Rows call the starts that this default solves reachable.
pub const SWITCHES: usize = 2;

/// Most switches that can be requested.
///
/// The number of sequences grows as a power of them.
pub const MOST_SWITCHES: usize = 10;

/// The same default for programs, of which every sequence takes a whole run.
pub const SWITCHES_OF_PROGRAMS: usize = 1;

/// Returns the default number of switches of a search of some egos.
pub fn usual_switches(egos: &[EgoUnderTest]) -> usize {
    // Your own controllers in Python are not copied either.
    let is_foreign = |ego: &EgoUnderTest| ego.scenario().ego().is_some_and(EgoDrive::is_foreign);
    if egos.iter().any(is_foreign) {
        SWITCHES_OF_PROGRAMS
    } else {
        SWITCHES
    }
}

/// Option of some search methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub enum MethodOption {
    /// Largest number of action switches in a sequence.
    Switches,
    /// Simulations per start.
    Budget,
    /// Run that provides the training counterexamples to begin with.
    Bank,
    /// Run whose trained policy proposes the sequences.
    Guided,
}

impl MethodOption {
    /// Returns the option with its value, as typed.
    pub fn usage(self) -> &'static str {
        match self {
            MethodOption::Switches => "--switches M",
            MethodOption::Budget => "--budget SIMS",
            MethodOption::Bank => "--bank RUN",
            MethodOption::Guided => "--guided RUN",
        }
    }

    /// Returns the text of the default.
    pub fn default_text(self) -> String {
        match self {
            MethodOption::Switches => format!("{SWITCHES}, programs {SWITCHES_OF_PROGRAMS}"),
            MethodOption::Budget => format!("{BUDGET}, guided {GUIDED_BUDGET}"),
            MethodOption::Bank | MethodOption::Guided => "RUN".to_owned(),
        }
    }

    pub(super) fn about(self) -> &'static str {
        match self {
            MethodOption::Switches => "Most switches of action in a sequence",
            MethodOption::Budget => "Simulations per start",
            MethodOption::Bank => "The run whose training counterexamples are mutated",
            MethodOption::Guided => "The run whose trained policy proposes the sequences",
        }
    }

    /// Returns the flag alone, `--budget` for `--budget SIMS`.
    pub(super) fn flag(self) -> &'static str {
        let usage = self.usage();
        usage.split_once(' ').map_or(usage, |(flag, _)| flag)
    }
}

/// Request for a search that is not possible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SearchError {
    /// Unknown name of a method.
    #[error("no search method is called `{name}`")]
    UnknownMethod {
        /// Requested name.
        name: String,
    },
    /// The method does not use the option.
    #[error("`{}` does nothing with `--method {method}`", option.flag())]
    DoesNothing {
        /// The option.
        option: MethodOption,
        /// Name of the method.
        method: &'static str,
        /// Options of the method.
        takes: &'static [MethodOption],
    },
    /// A method that starts from the counterexamples of a training has none.
    #[error("`--method mutate` needs the counterexamples of a training")]
    NothingToMutate,
    /// A method that plays what a trained policy proposes has none.
    #[error("`--method guided` needs the policy of a training")]
    NothingToGuide,
}

/// Description of a method: its name, its help and its options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MethodInfo {
    /// Name, as given to `--method`.
    pub name: &'static str,
    /// One line on the choice of sequences, without a full stop.
    pub help: &'static str,
    /// Options that have an effect.
    pub takes: &'static [MethodOption],
    /// Default number of simulations per start, 0 for methods without a budget.
    pub budget: u64,
    /// Whether the kinematic plant pre-screens sequences for the rigid plant.
    pub(super) prescreens: bool,
}

impl MethodInfo {
    /// Describes a method that samples within a budget.
    pub(super) const fn sampling(name: &'static str, help: &'static str) -> MethodInfo {
        MethodInfo {
            name,
            help,
            takes: &[MethodOption::Budget],
            budget: BUDGET,
            prescreens: false,
        }
    }

    /// Returns the text of the default of an option.
    pub fn default_text(&self, option: MethodOption) -> String {
        match option {
            // The option lists the defaults of all methods, and only one of them is meant
            // here.
            MethodOption::Budget => self.budget.to_string(),
            other => other.default_text(),
        }
    }

    /// Returns whether an option has an effect.
    pub fn takes(&self, option: MethodOption) -> bool {
        self.takes.contains(&option)
    }
}

/// Trained policy that proposes the sequences of a search.
#[derive(Clone, Copy)]
pub struct GuidingPolicy<'a>(pub &'a dyn Policy);

impl fmt::Debug for GuidingPolicy<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // A policy is a network, which no message shows.
        f.write_str("GuidingPolicy")
    }
}

/// Settings of a method, which reads the [options it takes](MethodInfo).
#[derive(Clone, Copy, Debug, Default)]
pub struct MethodSettings<'a> {
    /// Largest number of action switches in a sequence. `None`: [`SWITCHES`].
    pub switches: Option<usize>,
    /// Counterexamples of a training.
    pub stored: Option<&'a Stored>,
    /// Trained policy that proposes sequences.
    pub guide: Option<GuidingPolicy<'a>>,
}

/// Start to search, with everything needed for it.
pub(super) struct StartSearch<'a> {
    /// Requested world.
    pub scenario: &'a Scenario,
    /// The same world on the plant that pre-screens, if any.
    pub cheap: Option<&'a Scenario>,
    /// Bench of the requested world.
    pub bench: &'a mut Testbench,
    pub start: &'a Start,
    /// Noise of the episode, on which the generator of the method depends as well.
    pub noise: u64,
    pub index: usize,
    pub budget: u64,
    pub watch: &'a Watch<'a>,
}

/// Search method: each file of this directory implements it.
pub(super) trait SearchMethod<'a>: Copy {
    /// Name, help and options.
    const INFO: MethodInfo;

    /// Builds the method from its settings.
    ///
    /// # Errors
    /// Returns an error if a required setting is missing.
    fn with(settings: &MethodSettings<'a>) -> Result<Self, SearchError>;

    /// Returns the name in rows, with the budget and the unconfirmed sequences.
    fn text(&self, budget: u64, _unconfirmed: Option<Unconfirmed>) -> String {
        format!("{}, {budget} simulations", Self::INFO.name)
    }

    /// Searches one start. `None`: stopped from outside before a result.
    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult>;
}
