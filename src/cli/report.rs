//! `brakecheck report`: one HTML page and JUnit XML about a run.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::common::{finished, interrupted_early, load_world, open_run, print_json};
use super::failure::{Exit, Failure};
use super::headings::{INPUT, OUTPUT, TEST};
use super::number_args::{STARTS, count, start_count};
use super::progress;
use super::report_results;
use super::run_under_test::is_world;
use super::terminal::{self, Common};
use super::verdict::verdict;
use crate::crashes::{file_stem, openx, write_openx};
use crate::evaluation::{GivenRows, PointsRequest, ReportRequest, points};
use crate::experiment::{EgoUnderTest, consent_to};
use crate::report::Report;
use crate::run_dir::{RunDir, make_dir, write_file};
use crate::world::Scenario;

/// Episodes that the page of points or of kept crashes shows moving.
pub(super) const MOST_EXAMPLES: usize = 12;

#[derive(Args, Debug)]
pub(super) struct ReportArgs {
    /// A run, a world with points, kept crashes, or the JSON of `gate` or `risk`.
    #[arg(value_name = "RUN|WORLD.ron|DIR|FILE.json")]
    pub(super) run: PathBuf,
    /// The page to write; JUnit XML goes beside it [default: RUN/report.html].
    #[arg(short, long, value_name = "FILE.html")]
    pub(super) output: Option<PathBuf>,
    /// Another run of the same world, to show beside it; repeat for several.
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(super) with: Vec<PathBuf>,
    /// Rows to show, from `eval`, `gate`, `sweep` or `search` with `--json`; repeat for several.
    #[arg(long, value_name = "FILE.json", help_heading = INPUT)]
    pub(super) rows: Vec<PathBuf>,
    /// Test starts for the nominal ego.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    starts: usize,
    /// Test starts for every changed ego, without `--rows` [default: as many as
    /// 1000 episodes allow, 20 to 100].
    #[arg(long, value_name = "N", value_parser = start_count(), help_heading = TEST)]
    pub(super) reuse_starts: Option<usize>,
    /// Also write each counterexample of the page as OpenSCENARIO, into a directory
    /// beside it, and link it.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) scenarios: bool,
    /// Ego of the page: nominal, a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    pub(super) ego: Option<String>,
    /// Program to run as the ego of the page, after `--` (`lag_s` is 0).
    #[arg(last = true, value_name = "COMMAND")]
    pub(super) program: Vec<String>,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX), help_heading = TEST)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &ReportArgs) -> Result<Exit, Failure> {
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
    if args.scenarios || !args.with.is_empty() || !args.rows.is_empty() {
        return Err(Failure::input(
            format!("`{file}` is a world: --with, --rows and --scenarios are for runs"),
            "leave them out",
        ));
    }
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
    let mut page = table.page(vec![this_page(args)]);
    page.examples = table.examples(MOST_EXAMPLES, &bar.watch());
    drop(bar);
    let name = args.run.file_stem().unwrap_or_default();
    let usual = Path::new(name).with_extension("html");
    let html = args.output.clone().unwrap_or(usual);
    let pages = ReportTexts {
        verdict: vec![table.summary()],
        html: page.html(),
        junit: page.junit(),
    };
    pages.write(args, &html)?;
    Ok(finished(Exit::Done))
}

/// Texts of a page and of its JUnit file.
pub(super) struct ReportTexts {
    /// Verdict to print.
    pub(super) verdict: Vec<String>,
    pub(super) html: String,
    pub(super) junit: String,
}

