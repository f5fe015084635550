//! Dense time against brute force on a grid of instants and the intervals between.

use std::sync::Arc;

use brakecheck_stl::trace::{Schema, Signal};
use brakecheck_stl::{
    Constants, DenseError, DenseRowError, DenseTrace, Formula, Interpolation, Settings, TraceEnd,
    Until,
};
use proptest::prelude::*;

use super::naive::{Range, Wff, schema, settings, wff};

/// Samples at whole seconds, not all of them.
type Sample = (usize, [f64; 3]);

fn samples(longest: usize) -> impl Strategy<Value = Vec<Sample>> {
    let value = || (-8..9i32).prop_map(|v| f64::from(v) / 4.0);
    let row = (1..4usize, value(), value(), any::<bool>());
    prop::collection::vec(row, 1..longest).prop_map(|rows| {
        let mut time = 0;
        let rows = rows.into_iter().enumerate().map(|(i, (gap, x, y, on))| {
            time += if i == 0 { 0 } else { gap };
            (time, [x, y, f64::from(u8::from(on))])
        });
        rows.collect()
    })
}

fn dense(samples: &[Sample], interpolation: Interpolation) -> DenseTrace {
    let mut trace = DenseTrace::new(Arc::new(schema()), interpolation);
    for (time, row) in samples {
        trace.push(*time as f64, row).unwrap();
    }
    trace
}

/// A second has `scale` places: even places are instants, odd ones the intervals
/// between them.
struct Grid<'a> {
    samples: &'a [Sample],
    interpolation: Interpolation,
    scale: usize,
    closed: bool,
}

impl Grid<'_> {
    fn len(&self) -> usize {
        self.samples[self.samples.len() - 1].0 * self.scale + 1
    }

    fn row(&self, place: usize) -> [f64; 3] {
        let before = |sample: &&Sample| sample.0 * self.scale <= place;
        let i = self.samples.iter().take_while(before).count() - 1;
        let (time, row) = self.samples[i];
        match (self.interpolation, self.samples.get(i + 1)) {
            (Interpolation::Linear, Some((next, later))) => {
                let part = (place - time * self.scale) as f64 / ((next - time) * self.scale) as f64;
                let at = |k: usize| row[k] + (later[k] - row[k]) * part;
                [at(0), at(1), row[2]]
            }
            _ => row,
        }
    }

    fn ahead(&self, place: usize, range: Range) -> std::ops::Range<usize> {
        let end = range
            .to
            .map_or(self.len(), |to| place + to * self.scale + 1);
        place + range.from * self.scale..end.min(self.len())
    }

    fn behind(&self, place: usize, range: Range) -> std::ops::Range<usize> {
        let start = range
            .to
            .map_or(0, |to| place.saturating_sub(to * self.scale));
        start..(place + 1).saturating_sub(range.from * self.scale)
    }

    /// Returns true if the left side of an until must hold at the place of its goal.
    fn holds_at(&self, goal: usize, start: usize) -> bool {
        self.closed || (goal % 2 == 1 && goal != start)
    }

    fn until(&self, range: Range, guard: &[f64], goal: &[f64]) -> Vec<f64> {
        let at = |place: usize| {
            let mut best = f64::NEG_INFINITY;
            let (mut held, mut next) = (f64::INFINITY, place);
            for g in self.ahead(place, range) {
                while next < g {
                    held = held.min(guard[next]);
                    next += 1;
                }
                let own = if self.holds_at(g, place) {
                    guard[g]
                } else {
                    f64::INFINITY
                };
                best = best.max(goal[g].min(held).min(own));
            }
            best
        };
        (0..self.len()).map(at).collect()
    }

    fn since(&self, range: Range, guard: &[f64], goal: &[f64]) -> Vec<f64> {
        let at = |place: usize| {
            let mut best = f64::NEG_INFINITY;
            for g in self.behind(place, range) {
                let held = guard[g + 1..=place]
                    .iter()
                    .copied()
                    .fold(f64::INFINITY, f64::min);
                let own = if self.holds_at(g, place) {
                    guard[g]
                } else {
                    f64::INFINITY
                };
                best = best.max(goal[g].min(held).min(own));
            }
            best
        };
        (0..self.len()).map(at).collect()
    }

    /// The values at all places, `None` for a formula with steps between samples.
    fn values(&self, wff: &Wff) -> Option<Vec<f64>> {
        let operands: Option<Vec<Vec<f64>>> = wff.operands().map(|a| self.values(a)).collect();
        let operands = operands?;
        let each = |f: &dyn Fn(usize) -> f64| (0..self.len()).map(f).collect::<Vec<_>>();
        let least = |places: std::ops::Range<usize>| {
            places.map(|p| operands[0][p]).fold(f64::INFINITY, f64::min)
        };
        let most = |places: std::ops::Range<usize>| {
            places
                .map(|p| operands[0][p])
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let compare = |op: &str, d: f64| match op {
            "<" | "<=" => -d,
            ">" | ">=" => d,
            "==" => -d.abs(),
            _ => d.abs(),
        };
        let not = |values: &[f64]| values.iter().map(|v| -v).collect::<Vec<_>>();
        let sign = |on: bool| if on { f64::INFINITY } else { f64::NEG_INFINITY };
        Some(match wff {
            Wff::True => each(&|_| f64::INFINITY),
            Wff::On => each(&|p| sign(self.row(p)[2] != 0.0)),
            Wff::X(op, c) => each(&|p| compare(op, self.row(p)[0] - f64::from(*c))),
            Wff::Both(op, c) => each(&|p| {
                let row = self.row(p);
                compare(op, row[0] - 2.0 * row[1] - f64::from(*c))
            }),
            Wff::Signals(op) => each(&|p| compare(op, self.row(p)[0] - self.row(p)[1])),
            Wff::Ratio(..) | Wff::Step(..) => return None,
            Wff::Not(_) => not(&operands[0]),
            Wff::Gate(op, ..) => {
                let (a, b) = (&operands[0], &operands[1]);
                each(&|p| match *op {
                    "and" => a[p].min(b[p]),
                    "or" => a[p].max(b[p]),
                    "implies" => (-a[p]).max(b[p]),
                    "iff" => (-a[p]).max(b[p]).min(a[p].max(-b[p])),
                    _ => a[p].max(b[p]).min((-a[p]).max(-b[p])),
                })
            }
            Wff::Window(op, range, _) => each(&|p| match *op {
                "always" => least(self.ahead(p, *range)),
                "eventually" => most(self.ahead(p, *range)),
                "historically" => least(self.behind(p, *range)),
                _ => most(self.behind(p, *range)),
            }),
            Wff::Pair(op, range, ..) => {
                let (a, b) = (&operands[0], &operands[1]);
                match *op {
                    "until" => self.until(*range, a, b),
                    "release" => not(&self.until(*range, &not(a), &not(b))),
                    "since" => self.since(*range, a, b),
                    _ => {
                        let until = self.until(*range, a, b);
                        let range = Range { from: 0, ..*range };
                        each(&|p| until[p].max(least(self.ahead(p, range))))
                    }
                }
            }
        })
    }
}

