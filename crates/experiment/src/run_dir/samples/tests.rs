//! Traces of good and bad files.

use super::*;
use crate::run_dir::counterexample::csv_of;

#[test]
fn an_index_without_a_name_is_no_signal() {
    let text = ",time,x\nfirst,0.0,1\nsecond,0.1,2\n";
    let trace = trace_of_csv(text, None).expect("a trace");
    let signals = trace.schema().signals();
    let names: Vec<&str> = signals.iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["time", "x"]);
    assert_eq!(trace.signal("x"), Some(&[1.0, 2.0][..]));
    assert_eq!(trace.dt_s(), 0.1);
}

#[test]
fn names_with_separators_and_quotes_are_read_as_they_were_written() {
    let names = ["gap, front", "a;b;c", "\"lead\".speed", "plain"];
    let signals = names.map(|name| Signal::real(name, "", ""));
    let mut trace = Trace::new(Schema::new(0.1, signals).expect("a schema").into());
    trace.push(&[1.0, 2.0, 3.0, 4.0]).expect("finite");
    trace.push(&[5.0, 6.0, 7.0, 8.0]).expect("finite");
    let text = csv_of(&trace);
    assert!(
        text.starts_with("time,\"gap, front\",\"a;b;c\",\"\"\"lead\"\".speed\",plain\n"),
        "{text}"
    );
    let again = trace_of_csv(&text, None).expect("a trace");
    for (column, name) in names.iter().enumerate() {
        assert_eq!(again.signal(name), Some(trace.column(column)), "{name}");
    }
}

#[test]
fn good_files_are_read() {
    let trace =
        trace_of_csv("time,x,on\n0,1,true\n0.1,2,false\n0.2,3,true\n", None).expect("a trace");
    assert_eq!(trace.dt_s(), 0.1);
    assert_eq!(trace.signal("x"), Some([1.0, 2.0, 3.0].as_slice()));
    assert_eq!(trace.signal("on"), Some([1.0, 0.0, 1.0].as_slice()));
    for header in ["time [s]", "Time (s)", "t[s]"] {
        let text = format!("{header},x\n0,1\n0.5,2\n");
        let trace = trace_of_csv(&text, None).expect(header);
        assert_eq!(trace.dt_s(), 0.5, "{header}");
        assert!(!trace.schema().signals()[0].name.contains(['[', '(', ' ']));
    }
    let trace = trace_of_csv("x, y\n1, 2\n", Some(0.5)).expect("a trace");
    assert_eq!((trace.len(), trace.dt_s()), (1, 0.5));
}

#[test]
fn bad_files_name_the_line() {
    let cases = [
        ("", "empty"),
        ("t,y\n", "no sample"),
        ("x,,z\n1,2,3\n", "column 2"),
        ("t,x,x\n1,2,3\n", "declared twice"),
        ("t,y\n1,2\n3\n", "line 3: 1 values for 2 columns"),
        ("t\n1\nNaN\n", "line 3, column `t`: `NaN` is no time"),
        ("t,x\n1,inf\n", "`inf` is no finite number"),
        (
            "time x\n0 1\n",
            "none of the columns `time x` is known as the time",
        ),
        (
            "timestamp,x\n1700000000000,1\n1700000000100,1\n",
            "the times of `timestamp` are 1.7000000001e12 s, which fits ms",
        ),
        (
            "time;x\n0;1,5\n1;2.5\n",
            "line 3, column `x`: `2.5` is no finite number",
        ),
        (
            "time,x\n2026-11-29T10:00:00Z,1\n0.1,2\n",
            "line 3, column `time`: `0.1` is no time",
        ),
        (
            "time,x\n0,1\n2026-11-29T10:00:00Z,2\n",
            "line 3, column `time`: `2026-11-29T10:00:00Z` is no time",
        ),
        (
            "time,x\n2024-02-30T10:00:00,1\n2024-03-01T10:00:00,2\n",
            "line 2, column `time`: `2024-02-30T10:00:00` is no time: 2024-02 has the days 1 to 29",
        ),
        (
            "time,x\n10:00:00,1\n10:00:01,2\n",
            "line 2, column `time`: `10:00:00` is no time",
        ),
        ("t\n1\nabc\n", "`abc`"),
        ("t,x\n0,1\n1,1\n3,1\n", "line 4: time 3 s where 2 s was"),
        (
            "t,x\n0,1\n2,1\n3,1\n4,1\n",
            "line 3: time 2 s where 1 s was",
        ),
        (
            "t,x\n0,1\n.1,1\n.2,1\n.4,1\n",
            "line 5: time 0.4 s where 0.3 s was",
        ),
        ("t,x\n0,1\n0,1\n", "line 3: time 0 s is not later than 0 s"),
        (
            "t,x\n0,1\n1,1\n.5,1\n2,1\n",
            "line 4: time 0.5 s is not later",
        ),
        ("time [h],x\n0,1\n10,1\n", "in `h`"),
        (
            "x,y\n1,2\n",
            "none of the columns `x`, `y` is known as the time",
        ),
        ("0,1\n1,2\n", "line 1: values where the names"),
        (
            "time,stamp\n0,0\n1,2\n2,4\n",
            "`time` and `stamp` are both times",
        ),
        (
            "t,x\n0,1\n1,1\n2,1\n4,1\n5,1\n",
            "line 5: time 4 s where 3 s was",
        ),
    ];
    for (text, says) in cases {
        let error = trace_of_csv(text, None).expect_err(text).to_string();
        assert!(error.contains(says), "{text:?}: {error}");
    }
    let error = trace_of_csv("t,x\n0,1\n1,1\n", Some(0.5)).expect_err("contradiction");
    assert!(
        error.to_string().contains("not by the given 0.5 s"),
        "{error}"
    );
}

