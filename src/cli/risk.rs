//! `brakecheck risk`: the probability of a failure in declared traffic.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::{
    finished, interrupted_early, load_world, one_of, open_run, placed, print_json,
};
use super::defaults::PLANT;
use super::failure::{Exit, Failure};
use super::headings::{INPUT, OUTPUT, TEST};
use super::input::existing_path;
use super::number_args::{count, positive};
use super::output_path::{new_dir, new_file};
use super::progress;
use super::terminal::{self, Common};
use super::test_args::EgoArgs;
use crate::experiment::{EgoUnderTest, consent_to};
use crate::report::junit;
use crate::risk::{KnownFailure, Refusal, RiskReport, RiskRequest, RiskSettings, RiskTraffic};
use crate::rl::Policy;
use crate::run_dir::{RunDir, write_output};
use crate::sim::PlantKind;
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct RiskArgs {
    /// A world file, or the name of a shipped world.
    #[arg(value_name = "WORLD")]
    world: PathBuf,
    /// Laws of starts and actions, instead of the world's own `traffic`.
    ///
    /// A file with `Traffic(…)`, a model of `log --fit`, or motorway.
    #[arg(long, value_name = "NAME|FILE.ron")]
    traffic: Option<String>,
    /// Run of a trained ado, whose counterexamples guide the proposals.
    #[arg(long, value_name = "RUN", help_heading = INPUT)]
    run: Option<PathBuf>,
    /// Kept counterexamples, or directories of them, with the same use.
    #[arg(long, value_name = "FILE|DIR", value_parser = existing_path(), help_heading = INPUT)]
    known: Vec<PathBuf>,
    #[command(flatten)]
    ego: EgoArgs,
    /// An earlier ego, for the ratio of both risks on the same draws.
    #[arg(long, value_name = "NAME|FILE.ron")]
    baseline_ego: Option<String>,
    /// Exit with 1 unless the ratio is below this at 95 %.
    #[arg(long, value_name = "RATIO", requires = "baseline_ego", value_parser = positive, help_heading = OUTPUT)]
    at_most: Option<f64>,
    /// Most runs of each ego.
    #[arg(long, value_name = "N", default_value_t = RiskSettings::default().budget as u64,
        value_parser = count(1_000..=1_000_000_000))]
    budget: u64,
    /// Natural runs, which come first and are counted if 100 of them fail.
    #[arg(long = "natural-runs", value_name = "N", default_value_t = RiskSettings::default().natural as u64,
        value_parser = count(100..=1_000_000_000), help_heading = TEST)]
    natural: u64,
    /// Half-width of the interval to stop at, as a share of the risk.
    #[arg(long, value_name = "SHARE", default_value_t = RiskSettings::default().width,
        value_parser = positive, help_heading = TEST)]
    width: f64,
    /// The physics to measure in, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    /// The physics to learn proposals in, instead of the measured one.
    #[arg(long, value_parser = one_of::<PlantKind>(), help_heading = TEST)]
    learn_on: Option<PlantKind>,
    /// Learn proposals in a model of the ego that is fitted to N runs of it.
    ///
    /// For slow programs. The risk itself is measured on the ego only.
    #[arg(long, value_name = "N", value_parser = count(10..=1_000_000), help_heading = TEST)]
    surrogate: Option<u64>,
    /// Directory of finished runs, from which the same command continues.
    ///
    /// So does one with a greater budget or another width.
    #[arg(short, long, value_name = "DIR", value_parser = new_dir())]
    out: Option<PathBuf>,
    /// Keep the likeliest lawful failure of each kind as a file.
    #[arg(long, value_name = "DIR", value_parser = new_dir(), help_heading = OUTPUT)]
    keep: Option<PathBuf>,
    /// Write the estimates and the limit as test cases of JUnit XML to this file, too.
    #[arg(long, value_name = "FILE.xml", value_parser = new_file(), help_heading = OUTPUT)]
    junit: Option<PathBuf>,
    #[command(flatten)]
    answer: AnswerArgs,
    /// Seed of all draws.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &RiskArgs) -> Result<Exit, Failure> {
    let world = placed(load_world(&args.world, &args.common)?, args.plant)?;
    let traffic = traffic(args, &world)?;
    let egos = egos(args, &world)?;
    // Egos may be programs, which start only with consent.
    consent_to(&egos)?;
    let opened = args.run.as_ref().map(|run| open_run(run, &args.common));
    let run = opened.transpose()?;
    let known = known(args, &world, run.as_ref())?;
    let policy = policy(args, run.as_ref())?;
    let mut request = RiskRequest::new(&traffic, &egos);
    request.policy = policy.as_deref();
    request.settings = settings(args);
    request.known = &known;
    request.dir.clone_from(&args.out);
    // The cost is announced before the first run, because all runs may take hours.
    if !args.common.json {
        terminal::note(&request.announced());
    }
    let bar = progress::bar(&args.common, "");
    let report = request.estimate(&bar.watch())?;
    // The bar must not overwrite the report.
    drop(bar);
    let Some(mut report) = report else {
        return stopped_early(args);
    };
    // Kept with the numbers, so that a page of the JSON has the same decision.
    report.at_most = args.at_most;
    show(args, &report)?;
    if let Some(file) = &args.junit {
        write_output(file, junit(&[report.suite()]).as_bytes())?;
    }
    let kept = args.keep.as_ref().map(|dir| request.keep(&report, dir));
    // The rows are printed already, so an error of the disk here costs no result.
    for line in kept.transpose()?.into_iter().flatten() {
        terminal::note(&line);
    }
    Ok(finished(exit_of(args, &report)))
}

