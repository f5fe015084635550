//! Import errors and their places.

use std::path::{Path, PathBuf};

/// Error of an import, with its place in the files.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{}`{}{}: {what}", file.display(), self.place(), self.point())]
pub struct ImportError {
    /// File that contains the error.
    pub file: PathBuf,
    /// Element with its name, if known, and its line.
    pub element: Option<Box<(String, usize)>>,
    /// Index of the point, from 0, with the values that it sets.
    pub point: Option<Box<(usize, String)>>,
    /// Statement of the problem.
    pub what: String,
    /// Fix, if known.
    pub help: Option<String>,
    /// True if the error concerns the point only. Other points may be valid.
    pub is_of_point: bool,
}

impl ImportError {
    fn place(&self) -> String {
        let place = self.element.as_deref();
        let place = place.map(|(element, line)| format!(", line {line}, {element}"));
        place.unwrap_or_default()
    }

    fn point(&self) -> String {
        let point = self.point.as_deref();
        let point = point.map(|(index, set)| {
            if set.is_empty() {
                format!(", point {index}")
            } else {
                format!(", point {index} ({set})")
            }
        });
        point.unwrap_or_default()
    }

    /// Returns the error with a point, unless it already has a point.
    pub fn at_point(mut self, index: usize, set: &[(String, String)]) -> ImportError {
        let set = set.iter().map(|(name, value)| format!("{name} = {value}"));
        let set: Vec<String> = set.collect();
        self.point
            .get_or_insert_with(|| Box::new((index, set.join(", "))));
        self
    }

    /// Returns the error as one of a point, which `--skip-broken` leaves out.
    pub fn of_point(mut self) -> ImportError {
        self.is_of_point = true;
        let help = "--skip-broken leaves such points out and says how many";
        // A more specific help takes precedence.
        self.help.get_or_insert_with(|| help.to_owned());
        self
    }

    /// Returns the error with a help.
    pub fn helped(mut self, help: &str) -> ImportError {
        self.help = Some(help.to_owned());
        self
    }
}

/// Place in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct At {
    file: PathBuf,
    element: Option<Box<(String, usize)>>,
}

impl At {
    /// Place of a file as a whole.
    pub fn file(file: &Path) -> At {
        At {
            file: file.to_owned(),
            element: None,
        }
    }

    /// Place of an element.
    pub fn element(file: &Path, element: String, line: usize) -> At {
        At {
            file: file.to_owned(),
            element: Some(Box::new((element, line))),
        }
    }

    /// Returns an error at this place.
    pub fn error(&self, what: impl Into<String>) -> ImportError {
        ImportError {
            file: self.file.clone(),
            element: self.element.clone(),
            point: None,
            what: what.into(),
            help: None,
            is_of_point: false,
        }
    }
}
