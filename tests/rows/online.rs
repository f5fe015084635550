//! What is still possible after every sample, by hand.

use std::sync::Arc;

use brakecheck::stl::{Constants, Formula, Interval};
use brakecheck::trace::{Schema, Signal};

const INF: f64 = f64::INFINITY;

fn schema() -> Arc<Schema> {
    let signals = [
        Signal::real("x", "", "one"),
        Signal::real("y", "", "another"),
    ];
    Arc::new(Schema::new(1.0, signals).expect("a schema"))
}

/// Formula, rows (x, y), and [lo, hi] after each where nothing is known of the
/// length, and where it is known that no more samples come than these.
type Case<'a> = (
    &'a str,
    &'a [(f64, f64)],
    &'a [(f64, f64)],
    &'a [(f64, f64)],
);

#[test]
fn intervals_are_those_on_paper() {
    let cases: &[Case] = &[
        (
            "always x > 2",
            &[(5.0, 0.0), (3.0, 0.0), (4.0, 0.0)],
            &[(-INF, 3.0), (-INF, 1.0), (-INF, 1.0)],
            &[(-INF, 3.0), (-INF, 1.0), (1.0, 1.0)],
        ),
        (
            // Its window is over after the second sample.
            "always[0, 1] x > 2",
            &[(5.0, 0.0), (3.0, 0.0), (0.0, 0.0)],
            &[(-INF, 3.0), (1.0, 1.0), (1.0, 1.0)],
            &[(-INF, 3.0), (1.0, 1.0), (1.0, 1.0)],
        ),
        (
            "always[1, 2] x > 2",
            &[(0.0, 0.0), (3.0, 0.0), (2.5, 0.0), (-9.0, 0.0)],
            &[(-INF, INF), (-INF, 1.0), (0.5, 0.5), (0.5, 0.5)],
            &[(-INF, INF), (-INF, 1.0), (0.5, 0.5), (0.5, 0.5)],
        ),
        (
            "eventually[0, 2] x > 2",
            &[(0.0, 0.0), (3.0, 0.0), (2.5, 0.0)],
            &[(-2.0, INF), (1.0, INF), (1.0, 1.0)],
            &[(-2.0, INF), (1.0, INF), (1.0, 1.0)],
        ),
        (
            "eventually x > 2",
            &[(0.0, 0.0), (1.0, 0.0)],
            &[(-2.0, INF), (-1.0, INF)],
            &[(-2.0, INF), (-1.0, -1.0)],
        ),
        (
            "not always x > 2",
            &[(5.0, 0.0), (0.0, 0.0)],
            &[(-3.0, INF), (2.0, INF)],
            &[(-3.0, INF), (2.0, 2.0)],
        ),
        (
            "always x > 2 and eventually y > 0",
            &[(5.0, -1.0), (4.0, 1.0)],
            &[(-INF, 3.0), (-INF, 2.0)],
            &[(-INF, 3.0), (1.0, 1.0)],
        ),
        (
            "always x > 2 implies eventually y > 0",
            &[(5.0, -1.0), (4.0, -2.0), (1.0, -3.0)],
            // max(−hi, …) ≥ max(−3, −1); then max(−2, −1); then max(1, −1).
            &[(-1.0, INF), (-1.0, INF), (1.0, INF)],
            &[(-1.0, INF), (-1.0, INF), (1.0, 1.0)],
        ),
        (
            "always x > 2 iff eventually y > 0",
            &[(5.0, -1.0), (4.0, 1.0)],
            // a ∈ (−∞, 3], b ∈ [−1, ∞): min(max(−a, b), max(a, −b)) ≤ max(3, 1).
            // Then a ∈ (−∞, 2], b ∈ [1, ∞): max(2, −1). At the end a = 2, b = 1.
            &[(-INF, 3.0), (-INF, 2.0)],
            &[(-INF, 3.0), (1.0, 1.0)],
        ),
        (
            "x > 0 until[0, 2] y > 0",
            &[(4.0, -1.0), (3.0, -2.0), (2.0, 7.0)],
            // The goal may come while x holds: at most 4, then 3; then min(7, 3).
            &[(-1.0, 4.0), (-1.0, 3.0), (3.0, 3.0)],
            &[(-1.0, 4.0), (-1.0, 3.0), (3.0, 3.0)],
        ),
        (
            // A goal before its window does not count.
            "x > 0 until[1, 2] y > 0",
            &[(4.0, 9.0), (3.0, 2.0), (2.0, -1.0)],
            // Then min(2, 4); what is to come is worth min(4, 3) at most.
            &[(-INF, 4.0), (2.0, 3.0), (2.0, 2.0)],
            &[(-INF, 4.0), (2.0, 3.0), (2.0, 2.0)],
        ),
        (
            "x > 0 unless y > 0",
            &[(4.0, -5.0), (3.0, -5.0), (-1.0, -5.0)],
            // It may hold for ever: at most 4, 3; then it no longer does, and the
            // goal is worth min(…, −1) from now on.
            &[(-5.0, 4.0), (-5.0, 3.0), (-5.0, -1.0)],
            &[(-5.0, 4.0), (-5.0, 3.0), (-1.0, -1.0)],
        ),
        (
            "x > 0 release y > 0",
            // not (not x until not y): min over t of max(y, x before t).
            &[(-1.0, 5.0), (2.0, 3.0), (0.0, -4.0)],
            // 5; then max(3, −1) = 3, and later ones max(…, 2) ≥ 2.
            &[(-1.0, 5.0), (2.0, 3.0), (2.0, 2.0)],
            &[(-1.0, 5.0), (2.0, 3.0), (2.0, 2.0)],
        ),
        (
            "always (x > 2 implies eventually[0, 1] y > 0)",
            &[(5.0, -1.0), (1.0, 3.0), (4.0, -2.0), (0.0, -1.0)],
            // At t = 0: max(−3, −1, later). Then max(−3, 3) = 3 and max(1, 3, …) ≥ 3.
            // At t = 2 the answer is open: at least max(−2, −2). At last it is −1.
            &[(-INF, INF), (-INF, 3.0), (-INF, 3.0), (-INF, -1.0)],
            &[(-INF, INF), (-INF, 3.0), (-INF, 3.0), (-1.0, -1.0)],
        ),
        (
            "always (rise(x > 2) implies y > 0)",
            &[(3.0, -1.0), (1.0, 4.0), (5.0, 2.0)],
            // rise at 0: min(inf, 1) = 1, so max(−1, −1). rise at 1: min(−1, −1), so
            // max(1, 4). rise at 2: min(1, 3) = 1, so max(−1, 2).
            &[(-INF, -1.0), (-INF, -1.0), (-INF, -1.0)],
            &[(-INF, -1.0), (-INF, -1.0), (-1.0, -1.0)],
        ),
        (
            "eventually (fall(x > 2) and y > 0)",
            &[(3.0, 1.0), (1.0, 4.0), (0.0, 2.0)],
            // fall: min(inf, −1); min(1, 1) = 1; min(−1, 2).
            &[(-1.0, INF), (1.0, INF), (1.0, INF)],
            &[(-1.0, INF), (1.0, INF), (1.0, 1.0)],
        ),
        (
            "always (once[0, 1] x > 2)",
            &[(3.0, 0.0), (1.0, 0.0), (0.0, 0.0), (9.0, 0.0)],
            // 1; max(1, −1) = 1; max(−1, −2) = −1; 7.
            &[(-INF, 1.0), (-INF, 1.0), (-INF, -1.0), (-INF, -1.0)],
            &[(-INF, 1.0), (-INF, 1.0), (-INF, -1.0), (-1.0, -1.0)],
        ),
        (
            "eventually[2, 2] (historically[1, 2] x > 2)",
            &[(3.0, 0.0), (7.0, 0.0), (0.0, 0.0)],
            &[(-INF, INF), (-INF, INF), (1.0, 1.0)],
            &[(-INF, INF), (-INF, INF), (1.0, 1.0)],
        ),
        (
            "always (x > 0 since y > 0)",
            &[(1.0, 2.0), (3.0, -5.0), (-1.0, -5.0)],
            // 2; min(2, 3) = 2; min(2, −1) = −1.
            &[(-INF, 2.0), (-INF, 2.0), (-INF, -1.0)],
            &[(-INF, 2.0), (-INF, 2.0), (-1.0, -1.0)],
        ),
        (
            // Never y: there is nothing since which x holds.
            "eventually (x > 0 since y > 0)",
            &[(1.0, -2.0), (3.0, -5.0)],
            &[(-2.0, INF), (-2.0, INF)],
            &[(-2.0, INF), (-2.0, -2.0)],
        ),
        (
            "always (not x > 2)",
            &[(0.0, 0.0), (3.0, 0.0)],
            &[(-INF, 2.0), (-INF, -1.0)],
            &[(-INF, 2.0), (-1.0, -1.0)],
        ),
    ];
    for (text, rows, unknown, known) in cases {
        let formula: Formula = text.parse().expect(text);
        let monitor = formula.bind(&schema(), &Constants::new()).expect(text);
        let (mut loose, mut tight) = (monitor.online(), monitor.online_for(rows.len()));
        // Twice: a monitor that starts again knows nothing of the run before.
        for run in 0..2 {
            for (i, (x, y)) in rows.iter().enumerate() {
                let of = |(lo, hi): (f64, f64)| Interval { lo, hi };
                let seen = loose.push(&[*x, *y]).expect("a sample");
                assert_eq!(seen, of(unknown[i]), "{text}, after {i}, run {run}");
                let seen = tight.push(&[*x, *y]).expect("a sample");
                assert_eq!(seen, of(known[i]), "{text}, after {i} of all, run {run}");
            }
            // What comes after the last sample is none of them.
            let last = tight.interval();
            assert_eq!(tight.push(&[-99.0, 99.0]), Ok(last), "{text}");
            assert_eq!(tight.len(), rows.len());
            let value = known.last().expect("samples").0;
            assert_eq!((loose.finish(), tight.finish()), (value, value), "{text}");
            loose.reset();
            tight.reset();
        }
    }
}
