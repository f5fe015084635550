//! Bound arithmetic and comparisons: whole columns at a time, or one row.
//!
//! Both ways do the same operations in the same order, so that a monitor that
//! is fed sample by sample ends with the same bits as one that sees it all.

use super::monitor::Interval;
use super::range::{absolute, negated};
use super::syntax::{Arithmetic, Comparison, Function};

/// Samples that are evaluated at a time; a few buffers of it fit the L1 cache.
pub(crate) const CHUNK: usize = 512;

/// Where the values of a signal come from.
pub(crate) trait Columns {
    fn column(&self, signal: usize) -> &[f64];
}

impl Columns for crate::trace::Trace {
    fn column(&self, signal: usize) -> &[f64] {
        crate::trace::Trace::column(self, signal)
    }
}

impl Columns for Vec<Vec<f64>> {
    fn column(&self, signal: usize) -> &[f64] {
        &self[signal]
    }
}

/// An expression whose names are bound to signals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Number(f64),
    Signal(usize),
    Negative(Box<Value>),
    Calculated(Arithmetic, Box<(Value, Value)>),
    Call(Function, Vec<Value>),
}

impl Value {
    /// The value in one row.
    pub(crate) fn at(&self, row: &[f64]) -> f64 {
        match self {
            Value::Number(value) => *value,
            Value::Signal(signal) => row[*signal],
            Value::Negative(a) => -a.at(row),
            Value::Calculated(op, sides) => calculate(*op, sides.0.at(row), sides.1.at(row)),
            Value::Call(Function::Min, all) => {
                all.iter().map(|a| a.at(row)).reduce(smaller).unwrap_or(0.0)
            }
            Value::Call(Function::Max, all) => {
                all.iter().map(|a| a.at(row)).reduce(larger).unwrap_or(0.0)
            }
            Value::Call(function, all) => {
                let argument = |i: usize| all.get(i).map_or(0.0, |a| a.at(row));
                match function {
                    Function::Pow => libm::pow(argument(0), argument(1)),
                    _ => apply(*function, argument(0)),
                }
            }
        }
    }

    /// The values at samples `from ..` of the columns, at most [`CHUNK`] of them.
    pub(crate) fn fill(&self, columns: &impl Columns, from: usize, out: &mut [f64]) {
        debug_assert!(out.len() <= CHUNK);
        let len = out.len();
        match self {
            Value::Number(value) => out.fill(*value),
            Value::Signal(signal) => {
                out.copy_from_slice(&columns.column(*signal)[from..from + len])
            }
            Value::Negative(a) => {
                a.fill(columns, from, out);
                out.iter_mut().for_each(|v| *v = -*v);
            }
            Value::Calculated(op, sides) => {
                sides.0.fill(columns, from, out);
                sides.1.with(columns, from, len, |right| match op {
                    Arithmetic::Add => zip(out, right, |a, b| a + b),
                    Arithmetic::Subtract => zip(out, right, |a, b| a - b),
                    Arithmetic::Multiply => zip(out, right, |a, b| a * b),
                    Arithmetic::Divide => zip(out, right, |a, b| a / b),
                });
            }
            Value::Call(function, all) => {
                let mut all = all.iter();
                if let Some(first) = all.next() {
                    first.fill(columns, from, out);
                }
                match function {
                    Function::Min => {
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, smaller)))
                    }
                    Function::Max => {
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, larger)))
                    }
                    Function::Pow => {
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, libm::pow)))
                    }
                    _ => out.iter_mut().for_each(|v| *v = apply(*function, *v)),
                }
            }
        }
    }

    /// Hands the values to `use_them`, without a copy where it is a signal.
    fn with(
        &self,
        columns: &impl Columns,
        from: usize,
        len: usize,
        use_them: impl FnOnce(Operand<'_>),
    ) {
        match self {
            Value::Number(value) => use_them(Operand::Number(*value)),
            Value::Signal(signal) => {
                use_them(Operand::Column(&columns.column(*signal)[from..from + len]))
            }
            _ => {
                let mut values = [0.0; CHUNK];
                self.fill(columns, from, &mut values[..len]);
                use_them(Operand::Column(&values[..len]));
            }
        }
    }

    /// Calls `visit` with every signal that is read.
    pub(crate) fn signals(&self, visit: &mut impl FnMut(usize)) {
        match self {
            Value::Number(_) => {}
            Value::Signal(signal) => visit(*signal),
            Value::Negative(a) => a.signals(visit),
            Value::Calculated(_, sides) => {
                sides.0.signals(visit);
                sides.1.signals(visit);
            }
            Value::Call(_, all) => all.iter().for_each(|a| a.signals(visit)),
        }
    }

    /// Whether finite signals can give something that is not a number.
    fn can_be_nan(&self) -> bool {
        match self {
            Value::Number(_) | Value::Signal(_) => false,
            Value::Negative(a) => a.can_be_nan(),
            Value::Call(Function::Abs | Function::Min | Function::Max, all) => {
                all.iter().any(Value::can_be_nan)
            }
            // A sum of two signals can be infinite, but not NaN; deeper ones can.
            Value::Calculated(Arithmetic::Add | Arithmetic::Subtract, sides) => {
                !(sides.0.is_finite() && sides.1.is_finite())
            }
            _ => true,
        }
    }

    fn is_finite(&self) -> bool {
        match self {
            Value::Number(_) | Value::Signal(_) => true,
            Value::Negative(a) => a.is_finite(),
            Value::Call(Function::Abs | Function::Min | Function::Max, all) => {
                all.iter().all(Value::is_finite)
            }
            _ => false,
        }
    }
}

