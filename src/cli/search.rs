//! `brakecheck search`: action sequences per start, without learning.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::keep::KeepArgs;
use super::{
    Common, Exit, Failure, exit_of, interrupted_early, load_world, one_of, open_run, print_json,
    start_count, table, talk,
};
use crate::campaign::{
    BreakEven, Cem, EgoUnderTest, Method, SWITCHES, SearchCampaign, SearchTable,
    counterexamples_for, on_plant,
};
use crate::run::{Row, RunDir, Stored};
use crate::sim::PlantKind;

/// Simulations per start of the other methods, unless told otherwise.
const BUDGET: u64 = 100;

#[derive(Args, Debug)]
pub(super) struct SearchArgs {
    /// A world file or a run directory.
    #[arg(value_name = "WORLD|RUN")]
    world: PathBuf,
    /// How sequences are chosen.
    #[arg(long, value_enum, default_value = "switches")]
    method: MethodArg,
    /// Most switches of action in a sequence (switches) [default: 2].
    #[arg(long, value_name = "M")]
    switches: Option<usize>,
    /// Simulations per start (uniform, hold, cem, mutate) [default: 100].
    #[arg(long, value_name = "SIMS", value_parser = clap::value_parser!(u64).range(1..))]
    budget: Option<u64>,
    /// The run whose training counterexamples are mutated (mutate) [default: RUN].
    #[arg(long, value_name = "RUN")]
    from: Option<PathBuf>,
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = start_count())]
    starts: usize,
    /// Which ego is tested: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// The physics to test in, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>())]
    plant: Option<PlantKind>,
    #[command(flatten)]
    keep: KeepArgs,
    /// Exit with 1 if an ego can be made to fail.
    #[arg(long)]
    fail_on_counterexample: bool,
    /// A program that is the ego, after `--`: typing it consents to start it.
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum MethodArg {
    /// A random action at each decision.
    Uniform,
    /// A random action, held for five decisions.
    Hold,
    /// The cross-entropy method, with the rulebook's reward.
    Cem,
    /// The nearest counterexamples of a training, then mutations of them.
    Mutate,
    /// All sequences with at most M switches of action, fewest first.
    Switches,
}

pub(super) fn run(args: &SearchArgs) -> Result<Exit, Failure> {
    fitting(args)?;
    let run = match args.world.is_dir() {
        true => Some(open_run(&args.world, &args.common)?),
        false => None,
    };
    let (world, mut nominal) = match &run {
        Some(run) => (run.world()?, run.scenario()?),
        None => {
            let world = load_world(&args.world, &args.common)?;
            (world.clone(), world)
        }
    };
    if let Some(plant) = args.plant {
        nominal = on_plant(&nominal, plant)?;
    }
    let egos = EgoUnderTest::find_or_program(&nominal, &args.ego, &args.program)?;
    let stored = stored(args, run.as_ref(), &egos)?;
    let bar = talk::bar("searching");
    let campaign = SearchCampaign {
        world: &world,
        egos: &egos,
        run: run.as_ref(),
        method: method(args, stored.as_ref()),
        budget: args.budget.unwrap_or(BUDGET),
        starts: (args.starts, args.common.seed),
    };
    let Some(searched) = campaign.run(&bar.watch())? else {
        return interrupted_early(&args.common);
    };
    drop(bar);
    show(args, &searched)?;
    if let Some(dir) = args.keep.dir() {
        let bar = talk::bar("keeping");
        searched.keep(dir, args.keep.choice(), args.keep.form(), &bar.watch())?;
    }
    Ok(exit_of(&searched.rows, args.fail_on_counterexample))
}

fn show(args: &SearchArgs, searched: &SearchTable) -> Result<(), Failure> {
    let (rows, evens) = (&searched.rows, &searched.break_even);
    match args.common.json {
        true => print_json(&json!({ "rows": rows, "break_even": evens })),
        false => talk::data(&format!(
            "{}{}{}",
            table::rows(rows),
            anytime_lines(rows),
            evens.iter().map(in_words).collect::<String>()
        )),
    }
}

