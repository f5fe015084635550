//! Formulas and expressions under other names of their signals and constants.

use std::sync::Arc;

use crate::formula::{Expr, Formula};
use crate::syntax::{Node, NodeKind, Term, TermKind, Time, TimeBounds, TimeKind};

/// New name of a name, `None` to leave it.
type Renaming<'a> = &'a dyn Fn(&str) -> Option<String>;

impl Formula {
    /// Returns the formula with other names of its signals, constants and formulas.
    ///
    /// Names for which `new` returns `None` stay, among them `T` as a rule.
    ///
    /// ```
    /// use brakecheck_stl::Formula;
    ///
    /// let formula: Formula = "always[0, t] (x > y)".parse()?;
    /// let renamed = formula.renamed(&|name| (name == "x").then(|| "car.x".to_owned()));
    /// assert_eq!(renamed.to_string(), "always[0, t] (car.x > y)");
    /// # Ok::<(), brakecheck_stl::StlError>(())
    /// ```
    pub fn renamed(&self, new: &dyn Fn(&str) -> Option<String>) -> Formula {
        Formula {
            root: node(&self.root, new),
        }
    }

    /// Returns the names in order of occurrence, without repetition.
    ///
    /// They are those of signals, constants and formulas, since names are bound later.
    pub fn names(&self) -> Vec<String> {
        // A renaming is a shared function, so the list that it fills needs a cell.
        let names = std::cell::RefCell::new(Vec::new());
        // Nothing is renamed: the walk only visits each name in the order of the text.
        self.renamed(&|name| {
            let mut names = names.borrow_mut();
            if !names.iter().any(|known| known == name) {
                names.push(name.to_owned());
            }
            None
        });
        names.into_inner()
    }
}

impl Expr {
    /// Returns the expression with other names, as [`Formula::renamed`].
    pub fn renamed(&self, new: &dyn Fn(&str) -> Option<String>) -> Expr {
        Expr {
            root: term(&self.root, new),
        }
    }
}

fn name(old: &Arc<str>, new: Renaming<'_>) -> Arc<str> {
    new(old).map_or_else(|| Arc::clone(old), Arc::from)
}

fn node(old: &Node, new: Renaming<'_>) -> Arc<Node> {
    let sub = |old: &Arc<Node>| node(old, new);
    let all = |old: &[Arc<Node>]| old.iter().map(sub).collect();
    let kind = match &old.kind {
        NodeKind::Constant(value) => NodeKind::Constant(*value),
        NodeKind::Name(old) => NodeKind::Name(name(old, new)),
        NodeKind::Compare(first, rest) => {
            let rest = rest.iter().map(|(op, old)| (*op, term(old, new)));
            NodeKind::Compare(term(first, new), rest.collect())
        }
        NodeKind::In(x, range) => {
            let range = (term(&range.0, new), term(&range.1, new));
            NodeKind::In(term(x, new), Box::new(range))
        }
        NodeKind::Not(a) => NodeKind::Not(sub(a)),
        NodeKind::And(old) => NodeKind::And(all(old)),
        NodeKind::Or(old) => NodeKind::Or(all(old)),
        NodeKind::Implies(a, b) => NodeKind::Implies(sub(a), sub(b)),
        NodeKind::Iff(a, b) => NodeKind::Iff(sub(a), sub(b)),
        NodeKind::Xor(a, b) => NodeKind::Xor(sub(a), sub(b)),
        NodeKind::Unary(op, within, a) => NodeKind::Unary(*op, bounds(within, new), sub(a)),
        NodeKind::Binary(op, within, a, b) => {
            NodeKind::Binary(*op, bounds(within, new), sub(a), sub(b))
        }
    };
    // Places stay, so that an error still points into the text as written.
    Arc::new(Node {
        kind,
        span: old.span.clone(),
        depth: old.depth,
    })
}

fn bounds(old: &Option<TimeBounds>, new: Renaming<'_>) -> Option<TimeBounds> {
    old.as_ref().map(|old| TimeBounds {
        from: time(&old.from, new),
        to: old.to.as_ref().map(|old| time(old, new)),
        span: old.span.clone(),
    })
}

fn time(old: &Time, new: Renaming<'_>) -> Time {
    let kind = match &old.kind {
        TimeKind::Literal(value, unit) => TimeKind::Literal(*value, *unit),
        TimeKind::Name(old, unit) => TimeKind::Name(name(old, new), *unit),
        TimeKind::Negative(a) => TimeKind::Negative(Box::new(time(a, new))),
        TimeKind::Calculated(op, sides) => {
            let sides = (time(&sides.0, new), time(&sides.1, new));
            TimeKind::Calculated(*op, Box::new(sides))
        }
    };
    Time {
        kind,
        span: old.span.clone(),
        depth: old.depth,
    }
}

fn term(old: &Term, new: Renaming<'_>) -> Term {
    let kind = match &old.kind {
        TermKind::Number(value) => TermKind::Number(*value),
        TermKind::Name(old) => TermKind::Name(name(old, new)),
        TermKind::Negative(a) => TermKind::Negative(Box::new(term(a, new))),
        TermKind::Calculated(op, sides) => {
            let sides = (term(&sides.0, new), term(&sides.1, new));
            TermKind::Calculated(*op, Box::new(sides))
        }
        TermKind::Call(function, all) => {
            TermKind::Call(*function, all.iter().map(|a| term(a, new)).collect())
        }
    };
    Term {
        kind,
        span: old.span.clone(),
        depth: old.depth,
    }
}
