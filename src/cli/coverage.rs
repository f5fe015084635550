//! `brakecheck coverage`: what episodes cover of a specification, its rules and starts.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::{interrupted_early, one_of, open_run, placed, print_json, with_consent};
use super::defaults::PLANT;
use super::display::stdout_columns;
use super::failure::{Exit, Failure};
use super::headings::TEST;
use super::number_args::{STARTS, count, start_count};
use super::progress;
use super::run_under_test::refuse_world;
use super::terminal::{self, Common};
use crate::campaign::PlanDir;
use crate::coverage::{
    COVERAGE_EXPLAINED, Coverage, coverage_of_kept, coverage_of_population, coverage_of_run,
};
use crate::crashes::Regressions;
use crate::population::{PopulationDir, PopulationError};
use crate::run_dir::counted;
use crate::sim::PlantKind;

/// Lines of the table without `--details`, of a single world and of each of several.
const LINES: usize = 12;
const FEW_LINES: usize = 4;

#[derive(Args, Debug)]
pub(super) struct CoverageArgs {
    /// A run, a population, a planned campaign, or kept crashes.
    #[arg(value_name = "RUN|PLAN|DIR|FILE.ron")]
    path: PathBuf,
    /// Test starts to draw, from which the ado of a run plays.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    starts: usize,
    /// The physics to play a run in, instead of its own.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    #[command(flatten)]
    answer: AnswerArgs,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Coverages, with a remark on what they are about.
struct MeasuredCoverage {
    worlds: Vec<Coverage>,
    remark: Option<String>,
}

pub(super) fn run(args: &CoverageArgs) -> Result<Exit, Failure> {
    refuse_world_file(&args.path)?;
    let Some(measured) = measured(args)? else {
        return interrupted_early(&args.common);
    };
    let worlds: Vec<&Coverage> = measured.worlds.iter().filter(|it| !it.is_empty()).collect();
    if args.common.json {
        print_json(&json!({ "coverage": objects(&worlds), "remark": measured.remark }))?;
    } else {
        terminal::data(&answer(&worlds, measured.remark).text(args.answer))?;
    }
    // Nothing evaluated is no coverage, so a script must not take it for one.
    if worlds.is_empty() {
        return Err(Failure::fault(
            "no episode was evaluated, so nothing is known of the coverage",
            Some("train the run, run the campaign, or keep crashes first".to_owned()),
        ));
    }
    Ok(Exit::Done)
}

/// Refuses a world, but not the file of a kept crash.
fn refuse_world_file(path: &Path) -> Result<(), Failure> {
    // Both are RON files, and only their content tells them apart.
    if path.is_file() && Regressions::find(path, None).is_ok() {
        return Ok(());
    }
    refuse_world(path, "coverage")
}

/// Measures what is named. `None`: stopped.
fn measured(args: &CoverageArgs) -> Result<Option<MeasuredCoverage>, Failure> {
    let (path, common) = (&args.path, &args.common);
    if path.join("plan.json").is_file() {
        return of_campaign(args);
    }
    let starts = (args.starts, args.seed);
    if PopulationDir::is_population(path) {
        let dir = PopulationDir::open(path)?;
        let members = dir.members(usize::MAX)?;
        // All members have the world of the first, so it is loaded once.
        let first = members.first().ok_or(PopulationError::NoMember)?;
        let world = placed(with_consent(first.scenario()?, common), args.plant)?;
        let bar = progress::bar(common, "");
        let measured = coverage_of_population(&dir, &members, &world, starts, &bar.watch())?;
        return Ok(measured.map(MeasuredCoverage::of));
    }
    if path.join("manifest.json").is_file() {
        let run = open_run(path, common)?;
        let world = placed(run.scenario()?, args.plant)?;
        let bar = progress::bar(common, "");
        let measured = coverage_of_run(&run, &world, starts, &bar.watch())?;
        return Ok(measured.map(MeasuredCoverage::of));
    }
    let kept = Regressions::find(path, None)?
        .allow_programs(common.allow_programs)
        .begin_egos_anew(common.fresh)
        .allow_invalid(common.allow_invalid);
    // The recorded ego decides what was covered, whatever the world names today.
    let replayed = kept.replay_recorded()?;
    kept.check_faults(&replayed)?;
    let others = replayed.iter().filter(|one| !one.still_fails()).count();
    Ok(Some(MeasuredCoverage {
        worlds: coverage_of_kept(&replayed),
        remark: (others > 0).then(|| {
            let files = counted(others, "file");
            format!("{files} left out, without a failure in the replay")
        }),
    }))
}

/// Measures the finished pieces of a campaign. `None`: stopped.
fn of_campaign(args: &CoverageArgs) -> Result<Option<MeasuredCoverage>, Failure> {
    let common = &args.common;
    let dir = PlanDir::open(&args.path, common.allow_programs, common.allow_invalid)?;
    let bar = progress::bar(common, "");
    let Some(measured) = dir.coverage(&bar.watch())? else {
        return Ok(None);
    };
    let (pieces, of) = (measured.pieces, measured.of);
    Ok(Some(MeasuredCoverage {
        worlds: measured.worlds,
        remark: (pieces < of).then(|| format!("{pieces} of {of} pieces are there")),
    }))
}

impl MeasuredCoverage {
    fn of(coverage: Coverage) -> MeasuredCoverage {
        MeasuredCoverage {
            worlds: vec![coverage],
            remark: None,
        }
    }
}

fn objects(worlds: &[&Coverage]) -> Vec<Value> {
    let object = |coverage: &&Coverage| {
        let mut object = json!(coverage);
        object["verdict"] = json!(coverage.verdict());
        object["remarks"] = json!(coverage.remarks());
        object
    };
    worlds.iter().map(object).collect()
}

fn answer(worlds: &[&Coverage], remark: Option<String>) -> PrintedAnswer {
    let columns = stdout_columns();
    let (verdict, most) = match worlds {
        [] => (vec!["no result: no episode was evaluated".to_owned()], 0),
        [one] => (one.verdict(), LINES),
        several => (several_in_words(several), FEW_LINES),
    };
    let table = |coverage: &&Coverage| {
        // The verdict of a single world is above the table already.
        let title = match worlds {
            [_] => String::new(),
            _ => format!("{}\n", coverage.verdict().join("\n")),
        };
        format!("{title}{}", coverage.table(most).to_terminal(columns))
    };
    // One table fits a screen, so those of further worlds are details.
    let (first, others) = worlds.split_at(worlds.len().min(1));
    let tables: Vec<String> = first.iter().map(table).collect();
    let whole = |coverage: &&Coverage| {
        let all = coverage.whole_table().to_terminal(columns);
        let kinds = coverage.kind_table().to_terminal(columns);
        format!("{all}\n{kinds}\n{}", coverage.remarks().join("\n"))
    };
    let details = others.iter().map(table).chain(worlds.iter().map(whole));
    PrintedAnswer {
        verdict,
        table: tables
            .into_iter()
            .chain(remark)
            .collect::<Vec<_>>()
            .join("\n"),
        details: details.collect::<Vec<_>>().join("\n"),
        legend: COVERAGE_EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    }
}

/// Returns the gaps of several worlds in a line, the first of them by name.
fn several_in_words(worlds: &[&Coverage]) -> Vec<String> {
    let with = worlds.iter().filter(|it| !it.gaps.is_empty());
    let gaps: usize = worlds.iter().map(|it| it.gaps.len()).sum();
    let names: Vec<String> = with
        .map(|it| format!("`{}` {}", it.world, it.gaps.len()))
        .collect();
    let of = worlds.len();
    vec![match names.len() {
        0 => format!("no gap found in {}", counted(of, "world")),
        some => format!(
            "{} in {some} of {}: {}",
            counted(gaps, "gap"),
            counted(of, "world"),
            names.join(", ")
        ),
    }]
}
