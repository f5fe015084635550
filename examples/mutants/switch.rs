//! A source with switches: every mutant stands beside what it replaces.
//!
//! `a - b` becomes `(if crate::mutant::on(7) { a + b } else { a - b })`.
//! Changes inside a changed span are compiled into the unchanged branch only,
//! so that one mutant is on at a time.

use std::cmp::Reverse;
use std::iter::Peekable;
use std::ops::Range;
use std::slice::Iter;

use super::find::{Form, Mutant};

/// A source with switches, and where they are.
#[derive(Debug, Default)]
pub struct Switched {
    /// The new text.
    pub text: String,
    /// Every switch with the bytes of the new text from its `if` to its end.
    pub switches: Vec<Switch>,
}

/// One switch of a new text.
#[derive(Debug)]
pub struct Switch {
    id: u32,
    span: Range<usize>,
}

/// Compiles mutants with their ids into their source.
pub fn switched(source: &str, mutants: &[(u32, &Mutant)]) -> Switched {
    let mut mutants = mutants.to_vec();
    // Outer ones first.
    mutants.sort_by_key(|(id, m)| (m.span.start, Reverse(m.span.end), *id));
    let mut out = Switched::default();
    out.write(source, 0..source.len(), &mut mutants.iter().peekable());
    out
}

type Rest<'a, 'b> = Peekable<Iter<'b, (u32, &'a Mutant)>>;

impl Switched {
    fn write(&mut self, source: &str, span: Range<usize>, rest: &mut Rest<'_, '_>) {
        let mut at = span.start;
        while let Some((id, mutant)) = rest.next_if(|(_, m)| m.span.end <= span.end) {
            self.text.push_str(&source[at..mutant.span.start]);
            at = mutant.span.end;
            let from = self.text.len();
            let (open, close) = match mutant.form {
                Form::Expression => ("(", ")"),
                Form::Statement | Form::Entry => ("", ""),
            };
            self.text += &format!("{open}if crate::mutant::on({id}) {{ ");
            self.text.push_str(&mutant.text);
            if mutant.form != Form::Entry {
                self.text.push_str(" } else { ");
                self.write(source, mutant.span.clone(), rest);
            }
            self.text += &format!(" }}{close}");
            self.switches.push(Switch {
                id: *id,
                span: from..self.text.len(),
            });
        }
        self.text.push_str(&source[at..span.end]);
    }

    /// Who is to blame for an error there: the innermost switch around it, or
    /// else the switches in it.
    pub fn blamed(&self, error: &Range<usize>) -> Vec<u32> {
        let around = |s: &&Switch| s.span.start <= error.start && error.end <= s.span.end;
        let inside = |s: &&Switch| error.start <= s.span.start && s.span.end <= error.end;
        let innermost = self
            .switches
            .iter()
            .filter(around)
            .min_by_key(|s| s.span.len());
        match innermost {
            Some(switch) => vec![switch.id],
            None => self.switches.iter().filter(inside).map(|s| s.id).collect(),
        }
    }
}
