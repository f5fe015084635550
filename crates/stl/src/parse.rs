//! Parsing of tokens to a syntax tree, by operator precedence.
//!
//! Tightest first: arithmetic, comparison, `not` and the temporal prefixes,
//! until and release, unless, since (in this order, as in RTAMT), and, or,
//! implies (to the right), iff, xor. Formulas and numbers share one grammar, so
//! that `(x + 1) * 2 > 3` and `(x > 1) and y` need no look-ahead. The sort of an
//! operand is checked when an operator takes it.

use std::sync::Arc;

use crate::error::{StlError, suggest};
use crate::syntax::{Arithmetic, Comparison, Function, Node, NodeKind, Term, TermKind, Unary};
use crate::token::{Spanned, Token};

mod bounds;
mod complaints;
mod cursor;
mod parsed;
mod words;

use complaints::describe;
use cursor::Parser;
use parsed::{Parsed, join};
pub(crate) use words::is_keyword;
use words::{
    Infix, Logic, Prefix, infix_of, is_prefix_letter, is_word_operator, prefix_of, starts_operand,
    strength,
};

pub(crate) fn parse_formula(text: &str) -> Result<Box<Node>, StlError> {
    let mut parser = Parser::new(text)?;
    let parsed = parser.expression(strength::LOOSEST)?;
    parser.finish()?;
    parsed.into_formula("a formula is expected here")
}

pub(crate) fn parse_term(text: &str) -> Result<Box<Term>, StlError> {
    let mut parser = Parser::new(text)?;
    let parsed = parser.expression(strength::LOOSEST)?;
    parser.finish()?;
    parsed.into_term("a number is expected here")
}

impl<'a> Parser<'a> {
    fn expression(&mut self, loosest: u8) -> Result<Parsed, StlError> {
        // Counts recursion, so that no text can overflow the stack.
        self.descend()?;
        let mut left = self.operand()?;
        while let Some(infix) = infix_of(&self.peek(0).token) {
            if infix.strength() < loosest {
                break;
            }
            let operator = self.advance();
            left = self.combine(left, infix, operator)?;
        }
        // Not restored on an error, which ends the parsing.
        self.nesting -= 1;
        Ok(left)
    }

    fn combine(
        &mut self,
        left: Parsed,
        infix: Infix,
        operator: Spanned<'a>,
    ) -> Result<Parsed, StlError> {
        match infix {
            Infix::Compare(op) => self.comparison(left, op, operator),
            Infix::In => self.membership(left, operator),
            Infix::Arithmetic(op) => self.arithmetic(left, op, operator),
            Infix::Logic(logic) => self.logic(left, logic, operator),
        }
    }

    fn arithmetic(
        &mut self,
        left: Parsed,
        op: Arithmetic,
        operator: Spanned<'a>,
    ) -> Result<Parsed, StlError> {
        let what = format!("{} needs numbers", describe(&operator.token));
        // A tighter right side groups to the left.
        let tighter = Infix::Arithmetic(op).strength() + 1;
        let left = left.into_term(&what)?;
        let right = self.expression(tighter)?.into_term(&what)?;
        let span = left.span.0.start..right.span.0.end;
        Parsed::term(TermKind::Calculated(op, Box::new((*left, *right))), span)
    }

    fn logic(
        &mut self,
        left: Parsed,
        logic: Logic,
        operator: Spanned<'a>,
    ) -> Result<Parsed, StlError> {
        let what = format!("{} needs formulas", describe(&operator.token));
        // `=>` for "at least" is a likely slip, so the error explains the symbol.
        let hint = |error: StlError| match operator.token {
            Token::Symbol("=>") => error.with_help("`=>` is implication; \"at least\" is `>=`"),
            _ => error,
        };
        let left = left.into_formula(&what).map_err(hint)?;
        let bounds = match logic {
            Logic::Temporal(_) => self.bounds()?,
            _ => self.no_bounds(&operator.token, |word, bounds| {
                format!("write `… {word} eventually{bounds} …` or `always{bounds} (… {word} …)`")
            })?,
        };
        // Implication groups to the right, every other operator to the left.
        let tighter = Infix::Logic(logic).strength() + u8::from(logic != Logic::Implies);
        let right = self
            .expression(tighter)?
            .into_formula(&what)
            .map_err(hint)?;
        join(logic, bounds, *left, *right)
    }

