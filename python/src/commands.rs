//! Campaigns: requests of Python, and their rows.

use std::num::NonZeroU64;
use std::path::PathBuf;
use std::sync::Arc;

use brakecheck::adversary::{Ado, AdoWord};
use brakecheck::crashes::{CrashSelection, Form, KeepSettings};
use brakecheck::evaluation::{
    Evaluation, GivenRows, ReportRequest, Sampling, SearchCampaign, policy_for, untrained,
};
use brakecheck::experiment::{check_repeatability, consent, on_plant, test_starts};
use brakecheck::risk::RiskTraffic;
use brakecheck::rulebook::TrainingGoal;
use brakecheck::run_dir::{AdversaryId, Row, RunDir};
use brakecheck::search::{
    Adversary, BestConstant, Experiment, GuidingPolicy, Method, MethodOption, MethodSettings,
    Search, usual_switches,
};
use brakecheck::training::{PerAdoMode, TrainRequest, TrainSession};
use brakecheck::world::Scenario;
use pyo3::prelude::*;
use pyo3::types::PyString;
use serde_json::json;

use crate::ado::PythonPolicy;
use crate::convert::objects;
use crate::ego::{egos, is_python};
use crate::error::{failed, wrong};
use crate::watch::{Running, something};
use crate::world::{RawWorld, plant_of};

/// Selection and directory of the counterexamples to write.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Keeping {
    directory: PathBuf,
    /// Greatest number per ego, or None for all.
    most: Option<usize>,
    as_found: bool,
}

impl Keeping {
    fn settings(&self) -> KeepSettings {
        let form = if self.as_found {
            Form::AsFound
        } else {
            Form::Shrunk
        };
        KeepSettings::new(
            self.most.map_or(CrashSelection::All, CrashSelection::Worst),
            form,
        )
    }
}

/// Request of `train`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct TrainOptions {
    output: PathBuf,
    ego: Option<Py<PyAny>>,
    seed: Option<u64>,
    decisions: Option<u64>,
    learner: Option<String>,
    /// `None` takes the world's own.
    goals: Option<Vec<String>>,
    against: String,
    leave_out: Option<String>,
    plant: Option<String>,
    from_run: Option<PathBuf>,
    per_ado: Option<String>,
    bank: Vec<PathBuf>,
    /// A file of declared traffic, or `world` for the world's own.
    traffic: Option<String>,
    temperature: Option<f64>,
    prior: Option<f64>,
    resume: bool,
    starts: usize,
}

