//! `brakecheck report`: one HTML page and JUnit XML about a run.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::common::{finished, interrupted_early, load_world, open_run, print_json};
use super::failure::{Exit, Failure};
use super::number_args::{STARTS, count, start_count};
use super::progress;
use super::run_under_test::is_world;
use super::terminal::{self, Common};
use crate::crashes::{file_stem, openx, write_openx};
use crate::evaluation::{GivenRows, PointsRequest, ReportRequest, points};
use crate::experiment::{EgoUnderTest, consent_to};
use crate::report::Report;
use crate::run_dir::{RunDir, make_dir, write_file};

/// Failures that the page of a world's points shows moving.
const MOST_EXAMPLES: usize = 12;

#[derive(Args, Debug)]
pub(super) struct ReportArgs {
    /// The run directory that `train` made; or a world with points.
    #[arg(value_name = "RUN|WORLD.ron")]
    run: PathBuf,
    /// The page to write; JUnit XML goes beside it [default: RUN/report.html].
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Another run of the same world, to show beside it; repeat for several.
    #[arg(long, value_name = "RUN", num_args = 1..)]
    with: Vec<PathBuf>,
    /// Rows to show, from `eval`, `gate`, `sweep` or `search` with `--json`; repeat for several.
    #[arg(long, value_name = "FILE.json")]
    rows: Vec<PathBuf>,
    /// Test starts for the nominal ego.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count())]
    starts: usize,
    /// Test starts for every changed ego, without `--rows` [default: as many as
    /// 1000 episodes allow, 20 to 100].
    #[arg(long, value_name = "N", value_parser = start_count())]
    reuse_starts: Option<usize>,
    /// Also write each counterexample of the page as OpenSCENARIO, into a directory
    /// beside it, and link it.
    #[arg(long)]
    scenarios: bool,
    /// Ego of a world with points: nominal, a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// Program to run as the ego of a world with points, after `--` (`lag_s` is 0).
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    /// Seed of the test starts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count(0..=u64::MAX))]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &ReportArgs) -> Result<Exit, Failure> {
    if is_world(&args.run) {
        return of_points(args);
    }
    if args.ego.is_some() || !args.program.is_empty() {
        return Err(Failure::input(
            "the page of a run shows all egos of its world, so it takes no `--ego` and no program",
            "leave it out, or add rows by `--rows` from `brakecheck eval RUN --ego E --json`",
        ));
    }
    of_run(args)
}

/// Writes the page of a run.
fn of_run(args: &ReportArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let scenario = run.scenario()?;
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
    write(args, &html, &report)?;
    match unheeded(args, &report) {
        // Faults of this evaluation are reported with all details at the end.
        Some(failure) if args.common.faults().complaint().is_none() => Err(failure),
        _ => Ok(Exit::Done),
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
    let requested = args.ego.as_deref().unwrap_or("nominal");
    let egos = EgoUnderTest::find_or_program(&world, requested, &args.program)?;
    let [ego] = &egos[..] else {
        return Err(Failure::input(
            "`--ego all` is more than one ego",
            "name one: a page is about one ego",
        ));
    };
    consent_to(&egos)?;
    let bar = progress::bar(&args.common, "");
    let request = PointsRequest {
        ego,
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
    write_files(args, &html, (page.html(), page.junit()))?;
    if !args.common.json {
        terminal::data(&table.summary())?;
    }
    Ok(finished(Exit::Done))
}

/// Writes the page and the JUnit file, and prints their paths.
fn write(args: &ReportArgs, html: &Path, report: &Report<'_>) -> Result<(), Failure> {
    write_files(args, html, (report.html(), report.junit()))
}

fn write_files(args: &ReportArgs, html: &Path, texts: (String, String)) -> Result<(), Failure> {
    let junit = html.with_extension("junit.xml");
    write_file(html, texts.0.as_bytes())?;
    write_file(&junit, texts.1.as_bytes())?;
    if args.common.json {
        print_json(&json!({
            "report": html.display().to_string(),
            "junit": junit.display().to_string(),
        }))
    } else {
        terminal::data(&format!("{}\n{}", html.display(), junit.display()))
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
        let name = file_stem(scenario, &nominal.row.ego, seed, example.start);
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
fn this_page(args: &ReportArgs) -> String {
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
