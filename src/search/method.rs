//! What a method of searching says of itself, and what it is given.

use strum::VariantArray;

use super::found::Found;
use crate::experiment::Watch;
use crate::run_dir::{Stored, Unconfirmed};
use crate::scene::Start;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// Simulations per start of methods that sample, unless told otherwise.
pub const BUDGET: u64 = 100;

/// Most switches of action in the sequences of [`super::list::Switches`], unless told
/// otherwise; what it then solves is what rows call reachable.
pub const SWITCHES: usize = 2;

/// An option that some methods take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub enum MethodOption {
    /// Most switches of action in a sequence.
    Switches,
    /// Simulations per start.
    Budget,
    /// The run whose training counterexamples the method begins with.
    From,
}

impl MethodOption {
    /// As it is typed, with what it takes.
    pub fn usage(self) -> &'static str {
        match self {
            MethodOption::Switches => "--switches M",
            MethodOption::Budget => "--budget SIMS",
            MethodOption::From => "--from RUN",
        }
    }

    /// What holds without it.
    pub fn default_text(self) -> String {
        match self {
            MethodOption::Switches => SWITCHES.to_string(),
            MethodOption::Budget => BUDGET.to_string(),
            MethodOption::From => "RUN".to_owned(),
        }
    }

    pub(super) fn about(self) -> &'static str {
        match self {
            MethodOption::Switches => "Most switches of action in a sequence",
            MethodOption::Budget => "Simulations per start",
            MethodOption::From => "The run whose training counterexamples are mutated",
        }
    }

    /// `--budget` of `--budget SIMS`.
    pub(super) fn flag(self) -> &'static str {
        let usage = self.usage();
        usage.split_once(' ').map_or(usage, |(flag, _)| flag)
    }
}

/// A search that cannot be asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SearchError {
    /// No method has this name.
    #[error("no search method is called `{name}`")]
    UnknownMethod {
        /// Name asked for.
        name: String,
    },
    /// An option that the method does not take.
    #[error("`{}` does nothing with `--method {method}`", option.flag())]
    DoesNothing {
        /// The option.
        option: MethodOption,
        /// Name of the method.
        method: &'static str,
        /// Options that the method takes.
        takes: &'static [MethodOption],
    },
    /// A method that begins with counterexamples of a training has none.
    #[error("`--method mutate` needs the counterexamples of a training")]
    NothingToMutate,
}

/// A method by its name: what users read of it, and which options it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MethodInfo {
    /// What `--method` calls it.
    pub name: &'static str,
    /// One line on how it chooses sequences, without a full stop.
    pub help: &'static str,
    /// The options that do something for it.
    pub takes: &'static [MethodOption],
    /// Whether the kinematic plant sorts out sequences for the rigid one.
    pub(super) prescreens: bool,
}

impl MethodInfo {
    /// A method that samples within a budget.
    pub(super) const fn sampling(name: &'static str, help: &'static str) -> MethodInfo {
        MethodInfo {
            name,
            help,
            takes: &[MethodOption::Budget],
            prescreens: false,
        }
    }

    /// Whether an option does something for it.
    pub fn takes(&self, option: MethodOption) -> bool {
        self.takes.contains(&option)
    }
}

/// What a method is built with; of these it reads what it [takes](MethodInfo).
#[derive(Clone, Copy, Debug, Default)]
pub struct MethodSettings<'a> {
    /// Most switches of action in a sequence; `None`: [`SWITCHES`].
    pub switches: Option<usize>,
    /// The counterexamples of a training.
    pub stored: Option<&'a Stored>,
}

/// One start, and what to search it with.
pub(super) struct StartSearch<'a> {
    /// The world asked for.
    pub scenario: &'a Scenario,
    /// The same on the plant that sorts out sequences first, if one does.
    pub cheap: Option<&'a Scenario>,
    /// A bench of the world asked for.
    pub bench: &'a mut Testbench,
    pub start: &'a Start,
    /// The episode's noise, on which the method's dice depend as well.
    pub noise: u64,
    pub index: usize,
    pub budget: u64,
    pub watch: &'a Watch<'a>,
}

/// How sequences of actions are chosen: what a file of this directory is for.
pub(super) trait SearchMethod<'a>: Copy {
    /// Its name, its help and its options.
    const INFO: MethodInfo;

    /// The method with these settings.
    ///
    /// # Errors
    /// It needs one that is missing.
    fn with(settings: &MethodSettings<'a>) -> Result<Self, SearchError>;

    /// What rows call it, with the budget and what did not carry over.
    fn text(&self, budget: u64, _unconfirmed: Option<Unconfirmed>) -> String {
        format!("{}, {budget} simulations", Self::INFO.name)
    }

    /// Searches one start; `None` when stopped from outside before a result.
    fn solve(&self, one: StartSearch<'_>) -> Option<Found>;
}
