//! Output of `eval` on compared egos: the gate, and a sweep.

use std::path::Path;

use serde_json::{Value, json};

use super::{Failure, table_of, talk};
use crate::evaluation::{EvaluationTable, Gate, GateOn, Sweep, SweepPoint, Swept};
use crate::experiment::Watch;
use crate::report::sweep_curve;
use crate::run_dir::write_file;
use crate::stats::{at_most, wilson};

/// Legend of a sweep's columns.
const EXPLAINED: &str = "
failing        starts from which some ado makes the ego fail with that value, every rule kept
95 % interval  of the share of such starts, in %; in 40ths: the same share as a bar, rounded up";

/// Egos compared with each other.
#[derive(Default)]
pub(super) struct GateAndSweep {
    gates: Vec<Gate>,
    swept: Option<Swept>,
}

impl GateAndSweep {
    /// Compares egos with a baseline ego, and draws the curve of a sweep.
    pub(super) fn of(
        (baseline, curve_file): (Option<&str>, Option<&Path>),
        sweep: Option<&Sweep>,
        evaluated: &EvaluationTable<'_>,
        watch: &Watch<'_>,
    ) -> Result<GateAndSweep, Failure> {
        let swept = sweep.map(|sweep| sweep.swept(&evaluated.egos));
        if let (Some(file), Some(swept)) = (curve_file, &swept) {
            write_file(file, curve(swept).as_bytes())?;
        }
        Ok(GateAndSweep {
            gates: match baseline {
                Some(baseline) => evaluated.gates(baseline, watch)?,
                None => Vec::new(),
            },
            swept,
        })
    }

    pub(super) fn add_to(&self, object: &mut Value) {
        if !self.gates.is_empty() {
            object["gates"] = json!(self.gates);
        }
        if let Some(swept) = &self.swept {
            object["swept"] = json!(swept);
        }
    }

    pub(super) fn show(&self) -> Result<(), Failure> {
        for gate in &self.gates {
            talk::data(&format!("\n{}", in_words(gate)))?;
        }
        match &self.swept {
            Some(swept) => talk::data(&format!("\n{}", of_sweep(swept))),
            None => Ok(()),
        }
    }

    /// Returns whether the gate fails because of newly failing starts.
    pub(super) fn is_held_up(&self, on: GateOn) -> bool {
        self.gates.iter().any(|gate| gate.blocks(on))
    }
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

fn curve(swept: &Swept) -> String {
    let points = swept.points.iter().map(|point| {
        let share = point.failing as f64 / point.starts.max(1) as f64;
        (point.value, share, wilson(point.failing, point.starts))
    });
    sweep_curve(
        &swept.parameter,
        &points.collect::<Vec<_>>(),
        &safety(swept),
    )
}

fn of_sweep(swept: &Swept) -> String {
    let parameter = &swept.parameter;
    let lines = swept.points.iter().map(|point| {
        let SweepPoint {
            value,
            starts,
            failing,
        } = *point;
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
    let table = table_of(header, lines);
    format!("{table}{EXPLAINED}\n{}", safety(swept))
}

/// From where on, or up to where, no start fails.
fn safety(swept: &Swept) -> String {
    let parameter = &swept.parameter;
    let starts = swept.points.iter().map(|point| point.starts);
    // The value with the fewest starts has the weakest bound.
    let bound = 100.0 * at_most(starts.min().unwrap_or(0));
    let safe = match (swept.safe_from, swept.safe_up_to) {
        (Some(least), Some(most)) if least <= most => "no value fails".to_owned(),
        (Some(from), _) => format!("no failure from {parameter} = {from} on"),
        (None, Some(to)) => format!("no failure up to {parameter} = {to}"),
        // Safe values in the middle only are no useful bound.
        (None, None) => return "starts fail at both ends of the range".to_owned(),
    };
    format!("{safe}: at each such value at most {bound:.1} % at 95 %, for these ados and starts")
}
