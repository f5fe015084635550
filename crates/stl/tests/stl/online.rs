//! Sample by sample: what is possible, and what it ends with.

use brakecheck_stl::trace::{RowError, Schema, Signal, Trace};
use brakecheck_stl::{Constants, Formula, Interval, Scratch, Settings, TraceEnd, Until};
use proptest::prelude::*;

use super::naive::{Lengths, doubtful, naive, nested, rows, settings, trace, wff, zeros};

proptest! {
    #![proptest_config(super::cases(4000))]

    /// At every prefix exactly the interval of the definition, which contains
    /// the value of every trace that begins so; at the end the value itself.
    #[test]
    fn intervals_are_exact_and_end_with_the_value(
        wff in prop_oneof![wff(), nested()],
        rows in rows(),
        closed in any::<bool>(),
        end in prop_oneof![Just(TraceEnd::Truncate), Just(TraceEnd::Strict), Just(TraceEnd::Hold)],
    ) {
        let until = if closed { Until::Closed } else { Until::HalfOpen };
        let monitor = wff.monitor(&settings(until, end));
        let n = rows.len();
        let mut scratch = Scratch::new();
        let value = monitor.robustness(&trace(&rows), &mut scratch);
        let mut unknown = monitor.online();
        let mut known = monitor.online_for(n);
        for i in 0..n {
            let prefix = trace(&rows[..=i]);
            let loose = unknown.push(&rows[i]).unwrap();
            let tight = known.push(&rows[i]).unwrap();
            prop_assert_eq!(loose, monitor.interval(&prefix, &mut scratch), "after {}", i);
            prop_assert!(loose.contains(value) && tight.contains(value), "{:?} {:?} {} after {}", loose, tight, value, i);
            prop_assert!(loose.lo <= tight.lo && tight.hi <= loose.hi);
            let ended_here = monitor.robustness(&prefix, &mut scratch);
            prop_assert!(loose.contains(ended_here));
            prop_assert_eq!(unknown.clone().finish(), ended_here);
            if end == TraceEnd::Truncate {
                prop_assert_eq!(known.clone().finish(), ended_here);
            }
            if end == TraceEnd::Truncate && i + 1 < n {
                let lengths = Lengths { bounded: n, unbounded: n, closed };
                prop_assert_eq!((tight.lo, tight.hi), naive(&wff, &rows[..=i], lengths)[0], "after {}", i);
            }
        }
        prop_assert_eq!(known.interval(), Interval { lo: value, hi: value });
        prop_assert_eq!(known.push(&[9.0; 3]).unwrap(), Interval { lo: value, hi: value });
        prop_assert_eq!(unknown.finish(), value);
    }

    /// 0 and −0 are one number: the same bits whichever is measured, online
    /// and offline, at the end and on the way.
    #[test]
    fn the_sign_of_zero_never_shows(
        wff in prop_oneof![wff(), doubtful(), nested()],
        rows in zeros(),
        closed in any::<bool>(),
        end in prop_oneof![Just(TraceEnd::Truncate), Just(TraceEnd::Strict), Just(TraceEnd::Hold)],
    ) {
        let until = if closed { Until::Closed } else { Until::HalfOpen };
        let monitor = wff.monitor(&settings(until, end));
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let mut scratch = Scratch::new();
        let all = monitor.robustness_all(&trace(&rows));
        prop_assert!(all.iter().all(|v| *v != 0.0 || v.is_sign_positive()), "{:?}", all);
        let value = monitor.robustness(&trace(&rows), &mut scratch);
        let (mut unknown, mut known) = (monitor.online(), monitor.online_for(rows.len()));
        for i in 0..rows.len() {
            let loose = unknown.push(&rows[i]).unwrap();
            let interval = monitor.interval(&trace(&rows[..=i]), &mut scratch);
            prop_assert_eq!(bits(&[loose.lo, loose.hi]), bits(&[interval.lo, interval.hi]));
            known.push(&rows[i]).unwrap();
        }
        let ends = [all[0], unknown.finish(), known.interval().lo, known.interval().hi];
        prop_assert_eq!(bits(&ends), bits(&[value; 4]));
        prop_assert_eq!(monitor.explain(&trace(&rows)).robustness.to_bits(), value.to_bits());
    }

    /// A monitor that starts again knows nothing of the run before.
    #[test]
    fn reset_forgets(wff in prop_oneof![wff(), nested()], first in rows(), second in rows()) {
        let monitor = wff.monitor(&Settings::default());
        let mut used = monitor.online();
        first.iter().for_each(|row| { used.push(row).unwrap(); });
        used.finish();
        used.reset();
        let mut fresh = monitor.online();
        for row in &second {
            prop_assert_eq!(used.push(row).unwrap(), fresh.push(row).unwrap());
        }
        prop_assert_eq!(used.finish(), fresh.finish());
    }
}

