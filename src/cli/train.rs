//! `brakecheck train`: a world in, a run directory with a trained ado out.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::answer::AnswerArgs;
use super::common::{
    finished, interrupted_early, load_world, note_warnings, one_of, open_run, plant_in, print_json,
    refuse_program,
};
use super::defaults::{PLANT, is_plant_default};
use super::failure::{Exit, Failure};
use super::headings::{EGO, LEARNING, TEST};
use super::live::{RerunArgs, Streamed};
use super::number_args::{STARTS, count, start_count};
use super::output_path::new_dir;
use super::terminal::{self, Common};
use super::test_args::temperature;
use super::traffic_args::TrafficArgs;
use super::verdict::verdict;
use super::{league, population, progress, table};
use crate::population::{DistinctRequest, DistinctSession, LeagueRequest, LeagueSession};
use crate::risk::RiskTraffic;
use crate::rulebook::TrainingGoal;
use crate::run_dir::{AdversaryId, CalibrationWarning, RunDir, TrainingEnd, counted};
use crate::sim::PlantKind;
use crate::training::{
    Closing, OptionClash, PerAdoMode, SessionError, TrainRequest, TrainSession, TrainingOutcome,
};
use crate::world::{Scenario, TrainingEgos};

#[derive(Args, Debug)]
pub(super) struct TrainArgs {
    /// The world: a file, or the name of a shipped one.
    world: PathBuf,
    /// The run directory to make [default: runs/WORLD-SEED].
    #[arg(short, long, value_name = "RUN", value_parser = new_dir())]
    output: Option<PathBuf>,
    /// Decisions to train for, instead of the world's number.
    #[arg(long, value_name = "N", value_parser = count(1..=u64::MAX))]
    decisions: Option<u64>,
    /// Which of the world's `learners` to train with, instead of its `learner`.
    #[arg(long, value_name = "NAME", help_heading = LEARNING)]
    learner: Option<String>,
    /// Give each ado a policy of its own, instead of one for all of them.
    #[arg(long, value_name = "MODE", value_parser = one_of::<PerAdoMode>(), help_heading = LEARNING)]
    per_ado: Option<PerAdoMode>,
    /// Reward severe or distinct failures, instead of the world's `goals`.
    #[arg(long = "goal", value_parser = one_of::<TrainingGoal>(), value_name = "GOAL", help_heading = LEARNING)]
    goals: Vec<TrainingGoal>,
    /// Temperature of an ado of declared traffic: at 1 it drives as the traffic that fails.
    #[arg(long, value_name = "T", value_parser = temperature, help_heading = LEARNING)]
    temperature: Option<f64>,
    /// Weaken the traffic's law, from 1 (as people drive) to 0 (any possible action).
    #[arg(long, value_name = "B", value_parser = prior, help_heading = LEARNING)]
    prior: Option<f64>,
    /// Egos to train against: the world's own, or its family under `train_against`.
    #[arg(long, value_parser = one_of::<TrainingEgos>(), default_value = "nominal", value_name = "EGOS", help_heading = EGO)]
    against: TrainingEgos,
    /// Leave a structure out of the family, to test the ado on it later.
    #[arg(long, value_name = "STRUCTURE", help_heading = EGO)]
    leave_out: Option<String>,
    /// Train against a changed ego: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// The physics to train in, instead of the world's.
    #[arg(long, value_parser = one_of::<PlantKind>(), env = PLANT, hide_env_values = true, help_heading = TEST)]
    plant: Option<PlantKind>,
    /// Continue an interrupted training in RUN.
    #[arg(long)]
    resume: bool,
    /// Begin with the policy of another run and fine-tune it.
    #[arg(long, value_name = "RUN", conflicts_with = "resume", help_heading = LEARNING)]
    from: Option<PathBuf>,
    /// Learn from a run, or from kept counterexamples, of any ego (repeatable).
    #[arg(long, value_name = "RUN|DIR", conflicts_with = "resume", help_heading = LEARNING)]
    bank: Vec<PathBuf>,
    /// Train N ados for distinct failures, without a closing evaluation.
    #[arg(long, value_name = "N", value_parser = count(1..=1000), help_heading = LEARNING)]
    distinct: Option<u64>,
    /// Train ados against egos of the family that respond to them (experimental).
    #[arg(long, value_name = "ROUNDS", conflicts_with = "distinct", value_parser = count(1..=1000), help_heading = LEARNING)]
    league: Option<u64>,
    /// Test starts of the closing evaluation, always of seed 0.
    #[arg(long, value_name = "N", default_value_t = STARTS, value_parser = start_count(), help_heading = TEST)]
    starts: usize,
    /// Seed of the training [default: 0, or as begun].
    #[arg(long, value_name = "N", value_parser = count(0..=u64::MAX))]
    seed: Option<u64>,
    /// Taken only to be refused with the fix.
    #[arg(last = true, hide = true)]
    program: Vec<String>,
    #[command(flatten)]
    traffic: TrafficArgs,
    #[command(flatten)]
    live: RerunArgs,
    #[command(flatten)]
    answer: AnswerArgs,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &TrainArgs) -> Result<Exit, Failure> {
    // A run must be repeatable from its directory, which a typed program is not in.
    refuse_program("train", &args.program)?;
    let world = load_world(&args.world, &args.common)?;
    args.traffic.one_rate("train")?;
    let laws = args.traffic.laws(&world)?;
    // A file of laws is no model of drivers, so it must not be read as one.
    let world = match &laws {
        Some(_) => world,
        None => args.traffic.limited(world)?,
    };
    // A refused stream must leave no run directory, and a refused training no stream.
    args.live.admit(args.common.json)?;
    // Before the first decision, because an odd world wastes the whole training.
    note_warnings(&args.world, &world);
    let given = Given {
        args,
        laws: laws.as_ref(),
    };
    match (args.distinct, args.league) {
        (None, None) => train_one(given, &world),
        _ if laws.is_some() => Err(SessionError::Options(OptionClash::TrafficAndMany).into()),
        (Some(members), _) => train_population(args, &world, members as usize),
        (None, Some(rounds)) => train_league(args, &world, rounds as usize),
    }
}

