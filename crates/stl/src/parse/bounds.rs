//! Bounds of temporal operators: `[0, 2]`, `[0:T]`, `[100 ms, 2 * T]`, `[1, end]`.

use super::complaints::describe;
use super::cursor::Parser;
use super::words::is_word_operator;
use crate::error::StlError;
use crate::number::Decimal;
use crate::syntax::{Arithmetic, Span, Time, TimeBounds, TimeKind, TimeUnit};
use crate::token::{Spanned, Token};

/// Greatest depth of a calculated time.
const MAX_TIME_DEPTH: usize = 16;

impl<'a> Parser<'a> {
    /// Parses the bounds here, if any.
    pub(super) fn bounds(&mut self) -> Result<Option<TimeBounds>, StlError> {
        let open = self.peek(0).span.clone();
        if !self.take_symbol("[") {
            return Ok(None);
        }
        let here = self.peek(0).clone();
        // An endless beginning would be an empty window.
        if is_endless(&here.token) {
            return Err(
                StlError::new("a window begins at a time", here.span, "not a time")
                    .with_help("only the second bound can be `inf` or `end`"),
            );
        }
        let from = self.time(0)?;
        // Both separators are common, and RTAMT writes `[a:b]`.
        if !self.take_symbol(",") && !self.take_symbol(":") {
            return Err(self.unexpected("`,` and the second bound").maybe_help(
                (self.at_symbol("]"))
                    .then(|| format!("bounds are two times, such as `[0, {from}]`")),
            ));
        }
        let to = if is_endless(&self.peek(0).token) {
            self.advance();
            None
        } else {
            Some(self.time(0)?)
        };
        let end = self.peek(0).span.end;
        if !self.take_symbol("]") {
            return match self.peek(0).token {
                Token::End => Err(
                    StlError::new("this `[` is never closed", open, "opened here")
                        .with_help("add a `]`"),
                ),
                _ => Err(self.unexpected("`]`")),
            };
        }
        Ok(Some(TimeBounds {
            from,
            to,
            span: Span(open.start..end),
        }))
    }

    /// Refuses bounds behind an operator that takes none.
    ///
    /// `help` gets the operator and the bounds as texts.
    pub(super) fn no_bounds(
        &mut self,
        operator: &Token<'_>,
        help: impl FnOnce(&str, &str) -> String,
    ) -> Result<Option<TimeBounds>, StlError> {
        if !self.at_symbol("[") {
            return Ok(None);
        }
        let open = self.peek(0).span.clone();
        // Errors inside these bounds are not the first thing to correct.
        let (bounds, span) = match self.bounds() {
            Ok(Some(bounds)) => (bounds.to_string(), bounds.span.0),
            _ => ("[a, b]".to_owned(), open),
        };
        let word = describe(operator);
        let error = StlError::new(format!("{word} takes no bounds"), span, "not allowed here");
        Err(error.with_help(help(word.trim_matches('`'), &bounds)))
    }

    /// Parses a sum or a product of times. `loosest` is 0 for sums, 1 for products.
    fn time(&mut self, loosest: u8) -> Result<Time, StlError> {
        self.descend()?;
        let mut left = self.time_operand()?;
        loop {
            let (op, strength) = match self.peek(0).token {
                Token::Symbol("+") => (Arithmetic::Add, 0),
                Token::Symbol("-") => (Arithmetic::Subtract, 0),
                Token::Symbol("*") => (Arithmetic::Multiply, 1),
                Token::Symbol("/") => (Arithmetic::Divide, 1),
                _ => break,
            };
            if strength < loosest {
                break;
            }
            self.advance();
            // A stronger right side groups to the left, as in expressions.
            let right = self.time(strength + 1)?;
            let span = left.span.0.start..right.span.0.end;
            left = checked(Time::new(
                TimeKind::Calculated(op, Box::new((left, right))),
                span,
            ))?;
        }
        self.nesting -= 1;
        Ok(left)
    }

    fn time_operand(&mut self) -> Result<Time, StlError> {
        let Spanned { token, span } = self.peek(0).clone();
        let kind = match token {
            Token::Number(digits) => {
                // Digits are kept as written: an f64 would lose that 0.3 is three tenths.
                self.advance();
                let Some(value) = Decimal::parse(digits) else {
                    return Err(StlError::new(
                        "this time has too many digits",
                        span,
                        "at most 19 digits, at most 30 places from the point",
                    ));
                };
                TimeKind::Literal(value, self.unit())
            }
            Token::Symbol("-") => {
                self.advance();
                self.descend()?;
                let inner = self.time_operand()?;
                self.nesting -= 1;
                TimeKind::Negative(Box::new(inner))
            }
            Token::Symbol("(") => {
                self.advance();
                let inner = self.time(0)?;
                let end = self.close(")", span.clone())?;
                // The parentheses belong to the place that an error underlines.
                return Ok(Time {
                    span: Span(span.start..end),
                    ..inner
                });
            }
            Token::Quoted(name) => {
                self.advance();
                TimeKind::Name(name.into(), self.unit())
            }
            // An operator here means that the time is missing.
            Token::Word(name) if !is_endless(&token) && !is_word_operator(name) => {
                self.advance();
                TimeKind::Name(name.into(), self.unit())
            }
            _ => return Err(self.unexpected("a time, such as `0`, `1.5`, `200 ms` or a constant")),
        };
        let end = self.tokens[self.at - 1].span.end;
        checked(Time::new(kind, span.start..end))
    }

    fn unit(&mut self) -> Option<TimeUnit> {
        let Token::Word(word) = self.peek(0).token else {
            return None;
        };
        let unit = TimeUnit::parse(word)?;
        self.advance();
        Some(unit)
    }
}

fn is_endless(token: &Token<'_>) -> bool {
    matches!(token, Token::Word("inf" | "end"))
}

fn checked(time: Time) -> Result<Time, StlError> {
    if time.depth > MAX_TIME_DEPTH {
        Err(
            StlError::new("this time is too complicated", time.span.0, "too deep")
                .with_help("give it a name among the constants"),
        )
    } else {
        Ok(time)
    }
}
