//! `brakecheck search`: action sequences per start, without learning.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{
    Common, Exit, Failure, NamedEgo, PlantArg, all_played, consent, egos_or_program,
    interrupted_early, load_world, on_plant, open_run, print_json, say_if_moody, start_count,
    table, talk,
};
use crate::campaign::{
    Ado, BreakEven, Cem, Cost, EvalRequest, Method, SearchRequest, Searched, TestStarts, Watch,
    break_even, eval, search, test_starts,
};
use crate::rl::Policy;
use crate::run::{Manifest, Row, RunDir, RunError, Stored};
use crate::scenario::Scenario;

/// Switches of `--method switches`, unless told otherwise.
const SWITCHES: usize = 2;
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
    #[arg(long)]
    plant: Option<PlantArg>,
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
    let egos = egos_or_program(&nominal, &args.ego, &args.program)?;
    consent(all_played(&world, &egos))?;
    let stored = match args.method {
        MethodArg::Mutate => Some(stored(args, run.as_ref(), &egos)?),
        _ => None,
    };
    let trained = match &run {
        Some(run) if run.manifest().is_finished() => match run.policy() {
            Ok(policy) => Some((policy, run.manifest())),
            // A conditional ado plays only where it is told the ego's parameters.
            Err(error @ RunError::Untold { .. }) => {
                talk::say(&format!("{error}; searching without it"));
                None
            }
            Err(error) => return Err(error.into()),
        },
        _ => None,
    };
    let bar = talk::bar("searching");
    let watch = bar.watch();
    let Some(starts) = test_starts(&world, args.common.seed, args.starts, &watch) else {
        return interrupted_early(&args.common);
    };
    let mut rows = Vec::new();
    let mut evens = Vec::new();
    for ego in &egos {
        bar.now(format!("searching: {}", ego.name));
        let request = SearchRequest {
            scenario: &ego.scenario,
            ego: &ego.name,
            method: method(args, stored.as_ref()),
            budget: args.budget.unwrap_or(BUDGET),
            starts: &starts,
        };
        let searched = search(&request, &watch);
        if let Some((policy, manifest)) = &trained {
            let against = Against {
                policy: &**policy,
                manifest,
                starts: &starts,
            };
            let row = against.row(ego, &searched, &watch);
            evens.extend(against.break_even(&request, &searched, &row));
            rows.push(row);
        }
        rows.push(searched.row);
        bar.aside(|| say_if_moody(ego, &starts, &watch));
        if watch.stopped() {
            break;
        }
    }
    drop(bar);
    match args.common.json {
        true => print_json(&json!({ "rows": rows, "break_even": evens })),
        false => talk::data(&format!(
            "{}{}{}",
            table::rows(&rows),
            anytime_lines(&rows),
            evens.iter().map(in_words).collect::<String>()
        )),
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

/// The counterexamples to mutate; they must fit the egos' worlds.
fn stored(args: &SearchArgs, run: Option<&RunDir>, egos: &[NamedEgo]) -> Result<Stored, Failure> {
    let (stored, source) = match (&args.from, run) {
        (Some(path), _) => {
            let run = open_run(path, &args.common)?;
            (run.counterexamples()?, run.scenario()?)
        }
        (None, Some(run)) => (run.counterexamples()?, run.scenario()?),
        (None, None) => {
            return Err(Failure::input(
                "`--method mutate` needs the counterexamples of a training",
                "name a run directory with `--from RUN`",
            ));
        }
    };
    let shape = |scenario: &Scenario| (scenario.axes(), scenario.world().spaces().actions);
    match egos
        .iter()
        .find(|ego| shape(&ego.scenario) != shape(&source))
    {
        Some(ego) => Err(Failure::input(
            format!(
                "the counterexamples of `{}` do not fit `{}` with the ego `{}`: other starts or actions",
                source.name, ego.scenario.name, ego.name
            ),
            "name a run of the same world",
        )),
        None => Ok(stored),
    }
}

/// The trained ado of the run that is searched.
struct Against<'a> {
    policy: &'a dyn Policy,
    manifest: &'a Manifest,
    starts: &'a TestStarts,
}

impl Against<'_> {
    fn row(&self, ego: &NamedEgo, searched: &Searched, watch: &Watch<'_>) -> Row {
        let request = EvalRequest {
            scenario: &ego.scenario,
            ego: &ego.name,
            ado: Ado::Trained(self.policy, self.manifest.seed),
            starts: self.starts,
        };
        let mut row = eval(&request, watch).row;
        row.compare_with_search(&searched.row.solved);
        row
    }

    /// Of methods with a budget only: the others are no rival but a measure.
    fn break_even(
        &self,
        request: &SearchRequest<'_>,
        searched: &Searched,
        trained: &Row,
    ) -> Option<BreakEven> {
        if matches!(request.method, Method::Switches(_)) || talk::stopped() {
            return None;
        }
        let once = match request.method {
            // It lives on a training as well: neither is charged for one.
            Method::Mutate(_) => Cost::default(),
            _ => Cost::of_training(self.manifest),
        };
        if self.manifest.physics_steps == 0 {
            talk::say("an earlier version trained this run: it counted no physics steps");
        }
        break_even(searched, request.budget, trained, once)
    }
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