/// Arguments, with the traffic that they name.
#[derive(Clone, Copy)]
struct Given<'a> {
    args: &'a TrainArgs,
    laws: Option<&'a RiskTraffic>,
}

/// Trains one ado and evaluates it.
fn train_one(given: Given<'_>, world: &Scenario) -> Result<Exit, Failure> {
    let args = given.args;
    let mut session = session(given, world)?;
    let title = format!("training in {}", world.name);
    // Opened after the session, so that a refused training leaves no file of a stream.
    let live = args.live.open(&title, Streamed::Training)?;
    let bar = progress::bar(&args.common, "");
    let trained = session.train(&bar.watch().shown_to(live.audience()))?;
    drop(bar);
    let path = session.run().path().display().to_string();
    // An interrupted training has no final policy, so there is nothing to evaluate.
    if trained.interrupted {
        let (done, requested) = (trained.done.decisions, trained.done.decisions_asked);
        // A training that still learns goes on beyond the requested decisions.
        let of = if done > requested {
            format!("decisions, of which {requested} were requested")
        } else {
            format!("of {}", counted(requested, "decision"))
        };
        terminal::note(&format!(
            "stopped after {done} {of}; go on with `brakecheck train {} -o {path} --resume`",
            args.world.display(),
        ));
        return Ok(Exit::Interrupted);
    }
    print_trained(&trained);
    let bar = progress::bar(&args.common, "");
    let watch = bar.watch().shown_to(live.audience());
    let Some(closing) = session.evaluate(args.starts, &watch)? else {
        return interrupted_early(&args.common);
    };
    drop(bar);
    show(args, &session, &trained, &closing)?;
    // The rows are printed first, so a full disk does not cost them.
    session.keep(&closing)?;
    if !args.common.json {
        terminal::note(&format!("kept in {path}"));
    }
    Ok(finished(Exit::Done))
}

/// Trains several ados that fail the ego in different cells.
fn train_population(args: &TrainArgs, world: &Scenario, members: usize) -> Result<Exit, Failure> {
    let from = source(args)?;
    let request = DistinctRequest::new(request(args, world, from.as_ref()), members);
    let path = output(args, world);
    let session = DistinctSession::begin(world, &path, &request, args.resume)?;
    let title = format!("training in {}", world.name);
    // Opened after the session, as in `train_one`.
    let live = args.live.open(&title, Streamed::Training)?;
    population::train(session, &path, &args.common, live.audience())
}

/// Trains egos and ados by alternating responses.
fn train_league(args: &TrainArgs, world: &Scenario, rounds: usize) -> Result<Exit, Failure> {
    let from = source(args)?;
    let request = LeagueRequest::new(request(args, world, from.as_ref()), rounds);
    let path = output(args, world);
    let session = LeagueSession::begin(world, &path, &request, args.resume)?;
    let title = format!("training in {}", world.name);
    // Opened after the session, as in `train_one`.
    let live = args.live.open(&title, Streamed::Training)?;
    league::train(session, &path, rounds, &args.common, live.audience())
}

/// Returns the run directory.
fn output(args: &TrainArgs, world: &Scenario) -> PathBuf {
    // The seed is in the name, so that trainings of several seeds do not collide.
    let default = || PathBuf::from(format!("runs/{}-{}", world.name, args.seed.unwrap_or(0)));
    args.output.clone().unwrap_or_else(default)
}

fn prior(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok();
    value
        .filter(|value| (0.0..=1.0).contains(value))
        .ok_or_else(|| "give a number from 0 to 1, such as 0.5".to_owned())
}

