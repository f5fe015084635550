//! One sample of a driven episode, as the page gets it.

use serde::Serialize;

use super::input::DriveInput;
use crate::experiment::ShownFrame;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// One sample: poses, lights, margins and signals.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveFrame {
    /// Position, time, poses, phases and speeds, as pictures and recordings draw them.
    #[serde(flatten)]
    pub shown: ShownFrame,
    /// ρ(ψ_ego) of the samples so far. `None` if it is infinite.
    pub spec: Option<f64>,
    /// Robustness of every rule on the samples so far.
    pub rules: Vec<Option<f64>>,
    /// Value of every signal.
    pub signals: Vec<f64>,
    /// Input that led here. `None` at 0 s.
    pub input: Option<DriveInput>,
    /// Joint action of the ados in words. `None` before the first decision.
    pub action: Option<String>,
    /// Value of the trained ado, V(s).
    pub value: Option<f32>,
    /// Value of every joint action, where the trained ado has them.
    pub values: Vec<f32>,
    /// Verdict, once it is final.
    pub outcome: Option<DriveOutcome>,
}

/// Verdict of an episode, in the words of every verb.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveOutcome {
    /// `counterexample`, `held`, `foul`, `uncounted` or `invalid`.
    pub verdict: &'static str,
    /// Outcome in a few words.
    pub words: String,
    /// Time of the verdict.
    pub time_s: f64,
    /// Broken rules, as positions in the rulebook.
    pub broken: Vec<usize>,
    /// True if it can be kept.
    pub keeps: bool,
}

/// JSON has no infinities.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl DriveFrame {
    /// Returns the frame of a bench's current sample, without what the player knows.
    pub(super) fn of(
        bench: &Testbench,
        world: &Scenario,
        input: Option<DriveInput>,
        action: Option<usize>,
    ) -> DriveFrame {
        let trace = bench.trace();
        let margins = bench.margins();
        let last = trace.len().saturating_sub(1);
        let mut signals = vec![0.0; trace.schema().len()];
        trace.read_row(last, &mut signals);
        DriveFrame {
            shown: ShownFrame {
                sample: last,
                ..ShownFrame::now(bench)
            },
            spec: finite(margins.spec),
            rules: margins.rules.into_iter().map(finite).collect(),
            signals,
            input,
            action: action.map(|action| world.action_label(action)),
            value: None,
            values: Vec::new(),
            outcome: None,
        }
    }
}
