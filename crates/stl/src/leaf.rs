//! Bound arithmetic and comparisons, for whole columns or for single rows.
//!
//! Both forms apply the same operations in the same order. A monitor fed sample
//! by sample thus ends with the same bits as a monitor of the whole trace. No
//! margin is −0 for the same reason: a minimum of 0 and −0 depends on the order
//! of its operands, and orders differ.

use crate::interval::Interval;
use crate::syntax::{Arithmetic, Comparison, Function};
use crate::trace_operators::opposite;

/// Samples evaluated at a time. A few buffers of this size fit the L1 cache.
pub(crate) const CHUNK: usize = 512;

/// Source of the values of signals.
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

/// Expression whose names are bound to signals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum BoundExpression {
    Number(f64),
    Signal(usize),
    Negative(Box<BoundExpression>),
    Calculated(Arithmetic, Box<(BoundExpression, BoundExpression)>),
    Call(Function, Vec<BoundExpression>),
}

impl BoundExpression {
    /// Returns the value in a row.
    pub(crate) fn at(&self, row: &[f64]) -> f64 {
        match self {
            BoundExpression::Number(value) => *value,
            BoundExpression::Signal(signal) => row[*signal],
            BoundExpression::Negative(a) => -a.at(row),
            BoundExpression::Calculated(op, sides) => {
                calculate(*op, sides.0.at(row), sides.1.at(row))
            }
            BoundExpression::Call(Function::Min, all) => {
                all.iter().map(|a| a.at(row)).reduce(least).unwrap_or(0.0)
            }
            BoundExpression::Call(Function::Max, all) => all
                .iter()
                .map(|a| a.at(row))
                .reduce(greatest)
                .unwrap_or(0.0),
            BoundExpression::Call(function, all) => {
                // The parser checks the number of arguments, so no default is ever
                // read.
                let argument = |i: usize| all.get(i).map_or(0.0, |a| a.at(row));
                match function {
                    Function::Pow => power(argument(0), argument(1)),
                    _ => apply(*function, argument(0)),
                }
            }
        }
    }

