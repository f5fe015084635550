//! The syntax tree of formulas and expressions, and its canonical text.
//!
//! Spans are kept for errors found later, and take no part in equality.

use std::fmt::{self, Display, Formatter};
use std::ops::Range;
use std::sync::Arc;

use super::number::Decimal;
use super::parse::is_keyword;
use super::token::is_plain_name;

/// A place in the text; all places are equal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Span(pub(crate) Range<usize>);

impl PartialEq for Span {
    fn eq(&self, _: &Span) -> bool {
        true
    }
}

/// A formula with its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) kind: Kind,
    pub(crate) span: Span,
    /// Levels below and with this one.
    pub(crate) depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kind {
    Constant(bool),
    /// A Boolean signal or a named formula.
    Name(Arc<str>),
    /// `first op expr op expr …`
    Compare(Term, Vec<(Comparison, Term)>),
    In(Term, Box<(Term, Term)>),
    Not(Arc<Node>),
    And(Vec<Arc<Node>>),
    Or(Vec<Arc<Node>>),
    Implies(Arc<Node>, Arc<Node>),
    Iff(Arc<Node>, Arc<Node>),
    Xor(Arc<Node>, Arc<Node>),
    Unary(Unary, Option<Bounds>, Arc<Node>),
    Binary(Binary, Option<Bounds>, Arc<Node>, Arc<Node>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unary {
    Always,
    Eventually,
    Historically,
    Once,
    Next,
    Prev,
    StrongNext,
    StrongPrev,
    Rise,
    Fall,
}

impl Unary {
    pub(crate) fn takes_bounds(self) -> bool {
        matches!(
            self,
            Unary::Always | Unary::Eventually | Unary::Historically | Unary::Once
        )
    }

    pub(crate) fn word(self) -> &'static str {
        match self {
            Unary::Always => "always",
            Unary::Eventually => "eventually",
            Unary::Historically => "historically",
            Unary::Once => "once",
            Unary::Next => "next",
            Unary::Prev => "prev",
            Unary::StrongNext => "s_next",
            Unary::StrongPrev => "s_prev",
            Unary::Rise => "rise",
            Unary::Fall => "fall",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Binary {
    Until,
    Release,
    Unless,
    Since,
}

impl Binary {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Binary::Until => "until",
            Binary::Release => "release",
            Binary::Unless => "unless",
            Binary::Since => "since",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Comparison {
    Less,
    LessEqual,
    Greater,
    GreaterEqual,
    Equal,
    NotEqual,
}

impl Comparison {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Comparison::Less => "<",
            Comparison::LessEqual => "<=",
            Comparison::Greater => ">",
            Comparison::GreaterEqual => ">=",
            Comparison::Equal => "==",
            Comparison::NotEqual => "!=",
        }
    }
}

/// `[from, to]`; no `to` is the end of the trace.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) from: Time,
    pub(crate) to: Option<Time>,
    pub(crate) span: Span,
}

/// A time in a bound.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Time {
    pub(crate) kind: TimeKind,
    pub(crate) span: Span,
    /// Levels below and with this one.
    pub(crate) depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TimeKind {
    Literal(Decimal, Option<Unit>),
    Name(Arc<str>, Option<Unit>),
    Negative(Box<Time>),
    Calculated(Arithmetic, Box<(Time, Time)>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unit {
    S,
    Ms,
    Us,
    Ns,
}

impl Unit {
    pub(crate) fn parse(word: &str) -> Option<Unit> {
        Some(match word {
            "s" => Unit::S,
            "ms" => Unit::Ms,
            "us" | "µs" | "μs" => Unit::Us,
            "ns" => Unit::Ns,
            _ => return None,
        })
    }

    pub(crate) fn word(self) -> &'static str {
        match self {
            Unit::S => "s",
            Unit::Ms => "ms",
            Unit::Us => "us",
            Unit::Ns => "ns",
        }
    }

    pub(crate) fn per_second(self) -> i128 {
        match self {
            Unit::S => 1,
            Unit::Ms => 1_000,
            Unit::Us => 1_000_000,
            Unit::Ns => 1_000_000_000,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arithmetic {
    Add,
    Subtract,
    Multiply,
    Divide,
}

impl Arithmetic {
    fn word(self) -> &'static str {
        match self {
            Arithmetic::Add => "+",
            Arithmetic::Subtract => "-",
            Arithmetic::Multiply => "*",
            Arithmetic::Divide => "/",
        }
    }

    fn strength(self) -> u8 {
        match self {
            Arithmetic::Add | Arithmetic::Subtract => 1,
            Arithmetic::Multiply | Arithmetic::Divide => 2,
        }
    }
}

/// A number-valued expression with its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    pub(crate) kind: TermKind,
    pub(crate) span: Span,
    /// Levels below and with this one.
    pub(crate) depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TermKind {
    Number(f64),
    Name(Arc<str>),
    Negative(Box<Term>),
    Calculated(Arithmetic, Box<(Term, Term)>),
    Call(Function, Vec<Term>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Function {
    Abs,
    Min,
    Max,
    Sqrt,
    Pow,
    Exp,
}

impl Function {
    pub(crate) const NAMES: [&str; 6] = ["abs", "min", "max", "sqrt", "pow", "exp"];

    pub(crate) fn parse(word: &str) -> Option<Function> {
        Some(match word {
            "abs" => Function::Abs,
            "min" => Function::Min,
            "max" => Function::Max,
            "sqrt" => Function::Sqrt,
            "pow" => Function::Pow,
            "exp" => Function::Exp,
            _ => return None,
        })
    }

    fn word(self) -> &'static str {
        Function::NAMES[self as usize]
    }

    /// Fewest and most arguments.
    pub(crate) fn arity(self) -> (usize, usize) {
        match self {
            Function::Abs | Function::Sqrt | Function::Exp => (1, 1),
            Function::Pow => (2, 2),
            Function::Min | Function::Max => (2, 64),
        }
    }
}

impl Node {
    pub(crate) fn new(kind: Kind, span: Range<usize>) -> Node {
        let terms =
            |terms: &mut dyn Iterator<Item = &Term>| terms.map(|t| t.depth).max().unwrap_or(0);
        let below = match &kind {
            Kind::Constant(_) | Kind::Name(_) => 0,
            Kind::Compare(first, rest) => {
                terms(&mut std::iter::once(first).chain(rest.iter().map(|(_, t)| t)))
            }
            Kind::In(x, range) => terms(&mut [x, &range.0, &range.1].into_iter()),
            Kind::Not(a) | Kind::Unary(_, _, a) => a.depth,
            Kind::And(all) | Kind::Or(all) => all.iter().map(|a| a.depth).max().unwrap_or(0),
            Kind::Implies(a, b) | Kind::Iff(a, b) | Kind::Xor(a, b) | Kind::Binary(_, _, a, b) => {
                a.depth.max(b.depth)
            }
        };
        Node {
            kind,
            span: Span(span),
            depth: below + 1,
        }
    }
}

impl Term {
    pub(crate) fn new(kind: TermKind, span: Range<usize>) -> Term {
        let below = match &kind {
            TermKind::Number(_) | TermKind::Name(_) => 0,
            TermKind::Negative(a) => a.depth,
            TermKind::Calculated(_, ab) => ab.0.depth.max(ab.1.depth),
            TermKind::Call(_, all) => all.iter().map(|a| a.depth).max().unwrap_or(0),
        };
        Term {
            kind,
            span: Span(span),
            depth: below + 1,
        }
    }
}

impl Time {
    pub(crate) fn new(kind: TimeKind, span: Range<usize>) -> Time {
        let below = match &kind {
            TimeKind::Literal(..) | TimeKind::Name(..) => 0,
            TimeKind::Negative(a) => a.depth,
            TimeKind::Calculated(_, ab) => ab.0.depth.max(ab.1.depth),
        };
        Time {
            kind,
            span: Span(span),
            depth: below + 1,
        }
    }
}

impl Display for Node {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.kind {
            Kind::Constant(value) => write!(f, "{value}"),
            Kind::Name(name) => write_name(f, name),
            Kind::Compare(first, rest) => {
                write!(f, "{first}")?;
                rest.iter()
                    .try_for_each(|(op, term)| write!(f, " {} {term}", op.word()))
            }
            Kind::In(x, range) => write!(f, "{x} in [{}, {}]", range.0, range.1),
            Kind::Not(a) => {
                f.write_str("not ")?;
                write_prefixed(f, a)
            }
            Kind::And(all) => write_joined(f, "and", all),
            Kind::Or(all) => write_joined(f, "or", all),
            Kind::Implies(a, b) => write_joined(f, "implies", [a, b]),
            Kind::Iff(a, b) => write_joined(f, "iff", [a, b]),
            Kind::Xor(a, b) => write_joined(f, "xor", [a, b]),
            Kind::Unary(op, bounds, a) => {
                f.write_str(op.word())?;
                if let Some(bounds) = bounds {
                    write!(f, "{bounds}")?;
                }
                f.write_str(" ")?;
                write_prefixed(f, a)
            }
            Kind::Binary(op, bounds, a, b) => {
                write_operand(f, a)?;
                write!(f, " {}", op.word())?;
                if let Some(bounds) = bounds {
                    write!(f, "{bounds}")?;
                }
                f.write_str(" ")?;
                write_operand(f, b)
            }
        }
    }
}

fn write_joined<'a>(
    f: &mut Formatter<'_>,
    word: &str,
    all: impl IntoIterator<Item = &'a Arc<Node>>,
) -> fmt::Result {
    for (i, node) in all.into_iter().enumerate() {
        if i != 0 {
            write!(f, " {word} ")?;
        }
        write_operand(f, node)?;
    }
    Ok(())
}

fn write_operand(f: &mut Formatter<'_>, node: &Node) -> fmt::Result {
    match node.kind {
        Kind::Constant(_) | Kind::Name(_) => write!(f, "{node}"),
        _ => write!(f, "({node})"),
    }
}

/// A prefix operator needs no parentheses around another one.
fn write_prefixed(f: &mut Formatter<'_>, node: &Node) -> fmt::Result {
    match node.kind {
        Kind::Not(_) | Kind::Unary(..) => write!(f, "{node}"),
        _ => write_operand(f, node),
    }
}

pub(crate) fn write_name(f: &mut Formatter<'_>, name: &str) -> fmt::Result {
    if is_plain_name(name) && !is_keyword(name) {
        f.write_str(name)
    } else if name.contains('"') {
        write!(f, "`{name}`")
    } else {
        write!(f, "\"{name}\"")
    }
}

impl Display for Bounds {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.to {
            Some(to) => write!(f, "[{}, {to}]", self.from),
            None => write!(f, "[{}, end]", self.from),
        }
    }
}

impl Display for Time {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.kind {
            TimeKind::Literal(value, None) => write!(f, "{value}"),
            TimeKind::Literal(value, Some(unit)) => write!(f, "{value} {}", unit.word()),
            TimeKind::Name(name, unit) => {
                write_name(f, name)?;
                unit.map_or(Ok(()), |unit| write!(f, " {}", unit.word()))
            }
            TimeKind::Negative(a) if matches!(a.kind, TimeKind::Calculated(..)) => {
                write!(f, "-({a})")
            }
            TimeKind::Negative(a) => write!(f, "-{a}"),
            TimeKind::Calculated(op, sides) => {
                let strength = |time: &Time| match &time.kind {
                    TimeKind::Calculated(op, _) => op.strength(),
                    _ => 9,
                };
                let (a, b) = (&sides.0, &sides.1);
                write_sides(f, *op, (a, strength(a)), (b, strength(b)))
            }
        }
    }
}

impl Display for Term {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.kind {
            TermKind::Number(value) => write_number(f, *value),
            TermKind::Name(name) => write_name(f, name),
            TermKind::Negative(a) if matches!(a.kind, TermKind::Calculated(..)) => {
                write!(f, "-({a})")
            }
            TermKind::Negative(a) => write!(f, "-{a}"),
            TermKind::Calculated(op, sides) => {
                let strength = |term: &Term| match &term.kind {
                    TermKind::Calculated(op, _) => op.strength(),
                    _ => 9,
                };
                let (a, b) = (&sides.0, &sides.1);
                write_sides(f, *op, (a, strength(a)), (b, strength(b)))
            }
            TermKind::Call(function, all) => {
                write!(f, "{}(", function.word())?;
                for (i, term) in all.iter().enumerate() {
                    write!(f, "{}{term}", if i == 0 { "" } else { ", " })?;
                }
                f.write_str(")")
            }
        }
    }
}

/// Operators of one strength group to the left.
fn write_sides<T: Display>(
    f: &mut Formatter<'_>,
    op: Arithmetic,
    a: (T, u8),
    b: (T, u8),
) -> fmt::Result {
    match a.1 < op.strength() {
        true => write!(f, "({})", a.0)?,
        false => write!(f, "{}", a.0)?,
    }
    write!(f, " {} ", op.word())?;
    match b.1 <= op.strength() {
        true => write!(f, "({})", b.0),
        false => write!(f, "{}", b.0),
    }
}

fn write_number(f: &mut Formatter<'_>, value: f64) -> fmt::Result {
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) {
        write!(f, "{value}")
    } else {
        write!(f, "{value:e}")
    }
}
