//! Every sample with its delay: the values of the offline monitor, in order.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Formula, Monitor, Settings, TraceEnd, Until};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

use super::naive::{doubtful, nested, rows, settings, trace, wff, zeros};

const ENDS: [TraceEnd; 3] = [TraceEnd::Truncate, TraceEnd::Hold, TraceEnd::Strict];

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Streams a trace, and checks the sample at which each value appears.
fn streamed(monitor: &Monitor, trace: &Trace) -> Vec<f64> {
    let mut stream = monitor.stream();
    let mut row = vec![0.0; trace.schema().len()];
    let mut all = Vec::new();
    for i in 0..trace.len() {
        trace.read_row(i, &mut row);
        let value = stream.push(&row).unwrap();
        let decides = monitor.horizon_samples().is_some_and(|delay| delay <= i);
        assert_eq!(value.is_some(), decides, "sample {i}");
        all.extend(value);
    }
    all.extend(stream.finish());
    assert_eq!(stream.len(), trace.len());
    assert!(stream.finish().is_empty());
    all
}

/// Formulas and traces with a fixed seed: a failure is the same failure everywhere.
#[test]
fn streamed_values_are_the_offline_values() {
    let cases = if cfg!(debug_assertions) { 500 } else { 5000 };
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
    let formula = prop_oneof![3 => wff(), 1 => doubtful(), 1 => nested()];
    let rows = prop_oneof![4 => rows(), 1 => zeros()];
    let reading = (any::<bool>(), prop::sample::select(ENDS.to_vec()));
    TestRunner::new_with_rng(config, rng)
        .run(&(formula, rows, reading), |(wff, rows, (closed, end))| {
            let until = if closed {
                Until::Closed
            } else {
                Until::HalfOpen
            };
            let monitor = wff.monitor(&settings(until, end));
            let trace = trace(&rows);
            let want = monitor.robustness_all(&trace);
            prop_assert_eq!(bits(&streamed(&monitor, &trace)), bits(&want));
            Ok(())
        })
        .unwrap();
}

fn line(values: impl Iterator<Item = f64>) -> Trace {
    let x = Signal::real("x", "", "a number");
    let mut trace = Trace::new(Schema::new(0.1, [x]).unwrap().into());
    values.for_each(|value| trace.push(&[value]).unwrap());
    trace
}

/// Long runs cross the point where old samples are dropped.
#[test]
fn long_streams_forget_what_no_longer_matters() {
    let texts = [
        "x > 50",
        "always[0, 7] eventually[0.3, 2.5] (x > 60)",
        "always (x < 90 implies eventually[0, 2] (x > 10))",
        "((x > 5) until[1, 9] (x > 97)) and always[0, 0.3] (x < 99)",
        "((x > 2) unless[0.5, 20] (x > 99)) or next (x > 3)",
        "(always[0, 3] (x > 1)) release[2, 6] (x < 95)",
        "once[1, 4] eventually[0, 5] (x > 97)",
        "once eventually[0, 5] (x > 99)",
        "((x > 1) since[2, 30] (x > 98)) iff eventually[0.1, 0.4] (x > 70)",
        "(eventually[0, 2] (x > 90)) since[0, 3] (always[0, 1] (x > 5))",
        "historically[3, end] rise (eventually[1, 2] (x > 90))",
    ];
    let trace = line((0..3000).map(|i| f64::from((i * 7919) % 101)));
    for text in texts {
        let formula: Formula = text.parse().unwrap();
        for end in ENDS {
            let settings = Settings {
                end,
                rho_max: Some(40.0),
                ..Settings::default()
            };
            let monitor = formula
                .bind_with(trace.schema(), &Default::default(), &settings)
                .unwrap();
            let want = monitor.robustness_all(&trace);
            assert_eq!(bits(&streamed(&monitor, &trace)), bits(&want), "{text}");
        }
    }
}

#[test]
fn an_invalid_row_changes_nothing_and_a_reset_forgets() {
    let trace = line(std::iter::empty());
    let formula: Formula = "once[0, 0.2] always[0, 0.1] (x >= 0)".parse().unwrap();
    let monitor = formula.bind(trace.schema(), &Constants::new()).unwrap();
    let mut stream = monitor.stream();
    assert!(stream.is_empty());
    assert_eq!(stream.push(&[9.0]), Ok(None));
    assert!(stream.push(&[f64::NAN]).is_err());
    assert!(stream.push(&[]).is_err());
    assert_eq!(stream.push(&[1.0]), Ok(Some(1.0)));
    stream.reset();
    assert_eq!(stream.push(&[2.0]), Ok(None));
    assert_eq!(stream.push(&[3.0]), Ok(Some(2.0)));
    assert_eq!((stream.finish(), stream.len()), (vec![3.0], 2));
    // After the end, rows are checked and ignored.
    assert!(stream.push(&[f64::INFINITY]).is_err());
    assert_eq!((stream.push(&[1.0]), stream.len()), (Ok(None), 2));
    assert!(monitor.stream().finish().is_empty());
}