/// A trace of three seconds whose x is 9 at 0.8 s, with a stamp per instant.
fn stamped(rate_hz: f64, stamp: impl Fn(f64) -> String) -> String {
    let rows = (0..=(3.0 * rate_hz) as usize).map(|i| {
        let time_s = i as f64 / rate_hz;
        let x = if (time_s - 0.8).abs() < 0.5 / rate_hz {
            9
        } else {
            0
        };
        format!("{x},{}\n", stamp(time_s))
    });
    format!("x,sim_time\n{}", rows.collect::<String>())
}

#[test]
fn rounded_stamps_have_their_rate() {
    for rate_hz in [10.0, 15.0, 24.0, 30.0, 60.0, 90.0, 100.0] {
        let stamps: [&dyn Fn(f64) -> String; 8] = [
            &|t| format!("2026-11-29T10:00:{t:06.3}Z"),
            &|t| format!("2026-12-31 23:59:{:09.6}+01:00", 56.0 + t),
            &|t| format!("{t}"),
            &|t| format!("{t:.3}"),
            &|t| format!("{}", t as f32),
            &|t| format!("{}", f64::from(t as f32)),
            &|t| format!("{}", 1.7e9 + t),
            &|t| format!("{:.3}", 1.7e9 + t),
        ];
        for stamp in stamps {
            let text = stamped(rate_hz, stamp);
            let read = read_trace(&text, &TraceOptions::default())
                .unwrap_or_else(|error| panic!("{rate_hz} Hz: {error}\n{text}"));
            assert_eq!(read.trace.dt_s(), 1.0 / rate_hz);
            assert_eq!(read.time.as_deref(), Some("sim_time"));
        }
    }
}

#[test]
fn the_time_is_known_wherever_it_stands() {
    for text in [
        "# time,x\n0.0,1\n0.1,2\n0.2,3\n",
        "# made by numpy\n# time, x\n0.0,1\n0.1,2\n0.2,3\n",
        "x,TimeStamp\n1,0.0\n2,0.1\n3,0.2\n",
        "x,time_ms\n1,0\n2,100\n3,200\n",
        ",time,x\n0,0.0,1\n1,0.1,2\n2,0.2,3\n",
        "time;x\n0;1,0\n0,1;2,0\n0,2;3,0\n",
        "t\tx\n0\t1\n0.1\t2\n0.2\t3\n",
        "x,timestamp_ms\n1,2026-11-29 23:59:59.9\n2,2026-11-30 00:00:00.0\n3,2026-11-30 00:00:00.1\n",
        "epoch,x\n1700000000.0,1\n1700000000.1,2\n1700000000.2,3\n",
    ] {
        let trace = trace_of_csv(text, None).unwrap_or_else(|it| panic!("{text}: {it}"));
        assert_eq!((trace.dt_s(), trace.len()), (0.1, 3), "{text}");
        assert_eq!(
            trace.signal("x"),
            Some([1.0, 2.0, 3.0].as_slice()),
            "{text}"
        );
    }
    let named = TraceOptions {
        time: Some("k"),
        ..TraceOptions::default()
    };
    let read = read_trace("x,k\n1,0\n2,0.5\n", &named).expect("a trace");
    assert_eq!(read.trace.dt_s(), 0.5);
    let error = read_trace("x,t\n1,0\n2,0.5\n", &named).expect_err("no column k");
    assert!(
        error.to_string().contains("no column `k` among `x`, `t`"),
        "{error}"
    );
}

#[test]
fn short_periods_and_single_samples_are_stated_as_they_are() {
    let read = |text: &str| {
        let read = read_trace(text, &TraceOptions::default());
        read.map(|it| it.to_string()).map_err(|it| it.to_string())
    };
    for (text, says) in [
        (
            "t,x\n0,1\n",
            "time `t`: 1 sample, and the period is taken as 1 s",
        ),
        (
            "time_ns,x\n0,1\n1,2\n",
            "time `time_ns`: 2 samples at 1.000e-9 s",
        ),
        (
            "t,x\n0,1\n0.05,2\n",
            "time `t`: 2 samples at 0.050000 s (20 Hz)",
        ),
    ] {
        let said = read(text).expect(text);
        assert!(said.starts_with(says), "{said}");
    }
}
