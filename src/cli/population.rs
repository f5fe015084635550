//! Populations of ados in `train --distinct` and `eval --members`.

use std::path::Path;

use serde_json::json;

use super::common::{exit_of, finished, interrupted_early, open_run, placed, print_json};
use super::display::stdout_columns;
use super::eval_args::EvalArgs;
use super::failure::{Exit, Failure};
use super::run_under_test::refuse_world;
use super::terminal::{self, Common};
use super::test_args::note_program_costs;
use super::{progress, table};
use crate::experiment::{Audience, EgoUnderTest};
use crate::population::{
    DistinctOutcome, DistinctSession, PopulationDir, PopulationResults, PopulationTest,
};
use crate::report::TextTable;
use crate::run_dir::{Row, RunDir, counted};
use crate::world::Scenario;

/// Most cells that a table lists.
const LISTED: usize = 20;

/// Trains a population that was begun or opened again.
pub(super) fn train(
    session: DistinctSession,
    path: &Path,
    common: &Common,
    audience: Option<&dyn Audience>,
) -> Result<Exit, Failure> {
    let bar = progress::bar(common, "");
    let watch = bar.watch().shown_to(audience);
    let trained = session.train(&watch)?;
    // The bar must not overwrite the lines that follow.
    drop(bar);
    if trained.interrupted {
        terminal::note(&format!(
            "stopped; finished members are kept: go on with the same command and `--resume` in {}",
            path.display(),
        ));
        return Ok(Exit::Interrupted);
    }
    // The training writes the manifest that is printed, so it is read afterwards.
    let dir = PopulationDir::open(path)?;
    if common.json {
        print_json(&json!({
            "run": path.display().to_string(),
            "population": dir.manifest(),
            "cpu_s": trained.members.iter().map(|member| member.done.cpu_s).sum::<f64>(),
            "search_cpu_s": trained.search_cpu_s,
        }))?;
    } else {
        print_trained(&trained);
        terminal::note(&format!(
            "kept in {0}; evaluate it with `brakecheck eval {0} --members all`",
            path.display(),
        ));
    }
    Ok(finished(Exit::Done))
}

fn print_trained(trained: &DistinctOutcome) {
    for (number, member) in trained.members.iter().enumerate() {
        let done = &member.done;
        terminal::note(&format!(
            "member {number:03} trained for {} in {}: {:.1} s of processor time",
            counted(done.decisions, "decision"),
            counted(done.episodes, "episode"),
            done.cpu_s,
        ));
        if let Some(warning) = done.calibration.and_then(|c| c.warning()) {
            terminal::note(&format!("warning: {}", warning.what));
        }
    }
    if let Some(archive) = &trained.archive {
        terminal::note(&format!(
            "the archive has {} of {} in {}: {:.1} s of processor time",
            counted(archive.cells, "cell"),
            counted(archive.failures, "failure"),
            counted(archive.simulations, "simulation"),
            trained.search_cpu_s,
        ));
    }
}

/// Evaluates the first members of a population, or a run as a population of one.
pub(super) fn eval(args: &EvalArgs, most: usize) -> Result<Exit, Failure> {
    let test = &args.test;
    refuse_world(&args.run, "eval --members")?;
    refuse_options(args)?;
    test.live.admit(test.common.json)?;
    let members = members(args, most)?;
    let ego = ego(args, &members)?;
    let live = args.open_live(ego.scenario())?;
    let bar = progress::bar(&test.common, "");
    let watch = bar.watch().shown_to(live.audience());
    let request = PopulationTest {
        members: &members,
        ego: &ego,
        starts: (test.starts, test.seed),
        search: test.search,
    };
    let Some(results) = request.run(&watch)? else {
        drop(bar);
        return interrupted_early(&test.common);
    };
    note_program_costs(std::slice::from_ref(&ego), &watch);
    drop(bar);
    // The search is a row, too, because the exit code and the verdict ask for any
    // failure.
    let rows = all_rows(&results);
    if test.common.json {
        print_json(&json!(results))?;
    } else {
        let mut answer = table::rows(&rows);
        let cells = text(&results);
        answer.table.push_str(&format!("\n{}", cells.join("\n")));
        let table = cell_table(&results, ego.scenario());
        answer.details.push_str(&format!("\n{table}"));
        test.live.data(&answer.text(test.answer))?;
    }
    Ok(exit_of(&rows, args.fail_on_counterexample))
}

