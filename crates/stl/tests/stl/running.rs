//! Compiled formulas against the general monitor: the same bits, run by run and side by side.

use brakecheck_stl::{Interval, RunColumns, RunningMonitor, Scratch, TraceEnd, Until};
use proptest::prelude::*;

use super::naive::{Range, Wff, doubtful, rows, settings, trace, wff, zeros};

/// Logic over windows and untils of comparisons and of unbounded past: what is compiled.
fn top() -> impl Strategy<Value = Wff> {
    let select = |names: &[&'static str]| prop::sample::select(names.to_vec());
    let range = || {
        prop_oneof![
            3 => Just(Range { from: 0, to: None }),
            1 => (0..4usize).prop_map(|from| Range { from, to: None }),
            2 => (0..4usize, 0..50usize).prop_map(|(from, w)| Range { from, to: Some(from + w) }),
        ]
    };
    let op = select(&["<", "<=", ">", ">=", "==", "!="]);
    let leaf = prop_oneof![
        1 => Just(Wff::True),
        2 => Just(Wff::On),
        4 => (op.clone(), -3..4i32).prop_map(|(op, c)| Wff::X(op, c)),
        2 => (op.clone(), -3..4i32).prop_map(|(op, c)| Wff::Both(op, c)),
        1 => (op.clone(), -3..4i32).prop_map(|(op, c)| Wff::Ratio(op, c)),
        2 => op.prop_map(Wff::Signals),
    ];
    let whole = Range { from: 0, to: None };
    let gates = ["and", "or", "implies", "iff", "xor"];
    let present = leaf.prop_recursive(3, 8, 2, move |inner| {
        let boxed = inner.prop_map(Box::new);
        prop_oneof![
            1 => boxed.clone().prop_map(Wff::Not),
            2 => (select(&gates), boxed.clone(), boxed.clone())
                .prop_map(|(op, a, b)| Wff::Gate(op, a, b)),
            1 => (select(&["historically", "once"]), boxed.clone())
                .prop_map(move |(op, a)| Wff::Window(op, whole, a)),
            1 => (select(&["rise", "fall"]), boxed.clone()).prop_map(|(op, a)| Wff::Step(op, a)),
            1 => (boxed.clone(), boxed).prop_map(move |(a, b)| Wff::Pair("since", whole, a, b)),
        ]
    });
    let present = present.prop_map(Box::new).boxed();
    let first = prop_oneof![
        1 => present.clone().prop_map(|it| *it),
        4 => (select(&["always", "eventually"]), range(), present.clone())
            .prop_map(|(op, range, a)| Wff::Window(op, range, a)),
        3 => (select(&["until", "unless", "release"]), range(), present.clone(), present)
            .prop_map(|(op, range, a, b)| Wff::Pair(op, range, a, b)),
    ];
    first.prop_recursive(2, 4, 2, move |inner| {
        let boxed = inner.prop_map(Box::new);
        prop_oneof![
            1 => boxed.clone().prop_map(Wff::Not),
            3 => (select(&gates), boxed.clone(), boxed).prop_map(|(op, a, b)| Wff::Gate(op, a, b)),
        ]
    })
}

fn bits(interval: Interval) -> [u64; 2] {
    [interval.lo.to_bits(), interval.hi.to_bits()]
}

proptest! {
    #![proptest_config(super::cases(4000))]

    #[test]
    fn a_compiled_formula_has_the_bits_of_the_general_monitor(
        wff in prop_oneof![3 => top(), 1 => wff(), 1 => doubtful()],
        rows in prop_oneof![rows(), zeros()],
        closed in any::<bool>(),
    ) {
        let until = if closed { Until::Closed } else { Until::HalfOpen };
        let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
        let Some(running) = monitor.running(rows.len()) else {
            return Ok(());
        };
        let mut general = monitor.online_for(rows.len());
        let mut numbers = vec![0.0; running.numbers()];
        running.begin(&mut numbers);
        let mut scratch = Scratch::new();
        for (i, row) in rows.iter().enumerate() {
            let want = general.push(row).unwrap();
            let found = running.push(&mut numbers, i, row);
            prop_assert_eq!(bits(found), bits(want), "{:?} {:?} after {}", found, want, i);
            prop_assert_eq!(bits(running.interval(&numbers, i + 1)), bits(want));
            let want = monitor.robustness(&trace(&rows[..=i]), &mut scratch);
            let found = running.ended(&numbers, i + 1);
            prop_assert_eq!(found.to_bits(), want.to_bits(), "{} {} after {}", found, want, i);
        }
    }

    /// Runs that began at different times, one of which begins again.
    #[test]
    fn runs_side_by_side_have_the_bits_of_each_alone(
        wff in prop_oneof![3 => top(), 1 => doubtful()],
        rows in prop_oneof![rows(), zeros()],
        closed in any::<bool>(),
        again in 0..40usize,
    ) {
        let until = if closed { Until::Closed } else { Until::HalfOpen };
        let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
        let Some(running) = monitor.running(rows.len()) else {
            return Ok(());
        };
        const RUNS: usize = 5;
        let mut numbers = vec![vec![0.0; RUNS]; running.numbers()];
        let mut alone = vec![vec![0.0; running.numbers()]; RUNS];
        let mut samples = [0; RUNS];
        for run in 0..RUNS {
            running.begin_run(&mut numbers, run);
            running.begin(&mut alone[run]);
        }
        for step in 0..rows.len() {
            if step == again {
                running.begin_run(&mut numbers, 1);
                running.begin(&mut alone[1]);
                samples[1] = 0;
            }
            let row = |run: usize| rows[(step + 3 * run) % rows.len()];
            let column = |signal: usize| (0..RUNS).map(|run| row(run)[signal]).collect();
            let columns: Vec<Vec<f64>> = (0..3).map(column).collect();
            let mut greatest = [0.0; RUNS];
            running.push_runs(&mut numbers, &samples, RunColumns(&columns), &mut greatest);
            for run in 0..RUNS {
                let want = running.push(&mut alone[run], samples[run], &row(run));
                samples[run] += 1;
                prop_assert_eq!(greatest[run].to_bits(), want.hi.to_bits());
                let found = running.interval_of_run(&numbers, run, samples[run]);
                prop_assert_eq!(bits(found), bits(want));
                let ended = running.ended_run(&numbers, run, samples[run]);
                prop_assert_eq!(ended.to_bits(), running.ended(&alone[run], samples[run]).to_bits());
            }
        }
    }
}

fn compiled(text: &str) -> Option<RunningMonitor> {
    let formula: brakecheck_stl::Formula = text.parse().unwrap();
    let monitor = formula.bind(&super::naive::schema(), &Default::default());
    monitor.unwrap().running(20)
}

#[test]
fn what_is_compiled_and_what_is_not() {
    for text in [
        "always (x >= 1)",
        "always[0, 19] (x >= 1) and eventually (y < x)",
        "(x > 1) unless (abs(y) <= 2)",
        "always (rise(on) implies (x > 1 and y > 2))",
        "not (x > 1 until[2, 5] y > 2)",
    ] {
        assert!(compiled(text).is_some(), "{text}");
    }
    for text in [
        "always (on implies eventually[0, 2] (x > 1))",
        "always once[0, 2] (x > 1)",
    ] {
        assert!(compiled(text).is_none(), "{text}");
    }
    let extremum = compiled("always (x >= 1)").unwrap();
    assert_eq!(extremum.numbers(), 2);
}
