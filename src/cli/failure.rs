//! Every error, rendered once: place, reason, cure, and the exit code.

mod conversion;

pub use conversion::ErrorReport;

use std::fmt;

use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, Severity};

use super::excerpt::Excerpt;
use crate::ron_file::Problem;
use crate::visible::{command_line, visible, visible_line};

/// Messages of one failure that are printed.
const MOST_NOTES: usize = 50;
/// Characters of a line of a message that are printed.
const MOST_CHARS: usize = 2000;
/// Digits in a row that are printed.
const MOST_DIGITS: usize = 40;

/// The documented exit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// A counterexample was found and asked to fail, a kept one still fails, a gate failed,
    /// or an editor left `lsp` without `shutdown`.
    Counterexample = 1,
    /// The user's input is wrong.
    Input = 2,
    /// A fault of ego, disk or program.
    Fault = 3,
    /// A replay is not bit-identical.
    NotIdentical = 4,
    /// Interrupted; what was computed is saved or printed.
    Interrupted = 130,
}

/// Failure of a verb, with its exit code and its help.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// One or more messages.
    pub(crate) notes: Vec<Note>,
    /// Last line, which is never wrapped.
    last_line: Option<String>,
}

/// One message with its place, where it has one.
#[derive(Debug)]
pub(crate) struct Note {
    what: String,
    help: Option<String>,
    place: Option<(Excerpt, LabeledSpan)>,
    /// It stops nothing, and is drawn so.
    is_warning: bool,
}

impl Failure {
    /// A message about the user's input.
    pub fn input(what: impl Into<String>, help: impl Into<String>) -> Failure {
        Failure::plain(Exit::Input, what.into(), Some(help.into()))
    }

    /// A message about a fault that is not the user's.
    pub fn fault(what: impl Into<String>, help: Option<String>) -> Failure {
        Failure::plain(Exit::Fault, what.into(), help)
    }

    /// Several messages.
    pub(super) fn of(exit: Exit, notes: Vec<Note>) -> Failure {
        Failure {
            exit,
            notes,
            last_line: None,
        }
    }

    /// Adds a message without a place.
    pub(super) fn with_note(mut self, what: &str) -> Failure {
        self.notes.push(Note {
            is_warning: true,
            ..Note::new(what, None)
        });
        self
    }

    /// Ends with a command line that nothing wraps.
    pub(super) fn with_command(self, command: &str) -> Failure {
        Failure {
            // Not cut: a person has to see all of what would be started.
            last_line: Some(visible(command).into_owned()),
            ..self
        }
    }

    fn plain(exit: Exit, what: String, help: Option<String>) -> Failure {
        Failure {
            exit,
            notes: vec![Note::new(&what, help.as_deref())],
            last_line: None,
        }
    }

    /// Renders all messages, `width` columns wide.
    pub fn render(&self, theme: GraphicalTheme, width: usize) -> String {
        // An excerpt holds one line beside a mistake, so more context would show nothing.
        let handler = GraphicalReportHandler::new_themed(theme)
            .with_width(width)
            .with_context_lines(1);
        let mut text = String::new();
        for note in &self.notes {
            // A message without its drawing is better than none.
            if handler.render_report(&mut text, note).is_err() {
                text.push_str(&note.what);
            }
        }
        if let Some(line) = &self.last_line {
            // Added after the rendering, which would wrap a long line.
            text.push_str(&format!("        {line}\n"));
        }
        text
    }
}

impl Note {
    /// A message without a place, as a terminal may show it.
    pub(super) fn new(what: &str, help: Option<&str>) -> Note {
        Note {
            what: printable(what),
            help: help.map(printable),
            place: None,
            is_warning: false,
        }
    }
}

/// A text without control characters and without lines that fill a screen.
fn printable(text: &str) -> String {
    let text = with_short_numbers(&visible(text));
    // A line of megabytes would hide the message in a terminal.
    // Bytes bound characters, so most texts need no count.
    if text.lines().all(|line| line.len() <= MOST_CHARS) {
        return text;
    }
    let lines = text
        .lines()
        .map(|line| match line.char_indices().nth(MOST_CHARS) {
            Some((end, _)) => format!("{}…", &line[..end]),
            None => line.to_owned(),
        });
    lines.collect::<Vec<_>>().join("\n")
}

/// A text in which the ends of very long numbers are left out.
fn with_short_numbers(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut digits = 0;
    for c in text.chars() {
        digits = if c.is_ascii_digit() { digits + 1 } else { 0 };
        if digits <= MOST_DIGITS {
            shown.push(c);
        } else if digits == MOST_DIGITS + 1 {
            shown.push('…');
        }
    }
    shown
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for Note {}

impl Diagnostic for Note {
    fn severity(&self) -> Option<Severity> {
        self.is_warning.then_some(Severity::Warning)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help
            .as_ref()
            .map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        let (source, _) = self.place.as_ref()?;
        Some(source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let (_, label) = self.place.as_ref()?;
        Some(Box::new(std::iter::once(label.clone())))
    }
}

fn placed(file: &str, text: &str, problem: &Problem) -> Note {
    Note {
        place: Some(Excerpt::of(
            file,
            text,
            problem.span.clone(),
            &problem.label,
        )),
        ..Note::new(&problem.what, problem.help.as_deref())
    }
}

/// Formats warnings for `check`, limited to the first ones.
pub(super) fn warnings(file: &str, text: &str, all: &[Problem]) -> Vec<Note> {
    let first = all.iter().take(MOST_NOTES);
    let mut notes: Vec<Note> = first
        .map(|problem| Note {
            is_warning: true,
            ..placed(file, text, problem)
        })
        .collect();
    if let more @ 1.. = all.len() - notes.len() {
        let what = format!("{more} more warnings are not shown");
        let help = "`check --json` lists all of them";
        notes.push(Note {
            is_warning: true,
            ..Note::new(&what, Some(help))
        });
    }
    notes
}

/// Creates the failure of a program that was named without consent.
///
/// The program is on the last line, by itself. No part of its name can then be taken for
/// a part of this message.
pub(super) fn not_allowed(who: &str, command: &[String]) -> Failure {
    // The text is of a foreign file, and a line break in it could imitate a message of
    // this program.
    let who = visible_line(who);
    Failure::input(
        format!("{who} is a program that a file names: nothing was started"),
        "add `--allow-programs` (in Rust `allow_programs(true)`) if you trust the author of that \
         file and this program:",
    )
    .with_command(&command_line(command))
}

/// Renders failures without colour, for tests and logs.
pub fn plain_theme() -> GraphicalTheme {
    GraphicalTheme::unicode_nocolor()
}
