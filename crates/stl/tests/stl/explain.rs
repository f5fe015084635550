//! The leaf that decides.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Explanation, Formula, Reason, TraceEnd, Until};
use proptest::prelude::*;

use super::naive::{rows, settings, trace, wff};

/// Every step has the value, up to its sign, and a leaf is its reason.
pub fn ends_at_the_value(explanation: &Explanation) -> Result<(), TestCaseError> {
    let rho = explanation.robustness;
    for step in &explanation.path {
        prop_assert_eq!(step.value.abs(), rho.abs(), "{}", explanation);
    }
    if rho.is_finite() {
        prop_assert_eq!(explanation.reason, Reason::Leaf, "{}", explanation);
    }
    Ok(())
}

proptest! {
    #![proptest_config(super::cases(2000))]

    #[test]
    fn the_leaf_has_the_value(wff in wff(), rows in rows(), closed in any::<bool>(), end in 0..3usize) {
        let until = if closed { Until::Closed } else { Until::HalfOpen };
        let end = [TraceEnd::Truncate, TraceEnd::Hold, TraceEnd::Strict][end];
        let monitor = wff.monitor(&settings(until, end));
        let explanation = monitor.explain(&trace(&rows));
        ends_at_the_value(&explanation)?;
        prop_assert!(serde_json::to_string(&explanation).is_ok());
    }
}

fn run() -> Trace {
    let signals = [
        Signal::real("headway", "m", "front to front"),
        Signal::boolean("contact", "whether they touch"),
    ];
    let mut trace = Trace::new(Schema::new(0.5, signals).unwrap().into());
    for (headway, contact) in [(9.0, 0.0), (6.5, 0.0), (4.25, 0.0), (5.0, 1.0)] {
        trace.push(&[headway, contact]).unwrap();
    }
    trace
}

fn explain(text: &str) -> Explanation {
    let trace = run();
    let formula: Formula = text.parse().unwrap();
    formula
        .bind(trace.schema(), &Constants::from([("d_safe".into(), 4.7)]))
        .unwrap()
        .explain(&trace)
}

#[test]
fn as_text() {
    let texts = [
        "always (headway >= d_safe)",
        "not eventually[0, 1.5] (contact or headway < 2)",
        "always[0, 1] (1 <= headway <= 10 and headway > 4 and (headway < 12))",
        "eventually[5, 6] (headway > 4)",
        "(headway > 5) until contact",
        "rise contact or not true",
    ];
    let told: Vec<String> = texts
        .into_iter()
        .map(|text| explain(text).to_string())
        .collect();
    insta::assert_snapshot!(told.join("\n\n"));
}

#[test]
fn as_json() {
    let json = serde_json::to_string_pretty(&explain("always not contact")).unwrap();
    insta::assert_snapshot!(json);
}

#[test]
fn nothing_to_explain() {
    let trace = Trace::new(run().schema().clone());
    let formula: Formula = "headway > 1".parse().unwrap();
    let explanation = formula
        .bind(trace.schema(), &Constants::new())
        .unwrap()
        .explain(&trace);
    assert_eq!(
        (explanation.reason, explanation.leaf()),
        (Reason::EmptyTrace, None)
    );
    assert_eq!(explanation.to_string(), "ρ = -inf: the trace is empty");
}