/// Ends a risk without a result, by an interruption or because of the ego.
fn stopped_early(args: &RiskArgs) -> Result<Exit, Failure> {
    // Without a directory nothing is kept, and there is nothing to go on with.
    let Some(dir) = args.out.as_ref().filter(|_| terminal::stopped()) else {
        return interrupted_early(&args.common);
    };
    terminal::note(&format!(
        "stopped; finished runs are kept in {}: go on with the same command",
        dir.display()
    ));
    Ok(Exit::Interrupted)
}

fn traffic(args: &RiskArgs, world: &Scenario) -> Result<RiskTraffic, Failure> {
    if let Some(name) = &args.traffic {
        return Ok(RiskTraffic::read(world, name)?);
    }
    RiskTraffic::of_world(world)?.ok_or_else(|| {
        Failure::input(
            format!("`{}` declares no traffic", world.name()),
            "name a file with `--traffic`, or add `traffic: Traffic(…)` to the world",
        )
    })
}

fn settings(args: &RiskArgs) -> RiskSettings {
    RiskSettings {
        // The parser allows a billion at most, which fits into 32 bits.
        budget: args.budget as usize,
        natural: args.natural as usize,
        width: args.width,
        seed: args.seed,
        learn_on: args.learn_on,
        surrogate: args.surrogate,
    }
}

/// Returns the ego under test, and the baseline ego below it.
fn egos(args: &RiskArgs, world: &Scenario) -> Result<Vec<EgoUnderTest>, Failure> {
    let one = |egos: Vec<EgoUnderTest>, option: &str| match <[EgoUnderTest; 1]>::try_from(egos) {
        Ok([ego]) => Ok(ego),
        Err(_) => Err(Failure::input(
            format!("`{option} all` is more than one ego"),
            "name one ego, and run it again for each other one",
        )),
    };
    let mut egos = vec![one(args.ego.find(world)?, "--ego")?];
    if let Some(name) = &args.baseline_ego {
        let baseline = one(EgoUnderTest::find(world, name)?, "--baseline-ego")?;
        // The ratio of an ego to itself is 1 on the same draws.
        if baseline.name() == egos[0].name() {
            return Err(Failure::input(
                format!("`{name}` is compared with itself"),
                "name another ego with `--ego`",
            ));
        }
        egos.push(baseline);
    }
    Ok(egos)
}

