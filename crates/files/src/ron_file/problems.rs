//! Mistakes of a world file with their places.

use super::error::{Problem, did_you_mean, known_names};
use super::locate::ValuePath;
use crate::stl::StlError;

/// Greatest number of reported mistakes, which suffices for a round of corrections.
const MOST: usize = 100;

/// Mistakes found so far, with the text that contains them.
pub struct Problems<'a> {
    text: &'a str,
    list: Vec<Problem>,
    /// Number of mistakes beyond those of the list.
    more: usize,
}

impl<'a> Problems<'a> {
    /// Creates a list without mistakes for a text.
    pub fn new(text: &'a str) -> Problems<'a> {
        Problems {
            text,
            list: Vec::new(),
            more: 0,
        }
    }

    /// Reports a mistake at the value under `path`.
    pub fn add(
        &mut self,
        path: &ValuePath,
        what: impl Into<String>,
        label: &str,
        help: Option<String>,
    ) {
        // Before the place is searched, whose cost grows with the text.
        if self.list.len() >= MOST {
            self.more += 1;
            return;
        }
        self.list.push(Problem {
            what: what.into(),
            span: path.find(self.text),
            label: label.to_owned(),
            help,
        });
    }

    /// Reports an unknown name, with a guess and the known names.
    pub fn unknown(&mut self, path: &ValuePath, what: &str, name: &str, known: &[&str]) {
        let list = known_names("known", known.iter().copied());
        let help = match did_you_mean(name, known.iter().copied()) {
            Some(guess) => format!("{guess} — {list}"),
            None => list,
        };
        self.add(path, format!("no {what} `{name}`"), "unknown", Some(help));
    }

    /// Reports a mistake inside the STL string under `path`.
    pub fn stl(&mut self, path: &ValuePath, error: &StlError) {
        self.list.push(Problem {
            what: error.to_string(),
            span: self.place_in_stl(path, error),
            label: error.label().to_owned(),
            help: error.help().map(str::to_owned),
        });
    }

    /// Reports that the signal `name` uses a signal that is not declared before it.
    pub fn too_early(&mut self, path: &ValuePath, error: &StlError, used: &str, name: &str) {
        let (what, label, help) = if used == name {
            (
                format!("the signal `{name}` is defined by itself"),
                "not known yet",
                "say what it is by other signals".to_owned(),
            )
        } else {
            (
                format!("the signal `{used}` is declared later"),
                "not known yet",
                format!("move `{used}` up, above `{name}`: signals use those above them"),
            )
        };
        self.list.push(Problem {
            what,
            span: self.place_in_stl(path, error),
            label: label.to_owned(),
            help: Some(help),
        });
    }

    fn place_in_stl(&self, path: &ValuePath, error: &StlError) -> std::ops::Range<usize> {
        // The mistake may be in a named formula that this formula uses.
        let named = error
            .formula()
            .map(|name| ValuePath::top().to("formulas").to(name));
        let path = named.as_ref().unwrap_or(path);
        let value = path.find(self.text);
        let quoted = &self.text[value.clone()];
        let inner = error.span();
        let open = quoted.find('"').map_or(0, |quote| quote + 1);
        // Escapes shift the positions, so the complete string is underlined.
        let shifted = quoted.starts_with('"') && quoted.contains('\\');
        if shifted || quoted.len() < open + inner.end {
            value
        } else {
            value.start + open + inner.start..value.start + open + inner.end
        }
    }

    /// Returns the number of mistakes so far, also of those that are not reported.
    pub fn len(&self) -> usize {
        self.list.len() + self.more
    }

    /// Returns whether there is no mistake so far.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Returns the mistakes as an error, if there are any.
    pub fn done(&mut self) -> Result<(), Vec<Problem>> {
        if self.list.is_empty() {
            Ok(())
        } else {
            Err(std::mem::take(&mut self.list))
        }
    }

    /// Reports a mistake after which nothing can be checked, and returns all mistakes.
    pub fn ended(&mut self, path: &ValuePath, what: impl Into<String>) -> Vec<Problem> {
        self.add(path, what, "here", None);
        std::mem::take(&mut self.list)
    }

    /// Reports a mistake in an STL string after which nothing can be checked.
    pub fn ended_in_stl(&mut self, path: &ValuePath, error: &StlError) -> Vec<Problem> {
        self.stl(path, error);
        std::mem::take(&mut self.list)
    }

    /// Returns the mistakes in the order of their report.
    pub fn into_list(self) -> Vec<Problem> {
        self.list
    }
}
