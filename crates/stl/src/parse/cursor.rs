//! Position of the parser in its tokens.

use crate::error::StlError;
use crate::token::{Spanned, Token, tokenize};

pub(super) struct Parser<'a> {
    pub(super) tokens: Vec<Spanned<'a>>,
    pub(super) at: usize,
    pub(super) nesting: usize,
}

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str) -> Result<Parser<'a>, StlError> {
        Ok(Parser {
            tokens: tokenize(text)?,
            at: 0,
            nesting: 0,
        })
    }

    /// Returns the `ahead`-th token from here, the end token beyond the end.
    pub(super) fn peek(&self, ahead: usize) -> &Spanned<'a> {
        // Invariant: there is always a last token, the end.
        &self.tokens[(self.at + ahead).min(self.tokens.len() - 1)]
    }

    pub(super) fn advance(&mut self) -> Spanned<'a> {
        let token = self.peek(0).clone();
        self.at += 1;
        token
    }

    pub(super) fn at_symbol(&self, symbol: &str) -> bool {
        matches!(self.peek(0).token, Token::Symbol(s) if s == symbol)
    }

    pub(super) fn take_symbol(&mut self, symbol: &str) -> bool {
        let there = self.at_symbol(symbol);
        self.at += usize::from(there);
        there
    }
}