/// Opens the run to fine-tune.
fn source(args: &TrainArgs) -> Result<Option<RunDir>, Failure> {
    let from = args.from.as_ref();
    Ok(from.map(|from| open_run(from, &args.common)).transpose()?)
}

fn request<'a>(
    args: &'a TrainArgs,
    world: &Scenario,
    from: Option<&'a RunDir>,
) -> TrainRequest<'a> {
    // A run that is resumed keeps its plant, whatever the default is now.
    let is_stale = args.resume && is_plant_default();
    TrainRequest {
        seed: args.seed,
        decisions: args.decisions,
        learner: args.learner.as_deref(),
        per_ado: args.per_ado,
        // No goal means those of the world, and an empty list would mean none.
        goals: (!args.goals.is_empty()).then_some(&*args.goals),
        against: args.against,
        leave_out: args.leave_out.as_deref(),
        ego: args.ego.as_deref(),
        plant: plant_in(world, args.plant).filter(|_| !is_stale),
        from,
        bank: &args.bank,
        // Only the training of a single ado takes laws, and `session` adds them.
        traffic: None,
        temperature: args.temperature,
        prior: args.prior,
    }
}

/// Begins a training or goes on with one.
fn session(given: Given<'_>, world: &Scenario) -> Result<TrainSession, Failure> {
    let args = given.args;
    let path = output(args, world);
    // The source run is opened first, so a damaged run leaves no new directory.
    let from = source(args)?;
    let request = TrainRequest {
        traffic: given.laws,
        ..request(args, world, from.as_ref())
    };
    Ok(if args.resume {
        TrainSession::resume(world, &path, &request)?
    } else {
        TrainSession::begin(world, &path, &request)?
    })
}

fn print_trained(trained: &TrainingOutcome) {
    let done = &trained.done;
    terminal::note(&format!(
        "trained for {} in {}: {:.1} s of processor time, {:.0} decisions/s",
        counted(done.decisions, "decision"),
        counted(done.episodes, "episode"),
        done.cpu_s,
        rate(trained)
    ));
}

/// Notes dropped episodes, an early end, and an ado that is not reliable.
fn note_end(trained: &TrainingOutcome, closing: &Closing) {
    if trained.aborted > 0 {
        terminal::note(&format!(
            "dropped {} for faults of the ego or the physics",
            counted(trained.aborted, "episode")
        ));
    }
    // The usual end, after the requested decisions, needs no remark.
    if let Some(ended) = trained
        .done
        .ended
        .filter(|ended| *ended != TrainingEnd::Asked)
    {
        let calibration = trained.done.calibration.as_ref();
        terminal::note(&format!("ended: {}", ended.in_words(calibration)));
    }
    if let Some(warning) = warning(trained, closing) {
        terminal::note(&format!("warning: {}", warning.what));
        terminal::note(&format!("  help: {}", warning.help));
    }
}

/// Returns the warning about an ado that solves fewer starts than a search.
///
/// Traffic cannot play all sequences of a search, so its ado is no worse for those.
fn warning(trained: &TrainingOutcome, closing: &Closing) -> Option<CalibrationWarning> {
    trained.warning().filter(|_| closing.traffic.is_none())
}

/// Decisions per second of processor time.
fn rate(trained: &TrainingOutcome) -> f64 {
    // A very short training may have no measurable processor time.
    trained.done.decisions as f64 / trained.done.cpu_s.max(1e-9)
}

fn show(
    args: &TrainArgs,
    session: &TrainSession,
    trained: &TrainingOutcome,
    closing: &Closing,
) -> Result<(), Failure> {
    let rows = &closing.rows;
    if !args.common.json {
        let mut answer = table::rows(rows);
        // What was trained is the question, also where a baseline does better.
        if let Some(own) = rows.iter().find(|row| row.ado == AdversaryId::Trained) {
            answer.verdict = verdict(std::slice::from_ref(own));
        }
        // A stream may occupy stdout, so the table yields to it.
        args.live.data(&answer.text(args.answer))?;
        if let Some(traffic) = &closing.traffic {
            traffic
                .in_words()
                .iter()
                .for_each(|line| terminal::note(line));
        }
        note_end(trained, closing);
        return Ok(());
    }
    let (run, world) = (session.run(), session.world());
    print_json(&json!({
        "run": run.path().display().to_string(),
        "world": world.name,
        "plant": world.plant(),
        "seed": run.manifest().seed,
        "decisions": trained.done.decisions,
        "episodes": trained.done.episodes,
        "cpu_s": trained.done.cpu_s,
        "decisions_per_cpu_s": rate(trained),
        "sought": run.manifest().sought,
        "calibration": trained.done.calibration,
        "ended": trained.done.ended,
        "warning": warning(trained, closing),
        "traffic": closing.traffic,
        "rows": rows,
    }))
}
