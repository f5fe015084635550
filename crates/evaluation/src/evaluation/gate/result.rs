//! Gates as test cases, as a table and as a page.

use super::{DecidedGate, Flipped, GateOn};
use crate::preventability::Avoidability;
use crate::report::{
    ResultPage, ResultTable, TestCase, TestMessage, TestOutcome, TestSuite, TextTable,
};
use crate::stats::StartOutcome;

impl DecidedGate {
    /// Returns the decision in a sentence, with the names of both egos.
    pub fn verdict(&self) -> String {
        format!(
            "gate {}: `{}` against `{}`",
            self.decision(),
            self.gate.ego,
            self.gate.baseline
        )
    }

    /// Returns a suite with the gate itself as a case, and a case per start.
    ///
    /// A start that also fails on the baseline ego, or whose failure does not close the
    /// gate, is skipped, and so is a start without an answer.
    pub fn suite(&self, world: &str) -> TestSuite {
        let case = |name: String, outcome| TestCase {
            class: format!("gate.{world}.{}", self.gate.ego),
            name,
            time_s: None,
            requirement: None,
            outcome,
        };
        let starts = self.gate.outcomes.iter().enumerate();
        let starts = starts.map(|(start, outcome)| {
            case(
                format!("start {start:04}"),
                self.start_case(start, *outcome),
            )
        });
        // A gate may be closed by failures without an adversary, which have no case of a
        // start.
        let gate = case("gate".to_owned(), self.gate_case());
        TestSuite {
            name: "gate".to_owned(),
            time_s: None,
            cases: std::iter::once(gate).chain(starts).collect(),
        }
    }

    fn gate_case(&self) -> TestOutcome {
        let message = |kind| TestMessage {
            kind,
            message: format!("gate {}", self.decision()),
            words: self.lines().join("\n"),
        };
        if self.is_closed() {
            TestOutcome::Failed(message("gate"))
        } else if self.gate.is_unanswered() {
            // Neither a pass nor a skip, since CI would turn green without any evidence.
            TestOutcome::Error(message("no answer"))
        } else {
            TestOutcome::Passed
        }
    }

    fn start_case(&self, start: usize, outcome: StartOutcome) -> TestOutcome {
        let gate = &self.gate;
        let failed = |message: String| {
            TestOutcome::Failed(TestMessage {
                kind: "newly failing",
                message,
                words: String::new(),
            })
        };
        let skipped = |why: &str| TestOutcome::Skipped(why.to_owned());
        // Before the outcomes, which do not tell newly failing starts from
        // those that always fail.
        if let Some(flipped) = gate.newly_failing.iter().find(|it| it.start == start) {
            return if self.is_closed_by(flipped) {
                failed(format!("newly failing, {}", words_of(flipped.avoidability)))
            } else {
                skipped("newly failing, but not for a reason that closes this gate")
            };
        }
        let more_severe = gate.more_severe.iter().find(|it| it.start == start);
        match (outcome, more_severe) {
            (StartOutcome::Solved, Some(it)) if self.closed_by.contains(&GateOn::Severity) => {
                failed(format!(
                    "more severe: Δv {:.1} m/s before, {:.1} m/s now",
                    it.before_mps, it.now_mps
                ))
            }
            // Not each start has a result on the baseline ego then.
            (StartOutcome::Solved, _) if gate.not_run.baseline > 0 => {
                skipped("fails on the baseline ego, too, or that did not run")
            }
            (StartOutcome::Solved, _) => skipped("fails on the baseline ego, too"),
            (StartOutcome::Held | StartOutcome::Uncounted, _) => TestOutcome::Passed,
            (StartOutcome::RuleViolation, _) => skipped("no answer: an ado broke its rule first"),
            (StartOutcome::Trivial, _) => skipped("left out: fails without an adversary"),
            (StartOutcome::Unsolved | StartOutcome::NotReached, _) => skipped("not decided"),
            (StartOutcome::Invalid, _) => TestOutcome::Error(TestMessage {
                kind: "fault",
                message: "the ego or the physics failed to run".to_owned(),
                words: String::new(),
            }),
        }
    }

    fn is_closed_by(&self, flipped: &Flipped) -> bool {
        self.closed_by.iter().any(|on| match on {
            GateOn::UnlessUnavoidable => flipped.avoidability != Avoidability::Unavoidable,
            GateOn::Preventable => flipped.avoidability == Avoidability::Preventable,
            GateOn::Any => true,
            GateOn::Never | GateOn::Severity => false,
        })
    }
}

