//! Compiled formulas against the general monitor: the same bits, run by run and side by side.

use brakecheck_stl::{Interval, RunningMonitor, SampleColumns, Scratch, TraceEnd, Until};
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

    /// Samples in blocks leave the numbers of samples one by one.
    #[test]
    fn blocks_of_samples_have_the_bits_of_single_samples(
        op in prop::sample::select(vec!["<", "<=", ">", ">=", "==", "!="]),
        side in -3..4i32,
        leaf in 0..4usize,
        rows in prop_oneof![rows(), zeros()],
        block in 1..12usize,
    ) {
        let leaf = match leaf {
            0 => Wff::X(op, side),
            1 => Wff::Both(op, side),
            2 => Wff::Ratio(op, side),
            _ => Wff::Signals(op),
        };
        let whole = Range { from: 0, to: None };
        let wff = Wff::Window("always", whole, leaf.into());
        let monitor = wff.monitor(&settings(Until::HalfOpen, TraceEnd::Truncate));
        let running = monitor.running(rows.len()).expect("an extremum");
        let mut numbers = vec![0.0; running.numbers()];
        running.begin(&mut numbers);
        let (mut single, mut work) = (numbers.clone(), [0.0; 12]);
        for (i, rows) in rows.chunks(block).enumerate() {
            let column = |signal: usize| rows.iter().map(|row| row[signal]).collect();
            let columns: Vec<Vec<f64>> = (0..3).map(column).collect();
            let columns = SampleColumns(&columns);
            let least = running.push_all(&mut numbers, columns, rows.len(), &mut work);
            let mut want = f64::INFINITY;
            for (k, row) in rows.iter().enumerate() {
                want = want.min(running.push(&mut single, i * block + k, row).hi);
            }
            prop_assert_eq!(least.expect("an extremum").to_bits(), want.to_bits());
            let known = i * block + rows.len();
            let ended = running.ended(&numbers, known);
            prop_assert_eq!(ended.to_bits(), running.ended(&single, known).to_bits());
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