/// Trains an ado, evaluates it, and returns the results.
#[pyfunction]
pub(crate) fn train_ado<'py>(
    py: Python<'py>,
    world: &RawWorld,
    options: TrainOptions,
    running: Running,
) -> PyResult<Bound<'py, PyAny>> {
    some_starts(options.starts)?;
    let mut world = world.0.clone();
    let mut name = None;
    if let Some(ego) = options.ego.as_ref().map(|ego| ego.bind(py)) {
        match ego.cast::<PyString>() {
            Ok(named) => name = Some(named.to_cow()?.into_owned()),
            // Run directories store the ego by a name or file, and the words of a program
            // are neither.
            Err(_) if !is_python(Some(ego)) && !ego.is_none() => {
                return Err(wrong(
                    "an ado is trained against an ego that its world can name",
                    "write the program into a RON file with a `Change`, and give its path",
                ));
            }
            // An ego in Python has no name that a request could state, so the world
            // itself gets it.
            Err(_) => world = egos(&world, Some(ego))?[0].scenario().clone(),
        }
    }
    let plant = options.plant.as_deref().map(plant_of).transpose()?;
    let against = options.against.parse().map_err(|_| {
        let what = format!("`against={:?}` is not known", options.against);
        wrong(what, "known: nominal, wide")
    })?;
    let parsed = options.goals.as_ref().map(|goals| {
        let goal = |word: &String| {
            word.to_lowercase().parse::<TrainingGoal>().map_err(|_| {
                let what = format!("unknown training goal {word:?}");
                wrong(what, "known: severe, distinct")
            })
        };
        goals.iter().map(goal).collect::<PyResult<Vec<_>>>()
    });
    let goals = parsed.transpose()?;
    let per_ado = options
        .per_ado
        .as_deref()
        .map(|word| {
            let what = || format!("`per_ado={word:?}` is not known");
            let mode = word.parse::<PerAdoMode>();
            mode.map_err(|_| wrong(what(), "known: independent, alternating"))
        })
        .transpose()?;
    let from = options
        .from_run
        .as_deref()
        .map(RunDir::open)
        .transpose()
        .map_err(failed)?;
    let traffic =
        match options.traffic.as_deref() {
            None => None,
            Some("world") => Some(RiskTraffic::of_world(&world).map_err(failed)?.ok_or_else(
                || {
                    wrong(
                        "the world declares no traffic",
                        "name a file, or add `traffic: Traffic(…)` to the world",
                    )
                },
            )?),
            Some(file) => Some(RiskTraffic::read(&world, file).map_err(failed)?),
        };
    let found = running.watched(py, move |watch| {
        let request = TrainRequest {
            traffic: traffic.as_ref(),
            temperature: options.temperature,
            prior: options.prior,
            seed: options.seed,
            decisions: options.decisions,
            learner: options.learner.as_deref(),
            goals: goals.as_deref(),
            against,
            leave_out: options.leave_out.as_deref(),
            ego: name.as_deref(),
            plant,
            per_ado,
            bank: &options.bank,
            from: from.as_ref(),
        };
        let mut session = if options.resume {
            TrainSession::resume(&world, &options.output, &request)?
        } else {
            TrainSession::begin(&world, &options.output, &request)?
        };
        let trained = session.train(watch)?;
        // The run directory keeps a checkpoint, and the caller gets its
        // `KeyboardInterrupt`.
        if trained.interrupted {
            return Ok(None);
        }
        let Some(closing) = session.evaluate(options.starts, watch)? else {
            return Ok(None);
        };
        session.keep(&closing)?;
        Ok(Some(json!({
            "run": session.run().path(), "decisions": trained.done.decisions,
            "episodes": trained.done.episodes, "cpu_s": trained.done.cpu_s,
            "aborted": trained.aborted, "rows": closing.rows,
        })))
    })?;
    objects(py, &something(found)?)
}

/// Request of `eval` with a run.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct EvalOptions {
    run: PathBuf,
    ego: Option<Py<PyAny>>,
    ados: Vec<String>,
    starts: usize,
    seed: u64,
    plant: Option<String>,
    search: Option<usize>,
    tries: u64,
    temperature: Option<f64>,
    draws: u32,
    runs: u64,
    keep: Option<Keeping>,
    allow_programs: bool,
}

/// Returns the rows of a trained ado and its rivals on egos.
#[pyfunction]
pub(crate) fn eval_run<'py>(
    py: Python<'py>,
    options: EvalOptions,
    running: Running,
) -> PyResult<Bound<'py, PyAny>> {
    some_starts(options.starts)?;
    let mut run = RunDir::open(&options.run).map_err(failed)?;
    run.allow_programs(options.allow_programs);
    let nominal = placed(&run.scenario().map_err(failed)?, options.plant.as_deref())?;
    let ego = options.ego.as_ref().map(|ego| ego.bind(py));
    let egos = egos(&nominal, ego)?;
    let groups = options
        .ados
        .iter()
        .map(|word| {
            let known = || "known: trained, all, and those of `brakecheck eval --help`";
            let group = AdoWord::named(word);
            group.ok_or_else(|| wrong(format!("there is no ado `{word}`"), known()))
        })
        .collect::<PyResult<Vec<_>>>()?;
    let ados: Vec<AdversaryId> = groups
        .iter()
        .flat_map(|group| group.ids(&run, &nominal))
        .collect();
    let temperature = options.temperature;
    // The command line checks these while parsing, and Python has no such step.
    if temperature.is_some_and(|it| !(1e-6..=1e6).contains(&it)) || options.draws == 0 {
        return Err(wrong(
            "a temperature or a number of draws is out of range",
            "give a temperature such as 0.1, and at least one draw",
        ));
    }
    let sampling = temperature.map(|temperature| Sampling {
        temperature,
        draws: options.draws,
    });
    let rows = running.watched(py, move |watch| {
        let evaluation = Evaluation {
            ados: &ados,
            starts: (options.starts, options.seed),
            search: options.search,
            tries: options.tries,
            sampling,
            // 0 stands for no adaptation, as on the command line.
            runs: NonZeroU64::new(options.runs),
            keeps: options.keep.is_some(),
            ..Evaluation::new(&run, &nominal, &egos)
        };
        let Some(table) = evaluation.run(watch)? else {
            return Ok(None);
        };
        if let Some(keep) = &options.keep {
            table.keep(&keep.directory, keep.settings(), watch)?;
        }
        let rows = table.rows();
        // A failure at a later ego is an exception, because a list of rows cannot show
        // it.
        match table.failure {
            Some(failure) => Err(failure.into()),
            None => Ok(Some(rows)),
        }
    })?;
    objects(py, &something(rows)?)
}

