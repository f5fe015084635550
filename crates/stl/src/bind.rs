//! Binding of names to signals, constants and formulas, and of times to samples.

use std::fmt::Write as _;
use std::sync::Arc;

use crate::error::StlError;
use crate::formula::{Expr, Formula};
use crate::leaf::{BoundExpression, Leaf};
use crate::monitor::Monitor;
use crate::number::Ratio;
use crate::program::{BooleanOp, BoundProgram, Edge, Id, MinMax, Op, Strength};
use crate::settings::{Constants, Names, Settings};
use crate::syntax::{Binary, Comparison, Node, NodeKind, Term, Unary};
use crate::trace::{Schema, SignalKind};
use crate::trace_operators::SampleWindow;
use crate::undefined;

mod names;
mod times;

use names::{NameScope, not_finite};

/// Greatest depth of a formula after named formulas are expanded.
const MAX_DEPTH: usize = 200;

impl Formula {
    /// Binds names to the signals of `schema` and to `constants`.
    ///
    /// # Errors
    /// - An unknown name.
    /// - A Boolean where a number is expected, or the reverse.
    /// - A bound that is not a multiple of the sampling period.
    /// - A formula that looks too far ahead or back.
    pub fn bind(&self, schema: &Schema, constants: &Constants) -> Result<Monitor, StlError> {
        let names = Names {
            constants: constants.clone(),
            ..Names::default()
        };
        self.bind_with(schema, &names, &Settings::default())
    }

    /// Binds like [`Formula::bind`], with named formulas and other settings.
    ///
    /// # Errors
    /// As [`Formula::bind`], and a named formula that is defined by itself.
    pub fn bind_with(
        &self,
        schema: &Schema,
        names: &Names,
        settings: &Settings,
    ) -> Result<Monitor, StlError> {
        // Negated, so that NaN is refused as well. Settings have no place in the text,
        // hence the empty spans.
        if let Some(rho_max) = settings.rho_max
            && !(rho_max.is_finite() && rho_max > 0.0)
        {
            let what = format!("rho_max must be positive and finite, not {rho_max}");
            return Err(StlError::new(what, 0..0, "cannot be clamped"));
        }
        // As a fraction, so that bounds are compared with multiples of it exactly.
        let period = Ratio::from_f64(schema.dt_s()).ok_or_else(|| {
            let what = format!(
                "the sampling period {} s is no manageable fraction",
                schema.dt_s()
            );
            StlError::new(what, 0..0, "cannot be sampled")
        })?;
        let mut binder = Binder {
            scope: NameScope { schema, names },
            settings,
            period,
            program: BoundProgram::new(schema),
            open: Vec::new(),
            depth: 0,
        };
        binder.node(&self.root)?;
        // After binding, since the sense of a comparison depends on the whole formula.
        Ok(Monitor::new(undefined::settle(binder.program), settings))
    }
}

impl Expr {
    /// Binds names to the signals of `schema` and to `constants`.
    ///
    /// # Errors
    /// An unknown name, a Boolean signal, or a constant part that is not finite.
    pub fn bind(&self, schema: &Schema, constants: &Constants) -> Result<BoundExpr, StlError> {
        let names = Names {
            constants: constants.clone(),
            ..Names::default()
        };
        let value = NameScope {
            schema,
            names: &names,
        }
        .value(&self.root)?;
        Ok(BoundExpr {
            value,
            width: schema.len(),
        })
    }
}

/// Expression bound to a schema, which maps a row to a number.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundExpr {
    pub(crate) value: BoundExpression,
    width: usize,
}

impl BoundExpr {
    /// Returns the positions in a row of the signals read.
    pub fn signals(&self) -> Vec<usize> {
        let mut all = Vec::new();
        self.value.signals(&mut |signal| all.push(signal));
        all
    }

    /// Returns the value in a row.
    ///
    /// Arithmetic follows IEEE 754, so a division by zero is ±inf. An undefined
    /// value (0/0, the root of a negative number) is NaN and stays NaN in every
    /// operation, in `min`, `max` and `pow` too.
    ///
    /// # Panics
    /// The row is shorter than the schema to which the expression is bound.
    pub fn eval(&self, row: &[f64]) -> f64 {
        assert!(
            self.width <= row.len(),
            "a row of {} for {} signals",
            row.len(),
            self.width
        );
        self.value.at(row)
    }
}

/// Extent of a comparison in its place in the text.
#[derive(Clone, Copy)]
enum Whole {
    Yes,
    No,
}

/// Formula while its names are bound.
struct Binder<'a> {
    scope: NameScope<'a>,
    settings: &'a Settings,
    period: Ratio,
    program: BoundProgram,
    /// Named formulas being bound, outermost first.
    open: Vec<&'a str>,
    depth: usize,
}

