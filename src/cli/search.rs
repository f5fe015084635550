//! `brakecheck search`: action sequences per start, without learning.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{ArgPredicate, PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::json;
use strum::VariantArray;

use super::answer::AnswerArgs;
use super::common::{exit_of, interrupted_early, load_world, one_of, open_run, placed, print_json};
use super::defaults::PLANT;
use super::failure::{Exit, Failure};
use super::headings::{INPUT, OUTPUT, TEST};
use super::keep::{KeepArgs, KeepStep};
use super::live::{RerunArgs, Streamed};
use super::number_args::{STARTS, count, start_count, switch_count};
use super::output_path::new_file;
use super::terminal::Common;
use super::test_args::{EgoArgs, note_program_costs};
use super::traffic_args::TrafficArgs;
use super::{progress, table};
use crate::evaluation::{BreakEven, SearchCampaign, SearchTable, counterexamples_for, policy_for};
use crate::experiment::{EgoUnderTest, Watch};
use crate::report::junit;
use crate::rl::Policy;
use crate::run_dir::{Row, RunDir, Stored, write_output};
use crate::search::{
    GuidingPolicy, Method, MethodInfo, MethodOption, MethodSettings, usual_switches,
};
use crate::sim::PlantKind;
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct SearchArgs {
    /// A world file, the name of a shipped world, or a run directory.
    #[arg(value_name = "WORLD|RUN")]
    world: PathBuf,
    /// Method that chooses the sequences.
    // `--guided RUN` alone is enough to choose its method.
    #[arg(long, value_parser = method_of_the_list(), default_value = "switches",
        default_value_if("guided", ArgPredicate::IsPresent, "guided"))]
    method: MethodInfo,
    #[arg(long, value_name = "M", help = MethodOption::Switches.help(),
        value_parser = switch_count(), help_heading = TEST)]
    switches: Option<usize>,
    // `eval` calls a limit of this kind `--tries`.
    #[arg(long, visible_alias = "tries", value_name = "SIMS", help = MethodOption::Budget.help(),
        value_parser = count(1..=u64::MAX), help_heading = TEST)]
    budget: Option<u64>,
    #[arg(long, value_name = "RUN", help = MethodOption::Bank.help(), help_heading = INPUT)]
    bank: Option<PathBuf>,
    #[arg(long, value_name = "RUN", help = MethodOption::Guided.help(), help_heading = INPUT)]
    guided: Option<PathBuf>,
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    starts: usize,
    #[command(flatten)]
    ego: EgoArgs,
    /// The physics to test in, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    #[command(flatten)]
    traffic: TrafficArgs,
    #[command(flatten)]
    keep: KeepArgs,
    #[command(flatten)]
    live: RerunArgs,
    #[command(flatten)]
    answer: AnswerArgs,
    /// Write every start as a test case of JUnit XML to this file, too.
    #[arg(long, value_name = "FILE.xml", value_parser = new_file(), help_heading = OUTPUT)]
    junit: Option<PathBuf>,
    /// Exit with 1 if an ego can be made to fail.
    #[arg(long)]
    fail_on_counterexample: bool,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

/// The methods of the list, each with its help.
fn method_of_the_list() -> impl TypedValueParser<Value = MethodInfo> {
    let all = Method::all().iter();
    let values = all.map(|method| PossibleValue::new(method.name).help(method.help));
    let named = |name: String| Method::all().iter().find(|method| method.name == name);
    // Invariant: the words are names of the list.
    PossibleValuesParser::new(values).try_map(move |name| named(name.clone()).copied().ok_or(name))
}

pub(super) fn run(args: &SearchArgs) -> Result<Exit, Failure> {
    let run = opened(args)?;
    let (world, nominal) = worlds(args, run.as_ref())?;
    args.traffic.keep_one(args.keep.dir())?;
    let egos = args.traffic.levels(args.ego.find(&nominal)?);
    let training = TrainingResults::of(args, run.as_ref(), &egos)?;
    let settings = MethodSettings {
        switches: Some(args.switches.unwrap_or_else(|| usual_switches(&egos))),
        ..training.settings()
    };
    let live = args.live.open(world.name(), Streamed::Episodes)?;
    let bar = progress::bar(&args.common, "");
    let campaign = SearchCampaign {
        world: &world,
        egos: &egos,
        run: run.as_ref(),
        method: Method::named(args.method.name, &settings)?,
        budget: args.budget.unwrap_or(args.method.budget),
        starts: (args.starts, args.seed),
    };
    let steps = args.keep.steps(egos.len());
    let watch = bar.watch().first_of(steps).shown_to(live.audience());
    let Some(searched) = campaign.run(&watch)? else {
        return interrupted_early(&args.common);
    };
    note_program_costs(&egos, &watch);
    drop(bar);
    // Rows are printed before files are written, so a full disk does not cost them.
    show(args, &searched)?;
    if let Some(file) = &args.junit {
        write_output(file, junit(&[searched.suite()]).as_bytes())?;
    }
    let keep = |dir: &Path, settings, watch: &Watch<'_>| searched.keep(dir, settings, watch);
    let step = KeepStep {
        egos: egos.len(),
        answer: args.answer,
    };
    args.keep.last_step(&args.common, step, keep)?;
    Ok(exit_of(&searched.rows, args.fail_on_counterexample))
}

/// Opens the run, if one is named.
fn opened(args: &SearchArgs) -> Result<Option<RunDir>, Failure> {
    // An option without effect is refused before any file is read.
    args.method.refuse_others(&given(args))?;
    args.live.admit(args.common.json)?;
    // Shipped names and standard input are worlds, so only a directory can be a run.
    if !args.world.is_dir() {
        return Ok(None);
    }
    Ok(Some(open_run(&args.world, &args.common)?))
}