enum Operand<'a> {
    Number(f64),
    Column(&'a [f64]),
}

fn zip(out: &mut [f64], right: Operand<'_>, op: impl Fn(f64, f64) -> f64) {
    match right {
        Operand::Number(b) => out.iter_mut().for_each(|a| *a = op(*a, b)),
        Operand::Column(b) => out.iter_mut().zip(b).for_each(|(a, b)| *a = op(*a, *b)),
    }
}

fn calculate(op: Arithmetic, a: f64, b: f64) -> f64 {
    match op {
        Arithmetic::Add => a + b,
        Arithmetic::Subtract => a - b,
        Arithmetic::Multiply => a * b,
        Arithmetic::Divide => a / b,
    }
}

fn apply(function: Function, a: f64) -> f64 {
    match function {
        Function::Sqrt => a.sqrt(),
        // libm's, so that every machine gives the same bits.
        Function::Exp => libm::exp(a),
        _ => a.abs(),
    }
}

pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if b < a { a } else { b }
}

/// A comparison or a Boolean signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Leaf {
    /// `left − right` for ≥, >, ==, != and `right − left` for ≤, <.
    difference: Value,
    shape: Shape,
    can_be_nan: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    AtLeast,
    MoreThan,
    Equal,
    NotEqual,
    Boolean,
}

/// What a leaf is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Question {
    /// How far from changing: the robustness.
    Margin,
    /// 1 where it is true, −1 where not: `>` and `≥` differ.
    Truth,
}

impl Leaf {
    pub(crate) fn compare(left: Value, op: Comparison, right: Value) -> Leaf {
        let (shape, sides) = match op {
            Comparison::GreaterEqual => (Shape::AtLeast, (left, right)),
            Comparison::Greater => (Shape::MoreThan, (left, right)),
            Comparison::LessEqual => (Shape::AtLeast, (right, left)),
            Comparison::Less => (Shape::MoreThan, (right, left)),
            Comparison::Equal => (Shape::Equal, (left, right)),
            Comparison::NotEqual => (Shape::NotEqual, (left, right)),
        };
        let difference = Value::Calculated(Arithmetic::Subtract, Box::new(sides));
        let can_be_nan = difference.can_be_nan();
        Leaf {
            difference,
            shape,
            can_be_nan,
        }
    }

