//! Arguments of `brakecheck eval`.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::headings::{ADOS, TEST};
use super::live::{Live, Streamed};
use super::number_args::whole_number;
use super::test_args::{EgoArgs, TestArgs};
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct EvalArgs {
    /// Run directory of a trained ado, or a world to play its points, or baselines and search.
    #[arg(value_name = "RUN|WORLD.ron")]
    pub(super) run: PathBuf,
    #[command(flatten)]
    pub(super) ego: EgoArgs,
    /// Also check the paper's theorems: 1 to 3 on a grid, 3 and Lemma 1 on the road.
    #[arg(long, help_heading = TEST)]
    pub(super) theorems: bool,
    /// Test the first N members of a population, and count their cells of failures.
    #[arg(long, value_name = "all|N", value_parser = members, help_heading = ADOS)]
    pub(super) members: Option<usize>,
    /// Exit with 1 if any ado makes an ego fail.
    #[arg(long)]
    pub(super) fail_on_counterexample: bool,
    #[command(flatten)]
    pub(super) test: TestArgs,
}

/// Parses a number of members, `usize::MAX` for all.
fn members(text: &str) -> Result<usize, &'static str> {
    if text == "all" {
        return Ok(usize::MAX);
    }
    // No member would play nothing, so 0 is refused like an unknown word.
    let number = whole_number(text).filter(|number| *number > 0);
    number
        // A number of members need not fit into a `usize` of 32 bits.
        .and_then(|number| usize::try_from(number).ok())
        .ok_or("all, or a number of members from 1")
}

impl EvalArgs {
    /// Opens the stream of an evaluation of a world, if one is requested.
    pub(super) fn open_live(&self, world: &Scenario) -> Result<Live, Failure> {
        self.test.live.open(world.name(), Streamed::Episodes)
    }
}