    /// Computes at most [`CHUNK`] values, at the samples `from ..` of the columns.
    pub(crate) fn fill(&self, columns: &impl Columns, from: usize, out: &mut [f64]) {
        debug_assert!(out.len() <= CHUNK);
        let len = out.len();
        match self {
            BoundExpression::Number(value) => out.fill(*value),
            BoundExpression::Signal(signal) => {
                out.copy_from_slice(&columns.column(*signal)[from..from + len])
            }
            BoundExpression::Negative(a) => {
                a.fill(columns, from, out);
                out.iter_mut().for_each(|v| *v = -*v);
            }
            BoundExpression::Calculated(op, sides) => {
                sides.0.fill(columns, from, out);
                // An own loop per operation, so that each compiles to vector instructions.
                sides.1.with(columns, from, len, |right| match op {
                    Arithmetic::Add => zip(out, right, |a, b| a + b),
                    Arithmetic::Subtract => zip(out, right, |a, b| a - b),
                    Arithmetic::Multiply => zip(out, right, |a, b| a * b),
                    Arithmetic::Divide => zip(out, right, |a, b| a / b),
                });
            }
            BoundExpression::Call(function, all) => {
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

    /// Passes the values to `use_them`, without a copy for a signal.
    fn with(
        &self,
        columns: &impl Columns,
        from: usize,
        len: usize,
        use_them: impl FnOnce(Operand<'_>),
    ) {
        match self {
            BoundExpression::Number(value) => use_them(Operand::Number(*value)),
            BoundExpression::Signal(signal) => {
                use_them(Operand::Column(&columns.column(*signal)[from..from + len]))
            }
            _ => {
                // On the stack: nested expressions need no allocation.
                let mut values = [0.0; CHUNK];
                self.fill(columns, from, &mut values[..len]);
                use_them(Operand::Column(&values[..len]));
            }
        }
    }

    /// Calls `visit` with every signal that the expression reads.
    pub(crate) fn signals(&self, visit: &mut impl FnMut(usize)) {
        match self {
            BoundExpression::Number(_) => {}
            BoundExpression::Signal(signal) => visit(*signal),
            BoundExpression::Negative(a) => a.signals(visit),
            BoundExpression::Calculated(_, sides) => {
                sides.0.signals(visit);
                sides.1.signals(visit);
            }
            BoundExpression::Call(_, all) => all.iter().for_each(|a| a.signals(visit)),
        }
    }

    /// Returns true if finite signals can give NaN.
    pub(crate) fn can_be_nan(&self) -> bool {
        match self {
            BoundExpression::Number(_) | BoundExpression::Signal(_) => false,
            BoundExpression::Negative(a) => a.can_be_nan(),
            BoundExpression::Call(Function::Abs | Function::Min | Function::Max, all) => {
                all.iter().any(BoundExpression::can_be_nan)
            }
            // A sum or product of two signals can be infinite, but not NaN. Deeper terms
            // can be NaN.
            BoundExpression::Calculated(
                Arithmetic::Add | Arithmetic::Subtract | Arithmetic::Multiply,
                sides,
            ) => !(sides.0.is_finite() && sides.1.is_finite()),
            // Errs on the safe side: an extra pass is cheap, a missed NaN is a wrong
            // verdict.
            _ => true,
        }
    }

    fn is_finite(&self) -> bool {
        match self {
            BoundExpression::Number(_) | BoundExpression::Signal(_) => true,
            BoundExpression::Negative(a) => a.is_finite(),
            BoundExpression::Call(Function::Abs | Function::Min | Function::Max, all) => {
                all.iter().all(BoundExpression::is_finite)
            }
            // Sums and products of finite values may overflow.
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
        // IEEE 754 rounds square roots correctly, so the platform's is portable.
        Function::Sqrt => a.sqrt(),
        // From libm, so that every machine gives the same bits.
        Function::Exp => libm::exp(a),
        // Functions of several arguments never get here, because the callers handle
        // them.
        _ => a.abs(),
    }
}

/// Power from libm, so that every machine gives the same bits.
///
/// Unlike IEEE 754, NaN stays NaN as the base of power 0 and as the power of 1.
fn power(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        return f64::NAN;
    }
    libm::pow(a, b)
}

/// Returns the smaller of two numbers, NaN if either is NaN.
fn least(a: f64, b: f64) -> f64 {
    // A NaN in `b` fails the comparison and is returned as `b`.
    if a < b || a.is_nan() { a } else { b }
}

/// Returns the larger of two numbers, NaN if either is NaN.
fn greatest(a: f64, b: f64) -> f64 {
    if b < a || a.is_nan() { a } else { b }
}

/// Comparison or Boolean signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Leaf {
    /// `left − right` for ≥, >, ==, != and `right − left` for ≤, <.
    difference: BoundExpression,
    shape: ComparisonKind,
    can_be_nan: bool,
    undefined: Undefined,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ComparisonKind {
    AtLeast,
    MoreThan,
    Equal,
    NotEqual,
    Boolean,
}

/// Value of a comparison whose difference is NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Undefined {
    /// Worst value for a comparison that is not negated.
    Fails,
    /// Worst value under an odd number of negations.
    Holds,
}

impl Undefined {
    pub(crate) fn opposite(self) -> Undefined {
        match self {
            Undefined::Fails => Undefined::Holds,
            Undefined::Holds => Undefined::Fails,
        }
    }

    fn answer(self, question: Semantics) -> f64 {
        // Infinite, since no finite change leads back to a defined value.
        let magnitude = match question {
            Semantics::Margin => f64::INFINITY,
            Semantics::Truth => 1.0,
        };
        match self {
            Undefined::Fails => -magnitude,
            Undefined::Holds => magnitude,
        }
    }
}

/// Quantity that a leaf computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Semantics {
    /// Distance to a change of the verdict: the robustness.
    Margin,
    /// 1 for true, −1 for false, so that `>` and `≥` differ.
    Truth,
}

impl Leaf {
    pub(crate) fn compare(left: BoundExpression, op: Comparison, right: BoundExpression) -> Leaf {
        // Exchanged sides turn ≤ and < into the two other shapes.
        let (shape, sides) = match op {
            Comparison::GreaterEqual => (ComparisonKind::AtLeast, (left, right)),
            Comparison::Greater => (ComparisonKind::MoreThan, (left, right)),
            Comparison::LessEqual => (ComparisonKind::AtLeast, (right, left)),
            Comparison::Less => (ComparisonKind::MoreThan, (right, left)),
            Comparison::Equal => (ComparisonKind::Equal, (left, right)),
            Comparison::NotEqual => (ComparisonKind::NotEqual, (left, right)),
        };
        let sides = (unsigned(sides.0, 0.0), unsigned(sides.1, -0.0));
        let difference = BoundExpression::Calculated(Arithmetic::Subtract, Box::new(sides));
        let can_be_nan = difference.can_be_nan();
        Leaf {
            difference,
            shape,
            can_be_nan,
            // Provisional: binding corrects it once the negations above are known.
            undefined: Undefined::Fails,
        }
    }

    /// Returns the leaf with another value for an undefined difference.
    pub(crate) fn counting(&self, undefined: Undefined) -> Leaf {
        Leaf {
            undefined,
            ..self.clone()
        }
    }

    /// Returns true if finite signals can make the difference NaN.
    pub(crate) fn can_be_undefined(&self) -> bool {
        self.can_be_nan
    }

    /// Returns true if the difference is NaN at a sample of the columns.
    pub(crate) fn is_undefined(&self, columns: &impl Columns, sample: usize) -> bool {
        let mut difference = [0.0];
        self.difference.fill(columns, sample, &mut difference);
        difference[0].is_nan()
    }

    pub(crate) fn boolean(signal: usize) -> Leaf {
        Leaf {
            difference: BoundExpression::Signal(signal),
            shape: ComparisonKind::Boolean,
            can_be_nan: false,
            undefined: Undefined::Fails,
        }
    }

    pub(crate) fn shape(&self) -> ComparisonKind {
        self.shape
    }

    /// Returns the expression behind the robustness.
    pub(crate) fn difference(&self) -> &BoundExpression {
        &self.difference
    }

    /// Returns the range of the robustness, given a range of the difference.
    pub(crate) fn margins(&self, difference: Interval) -> Interval {
        match self.shape {
            ComparisonKind::AtLeast | ComparisonKind::MoreThan => difference,
            ComparisonKind::Equal => difference.absolute().negated(),
            ComparisonKind::NotEqual => difference.absolute(),
            // Any number but 0 is true, so a range without 0 always holds.
            ComparisonKind::Boolean if !difference.contains(0.0) => {
                Interval::exactly(f64::INFINITY)
            }
            ComparisonKind::Boolean => Interval::ANY,
        }
    }

    /// Returns the robustness in a row.
    #[inline]
    pub(crate) fn at(&self, row: &[f64]) -> f64 {
        // Fast path for the common leaf, `signal ≥ number`, without a tree walk.
        if let (
            ComparisonKind::AtLeast | ComparisonKind::MoreThan,
            BoundExpression::Calculated(_, sides),
        ) = (self.shape, &self.difference)
        {
            // Finite operands give no NaN here, so the undefined case needs no check.
            match **sides {
                (BoundExpression::Signal(a), BoundExpression::Number(b)) => return row[a] - b,
                (BoundExpression::Number(a), BoundExpression::Signal(b)) => return a - row[b],
                // The difference of two signals may be −0, unlike that with a constant.
                (BoundExpression::Signal(a), BoundExpression::Signal(b)) => {
                    return row[a] - row[b] + 0.0;
                }
                _ => {}
            }
        }
        let margin = self.shape.margin(self.difference.at(row));
        if margin.is_nan() {
            self.undefined.answer(Semantics::Margin)
        } else {
            margin
        }
    }

    /// Computes the answers at the samples `from ..` of the columns.
    pub(crate) fn fill(
        &self,
        columns: &impl Columns,
        question: Semantics,
        from: usize,
        out: &mut [f64],
    ) {
        let shape = self.shape;
        for (i, out) in out.chunks_mut(CHUNK).enumerate() {
            self.difference.fill(columns, from + i * CHUNK, out);
            // The match is outside the loops, so that each loop is free of branches.
            match (question, shape) {
                (Semantics::Truth, _) => each(out, |d| shape.truth(d)),
                (_, ComparisonKind::AtLeast | ComparisonKind::MoreThan)
                    if self.is_its_difference() => {}
                (_, ComparisonKind::AtLeast | ComparisonKind::MoreThan) => {
                    each(out, |d| ComparisonKind::AtLeast.margin(d))
                }
                (_, ComparisonKind::Equal) => each(out, |d| ComparisonKind::Equal.margin(d)),
                (_, ComparisonKind::NotEqual) => each(out, |d| ComparisonKind::NotEqual.margin(d)),
                (_, ComparisonKind::Boolean) => each(out, |d| ComparisonKind::Boolean.margin(d)),
            }
            // Most leaves cannot be NaN and skip this pass.
            if self.can_be_nan {
                let undefined = self.undefined.answer(question);
                each(out, |v| if v.is_nan() { undefined } else { v });
            }
        }
    }

    /// Returns true if the margin is the difference bit for bit, never −0.
    fn is_its_difference(&self) -> bool {
        let BoundExpression::Calculated(_, sides) = &self.difference else {
            return false;
        };
        let one_is_number = matches!(
            **sides,
            (BoundExpression::Number(_), _) | (_, BoundExpression::Number(_))
        );
        matches!(
            self.shape,
            ComparisonKind::AtLeast | ComparisonKind::MoreThan
        ) && one_is_number
    }

    pub(crate) fn signals(&self, visit: &mut impl FnMut(usize)) {
        self.difference.signals(visit);
    }
}

/// Returns a side of a comparison. A constant zero gets the sign of `zero`.
///
/// `x − y` is −0 only for x = −0 and y = 0. With 0 on the left and −0 on the
/// right, a difference with a constant is never −0, at no cost.
fn unsigned(side: BoundExpression, zero: f64) -> BoundExpression {
    match side {
        // The pattern matches −0 too, as floats compare.
        BoundExpression::Number(0.0) => BoundExpression::Number(zero),
        side => side,
    }
}

fn each(out: &mut [f64], answer: impl Fn(f64) -> f64) {
    out.iter_mut().for_each(|v| *v = answer(*v));
}

/// NaN stays NaN here, because the leaf knows its replacement value.
impl ComparisonKind {
    fn margin(self, difference: f64) -> f64 {
        match self {
            // Adding 0 turns −0 into 0 and leaves every other value as it is.
            ComparisonKind::AtLeast | ComparisonKind::MoreThan => difference + 0.0,
            ComparisonKind::Equal => opposite(difference.abs()),
            ComparisonKind::NotEqual => difference.abs(),
            ComparisonKind::Boolean if difference != 0.0 => f64::INFINITY,
            ComparisonKind::Boolean => f64::NEG_INFINITY,
        }
    }

    fn truth(self, difference: f64) -> f64 {
        // The comparisons below would take NaN for false.
        if difference.is_nan() {
            return difference;
        }
        let holds = match self {
            ComparisonKind::AtLeast => difference >= 0.0,
            ComparisonKind::MoreThan => difference > 0.0,
            ComparisonKind::Equal => difference == 0.0,
            ComparisonKind::NotEqual => difference != 0.0,
            ComparisonKind::Boolean => difference != 0.0,
        };
        if holds { 1.0 } else { -1.0 }
    }
}
