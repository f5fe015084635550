//! Canonical text of a syntax tree, which parses to the same tree.
//!
//! Operands are in parentheses, so that readers need not know precedences.
//! Exceptions are names, constants, and a prefix operator behind another.

use std::fmt::{self, Display, Formatter};
use std::sync::Arc;

use super::{Arithmetic, Node, NodeKind, Term, TermKind, Time, TimeBounds, TimeKind};
use crate::parse::is_keyword;
use crate::token::is_plain_name;

impl Display for Node {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match &self.kind {
            NodeKind::Constant(value) => write!(f, "{value}"),
            NodeKind::Name(name) => write_name(f, name),
            NodeKind::Compare(first, rest) => {
                write!(f, "{first}")?;
                rest.iter()
                    .try_for_each(|(op, term)| write!(f, " {} {term}", op.word()))
            }
            NodeKind::In(x, range) => write!(f, "{x} in [{}, {}]", range.0, range.1),
            NodeKind::Not(a) => {
                f.write_str("not ")?;
                write_prefixed(f, a)
            }
            NodeKind::And(all) => write_joined(f, "and", all),
            NodeKind::Or(all) => write_joined(f, "or", all),
            NodeKind::Implies(a, b) => write_joined(f, "implies", [a, b]),
            NodeKind::Iff(a, b) => write_joined(f, "iff", [a, b]),
            NodeKind::Xor(a, b) => write_joined(f, "xor", [a, b]),
            NodeKind::Unary(op, bounds, a) => {
                f.write_str(op.word())?;
                if let Some(bounds) = bounds {
                    write!(f, "{bounds}")?;
                }
                f.write_str(" ")?;
                write_prefixed(f, a)
            }
            NodeKind::Binary(op, bounds, a, b) => {
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
        NodeKind::Constant(_) | NodeKind::Name(_) => write!(f, "{node}"),
        _ => write!(f, "({node})"),
    }
}

/// Writes an operand of a prefix operator, without parentheses around a prefix.
fn write_prefixed(f: &mut Formatter<'_>, node: &Node) -> fmt::Result {
    match node.kind {
        NodeKind::Not(_) | NodeKind::Unary(..) => write!(f, "{node}"),
        _ => write_operand(f, node),
    }
}

fn write_name(f: &mut Formatter<'_>, name: &str) -> fmt::Result {
    if is_plain_name(name) && !is_keyword(name) {
        f.write_str(name)
    // A name that contains double quotes needs the other quotes.
    } else if name.contains('"') {
        write!(f, "`{name}`")
    } else {
        write!(f, "\"{name}\"")
    }
}

impl Display for TimeBounds {
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
                // Without parentheses the sign would apply to the first operand only.
                write!(f, "-({a})")
            }
            TimeKind::Negative(a) => write!(f, "-{a}"),
            TimeKind::Calculated(op, sides) => {
                let strength = |time: &Time| match &time.kind {
                    TimeKind::Calculated(op, _) => op.strength(),
                    // Any other time binds tighter than every operator.
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
                    // Any other term binds tighter than every operator.
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

/// Writes both sides of an operator. Operators of equal strength group left.
fn write_sides<T: Display>(
    f: &mut Formatter<'_>,
    op: Arithmetic,
    a: (T, u8),
    b: (T, u8),
) -> fmt::Result {
    if a.1 < op.strength() {
        write!(f, "({})", a.0)?
    } else {
        write!(f, "{}", a.0)?
    }
    write!(f, " {} ", op.word())?;
    // On the right equal strength needs them: a − (b − c) is not a − b − c.
    if b.1 <= op.strength() {
        write!(f, "({})", b.0)
    } else {
        write!(f, "{}", b.0)
    }
}

fn write_number(f: &mut Formatter<'_>, value: f64) -> fmt::Result {
    // Plain digits in the usual range, an exponent where zeros would pile up.
    if value == 0.0 || (1e-5..1e15).contains(&value.abs()) {
        write!(f, "{value}")
    } else {
        write!(f, "{value:e}")
    }
}
