//! `brakecheck report`: one HTML page and JUnit XML about a run.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Deserialize;
use serde_json::json;

use super::told::{Params, playing};
use super::{
    Common, Exit, Failure, NamedEgo, all_played, consent, egos, interrupted_early, open_run,
    print_json, start_count, talk,
};
use crate::campaign::{
    Ado, BreakEven, EvalRequest, TestStarts, Watch, eval, explain_first, telling, test_starts,
};
use crate::report::{Cost, Example, Nominal, Report, Tested, Training};
use crate::run::{Row, RunDir, RunError, write_file};
use crate::scenario::{Against, Scenario};

/// Episodes that changed egos are tried on, unless told otherwise, and the
/// least and most starts of each.
const REUSE_EPISODES: usize = 1000;
const LEAST_STARTS: usize = 20;
const MOST_STARTS: usize = 100;
/// A file of rows is no larger than this.
const MAX_ROWS_BYTES: u64 = 50_000_000;

#[derive(Args, Debug)]
pub(super) struct ReportArgs {
    /// The run directory that `train` made.
    run: PathBuf,
    /// The page to write; JUnit XML goes beside it [default: RUN/report.html].
    #[arg(short, long, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Another run of the same world, to show beside it; repeat for several.
    #[arg(long, value_name = "RUN", num_args = 1..)]
    with: Vec<PathBuf>,
    /// Rows to show: what `eval` or `search` printed with `--json`; repeat for several.
    #[arg(long, value_name = "FILE.json")]
    rows: Vec<PathBuf>,
    /// Test starts for the nominal ego.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = start_count())]
    starts: usize,
    /// The first of them that every changed ego is tried on too, without
    /// `--rows` [default: as many as 1000 episodes allow, 20 to 100].
    #[arg(long, value_name = "N", value_parser = start_count())]
    reuse_starts: Option<usize>,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &ReportArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let scenario = run.scenario()?;
    let mut trainings = vec![training(&run)?];
    for other in &args.with {
        let other = open_run(other, &args.common)?;
        if other.manifest().world_sha256 != run.manifest().world_sha256 {
            return Err(Failure::input(
                format!("`{}` is a run of another world", other.path().display()),
                "`--with` shows runs whose world files are equal to the letter",
            ));
        }
        trainings.push(training(&other)?);
    }
    let mut given = Printed::default();
    for file in &args.rows {
        let printed = printed_in(file, &scenario)?;
        given.rows.extend(printed.rows);
        given.break_even.extend(printed.break_even);
    }
    let played = match given.rows.is_empty() {
        true => egos(&scenario, "all")?,
        false => Vec::new(),
    };
    if run.manifest().is_finished() {
        consent(all_played(&scenario, &played))?;
    }
    let bar = talk::bar("playing");
    let watch = bar.watch();
    let mut report = Report {
        scenario: &scenario,
        run: shown(&args.run),
        manifest: run.manifest(),
        trainings,
        nominal: None,
        tested: Vec::new(),
        about_tested: String::new(),
        costs: Vec::new(),
        notes: notes(&run),
        faults: Vec::new(),
        commands: commands(args, &run, &scenario),
    };
    if run.manifest().is_finished() {
        let job = Job {
            args,
            run: &run,
            scenario: &scenario,
            watch: &watch,
        };
        // An ego that does not run is what the page then tells of.
        if job.fill(&mut report, given)?.is_none() && talk::stopped() {
            return interrupted_early(&args.common);
        }
    }
    let complaint = talk::faults().complaint();
    report.faults = complaint.map(|it| it.faults).unwrap_or_default();
    drop(bar);
    let mut unheeded = report.tested.iter().map(|tested| &tested.row);
    let unheeded = unheeded.find(|row| args.common.allow_invalid < row.invalid_share());
    let unheeded = unheeded.map(|row| {
        Failure::fault(
            format!(
                "{} of {} starts of `{}`, {} are invalid: its ego failed to run",
                row.invalid,
                row.starts + row.invalid,
                row.ego,
                row.ado
            ),
            Some("the page and the JUnit file say why; `--allow-invalid SHARE` allows some".into()),
        )
    });
    let html = args.output.clone();
    let html = html.unwrap_or_else(|| run.path().join("report.html"));
    let junit = html.with_extension("junit.xml");
    write_file(&html, report.html().as_bytes())?;
    write_file(&junit, report.junit().as_bytes())?;
    match args.common.json {
        true => print_json(&json!({
            "report": html.display().to_string(),
            "junit": junit.display().to_string(),
        })),
        false => talk::data(&format!("{}\n{}", html.display(), junit.display())),
    }?;
    match unheeded {
        // What was played here is complained of with all its faults.
        Some(failure) if talk::faults().complaint().is_none() => Err(failure),
        _ => Ok(Exit::Done),
    }
}