    /// Parses `first op second op third …`, which compares every neighbouring pair.
    fn comparison(
        &mut self,
        left: Parsed,
        op: Comparison,
        operator: Spanned<'a>,
    ) -> Result<Parsed, StlError> {
        let equality = matches!(op, Comparison::Equal | Comparison::NotEqual);
        let hint = |error: StlError| {
            if equality {
                error.with_help("two formulas are compared with `iff` or `xor`")
            } else {
                error
            }
        };
        let what = format!("{} compares numbers", describe(&operator.token));
        let first = left.into_term(&what).map_err(hint)?;
        let mut rest = Vec::new();
        let mut op = Some(op);
        // A loop, since the chain `a < b < c` is a single node without nesting.
        while let Some(comparison) = op {
            // Tighter than a comparison, so that the next one stays in the chain.
            let right = self
                .expression(strength::COMPARE + 1)?
                .into_term(&what)
                .map_err(hint)?;
            rest.push((comparison, *right));
            op = match infix_of(&self.peek(0).token) {
                Some(Infix::Compare(next)) => {
                    self.advance();
                    Some(next)
                }
                _ => None,
            };
        }
        let end = rest
            .last()
            .map_or(first.span.0.end, |(_, term)| term.span.0.end);
        let span = first.span.0.start..end;
        Parsed::formula(NodeKind::Compare(*first, rest), span)
    }

    /// Parses `x in [low, high]`.
    fn membership(&mut self, left: Parsed, operator: Spanned<'a>) -> Result<Parsed, StlError> {
        let what = format!("{} needs numbers", describe(&operator.token));
        let x = left.into_term(&what)?;
        let open = self.peek(0).span.clone();
        if !self.take_symbol("[") {
            return Err(self.unexpected("`[` and a range such as `[0, 1]`"));
        }
        let low = self.expression(strength::COMPARE + 1)?.into_term(&what)?;
        // A colon is accepted too, as in the bounds `[0:2]` of other STL tools.
        if !self.take_symbol(",") && !self.take_symbol(":") {
            return Err(self.unexpected("`,` and the upper end of the range"));
        }
        let high = self.expression(strength::COMPARE + 1)?.into_term(&what)?;
        let end = self.close("]", open)?;
        let span = x.span.0.start..end;
        Parsed::formula(NodeKind::In(*x, Box::new((*low, *high))), span)
    }

    fn operand(&mut self) -> Result<Parsed, StlError> {
        if let Some(prefix) = self.prefix() {
            return self.prefixed(prefix);
        }
        let Spanned { token, span } = self.peek(0).clone();
        match token {
            Token::Number(digits) => {
                self.advance();
                // `1e999` parses to infinity.
                let value = digits
                    .parse::<f64>()
                    .ok()
                    .filter(|v| v.is_finite())
                    .ok_or_else(|| {
                        StlError::new("this number is too large", span.clone(), "not finite")
                    })?;
                Parsed::term(TermKind::Number(value), span)
            }
            Token::Quoted(name) => {
                // Quotes make a name of any word, even of an operator.
                self.advance();
                Ok(Parsed::Name(name.into(), span))
            }
            Token::Symbol("(") => self.parenthesised(),
            Token::Word("true" | "TRUE" | "false" | "FALSE") => {
                self.advance();
                let value = matches!(token, Token::Word("true" | "TRUE"));
                Parsed::formula(NodeKind::Constant(value), span)
            }
            Token::Word(word) if is_word_operator(word) => {
                // An operator here lacks its left side, and it cannot be a name.
                Err(self.unexpected("a formula or a number"))
            }
            // A name before `(` can only be a function, so a misspelt name is reported.
            Token::Word(word) if self.peek(1).token == Token::Symbol("(") => self.call(word),
            Token::Word(word) => {
                self.advance();
                self.skip_breach_time();
                Ok(Parsed::Name(word.into(), span))
            }
            _ => Err(self.unexpected("a formula or a number")),
        }
    }

    fn parenthesised(&mut self) -> Result<Parsed, StlError> {
        let open = self.advance().span;
        let inner = self.expression(strength::LOOSEST)?;
        let end = self.close(")", open.clone())?;
        Ok(inner.with_span(open.start..end))
    }

    /// Skips the time of a signal in Breach's notation, `x[t]`.
    fn skip_breach_time(&mut self) {
        let tokens = [0, 1, 2].map(|ahead| self.peek(ahead).token);
        if tokens == [Token::Symbol("["), Token::Word("t"), Token::Symbol("]")] {
            self.at += 3;
        }
    }

