//! `brakecheck gate`: an ego against an earlier one, start by start.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::run_under_test::{RunUnderTest, Supplement, refuse_world, rows_of};
use super::test_args::{EgoArgs, TestArgs};
use super::{Exit, Failure, exit_of, interrupted_early, one_of, progress};
use crate::evaluation::{Gate, GateOn};
use crate::experiment::EgoUnderTest;
use crate::world::Scenario;

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
    /// Newly failing starts that fail the gate, with exit code 1.
    #[arg(long, value_parser = one_of::<GateOn>(), default_value = "preventable")]
    on: GateOn,
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
    let watch = tested.watch((&bar, &live), egos.len());
    let Some(evaluated) = tested.evaluate(&egos, true, &watch)? else {
        return interrupted_early(&args.test.common);
    };
    let gates = evaluated.gates(&args.baseline_ego, &watch.unnumbered())?;
    drop(bar);
    // An interruption before the baseline ego leaves nothing to compare.
    let result = (!gates.is_empty()).then(|| Supplement {
        key: "gates",
        value: json!(gates),
        text: gates.iter().map(in_words).collect::<Vec<_>>().join("\n\n"),
    });
    tested.show(&evaluated, result)?;
    tested.keep(&evaluated, egos.len())?;
    let exit = exit_of(&rows_of(evaluated)?, false);
    // An interruption takes precedence over a failed gate.
    let is_closed = gates.iter().any(|gate| gate.blocks(args.on));
    Ok(if exit == Exit::Done && is_closed {
        Exit::Counterexample
    } else {
        exit
    })
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
    egos.push(before.clone());
    Ok(egos)
}

fn in_words(gate: &Gate) -> String {
    let (ego, baseline) = (&gate.ego, &gate.baseline);
    let speeds = match (gate.closing_before_mps, gate.closing_after_mps) {
        (Some(before), Some(after)) => format!(
            "; closing there {:.1} / {:.1} m/s before, {:.1} / {:.1} m/s now (median / 90 %)",
            before.median, before.p90, after.median, after.p90
        ),
        _ => String::new(),
    };
    let preventable = gate.newly_failing.iter();
    let preventable = preventable.filter(|start| start.preventable == Some(true));
    format!(
        "`{ego}` against `{baseline}`, {} starts: {} newly failing ({} of them preventable), {} \
         newly fixed, {} fail on both{speeds}; exact McNemar p = {:.2e}",
        gate.compared,
        gate.newly_failing.len(),
        preventable.count(),
        gate.newly_fixed.len(),
        gate.both_fail,
        gate.p_value
    )
}
