//! `brakecheck report`: one HTML page and JUnit XML about a run.

use std::path::Path;

use super::common::{finished, interrupted_early, load_world, open_run};
use super::failure::{Exit, Failure};
use super::points::check_answers;
use super::progress;
use super::report_args::{ReportArgs, shown};
use super::report_results;
use super::report_texts::{MOST_EXAMPLES, ReportTexts};
use super::run_under_test::is_world;
use super::terminal;
use super::training_command::training_command;
use super::verdict::verdict;
use crate::crashes::{file_stem, openx, write_openx};
use crate::evaluation::{GivenRows, PointsRequest, ReportRequest, points};
use crate::experiment::{EgoUnderTest, consent_to};
use crate::report::Report;
use crate::run_dir::{RunDir, counted, make_dir};
use crate::visible::shell_word;
use crate::world::Scenario;

pub(super) fn run(args: &ReportArgs) -> Result<Exit, Failure> {
    // The ending decides before worlds are looked for, since any file could be a world.
    let is_json = args.run.extension().is_some_and(|it| it == "json");
    if is_json && args.run.is_file() {
        return report_results::of_file(args);
    }
    if is_world(&args.run) {
        return of_points(args);
    }
    if report_results::is_kept(&args.run) {
        return report_results::of_crashes(args);
    }
    of_run(args)
}

/// Writes the page of a run.
fn of_run(args: &ReportArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let scenario = run.scenario()?;
    let ego = ego(args, &scenario)?;
    let others = args.with.iter().map(|other| open_run(other, &args.common));
    let mut given = GivenRows::default();
    for file in &args.rows {
        given.read(file, &scenario)?;
    }
    let request = ReportRequest {
        run: &run,
        scenario: &scenario,
        with: &others.collect::<Result<Vec<_>, _>>()?,
        given: &given,
        starts: (args.starts, args.seed),
        ego: ego.as_ref(),
        reuse_starts: args.reuse_starts,
    };
    let bar = progress::bar(&args.common, "");
    let Some(mut report) = request.report(&bar.watch())? else {
        return interrupted_early(&args.common);
    };
    drop(bar);
    // The page ends with the commands that make it again.
    report.commands = commands(args, &run);
    let html = args
        .output
        .clone()
        .unwrap_or_else(|| run.path().join("report.html"));
    if args.scenarios {
        write_scenarios(&html, &mut report, args.seed)?;
    }
    let rows = report.nominal.as_ref().map(|nominal| nominal.row.clone());
    let pages = ReportTexts {
        verdict: rows.map_or(Vec::new(), |row| verdict(&[row])),
        html: report.html(),
        junit: report.junit(),
    };
    pages.write(args, &html)?;
    // The page is there already, and shows the starts that did not run.
    match unheeded(args, &report) {
        // Faults of this evaluation are reported with all details at the end.
        Some(failure) if args.common.faults().complaint().is_none() => Err(failure),
        _ => Ok(Exit::Done),
    }
}

/// Returns the ego of the page, if one is named.
fn ego(args: &ReportArgs, world: &Scenario) -> Result<Option<EgoUnderTest>, Failure> {
    if args.ego.is_none() && args.program.is_empty() {
        return Ok(None);
    }
    let requested = args.ego.as_deref().unwrap_or("nominal");
    match &EgoUnderTest::find_or_program(world, requested, &args.program)?[..] {
        [ego] if ego.is_nominal() => Ok(None),
        [ego] => Ok(Some(ego.clone())),
        _ => Err(Failure::input(
            "`--ego all` is more than one ego",
            "name one: a page is about one ego",
        )),
    }
}

