//! Possible robustness for given ranges of the signals.

use crate::bind::BoundExpr;
use crate::interval::Interval;
use crate::leaf::{BoundExpression, Leaf};
use crate::monitor::Monitor;
use crate::program::{MinMax, Op, Strength};
use crate::settings::TraceEnd;
use crate::syntax::{Arithmetic, Function};
use crate::trace_operators::{Extremum, Max, Min};

impl Monitor {
    /// Bounds ρ(φ, s, 0) over all traces whose signals stay within ranges.
    ///
    /// `ranges` has an entry per signal of the schema. The bounds are safe but not
    /// tight, by interval arithmetic: a signal mentioned twice counts as two.
    ///
    /// # Panics
    /// `ranges` has fewer entries than the bound schema has signals.
    pub fn range(&self, ranges: &[Interval]) -> Interval {
        assert!(
            self.program.schema.len() <= ranges.len(),
            "a range per signal"
        );
        let mut known: Vec<Interval> = Vec::with_capacity(self.program.instructions.len());
        let is_strict = self.settings.end == TraceEnd::Strict;
        for instruction in &self.program.instructions {
            let op = &instruction.op;
            // Samples behind the end are unknown, so a window may have any value there.
            let is_open = matches!(op, Op::Ahead(..) | Op::Until(..))
                && op.window().and_then(|it| it.to).is_some_and(|to| to > 0);
            known.push(if is_strict && is_open {
                Interval::ANY
            } else {
                range_of(op, &known, ranges)
            });
        }
        let whole = known.last().copied().unwrap_or(Interval::ANY);
        whole.map(|value| self.clamp(value))
    }
}

impl BoundExpr {
    /// Bounds the value over all rows whose signals stay within ranges.
    ///
    /// # Panics
    /// `ranges` has fewer entries than the bound schema has signals.
    pub fn range(&self, ranges: &[Interval]) -> Interval {
        range_of_value(&self.value, ranges).unwrap_or(Interval::ANY)
    }
}

fn range_of(op: &Op, known: &[Interval], ranges: &[Interval]) -> Interval {
    match *op {
        Op::Constant(true) => Interval::exactly(f64::INFINITY),
        Op::Constant(false) => Interval::exactly(f64::NEG_INFINITY),
        Op::Leaf(ref leaf) => range_of_leaf(leaf, ranges),
        Op::Not(a) => known[a].negated(),
        Op::Gate(gate, a, b) => {
            let (a, b) = (known[a], known[b]);
            Interval {
                lo: gate.at(a.lo, a.hi, b.lo, b.hi),
                hi: gate.at(a.hi, a.lo, b.hi, b.lo),
            }
        }
        // Windows that begin later can be empty. Then `always` is +inf and `eventually`
        // is −inf.
        Op::Ahead(side, window, a) | Op::Behind(side, window, a) => match side {
            _ if window.from == 0 => known[a],
            MinMax::Min => Interval {
                hi: f64::INFINITY,
                ..known[a]
            },
            MinMax::Max => Interval {
                lo: f64::NEG_INFINITY,
                ..known[a]
            },
        },
        // A window from 0 contains the present sample, so it is never empty.
        Op::Until(_, strength, window, a, b) => {
            let both = union(known[a], known[b]);
            match (window.from, strength) {
                (0, _) => both,
                (_, Strength::Strong) => Interval::ANY,
                (_, Strength::Weak) => Interval {
                    hi: f64::INFINITY,
                    ..both
                },
            }
        }
        Op::Since(window, a, b) if window.from == 0 => union(known[a], known[b]),
        // A later window may be empty, and an edge compares with `prev` at the start.
        Op::Since(..) | Op::Edge(..) => Interval::ANY,
    }
}

fn range_of_leaf(leaf: &Leaf, ranges: &[Interval]) -> Interval {
    // An undefined comparison counts as −inf, or as inf under a negation.
    let Some(difference) = range_of_value(leaf.difference(), ranges) else {
        return Interval::ANY;
    };
    leaf.margins(difference)
}