    /// Returns the prefix operator here, a single letter only in a prefix position.
    fn prefix(&self) -> Option<Prefix> {
        let prefix = prefix_of(&self.peek(0).token)?;
        let Token::Word(word) = self.peek(0).token else {
            return Some(prefix);
        };
        if !is_prefix_letter(word) {
            return Some(prefix);
        }
        let next = self.peek(1);
        let operator = match next.token {
            Token::Symbol("[") => true,
            // `G -x > 0` is an operator, `G - x > 0` and `G-x > 0` are differences.
            Token::Symbol("-") => {
                self.peek(0).span.end < next.span.start && next.span.end == self.peek(2).span.start
            }
            // `G U x` is the name G until x, `G U > 3` is always (U > 3).
            Token::Word("U" | "R" | "W" | "S") => {
                !starts_operand(&self.peek(2).token) && !self.at_bounds(2)
            }
            ref token => starts_operand(token),
        };
        operator.then_some(prefix)
    }

    fn at_bounds(&self, ahead: usize) -> bool {
        self.peek(ahead).token == Token::Symbol("[")
    }

    fn prefixed(&mut self, prefix: Prefix) -> Result<Parsed, StlError> {
        let operator = self.advance();
        let word = describe(&operator.token);
        let start = operator.span.start;
        if prefix == Prefix::Negate {
            let inner = self.expression(strength::NEGATE)?;
            let term = inner
                .into_term("`-` needs a number")
                .map_err(|e| e.with_help("negate a formula with `not`"))?;
            let span = start..term.span.0.end;
            // A negative literal is a number, so it prints and folds as such.
            let kind = match term.kind {
                TermKind::Number(value) => TermKind::Number(-value),
                _ => TermKind::Negative(term),
            };
            return Parsed::term(kind, span);
        }
        let bounds = match prefix {
            Prefix::Temporal(op) if op.takes_bounds() => self.bounds()?,
            _ => self.no_bounds(&operator.token, |word, bounds| match prefix {
                Prefix::Temporal(Unary::Next | Unary::StrongNext) => {
                    "`always[a, a]` looks several samples ahead".to_owned()
                }
                Prefix::Temporal(Unary::Prev | Unary::StrongPrev) => {
                    "`historically[a, a]` looks several samples back".to_owned()
                }
                Prefix::Not => {
                    format!("write `{word} eventually{bounds} …` or `always{bounds} {word} …`")
                }
                _ => format!("write `eventually{bounds} {word} …`"),
            })?,
        };
        let inner = self
            .expression(strength::PREFIX)?
            .into_formula(&format!("{word} needs a formula"))?;
        let span = start..inner.span.0.end;
        let kind = match prefix {
            Prefix::Temporal(op) => NodeKind::Unary(op, bounds, Arc::from(inner)),
            Prefix::Not | Prefix::Negate => NodeKind::Not(Arc::from(inner)),
        };
        Parsed::formula(kind, span)
    }

    /// Parses `name(argument, …)`.
    fn call(&mut self, word: &str) -> Result<Parsed, StlError> {
        let name = self.advance().span;
        let Some(function) = Function::parse(word) else {
            let error = StlError::new(
                format!("there is no function `{word}`"),
                name,
                "unknown function",
            );
            // A misspelt operator before `(` looks like a call, so operators come first.
            let functions = || suggest(word, "functions", Function::NAMES.into_iter());
            return Err(error.maybe_help(words::closest_operator(word).or_else(functions)));
        };
        let open = self.advance().span;
        let mut arguments = Vec::new();
        if !self.at_symbol(")") {
            loop {
                let argument = self.expression(strength::LOOSEST)?;
                arguments.push(*argument.into_term(&format!("`{word}` takes numbers"))?);
                if !self.take_symbol(",") {
                    break;
                }
            }
        }
        let end = self.close(")", open)?;
        let (fewest, most) = function.arity();
        // The whole call is marked, since the error is in the number of arguments.
        if arguments.len() < fewest || most < arguments.len() {
            let wants = match (fewest, most) {
                (1, _) => "1 argument".to_owned(),
                (2, 2) => "2 arguments".to_owned(),
                _ => format!("{fewest} to {most} arguments"),
            };
            return Err(StlError::new(
                format!("`{word}` takes {wants}, not {}", arguments.len()),
                name.start..end,
                "wrong number of arguments",
            ));
        }
        Parsed::term(TermKind::Call(function, arguments), name.start..end)
    }

    fn finish(&self) -> Result<(), StlError> {
        match self.peek(0).token {
            Token::End => Ok(()),
            _ => Err(self.unexpected("an operator or the end")),
        }
    }
}
