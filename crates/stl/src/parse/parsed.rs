//! Part of a text that the parser has read so far.

use std::ops::Range;
use std::sync::Arc;

use super::complaints::{checked, checked_term};
use super::words::Logic;
use crate::error::StlError;
use crate::syntax::{Node, NodeKind, Span, Term, TermKind, TimeBounds};

/// Parsed part, whose sort is settled by the operator that takes it.
pub(super) enum Parsed {
    Formula(Box<Node>),
    Term(Box<Term>),
    Name(Arc<str>, Range<usize>),
}

impl Parsed {
    pub(super) fn formula(kind: NodeKind, span: Range<usize>) -> Result<Parsed, StlError> {
        checked(Node::new(kind, span)).map(|node| Parsed::Formula(Box::new(node)))
    }

    pub(super) fn term(kind: TermKind, span: Range<usize>) -> Result<Parsed, StlError> {
        checked_term(Term::new(kind, span)).map(|term| Parsed::Term(Box::new(term)))
    }

    pub(super) fn with_span(mut self, new: Range<usize>) -> Parsed {
        match &mut self {
            Parsed::Formula(node) => node.span = Span(new),
            Parsed::Term(term) => term.span = Span(new),
            Parsed::Name(_, span) => *span = new,
        }
        self
    }

    pub(super) fn into_formula(self, what: &str) -> Result<Box<Node>, StlError> {
        match self {
            Parsed::Formula(node) => Ok(node),
            Parsed::Name(name, span) => Ok(Box::new(Node::new(NodeKind::Name(name), span))),
            Parsed::Term(term) => Err(StlError::new(what, term.span.0.clone(), "this is a number")
                .with_help(format!("compare it with something, such as `{term} > 0`"))),
        }
    }

    pub(super) fn into_term(self, what: &str) -> Result<Box<Term>, StlError> {
        match self {
            Parsed::Term(term) => Ok(term),
            // A lone name may be a number or a formula. Binding checks which.
            Parsed::Name(name, span) => Ok(Box::new(Term::new(TermKind::Name(name), span))),
            Parsed::Formula(node) => Err(StlError::new(
                what,
                node.span.0.clone(),
                "this is true or false, not a number",
            )),
        }
    }
}

/// Joins two operands under a logical operator.
pub(super) fn join(
    logic: Logic,
    bounds: Option<TimeBounds>,
    left: Node,
    right: Node,
) -> Result<Parsed, StlError> {
    let span = left.span.0.start..right.span.0.end;
    let node = match logic {
        Logic::And => flat(left, right, span, NodeKind::And),
        Logic::Or => flat(left, right, span, NodeKind::Or),
        _ => {
            let (left, right) = (Arc::new(left), Arc::new(right));
            let kind = match logic {
                Logic::Implies => NodeKind::Implies(left, right),
                Logic::Iff => NodeKind::Iff(left, right),
                Logic::Temporal(op) => NodeKind::Binary(op, bounds, left, right),
                // Conjunctions and disjunctions are joined above, so only xor is left.
                Logic::Xor | Logic::And | Logic::Or => NodeKind::Xor(left, right),
            };
            Node::new(kind, span)
        }
    };
    checked(node).map(|node| Parsed::Formula(Box::new(node)))
}

/// Joins operands flat: `and` and `or` ignore parentheses among themselves.
fn flat(left: Node, right: Node, span: Range<usize>, join: fn(Vec<Arc<Node>>) -> NodeKind) -> Node {
    let same = |node: &Node| {
        std::mem::discriminant(&node.kind) == std::mem::discriminant(&join(Vec::new()))
    };
    // A merged operand adds no level, so long chains stay within the limit.
    let depth_of = |node: &Node| node.depth + usize::from(!same(node));
    let depth = depth_of(&left).max(depth_of(&right));
    let parts = |node: Node| match (same(&node), node) {
        (
            true,
            Node {
                kind: NodeKind::And(all) | NodeKind::Or(all),
                ..
            },
        ) => all,
        (_, node) => vec![Arc::new(node)],
    };
    let mut all = parts(left);
    all.append(&mut parts(right));
    Node {
        kind: join(all),
        span: Span(span),
        depth,
    }
}
