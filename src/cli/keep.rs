//! What `eval` and `search` take about keeping counterexamples.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::campaign::{Choice, Form};

/// Which counterexamples are written as files, and in which form.
#[derive(Args, Clone, Debug)]
pub(super) struct KeepArgs {
    /// Write the worst counterexamples that differ and persist into a directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Counterexamples to write per ego, at most.
    #[arg(long, value_name = "N", default_value_t = 10, requires = "keep")]
    pub(super) keep_most: usize,
    /// Write every counterexample, like others or not.
    #[arg(long, requires = "keep", conflicts_with = "keep_most")]
    keep_all: bool,
    /// Write them as they were found, instead of as small as they get.
    #[arg(long, requires = "keep")]
    as_found: bool,
}

impl KeepArgs {
    /// The directory, if anything is to be kept.
    pub(super) fn dir(&self) -> Option<&Path> {
        self.keep.as_deref()
    }

    pub(super) fn choice(&self) -> Choice {
        match self.keep_all {
            true => Choice::All,
            false => Choice::Worst(self.keep_most),
        }
    }

    pub(super) fn form(&self) -> Form {
        match self.as_found {
            true => Form::AsFound,
            false => Form::Shrunk,
        }
    }
}
