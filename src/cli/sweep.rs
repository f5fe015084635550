//! `brakecheck sweep`: an ado against an ego over a range of a parameter.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::answer::PrintedAnswer;
use super::common::{exit_of, interrupted_early, table_of};
use super::failure::{Exit, Failure};
use super::output_path::new_svg;
use super::progress;
use super::run_under_test::{RunUnderTest, Supplement, refuse_world, rows_of};
use super::test_args::TestArgs;
use crate::evaluation::Sweep;
use crate::report::sweep_curve;
use crate::run_dir::{SweepPoint, Swept, write_output};
use crate::stats::{at_most, wilson};

/// Legend of a sweep's columns.
const EXPLAINED: &str = "
failing        starts on which the ego violates its specification with that value, every rule kept
95 % interval  of the share of such starts, in %, two-sided; in 40ths: the same share as a bar, rounded up";

#[derive(Args, Debug)]
pub(super) struct SweepArgs {
    /// The run directory that `train` made.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Parameter of the ego, its range, and the number of values [default: 7].
    #[arg(long, value_name = "ego.NAME=LO..HI[:N]")]
    over: String,
    /// Draw the share of failing starts over the range as SVG.
    #[arg(long, value_name = "FILE.svg", value_parser = new_svg())]
    curve: Option<PathBuf>,
    #[command(flatten)]
    pub(super) test: TestArgs,
}

pub(super) fn run(args: &SweepArgs) -> Result<Exit, Failure> {
    refuse_world(&args.run, "sweep")?;
    args.test.traffic.one_rate("sweep")?;
    let sweep = Sweep::parse(&args.over)?;
    let tested = RunUnderTest::open(&args.run, &args.test)?;
    let egos = sweep.egos(&tested.nominal)?;
    let live = tested.live()?;
    let bar = progress::bar(&args.test.common, "");
    let watch = tested.watch(&bar, &live, egos.len());
    // Values are compared by their rates, so no episode has to stay in memory.
    let Some(evaluated) = tested.evaluate(&egos, false, &watch)? else {
        return interrupted_early(&args.test.common);
    };
    drop(bar);
    let swept = sweep.swept(&evaluated.egos);
    // Rows are printed before files are written, so a full disk does not cost the rows.
    let result = Supplement {
        key: "swept",
        value: json!(swept),
        answer: answer(&swept),
    };
    tested.show(&evaluated, Some(result))?;
    if let Some(file) = &args.curve {
        let curve = sweep_curve(&swept, &safety(&swept));
        write_output(file, curve.as_bytes())?;
    }
    tested.keep(&evaluated, egos.len())?;
    // A sweep measures where an ego begins to fail, so a failure is no error of it.
    Ok(exit_of(&rows_of(evaluated)?, false))
}

fn answer(swept: &Swept) -> PrintedAnswer {
    let parameter = &swept.parameter;
    let lines = swept.points.iter().map(|point| {
        let SweepPoint {
            value,
            starts,
            failing,
            partial,
        } = *point;
        if let Some(partial) = partial {
            return [
                format!("{value}"),
                format!("at least {failing} of {}", partial.of),
                "–".to_owned(),
                format!("interrupted: {} decided", partial.decided),
            ];
        }
        // Starts are independent here, so a binomial interval applies.
        let [lo, hi] = wilson(failing, starts).map(|share| 100.0 * share);
        [
            format!("{value}"),
            format!("{failing} of {starts}"),
            format!("{lo:.1} – {hi:.1}"),
            // Rounded up, so that a single failure is visible.
            "#".repeat((40.0 * failing as f64 / starts.max(1) as f64).ceil() as usize),
        ]
    });
    let header = [parameter.as_str(), "failing", "95 % interval", "in 40ths"];
    PrintedAnswer {
        verdict: vec![safety(swept)],
        table: table_of(header, lines),
        legend: EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    }
}

/// From where on, or up to where, no start fails.
fn safety(swept: &Swept) -> String {
    let parameter = &swept.parameter;
    // A value without any result is not among the safe ones.
    let whole = |it: &&SweepPoint| it.partial.is_none() && it.starts > 0;
    let starts = swept.points.iter().filter(whole).map(|it| it.starts);
    // The value with the fewest starts has the weakest bound.
    let bound = 100.0 * at_most(starts.min().unwrap_or(0));
    let safe = match (swept.safe_from, swept.safe_up_to) {
        // The safe parts of both ends meet, so no value of the sweep fails.
        (Some(least), Some(most)) if least <= most => "no value fails".to_owned(),
        (Some(from), _) => format!("no failure from {parameter} = {from} on"),
        (None, Some(to)) => format!("no failure up to {parameter} = {to}"),
        // Safe values in the middle only are no useful bound.
        (None, None) => return no_safe_end(swept),
    };
    format!(
        "{safe}: at each such value at most {bound:.1} % (one-sided 95 % bound), for these ados and starts"
    )
}

/// Tells a range whose ends fail from one whose ends have no result.
fn no_safe_end(swept: &Swept) -> String {
    let ends = [swept.points.first(), swept.points.last()];
    // An end with all results and no failure would be safe.
    match ends.into_iter().flatten().find(|point| point.failing == 0) {
        Some(open) => format!(
            "no end of the range is known to be safe: {} = {} lacks results",
            swept.parameter, open.value
        ),
        None => "starts fail at both ends of the range".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_without_a_result_is_not_said_to_fail() {
        let said = |counts: [[usize; 2]; 2]| {
            let points = counts.into_iter().enumerate();
            let points = points.map(|(at, [failing, starts])| SweepPoint {
                value: at as f64,
                starts,
                failing,
                partial: None,
            });
            safety(&Swept::of("gap_m", points.collect()))
        };
        assert_eq!(
            said([[3, 9], [1, 9]]),
            "starts fail at both ends of the range"
        );
        assert_eq!(
            said([[3, 9], [0, 0]]),
            "no end of the range is known to be safe: gap_m = 1 lacks results"
        );
        assert!(said([[3, 9], [0, 9]]).starts_with("no failure from gap_m = 1 on"));
    }
}