/// Returns the counterexamples of a training and of kept files.
fn known(
    args: &RiskArgs,
    world: &Scenario,
    run: Option<&RunDir>,
) -> Result<Vec<KnownFailure>, Failure> {
    let mut all = Vec::new();
    if let Some(run) = run {
        all.extend(KnownFailure::of_run(world, run)?);
    }
    for path in &args.known {
        let found = KnownFailure::of_files(world, path)?;
        // A wrong path would silently leave the proposals without examples.
        if found.is_empty() {
            return Err(Failure::input(
                format!(
                    "`{}` has no counterexample of `{}`",
                    path.display(),
                    world.name()
                ),
                "name files that were kept in this world, or leave out `--known`",
            ));
        }
        all.extend(found);
    }
    Ok(all)
}

/// Returns the policy of a trained ado, if a surrogate can use one.
fn policy(args: &RiskArgs, run: Option<&RunDir>) -> Result<Option<Box<dyn Policy>>, Failure> {
    // Without a surrogate nothing plays the policy, so it is not read.
    match run.filter(|_| args.surrogate.is_some()) {
        Some(run) => Ok(Some(run.policy()?)),
        None => Ok(None),
    }
}

fn show(args: &RiskArgs, report: &RiskReport) -> Result<(), Failure> {
    if args.common.json {
        return print_json(&json!(report));
    }
    let answer = PrintedAnswer {
        verdict: report.verdict(),
        table: report.readings(),
        details: report.details(),
        ..PrintedAnswer::default()
    };
    terminal::data(&answer.text(args.answer))?;
    // On stderr, so that stdout has the answer alone.
    for ego in &report.egos {
        for Refusal { reason, fix } in ego.refusals() {
            terminal::note(&format!(
                "no result for `{}`: {reason}\n  help: {fix}",
                ego.ego
            ));
        }
    }
    Ok(())
}

fn exit_of(args: &RiskArgs, report: &RiskReport) -> Exit {
    // Without a result, no ratio may decide.
    if !report.is_result() {
        return Exit::Fault;
    }
    if args.at_most.is_some_and(|limit| report.is_above(limit)) {
        Exit::Counterexample
    } else {
        Exit::Done
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::risk::{RiskCost, RiskEstimate};
    use crate::rulebook::Counts;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        risk: RiskArgs,
    }

    fn args(more: &[&str]) -> RiskArgs {
        let words = ["risk", "acc", "--baseline-ego", "old"];
        Line::parse_from(words.iter().chain(more)).risk
    }

    fn report(ratio: Option<[f64; 2]>, between: Option<[[f64; 2]; 2]>) -> RiskReport {
        let estimate = |interval: [f64; 2]| RiskEstimate {
            probability: interval[0],
            interval,
            ess: 100.0,
            hits: 100,
        };
        RiskReport {
            world: "acc".to_owned(),
            plant: "kinematic".to_owned(),
            horizon_s: 15.0,
            traffic: "test".to_owned(),
            uniform_axes: Vec::new(),
            inside: 1.0,
            counts: Counts::Violation,
            exposure: None,
            egos: Vec::new(),
            ratio: ratio.map(estimate),
            ratio_between: between.map(|it| it.map(estimate)),
            surrogate_errors_m: Vec::new(),
            cost: RiskCost::default(),
            at_most: None,
        }
    }

    #[test]
    fn a_limit_on_the_ratio_is_kept_by_its_upper_end_with_every_fault() {
        let limit = args(&["--at-most", "1.5"]);
        for (ratio, between, exit) in [
            (Some([0.8, 1.5]), None, Exit::Done),
            (Some([0.8, 1.6]), None, Exit::Counterexample),
            (None, Some([[0.5, 0.7], [0.9, 1.5]]), Exit::Done),
            (None, Some([[0.5, 0.7], [0.9, 1.6]]), Exit::Counterexample),
            (None, None, Exit::Counterexample),
        ] {
            let report = report(ratio, between);
            assert_eq!(exit_of(&limit, &report), exit, "{ratio:?}, {between:?}");
            assert_eq!(exit_of(&args(&[]), &report), Exit::Done);
        }
    }
}
