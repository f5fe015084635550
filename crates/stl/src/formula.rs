//! Parsed formulas and expressions, not yet bound to signals.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;
use std::sync::Arc;

use crate::error::StlError;
use crate::parse::{parse_formula, parse_term};
use crate::syntax::{Arithmetic, Function, Node, Term, TermKind};

/// Formula of Signal Temporal Logic.
///
/// Parse it with [`str::parse`]. It prints as a canonical text that parses to the
/// same formula.
///
/// ```
/// use brakecheck_stl::Formula;
///
/// let formula: Formula = "G[0:2](x>1) -> !y".parse()?;
/// assert_eq!(formula.to_string(), "(always[0, 2] (x > 1)) implies (not y)");
/// # Ok::<(), brakecheck_stl::StlError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Formula {
    pub(crate) root: Arc<Node>,
}

impl FromStr for Formula {
    type Err = StlError;

    fn from_str(text: &str) -> Result<Formula, StlError> {
        Ok(Formula {
            root: Arc::from(parse_formula(text)?),
        })
    }
}

impl Display for Formula {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.root.fmt(f)
    }
}

/// Arithmetic expression, such as `ado.x - ego.x`.
///
/// ```
/// use brakecheck_stl::{Constants, Expr};
/// use brakecheck_stl::trace::{Schema, Signal};
///
/// let schema = Schema::new(0.1, [Signal::real("x", "m", "where"), Signal::real("y", "m", "where")])?;
/// let expr: Expr = "abs(x - y) / 2".parse()?;
/// assert_eq!(expr.signals(), ["x", "y"]);
/// assert_eq!(expr.bind(&schema, &Constants::new())?.eval(&[1.0, 4.0]), 1.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    pub(crate) root: Term,
}

impl Expr {
    /// Returns the names in order of occurrence, without repetition.
    ///
    /// Constants are included, since names are bound later.
    pub fn signals(&self) -> Vec<&str> {
        fn visit<'a>(term: &'a Term, names: &mut Vec<&'a str>) {
            match &term.kind {
                TermKind::Number(_) => {}
                // A list instead of a set keeps the order of the text, and names are
                // few.
                TermKind::Name(name) if names.contains(&&**name) => {}
                TermKind::Name(name) => names.push(name),
                TermKind::Negative(a) => visit(a, names),
                TermKind::Calculated(_, sides) => {
                    visit(&sides.0, names);
                    visit(&sides.1, names);
                }
                TermKind::Call(_, all) => all.iter().for_each(|a| visit(a, names)),
            }
        }
        let mut names = Vec::new();
        visit(&self.root, &mut names);
        names
    }

    /// Returns true if the value has the common unit of its signals.
    ///
    /// This holds while the expression only adds, subtracts and selects. A product, a
    /// quotient, a root or a power has another unit.
    pub fn keeps_units(&self) -> bool {
        fn visit(term: &Term) -> bool {
            match &term.kind {
                TermKind::Number(_) | TermKind::Name(_) => true,
                TermKind::Negative(a) => visit(a),
                TermKind::Calculated(Arithmetic::Add | Arithmetic::Subtract, sides) => {
                    visit(&sides.0) && visit(&sides.1)
                }
                TermKind::Calculated(Arithmetic::Multiply | Arithmetic::Divide, _) => false,
                TermKind::Call(Function::Abs | Function::Min | Function::Max, all) => {
                    all.iter().all(visit)
                }
                TermKind::Call(Function::Sqrt | Function::Pow | Function::Exp, _) => false,
            }
        }
        visit(&self.root)
    }
}

impl FromStr for Expr {
    type Err = StlError;

    fn from_str(text: &str) -> Result<Expr, StlError> {
        Ok(Expr {
            root: *parse_term(text)?,
        })
    }
}

impl Display for Expr {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.root.fmt(f)
    }
}