    pub(crate) fn boolean(signal: usize) -> Leaf {
        Leaf {
            difference: Value::Signal(signal),
            shape: Shape::Boolean,
            can_be_nan: false,
        }
    }

    /// What the robustness is worked out from.
    pub(crate) fn difference(&self) -> &Value {
        &self.difference
    }

    /// The robustness, given a range of the difference.
    pub(crate) fn margins(&self, difference: Interval) -> Interval {
        match self.shape {
            Shape::AtLeast | Shape::MoreThan => difference,
            Shape::Equal => negated(absolute(difference)),
            Shape::NotEqual => absolute(difference),
            Shape::Boolean if !difference.contains(0.0) => Interval {
                lo: f64::INFINITY,
                hi: f64::INFINITY,
            },
            Shape::Boolean => Interval::ANY,
        }
    }

    /// The robustness in one row.
    pub(crate) fn at(&self, row: &[f64]) -> f64 {
        // The common leaf, `signal ≥ number`, without the walk over the tree.
        if let (Shape::AtLeast | Shape::MoreThan, Value::Calculated(_, sides)) =
            (self.shape, &self.difference)
        {
            match **sides {
                (Value::Signal(a), Value::Number(b)) => return row[a] - b,
                (Value::Number(a), Value::Signal(b)) => return a - row[b],
                (Value::Signal(a), Value::Signal(b)) => return row[a] - row[b],
                _ => {}
            }
        }
        let margin = self.shape.margin(self.difference.at(row));
        if margin.is_nan() {
            f64::NEG_INFINITY
        } else {
            margin
        }
    }

    /// The answers at samples `from ..` of the columns.
    pub(crate) fn fill(
        &self,
        columns: &impl Columns,
        question: Question,
        from: usize,
        out: &mut [f64],
    ) {
        for (i, out) in out.chunks_mut(CHUNK).enumerate() {
            self.difference.fill(columns, from + i * CHUNK, out);
            let shape = self.shape;
            match question {
                Question::Truth => out.iter_mut().for_each(|v| *v = shape.truth(*v)),
                Question::Margin => match shape {
                    Shape::AtLeast | Shape::MoreThan => {}
                    Shape::Equal => out.iter_mut().for_each(|v| *v = -v.abs()),
                    Shape::NotEqual => out.iter_mut().for_each(|v| *v = v.abs()),
                    Shape::Boolean => out.iter_mut().for_each(|v| *v = Shape::Boolean.margin(*v)),
                },
            }
            if self.can_be_nan && question == Question::Margin {
                // What cannot be computed does not hold.
                out.iter_mut()
                    .for_each(|v| *v = if v.is_nan() { f64::NEG_INFINITY } else { *v });
            }
        }
    }

    pub(crate) fn signals(&self, visit: &mut impl FnMut(usize)) {
        self.difference.signals(visit);
    }
}

impl Shape {
    fn margin(self, difference: f64) -> f64 {
        match self {
            Shape::AtLeast | Shape::MoreThan => difference,
            Shape::Equal => -difference.abs(),
            Shape::NotEqual => difference.abs(),
            Shape::Boolean if difference != 0.0 => f64::INFINITY,
            Shape::Boolean => f64::NEG_INFINITY,
        }
    }

    fn truth(self, difference: f64) -> f64 {
        let holds = match self {
            Shape::AtLeast => 0.0 <= difference,
            Shape::MoreThan => 0.0 < difference,
            Shape::Equal => difference == 0.0,
            // NaN differs from everything, and still does not hold.
            Shape::NotEqual => difference < 0.0 || 0.0 < difference,
            Shape::Boolean => difference != 0.0,
        };
        if holds { 1.0 } else { -1.0 }
    }
}