/// Returns the world that draws the starts and the world that plays them.
fn worlds(args: &SearchArgs, run: Option<&RunDir>) -> Result<(Scenario, Scenario), Failure> {
    let (world, nominal) = match run {
        // Starts come from the plant of the file, and episodes from the plant of the
        // training.
        Some(run) => (run.world()?, run.scenario()?),
        None => {
            let world = load_world(&args.world, &args.common)?;
            (world.clone(), world)
        }
    };
    let in_traffic = args.traffic.declared(nominal)?;
    Ok((world, placed(in_traffic, args.plant)?))
}

fn show(args: &SearchArgs, searched: &SearchTable) -> Result<(), Failure> {
    let (rows, evens) = (&searched.rows, &searched.break_even);
    if args.common.json {
        print_json(&json!({ "rows": rows, "break_even": evens }))
    } else {
        let mut answer = table::rows(rows);
        answer.details.push_str(&anytime_lines(rows));
        // The cost is the question of a search of a run.
        answer.table.extend(evens.iter().map(in_words));
        args.live.data(&answer.text(args.answer))
    }
}

/// The options that were given, of those that some methods take.
fn given(args: &SearchArgs) -> Vec<MethodOption> {
    let options = MethodOption::VARIANTS.iter().copied();
    let is_given = |option: &MethodOption| match option {
        MethodOption::Switches => args.switches.is_some(),
        MethodOption::Budget => args.budget.is_some(),
        MethodOption::Bank => args.bank.is_some(),
        MethodOption::Guided => args.guided.is_some(),
    };
    options.filter(is_given).collect()
}

/// Results of a training that propose sequences, where the method takes them.
struct TrainingResults {
    stored: Option<Stored>,
    policy: Option<Box<dyn Policy>>,
}

impl TrainingResults {
    fn of(
        args: &SearchArgs,
        run: Option<&RunDir>,
        egos: &[EgoUnderTest],
    ) -> Result<TrainingResults, Failure> {
        Ok(TrainingResults {
            stored: stored(args, run, egos)?,
            policy: guiding(args, run, egos)?,
        })
    }

    fn settings(&self) -> MethodSettings<'_> {
        MethodSettings {
            stored: self.stored.as_ref(),
            guide: self.policy.as_deref().map(GuidingPolicy),
            ..MethodSettings::default()
        }
    }
}

/// The counterexamples to mutate, if the method does and there is a run.
fn stored(
    args: &SearchArgs,
    run: Option<&RunDir>,
    egos: &[EgoUnderTest],
) -> Result<Option<Stored>, Failure> {
    if !args.method.takes(MethodOption::Bank) {
        return Ok(None);
    }
    let path = args.bank.as_ref();
    let bank = path.map(|path| open_run(path, &args.common)).transpose()?;
    // `--bank` takes precedence over the searched run.
    let source = bank.as_ref().or(run);
    Ok(source
        .map(|source| counterexamples_for(source, egos))
        .transpose()?)
}

/// The policy that proposes the sequences, if the method takes one and there is a run.
fn guiding(
    args: &SearchArgs,
    run: Option<&RunDir>,
    egos: &[EgoUnderTest],
) -> Result<Option<Box<dyn Policy>>, Failure> {
    if !args.method.takes(MethodOption::Guided) {
        return Ok(None);
    }
    let path = args.guided.as_ref();
    let guide = path.map(|path| open_run(path, &args.common)).transpose()?;
    // `--guided` takes precedence over the searched run.
    let source = guide.as_ref().or(run);
    Ok(source.map(|source| policy_for(source, egos)).transpose()?)
}

/// Success after fewer simulations, one line per search.
fn anytime_lines(rows: &[Row]) -> String {
    let mut text = String::new();
    // A single budget is in the table already.
    for row in rows.iter().filter(|row| row.anytime.len() > 1) {
        let part = |at: &crate::run_dir::Anytime| {
            format!("{}: {:.1} %", at.budget, 100.0 * at.success_rate)
        };
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
    let reached = if even.matched {
        format!(
            "reaches the ado's {:.1} % with a budget of {}",
            100.0 * ado.success_rate,
            even.budget
        )
    } else {
        format!(
            "does not reach the ado's {:.1} % with {} simulations per start (it has {:.1} %)",
            100.0 * ado.success_rate,
            even.budget,
            100.0 * search.success_rate
        )
    };
    let spent = format!(
        "\n{}: the search {reached}; it takes {:.1} simulations per start on average, the ado {:.1}",
        even.ego, search.simulations, ado.simulations
    );
    // Both use the same training, so neither is charged for it.
    if even.once.simulations == 0 {
        return format!("{spent}.\nBoth require a training.");
    }
    // A search that fell short would need more, so the ado pays off even earlier.
    let at_most = if even.matched { "" } else { "at most " };
    let from = |starts: Option<f64>| match starts {
        // A part of a start cannot be played, so the number is rounded up.
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

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::SearchArgs;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        search: SearchArgs,
    }

    #[test]
    fn a_method_of_the_list_is_a_value_with_its_help() {
        let parsed = Alone::try_parse_from(["search", "a.ron", "--method", "mutate"])
            .map_err(|e| e.to_string())
            .expect("in the list");
        assert_eq!(parsed.search.method.name, "mutate");
        let help = Alone::command().render_long_help().to_string();
        for says in [
            "- mutate: ",
            "(uniform, hold, cem, mutate, guided) [default: 100, guided 20]",
        ] {
            assert!(help.contains(says), "{help}");
        }
    }
}
