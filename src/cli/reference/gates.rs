//! Reasons that close a gate, and the effect of a start on it.

use strum::VariantArray;

use super::page::ReferenceTable;
use crate::evaluation::GateOn;

/// Effects of a start by its outcomes on both egos, in the order in which they are decided.
const STARTS: [[&str; 2]; 8] = [
    [
        "an ego or the physics did not run",
        "not compared, and counted",
    ],
    [
        "both egos fail without an adversary",
        "not compared, because it shows no difference",
    ],
    [
        "both fail",
        "fails on both, and may fail more or less severely",
    ],
    [
        "the new ego fails, the baseline does not",
        "newly failing. McNemar's p leaves it out if an ado broke its rule against the baseline",
    ],
    [
        "an ado breaks its rule against the new ego only",
        "no answer: neither failing nor fixed, and counted",
    ],
    [
        "the baseline fails, the new ego does not",
        "newly fixed, also if its violation does not satisfy `counts`",
    ],
    ["neither fails", "compared, without an effect"],
    [
        "the new ego fails with the ados' neutral action, the baseline does not",
        "newly failing without an adversary, which closes the gate, too",
    ],
];

/// Returns the tables of `--on` and of starts.
pub(super) fn tables() -> [ReferenceTable; 2] {
    // The list is the one that reads the option, so no reason can be missing.
    let reasons = GateOn::VARIANTS.iter().map(|on| {
        let name = format!("`{}`", <&str>::from(on));
        vec![name, closes_on(*on).to_owned()]
    });
    let starts = STARTS.map(|row| row.map(str::to_owned).to_vec());
    let reasons_about = "\
`gate --on` has reasons separated by commas, and any of them closes the gate. \
A crash is shown to be unavoidable only if reference drivers can judge it, and neither they \
nor full braking without delay avoid it.";
    let starts_about = "\
Each start is compared under the same ado. It counts in the first row that applies, and in the \
last row as well. \
A gate that stays open without an answer from any start has exit code 3.";
    [
        ReferenceTable::new("Reasons of `gate --on`", &["reason", "effect"], reasons)
            .with_about(reasons_about.to_owned()),
        ReferenceTable::new("Starts of a gate", &["start", "effect"], starts)
            .with_about(starts_about.to_owned()),
    ]
}

fn closes_on(on: GateOn) -> &'static str {
    match on {
        GateOn::UnlessUnavoidable => {
            "newly failing starts, unless the crash is shown to be unavoidable (default). If the \
             baseline fails from all starts, none can fail newly: the gate then closes if more \
             starts fail more severely than less severely or no longer"
        }
        GateOn::Preventable => "newly failing starts that CC_LATCHED or FSM would have avoided",
        GateOn::Any => "all newly failing starts",
        GateOn::Never => "no newly failing start",
        GateOn::Severity => {
            "in addition, starts that fail on both egos with Δv of the ego up by more than 20 %, \
             otherwise a warning. Alone it keeps the default, and `never,severity` is severity only"
        }
    }
}
