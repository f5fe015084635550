//! Options of `brakecheck eval`.

use std::path::PathBuf;

use clap::Args;

use super::keep::KeepArgs;
use super::number_args::{STARTS, count, start_count};
use super::{Common, one_of};
use crate::adversary::AdoKind;
use crate::evaluation::GateOn;
use crate::sim::PlantKind;

#[derive(Args, Debug)]
pub(super) struct EvalArgs {
    /// The run directory that `train` made; or a world: its points, or its
    /// baselines and search.
    #[arg(value_name = "RUN|WORLD.ron")]
    pub(super) run: PathBuf,
    /// Test starts to draw; of a table of points all are played.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    pub(super) starts: usize,
    /// Who plays the ado; repeat for several. Without it the trained one, beside
    /// which an ado that learns egos (`--runs`) has its baselines.
    #[arg(long, value_parser = one_of::<AdoKind>(), value_name = "ADO")]
    pub(super) ado: Vec<AdoKind>,
    /// Which ego is tested: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    pub(super) ego: String,
    /// The physics to test in, instead of the run's.
    #[arg(long, value_parser = one_of::<PlantKind>())]
    pub(super) plant: Option<PlantKind>,
    /// Also search with at most so many switches, and fill in recall.
    #[arg(long, value_name = "M")]
    pub(super) search: Option<usize>,
    /// Runs of the trained ado per start: the greedy one, then explored ones.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1..=1_000_000))]
    pub(super) tries: u64,
    /// Runs of the ego that the ado may learn it from (100 are enough; a conditional
    /// one identifies it from 10); 0: it plays every ego as it was trained.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=100_000))]
    pub(super) runs: u64,
    #[command(flatten)]
    pub(super) keep: KeepArgs,
    /// Also check the paper's theorems: 1 to 3 on a grid, 3 and Lemma 1 on the road.
    #[arg(long)]
    pub(super) theorems: bool,
    /// The ego before: what fails newly against it decides the exit code.
    #[arg(long, value_name = "NAME|FILE.ron", conflicts_with = "over")]
    pub(super) baseline_ego: Option<String>,
    /// Which newly failing starts exit with 1, with `--baseline-ego`.
    #[arg(
        long,
        value_parser = one_of::<GateOn>(),
        default_value = "preventable",
        requires = "baseline_ego"
    )]
    pub(super) gate: GateOn,
    /// One parameter of the ego over a range instead of `--ego`: where it is safe.
    #[arg(long, value_name = "ego.NAME=LO..HI[:N]", conflicts_with_all = ["ego", "program"])]
    pub(super) over: Option<String>,
    /// Draw the sweep of `--over` as SVG.
    #[arg(long, value_name = "FILE.svg", requires = "over")]
    pub(super) curve: Option<PathBuf>,
    /// Exit with 1 if any ado makes an ego fail.
    #[arg(long)]
    pub(super) fail_on_counterexample: bool,
    /// A program that is the ego, after `--`: typing it consents to start it.
    #[arg(last = true, value_name = "COMMAND")]
    pub(super) program: Vec<String>,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX))]
    pub(super) seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}