/// Request of an evaluation without a run.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct BaselineOptions {
    /// Function from observations to joint actions. None plays baselines and search only.
    ado: Option<Py<PyAny>>,
    name: String,
    ego: Option<Py<PyAny>>,
    starts: usize,
    seed: u64,
    switches: Option<usize>,
    keep: Option<Keeping>,
}

/// Returns the rows of any ado, or of none, on egos of a world, beside the baselines.
#[pyfunction]
pub(crate) fn eval_world<'py>(
    py: Python<'py>,
    world: &RawWorld,
    options: BaselineOptions,
    running: Running,
) -> PyResult<Bound<'py, PyAny>> {
    some_starts(options.starts)?;
    let nominal = world.0.clone();
    let egos = egos(&nominal, options.ego.as_ref().map(|ego| ego.bind(py)))?;
    let (seed, count) = (options.seed, options.starts);
    let Some(act) = &options.ado else {
        let switches = options.switches.unwrap_or_else(|| usual_switches(&egos));
        let rows = running.watched(py, move |watch| {
            let table = untrained(&nominal, &egos, seed, count, switches, watch)?;
            Ok(table.map(|table| table.rows))
        })?;
        return objects(py, &something(rows)?);
    };
    let spaces = nominal.world().spaces();
    // The policy is shared, because its exception is read after the work has ended in
    // another thread.
    let policy = Arc::new(PythonPolicy::new(
        act.bind(py),
        spaces.actions,
        spaces.neutral,
    ));
    let acting = policy.clone();
    let rows = running.watched(py, move |watch| {
        let policy = &*acting;
        consent(&nominal, &egos)?;
        let Some(starts) = test_starts(&nominal, seed, count, watch) else {
            return Ok(None);
        };
        let mut rows = Vec::new();
        let ado = Ado::Rule(policy, "python", "python");
        // The order matters for the places below: your ado first, the constant second.
        let adversaries: [&dyn Adversary; 4] = [&ado, &BestConstant, &Ado::Hold, &Ado::Random];
        for ego in &egos {
            let experiment = Experiment {
                ego,
                adversaries: adversaries.to_vec(),
                starts: &starts,
            };
            let mut cells = experiment.run(watch);
            if let Some(keep) = &options.keep {
                cells[0].adversary = options.name.as_str().into();
                // Counterexamples of the baselines are no findings of your ado, so only
                // its own are kept.
                keep.settings().keep(&cells[0], &keep.directory, watch)?;
            }
            cells[0].row.method.clone_from(&options.name);
            // The constant is played second and shown last.
            cells[1..].rotate_left(1);
            let mut own: Vec<Row> = cells.into_iter().map(|cell| cell.row).collect();
            if let Some(switches) = options.switches {
                let search = Search::switches(switches).play(ego, &starts, watch);
                // The search is last, because the comparison takes the last row as its
                // yardstick.
                own.extend(search.map(|cell| cell.row));
                Row::compare_with_last(&mut own);
            }
            check_repeatability(ego, &starts, &mut own, watch);
            rows.append(&mut own);
        }
        Ok(Some(rows))
    });
    // An exception of the ado says more than what came of it.
    policy.check()?;
    objects(py, &something(rows?)?)
}

/// Request of `search`.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SearchOptions {
    ego: Option<Py<PyAny>>,
    method: String,
    switches: Option<usize>,
    budget: Option<u64>,
    guided: Option<PathBuf>,
    starts: usize,
    seed: u64,
    keep: Option<Keeping>,
}