struct Job<'a> {
    args: &'a ReportArgs,
    run: &'a RunDir,
    scenario: &'a Scenario,
    watch: &'a Watch<'a>,
}

impl Job<'_> {
    /// Plays what the report shows; `None`: stopped.
    fn fill(&self, report: &mut Report<'_>, given: Printed) -> Result<Option<()>, Failure> {
        let train_seed = self.run.manifest().seed;
        // An ado that is told which ego it meets is told the truth here.
        let params = self.is_told().then_some(Params::True);
        let seed = self.args.common.seed;
        let own = NamedEgo::nominal(self.scenario);
        let told = playing(self.run, params.as_ref(), &own, seed, self.watch)?;
        let ado = Ado::Trained(&*told.policy, train_seed);
        let Some(starts) = self.starts(&self.run.world()?, self.args.starts) else {
            return Ok(None);
        };
        let request = EvalRequest {
            scenario: self.scenario,
            ego: "nominal",
            ado,
            starts: &starts,
        };
        let evaluated = eval(&request, self.watch);
        let verdicts = evaluated.outcomes.iter().map(|o| o.map(|o| o.verdict));
        let all = starts.starts.iter().map(|(start, _)| start.clone());
        let chosen = telling(&request, &evaluated).into_iter();
        report.nominal = Some(Nominal {
            row: evaluated.row.clone(),
            starts: all.zip(verdicts).collect(),
            telling: chosen
                .map(|chosen| Example {
                    chosen_for: chosen.chosen_for,
                    start: chosen.start,
                    episode: chosen.episode,
                })
                .collect(),
        });
        if given.rows.is_empty() {
            report.tested.push(Tested {
                why: explain_first(&request, &evaluated).map(|(_, why)| why.to_string()),
                row: evaluated.row,
            });
            let egos = egos(self.scenario, "all")?;
            let count = self.args.reuse_starts.unwrap_or_else(|| {
                (REUSE_EPISODES / (2 * egos.len())).clamp(LEAST_STARTS, MOST_STARTS)
            });
            let few = first(&starts, count);
            for ego in egos {
                let own = match ego.scenario.axes() == self.scenario.axes() {
                    true => few.clone(),
                    false => match self.starts(&ego.scenario, count) {
                        Some(own) => own,
                        None => return Ok(None),
                    },
                };
                let told = playing(self.run, params.as_ref(), &ego, seed, self.watch)?;
                for ado in [Ado::Trained(&*told.policy, train_seed), Ado::Held] {
                    let request = EvalRequest {
                        scenario: &ego.scenario,
                        ego: &ego.name,
                        ado,
                        starts: &own,
                    };
                    if ego.name == "nominal" && ado.word() == "trained" {
                        continue;
                    }
                    let evaluated = eval(&request, self.watch);
                    report.tested.push(Tested {
                        why: explain_first(&request, &evaluated).map(|(_, why)| why.to_string()),
                        row: evaluated.row,
                    });
                }
            }
            report.about_tested = format!(
                "The trained ado and random actions held for five decisions, one simulation per \
                 start: on the nominal ego the trained ado from {} starts, all else from the \
                 first {} of them. More ados, recall and searches can stand here: give what \
                 eval and search print with --json by --rows.",
                starts.starts.len(),
                few.starts.len(),
            );
        } else {
            report.about_tested = "Rows as given with `--rows`.".to_owned();
            let rows = given.rows.into_iter();
            report.tested = rows.map(|row| Tested { row, why: None }).collect();
        }
        report.costs = costs(report, given.break_even);
        Ok((!talk::stopped()).then_some(()))
    }

    fn is_told(&self) -> bool {
        self.run.manifest().against == Against::Conditional
    }

    fn starts(&self, scenario: &Scenario, count: usize) -> Option<TestStarts> {
        test_starts(scenario, self.args.common.seed, count, self.watch)
    }
}

/// The first starts of a list.
fn first(starts: &TestStarts, count: usize) -> TestStarts {
    let count = count.min(starts.starts.len());
    TestStarts {
        seed: starts.seed,
        starts: starts.starts[..count].to_vec(),
        trivial: starts.trivial[..count].to_vec(),
    }
}