/// Refuses options that `--members` does not use.
fn refuse_options(args: &EvalArgs) -> Result<(), Failure> {
    let test = &args.test;
    // An option without effect would suggest a result that it did not have.
    let given = [
        (!test.ado.is_empty(), "--ado"),
        (test.tries > 1, "--tries"),
        (test.temperature.is_some(), "--temperature"),
        (test.runs > 0, "--runs"),
        (test.keep.dir().is_some(), "--keep"),
        (args.theorems, "--theorems"),
    ];
    match given.iter().find(|(is_given, _)| *is_given) {
        Some((_, option)) => Err(Failure::input(
            format!("`{option}` does nothing with `--members`"),
            "leave it out, or evaluate a single member: `brakecheck eval RUN/members/000`",
        )),
        None => Ok(()),
    }
}

fn members(args: &EvalArgs, most: usize) -> Result<Vec<RunDir>, Failure> {
    let common = &args.test.common;
    if !PopulationDir::is_population(&args.run) {
        // A run is a population of one, so that both can be compared by their cells.
        return Ok(vec![open_run(&args.run, common)?]);
    }
    let mut members = PopulationDir::open(&args.run)?.members(most)?;
    // Consent is given per command, and a stored run has none.
    for member in &mut members {
        member.allow_programs(common.allow_programs);
        if common.fresh {
            member.begin_egos_anew();
        }
    }
    Ok(members)
}

/// Returns the single ego to test.
fn ego(args: &EvalArgs, members: &[RunDir]) -> Result<EgoUnderTest, Failure> {
    let test = &args.test;
    let first = members
        .first()
        .ok_or(crate::population::PopulationError::NoMember)?;
    let on_plant = placed(first.scenario()?, test.plant)?;
    let world = test.traffic.limited(on_plant)?;
    let mut egos = test.traffic.levels(args.ego.find(&world)?);
    if egos.len() != 1 {
        return Err(Failure::input(
            "`--members` tests one ego",
            "name one ego with `--ego`, and at most one `--natural`",
        ));
    }
    Ok(egos.swap_remove(0))
}

fn all_rows(results: &PopulationResults) -> Vec<Row> {
    let rows = results.members.iter().map(|member| member.row.clone());
    let search = results.search.iter().map(|search| search.row.clone());
    rows.chain(search).collect()
}

/// Returns the numbers of cells in sentences.
fn text(results: &PopulationResults) -> Vec<String> {
    let mut lines = Vec::new();
    for member in &results.members {
        lines.push(format!(
            "{}: {}, {} of them new, {:.0} per second of processor time",
            member.member,
            counted(member.cells, "cell"),
            member.new_cells,
            member.cells_per_cpu_s,
        ));
    }
    let union = &results.union;
    let interval = union.ci95.map_or("interrupted".to_owned(), |ci95| {
        let [lo, hi] = ci95.map(|share| 100.0 * share);
        format!("[{lo:.0}, {hi:.0}]")
    });
    let recall = union.recall.map(|recall| format!(", recall {recall:.2}"));
    lines.push(format!(
        "union: {} of {}, {:.0} % {interval}{}, {} in {}, {:.0} per \
         second of processor time",
        union.successes,
        counted(union.starts, "start"),
        100.0 * union.success_rate,
        recall.unwrap_or_default(),
        counted(union.cells, "cell"),
        counted(union.runs, "run"),
        union.cells_per_cpu_s,
    ));
    if let Some(search) = &results.search {
        lines.push(format!(
            "search: {}, {} of them in no member's",
            counted(search.cells.len(), "cell"),
            search.beyond_members,
        ));
    }
    let estimate = &results.estimate;
    let [lo, hi] = estimate.ci95;
    let coverage = estimate
        .coverage
        .map(|share| format!("; the next failure is in a known cell with probability {share:.2}"));
    lines.push(format!(
        "all cells: {:.0} [{lo:.0}, {hi:.0}] estimated, {} observed{}",
        estimate.all,
        estimate.observed,
        coverage.unwrap_or_default(),
    ));
    let new = &results.next.new_cells;
    let [lo, hi] = new.interval95;
    lines.push(format!(
        "next {}: {:.1} new cells expected [{lo:.0}, {hi:.0}]",
        counted(results.next.runs, "run"),
        new.expected,
    ));
    lines
}

/// Formats the cells in the words of their world.
fn cell_table(results: &PopulationResults, world: &Scenario) -> String {
    let listed = results.cells.iter().take(LISTED);
    let rows = listed.map(|count| [count.cell.in_words(world), count.failures.to_string()]);
    let table = TextTable::new(["cell", "starts"], rows)
        .numbers_from(1)
        .to_terminal(stdout_columns());
    let more = results.cells.len().saturating_sub(LISTED);
    if more > 0 {
        return format!("{table}\n`--json` has {}", counted(more, "further cell"));
    }
    table
}
