//! What cannot be imported, and where.

use std::path::{Path, PathBuf};

/// Something in a file that cannot be imported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{}`{}{}: {what}", file.display(), self.place(), self.point())]
pub struct ImportError {
    /// The file.
    pub file: PathBuf,
    /// The element, with its name if it has one, and its line.
    pub element: Option<Box<(String, usize)>>,
    /// The point, from 0, with what it sets.
    pub point: Option<Box<(usize, String)>>,
    /// What is wrong.
    pub what: String,
    /// The cure, where one is known.
    pub help: Option<String>,
    /// Whether it is the point that is wrong: others of the file may be sound.
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
        let point = point.map(|(index, set)| match set.is_empty() {
            true => format!(", point {index}"),
            false => format!(", point {index} ({set})"),
        });
        point.unwrap_or_default()
    }

    /// The same of a point.
    pub(super) fn at_point(mut self, index: usize, set: &[(String, String)]) -> ImportError {
        let set = set.iter().map(|(name, value)| format!("{name} = {value}"));
        let set: Vec<String> = set.collect();
        self.point
            .get_or_insert_with(|| Box::new((index, set.join(", "))));
        self
    }

    /// The same of a point that can be left out.
    pub(super) fn of_point(mut self) -> ImportError {
        self.is_of_point = true;
        let help = "--skip-broken leaves such points out and says how many";
        self.help.get_or_insert_with(|| help.to_owned());
        self
    }

    /// The same with a cure.
    pub(super) fn helped(mut self, help: &str) -> ImportError {
        self.help = Some(help.to_owned());
        self
    }
}

/// Where something stands.
#[derive(Clone, Debug)]
pub(super) struct At {
    file: PathBuf,
    element: Option<Box<(String, usize)>>,
}

impl At {
    /// A file as a whole.
    pub fn file(file: &Path) -> At {
        At {
            file: file.to_owned(),
            element: None,
        }
    }

    /// An element of it.
    pub fn element(file: &Path, element: String, line: usize) -> At {
        At {
            file: file.to_owned(),
            element: Some(Box::new((element, line))),
        }
    }

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