/// Searches action sequences, start by start, and returns rows.
#[pyfunction]
pub(crate) fn search_world<'py>(
    py: Python<'py>,
    world: &RawWorld,
    options: SearchOptions,
    running: Running,
) -> PyResult<Bound<'py, PyAny>> {
    some_starts(options.starts)?;
    let egos = egos(&world.0, options.ego.as_ref().map(|ego| ego.bind(py)))?;
    let guide = options.guided.as_ref().map(|run| {
        let run = RunDir::open(run).map_err(failed)?;
        policy_for(&run, &egos).map_err(failed)
    });
    let policy = guide.transpose()?;
    let switches = Some(options.switches.unwrap_or_else(|| usual_switches(&egos)));
    // Refused before anything is played.
    let settings = MethodSettings {
        switches,
        guide: policy.as_deref().map(GuidingPolicy),
        ..MethodSettings::default()
    };
    let method = Method::named(&options.method, &settings).map_err(failed)?;
    // An option without effect would suggest a result that it did not have.
    let given = [
        options.switches.map(|_| MethodOption::Switches),
        options.budget.map(|_| MethodOption::Budget),
        options.guided.as_ref().map(|_| MethodOption::Guided),
    ];
    let options_given: Vec<MethodOption> = given.into_iter().flatten().collect();
    let refused = method.info().refuse_others(&options_given);
    refused.map_err(failed)?;
    if options.budget == Some(0) {
        return Err(wrong(
            "a search of 0 simulations finds nothing",
            "give at least one per start, such as `budget=100`",
        ));
    }
    // The work may outlive this call after Ctrl-C, so it owns all that it reads.
    let (world, name) = (world.0.clone(), options.method.clone());
    let rows = running.watched(py, move |watch| {
        let settings = MethodSettings {
            switches,
            guide: policy.as_deref().map(GuidingPolicy),
            ..MethodSettings::default()
        };
        let method = Method::named(&name, &settings)?;
        let campaign = SearchCampaign {
            world: &world,
            egos: &egos,
            run: None,
            method,
            budget: options.budget.unwrap_or(method.info().budget),
            starts: (options.starts, options.seed),
        };
        let Some(table) = campaign.run(watch)? else {
            return Ok(None);
        };
        if let Some(keep) = &options.keep {
            table.keep(&keep.directory, keep.settings(), watch)?;
        }
        Ok(Some(table.rows))
    })?;
    objects(py, &something(rows)?)
}

/// Writes a page about a run and JUnit XML beside it, and returns the two files.
#[pyfunction]
pub(crate) fn report_run(
    py: Python<'_>,
    run: PathBuf,
    output: Option<PathBuf>,
    starts: (usize, u64),
    running: Running,
) -> PyResult<(PathBuf, PathBuf)> {
    some_starts(starts.0)?;
    let html = output.unwrap_or_else(|| run.join("report.html"));
    let junit = html.with_extension("junit.xml");
    let run = RunDir::open(&run).map_err(failed)?;
    let scenario = run.scenario().map_err(failed)?;
    let files = (html.clone(), junit.clone());
    let done = running.watched(py, move |watch| {
        let request = ReportRequest {
            run: &run,
            scenario: &scenario,
            with: &[],
            given: &GivenRows::default(),
            starts,
            ego: None,
            reuse_starts: None,
        };
        let Some(report) = request.report(watch)? else {
            return Ok(None);
        };
        brakecheck::run_dir::write_file(&html, report.html().as_bytes())?;
        brakecheck::run_dir::write_file(&junit, report.junit().as_bytes())?;
        Ok(Some(()))
    })?;
    something(done)?;
    Ok(files)
}

/// Refuses a test without a start, whose rates of 0 would have no evidence.
fn some_starts(starts: usize) -> PyResult<()> {
    if starts > 0 {
        return Ok(());
    }
    Err(wrong(
        "a test of 0 starts shows nothing",
        "give at least one, such as `starts=300`",
    ))
}

/// Returns the world on the requested plant.
fn placed(world: &Scenario, plant: Option<&str>) -> PyResult<Scenario> {
    match plant {
        Some(plant) => on_plant(world, plant_of(plant)?).map_err(failed),
        None => Ok(world.clone()),
    }
}
