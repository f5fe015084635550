//! `brakecheck eval WORLD` in a world with points.

use std::path::Path;

use serde_json::json;

use super::answer::PrintedAnswer;
use super::common::{interrupted_early, print_json, table_of};
use super::display::stdout_columns;
use super::eval_args::EvalArgs;
use super::failure::{Exit, Failure};
use super::keep::note_kept;
use super::live::Live;
use super::terminal;
use super::test_args::note_program_costs;
use super::{progress, table};
use crate::evaluation::{PointOutcome, PointResult, PointsRequest, PointsTable, points};
use crate::experiment::{EgoUnderTest, consent_to};
use crate::report::TextTable;
use crate::run_dir::counted;
use crate::world::Scenario;

/// Points in the printed table. The details have all of them.
const SHOWN: usize = 8;

/// Legend of the columns.
const EXPLAINED: &str = "
passed         points at which the ego meets its specification
failed         points at which it does not; in m/s: the closing speed of its contact
no answer      points at which an ado breaks its rule first: neither passed nor failed
did not run    points at which the ego or the physics failed: neither passed nor failed
no result      every point of an ego that is not deterministic: `random`, `clock` or `kept_state`
varied         passed points at which a lawful variation makes the ego fail: an `!` at the point
preventable    of those, points at which a human model of UN R157 (CC_LATCHED or FSM) avoids it";

/// Plays every ego at every point, and prints, keeps and gates the results.
pub(super) fn run(args: &EvalArgs, world: &Scenario) -> Result<Exit, Failure> {
    let egos = args.ego.find(world)?;
    // Only the named egos play here, so the world's own ego needs no consent.
    consent_to(&egos)?;
    let live = args.open_live(world)?;
    let tables = played(args, &egos, &live);
    if tables.is_empty() {
        return interrupted_early(&args.test.common);
    }
    show(args, world, &tables)?;
    // Results are printed first, so a full disk does not cost them.
    if let Some(dir) = args.test.keep.dir() {
        keep(args, &tables, dir)?;
    }
    if terminal::stopped() {
        terminal::note("interrupted: the table covers the points that were finished");
        return Ok(Exit::Interrupted);
    }
    // An ego without a single answer has passed nothing, even if no point fails.
    check_answers(&tables)?;
    let fails = tables.iter().any(PointsTable::fails);
    Ok(if fails && args.fail_on_counterexample {
        Exit::Counterexample
    } else {
        Exit::Done
    })
}

/// Refuses the result of an ego if none of its points has an answer.
pub(super) fn check_answers(tables: &[PointsTable]) -> Result<(), Failure> {
    match tables.iter().find(|table| table.lacks_answers()) {
        Some(table) => Err(Failure::fault(
            format!(
                "no point has an answer for `{}`: an ado breaks its rule first at {} of {}",
                table.ego,
                table.no_answer,
                table.points.len()
            ),
            Some("correct the rules or the points of the world, and run it again".to_owned()),
        )),
        None => Ok(()),
    }
}

fn played(args: &EvalArgs, egos: &[EgoUnderTest], live: &Live) -> Vec<PointsTable> {
    let bar = progress::bar(&args.test.common, "");
    let watch = bar.watch().shown_to(live.audience());
    let mut tables = Vec::new();
    for ego in egos {
        watch.phase(&format!("points: {}", ego.name()));
        let request = PointsRequest {
            ego,
            starts: (args.test.starts, args.test.seed),
            switches: args.test.search,
        };
        tables.extend(points(&request, &watch));
        if watch.stopped() {
            break;
        }
    }
    note_program_costs(egos, &watch);
    tables
}

fn keep(args: &EvalArgs, tables: &[PointsTable], dir: &Path) -> Result<(), Failure> {
    let bar = progress::bar(&args.test.common, "");
    let mut kept = Vec::new();
    for table in tables {
        kept.extend(table.keep(dir, args.test.keep.settings_of_points(), &bar.watch())?);
    }
    drop(bar);
    note_kept(&kept, args.test.answer);
    Ok(())
}

fn show(args: &EvalArgs, world: &Scenario, tables: &[PointsTable]) -> Result<(), Failure> {
    if args.test.common.json {
        // Other verbs print one list for all egos, too.
        let rows: Vec<_> = tables.iter().flat_map(|table| &table.rows).collect();
        return print_json(&json!({ "rows": rows, "points": tables }));
    }
    let answer = answer(args, world, tables);
    args.test.live.data(&answer.text(args.test.answer))
}