impl<'a> Binder<'a> {
    fn node(&mut self, node: &Arc<Node>) -> Result<Id, StlError> {
        // Not restored on an error, which ends the binding.
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            let what = format!("the formula is nested deeper than {MAX_DEPTH} levels");
            return Err(StlError::new(what, node.span.0.clone(), "too deep"));
        }
        let id = self.operator(node)?;
        self.depth -= 1;
        Ok(id)
    }

    fn operator(&mut self, node: &Arc<Node>) -> Result<Id, StlError> {
        match &node.kind {
            NodeKind::Constant(value) => self.push(Op::Constant(*value), node),
            NodeKind::Name(name) => self.name(name, node),
            NodeKind::Compare(first, rest) => self.comparison(first, rest, node),
            NodeKind::In(x, range) => {
                // A range is two comparisons, so its robustness is the distance to the
                // nearer end.
                let low = (Comparison::GreaterEqual, range.0.clone());
                let high = (Comparison::LessEqual, range.1.clone());
                let low = self.pair(x, &low, node, Whole::No)?;
                let high = self.pair(x, &high, node, Whole::No)?;
                self.check_order(range)?;
                self.push(Op::Gate(BooleanOp::And, low, high), node)
            }
            NodeKind::Not(a) => {
                let a = self.node(a)?;
                self.push(Op::Not(a), node)
            }
            NodeKind::And(all) => self.all_of(BooleanOp::And, all, node),
            NodeKind::Or(all) => self.all_of(BooleanOp::Or, all, node),
            NodeKind::Implies(a, b) => self.gate(BooleanOp::Implies, a, b, node),
            NodeKind::Iff(a, b) => self.gate(BooleanOp::Iff, a, b, node),
            NodeKind::Xor(a, b) => self.gate(BooleanOp::Xor, a, b, node),
            NodeKind::Unary(op, bounds, a) => {
                let window = self.window(bounds.as_ref())?;
                // `Min` of an empty window is +inf and `Max` is −inf. That alone makes `next`
                // and `prev` weak or strong at the ends of a trace.
                let one = SampleWindow {
                    from: 1,
                    to: Some(1),
                };
                let a = self.node(a)?;
                let op = match op {
                    Unary::Always => Op::Ahead(MinMax::Min, window, a),
                    Unary::Eventually => Op::Ahead(MinMax::Max, window, a),
                    Unary::Historically => Op::Behind(MinMax::Min, window, a),
                    Unary::Once => Op::Behind(MinMax::Max, window, a),
                    Unary::Next => Op::Ahead(MinMax::Min, one, a),
                    Unary::StrongNext => Op::Ahead(MinMax::Max, one, a),
                    Unary::Prev => Op::Behind(MinMax::Min, one, a),
                    Unary::StrongPrev => Op::Behind(MinMax::Max, one, a),
                    Unary::Rise => Op::Edge(Edge::Rise, a),
                    Unary::Fall => Op::Edge(Edge::Fall, a),
                };
                self.push(op, node)
            }
            NodeKind::Binary(op, bounds, a, b) => {
                let window = self.window(bounds.as_ref())?;
                let (a, b) = (self.node(a)?, self.node(b)?);
                let op = match op {
                    // Release is the dual of until: the same operator with exchanged extrema.
                    Binary::Until => Op::Until(MinMax::Max, Strength::Strong, window, a, b),
                    Binary::Unless => Op::Until(MinMax::Max, Strength::Weak, window, a, b),
                    Binary::Release => Op::Until(MinMax::Min, Strength::Strong, window, a, b),
                    Binary::Since => Op::Since(window, a, b),
                };
                self.push(op, node)
            }
        }
    }

    fn push(&mut self, op: Op, node: &Arc<Node>) -> Result<Id, StlError> {
        let limits = &self.settings.limits;
        // Named formulas are expanded at every use, so sizes can grow exponentially.
        if limits.operators <= self.program.instructions.len() {
            let what = format!("the formula has more than {} operators", limits.operators);
            return Err(StlError::new(what, node.span.0.clone(), "too large"));
        }
        self.program
            .push(op, node.clone(), limits.horizon_samples)
            .ok_or_else(|| {
                let what = format!(
                    "the formula looks further than {} samples",
                    limits.horizon_samples
                );
                StlError::new(what, node.span.0.clone(), "too far").with_help(format!(
                    "one sample is {} s; `end` means to the end of the trace",
                    self.period
                ))
            })
    }

    fn gate(
        &mut self,
        gate: BooleanOp,
        a: &Arc<Node>,
        b: &Arc<Node>,
        node: &Arc<Node>,
    ) -> Result<Id, StlError> {
        let (a, b) = (self.node(a)?, self.node(b)?);
        self.push(Op::Gate(gate, a, b), node)
    }

    /// Builds a balanced tree, so that a thousand rules are ten levels deep.
    fn all_of(
        &mut self,
        gate: BooleanOp,
        all: &[Arc<Node>],
        node: &Arc<Node>,
    ) -> Result<Id, StlError> {
        match all {
            [only] => self.node(only),
            _ => {
                let (left, right) = all.split_at(all.len() / 2);
                let (a, b) = (
                    self.all_of(gate, left, node)?,
                    self.all_of(gate, right, node)?,
                );
                self.push(Op::Gate(gate, a, b), node)
            }
        }
    }

    fn comparison(
        &mut self,
        first: &Term,
        rest: &[(Comparison, Term)],
        node: &Arc<Node>,
    ) -> Result<Id, StlError> {
        // A lone comparison is explained by its own text, a chain by the pair that
        // decides.
        let alone = if rest.len() == 1 {
            Whole::Yes
        } else {
            Whole::No
        };
        let mut left = first;
        let mut whole = None;
        for side in rest {
            let pair = self.pair(left, side, node, alone)?;
            whole = Some(match whole {
                None => pair,
                Some(before) => self.push(Op::Gate(BooleanOp::And, before, pair), node)?,
            });
            left = &side.1;
        }
        // Invariant: the parser never makes a comparison without a right side.
        whole.ok_or_else(|| StlError::new("nothing is compared", node.span.0.clone(), "empty"))
    }

    /// Binds a comparison, the whole of `node` or a single pair of its chain.
    fn pair(
        &mut self,
        left: &Term,
        side: &(Comparison, Term),
        node: &Arc<Node>,
        whole: Whole,
    ) -> Result<Id, StlError> {
        let leaf = self.leaf(left, side.0, &side.1)?;
        let source = match whole {
            Whole::Yes => node.clone(),
            // A node of its own, so that explanations show the pair and not the chain.
            Whole::No => {
                let kind = NodeKind::Compare(left.clone(), vec![side.clone()]);
                Arc::new(Node::new(kind, node.span.0.clone()))
            }
        };
        self.push(Op::Leaf(leaf), &source)
    }

    /// Refuses constant ends of a range in the wrong order, between which nothing lies.
    fn check_order(&self, range: &(Term, Term)) -> Result<(), StlError> {
        let ends = (self.scope.value(&range.0)?, self.scope.value(&range.1)?);
        let (BoundExpression::Number(low), BoundExpression::Number(high)) = ends else {
            return Ok(());
        };
        if low <= high {
            return Ok(());
        }
        let what = format!("no number lies in [{}, {}]", range.0, range.1);
        let span = range.0.span.0.start..range.1.span.0.end;
        let help = format!("write [{}, {}]", range.1, range.0);
        Err(StlError::new(what, span, format!("{low} is above {high}")).with_help(help))
    }

    fn leaf(&self, left: &Term, op: Comparison, right: &Term) -> Result<Leaf, StlError> {
        Ok(Leaf::compare(
            self.scope.value(left)?,
            op,
            self.scope.value(right)?,
        ))
    }

    /// Binds a name in a formula: a Boolean signal or a named formula.
    fn name(&mut self, name: &Arc<str>, node: &Arc<Node>) -> Result<Id, StlError> {
        let span = node.span.0.clone();
        let scope = &self.scope;
        if let Some(signal) = scope.schema.position(name) {
            return match scope.schema.signals()[signal].kind {
                SignalKind::Boolean => self.push(Op::Leaf(Leaf::boolean(signal)), node),
                SignalKind::Real => Err(StlError::new(
                    format!("the signal `{name}` is a number, not true or false"),
                    span,
                    "a number",
                )
                .with_help(format!("compare it with something, such as `{node} > 0`"))),
            };
        }
        if scope.names.constants.contains_key(&**name) {
            let error = StlError::new(
                format!("the constant `{name}` is a number, not true or false"),
                span,
                "a number",
            );
            return Err(
                error.with_help(format!("compare something with it, such as `x >= {node}`"))
            );
        }
        let Some((name, formula)) = scope.names.formulas.get_key_value(&**name) else {
            return Err(scope.unknown(name, span));
        };
        // Without this check the expansion would never end.
        if let Some(at) = self.open.iter().position(|open| open == name) {
            let mut path = self.open[at..].join("` → `");
            let _ = write!(path, "` → `{name}");
            return Err(StlError::new(
                format!("the formula `{name}` is defined by itself"),
                span,
                "comes back to itself",
            )
            .with_help(format!("`{path}`")));
        }
        self.open.push(name);
        // Spans below refer to the text of the named formula, as the error records.
        let id = self
            .node(&formula.root)
            .map_err(|error| error.inside(name))?;
        self.open.pop();
        Ok(id)
    }
}
