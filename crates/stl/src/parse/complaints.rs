//! Errors for a text that does not parse.

use std::ops::Range;

use super::cursor::Parser;
use super::words;
use crate::error::StlError;
use crate::syntax::{Node, Term};
use crate::token::{Spanned, Token};

/// Greatest depth of the syntax tree.
const MAX_DEPTH: usize = 100;
/// Greatest depth of the parser's recursion, in which parentheses count too.
const MAX_NESTING: usize = 2 * MAX_DEPTH + 16;

impl Parser<'_> {
    pub(super) fn descend(&mut self) -> Result<(), StlError> {
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return Err(too_deep(self.peek(0).span.clone()));
        }
        Ok(())
    }

    pub(super) fn close(&mut self, symbol: &str, open: Range<usize>) -> Result<usize, StlError> {
        let here = self.peek(0).clone();
        if self.take_symbol(symbol) {
            return Ok(here.span.end);
        }
        // The opening bracket is marked, since the end of the text shows nothing.
        if here.token == Token::End {
            let opener = if symbol == ")" { "(" } else { "[" };
            return Err(StlError::new(
                format!("this `{opener}` is never closed"),
                open,
                "opened here",
            )
            .with_help(format!("add a `{symbol}`")));
        }
        Err(self.unexpected(&format!("an operator or `{symbol}`")))
    }

    pub(super) fn unexpected(&self, expected: &str) -> StlError {
        let Spanned { token, span } = self.peek(0).clone();
        // An empty text gets an example instead of a list of expected tokens.
        if token == Token::End && self.at == 0 {
            return StlError::new("there is no formula", span, "empty")
                .with_help("write something like `always[0, 10] (speed <= 30)`");
        }
        let error = StlError::new(
            format!("expected {expected}, found {}", describe(&token)),
            span,
            format!("expected {expected}"),
        );
        let before = self.at.checked_sub(1).map(|at| &self.tokens[at]);
        // `2x` is two adjacent tokens, `2 x` may be anything.
        let adjacent = before.is_some_and(|before| before.span.end == error.span().start);
        match (before.map(|before| &before.token), token) {
            // A misspelt operator is read as a name, and parsing fails at the next token.
            (Some(Token::Word(name)), _) if let Some(close) = words::closest_operator(name) => {
                let span = before.map_or(0..0, |before| before.span.clone());
                StlError::new(
                    format!("there is no operator `{name}`"),
                    span,
                    "unknown operator",
                )
                .with_help(close)
            }
            (_, Token::Word(word)) if let Some(close) = words::closest_operator(word) => {
                error.with_help(close)
            }
            (Some(Token::Number(number)), Token::Word(word)) if adjacent => {
                error.with_help(format!("a product is written `{number} * {word}`"))
            }
            (Some(Token::Word(name)), Token::Symbol("[")) => error.with_help(format!(
                "`{name}` is read as a name here, and a name has no bounds"
            )),
            (_, Token::Symbol(")")) if expected.starts_with("an operator") => {
                error.with_help("there is no `(` for this `)`")
            }
            _ => error,
        }
    }
}

pub(super) fn checked(node: Node) -> Result<Node, StlError> {
    if node.depth > MAX_DEPTH {
        Err(too_deep(node.span.0))
    } else {
        Ok(node)
    }
}

pub(super) fn checked_term(term: Term) -> Result<Term, StlError> {
    if term.depth > MAX_DEPTH {
        Err(too_deep(term.span.0))
    } else {
        Ok(term)
    }
}

fn too_deep(span: Range<usize>) -> StlError {
    StlError::new(
        format!("this is nested deeper than {MAX_DEPTH} levels"),
        span,
        "too deep",
    )
    .with_help("split it into named formulas")
}

pub(super) fn describe(token: &Token<'_>) -> String {
    match token {
        Token::Word(text) | Token::Number(text) => format!("`{text}`"),
        Token::Quoted(text) => format!("\"{text}\""),
        Token::Symbol(text) => format!("`{text}`"),
        Token::End => "the end".to_owned(),
    }
}
