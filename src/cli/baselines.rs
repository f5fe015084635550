//! `brakecheck eval WORLD`: baselines and a search, in a world without a trained ado.

use serde_json::json;

use super::common::{exit_of, interrupted_early, load_world, placed, print_json};
use super::eval_args::EvalArgs;
use super::failure::{Exit, Failure};
use super::test_args::{TestArgs, note_program_costs};
use super::{points, progress, table};
use crate::evaluation::{BaselineTable, ado_effects, untrained};
use crate::search::usual_switches;

/// Refuses options that require a trained ado.
fn refuse_options_of_runs(args: &EvalArgs, has_points: bool) -> Result<(), Failure> {
    let test = &args.test;
    let options = [
        (!test.ado.is_empty(), "--ado"),
        // One try is the default, so more than one was asked for.
        (test.tries > 1, "--tries"),
        (test.temperature.is_some(), "--temperature"),
        (test.runs > 0, "--runs"),
        // Points are played by the ego itself, so their failures can be kept.
        (test.keep.dir().is_some() && !has_points, "--keep"),
        (args.theorems, "--theorems"),
    ];
    // One message has all of them, so that one correction suffices.
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

/// Plays the points of a world, or baselines and a search where it has none.
pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    let test = &args.test;
    let mut world = load_world(&args.run, &test.common)?;
    // A stream that cannot be written is refused before minutes of simulation.
    test.live.admit(test.common.json)?;
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
    // Every sequence is a whole run of a program, so its usual search is smaller.
    let switches = test.search.unwrap_or_else(|| usual_switches(&egos));
    let Some(baselines) = untrained(&world, &egos, test.seed, test.starts, switches, &watch)?
    else {
        // The bar would overwrite the note about the interruption.
        drop(bar);
        return interrupted_early(&test.common);
    };
    // The note passes through the watch, so the bar is still needed here.
    note_program_costs(&egos, &watch);
    drop(bar);
    print(&baselines, test)?;
    Ok(exit_of(&baselines.rows, args.fail_on_counterexample))
}

fn print(baselines: &BaselineTable, test: &TestArgs) -> Result<(), Failure> {
    let effects = ado_effects(&baselines.rows);
    if test.common.json {
        let mut object = json!({ "rows": baselines.rows, "in_the_way": baselines.in_the_way });
        if !effects.is_empty() {
            object["ado_effects"] = json!(effects);
        }
        return print_json(&object);
    }
    let mut answer = table::rows(&baselines.rows);
    table::add_effects(&mut answer, &effects);
    // A rule that blocks the adversaries explains low rates, so it is no detail.
    for why in &baselines.in_the_way {
        answer.table.push_str(&format!("\n{why}"));
    }
    test.live.data(&answer.text(test.answer))
}
