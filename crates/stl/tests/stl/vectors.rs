//! Values on which two independent monitors agree.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Formula, Interval, Names, Scratch, Settings, TraceEnd, Until};
use serde_json::Value;

const AGREED: &str = include_str!("agreed.jsonl");
const HALF_OPEN: &str = include_str!("until_halfopen.jsonl");

struct Case {
    text: String,
    formula: Formula,
    trace: Trace,
    data: Value,
}

fn cases(text: &str) -> Vec<Case> {
    let all: Vec<Case> = text
        .lines()
        .map(|line| {
            let data: Value = serde_json::from_str(line).unwrap();
            let names = ["x", "y", "z"];
            let signals = names.map(|name| Signal::real(name, "", "a signal"));
            let schema = Schema::new(number(&data["dt"]), signals).unwrap();
            let mut trace = Trace::new(schema.into());
            for i in 0..data["n"].as_u64().unwrap() as usize {
                trace
                    .push(&names.map(|name| number(&data["trace"][name][i])))
                    .unwrap();
            }
            let text = data["formula"].as_str().unwrap().to_owned();
            let formula = text
                .parse()
                .unwrap_or_else(|e: brakecheck_stl::StlError| panic!("{}", e.render(&text)));
            Case {
                formula,
                text,
                trace,
                data,
            }
        })
        .collect();
    assert!(all.len() > 80);
    all
}

fn number(value: &Value) -> f64 {
    match value {
        Value::String(text) => text.parse().unwrap(),
        _ => value.as_f64().unwrap(),
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

#[track_caller]
fn close(got: f64, want: f64, text: &str) {
    let same = got == want || (got - want).abs() <= 1e-9 * want.abs().max(1.0);
    assert!(same, "{got} instead of {want}: {text}");
}

fn settings(until: Until, end: TraceEnd) -> Settings {
    Settings {
        until,
        end,
        ..Settings::default()
    }
}

#[test]
fn robustness_at_every_sample() {
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let monitor = case
            .formula
            .bind(case.trace.schema(), &Constants::new())
            .unwrap();
        let want = numbers(&case.data["rho"]);
        let got = monitor.robustness_all(&case.trace);
        assert_eq!(got.len(), want.len());
        for (got, want) in got.iter().zip(&want) {
            close(*got, *want, &case.text);
        }
        let first = monitor.robustness(&case.trace, &mut Scratch::new());
        assert_eq!(first, got[0], "{}", case.text);
        close(first, number(&case.data["rho0"]), &case.text);
    }
}

#[test]
fn closed_until() {
    for case in cases(HALF_OPEN) {
        let settings = settings(Until::Closed, TraceEnd::Truncate);
        let monitor = case
            .formula
            .bind_with(case.trace.schema(), &Names::default(), &settings)
            .unwrap();
        let want = numbers(&case.data["rho_closed"]);
        for (got, want) in monitor.robustness_all(&case.trace).iter().zip(&want) {
            close(*got, *want, &case.text);
        }
        let first = monitor.robustness(&case.trace, &mut Scratch::new());
        close(first, number(&case.data["rho0_closed"]), &case.text);
    }
}

#[test]
fn last_sample_held() {
    let mut seen = 0;
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let settings = settings(Until::HalfOpen, TraceEnd::Hold);
        let monitor = case
            .formula
            .bind_with(case.trace.schema(), &Names::default(), &settings)
            .unwrap();
        if let Some(want) = case.data.get("rho0_hold_last").filter(|v| !v.is_null()) {
            seen += 1;
            let got = monitor.robustness(&case.trace, &mut Scratch::new());
            close(got, number(want), &case.text);
        }
    }
    assert!(seen > 150);
}

#[test]
fn robust_satisfaction_interval() {
    let mut seen = 0;
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let monitor = case
            .formula
            .bind(case.trace.schema(), &Constants::new())
            .unwrap();
        if let Some(want) = case.data.get("rosi0").filter(|v| !v.is_null()) {
            seen += 1;
            let mut online = monitor.online();
            let mut row = [0.0; 3];
            for i in 0..case.trace.len() {
                case.trace.read_row(i, &mut row);
                online.push(&row).unwrap();
            }
            let offline = monitor.interval(&case.trace, &mut Scratch::new());
            assert_eq!(online.interval(), offline, "{}", case.text);
            let Interval { lo, hi } = offline;
            close(lo, number(&want[0]), &case.text);
            close(hi, number(&want[1]), &case.text);
        }
    }
    assert!(seen > 150);
}

#[test]
fn online_ends_with_the_offline_value() {
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let monitor = case
            .formula
            .bind(case.trace.schema(), &Constants::new())
            .unwrap();
        let want = monitor.robustness(&case.trace, &mut Scratch::new());
        let mut known = monitor.online_for(case.trace.len());
        let mut unknown = monitor.online();
        let mut row = [0.0; 3];
        for i in 0..case.trace.len() {
            case.trace.read_row(i, &mut row);
            let (a, b) = (known.push(&row).unwrap(), unknown.push(&row).unwrap());
            assert!(
                a.contains(want) && b.contains(want),
                "{a:?} {b:?} {want} after {i}: {}",
                case.text
            );
        }
        assert_eq!(
            known.interval(),
            Interval { lo: want, hi: want },
            "{}",
            case.text
        );
        assert_eq!(unknown.finish(), want, "{}", case.text);
    }
}

#[test]
fn canonical_texts_mean_the_same() {
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let text = case.formula.to_string();
        assert_eq!(
            text.parse::<Formula>().unwrap(),
            case.formula,
            "{} as {text}",
            case.text
        );
    }
}

#[test]
fn the_deciding_leaf_has_the_value() {
    for case in cases(AGREED).iter().chain(&cases(HALF_OPEN)) {
        let monitor = case
            .formula
            .bind(case.trace.schema(), &Constants::new())
            .unwrap();
        let explanation = monitor.explain(&case.trace);
        let rho = explanation.robustness;
        for step in &explanation.path {
            assert_eq!(step.value.abs(), rho.abs(), "{}\n{explanation}", case.text);
        }
        if rho.is_finite() {
            assert_eq!(
                explanation.reason,
                brakecheck_stl::Reason::Leaf,
                "{}",
                case.text
            );
            assert!(!explanation.signals.is_empty());
        }
    }
}
