//! Arguments of `brakecheck eval`.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::live::{Live, Streamed};
use super::test_args::{EgoArgs, TestArgs};
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct EvalArgs {
    /// Run directory of a trained ado; or a world, to play its points, or baselines and search.
    #[arg(value_name = "RUN|WORLD.ron")]
    pub(super) run: PathBuf,
    #[command(flatten)]
    pub(super) ego: EgoArgs,
    /// Also check the paper's theorems: 1 to 3 on a grid, 3 and Lemma 1 on the road.
    #[arg(long)]
    pub(super) theorems: bool,
    /// Exit with 1 if any ado makes an ego fail.
    #[arg(long)]
    pub(super) fail_on_counterexample: bool,
    #[command(flatten)]
    pub(super) test: TestArgs,
}

impl EvalArgs {
    /// Opens the stream of an evaluation of a world, if one is requested.
    pub(super) fn open_live(&self, world: &Scenario) -> Result<Live, Failure> {
        self.test.live.open(world.name(), Streamed::Episodes)
    }
}
