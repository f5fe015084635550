//! Syntax tree of formulas and expressions.
//!
//! Spans are kept for errors found later and are ignored by equality.

use std::ops::Range;
use std::sync::Arc;

use crate::number::Decimal;

mod text;

/// Place in the text. All places are equal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Span(pub(crate) Range<usize>);

impl PartialEq for Span {
    fn eq(&self, _: &Span) -> bool {
        true
    }
}

/// Formula with its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Node {
    pub(crate) kind: NodeKind,
    pub(crate) span: Span,
    /// Number of levels, including this level.
    pub(crate) depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum NodeKind {
    Constant(bool),
    /// Boolean signal or named formula.
    Name(Arc<str>),
    /// Chain `first op expr op expr …`.
    Compare(Term, Vec<(Comparison, Term)>),
    In(Term, Box<(Term, Term)>),
    Not(Arc<Node>),
    And(Vec<Arc<Node>>),
    Or(Vec<Arc<Node>>),
    Implies(Arc<Node>, Arc<Node>),
    Iff(Arc<Node>, Arc<Node>),
    Xor(Arc<Node>, Arc<Node>),
    Unary(Unary, Option<TimeBounds>, Arc<Node>),
    Binary(Binary, Option<TimeBounds>, Arc<Node>, Arc<Node>),
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

/// Bounds `[from, to]`, without `to` up to the end of the trace.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TimeBounds {
    pub(crate) from: Time,
    pub(crate) to: Option<Time>,
    pub(crate) span: Span,
}

/// Time in a bound.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Time {
    pub(crate) kind: TimeKind,
    pub(crate) span: Span,
    /// Number of levels, including this level.
    pub(crate) depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum TimeKind {
    Literal(Decimal, Option<TimeUnit>),
    Name(Arc<str>, Option<TimeUnit>),
    Negative(Box<Time>),
    Calculated(Arithmetic, Box<(Time, Time)>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    S,
    Ms,
    Us,
    Ns,
}

impl TimeUnit {
    pub(crate) fn parse(word: &str) -> Option<TimeUnit> {
        Some(match word {
            "s" => TimeUnit::S,
            "ms" => TimeUnit::Ms,
            // The micro sign and the Greek letter look alike, so both are accepted.
            "us" | "µs" | "μs" => TimeUnit::Us,
            "ns" => TimeUnit::Ns,
            _ => return None,
        })
    }

    pub(crate) fn word(self) -> &'static str {
        match self {
            TimeUnit::S => "s",
            TimeUnit::Ms => "ms",
            TimeUnit::Us => "us",
            TimeUnit::Ns => "ns",
        }
    }

    pub(crate) fn per_second(self) -> i128 {
        match self {
            TimeUnit::S => 1,
            TimeUnit::Ms => 1_000,
            TimeUnit::Us => 1_000_000,
            TimeUnit::Ns => 1_000_000_000,
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
            // As in the parser, so that printed brackets keep the meaning.
            Arithmetic::Add | Arithmetic::Subtract => 1,
            Arithmetic::Multiply | Arithmetic::Divide => 2,
        }
    }
}

/// Number-valued expression with its place in the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    pub(crate) kind: TermKind,
    pub(crate) span: Span,
    /// Number of levels, including this level.
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
        // `NAMES` lists the variants in their order.
        Function::NAMES[self as usize]
    }

    /// Returns the fewest and the most arguments.
    pub(crate) fn arity(self) -> (usize, usize) {
        match self {
            Function::Abs | Function::Sqrt | Function::Exp => (1, 1),
            Function::Pow => (2, 2),
            Function::Min | Function::Max => (2, 64),
        }
    }
}

impl Node {
    pub(crate) fn new(kind: NodeKind, span: Range<usize>) -> Node {
        let terms =
            |terms: &mut dyn Iterator<Item = &Term>| terms.map(|t| t.depth).max().unwrap_or(0);
        let below = match &kind {
            NodeKind::Constant(_) | NodeKind::Name(_) => 0,
            NodeKind::Compare(first, rest) => {
                terms(&mut std::iter::once(first).chain(rest.iter().map(|(_, t)| t)))
            }
            NodeKind::In(x, range) => terms(&mut [x, &range.0, &range.1].into_iter()),
            NodeKind::Not(a) | NodeKind::Unary(_, _, a) => a.depth,
            NodeKind::And(all) | NodeKind::Or(all) => {
                all.iter().map(|a| a.depth).max().unwrap_or(0)
            }
            NodeKind::Implies(a, b)
            | NodeKind::Iff(a, b)
            | NodeKind::Xor(a, b)
            | NodeKind::Binary(_, _, a, b) => a.depth.max(b.depth),
        };
        // Stored, since a recursive count of a deep tree could overflow the stack.
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