/// Refuses options that the method would ignore.
fn fitting(args: &SearchArgs) -> Result<(), Failure> {
    let switches = args.method == MethodArg::Switches;
    let refused = |what: &str, help: &str| Err(Failure::input(what, help));
    if switches && args.budget.is_some() {
        return refused(
            "`--budget` is for methods that sample, and `switches` tries all sequences",
            "bound it with `--switches M`, or choose a method with `--method hold`, `cem` or `uniform`",
        );
    }
    if !switches && args.switches.is_some() {
        return refused(
            "`--switches` is for `--method switches`",
            "bound this method with `--budget SIMS`",
        );
    }
    if args.method != MethodArg::Mutate && args.from.is_some() {
        return refused(
            "`--from` is for `--method mutate`",
            "leave it out, or add `--method mutate`",
        );
    }
    Ok(())
}

fn method<'a>(args: &SearchArgs, stored: Option<&'a Stored>) -> Method<'a> {
    match (args.method, stored) {
        (MethodArg::Mutate, Some(stored)) => Method::Mutate(stored),
        (MethodArg::Uniform, _) => Method::Uniform,
        (MethodArg::Cem, _) => Method::Cem(Cem::default()),
        (MethodArg::Switches, _) => Method::Switches(args.switches.unwrap_or(SWITCHES)),
        // Invariant: `mutate` has been given what it mutates.
        (MethodArg::Hold | MethodArg::Mutate, _) => Method::Hold,
    }
}

/// The counterexamples to mutate, if the method does.
fn stored(
    args: &SearchArgs,
    run: Option<&RunDir>,
    egos: &[EgoUnderTest],
) -> Result<Option<Stored>, Failure> {
    if args.method != MethodArg::Mutate {
        return Ok(None);
    }
    let from = args.from.as_ref();
    let from = from.map(|from| open_run(from, &args.common)).transpose()?;
    let Some(run) = from.as_ref().or(run) else {
        return Err(Failure::input(
            "`--method mutate` needs the counterexamples of a training",
            "name a run directory with `--from RUN`",
        ));
    };
    Ok(Some(counterexamples_for(run, egos)?))
}

/// Success after fewer simulations, one line per search.
fn anytime_lines(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows.iter().filter(|row| 1 < row.anytime.len()) {
        let part =
            |at: &crate::run::Anytime| format!("{}: {:.1} %", at.budget, 100.0 * at.success_rate);
        let parts: Vec<String> = row.anytime.iter().map(part).collect();
        text.push_str(&format!(
            "\n{}, {}: success after so many simulations per start: {}",
            row.ego,
            row.method,
            parts.join(", ")
        ));
    }
    text
}

fn in_words(even: &BreakEven) -> String {
    let (ado, search) = (&even.ado, &even.search);
    let reached = match even.matched {
        true => format!(
            "reaches the ado's {:.1} % with a budget of {}",
            100.0 * ado.success_rate,
            even.budget
        ),
        false => format!(
            "does not reach the ado's {:.1} % with {} simulations per start (it has {:.1} %)",
            100.0 * ado.success_rate,
            even.budget,
            100.0 * search.success_rate
        ),
    };
    let spent = format!(
        "\n{}: the search {reached}; it takes {:.1} simulations per start on average, the ado {:.1}",
        even.ego, search.simulations, ado.simulations
    );
    if even.once.simulations == 0 {
        return format!("{spent}.\nBoth live on a training.");
    }
    let at_most = match even.matched {
        true => "",
        false => "at most ",
    };
    let from = |starts: Option<f64>| match starts {
        Some(starts) => format!("from {at_most}{:.0} starts on", starts.ceil()),
        None => "never, or unknown,".to_owned(),
    };
    format!(
        "{spent} after {} in training.\nThe ado is cheaper {} by simulations, {} by physics steps, {} by processor time.",
        even.once.simulations,
        from(even.starts),
        from(even.starts_by_physics_steps),
        from(even.starts_by_cpu_s),
    )
}
