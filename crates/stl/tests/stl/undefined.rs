//! What is not a number never makes a verdict weaker.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{
    Constants, Expr, Formula, Interval, Monitor, Reason, Scratch, TraceEnd, Until,
};
use proptest::prelude::*;

use super::explain::ends_at_the_value;
use super::naive::{Lengths, doubtful, naive, naive_held, rows, settings, trace, zeros};

fn reading() -> impl Strategy<Value = (Until, TraceEnd)> {
    let until = prop_oneof![Just(Until::HalfOpen), Just(Until::Closed)];
    let end = [TraceEnd::Truncate, TraceEnd::Hold, TraceEnd::Strict];
    (until, prop::sample::select(end.to_vec()))
}

proptest! {
    #![proptest_config(super::cases(2000))]

    /// A comparison without a value could have any: ρ is what is certain.
    #[test]
    fn what_cannot_be_computed_counts_for_the_worst(
        wff in doubtful(),
        rows in prop_oneof![rows(), zeros()],
        (until, end) in reading(),
    ) {
        let monitor = wff.monitor(&settings(until, end));
        let (trace, mut scratch) = (trace(&rows), Scratch::new());
        let rho = monitor.robustness(&trace, &mut scratch);
        let closed = until == Until::Closed;
        let n = rows.len();
        let bounded = if end == TraceEnd::Strict { usize::MAX } else { n };
        let want = match end {
            TraceEnd::Hold => naive_held(&wff, &rows, closed),
            _ => naive(&wff, &rows, Lengths { bounded, unbounded: n, closed })[0].0,
        };
        prop_assert_eq!(rho, want);
        let truth = monitor.satisfied(&trace, &mut scratch);
        prop_assert!(rho == 0.0 || (0.0 < rho) == truth, "{rho} {truth}");
    }

    #[test]
    fn what_cannot_be_computed_is_the_same_online(
        wff in doubtful(),
        rows in prop_oneof![rows(), zeros()],
        (until, end) in reading(),
    ) {
        let monitor = wff.monitor(&settings(until, end));
        let mut scratch = Scratch::new();
        let value = monitor.robustness(&trace(&rows), &mut scratch);
        let (mut unknown, mut known) = (monitor.online(), monitor.online_for(rows.len()));
        for i in 0..rows.len() {
            let loose = unknown.push(&rows[i]).unwrap();
            let tight = known.push(&rows[i]).unwrap();
            prop_assert_eq!(loose, monitor.interval(&trace(&rows[..=i]), &mut scratch));
            prop_assert!(loose.contains(value) && tight.contains(value));
        }
        prop_assert_eq!(known.interval().lo, value);
        prop_assert_eq!(unknown.finish(), value);
    }

    /// Neither a formula nor its negation holds by a comparison without value.
    #[test]
    fn negation_gains_nothing(wff in doubtful(), rows in zeros()) {
        let (trace, mut scratch) = (trace(&rows), Scratch::new());
        let text = wff.text();
        let rho = |text: &str, scratch: &mut Scratch| bind(text, &trace).robustness(&trace, scratch);
        let (plain, negated) = (rho(&text, &mut scratch), rho(&format!("not ({text})"), &mut scratch));
        prop_assert!(plain <= -negated, "{plain} {negated}");
        prop_assert_eq!(rho(&format!("not not ({text})"), &mut scratch), plain);
    }

    #[test]
    fn explanations_end_where_the_value_is(wff in doubtful(), rows in zeros(), (until, end) in reading()) {
        let monitor = wff.monitor(&settings(until, end));
        ends_at_the_value(&monitor.explain(&trace(&rows)))?;
    }
}

fn line(values: &[f64]) -> Trace {
    let schema = Schema::new(1.0, [Signal::real("x", "", "a number")]).unwrap();
    let mut trace = Trace::new(schema.into());
    values
        .iter()
        .for_each(|value| trace.push(&[*value]).unwrap());
    trace
}