fn line(values: impl Iterator<Item = f64>) -> Trace {
    let schema = Schema::new(0.1, [Signal::real("x", "", "a ramp")]).unwrap();
    let mut trace = Trace::new(schema.into());
    values.for_each(|value| trace.push(&[value]).unwrap());
    trace
}

/// Long runs cross the point where old samples are dropped.
#[test]
fn long_runs_forget_what_no_longer_matters() {
    let texts = [
        "always (x < 90 implies eventually[0, 2] (x > 10))",
        "eventually[1, 30] always[0.5, 3] once[0, 4] (x > 97)",
        "always ((x > 5) until[0, 1.5] (x < 40)) or historically[1, 2] (x > 3)",
        "always[0, 100] ((once[1, end] (x > 50)) implies (x since[0.5, 2.5] x > 3))",
        "always eventually (x > 50)",
        "eventually once[0, 1] always[0, 1] (x > 60)",
    ];
    for text in texts {
        let text = text.replace("x since", "(x > 1) since");
        let trace = line((0..3000).map(|i| f64::from((i * 7919) % 101)));
        let formula: Formula = text.parse().unwrap();
        let monitor = formula.bind(trace.schema(), &Constants::new()).unwrap();
        let mut scratch = Scratch::new();
        let (mut online, mut prefix) = (monitor.online(), line(std::iter::empty()));
        for (i, value) in trace.column(0).iter().enumerate() {
            prefix.push(&[*value]).unwrap();
            let interval = online.push(&[*value]).unwrap();
            if i % 50 == 0 || i < 40 {
                assert_eq!(
                    interval,
                    monitor.interval(&prefix, &mut scratch),
                    "{text} after {i}"
                );
            }
        }
        assert_eq!(
            online.finish(),
            monitor.robustness(&trace, &mut scratch),
            "{text}"
        );
    }
}

/// A violation that a NaN follows is still one.
#[test]
fn a_row_that_is_no_sample_is_refused_and_changes_nothing() {
    let trace = line(std::iter::empty());
    let not_finite = |value: f64| {
        if value.is_nan() {
            "`x` is NaN at sample 1: traces hold finite numbers only".to_owned()
        } else {
            format!("`x` is {value} at sample 1: traces hold finite numbers only")
        }
    };
    let texts = [
        "always (x >= 0)",
        "not eventually (x < 0)",
        "always[0, 2] (x >= 0)",
        "always once[0, 1] always[0, 1] (x >= 0)",
        "x >= 0",
        "(x >= 0) unless (x > 9)",
    ];
    for text in texts {
        let formula: Formula = text.parse().unwrap();
        let monitor = formula.bind(trace.schema(), &Constants::new()).unwrap();
        for mut online in [
            monitor.online(),
            monitor.online_for(2),
            monitor.online_for(9),
        ] {
            let before = online.push(&[-5.0]).unwrap();
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let error = online.push(&[value]).unwrap_err();
                assert_eq!(error.to_string(), not_finite(value), "{text}");
                assert_eq!((online.interval(), online.len()), (before, 1), "{text}");
            }
            for row in [&[][..], &[1.0, 2.0]] {
                let want = RowError::Length {
                    got: row.len(),
                    want: 1,
                    sample: 1,
                };
                assert_eq!(online.push(row), Err(want), "{text}");
            }
            online.push(&[2.0]).unwrap();
            assert_eq!((online.finish(), online.len()), (-5.0, 2), "{text}");
            // Nor is it taken when samples are no longer listened to.
            assert!(online.push(&[f64::NAN]).is_err(), "{text}");
            assert_eq!(online.finish(), -5.0, "{text}");
        }
    }
}

#[test]
fn a_verdict_is_final_only_when_nothing_can_change_it() {
    let trace = line([5.0, 3.0, 6.0].into_iter());
    let bind = |text: &str| {
        text.parse::<Formula>()
            .unwrap()
            .bind(trace.schema(), &Constants::new())
            .unwrap()
    };

    // The end is not known: a rule for ever is never kept, only broken.
    let mut online = bind("always (x >= 4)").online();
    assert!(!online.interval().is_final() && online.is_empty());
    assert!(!online.push(&[5.0]).unwrap().is_kept());
    assert!(online.push(&[3.0]).unwrap().is_violated());
    assert!(!online.interval().is_final());
    assert_eq!((online.finish(), online.len()), (-1.0, 2));

    // With a bound, the value is final as soon as its window is over.
    let mut online = bind("eventually[0, 0.1] (x >= 4)").online();
    assert_eq!(
        online.push(&[5.0]).unwrap(),
        Interval {
            lo: 1.0,
            hi: f64::INFINITY
        }
    );
    assert_eq!(online.push(&[3.0]).unwrap(), Interval { lo: 1.0, hi: 1.0 });

    // Nothing at all: nothing is shown.
    assert_eq!(bind("always (x >= 4)").online().finish(), f64::NEG_INFINITY);
    assert!(
        bind("always (x >= 4)")
            .robustness_all(&line(std::iter::empty()))
            .is_empty()
    );
}