fn agrees(
    wff: &Wff,
    samples: &[Sample],
    interpolation: Interpolation,
    (scale, tolerance): (usize, f64),
    closed: bool,
) -> Result<(), TestCaseError> {
    let until = if closed {
        Until::Closed
    } else {
        Until::HalfOpen
    };
    let monitor = wff.monitor(&settings(until, TraceEnd::Truncate));
    let got = monitor.robustness_dense(&dense(samples, interpolation));
    let grid = Grid {
        samples,
        interpolation,
        scale,
        closed,
    };
    match grid.values(wff) {
        None => {
            let refused = matches!(got, Err(DenseError::Step { .. }));
            prop_assert!(refused, "{}", wff.text());
        }
        Some(want) => {
            let got = got.unwrap();
            let close = got == want[0] || (got - want[0]).abs() <= tolerance;
            prop_assert!(close, "{} not {} of {}", got, want[0], wff.text());
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(super::cases(5000))]

    /// Values are constant at every place, so the grid is exact.
    #[test]
    fn constant_signals_are_exact(wff in wff(), samples in samples(9), closed in any::<bool>()) {
        agrees(&wff, &samples, Interpolation::Constant, (2, 0.0), closed)?;
    }
}

proptest! {
    #![proptest_config(super::cases(300))]

    /// The grid misses extrema between its instants by less than a step at most.
    #[test]
    fn linear_signals_are_exact(wff in wff(), samples in samples(5), closed in any::<bool>()) {
        agrees(&wff, &samples, Interpolation::Linear, (64, 0.25), closed)?;
    }
}

fn line(interpolation: Interpolation, samples: &[(f64, f64)]) -> DenseTrace {
    let schema = Schema::new(0.5, [Signal::real("x", "", "a number")]).unwrap();
    let mut trace = DenseTrace::new(schema.into(), interpolation);
    for (time, x) in samples {
        trace.push(*time, &[*x]).unwrap();
    }
    trace
}

fn rho(text: &str, trace: &DenseTrace) -> Result<f64, DenseError> {
    let schema = Schema::new(0.5, [Signal::real("x", "", "a number")]).unwrap();
    let formula: Formula = text.parse().unwrap();
    let monitor = formula.bind(&schema, &Constants::new()).unwrap();
    monitor.robustness_dense(trace)
}

#[test]
fn extrema_between_samples_are_found() {
    let samples = [(0.25, 0.0), (1.75, 3.0), (2.25, 2.0), (7.25, 7.0)];
    let linear = line(Interpolation::Linear, &samples);
    let constant = line(Interpolation::Constant, &samples);
    // Times count from the first sample: x(0.75) = 1 and x(1.25) = 2.
    for (text, on_lines, in_steps) in [
        ("always[0.5, 1] (x > 0)", 1.0, 0.0),
        ("eventually[0.5, 1] (x > 0)", 2.0, 0.0),
        ("eventually[0.5, 1.5] (x > 0)", 3.0, 3.0),
        // min(x, 2 − x) is greatest where both are 1.
        ("eventually (x > 0 and x < 2)", 1.0, 0.0),
        ("always (x > 1 or x < 1)", 0.0, 1.0),
        ("eventually (x == 5)", 0.0, -2.0),
        ("always[0.5, 1.5] (x != 1.5)", 0.0, 1.5),
        // x rises with slope 2 before the goal.
        ("(x < 2) until (x > 1)", 0.5, 2.0),
        ("always[7, 8] (x > 6)", 1.0, 1.0),
        ("always[7.5, 8] (x > 6)", f64::INFINITY, f64::INFINITY),
        ("eventually[7, end] once[1, 2] (x > 0)", 6.0, 2.0),
    ] {
        assert_eq!(rho(text, &linear), Ok(on_lines), "{text}");
        assert_eq!(rho(text, &constant), Ok(in_steps), "{text}");
    }
}

/// x rises to 4 while `on` is true, and falls from there when it no longer is.
#[test]
fn limits_at_jumps_count() {
    let samples = [
        (0, [0.0, 0.0, 1.0]),
        (2, [4.0, 0.0, 0.0]),
        (4, [0.0, 0.0, 0.0]),
    ];
    let trace = dense(&samples, Interpolation::Linear);
    for (text, want) in [
        ("eventually (x > 0 and on)", 4.0),
        ("eventually[0, 1] (x > 0 and on)", 2.0),
        ("eventually[4, 4] once (x > 0 and on)", 4.0),
        ("always (x < 0 or not on)", -4.0),
        ("eventually[3, 4] once[1, 2] (x > 0 and on)", 4.0),
        ("on until (x > 3.5)", 0.5),
        ("(x > -1) until (x > 3 and on)", 1.0),
        ("(x < 9) until (not on)", 5.0),
        ("eventually[4, 4] ((x < 9) since on)", 5.0),
    ] {
        let formula: Formula = text.parse().unwrap();
        let monitor = formula.bind(&schema(), &Constants::new()).unwrap();
        assert_eq!(monitor.robustness_dense(&trace), Ok(want), "{text}");
    }
}

#[test]
fn times_in_which_a_window_is_lost_do_not_panic() {
    let trace = line(Interpolation::Linear, &[(1.7e18, 1.0), (1.8e18, 3.0)]);
    assert_eq!(rho("always[0, 1] (x >= 0)", &trace), Ok(1.0));
    let single = line(Interpolation::Linear, &[(1.7e18, 1.0)]);
    assert_eq!(rho("always[0, 1] (x >= 0)", &single), Ok(1.0));
}

#[test]
fn what_has_no_dense_meaning_is_refused() {
    let linear = line(Interpolation::Linear, &[(0.0, 1.0), (0.1, 2.0)]);
    let constant = line(Interpolation::Constant, &[(0.0, 1.0), (0.1, 2.0)]);
    let formula = "next (x > 1)".to_owned();
    assert_eq!(rho(&formula, &linear), Err(DenseError::Step { formula }));
    let formula = "pow(x, 2) > 1".to_owned();
    assert_eq!(rho(&formula, &constant), Ok(0.0));
    assert_eq!(
        rho(&formula, &linear),
        Err(DenseError::NotLinear { formula })
    );
    let strict = Settings {
        end: TraceEnd::Strict,
        ..Settings::default()
    };
    let monitor = Wff::On.monitor(&strict);
    let samples = [(0, [0.0; 3])];
    let trace = dense(&samples, Interpolation::Constant);
    assert_eq!(monitor.robustness_dense(&trace), Err(DenseError::End));

    let mut trace = linear;
    for time_s in [0.1, -1.0, f64::NAN, f64::INFINITY] {
        let error = trace.push(time_s, &[1.0]);
        assert!(matches!(error, Err(DenseRowError::Time { sample: 2, .. })));
    }
    assert!(matches!(
        trace.push(0.2, &[f64::NAN]),
        Err(DenseRowError::Row(_))
    ));
    assert_eq!(trace.len(), 2);
    assert_eq!(
        rho("x > 0", &line(Interpolation::Linear, &[])),
        Ok(f64::NEG_INFINITY)
    );
}