impl ReportTexts {
    /// Writes the page and the JUnit file, and prints the verdict and their paths.
    pub(super) fn write(&self, args: &ReportArgs, html: &Path) -> Result<(), Failure> {
        let junit = html.with_extension("junit.xml");
        write_file(html, self.html.as_bytes())?;
        write_file(&junit, self.junit.as_bytes())?;
        if args.common.json {
            print_json(&json!({
                "report": html.display().to_string(),
                "junit": junit.display().to_string(),
            }))
        } else {
            let paths = [html, &junit].map(|path| path.display().to_string());
            terminal::data(&[&self.verdict[..], &paths].concat().join("\n"))
        }
    }
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
        let Some(start) = example.start else { continue };
        let name = file_stem(scenario, &nominal.row.ego, seed, start);
        match openx(scenario, &example.episode, &name, &nominal.row.ego) {
            Ok(files) => {
                let written = write_openx(&files, &dir, &name)?;
                let parent = html.parent().unwrap_or(html);
                let links = written
                    .iter()
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
        let run = quoted(&shown(&args.run));
        return Some(Failure::input(
            format!("{run} has no policy yet, so nothing was evaluated"),
            format!(
                "go on with `brakecheck train {run}/world.ron -o {run} --resume`, then report it"
            ),
        ));
    }
    let mut rows = report.tested.iter().map(|tested| &tested.row);
    // A row without a valid start is no result, whatever share is allowed.
    let is_unheeded = |share: f64| args.common.allow_invalid < share || share >= 1.0;
    let row = rows.find(|row| is_unheeded(row.invalid_share()))?;
    Some(Failure::fault(
        format!(
            "{} of {} starts of `{}`, {} are invalid: its ego failed to run",
            row.invalid,
            row.starts + row.invalid,
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
    let manifest = run.manifest();
    let here = quoted(&shown(run.path()));
    let world = quoted(&shown(&run.path().join("world.ron")));
    let mut train = format!(
        "brakecheck train {world} -o runs/{}-again --seed {} --decisions {}",
        manifest.world, manifest.seed, manifest.decisions
    );
    if let Some(plant) = manifest.plant.plant() {
        train.push_str(&format!(" --plant {}", <&str>::from(plant)));
    }
    if !manifest.against.is_nominal() {
        train.push_str(&format!(" --against {}", manifest.against));
    }
    if let Some(ego) = &manifest.ego {
        train.push_str(&format!(" --ego {}", quoted(&ego.name)));
    }
    if let Some(learner) = &manifest.learner {
        train.push_str(&format!(" --learner {learner}"));
    }
    vec![
        train,
        format!(
            "brakecheck eval {here} --seed {} --starts {} --ego all --ado all",
            args.seed, args.starts
        ),
        format!("brakecheck replay {here} --expect recorded"),
        this_page(args),
    ]
}

/// The command that makes this very page, with every option that it depends on.
pub(super) fn this_page(args: &ReportArgs) -> String {
    let mut words = vec![quoted(&shown(&args.run))];
    let mut option = |name: &str, values: Vec<String>| {
        words.push(name.to_owned());
        words.extend(values.iter().map(|value| quoted(value)));
    };
    if let Some(output) = &args.output {
        option("-o", vec![shown(output)]);
    }
    if !args.with.is_empty() {
        option("--with", args.with.iter().map(|run| shown(run)).collect());
    }
    for file in &args.rows {
        option("--rows", vec![shown(file)]);
    }
    // Defaults are written out, because a later version may change them.
    option("--starts", vec![args.starts.to_string()]);
    if let Some(starts) = args.reuse_starts {
        option("--reuse-starts", vec![starts.to_string()]);
    }
    option("--seed", vec![args.seed.to_string()]);
    if args.scenarios {
        option("--scenarios", Vec::new());
    }
    if args.common.allow_programs {
        option("--allow-programs", Vec::new());
    }
    if let Some(ego) = &args.ego {
        option("--ego", vec![ego.clone()]);
    }
    if args.common.allow_invalid > 0.0 {
        option(
            "--allow-invalid",
            vec![args.common.allow_invalid.to_string()],
        );
    }
    if !args.program.is_empty() {
        words.push("--".to_owned());
        words.extend(args.program.iter().map(|word| quoted(word)));
    }
    format!("brakecheck report {}", words.join(" "))
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        // A shell ends the quotes at an apostrophe, so it is escaped outside of them.
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}
