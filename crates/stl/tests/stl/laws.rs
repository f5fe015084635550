//! What holds for every formula and every trace.

use brakecheck_stl::trace::Trace;
use brakecheck_stl::{Interval, Monitor, Names, Scratch, Settings, TraceEnd, Until};
use proptest::prelude::*;

use super::naive::{
    Lengths, Wff, doubtful, naive, naive_held, rows, schema, settings, trace, wff, zeros,
};

fn bind(text: &str, settings: &Settings) -> Monitor {
    let formula = text.parse::<brakecheck_stl::Formula>().unwrap();
    formula
        .bind_with(&schema(), &Names::default(), settings)
        .unwrap()
}

fn rho(text: &str, trace: &Trace) -> Vec<f64> {
    bind(text, &Settings::default()).robustness_all(trace)
}

fn reading() -> impl Strategy<Value = Until> {
    prop_oneof![Just(Until::HalfOpen), Just(Until::Closed)]
}

/// Also with comparisons that can be undefined.
fn any_wff() -> impl Strategy<Value = Wff> {
    prop_oneof![wff(), doubtful()]
}

proptest! {
    #![proptest_config(super::cases(2000))]

    #[test]
    fn fast_is_naive(wff in wff(), rows in rows(), until in reading()) {
        let trace = trace(&rows);
        let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
        let n = rows.len();
        let lengths = Lengths { bounded: n, unbounded: n, closed: until == Until::Closed };
        let want: Vec<f64> = naive(&wff, &rows, lengths).iter().map(|pair| pair.0).collect();
        prop_assert_eq!(&monitor.robustness_all(&trace), &want);
        prop_assert_eq!(monitor.robustness(&trace, &mut Scratch::new()), want[0]);
    }

    #[test]
    fn fast_intervals_are_naive(wff in wff(), rows in rows(), until in reading()) {
        let trace = trace(&rows);
        let closed = until == Until::Closed;
        let lengths = Lengths { bounded: usize::MAX, unbounded: usize::MAX, closed };
        let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
        let got = monitor.interval(&trace, &mut Scratch::new());
        prop_assert_eq!((got.lo, got.hi), naive(&wff, &rows, lengths)[0]);

        let strict = wff.monitor(&settings(until, TraceEnd::Strict));
        let lengths = Lengths { bounded: usize::MAX, unbounded: rows.len(), closed };
        let want: Vec<f64> = naive(&wff, &rows, lengths).iter().map(|pair| pair.0).collect();
        prop_assert_eq!(strict.robustness_all(&trace), want);
    }

    #[test]
    fn ranges_of_signals_bound_the_robustness(wff in any_wff(), rows in rows(), until in reading()) {
        let column = |i: usize| rows.iter().map(move |row| row[i]);
        let ranges = [0, 1, 2].map(|i| Interval {
            lo: column(i).fold(f64::INFINITY, f64::min),
            hi: column(i).fold(f64::NEG_INFINITY, f64::max),
        });
        for end in [TraceEnd::Truncate, TraceEnd::Hold, TraceEnd::Strict] {
            let monitor = wff.monitor(&settings(until, end));
            let rho = monitor.robustness(&trace(&rows), &mut Scratch::new());
            let range = monitor.range(&ranges);
            prop_assert!(range.contains(rho), "{} in {range:?}", rho);
        }
    }

    #[test]
    fn holding_is_holding_for_long(wff in wff(), rows in rows(), until in reading()) {
        let monitor = wff.monitor(&settings(until, TraceEnd::Hold));
        let want = naive_held(&wff, &rows, until == Until::Closed);
        prop_assert_eq!(monitor.robustness(&trace(&rows), &mut Scratch::new()), want);
        prop_assert_eq!(monitor.robustness_all(&trace(&rows))[0], want);
    }

    #[test]
    fn sign_is_truth(wff in any_wff(), rows in rows(), until in reading()) {
        for end in [TraceEnd::Truncate, TraceEnd::Hold, TraceEnd::Strict] {
            let monitor = wff.monitor(&settings(until, end));
            let (trace, mut scratch) = (trace(&rows), Scratch::new());
            let rho = monitor.robustness(&trace, &mut scratch);
            let truth = monitor.satisfied(&trace, &mut scratch);
            prop_assert!(rho == 0.0 || (0.0 < rho) == truth, "{rho} {truth}");
        }
    }

    #[test]
    fn negation_and_duality(a in any_wff(), b in any_wff(), rows in rows(), from in 0..5usize, width in 0..9usize) {
        let trace = trace(&rows);
        let (a, b) = (a.text(), b.text());
        let to = from + width;
        let same = |left: String, right: String| {
            prop_assert_eq!(rho(&left, &trace), rho(&right, &trace), "{} and {}", left, right);
            Ok(())
        };
        same(format!("not not ({a})"), a.clone())?;
        same(format!("not (({a}) and ({b}))"), format!("(not ({a})) or (not ({b}))"))?;
        same(format!("not (({a}) or ({b}))"), format!("(not ({a})) and (not ({b}))"))?;
        same(format!("not always[{from},{to}] ({a})"), format!("eventually[{from},{to}] (not ({a}))"))?;
        same(format!("not historically[{from},{to}] ({a})"), format!("once[{from},{to}] (not ({a}))"))?;
        same(format!("({a}) release[{from},{to}] ({b})"), format!("not ((not ({a})) until[{from},{to}] (not ({b})))"))?;
        same(format!("eventually[{from},{to}] ({a})"), format!("true until[{from},{to}] ({a})"))?;
        same(format!("once[{from},{to}] ({a})"), format!("true since[{from},{to}] ({a})"))?;
        same(format!("({a}) unless[{from},{to}] ({b})"),
            format!("(({a}) until[{from},{to}] ({b})) or (always[0,{to}] ({a}))"))?;
        same(format!("({a}) implies ({b})"), format!("(not ({a})) or ({b})"))?;
        same(format!("rise ({a})"), format!("({a}) and prev (not ({a}))"))?;
        same(format!("fall ({a})"), format!("rise (not ({a}))"))?;
    }

    #[test]
    fn xor_is_not_iff(a in wff(), b in wff(), rows in rows()) {
        let (trace, a, b) = (trace(&rows), a.text(), b.text());
        let (xor, iff) = (format!("({a}) xor ({b})"), format!("not (({a}) iff ({b}))"));
        prop_assert_eq!(rho(&xor, &trace), rho(&iff, &trace));
    }

    /// Lemma 1: signals that move by less than ρ do not change the verdict.
    #[test]
    fn small_changes_keep_the_verdict(wff in wff(), rows in rows(), shift in prop::collection::vec(-1.0..1.0f64, 40)) {
        let monitor = wff.monitor(&Settings::default());
        let mut scratch = Scratch::new();
        let before = monitor.robustness(&trace(&rows), &mut scratch);
        // Leaves read x or x − 2·y: moving x alone moves them by as much.
        let reach = if before.is_finite() { before.abs() } else { 1.0 };
        let moved: Vec<[f64; 3]> =
            rows.iter().zip(&shift).map(|(row, s)| [row[0] + 0.99 * s * reach, row[1], row[2]]).collect();
        let after = monitor.robustness(&trace(&moved), &mut scratch);
        prop_assert!(before == 0.0 || (0.0 < before) == (0.0 < after), "{before} {after}");
    }

    #[test]
    fn clamping_is_clamping(wff in any_wff(), rows in rows()) {
        let trace = trace(&rows);
        let free = wff.monitor(&Settings::default());
        let clamped = wff.monitor(&Settings { rho_max: Some(1.5), ..Settings::default() });
        let want: Vec<f64> = free.robustness_all(&trace).iter().map(|v| v.clamp(-1.5, 1.5)).collect();
        prop_assert_eq!(clamped.robustness_all(&trace), want);
        let mut online = clamped.online_for(rows.len());
        rows.iter().for_each(|row| { online.push(row).unwrap(); });
        prop_assert_eq!(online.interval().lo, clamped.robustness(&trace, &mut Scratch::new()));
    }

    #[test]
    fn zeros_of_either_sign_are_the_same_run(wff in wff(), rows in zeros(), until in reading()) {
        let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
        let positive: Vec<[f64; 3]> = rows.iter().map(|row| row.map(|v| v + 0.0)).collect();
        let bits = |rows: &[[f64; 3]]| {
            let all = monitor.robustness_all(&trace(rows));
            all.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        };
        prop_assert_eq!(bits(&rows), bits(&positive));
    }

    #[test]
    fn a_used_scratch_changes_nothing(all in prop::collection::vec((wff(), rows()), 1..6)) {
        let mut used = Scratch::new();
        for (wff, rows) in &all {
            let monitor = wff.monitor(&Settings::default());
            let trace = trace(rows);
            let fresh = monitor.robustness(&trace, &mut Scratch::new());
            prop_assert_eq!(monitor.robustness(&trace, &mut used), fresh);
        }
    }

    #[test]
    fn canonical_text_reads_back(wff in any_wff()) {
        let formula = wff.formula();
        let text = formula.to_string();
        prop_assert_eq!(text.parse::<brakecheck_stl::Formula>().unwrap(), formula);
    }
}

