//! Formulas that a few running numbers decide, sample by sample or in blocks.
//!
//! Most rules are `always (x <= c)` or an `until` of comparisons, over a run of known
//! length. Their robustness at sample 0 is a running extremum. Such a formula is
//! compiled to a list of *instants*, whose value is known as soon as their sample is,
//! and *points*, the operators at sample 0 that fold them. All that a run has to
//! remember is one number for each.
//!
//! The operations and their order are those of [`OnlineMonitor`](crate::OnlineMonitor).
//! Its property tests hold the two together, bit for bit.

use crate::interval::Interval;
use crate::leaf::Leaf;
use crate::monitor::Monitor;
use crate::program::{BooleanOp, Edge, MinMax, Strength};
use crate::settings::Until;
use crate::sliding::UntilPart;
use crate::trace_operators::{Extremum, Max, Min, SampleWindow, opposite};

mod block;
mod compile;

pub use block::SampleColumns;

/// Monitor of a run of known length, whose whole memory is a short list of numbers.
///
/// Created by [`Monitor::running`]. It has no state of its own: you keep the numbers
/// of each run, [`RunningMonitor::numbers`] of them, and the count of its samples.
#[derive(Clone, Debug)]
pub struct RunningMonitor {
    monitor: Monitor,
    /// Number of samples of a full run.
    len: usize,
    /// In the order of evaluation. RunningInstant i has its latest value in number i.
    instants: Vec<RunningInstant>,
    points: Vec<RunningPoint>,
    root: usize,
    /// Numbers before the first sample: one per instant, then those carried on.
    begin: Vec<f64>,
    /// The instant and the number of an `always` over the whole run, if that is all.
    extremum: Option<(usize, usize)>,
}

/// Operator whose value at a sample needs no later sample.
#[derive(Clone, Debug)]
enum RunningInstant {
    Constant(f64),
    Leaf(Leaf),
    Not(usize),
    Gate(BooleanOp, usize, usize),
    /// Carries the operand's value of the last sample, negated by a fall.
    Edge(Edge, usize, usize),
    /// Carries its own value of the last sample.
    Since(usize, usize, usize),
    /// `historically` or `once` since the start. Carries its own last value.
    Past(MinMax, usize, usize),
}

/// Operator at sample 0.
#[derive(Clone, Debug)]
enum RunningPoint {
    /// Value of an instant at the first sample, kept in a number.
    First {
        instant: usize,
        kept: usize,
    },
    Window {
        side: MinMax,
        window: SampleWindow,
        instant: usize,
        folded: usize,
    },
    Until {
        side: MinMax,
        strength: Strength,
        window: SampleWindow,
        guard: usize,
        goal: usize,
        /// Number with the best value so far. The next one has the guard's extremum.
        best: usize,
    },
    Not(usize),
    Gate(BooleanOp, usize, usize),
}

#[inline(always)]
fn pick(side: MinMax, a: f64, b: f64) -> f64 {
    match side {
        MinMax::Min => Min::pick(a, b),
        MinMax::Max => Max::pick(a, b),
    }
}

fn dual(side: MinMax) -> MinMax {
    match side {
        MinMax::Min => MinMax::Max,
        MinMax::Max => MinMax::Min,
    }
}

/// Returns the value of a rise or a fall, and the number that it carries on.
#[inline(always)]
fn edge_at(edge: Edge, value: f64, before: f64) -> (f64, f64) {
    let current = match edge {
        Edge::Rise => value,
        Edge::Fall => opposite(value),
    };
    // −inf before the first sample makes its opposite hold, as a weak `prev` does.
    (Min::pick(opposite(before), current), current)
}

#[inline(always)]
fn since_at(until: Until, guard: f64, goal: f64, before: f64) -> f64 {
    let goal = if until == Until::Closed {
        Min::pick(guard, goal)
    } else {
        goal
    };
    Max::pick(goal, Min::pick(guard, before))
}