fn answer(args: &EvalArgs, world: &Scenario, tables: &[PointsTable]) -> PrintedAnswer {
    // All egos play the same points, so the first table has their number.
    let points = tables.first().map_or(0, |table| table.points.len());
    let verdict = match tables {
        [table] => format!("`{}`: {}", table.ego, table.summary()),
        _ => {
            let failing = tables.iter().filter(|table| table.fails()).count();
            format!(
                "{failing} of {} egos fail at a point or a variation",
                tables.len()
            )
        }
    };
    let origin = format!(
        "{} on the {} plant, {}, each played by the ego under test",
        world.name(),
        world.plant(),
        counted(points, "point"),
    );
    let mut text = String::new();
    for table in tables {
        if let Some(switches) = table.switches {
            text.push_str(&format!(
                "\n`{}`: variations with at most {switches} switches of what is added to a plan; \
                 `--search {}` looks further",
                table.ego,
                switches + 1
            ));
        }
        text.push_str(&table::remarks(&table.rows));
    }
    // Many points would hide the table of the egos.
    let mut table = if points <= SHOWN {
        by_point(world, tables)
    } else {
        text = format!("{}{text}", by_point(world, tables));
        failing(world, tables)
    };
    table = [table, in_all(tables)].join("\n");
    table.extend(tables.iter().map(|table| table::warnings(&table.rows)));
    // Imported scenes have a placeholder as their ego, so a user should replace it.
    if tables.iter().all(|table| table.ego == "nominal") && world.judges_each_ego() {
        table.push_str(&format!(
            "\nThat was the world's own ego. Yours: `brakecheck eval {} -- COMMAND`, or `--ego \
             FILE.ron`",
            args.run.display()
        ));
    }
    PrintedAnswer {
        verdict: vec![verdict, origin],
        table,
        details: text,
        legend: EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    }
}

/// A line per point, a column per ego.
fn by_point(world: &Scenario, tables: &[PointsTable]) -> String {
    points_table(world, tables, |_| true, usize::MAX)
}

/// The first points at which an ego fails, also under a variation, or did not run.
fn failing(world: &Scenario, tables: &[PointsTable]) -> String {
    let is_shown = |nth: usize| {
        let mut all = tables.iter();
        // The mark of a failing variation makes a point worth showing, too.
        all.any(|table| outcome(table, &table.points[nth]) != "passed")
    };
    points_table(world, tables, is_shown, SHOWN)
}

fn points_table(
    world: &Scenario,
    tables: &[PointsTable],
    is_shown: impl Fn(usize) -> bool,
    most: usize,
) -> String {
    let axes = world.axes();
    let axis_names = axes.iter().map(|axis| match axis.unit {
        "" => axis.name.clone(),
        unit => format!("{}, {unit}", axis.name),
    });
    let egos = tables.iter().map(|table| table.ego.clone());
    let columns = std::iter::once("point".to_owned())
        .chain(axis_names)
        .chain(egos);
    // All egos play the same points, so the first table has all rows.
    let points = tables
        .first()
        .map(|table| table.points.as_slice())
        .unwrap_or_default()
        .iter()
        .enumerate()
        .filter(|(nth, _)| is_shown(*nth));
    let points: Vec<(usize, &PointResult)> = points.collect();
    let more = points.len().saturating_sub(most);
    let rows = points.into_iter().take(most).map(|(nth, point)| {
        let values = point.start.values().map(|value| format!("{:.3}", value));
        let outcomes = tables
            .iter()
            .map(move |table| outcome(table, &table.points[nth]));
        let cells = std::iter::once(point.point.to_string());
        cells.chain(values).chain(outcomes)
    });
    let rows: Vec<Vec<String>> = rows.map(Iterator::collect).collect();
    if rows.is_empty() {
        return String::new();
    }
    let table = TextTable::new(columns, rows).to_terminal(stdout_columns());
    match more {
        0 => table,
        more => format!("{table}\n{more} more such points: `--details` lists them"),
    }
}

/// Formats the outcome of a point in a few words.
fn outcome(table: &PointsTable, point: &PointResult) -> String {
    let failure = point.failure.as_ref();
    match point.outcome {
        PointOutcome::Passed => {
            // A protocol counts the point itself, so a failing variation is only a mark.
            if point.varied.as_ref().is_some_and(|it| it.fails) {
                "passed !".to_owned()
            } else {
                "passed".to_owned()
            }
        }
        PointOutcome::Failed => match failure.and_then(|failure| failure.closing_mps) {
            Some(closing_mps) => format!("failed, {closing_mps:.1} m/s"),
            None => "failed".to_owned(),
        },
        PointOutcome::NoAnswer => "no answer".to_owned(),
        PointOutcome::Invalid if table.voided_by().is_some() => "no result".to_owned(),
        PointOutcome::Invalid => "did not run".to_owned(),
        PointOutcome::NotReached => "–".to_owned(),
    }
}

/// A line per ego.
fn in_all(tables: &[PointsTable]) -> String {
    let lines = tables.iter().map(|table| {
        let points = table.points.len();
        let varied = table.points.iter().filter_map(|it| it.varied.as_ref());
        let preventable = varied.filter(|it| it.preventable == Some(true)).count();
        let of = |count: usize| format!("{count} of {points}");
        [
            table.ego.clone(),
            of(table.passed),
            of(table.failed),
            of(table.no_answer),
            match table.voided_by() {
                Some(fault) => format!("no result: {}", fault.kind.word()),
                None => of(table.invalid),
            },
            table.strayed.map_or("–".to_owned(), |count| {
                format!("{count} of {}", table.searched())
            }),
            table
                .strayed
                .map_or("–".to_owned(), |_| preventable.to_string()),
        ]
    });
    let header = [
        "ego",
        "passed",
        "failed",
        "no answer",
        "did not run",
        "varied",
        "preventable",
    ];
    table_of(header, lines)
}
