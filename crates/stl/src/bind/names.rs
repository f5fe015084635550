//! Names and terms of expressions, bound to signals and constants.

use std::ops::Range;

use crate::error::{StlError, suggest};
use crate::leaf::BoundExpression;
use crate::settings::Names;
use crate::syntax::{Arithmetic, Term, TermKind};
use crate::trace::{Schema, SignalKind};

/// Meanings of a name: a signal, else a constant, else a formula.
pub(super) struct NameScope<'a> {
    pub(super) schema: &'a Schema,
    pub(super) names: &'a Names,
}

impl<'a> NameScope<'a> {
    pub(super) fn value(&self, term: &Term) -> Result<BoundExpression, StlError> {
        let value = match &term.kind {
            TermKind::Number(value) => BoundExpression::Number(*value),
            TermKind::Name(name) => return self.number(name, term.span.0.clone()),
            TermKind::Negative(a) => BoundExpression::Negative(Box::new(self.value(a)?)),
            TermKind::Calculated(op, sides) => BoundExpression::Calculated(
                *op,
                Box::new((self.value(&sides.0)?, self.value(&sides.1)?)),
            ),
            TermKind::Call(function, all) => {
                let all = all
                    .iter()
                    .map(|a| self.value(a))
                    .collect::<Result<_, _>>()?;
                BoundExpression::Call(*function, all)
            }
        };
        // Folded on the way up: leaves then compare a signal with a plain number. A
        // constant that is not finite is also found before any trace.
        fold_constant(value, term)
    }

    fn number(&self, name: &str, span: Range<usize>) -> Result<BoundExpression, StlError> {
        if let Some(signal) = self.schema.position(name) {
            return match self.schema.signals()[signal].kind {
                SignalKind::Real => Ok(BoundExpression::Signal(signal)),
                SignalKind::Boolean => Err(StlError::new(
                    format!("the signal `{name}` is Boolean, not a number"),
                    span,
                    "true or false",
                )
                .with_help(format!(
                    "write `{name}` or `not {name}`; two of them compare with `iff` or `xor`"
                ))),
            };
        }
        if let Some(value) = self.names.constants.get(name) {
            return if value.is_finite() {
                Ok(BoundExpression::Number(*value))
            } else {
                Err(not_finite(name, *value, span))
            };
        }
        if self.names.formulas.contains_key(name) {
            return Err(StlError::new(
                format!("`{name}` is a formula, not a number"),
                span,
                "true or false",
            ));
        }
        Err(self.unknown(name, span))
    }

    pub(super) fn unknown(&self, name: &str, span: Range<usize>) -> StlError {
        let constants = self.names.constants.keys().map(String::as_str);
        let formulas = self.names.formulas.keys().map(String::as_str);
        let signals = self.schema.signals().iter().map(|s| s.name.as_str());
        let error = StlError::new(
            format!("there is no signal, constant or formula `{name}`"),
            span,
            "unknown name",
        );
        error.maybe_help(suggest(
            name,
            "known",
            signals.chain(constants).chain(formulas),
        ))
    }
}

pub(super) fn not_finite(name: &str, value: f64, span: Range<usize>) -> StlError {
    StlError::new(
        format!("the constant `{name}` is {value}, not a finite number"),
        span,
        "not finite",
    )
}

/// Evaluates a value without signals.
fn fold_constant(value: BoundExpression, term: &Term) -> Result<BoundExpression, StlError> {
    // Refused even for a signal divided by 0, which is ±inf or NaN at every sample.
    if let BoundExpression::Calculated(Arithmetic::Divide, sides) = &value
        && sides.1 == BoundExpression::Number(0.0)
    {
        return Err(StlError::new(
            format!("`{term}` divides by zero"),
            term.span.0.clone(),
            "not a finite number",
        ));
    }
    let constant = match &value {
        BoundExpression::Negative(a) => matches!(**a, BoundExpression::Number(_)),
        BoundExpression::Calculated(_, sides) => matches!(
            **sides,
            (BoundExpression::Number(_), BoundExpression::Number(_))
        ),
        BoundExpression::Call(_, all) => {
            all.iter().all(|a| matches!(a, BoundExpression::Number(_)))
        }
        BoundExpression::Number(_) | BoundExpression::Signal(_) => return Ok(value),
    };
    if !constant {
        return Ok(value);
    }
    // Without signals no row is read.
    let number = value.at(&[]);
    if number.is_finite() {
        Ok(BoundExpression::Number(number))
    } else {
        Err(StlError::new(
            format!("`{term}` is {number}"),
            term.span.0.clone(),
            "not a finite number",
        ))
    }
}
