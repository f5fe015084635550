//! `brakecheck gate`: an ego against an earlier one, start by start.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::answer::PrintedAnswer;
use super::common::{exit_of, interrupted_early, one_of};
use super::display::stdout_columns;
use super::failure::{Exit, Failure};
use super::headings::OUTPUT;
use super::output_path::new_file;
use super::progress;
use super::run_under_test::{RunUnderTest, Supplement, refuse_world, rows_of};
use super::test_args::{EgoArgs, TestArgs};
use crate::evaluation::{DecidedGate, GateOn, gate_table, gates_verdict};
use crate::experiment::EgoUnderTest;
use crate::report::junit;
use crate::run_dir::write_output;
use crate::world::Scenario;

/// Legend of the columns of gates.
const EXPLAINED: &str = "
newly failing  starts from which the ego fails and the baseline ego does not, every rule kept
newly fixed    starts from which the baseline ego fails and the ego does not
more severe    starts that fail on both, with Δv of the ego up by more than 20 %
closing there  median closing speed of the contacts on starts that fail on both, before and now
McNemar p      exact two-sided p-value of the starts that fail on one of the two only";

#[derive(Args, Debug)]
pub(super) struct GateArgs {
    /// The run directory that `train` made.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    #[command(flatten)]
    ego: EgoArgs,
    /// The earlier ego, to compare with.
    #[arg(long, value_name = "NAME|FILE.ron")]
    baseline_ego: String,
    /// Reasons that fail the gate, with exit code 1, separated by commas.
    #[arg(
        long,
        value_name = "REASON",
        value_parser = one_of::<GateOn>(),
        value_delimiter = ',',
        default_value = "unless-unavoidable"
    )]
    on: Vec<GateOn>,
    /// Write the gate and every start as test cases of JUnit XML to this file, too.
    #[arg(long, value_name = "FILE.xml", value_parser = new_file(), help_heading = OUTPUT)]
    junit: Option<PathBuf>,
    #[command(flatten)]
    pub(super) test: TestArgs,
}

pub(super) fn run(args: &GateArgs) -> Result<Exit, Failure> {
    refuse_world(&args.run, "gate")?;
    args.test.traffic.one_rate("gate")?;
    let tested = RunUnderTest::open(&args.run, &args.test)?;
    let egos = egos(args, &tested.nominal)?;
    let live = tested.live()?;
    let bar = progress::bar(&args.test.common, "");
    let watch = tested.watch(&bar, &live, egos.len());
    let Some(evaluated) = tested.evaluate(&egos, true, &watch)? else {
        return interrupted_early(&args.test.common);
    };
    let gates = evaluated.gates(&args.baseline_ego, &watch.unnumbered())?;
    drop(bar);
    let gates: Vec<DecidedGate> = gates.into_iter().map(|it| it.decided(&args.on)).collect();
    // An interruption before the baseline ego leaves nothing to compare.
    let result = (!gates.is_empty()).then(|| Supplement {
        key: "gates",
        value: json!(gates),
        answer: answer(&gates),
    });
    tested.show(&evaluated, result)?;
    // CI reads this file, so it precedes the crashes, which take many runs to keep.
    if let Some(file) = &args.junit {
        let suites = gates.iter().map(|gate| gate.suite(tested.nominal.name()));
        let suites: Vec<_> = suites.collect();
        write_output(file, junit(&suites).as_bytes())?;
    }
    tested.keep(&evaluated, egos.len())?;
    // Rows without a start or of an interrupted run take precedence over an open gate.
    let exit = exit_of(&rows_of(evaluated)?, false);
    if exit != Exit::Done {
        return Ok(exit);
    }
    answered(&gates)?;
    Ok(if gates.iter().any(DecidedGate::is_closed) {
        Exit::Counterexample
    } else {
        Exit::Done
    })
}

/// Gates whose remarks are below the table. The details have all of them.
const REMARKED: usize = 2;

/// Returns the decision, with a line per ego.
fn answer(gates: &[DecidedGate]) -> PrintedAnswer {
    let remarks: Vec<String> = gates.iter().flat_map(DecidedGate::remarks).collect();
    let decisions: Vec<String> = gates.iter().map(ToString::to_string).collect();
    let mut table = gate_table(gates).to_terminal(stdout_columns());
    // The remarks of many gates would hide the table.
    if gates.len() <= REMARKED {
        table = [vec![table], remarks].concat().join("\n");
    }
    PrintedAnswer {
        verdict: vec![gates_verdict(gates)],
        table,
        details: decisions.join("\n\n"),
        legend: EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    }
}

/// Refuses a gate that compared nothing, so that CI never passes without an answer.
fn answered(gates: &[DecidedGate]) -> Result<(), Failure> {
    // A closed gate fails CI anyway, so only open ones need an answer.
    let mut open = gates.iter().filter(|gate| !gate.is_closed());
    match open.find(|gate| gate.gate.is_unanswered()) {
        Some(gate) => Err(Failure::fault(
            format!(
                "no start compares `{}` with `{}`: none has a result on both egos with every \
                 rule kept",
                gate.gate.ego, gate.gate.baseline
            ),
            Some("play more starts with `--starts`, or compare egos that run".to_owned()),
        )),
        None => Ok(()),
    }
}

/// Returns the egos under test, and the baseline ego below them.
fn egos(args: &GateArgs, nominal: &Scenario) -> Result<Vec<EgoUnderTest>, Failure> {
    let mut egos = args.ego.find(nominal)?;
    let requested = &args.baseline_ego;
    let before = EgoUnderTest::find(nominal, requested)?;
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
            format!("`{requested}` is compared with itself"),
            "name another ego with `--ego`",
        ));
    }
    // The baseline is last, so an interruption leaves rows of the egos under test.
    egos.push(before.clone());
    Ok(egos)
}
