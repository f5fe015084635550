//! `brakecheck eval`: a frozen ado on test starts and egos, beside baselines.

use std::num::NonZeroU64;
use std::path::Path;

use serde_json::json;

use super::eval_args::EvalArgs;
use super::gate_and_sweep::GateAndSweep;
use super::{
    Exit, Failure, exit_of, interrupted_early, load_world, open_run, points, print_json, progress,
    table, talk, theorems,
};
use crate::adversary::AdoKind;
use crate::evaluation::{
    Evaluation, EvaluationTable, Sweep, TheoremsChecked, summarise, untrained,
};
use crate::experiment::{EgoUnderTest, Watch, on_plant};
use crate::run_dir::{AdversaryId, RunDir};
use crate::sysid::ContextSource;
use crate::world::Scenario;

/// Remark on a conditional ado without any run of an ego.
const UNTOLD: &str = "the ado is told the parameters of the world's own ego: `--runs 10` identifies every ego from ten runs of it, `--runs 100` also learns how it drives";

/// Returns whether the path is a world file or a shipped world, and not a run.
pub(super) fn is_world(path: &Path) -> bool {
    let mut shipped = Scenario::shipped_names().chain(Scenario::protocol_names());
    let mut is_shipped = || shipped.any(|name| path.as_os_str() == name);
    // A directory of the same name as a shipped world is a run.
    path.is_file() || (!path.exists() && is_shipped())
}

/// Refuses options that require a run with an ado.
fn not_a_run(args: &EvalArgs, has_points: bool) -> Failure {
    let world = args.run.display();
    let (does, keep) = if has_points {
        ("--search, --keep", "")
    } else {
        ("--search", "--keep, ")
    };
    Failure::input(
        format!(
            "`{world}` is a world, and no run of an ado: of the options, --starts, --seed, --ego, --plant, {does} and those of every verb do something for it, and --ado, --tries, --runs, {keep}--theorems, --baseline-ego and --over do not"
        ),
        "leave them out: the baselines play anyway; or train an ado first and evaluate its run: `brakecheck train WORLD`",
    )
}

/// Evaluates a world in which no ado was trained.
fn of_world(args: &EvalArgs) -> Result<Exit, Failure> {
    let mut world = load_world(&args.run, &args.common)?;
    let has_points = world.has_points();
    // Points are played by the ego itself, so their failures can be kept.
    let keeps = args.keep.dir().is_some() && !has_points;
    let asks_for_an_ado = !args.ado.is_empty()
        || 1 < args.tries
        || 0 < args.runs
        || keeps
        || args.theorems
        || args.baseline_ego.is_some()
        || args.over.is_some();
    if asks_for_an_ado {
        return Err(not_a_run(args, has_points));
    }
    if let Some(plant) = args.plant {
        world = on_plant(&world, plant)?;
    }
    if has_points {
        return points::run(args, &world);
    }
    let egos = EgoUnderTest::find_or_program(&world, &args.ego, &args.program)?;
    let bar = progress::bar("");
    let watch = bar.watch().first_of(egos.len());
    let starts = (args.starts, args.seed);
    // One switch is a cheap estimate of the reach, while `search` looks further.
    let switches = args.search.unwrap_or(1);
    let Some(met) = untrained(&world, &egos, starts, switches, &watch)? else {
        drop(bar);
        return interrupted_early(&args.common);
    };
    drop(bar);
    if args.common.json {
        print_json(&json!({ "rows": met.rows, "in_the_way": met.in_the_way }))?
    } else {
        talk::data(&table::rows(&met.rows))?;
        for why in &met.in_the_way {
            talk::data(&why.to_string())?;
        }
    }
    Ok(exit_of(&met.rows, args.fail_on_counterexample))
}

pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    if is_world(&args.run) {
        return of_world(args);
    }
    let run = open_run(&args.run, &args.common)?;
    let bar = progress::bar("");
    let watch = bar.watch();
    // All checks of the request come before the first simulation.
    let context = told(args, &run)?;
    let nominal = nominal(args, &run)?;
    let sweep = args.over.as_deref().map(Sweep::parse).transpose()?;
    let egos = egos(args, sweep.as_ref(), &nominal)?;
    check(args, &nominal)?;
    let evaluation = Evaluation {
        run: &run,
        nominal: &nominal,
        egos: &egos,
        ados: &ados(args, &run),
        context: context.as_ref(),
        starts: (args.starts, args.seed),
        search: args.search,
        tries: args.tries,
        runs: NonZeroU64::new(args.runs),
        unknown: &[],
        keeps: args.keep.dir().is_some() || args.baseline_ego.is_some(),
    };
    // Keeping plays many runs, so it counts as a step.
    let watch = watch.first_of(egos.len() + usize::from(args.keep.dir().is_some()));
    let Some(mut evaluated) = evaluation.run(&watch)? else {
        return interrupted_early(&args.common);
    };
    let theorems = checked(args, &mut evaluated, &watch.unnumbered());
    let compared = (args.baseline_ego.as_deref(), args.curve.as_deref());
    let compared = GateAndSweep::of(compared, sweep.as_ref(), &evaluated, &watch.unnumbered())?;
    drop(bar);
    // Rows are printed before files are written, so a full disk does not cost the rows.
    show(args, &evaluated, theorems.as_ref(), &compared)?;
    keep(args, &evaluated, egos.len())?;
    ended(args, evaluated, theorems, &compared)
}

/// Keeps counterexamples if asked to: the step after as many as there are egos.
fn keep(args: &EvalArgs, evaluated: &EvaluationTable<'_>, egos: usize) -> Result<(), Failure> {
    if let Some(dir) = args.keep.dir() {
        let bar = progress::bar("");
        let watch = bar.watch().first_of(egos + 1).later(egos);
        evaluated.keep(dir, args.keep.settings(), &watch)?;
    }
    Ok(())
}

/// Returns the context of a conditional ado, with a remark if it has none.
fn told(args: &EvalArgs, run: &RunDir) -> Result<Option<ContextSource>, Failure> {
    let context = ContextSource::of(run, NonZeroU64::new(args.runs))?;
    if context == Some(ContextSource::Nominal) {
        talk::say(UNTOLD);
    }
    Ok(context)
}

/// The world of the run, on the plant to test on.
fn nominal(args: &EvalArgs, run: &RunDir) -> Result<Scenario, Failure> {
    let world = run.scenario()?;
    match args.plant {
        Some(plant) => Ok(on_plant(&world, plant)?),
        None => Ok(world),
    }
}

/// Returns the ados to play.
///
/// By default, an ado that adapts has the baselines beside it that it must exceed.
fn ados(args: &EvalArgs, run: &RunDir) -> Vec<AdoKind> {
    match (args.ado.is_empty(), args.runs) {
        (false, _) => args.ado.clone(),
        (true, 0) => vec![AdoKind::Trained],
        (true, _) => {
            use AdoKind::{Constant, Hold, Replays, Switch, Trained};
            let mut beside = vec![Trained, Hold, Constant, Switch];
            // Only a training against one ego stores counterexamples.
            if run.manifest().against.is_nominal() {
                beside.push(Replays);
            }
            beside
        }
    }
}

/// Refuses requests without a possible result.
fn check(args: &EvalArgs, nominal: &Scenario) -> Result<(), Failure> {
    keeps_something(args)?;
    can_learn(args, nominal)
}

/// Refuses to adapt to egos in worlds without driving.
fn can_learn(args: &EvalArgs, nominal: &Scenario) -> Result<(), Failure> {
    if 0 < args.runs && nominal.grid().is_some() {
        return Err(Failure::input(
            "`--runs` learns how an ego drives, and in this world no vehicle drives",
            "leave it out: the ado of a grid plays as it was trained",
        ));
    }
    Ok(())
}

