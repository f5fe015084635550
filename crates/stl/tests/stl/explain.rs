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

#[test]
fn parts_are_leaves_and_operands_and_every_explanation_goes_through_them() {
    let schema = run();
    let parts = |text: &str| {
        let formula: Formula = text.parse().unwrap();
        let constants = Constants::from([("d_safe".into(), 4.7)]);
        let monitor = formula.bind(schema.schema(), &constants).unwrap();
        let parts = monitor.parts();
        let leaf = monitor.explain(&schema).leaf().unwrap().formula.clone();
        assert!(
            parts.iter().any(|part| part.formula == leaf),
            "{leaf}: {parts:?}"
        );
        let listed = parts.into_iter().map(|part| (part.formula, part.within));
        listed.collect::<Vec<_>>()
    };
    let at = |text: &str, within| (text.to_owned(), within);
    assert_eq!(
        parts("always (headway >= d_safe)"),
        [at("headway >= d_safe", None)]
    );
    // An operand with a single leaf is no part of its own.
    assert_eq!(
        parts("always (headway > 1 and (eventually[0, 1] (headway > 2)) and not contact)"),
        [
            at("headway > 1", None),
            at("headway > 2", None),
            at("contact", None)
        ]
    );
    assert_eq!(
        parts("(always (headway > 1 or contact)) and (always (headway < 20))"),
        [
            at("always ((headway > 1) or contact)", None),
            at("headway > 1", Some(0)),
            at("contact", Some(0)),
            at("headway < 20", None),
        ]
    );
    // What occurs twice is one part.
    assert_eq!(
        parts("(headway > 1 or contact) implies (always (headway > 1))").len(),
        3
    );
}

#[test]
fn only_windows_inside_of_an_invariant_delay_its_violation() {
    let schema = run();
    let reach = |text: &str| {
        let formula: Formula = text.parse().unwrap();
        let monitor = formula.bind(schema.schema(), &Constants::new()).unwrap();
        monitor.inner_window_samples()
    };
    assert_eq!(reach("always[0, 9] (headway > 1)"), 0);
    assert_eq!(
        reach("always[0, 9] (contact implies eventually[0, 2] (headway > 1))"),
        4
    );
    assert_eq!(reach("(headway > 1) unless contact"), 0);
    assert_eq!(reach("eventually[0, 1] (headway > 1)"), 2);
}
