//! `brakecheck search`: action sequences per start, without learning.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{
    Common, Exit, Failure, PlantArg, egos, interrupted_early, on_plant, print_json, start_count,
    table, talk,
};
use crate::campaign::{Method, SearchRequest, Watch, search, test_starts};
use crate::run::RunDir;
use crate::scenario::Scenario;

#[derive(Args, Debug)]
pub(super) struct SearchArgs {
    /// A world file or a run directory.
    #[arg(value_name = "WORLD|RUN")]
    world: PathBuf,
    /// How sequences are chosen.
    #[arg(long, value_enum, default_value = "switches")]
    method: MethodArg,
    /// Most switches of action in a sequence (switches).
    #[arg(long, value_name = "M", default_value_t = 2)]
    switches: usize,
    /// Simulations per start (uniform, hold).
    #[arg(long, value_name = "SIMS", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..))]
    budget: u64,
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = start_count())]
    starts: usize,
    /// Which ego is tested: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// The physics to test in, instead of the world's.
    #[arg(long)]
    plant: Option<PlantArg>,
    /// Exit with 1 if an ego can be made to fail.
    #[arg(long)]
    fail_on_counterexample: bool,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum MethodArg {
    /// A random action at each decision.
    Uniform,
    /// A random action, held for five decisions.
    Hold,
    /// All sequences with at most M switches of action, fewest first.
    Switches,
}

pub(super) fn run(args: &SearchArgs) -> Result<Exit, Failure> {
    let (world, mut nominal) = match args.world.is_dir() {
        true => {
            let run = RunDir::open(&args.world)?;
            (run.world()?, run.scenario()?)
        }
        false => {
            let world = Scenario::load(&args.world)?;
            (world.clone(), world)
        }
    };
    if let Some(plant) = args.plant {
        nominal = on_plant(&nominal, plant)?;
    }
    let egos = egos(&nominal, &args.ego)?;
    let bar = talk::bar("searching", args.starts as u64);
    let watch = Watch {
        progress: &|done, _| bar.set_position(done),
        stop: talk::stop(),
    };
    let Some(starts) = test_starts(&world, args.common.seed, args.starts, &watch) else {
        return Ok(interrupted_early());
    };
    let mut rows = Vec::new();
    for ego in &egos {
        bar.set_message(format!("searching: {}", ego.name));
        let request = SearchRequest {
            scenario: &ego.scenario,
            ego: &ego.name,
            method: match args.method {
                MethodArg::Uniform => Method::Uniform,
                MethodArg::Hold => Method::Hold,
                MethodArg::Switches => Method::Switches(args.switches),
            },
            budget: args.budget,
            starts: &starts,
        };
        rows.push(search(&request, &watch).row);
    }
    bar.finish_and_clear();
    match args.common.json {
        true => print_json(&json!({ "rows": rows })),
        false => talk::data(&table::rows(&rows)),
    }?;
    if talk::stopped() {
        talk::say("interrupted: the rows cover the starts that were finished");
        return Ok(Exit::Interrupted);
    }
    let found = rows.iter().any(|row| 0 < row.successes);
    Ok(match found && args.fail_on_counterexample {
        true => Exit::Counterexample,
        false => Exit::Done,
    })
}