fn bind(text: &str, trace: &Trace) -> Monitor {
    let formula: Formula = text.parse().unwrap();
    formula.bind(trace.schema(), &Constants::new()).unwrap()
}

/// Every way to get no number out of finite signals, and every place for it.
#[test]
fn no_operator_turns_it_into_a_yes() {
    let trace = line(&[0.0, 0.0, 0.0]);
    let mut scratch = Scratch::new();
    let values = [
        "x / x",
        "sqrt(x - 1)",
        "pow(x - 1, 0.5)",
        "exp(999 + x) - exp(999 + x)",
        "x * exp(999 + x)",
        "-(x / x)",
        "abs(x / x)",
        "x / x + 1",
        "exp(x / x)",
        "min(x / x, 10)",
        "min(10, x / x)",
        "min(1, 2, x / x, 3)",
        "max(x / x, 10)",
        "max(10, x / x)",
        "pow(x / x, 0)",
        "pow(1, x / x)",
        "sqrt(x / x)",
    ];
    let formulas = [
        "{} > 1",
        "{} >= 1",
        "{} < 1",
        "{} <= 1",
        "{} == 1",
        "{} != 1",
        "{} in [0, 9]",
        "0 < {} < 9",
        "not ({} > 1)",
        "not ({} == 1)",
        "not not ({} > 1)",
        "({} > 1) and x >= 0",
        "({} > 1) or x > 0",
        "({} > 1) implies x > 0",
        "x >= 0 implies ({} > 1)",
        "({} > 1) iff x >= 0",
        "({} > 1) iff x > 0",
        "({} > 1) xor x >= 0",
        "({} > 1) xor x > 0",
        "({0} > 1) iff ({0} > 1)",
        "always ({} > 1)",
        "not eventually ({} > 1)",
        "eventually not ({} > 1)",
        "next ({} > 1)",
        "next rise ({} > 1)",
        "next fall ({} > 1)",
        "next not rise (not ({} > 1))",
        "x > 0 until ({} > 1)",
        "({} > 1) until x > 0",
        "({} > 1) release x > 0",
        "not (({} > 1) unless x > 0)",
        "not (({} > 1) since x >= 0)",
    ];
    for value in values {
        for formula in formulas {
            let text = formula.replace("{}", value).replace("{0}", value);
            let monitor = bind(&text, &trace);
            let rho = monitor.robustness(&trace, &mut scratch);
            assert!(rho <= 0.0, "{text}: {rho}");
            assert!(!monitor.satisfied(&trace, &mut scratch), "{text}");
            let mut online = monitor.online_for(trace.len());
            let mut interval = online.interval();
            for x in trace.column(0) {
                interval = online.push(&[*x]).unwrap();
            }
            assert_eq!(interval.hi, rho, "{text}");
        }
    }
    // What does not depend on it stays as it is.
    for text in [
        "x / x > 1 or x >= 0",
        "x > 0 implies x / x > 1",
        "true or x / x > 1",
    ] {
        assert!(bind(text, &trace).satisfied(&trace, &mut scratch), "{text}");
    }
}

/// The table in the documentation, row by row.
#[test]
fn every_row_of_the_documentation() {
    let signals = ["d", "v"].map(|name| Signal::real(name, "", "a number"));
    let mut trace = Trace::new(Schema::new(1.0, signals).unwrap().into());
    trace.push(&[0.0, 0.0]).unwrap();
    let rows: Vec<&str> = include_str!("../../docs/stl.md")
        .lines()
        .skip_while(|row| !row.starts_with("| at d = v = 0"))
        .skip(2)
        .take_while(|row| row.starts_with('|'))
        .collect();
    for row in &rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let (text, want) = (cells[1].trim_matches('`'), cells[2].replace('−', "-"));
        let got = bind(text, &trace).robustness(&trace, &mut Scratch::new());
        assert_eq!(got, want.parse::<f64>().unwrap(), "{text}");
    }
    assert_eq!(rows.len(), 6);
}