/// The trained ado's simulations beside those of every search of the nominal ego.
fn costs(report: &Report<'_>, evens: Vec<BreakEven>) -> Vec<Cost> {
    let evens: Vec<BreakEven> = evens
        .into_iter()
        .filter(|even| even.ego == "nominal")
        .collect();
    // On the starts of the first search: a rate on others is no comparison.
    let trained = evens.first().map(|even| Cost {
        name: "trained ado".to_owned(),
        fixed: report.manifest.episodes as f64,
        per_start: 1.0,
        solves: even.ado.success_rate,
        matched: true,
        anytime: Vec::new(),
    });
    let searches = evens.into_iter().map(|even| Cost {
        fixed: 0.0,
        matched: even.matched,
        per_start: even.search.simulations,
        solves: even.search.success_rate,
        anytime: even
            .curve
            .iter()
            .map(|point| (point.budget as f64, point.success_rate))
            .collect(),
        name: even.method,
    });
    trained.into_iter().chain(searches).collect()
}

fn training(run: &RunDir) -> Result<Training, Failure> {
    Ok(Training {
        run: shown(run.path()),
        manifest: run.manifest().clone(),
        progress: run.progress()?,
        closing: run.report()?,
    })
}

fn notes(run: &RunDir) -> Vec<String> {
    let manifest = run.manifest();
    let mut notes = Vec::new();
    if !manifest.against.is_nominal() {
        notes.push(format!(
            "This ado was trained against a family of egos ({}).",
            manifest.against
        ));
    }
    if manifest.against == Against::Conditional {
        notes.push(format!(
            "It is told the parameters of the ego it meets ({}); here the true ones.",
            manifest.told.join(", ")
        ));
    }
    if let Some(ego) = &manifest.ego {
        notes.push(format!(
            "This ado was trained against the changed ego `{}`.",
            ego.name
        ));
    }
    if manifest.is_finished() {
        return notes;
    }
    notes.push(format!(
        "This training is not finished: {} of {} decisions are done, and there is no ado to show \
         yet. Go on with `brakecheck train {} -o {} --resume`.",
        manifest.decisions_done,
        manifest.decisions,
        shown(&run.path().join("world.ron")),
        shown(run.path()),
    ));
    notes
}

/// What makes run and report again, from the world file kept in the run.
fn commands(args: &ReportArgs, run: &RunDir, scenario: &Scenario) -> Vec<String> {
    let manifest = run.manifest();
    let here = shown(run.path());
    let world = shown(&run.path().join("world.ron"));
    let mut train = format!(
        "brakecheck train {world} -o runs/{}-again --seed {} --decisions {}",
        scenario.name, manifest.seed, manifest.decisions
    );
    if let Some(plant) = manifest.plant.plant() {
        train.push_str(&format!(" --plant {}", format!("{plant:?}").to_lowercase()));
    }
    if !manifest.against.is_nominal() {
        train.push_str(&format!(" --against {}", manifest.against));
    }
    if let Some(ego) = &manifest.ego {
        train.push_str(&format!(" --ego '{}'", ego.name));
    }
    if let Some(learner) = &manifest.learner {
        train.push_str(&format!(" --learner {learner}"));
    }
    let mut report = format!("brakecheck report {here} --starts {}", args.starts);
    for file in &args.rows {
        report.push_str(&format!(" --rows {}", shown(file)));
    }
    if !args.with.is_empty() {
        report.push_str(" --with");
        let with = args.with.iter().map(|run| format!(" {}", shown(run)));
        report.extend(with);
    }
    vec![
        train,
        format!(
            "brakecheck eval {here} --seed {} --starts {} --ego all --ado all",
            args.common.seed, args.starts
        ),
        format!("brakecheck replay {here} --expect recorded"),
        format!("{report} --seed {}", args.common.seed),
    ]
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// What `eval` or `search` printed, as far as a report shows it.
#[derive(Default, Deserialize)]
struct Printed {
    rows: Vec<Row>,
    #[serde(default)]
    break_even: Vec<BreakEven>,
}

/// What a verb printed, if it is of this world.
fn printed_in(file: &Path, scenario: &Scenario) -> Result<Printed, Failure> {
    let wrong = |why: String| {
        Failure::input(
            format!("`{}` holds no rows: {why}", file.display()),
            "give what `brakecheck eval RUN --json` or `search … --json` printed",
        )
    };
    let size = std::fs::metadata(file).map(|meta| meta.len());
    if size.is_ok_and(|size| MAX_ROWS_BYTES < size) {
        return Err(wrong("it is too large".to_owned()));
    }
    let text = std::fs::read_to_string(file).map_err(|source| RunError::Io {
        verb: "reading",
        path: file.into(),
        source,
    })?;
    let printed: Printed = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    match printed.rows.iter().find(|row| row.world != scenario.name) {
        Some(other) => Err(wrong(format!("they are of the world `{}`", other.world))),
        None => Ok(printed),
    }
}