/// Plays one ego at the points of a world and writes their page.
fn of_points(args: &ReportArgs) -> Result<Exit, Failure> {
    let world = load_world(&args.run, &args.common)?;
    let file = args.run.display();
    if !world.has_points() {
        return Err(Failure::input(
            format!("`{file}` is a world, and no run of an ado"),
            format!(
                "train one and report its run: `brakecheck train {file} -o RUN`, `brakecheck report RUN`"
            ),
        ));
    }
    report_results::refuse_options(args, "a world")?;
    let named = ego(args, &world)?;
    let ego = named.unwrap_or_else(|| EgoUnderTest::nominal(&world));
    consent_to(std::slice::from_ref(&ego))?;
    let bar = progress::bar(&args.common, "");
    let request = PointsRequest {
        ego: &ego,
        starts: (args.starts, args.seed),
        switches: None,
    };
    let Some(table) = points(&request, &bar.watch()) else {
        return interrupted_early(&args.common);
    };
    let mut page = table.page(vec![args.this_page(true)]);
    page.examples = table.examples(MOST_EXAMPLES, &bar.watch());
    drop(bar);
    // A shipped world has no directory of its own, so the page is in the working one.
    let name = args.run.file_stem().unwrap_or_default();
    let usual = Path::new(name).with_extension("html");
    let html = args.output.clone().unwrap_or(usual);
    let pages = ReportTexts {
        verdict: vec![table.summary()],
        html: page.html(),
        junit: page.junit(),
    };
    pages.write(args, &html)?;
    if !terminal::stopped() {
        // Checked last, so that the page shows the points, too.
        check_answers(std::slice::from_ref(&table))?;
    }
    Ok(finished(Exit::Done))
}

/// Writes the counterexamples of a page as scenarios, and links them.
///
/// It writes them as `export` does. A refused counterexample is reported and has no link.
fn write_scenarios(html: &Path, report: &mut Report<'_>, seed: u64) -> Result<(), Failure> {
    let dir = html.with_extension("scenarios");
    let scenario = report.scenario;
    let Some(nominal) = &mut report.nominal else {
        return Ok(());
    };
    make_dir(&dir)?;
    for example in &mut nominal.highlights {
        // A kept file has no position among the starts, by which scenarios are named.
        let Some(start) = example.start else { continue };
        let name = file_stem(scenario, &nominal.row.ego, seed, start);
        match openx(scenario, &example.episode, &name, &nominal.row.ego) {
            Ok(files) => {
                let written = write_openx(&files, &dir, &name)?;
                let parent = html.parent().unwrap_or(html);
                let links = written
                    .iter()
                    // Links are relative, so that the page and its files can be moved
                    // together.
                    .map(|file| file.strip_prefix(parent).unwrap_or(file));
                example.scenarios = links.map(|link| link.display().to_string()).collect();
            }
            Err(why) => terminal::note(&format!("{name} is not exported: {why}")),
        }
    }
    Ok(())
}

/// A page without a row, or more invalid episodes in a row than are allowed.
fn unheeded(args: &ReportArgs, report: &Report<'_>) -> Option<Failure> {
    // JUnit without a test would pass.
    if report.tested.is_empty() {
        let run = shell_word(&shown(&args.run));
        return Some(Failure::input(
            format!("{run} has no policy yet, so nothing was evaluated"),
            format!(
                "go on with `brakecheck train {run}/world.ron -o {run} --resume`, then report it"
            ),
        ));
    }
    let mut rows = report.tested.iter().map(|tested| &tested.row);
    let row = rows.find(|row| args.common.refuses(row.invalid_share()))?;
    Some(Failure::fault(
        format!(
            "{} of {} of `{}`, {} are invalid: its ego failed to run",
            row.invalid,
            counted(row.starts + row.invalid, "start"),
            row.ego,
            row.ado
        ),
        Some("the page and the JUnit file say why; `--allow-invalid SHARE` allows some".into()),
    ))
}

/// Returns the commands that make the run and the report again.
///
/// They use the world file in the run.
fn commands(args: &ReportArgs, run: &RunDir) -> Vec<String> {
    let here = shell_word(&shown(run.path()));
    let mut commands = training_command(run);
    commands.extend([
        format!(
            "brakecheck eval {here} --seed {} --starts {} --ego all --ado all",
            args.seed, args.starts
        ),
        format!("brakecheck replay {here} --expect recorded"),
        args.this_page(true),
    ]);
    commands
}
