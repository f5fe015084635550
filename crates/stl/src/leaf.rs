//! Bound arithmetic and comparisons: whole columns at a time, or one row.
//!
//! Both ways do the same operations in the same order, so that a monitor that
//! is fed sample by sample ends with the same bits as one that sees it all.
//! For the same reason no margin is −0: which of 0 and −0 a minimum returns
//! depends on the order of its operands, and orders differ.

use crate::interval::Interval;
use crate::kernel::opposite;
use crate::syntax::{Arithmetic, Comparison, Function};

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
                all.iter().map(|a| a.at(row)).reduce(least).unwrap_or(0.0)
            }
            Value::Call(Function::Max, all) => all
                .iter()
                .map(|a| a.at(row))
                .reduce(greatest)
                .unwrap_or(0.0),
            Value::Call(function, all) => {
                let argument = |i: usize| all.get(i).map_or(0.0, |a| a.at(row));
                match function {
                    Function::Pow => power(argument(0), argument(1)),
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
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, least)))
                    }
                    Function::Max => {
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, greatest)))
                    }
                    Function::Pow => {
                        all.for_each(|a| a.with(columns, from, len, |b| zip(out, b, power)))
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
    pub(crate) fn can_be_nan(&self) -> bool {
        match self {
            Value::Number(_) | Value::Signal(_) => false,
            Value::Negative(a) => a.can_be_nan(),
            Value::Call(Function::Abs | Function::Min | Function::Max, all) => {
                all.iter().any(Value::can_be_nan)
            }
            // A sum or product of two signals can be infinite, but not NaN;
            // deeper ones can.
            Value::Calculated(
                Arithmetic::Add | Arithmetic::Subtract | Arithmetic::Multiply,
                sides,
            ) => !(sides.0.is_finite() && sides.1.is_finite()),
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

/// libm's, so that every machine gives the same bits; but 1 to the power of
/// what is no number is no number here, nor is that to the power of 0.
fn power(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        return f64::NAN;
    }
    libm::pow(a, b)
}

/// The smaller of two numbers; NaN if one of them is none, whichever it is.
fn least(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

/// The larger of two numbers; NaN if one of them is none, whichever it is.
fn greatest(a: f64, b: f64) -> f64 {
    if b < a || a.is_nan() { a } else { b }
}

/// A comparison or a Boolean signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Leaf {
    /// `left − right` for ≥, >, ==, != and `right − left` for ≤, <.
    difference: Value,
    shape: Shape,
    can_be_nan: bool,
    undefined: Undefined,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    AtLeast,
    MoreThan,
    Equal,
    NotEqual,
    Boolean,
}

/// What a comparison counts as where its difference is no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Undefined {
    /// The worst for a comparison that counts as it is.
    Fails,
    /// The worst under an odd number of negations.
    Holds,
}

impl Undefined {
    pub(crate) fn opposite(self) -> Undefined {
        match self {
            Undefined::Fails => Undefined::Holds,
            Undefined::Holds => Undefined::Fails,
        }
    }

    fn answer(self, question: Question) -> f64 {
        let magnitude = match question {
            Question::Margin => f64::INFINITY,
            Question::Truth => 1.0,
        };
        match self {
            Undefined::Fails => -magnitude,
            Undefined::Holds => magnitude,
        }
    }
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
        let sides = (unsigned(sides.0, 0.0), unsigned(sides.1, -0.0));
        let difference = Value::Calculated(Arithmetic::Subtract, Box::new(sides));
        let can_be_nan = difference.can_be_nan();
        Leaf {
            difference,
            shape,
            can_be_nan,
            undefined: Undefined::Fails,
        }
    }

    /// The same leaf with another answer where its difference is no number.
    pub(crate) fn counting(&self, undefined: Undefined) -> Leaf {
        Leaf {
            undefined,
            ..self.clone()
        }
    }

    /// Whether its difference can be no number for finite signals.
    pub(crate) fn can_be_undefined(&self) -> bool {
        self.can_be_nan
    }

    /// Whether its difference is no number at a sample of the columns.
    pub(crate) fn is_undefined(&self, columns: &impl Columns, sample: usize) -> bool {
        let mut difference = [0.0];
        self.difference.fill(columns, sample, &mut difference);
        difference[0].is_nan()
    }

    pub(crate) fn boolean(signal: usize) -> Leaf {
        Leaf {
            difference: Value::Signal(signal),
            shape: Shape::Boolean,
            can_be_nan: false,
            undefined: Undefined::Fails,
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
            Shape::Equal => difference.absolute().negated(),
            Shape::NotEqual => difference.absolute(),
            Shape::Boolean if !difference.contains(0.0) => Interval::exactly(f64::INFINITY),
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
                (Value::Signal(a), Value::Signal(b)) => return row[a] - row[b] + 0.0,
                _ => {}
            }
        }
        let margin = self.shape.margin(self.difference.at(row));
        match margin.is_nan() {
            true => self.undefined.answer(Question::Margin),
            false => margin,
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
        let shape = self.shape;
        for (i, out) in out.chunks_mut(CHUNK).enumerate() {
            self.difference.fill(columns, from + i * CHUNK, out);
            match (question, shape) {
                (Question::Truth, _) => each(out, |d| shape.truth(d)),
                (_, Shape::AtLeast | Shape::MoreThan) if self.is_its_difference() => {}
                (_, Shape::AtLeast | Shape::MoreThan) => each(out, |d| Shape::AtLeast.margin(d)),
                (_, Shape::Equal) => each(out, |d| Shape::Equal.margin(d)),
                (_, Shape::NotEqual) => each(out, |d| Shape::NotEqual.margin(d)),
                (_, Shape::Boolean) => each(out, |d| Shape::Boolean.margin(d)),
            }
            if self.can_be_nan {
                let undefined = self.undefined.answer(question);
                each(out, |v| if v.is_nan() { undefined } else { v });
            }
        }
    }

    /// Whether the margin is the difference, bit for bit: it is never −0.
    fn is_its_difference(&self) -> bool {
        let Value::Calculated(_, sides) = &self.difference else {
            return false;
        };
        let one_is_number = matches!(**sides, (Value::Number(_), _) | (_, Value::Number(_)));
        matches!(self.shape, Shape::AtLeast | Shape::MoreThan) && one_is_number
    }

    pub(crate) fn signals(&self, visit: &mut impl FnMut(usize)) {
        self.difference.signals(visit);
    }
}

