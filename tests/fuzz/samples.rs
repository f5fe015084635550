//! CSV: refused with its line, or the numbers that stand there.

use brakecheck::run_dir::trace_of_csv;
use brakecheck::trace::{Schema, Signal, SignalKind, Trace};
use brakecheck_experiment::run_dir::counterexample::csv_of;
use proptest::prelude::*;
use proptest::sample::select;

use super::corpus::{self, Source};
use super::harness::{Seen, Target};
use super::mutate::mutants;

const PIECES: [&str; 8] = [
    "time,x,on\n0,1,true\n0.1,2,false\n0.2,3,true\n",
    "x, y\n1, 2\n",
    "t,a.b,\"lead speed\"\n0,1e-3,-0\n0.05,.5,+7\n# a remark\n0.1,1E5,1e-300\n",
    "\u{feff}T;x\n0;1\n",
    "time,headway\r\n0,12.5\r\n1,11.25\r\n\r\n2,10\r\n",
    "x\n1\n\"2\"\n 3 \n",
    "on\ntrue\nFALSE\n",
    "time,x\n1000000.0,1\n1000000.1,2\n1000000.2,3\n",
];

/// Short files, and the beginnings of recorded ones.
fn texts() -> Vec<Source> {
    let pieces = PIECES
        .iter()
        .enumerate()
        .map(|(i, text)| Source::new(format!("piece {i}"), *text));
    let recorded = corpus::files("tests/regressions", "csv").into_iter();
    let begun = recorded.map(|source| {
        let lines: Vec<&str> = source.text.lines().take(6).collect();
        Source::new(source.name, lines.join("\n"))
    });
    pieces.chain(begun).collect()
}

#[test]
fn any_csv_is_refused_or_read_as_it_stands() {
    let target = Target {
        name: "csv",
        cases: 4000,
        shrinks: 2000,
        least_percent: (20, 20),
    };
    let given = select(vec![
        None,
        None,
        Some(0.1),
        Some(0.05),
        Some(0.0),
        Some(f64::NAN),
    ]);
    target.run(&(mutants(texts().into()), given), |(mutant, dt_s)| {
        let trace = match trace_of_csv(&mutant.text, *dt_s) {
            Ok(trace) => trace,
            Err(error) => {
                assert!(!error.to_string().is_empty() && !error.help().is_empty());
                return Seen::Refused;
            }
        };
        assert!(trace.dt_s().is_finite() && trace.dt_s() > 0.0);
        assert!(!trace.is_empty());
        assert!(dt_s.is_none_or(|dt_s| dt_s == trace.dt_s()));
        if let Some(naive) = naive(&mutant.text) {
            let columns = 0..trace.schema().len();
            let read: Vec<Vec<f64>> = columns.map(|i| trace.column(i).to_vec()).collect();
            assert_eq!(read, naive);
            let timed = trace.schema().signals()[0].name.to_ascii_lowercase();
            if timed == "time" || timed == "t" {
                evenly(&naive[0], trace.dt_s());
            }
        }
        back(&trace);
        Seen::Accepted
    });
}

/// Columns of a text without quotes, remarks, dates, an unnamed column and an announced
/// separator.
fn naive(text: &str) -> Option<Vec<Vec<f64>>> {
    let text = text.trim_start_matches('\u{feff}');
    if text.contains(['"', '#']) || text.starts_with("sep=") {
        return None;
    }
    let mut lines = text
        .split(['\n', '\r'])
        .filter(|line| !line.trim().is_empty());
    let header = lines.next()?;
    let count = |sign: char| header.matches(sign).count();
    let (semicolons, tabs) = (count(';'), count('\t'));
    let separator = match count(',') {
        commas if commas >= semicolons && commas >= tabs => ',',
        _ if semicolons >= tabs => ';',
        _ => '\t',
    };
    let fields = |line: &'_ str| -> Vec<String> {
        line.split(separator)
            .map(|field| field.trim().to_owned())
            .collect()
    };
    let mut names = fields(header);
    if names.len() > 1 && names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    if names.iter().any(String::is_empty) {
        return None;
    }
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        let mut values = fields(line);
        if values.len() == names.len() + 1 && values.last().is_some_and(String::is_empty) {
            values.pop();
        }
        assert_eq!(values.len(), names.len(), "{line:?}");
        for (column, value) in columns.iter_mut().zip(values) {
            let is_date = value.matches('-').count() > 1 && !value.contains(['e', 'E']);
            if is_date {
                return None;
            }
            column.push(match value.to_ascii_lowercase().as_str() {
                "true" => 1.0,
                "false" => 0.0,
                number if separator == ',' => number.parse().expect("a number"),
                number => number.replacen(',', ".", 1).parse().expect("a number"),
            });
        }
    }
    Some(columns)
}

/// No step of the time is off by more than two thousandths of a period: both
/// of its ends may be by one.
fn evenly(times: &[f64], dt_s: f64) {
    let scale = times
        .iter()
        .fold(0.0, |most: f64, time| most.max(time.abs()));
    for pair in times.windows(2) {
        let off = (pair[1] - pair[0] - dt_s).abs();
        assert!(
            off <= 3e-3 * dt_s + 1e-9 + 1e-12 * scale,
            "{pair:?} at {dt_s} s"
        );
    }
}

/// What is written reads back bit for bit.
fn back(trace: &Trace) {
    let timed = |name: &str| name.eq_ignore_ascii_case("time") || name.eq_ignore_ascii_case("t");
    let names = trace
        .schema()
        .signals()
        .iter()
        .map(|signal| signal.name.as_str());
    let plain = |name: &str| !name.contains(['\n', '\r', '#']) && name.trim() == name;
    // Time is written to the nanosecond.
    let told = (trace.dt_s() * 1e9).round() == trace.dt_s() * 1e9;
    if !told || trace.len() < 2 || !names.clone().all(plain) || names.clone().any(timed) {
        return;
    }
    let again = trace_of_csv(&csv_of(trace), None).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(again.dt_s(), trace.dt_s());
    for (i, signal) in trace.schema().signals().iter().enumerate() {
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let column = again.signal(&signal.name).expect("the column");
        assert_eq!(bits(column), bits(trace.column(i)), "{}", signal.name);
        assert_eq!(again.schema().signals()[i + 1].kind, SignalKind::Real);
    }
}

/// Every finite number, the odd ones often.
fn value() -> impl Strategy<Value = f64> {
    let odd = vec![
        0.0,
        -0.0,
        f64::MIN_POSITIVE,
        f64::MAX,
        f64::MIN,
        5e-324,
        1e21,
        0.1,
        1.0 / 3.0,
    ];
    prop_oneof![
        2 => select(odd),
        3 => any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |v| v.is_finite()),
        3 => -100.0..100.0f64,
    ]
}

#[test]
fn any_trace_survives_csv_bit_for_bit() {
    let target = Target {
        name: "trace",
        cases: 1000,
        shrinks: 2000,
        least_percent: (100, 0),
    };
    let rows = (1..6usize).prop_flat_map(|width| {
        let row = prop::collection::vec(value(), width);
        (Just(width), prop::collection::vec(row, 2..30))
    });
    let period = select(vec![0.05, 0.1, 1.0, 0.02, 1e-3, 3.0, 1e-6]);
    target.run(&(rows, period), |((width, rows), dt_s)| {
        let signals = (0..*width).map(|i| Signal::real(format!("signal.{i}"), "m", "a number"));
        let mut trace = Trace::new(Schema::new(*dt_s, signals).expect("a schema").into());
        rows.iter().for_each(|row| trace.push(row).expect("finite"));
        back(&trace);
        Seen::Accepted
    });
}