/// Returns the egos of the sweep, or the requested egos and the baseline ego.
fn egos(
    args: &EvalArgs,
    sweep: Option<&Sweep>,
    nominal: &Scenario,
) -> Result<Vec<EgoUnderTest>, Failure> {
    if let Some(sweep) = sweep {
        return Ok(sweep.egos(nominal)?);
    }
    let mut egos = EgoUnderTest::find_or_program(nominal, &args.ego, &args.program)?;
    if let Some(asked) = &args.baseline_ego {
        let before = EgoUnderTest::find(nominal, asked)?;
        let [before] = &before[..] else {
            return Err(Failure::input(
                "`--baseline-ego all` is more than one ego",
                "name the one ego that the others are compared with",
            ));
        };
        // The baseline ego is played once, even if `--ego all` contains it.
        egos.retain(|ego| ego.name() != before.name());
        if egos.is_empty() {
            return Err(Failure::input(
                format!("`{asked}` is compared with itself"),
                "name another ego with `--ego`",
            ));
        }
        // The baseline comes last, below the egos that are compared with it.
        egos.push(before.clone());
    }
    Ok(egos)
}

/// Checks the theorems if requested and if everything was played.
///
/// An error of the check does not hide the rows.
fn checked(
    args: &EvalArgs,
    evaluated: &mut EvaluationTable<'_>,
    watch: &Watch<'_>,
) -> Option<TheoremsChecked> {
    if !args.theorems || watch.stopped() || evaluated.failure.is_some() {
        return None;
    }
    watch.phase("theorems");
    let checked = evaluated.theorems(watch);
    checked.unwrap_or_else(|error| {
        evaluated.failure = Some(error);
        None
    })
}

/// Refuses to keep counterexamples of ados whose counterexamples are not kept.
fn keeps_something(args: &EvalArgs) -> Result<(), Failure> {
    let kept = [AdoKind::Trained, AdoKind::All, AdoKind::Optimal];
    let asked = &args.ado;
    let plays_trained = asked.is_empty() || kept.iter().any(|ado| asked.contains(ado));
    if args.keep.dir().is_some() && !plays_trained {
        Err(Failure::input(
            "`--keep` writes counterexamples of the trained ado, which is not asked for",
            "add `--ado trained`",
        ))
    } else {
        Ok(())
    }
}

fn show(
    args: &EvalArgs,
    evaluated: &EvaluationTable<'_>,
    theorems: Option<&TheoremsChecked>,
    compared: &GateAndSweep,
) -> Result<(), Failure> {
    let summary = summarise(&evaluated.egos, &AdversaryId::Trained);
    if args.common.json {
        let mut object = json!({
            "rows": evaluated.rows(),
            "egos": evaluated.egos,
            "summary": summary,
            "explain": evaluated.reasons,
        });
        // Keys appear only if requested, so scripts of other requests see no change.
        if !evaluated.identified.is_empty() {
            object["identified"] = json!(evaluated.identified);
        }
        if !evaluated.adapted_to.is_empty() {
            object["adapted"] = json!(evaluated.adapted_to);
        }
        if let Some(theorems) = theorems {
            object["theorems"] = json!(theorems);
        }
        compared.add_to(&mut object);
        return print_json(&object);
    }
    talk::data(&table::reuse(&evaluated.egos, &summary))?;
    for found in &evaluated.identified {
        talk::data(&format!("\n{}", table::identified(found)))?;
    }
    for adapted in &evaluated.adapted_to {
        talk::data(&format!("\n{adapted}"))?;
    }
    for why in &evaluated.reasons {
        talk::data(&format!(
            "\nwhy `{}` fails from start {}, the first of them: {}",
            why.ego, why.start, why.explanation
        ))?;
    }
    if let Some(theorems) = theorems {
        talk::data(&format!("\n{}", theorems::text(theorems)))?;
    }
    compared.show()
}

/// Returns the exit code, after everything was printed and kept.
fn ended(
    args: &EvalArgs,
    evaluated: EvaluationTable<'_>,
    theorems: Option<TheoremsChecked>,
    compared: &GateAndSweep,
) -> Result<Exit, Failure> {
    let rows = evaluated.rows();
    // A failure at a later ego decides, although the rows before it are printed.
    if let Some(failure) = evaluated.failure {
        return Err(failure.into());
    }
    if theorems.is_some_and(|theorems| theorems.is_refuted()) {
        return Err(Failure::fault(
            "a theorem failed on a pair of runs, which it cannot",
            Some("this is a bug of brakecheck: please report it with the run".to_owned()),
        ));
    }
    Ok(if compared.is_held_up(args.gate) {
        Exit::Counterexample
    } else {
        exit_of(&rows, args.fail_on_counterexample)
    })
}
