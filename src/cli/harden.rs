//! `brakecheck harden`: the smallest change of an ego with which it withstands.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::{finished, load_world, one_of, open_run, placed, print_json};
use super::defaults::PLANT;
use super::failure::{Exit, Failure};
use super::harden_text::{EXPLAINED, details, gate_command, table, verdict};
use super::headings::{ADOS, LEARNING, OUTPUT, TEST};
use super::input::existing_path;
use super::number_args::{STARTS, count, start_count, switch_count};
use super::output_path::new_dir;
use super::progress;
use super::run_under_test::is_world;
use super::terminal::{self, Common};
use super::test_args::{EgoArgs, note_program_costs};
use crate::evaluation::Sweep;
use crate::evaluation::harden::{
    AdoSet, DrivingLoss, EgoParameters, HardenReport, HardenRequest, HardenSettings, HardeningAdo,
};
use crate::experiment::{EgoUnderTest, consent_to};
use crate::population::PopulationDir;
use crate::risk::{KnownFailure, RiskTraffic};
use crate::sim::PlantKind;
use crate::world::Scenario;

/// Traffic of a world that declares none.
const USUAL_TRAFFIC: &str = "motorway";

/// Text of `--help` on the limits.
const LIMITS: &str = "\
Limit on what a change may cost in natural traffic (repeatable)

The measure is one of these, or your own:
- braking:       Mean deceleration over all time, m/s² [default: 110%]
- travel-time:   Time per distance, s/km [default: 105%]
- false-braking: Share of runs with braking above 3 m/s² in which an ego that keeps its
                 speed does not fail [default: +0.05]
- an expression, such as `max(0, ego.speed - 30)`: Its mean over all samples
- a formula, such as `always (headway > 8)`: The share of runs that violate it
The limit is a value, a percentage of the ego as it is, or `+0.05` more than it";

