//! `brakecheck eval`: a frozen ado on test starts and egos, beside baselines.

use serde_json::json;

use super::common::{exit_of, interrupted_early};
use super::eval_args::EvalArgs;
use super::failure::{Exit, Failure};
use super::run_under_test::{RunUnderTest, Supplement, rows_of};
use super::{progress, theorems};
use crate::evaluation::{EvaluationTable, TheoremsChecked};
use crate::experiment::Watch;
use crate::theorems::admits_theorems;

pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    // All checks of the request come before the first simulation.
    let tested = RunUnderTest::open(&args.run, &args.test)?.leaving_out_each();
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
    // The theorems belong to no ego, so they are not counted as a step.
    let theorems = checked(args, &mut evaluated, &watch.unnumbered());
    drop(bar);
    // Rows are printed before files are written, so a full disk does not cost the rows.
    let result = theorems.as_ref().map(|theorems| Supplement {
        key: "theorems",
        value: json!(theorems),
        answer: theorems::answer(theorems),
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