/// Advances an until by a sample.
#[inline(always)]
fn until_at(
    side: MinMax,
    until: Until,
    is_in_window: bool,
    guard: f64,
    goal: f64,
    so_far: UntilPart,
) -> UntilPart {
    let dual = dual(side);
    let goal = if until == Until::Closed {
        pick(dual, guard, goal)
    } else {
        goal
    };
    let best = if is_in_window {
        pick(side, so_far.best, pick(dual, goal, so_far.guard))
    } else {
        so_far.best
    };
    UntilPart {
        best,
        guard: pick(dual, so_far.guard, guard),
    }
}

/// Returns whether samples of a window are still to come, after `known` of `len`.
#[inline(always)]
fn is_open(window: SampleWindow, known: usize, len: usize) -> bool {
    known < len && window.from < len && window.to.is_none_or(|to| known <= to)
}

/// Opens the end of an interval that samples to come can move.
#[inline(always)]
fn opened(side: MinMax, interval: Interval) -> Interval {
    match side {
        MinMax::Min => Interval {
            lo: f64::NEG_INFINITY,
            ..interval
        },
        MinMax::Max => Interval {
            hi: f64::INFINITY,
            ..interval
        },
    }
}

impl RunningMonitor {
    /// Returns how many numbers a run has.
    pub fn numbers(&self) -> usize {
        self.begin.len()
    }

    /// Writes the numbers of a run without samples.
    ///
    /// # Panics
    /// `numbers` has another length than [`RunningMonitor::numbers`].
    pub fn begin(&self, numbers: &mut [f64]) {
        numbers.copy_from_slice(&self.begin);
    }

    /// Reads sample `sample`, counted from 0, and returns the possible values.
    ///
    /// The row must be one that [`Trace::push`](crate::trace::Trace::push) accepts:
    /// it is not checked. Samples beyond the length of the run must not be pushed.
    ///
    /// # Panics
    /// The row or the numbers are too short.
    pub fn push(&self, numbers: &mut [f64], sample: usize, row: &[f64]) -> Interval {
        let until = self.monitor.settings.until;
        // Operands come first, so every read is of the present sample.
        for (i, instant) in self.instants.iter().enumerate() {
            numbers[i] = match *instant {
                RunningInstant::Constant(value) => value,
                RunningInstant::Leaf(ref leaf) => leaf.at(row),
                RunningInstant::Not(a) => opposite(numbers[a]),
                RunningInstant::Gate(gate, a, b) => {
                    let (a, b) = (numbers[a], numbers[b]);
                    gate.at(a, a, b, b)
                }
                RunningInstant::Edge(edge, a, carried) => {
                    let (value, carry) = edge_at(edge, numbers[a], numbers[carried]);
                    numbers[carried] = carry;
                    value
                }
                RunningInstant::Since(a, b, carried) => {
                    numbers[carried] = since_at(until, numbers[a], numbers[b], numbers[carried]);
                    numbers[carried]
                }
                RunningInstant::Past(side, a, carried) => {
                    numbers[carried] = pick(side, numbers[carried], numbers[a]);
                    numbers[carried]
                }
            };
        }
        for point in &self.points {
            match *point {
                // Outside of all windows a formula is about the first sample only.
                RunningPoint::First { instant, kept } if sample == 0 => {
                    numbers[kept] = numbers[instant]
                }
                RunningPoint::First { .. } | RunningPoint::Not(_) | RunningPoint::Gate(..) => {}
                RunningPoint::Window {
                    side,
                    window,
                    instant,
                    folded,
                } => {
                    if window.from <= sample && window.to.is_none_or(|to| sample <= to) {
                        numbers[folded] = pick(side, numbers[folded], numbers[instant]);
                    }
                }
                RunningPoint::Until {
                    side,
                    window,
                    guard,
                    goal,
                    best,
                    ..
                } => {
                    // Samples before the window count, too: the guard must hold there.
                    if window.to.is_none_or(|to| sample <= to) {
                        let so_far = UntilPart {
                            best: numbers[best],
                            guard: numbers[best + 1],
                        };
                        let is_in_window = window.from <= sample;
                        let (guard, goal) = (numbers[guard], numbers[goal]);
                        let now = until_at(side, until, is_in_window, guard, goal, so_far);
                        (numbers[best], numbers[best + 1]) = (now.best, now.guard);
                    }
                }
            }
        }
        self.interval(numbers, sample + 1)
    }