#[test]
fn an_expression_that_is_no_number_stays_none() {
    let trace = line(&[0.0]);
    for text in [
        "min(x / x, 10)",
        "min(10, x / x)",
        "max(1, x / x, 3)",
        "pow(x / x, x)",
    ] {
        let expr: Expr = text.parse().unwrap();
        let bound = expr.bind(trace.schema(), &Constants::new()).unwrap();
        assert!(bound.eval(&[0.0]).is_nan(), "{text}");
        // Where there are numbers, the smallest, the largest and the power.
        assert_eq!(
            bound.eval(&[2.0]),
            if text.starts_with("max") { 3.0 } else { 1.0 },
            "{text}"
        );
    }
}

#[test]
fn the_reason_is_named() {
    let trace = line(&[1.0, 0.0]);
    let told: Vec<String> = [
        "always (x / x > 0.5)",
        "always not (min(x / x, 2) > 1)",
        "next fall (x / x > 0.5)",
        "always (x / x > 0.5 xor true)",
    ]
    .map(|text| {
        let explanation = bind(text, &trace).explain(&trace);
        assert_eq!(explanation.reason, Reason::Undefined, "{text}");
        explanation.to_string()
    })
    .into();
    insta::assert_snapshot!(told.join("\n\n"));
    let json = serde_json::to_value(bind("x / x > 2", &line(&[0.0])).explain(&line(&[0.0])));
    assert_eq!(json.unwrap()["reason"], "undefined");
}

/// A range has the value of what is undefined in it, on either side of a not.
#[test]
fn ranges_know_what_can_be_undefined() {
    let signals = ["x", "y"].map(|name| Signal::real(name, "", "a number"));
    let mut trace = Trace::new(Schema::new(1.0, signals).unwrap().into());
    trace.push(&[0.0, 2000.0]).unwrap();
    let ranges = [(-1.0, 1.0), (0.0, 2000.0)].map(|(lo, hi)| Interval { lo, hi });
    let values = [
        "exp(y) - exp(y)",
        "exp(y) + -exp(y)",
        "x * exp(y)",
        "exp(y) * x",
        "exp(y) / exp(y)",
        "x / x",
        "sqrt(x - 0.5)",
        "pow(x, 0.5 - y)",
    ];
    for value in values {
        for text in [
            format!("max({value}, 3) > 1"),
            format!("not (min({value}, 3) > 5)"),
            format!("x < 9 xor min({value}, 3) > 5"),
        ] {
            let monitor = bind(&text, &trace);
            let rho = monitor.robustness(&trace, &mut Scratch::new());
            assert!(monitor.range(&ranges).contains(rho), "{text}: {rho}");
        }
    }
    // Signals are finite, however large: a difference of two is a number.
    let range = bind("x + y - 1 != 9", &trace).range(&[Interval::ANY; 2]);
    assert_eq!((range.lo, range.hi), (0.0, f64::INFINITY));
}

/// What is bound both ways stays as small as it was, however deep.
#[test]
fn nesting_does_not_multiply() {
    let trace = line(&[0.0, 1.0, 0.0, 2.0, 0.0]);
    let nested = |n: usize, wrap: fn(String) -> String| {
        (0..n).fold("x / x > 0.5".to_owned(), |text, _| wrap(text))
    };
    let texts = [
        nested(60, |text| format!("rise ({text})")),
        nested(60, |text| format!("({text}) iff x > 1")),
        nested(40, |text| format!("x > 1 xor fall ({text})")),
        nested(60, |text| format!("({text}) iff always (x > 1)")),
        nested(40, |text| format!("(eventually[0, 1] ({text})) iff x > 1")),
        nested(40, |text| format!("(always ({text})) xor x > 1")),
    ];
    for text in texts {
        let monitor = bind(&text, &trace);
        let rho = monitor.robustness(&trace, &mut Scratch::new());
        assert_eq!(monitor.explain(&trace).robustness, rho);
        let mut online = monitor.online();
        for x in trace.column(0) {
            online.push(&[*x]).unwrap();
        }
        assert_eq!(online.finish(), rho);
    }
}
