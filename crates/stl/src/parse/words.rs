//! Meaning of tokens as operators.

use crate::syntax::{Arithmetic, Binary, Comparison, Unary};
use crate::token::Token;

/// Binding strengths of operators, from loose to tight.
pub(super) mod strength {
    pub(in crate::parse) const LOOSEST: u8 = 0;
    pub(in crate::parse) const XOR: u8 = 1;
    pub(in crate::parse) const IFF: u8 = 2;
    pub(in crate::parse) const IMPLIES: u8 = 3;
    pub(in crate::parse) const OR: u8 = 4;
    pub(in crate::parse) const AND: u8 = 5;
    pub(in crate::parse) const SINCE: u8 = 6;
    pub(in crate::parse) const UNLESS: u8 = 7;
    pub(in crate::parse) const UNTIL: u8 = 8;
    // Looser than a comparison: `not x > 0` negates the whole of it.
    pub(in crate::parse) const PREFIX: u8 = 9;
    pub(in crate::parse) const COMPARE: u8 = 10;
    pub(in crate::parse) const ADD: u8 = 11;
    pub(in crate::parse) const MULTIPLY: u8 = 12;
    pub(in crate::parse) const NEGATE: u8 = 13;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Prefix {
    Not,
    Negate,
    Temporal(Unary),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Infix {
    Logic(Logic),
    Compare(Comparison),
    In,
    Arithmetic(Arithmetic),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Logic {
    Xor,
    Iff,
    Implies,
    Or,
    And,
    Temporal(Binary),
}

impl Infix {
    pub(super) fn strength(self) -> u8 {
        match self {
            Infix::Logic(Logic::Xor) => strength::XOR,
            Infix::Logic(Logic::Iff) => strength::IFF,
            Infix::Logic(Logic::Implies) => strength::IMPLIES,
            Infix::Logic(Logic::Or) => strength::OR,
            Infix::Logic(Logic::And) => strength::AND,
            Infix::Logic(Logic::Temporal(Binary::Until | Binary::Release)) => strength::UNTIL,
            Infix::Logic(Logic::Temporal(Binary::Unless)) => strength::UNLESS,
            Infix::Logic(Logic::Temporal(Binary::Since)) => strength::SINCE,
            Infix::Compare(_) | Infix::In => strength::COMPARE,
            Infix::Arithmetic(Arithmetic::Add | Arithmetic::Subtract) => strength::ADD,
            Infix::Arithmetic(Arithmetic::Multiply | Arithmetic::Divide) => strength::MULTIPLY,
        }
    }
}

/// Returns the operator that a token is in front of an operand.
pub(super) fn prefix_of(token: &Token<'_>) -> Option<Prefix> {
    let unary = match token {
        Token::Word(word) => match *word {
            "not" => return Some(Prefix::Not),
            // Names of Breach and RTAMT are understood, so that their formulas need no
            // translation.
            "always" | "globally" | "alw" | "alw_" | "always_" | "G" => Unary::Always,
            "eventually" | "ev" | "ev_" | "eventually_" | "F" => Unary::Eventually,
            "historically" | "H" => Unary::Historically,
            "once" | "O" => Unary::Once,
            "next" | "X" => Unary::Next,
            "prev" | "Y" => Unary::Prev,
            "s_next" | "sX" => Unary::StrongNext,
            "s_prev" | "sY" => Unary::StrongPrev,
            "rise" => Unary::Rise,
            "fall" => Unary::Fall,
            _ => return None,
        },
        Token::Symbol("[]" | "□") => Unary::Always,
        Token::Symbol("<>" | "◇") => Unary::Eventually,
        Token::Symbol("!" | "~" | "¬") => return Some(Prefix::Not),
        Token::Symbol("-") => return Some(Prefix::Negate),
        _ => return None,
    };
    Some(Prefix::Temporal(unary))
}

/// Returns the operator that a token is behind an operand.
pub(super) fn infix_of(token: &Token<'_>) -> Option<Infix> {
    let word = match token {
        Token::Word(word) => *word,
        Token::Symbol(symbol) => symbol,
        _ => return None,
    };
    Some(match word {
        "until" | "until_" | "U" => Infix::Logic(Logic::Temporal(Binary::Until)),
        "release" | "R" => Infix::Logic(Logic::Temporal(Binary::Release)),
        "unless" | "W" => Infix::Logic(Logic::Temporal(Binary::Unless)),
        "since" | "S" => Infix::Logic(Logic::Temporal(Binary::Since)),
        "and" | "&" | "&&" | "/\\" | "∧" => Infix::Logic(Logic::And),
        "or" | "|" | "||" | "\\/" | "∨" => Infix::Logic(Logic::Or),
        "implies" | "->" | "=>" | "→" => Infix::Logic(Logic::Implies),
        "iff" | "<->" | "<=>" | "↔" => Infix::Logic(Logic::Iff),
        "xor" => Infix::Logic(Logic::Xor),
        "in" => Infix::In,
        "<" => Infix::Compare(Comparison::Less),
        "<=" | "≤" => Infix::Compare(Comparison::LessEqual),
        ">" => Infix::Compare(Comparison::Greater),
        ">=" | "≥" => Infix::Compare(Comparison::GreaterEqual),
        "==" | "===" => Infix::Compare(Comparison::Equal),
        "!=" | "!==" | "≠" => Infix::Compare(Comparison::NotEqual),
        "+" => Infix::Arithmetic(Arithmetic::Add),
        "-" => Infix::Arithmetic(Arithmetic::Subtract),
        "*" => Infix::Arithmetic(Arithmetic::Multiply),
        "/" => Infix::Arithmetic(Arithmetic::Divide),
        _ => return None,
    })
}

/// Returns true for single letters, which are names unless an operand follows.
pub(super) fn is_prefix_letter(word: &str) -> bool {
    matches!(word, "G" | "F" | "H" | "O" | "X" | "Y" | "sX" | "sY")
}

fn is_infix_letter(word: &str) -> bool {
    matches!(word, "U" | "R" | "W" | "S")
}

/// Returns true for words that are never names, unless quoted.
pub(super) fn is_word_operator(word: &str) -> bool {
    let token = Token::Word(word);
    // Single letters are common signal names, so they are never reserved.
    let letter = is_prefix_letter(word) || is_infix_letter(word);
    !letter && (prefix_of(&token).is_some() || infix_of(&token).is_some())
}

/// Returns true for words that a canonical text must quote to use as names.
pub(crate) fn is_keyword(word: &str) -> bool {
    let constant = matches!(word, "true" | "TRUE" | "false" | "FALSE" | "inf" | "end");
    constant || is_word_operator(word)
}

/// Returns true if an operand can start with this token, except `-` and `[`.
pub(super) fn starts_operand(token: &Token<'_>) -> bool {
    match token {
        Token::Number(_) | Token::Quoted(_) => true,
        Token::Word(word) => is_infix_letter(word) || infix_of(token).is_none(),
        Token::Symbol(symbol) => matches!(*symbol, "(" | "[]" | "<>" | "!" | "~" | "¬" | "□" | "◇"),
        Token::End => false,
    }
}

/// Returns "did you mean `until`?" for a word in the place of an operator.
pub(super) fn closest_operator(word: &str) -> Option<String> {
    const WORDS: [&str; 16] = [
        "always",
        "eventually",
        "historically",
        "once",
        "until",
        "release",
        "unless",
        "since",
        "and",
        "or",
        "implies",
        "iff",
        "xor",
        "not",
        "next",
        "prev",
    ];
    // Short words resemble too many others, and most of them are names.
    let close = WORDS.into_iter().find(|known| {
        *known != word && word.len() >= 4 && strsim::jaro_winkler(word, known) >= 0.9
    })?;
    Some(format!("did you mean `{close}`?"))
}