/// Long traces cross the blocks in which leaves and windows are evaluated.
#[test]
fn windows_of_all_sizes_on_a_long_trace() {
    let rows: Vec<[f64; 3]> = (0..1500)
        .map(|i| [f64::from((i * 7919) % 1013), f64::from((i * 31) % 17), 0.0])
        .collect();
    let trace = trace(&rows);
    let at = |i: usize| rows[i][0] - 500.0;
    for width in [1, 2, 3, 4, 5, 7, 16, 100, 511, 512, 513, 1499, 1500, 4000] {
        for from in [0, 1, 30] {
            let to = from + width - 1;
            let always = rho(&format!("always[{from}, {to}] (x >= 500)"), &trace);
            let once = rho(&format!("once[{from}, {to}] (x >= 500)"), &trace);
            for t in 0..rows.len() {
                let ahead = (t + from..(t + to + 1).min(rows.len()))
                    .map(at)
                    .fold(f64::INFINITY, f64::min);
                assert_eq!(always[t], ahead, "always[{from}, {to}] at {t}");
                let behind = (t.saturating_sub(to)..(t + 1).saturating_sub(from)).map(at);
                assert_eq!(
                    once[t],
                    behind.fold(f64::NEG_INFINITY, f64::max),
                    "once[{from}, {to}] at {t}"
                );
            }
        }
    }
}

#[test]
fn wff_texts_cover_the_language() {
    let wff = Wff::Step("rise", Box::new(Wff::On));
    assert_eq!(wff.formula().to_string(), "rise on");
}