/// A side of a comparison; a constant zero gets the sign of `zero`.
///
/// `x − y` is −0 only for x = −0 and y = 0, so with 0 on the left and −0 on
/// the right a difference with a constant never is, at no cost.
fn unsigned(side: Value, zero: f64) -> Value {
    match side {
        Value::Number(0.0) => Value::Number(zero),
        side => side,
    }
}

fn each(out: &mut [f64], answer: impl Fn(f64) -> f64) {
    out.iter_mut().for_each(|v| *v = answer(*v));
}

/// What is no number stays none; the leaf knows what it counts as.
impl Shape {
    fn margin(self, difference: f64) -> f64 {
        match self {
            // Adding 0 makes 0 of −0 and leaves everything else as it is.
            Shape::AtLeast | Shape::MoreThan => difference + 0.0,
            Shape::Equal => opposite(difference.abs()),
            Shape::NotEqual => difference.abs(),
            Shape::Boolean if difference != 0.0 => f64::INFINITY,
            Shape::Boolean => f64::NEG_INFINITY,
        }
    }

    fn truth(self, difference: f64) -> f64 {
        if difference.is_nan() {
            return difference;
        }
        let holds = match self {
            Shape::AtLeast => 0.0 <= difference,
            Shape::MoreThan => 0.0 < difference,
            Shape::Equal => difference == 0.0,
            Shape::NotEqual => difference != 0.0,
            Shape::Boolean => difference != 0.0,
        };
        if holds { 1.0 } else { -1.0 }
    }
}