#[derive(Args, Debug)]
pub(super) struct HardenArgs {
    /// A world, or the run of an ado or a population that the ego must withstand.
    ///
    /// In a world, the first ado is trained now.
    #[arg(value_name = "WORLD|RUN")]
    input: PathBuf,
    #[command(flatten)]
    ego: EgoArgs,
    /// Parameter that may change, and its range (repeatable).
    ///
    /// Without it, these are the parameters that a program declares, those of the world's
    /// `train_against`, or all of a stock ego from half to twice their value. N values are
    /// tried first.
    #[arg(long, value_name = "ego.NAME=LO..HI[:N]")]
    over: Vec<String>,
    /// Limit on what a change may cost in natural traffic (repeatable).
    #[arg(long, value_name = "MEASURE=LIMIT", long_help = LIMITS)]
    keep_below: Vec<String>,
    /// Traffic of these limits [default: the world's `traffic`, or motorway].
    #[arg(long, value_name = "NAME|FILE.ron")]
    traffic: Option<String>,
    /// Another run or population that the ego must withstand (repeatable).
    #[arg(long, value_name = "RUN", help_heading = ADOS)]
    against: Vec<PathBuf>,
    /// Kept crashes that the ego must withstand (repeatable).
    #[arg(long, value_name = "FILE|DIR", value_parser = existing_path(), help_heading = ADOS)]
    known: Vec<PathBuf>,
    /// Also search every start, with at most M switches of action.
    #[arg(long, value_name = "M", value_parser = switch_count(), help_heading = ADOS)]
    search: Option<usize>,
    /// Least reduction of the failures, as a share.
    #[arg(long, value_name = "SHARE", default_value_t = HardenSettings::default().reduction, value_parser = reduction)]
    reduction: f64,
    /// Sealed starts to confirm a change on.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    starts: usize,
    /// Starts of the search.
    #[arg(long, value_name = "N", default_value_t = HardenSettings::default().search_starts, value_parser = start_count(), help_heading = TEST)]
    search_starts: usize,
    /// Runs of the search in natural traffic. The confirmation has three times as many.
    #[arg(long = "natural-runs", value_name = "N", default_value_t = HardenSettings::default().runs as u64, value_parser = count(10..=1_000_000), help_heading = TEST)]
    natural_runs: u64,
    /// Most searches, each followed by a training.
    #[arg(long, value_name = "N", default_value_t = HardenSettings::default().rounds as u64, value_parser = count(1..=100), help_heading = TEST)]
    rounds: u64,
    /// Decisions of each training.
    #[arg(long, value_name = "N", default_value_t = HardenSettings::default().decisions, value_parser = count(1..=u64::MAX), help_heading = LEARNING)]
    decisions: u64,
    /// Directory of changes, runs and crashes [default: runs/WORLD-hardened].
    #[arg(short, long, value_name = "DIR", value_parser = new_dir(), help_heading = OUTPUT)]
    output: Option<PathBuf>,
    /// The physics of all runs, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    #[command(flatten)]
    answer: AnswerArgs,
    /// Seed of starts, draws and trainings.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Reads a share of failures to remove.
fn reduction(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>();
    value
        .ok()
        // A reduction of 0 would confirm the ego as it is, and NaN is refused by the
        // comparison.
        .filter(|value| *value > 0.0 && *value <= 1.0)
        .ok_or_else(|| "give a share above 0, and 1 at most, such as 0.9".to_owned())
}

pub(super) fn run(args: &HardenArgs) -> Result<Exit, Failure> {
    let world = placed(world(args)?, args.plant)?;
    let ego = ego(args, &world)?;
    // A program is started for its hello, before anything else.
    consent_to(std::slice::from_ref(&ego))?;
    let traffic = traffic(args, &world)?;
    let (parameters, ados) = (parameters(args, &ego)?, ados(args, &world)?);
    let usual = || PathBuf::from(format!("runs/{}-hardened", world.name()));
    let dir = args.output.clone().unwrap_or_else(usual);
    let request = HardenRequest {
        world: &world,
        parameters,
        ados,
        traffic: &traffic,
        losses: DrivingLoss::with_given(&args.keep_below)?,
        dir: &dir,
        settings: settings(args),
    };
    let bar = progress::bar(&args.common, "");
    let watch = bar.watch();
    let report = request.run(&watch)?;
    note_program_costs(std::slice::from_ref(&ego), &watch);
    drop(bar);
    show(args, &report, &ego)?;
    Ok(finished(exit_of(&report)))
}

fn world(args: &HardenArgs) -> Result<Scenario, Failure> {
    if is_world(&args.input) {
        return load_world(&args.input, &args.common);
    }
    // All members of a population have one world.
    let run = if PopulationDir::is_population(&args.input) {
        PopulationDir::open(&args.input)?.member_path(0)
    } else {
        args.input.clone()
    };
    Ok(open_run(&run, &args.common)?.scenario()?)
}

fn ego(args: &HardenArgs, world: &Scenario) -> Result<EgoUnderTest, Failure> {
    // Only `all` gives several egos.
    match <[EgoUnderTest; 1]>::try_from(args.ego.find(world)?) {
        Ok([ego]) => Ok(ego),
        Err(_) => Err(Failure::input(
            "`--ego all` is more than one ego",
            "name one ego, and run it again for each other one",
        )),
    }
}

fn traffic(args: &HardenArgs, world: &Scenario) -> Result<RiskTraffic, Failure> {
    if let Some(name) = &args.traffic {
        return Ok(RiskTraffic::read(world, name)?);
    }
    match RiskTraffic::of_world(world)? {
        Some(traffic) => Ok(traffic),
        None => Ok(RiskTraffic::read(world, USUAL_TRAFFIC)?),
    }
}

fn parameters(args: &HardenArgs, ego: &EgoUnderTest) -> Result<EgoParameters, Failure> {
    let parsed = args.over.iter().map(|text| Sweep::parse(text));
    let ranges: Vec<Sweep> = parsed.collect::<Result<_, _>>()?;
    Ok(EgoParameters::of(ego, &ranges)?)
}

/// Returns the ados of the runs, the kept crashes and the search.
fn ados(args: &HardenArgs, world: &Scenario) -> Result<AdoSet, Failure> {
    // A world has no trained ado. The hardening trains a first one, unless `--against`
    // names some.
    let own = (!is_world(&args.input)).then_some(&args.input);
    let mut ados = AdoSet {
        switches: args.search,
        ..AdoSet::default()
    };
    for run in own.into_iter().chain(&args.against) {
        let trained = HardeningAdo::of_run(run, args.common.allow_programs)?;
        ados.trained.extend(trained);
    }
    for path in &args.known {
        let found = KnownFailure::of_files(world, path)?;
        // A wrong path would silently leave the crashes out.
        if found.is_empty() {
            return Err(Failure::input(
                format!("`{}` has no crash of `{}`", path.display(), world.name()),
                "name files that were kept in this world, or leave out `--known`",
            ));
        }
        ados.kept.extend(found);
    }
    Ok(ados)
}

fn settings(args: &HardenArgs) -> HardenSettings {
    HardenSettings {
        reduction: args.reduction,
        search_starts: args.search_starts,
        // The parsers bound these numbers, so no cast truncates.
        runs: args.natural_runs as usize,
        sealed_starts: args.starts,
        decisions: args.decisions,
        rounds: args.rounds as usize,
        seed: args.seed,
    }
}

fn show(args: &HardenArgs, report: &HardenReport, ego: &EgoUnderTest) -> Result<(), Failure> {
    if args.common.json {
        let mut object = json!(report);
        // Without a confirmed change it is `null`, so that scripts always find the key.
        object["gate"] = gate_command(report, ego).map_or(Value::Null, Value::from);
        return print_json(&object);
    }
    let mut table = table(report);
    if let Some(gate) = gate_command(report, ego) {
        table.push_str(&format!("\nkeep it: {gate}"));
    }
    let answer = PrintedAnswer {
        verdict: verdict(report),
        table,
        details: details(report),
        legend: EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    };
    terminal::data(&answer.text(args.answer))
}

fn exit_of(report: &HardenReport) -> Exit {
    // An ego that never fails needs no change, which is as good as a confirmed one.
    if report.confirmed().is_some() || report.is_without_failure() {
        return Exit::Done;
    }
    // Nothing was evaluated, which is no answer.
    match report.searched.starts {
        0 => Exit::Fault,
        _ => Exit::Counterexample,
    }
}
