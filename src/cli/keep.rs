//! Options of `eval` and `search` for kept counterexamples.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::crashes::{CrashSelection, Form, KEEP_RUNS, KeepSettings};

/// Default number of kept counterexamples per ego.
const USUAL: usize = 10;

/// Which counterexamples are written as files, and in which form.
#[derive(Args, Clone, Debug)]
pub(super) struct KeepArgs {
    /// Write the worst counterexamples that differ and persist into a directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Counterexamples to write per ego, at most [default: 10; of points all]
    #[arg(long, value_name = "N", requires = "keep")]
    keep_most: Option<usize>,
    /// Write every counterexample, like others or not.
    #[arg(long, requires = "keep", conflicts_with = "keep_most")]
    keep_all: bool,
    /// Write them as they were found, instead of as small as they get.
    #[arg(long, requires = "keep")]
    as_found: bool,
    /// Runs of a program to minimize and label each counterexample, at most.
    #[arg(long, value_name = "N", default_value_t = KEEP_RUNS, requires = "keep")]
    keep_runs: u64,
}

impl KeepArgs {
    /// The directory, if anything is to be kept.
    pub(super) fn dir(&self) -> Option<&Path> {
        self.keep.as_deref()
    }

    /// Returns the settings, with the choice `usual` by default.
    fn settings_of(&self, usual: CrashSelection) -> KeepSettings {
        let choice = match (self.keep_all, self.keep_most) {
            (true, _) => CrashSelection::All,
            (false, Some(most)) => CrashSelection::Worst(most),
            (false, None) => usual,
        };
        let form = if self.as_found {
            Form::AsFound
        } else {
            Form::Shrunk
        };
        KeepSettings {
            runs: self.keep_runs,
            ..KeepSettings::new(choice, form)
        }
    }

    /// Returns the settings for counterexamples, by default the worst.
    pub(super) fn settings(&self) -> KeepSettings {
        self.settings_of(CrashSelection::Worst(USUAL))
    }

    /// Returns the settings for points, by default all.
    pub(super) fn settings_of_points(&self) -> KeepSettings {
        self.settings_of(CrashSelection::All)
    }
}