/// Returns the range of a value, `None` if the value can be NaN.
fn range_of_value(value: &BoundExpression, ranges: &[Interval]) -> Option<Interval> {
    let range = match value {
        BoundExpression::Number(value) => Interval::exactly(*value),
        BoundExpression::Signal(signal) => ranges[*signal],
        BoundExpression::Negative(a) => range_of_value(a, ranges)?.negated(),
        BoundExpression::Calculated(op, sides) => {
            let a = range_of_value(&sides.0, ranges)?;
            let b = range_of_value(&sides.1, ranges)?;
            // inf − inf and 0 · inf, although the signals themselves are finite.
            let unclear = value.can_be_nan();
            match op {
                Arithmetic::Add if unclear => of_corners(a, b, |x, y| x + y)?,
                Arithmetic::Add => Interval {
                    lo: a.lo + b.lo,
                    hi: a.hi + b.hi,
                },
                Arithmetic::Subtract if unclear => of_corners(a, b, |x, y| x - y)?,
                Arithmetic::Subtract => Interval {
                    lo: a.lo - b.hi,
                    hi: a.hi - b.lo,
                },
                Arithmetic::Multiply if unclear && (may_be_nan(a, b) || may_be_nan(b, a)) => {
                    return None;
                }
                Arithmetic::Multiply => of_corners(a, b, |x, y| x * y)?,
                // The quotient is unbounded near 0, and 0/0 is NaN.
                Arithmetic::Divide if b.contains(0.0) => return None,
                Arithmetic::Divide => of_corners(a, b, |x, y| x / y)?,
            }
        }
        BoundExpression::Call(function, all) => {
            let mut arguments = Vec::with_capacity(all.len());
            for argument in all {
                arguments.push(range_of_value(argument, ranges)?);
            }
            let first = *arguments.first()?;
            match function {
                Function::Min => arguments.into_iter().reduce(|a, b| Interval {
                    lo: Min::pick(a.lo, b.lo),
                    hi: Min::pick(a.hi, b.hi),
                })?,
                Function::Max => arguments.into_iter().reduce(|a, b| Interval {
                    lo: Max::pick(a.lo, b.lo),
                    hi: Max::pick(a.hi, b.hi),
                })?,
                Function::Abs => first.absolute(),
                // A square root of a negative number is NaN.
                Function::Sqrt if first.lo < 0.0 => return None,
                Function::Sqrt => first.map(f64::sqrt),
                Function::Exp => first.map(libm::exp),
                // Powers are not monotone in general, so corners would not bound them.
                Function::Pow => return None,
            }
        }
    };
    (!range.lo.is_nan() && !range.hi.is_nan()).then_some(range)
}

fn union(a: Interval, b: Interval) -> Interval {
    Interval {
        lo: Min::pick(a.lo, b.lo),
        hi: Max::pick(a.hi, b.hi),
    }
}

/// Returns true if 0 of `a` can be multiplied by an infinity of `b`.
fn may_be_nan(a: Interval, b: Interval) -> bool {
    a.contains(0.0) && (b.lo.is_infinite() || b.hi.is_infinite())
}

/// Returns the range of a monotone operation, `None` if a corner is NaN.
fn of_corners(a: Interval, b: Interval, op: impl Fn(f64, f64) -> f64) -> Option<Interval> {
    let corners = [
        op(a.lo, b.lo),
        op(a.lo, b.hi),
        op(a.hi, b.lo),
        op(a.hi, b.hi),
    ];
    if corners.iter().any(|corner| corner.is_nan()) {
        return None;
    }
    Some(Interval {
        lo: corners.into_iter().fold(f64::INFINITY, Min::pick),
        hi: corners.into_iter().fold(f64::NEG_INFINITY, Max::pick),
    })
}
