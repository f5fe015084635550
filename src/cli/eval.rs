//! `brakecheck eval`: a frozen ado on test starts and egos, beside baselines.

use serde_json::json;

use super::eval_args::EvalArgs;
use super::run_under_test::{RunUnderTest, Supplement, is_world, rows_of};
use super::test_args::note_program_costs;
use super::{
    Exit, Failure, exit_of, interrupted_early, load_world, placed, points, population, print_json,
    progress, table, theorems,
};
use crate::evaluation::{EvaluationTable, TheoremsChecked, untrained};
use crate::experiment::Watch;
use crate::search::usual_switches;
use crate::theorems::admits_theorems;

/// Refuses options that require a trained ado.
fn refuse_options_of_runs(args: &EvalArgs, has_points: bool) -> Result<(), Failure> {
    let test = &args.test;
    let options = [
        (!test.ado.is_empty(), "--ado"),
        (test.tries > 1, "--tries"),
        (test.temperature.is_some(), "--temperature"),
        (test.runs > 0, "--runs"),
        // Points are played by the ego itself, so their failures can be kept.
        (test.keep.dir().is_some() && !has_points, "--keep"),
        (args.theorems, "--theorems"),
    ];
    let given: Vec<&str> = options
        .iter()
        .filter(|(is_given, _)| *is_given)
        .map(|(_, option)| *option)
        .collect();
    if given.is_empty() {
        return Ok(());
    }
    Err(Failure::input(
        format!(
            "`{}` is a world, without the trained ado that is required by {}",
            args.run.display(),
            given.join(", ")
        ),
        "leave them out: the baselines play anyway; or train an ado first and evaluate its run: `brakecheck train WORLD`",
    ))
}

/// Evaluates a world in which no ado was trained.
fn of_world(args: &EvalArgs) -> Result<Exit, Failure> {
    let test = &args.test;
    let mut world = load_world(&args.run, &test.common)?;
    test.live.check(test.common.json)?;
    let has_points = world.has_points();
    world = test.traffic.limited(world)?;
    refuse_options_of_runs(args, has_points)?;
    world = placed(world, test.plant)?;
    if has_points {
        return points::run(args, &world);
    }
    let egos = test.traffic.levels(args.ego.find(&world)?);
    let live = args.open_live(&world)?;
    let bar = progress::bar(&args.test.common, "");
    let watch = bar.watch().first_of(egos.len()).shown_to(live.audience());
    let switches = test.search.unwrap_or_else(|| usual_switches(&egos));
    let Some(baselines) = untrained(&world, &egos, test.seed, test.starts, switches, &watch)?
    else {
        drop(bar);
        return interrupted_early(&test.common);
    };
    note_program_costs(&egos, &watch);
    drop(bar);
    if test.common.json {
        print_json(&json!({ "rows": baselines.rows, "in_the_way": baselines.in_the_way }))?
    } else {
        test.live.data(&table::rows(&baselines.rows))?;
        for why in &baselines.in_the_way {
            test.live.data(&why.to_string())?;
        }
    }
    Ok(exit_of(&baselines.rows, args.fail_on_counterexample))
}

pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    if let Some(members) = args.members {
        return population::eval(args, members);
    }
    if is_world(&args.run) {
        return of_world(args);
    }
    // All checks of the request come before the first simulation.
    let tested = RunUnderTest::open(&args.run, &args.test)?;
    if args.theorems {
        admits_theorems(&tested.nominal)?;
    }
    let egos = args.test.traffic.levels(args.ego.find(&tested.nominal)?);
    let live = tested.live()?;
    let bar = progress::bar(&args.test.common, "");
    let watch = tested.watch(&bar, &live, egos.len());
    let Some(mut evaluated) = tested.evaluate(&egos, false, &watch)? else {
        return interrupted_early(&args.test.common);
    };
    let theorems = checked(args, &mut evaluated, &watch.unnumbered());
    drop(bar);
    // Rows are printed before files are written, so a full disk does not cost the rows.
    let result = theorems.as_ref().map(|theorems| Supplement {
        key: "theorems",
        value: json!(theorems),
        text: theorems::text(theorems),
    });
    tested.show(&evaluated, result)?;
    tested.keep(&evaluated, egos.len())?;
    // A failure at a later ego decides, although the rows before it are printed.
    let rows = rows_of(evaluated)?;
    if theorems.is_some_and(|theorems| theorems.is_refuted()) {
        return Err(Failure::fault(
            "a theorem failed on a pair of runs, which it cannot",
            Some("this is a bug of brakecheck: please report it with the run".to_owned()),
        ));
    }
    Ok(exit_of(&rows, args.fail_on_counterexample))
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