    /// Returns the possible values after the first `known` samples.
    pub fn interval(&self, numbers: &[f64], known: usize) -> Interval {
        if known == 0 {
            return Interval::ANY.map(|value| self.monitor.clamp(value));
        }
        let interval = self.bounds(self.root, &|i| numbers[i], known, self.len);
        interval.map(|value| self.monitor.clamp(value))
    }

    /// Clears the numbers that no later sample reads.
    ///
    /// Two runs whose numbers are then equal have equal values from here on, whatever
    /// samples follow.
    pub fn normalize(&self, numbers: &mut [f64]) {
        // Each instant is written before it is read, at every sample.
        numbers[..self.instants.len()].fill(0.0);
    }

    /// Returns the number with the least value so far, for an `always` over the whole
    /// run of one comparison. `None` for any other formula.
    pub fn least(&self) -> Option<usize> {
        self.extremum.map(|(_, folded)| folded)
    }

    /// Returns the robustness of a run that ends after `known` samples.
    ///
    /// That of [`Monitor::robustness`] for the trace of these samples, bit for bit.
    pub fn ended(&self, numbers: &[f64], known: usize) -> f64 {
        self.ended_of(&|i| numbers[i], known)
    }

    #[inline(always)]
    fn ended_of(&self, number: &impl Fn(usize) -> f64, known: usize) -> f64 {
        if known == 0 {
            // No sample is no evidence, as for an empty trace.
            return self.monitor.clamp(f64::NEG_INFINITY);
        }
        // Nothing is to come after an end, so both bounds are equal.
        let value = self.bounds(self.root, number, known, known).lo;
        self.monitor.clamp(value)
    }

    /// Returns the interval of a point after `known` samples of a run of `len`.
    fn bounds(
        &self,
        point: usize,
        number: &impl Fn(usize) -> f64,
        known: usize,
        len: usize,
    ) -> Interval {
        match self.points[point] {
            RunningPoint::First { kept, .. } => Interval::exactly(number(kept)),
            RunningPoint::Window {
                side,
                window,
                folded,
                ..
            } => {
                let interval = Interval::exactly(number(folded));
                if is_open(window, known, len) {
                    opened(side, interval)
                } else {
                    interval
                }
            }
            RunningPoint::Until {
                side,
                strength,
                window,
                best,
                ..
            } => {
                let so_far = UntilPart {
                    best: number(best),
                    guard: number(best + 1),
                };
                until_bounds(side, strength, window, so_far, known, len)
            }
            RunningPoint::Not(a) => self.bounds(a, number, known, len).negated(),
            RunningPoint::Gate(gate, a, b) => {
                let a = self.bounds(a, number, known, len);
                let b = self.bounds(b, number, known, len);
                Interval {
                    lo: gate.at(a.lo, a.hi, b.lo, b.hi),
                    hi: gate.at(a.hi, a.lo, b.hi, b.lo),
                }
            }
        }
    }
}

fn until_bounds(
    side: MinMax,
    strength: Strength,
    window: SampleWindow,
    so_far: UntilPart,
    known: usize,
    len: usize,
) -> Interval {
    let UntilPart { best, guard: held } = so_far;
    let mut interval = Interval::exactly(best);
    if is_open(window, known, len) {
        // The goal may still occur, as long as the left side has held so far.
        match side {
            MinMax::Max => interval.hi = Max::pick(interval.hi, held),
            MinMax::Min => interval.lo = Min::pick(interval.lo, held),
        }
    }
    if strength == Strength::Weak {
        // The left side counts from the present on, not from the window's start.
        let throughout = SampleWindow { from: 0, ..window };
        let mut weak = Interval::exactly(held);
        if is_open(throughout, known, len) {
            weak = opened(dual(side), weak);
        }
        interval = Interval {
            lo: pick(side, interval.lo, weak.lo),
            hi: pick(side, interval.hi, weak.hi),
        };
    }
    interval
}