fn words_of(avoidability: Avoidability) -> &'static str {
    match avoidability {
        Avoidability::Preventable => "preventable",
        Avoidability::Avoidable => "avoided by other drivers only",
        Avoidability::Unavoidable => "unavoidable",
        Avoidability::Unknown => "unknown whether it is avoidable",
    }
}

/// Returns the decisions of gates in a sentence.
pub fn gates_verdict(gates: &[DecidedGate]) -> String {
    if let [gate] = gates {
        return gate.verdict();
    }
    let closed = gates.iter().filter(|gate| gate.is_closed());
    let names: Vec<String> = closed.map(|it| format!("`{}`", it.gate.ego)).collect();
    // A gate without an answer is neither open nor closed.
    let is_unanswered = |gate: &&DecidedGate| !gate.is_closed() && gate.gate.is_unanswered();
    let unanswered = gates.iter().filter(is_unanswered).count();
    if names.is_empty() && unanswered == 0 {
        return format!("all {} gates are open", gates.len());
    }
    let mut text = format!("{} of {} gates closed", names.len(), gates.len());
    if !names.is_empty() {
        text.push_str(&format!(": {}", names.join(", ")));
    }
    if unanswered > 0 {
        text.push_str(&format!(", {unanswered} without an answer"));
    }
    text
}

/// Returns a line per gate: its counts, the closing speeds where both fail, and p.
pub fn gate_table(gates: &[DecidedGate]) -> TextTable {
    let rows = gates.iter().map(|decided| {
        let gate = &decided.gate;
        let closing = match (gate.closing_before_mps, gate.closing_after_mps) {
            (Some(before), Some(after)) => format!("{:.1} → {:.1}", before.median, after.median),
            _ => "–".to_owned(),
        };
        [
            gate.ego.clone(),
            if decided.is_closed() {
                "closed"
            } else if gate.is_unanswered() {
                "no answer"
            } else {
                "open"
            }
            .to_owned(),
            gate.compared.to_string(),
            gate.newly_failing.len().to_string(),
            gate.newly_fixed.len().to_string(),
            gate.both_fail.to_string(),
            gate.more_severe.len().to_string(),
            closing,
            format!("{:.2e}", gate.p_value),
        ]
    });
    let columns = [
        "ego",
        "gate",
        "starts",
        "newly\nfailing",
        "newly\nfixed",
        "fail on\nboth",
        "more\nsevere",
        "closing there,\nm/s",
        "McNemar p",
    ];
    TextTable::new(columns, rows).numbers_from(2)
}

/// Returns the page of gates in a world.
pub fn gate_page(gates: &[DecidedGate], world: &str) -> ResultPage<'static> {
    let closed = gates.iter().filter(|gate| gate.is_closed()).count();
    // The page must not look good only because nothing could close the gate.
    let unanswered = gates.iter().any(|gate| gate.gate.is_unanswered());
    let flipped = gates.iter().flat_map(|decided| {
        let gate = &decided.gate;
        let one = |flipped: &Flipped, what: &str| {
            [
                gate.ego.clone(),
                flipped.start.to_string(),
                what.to_owned(),
                <&str>::from(&flipped.before).to_owned(),
                <&str>::from(&flipped.now).to_owned(),
                flipped
                    .closing_mps
                    .map_or("–".to_owned(), |speed| format!("{speed:.1}")),
            ]
        };
        let failing = gate.newly_failing.iter();
        let failing = failing
            .map(move |it| one(it, &format!("newly failing, {}", words_of(it.avoidability))));
        let fixed = gate
            .newly_fixed
            .iter()
            .map(move |it| one(it, "newly fixed"));
        let open = gate.no_answer.iter().map(move |it| one(it, "no answer"));
        failing.chain(fixed).chain(open).collect::<Vec<_>>()
    });
    let columns = ["ego", "start", "change", "before", "now", "closing, m/s"];
    let changes = TextTable::new(columns, flipped);
    ResultPage {
        kind: format!("gate, {world}"),
        verdict: gates_verdict(gates),
        is_bad: closed > 0 || unanswered,
        notes: gates.iter().flat_map(DecidedGate::lines).collect(),
        tables: vec![
            ResultTable {
                heading: "Comparison".to_owned(),
                table: gate_table(gates),
            },
            ResultTable {
                heading: "Starts with another outcome".to_owned(),
                table: changes,
            },
        ],
        ..ResultPage::default()
    }
}
