//! Import errors and their places.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// Error of an import, with its place in the files.
///
/// Its text has a line for every problem.
#[derive(Clone, Debug, PartialEq)]
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
    /// True if another problem is the cause, beside which this one says nothing new.
    pub follows: bool,
    /// Part of the files that is only read once this problem is mended.
    pub unread: Option<UnreadPart>,
    /// Further problems, in the order of the file.
    pub more: Vec<ImportError>,
}

impl std::error::Error for ImportError {}

/// Part of the files that is only read once a problem is mended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnreadPart {
    /// What stands or moves on the roads.
    OnTheRoads,
    /// All but the entities, without an ego.
    RestOfScenario,
    /// Points after many that are refused.
    LaterPoints,
}

impl UnreadPart {
    fn words(self) -> &'static str {
        match self {
            UnreadPart::OnTheRoads => "places and motion on the roads",
            UnreadPart::RestOfScenario => "the rest of the scenario",
            UnreadPart::LaterPoints => "the later points",
        }
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.headline())?;
        for error in &self.more {
            write!(f, "\n{}", error.headline())?;
        }
        self.unread_part()
            .map_or(Ok(()), |part| write!(f, "\nnot read before that: {part}"))
    }
}

/// Problems of an import, so that one message names them all.
#[derive(Clone, Debug, Default)]
pub struct Blockers(Vec<ImportError>);

impl Blockers {
    /// Keeps the error of a result, and returns its value.
    pub fn keep<T>(&mut self, result: Result<T, ImportError>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(mut error) => {
                let more = std::mem::take(&mut error.more);
                self.0.push(error);
                self.0.extend(more);
                None
            }
        }
    }

    /// Keeps an error.
    pub fn add(&mut self, error: ImportError) {
        self.keep::<()>(Err(error));
    }

    /// Returns whether there is no problem so far.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Ends the collection.
    ///
    /// # Errors
    ///
    /// Returns all problems as one error, each once and in the order of the file.
    pub fn none(self) -> Result<(), ImportError> {
        let mut all = self.0;
        // If all of them follow, the cause is reported elsewhere, and none is
        // dropped.
        if all.iter().any(|error| !error.follows) {
            all.retain(|error| !error.follows);
        }
        let mut known = BTreeSet::new();
        // A fault of a shared part is found once for each of its users.
        all.retain(|it| known.insert((it.what.clone(), it.file.clone(), it.element.clone())));
        let line = |error: &ImportError| error.element.as_ref().map_or(0, |it| it.1);
        all.sort_by(|a, b| (&a.file, line(a)).cmp(&(&b.file, line(b))));
        let mut all = all.into_iter();
        let Some(mut first) = all.next() else {
            return Ok(());
        };
        first.more = all.collect();
        // A point is only left out for what concerns the point alone.
        first.is_of_point &= first.more.iter().all(|error| error.is_of_point);
        Err(first)
    }
}

impl ImportError {
    /// Returns the text of this problem alone, with its place.
    pub fn headline(&self) -> String {
        let file = self.file.display();
        format!("`{file}`{}{}: {}", self.place(), self.point(), self.what)
    }

    /// Returns all problems of the error, this one first.
    pub fn all(&self) -> impl Iterator<Item = &ImportError> {
        std::iter::once(self).chain(&self.more)
    }

    /// Returns the first part of the files that is only read after a problem is mended.
    pub fn unread_part(&self) -> Option<&'static str> {
        self.all()
            .find_map(|error| error.unread)
            .map(UnreadPart::words)
    }

    /// Returns the error as one without which a part of the files is not read.
    pub fn before(mut self, part: UnreadPart) -> ImportError {
        self.unread = Some(part);
        self
    }

    /// Returns the error as the effect of another problem, if it is one.
    pub fn following(mut self, follows: bool) -> ImportError {
        self.follows = follows;
        self
    }

    fn place(&self) -> String {
        let place = self
            .element
            .as_deref()
            .map(|(element, line)| format!(", line {line}, {element}"));
        place.unwrap_or_default()
    }

    fn point(&self) -> String {
        let point = self.point.as_deref().map(|(index, set)| {
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
        let set: Vec<String> = set
            .iter()
            .map(|(name, value)| format!("{name} = {value}"))
            .collect();
        let point = Box::new((index, set.join(", ")));
        for error in &mut self.more {
            error.point.get_or_insert_with(|| point.clone());
        }
        self.point.get_or_insert(point);
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
            follows: false,
            unread: None,
            more: Vec::new(),
        }
    }
}
