//! `brakecheck.toml`: defaults of options for a directory or a repository.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{ColorChoice, Command, ValueEnum};
use strum::VariantArray;
use toml::de::{DeTable, DeValue};

use super::display::COLOR;
use super::failure::Failure;
use crate::ron_file::{Problem, ScenarioError, file_text, guessed};
use crate::sim::PlantKind;

/// Name of the file.
const FILE: &str = "brakecheck.toml";
/// Environment variable for `--jobs`.
pub(super) const JOBS: &str = "BRAKECHECK_JOBS";
/// Environment variable for `--plant`.
pub(super) const PLANT: &str = "BRAKECHECK_PLANT";
/// Options with a default, each with its environment variable.
pub(super) const SETTINGS: [(&str, &str); 3] = [("jobs", JOBS), ("plant", PLANT), ("color", COLOR)];
/// Most threads of a command.
pub(super) const MOST_JOBS: u16 = 1024;

/// Set if `--plant` was not typed: its value is of the environment or the file.
static IS_PLANT_DEFAULT: AtomicBool = AtomicBool::new(false);

/// Notes whether the plant of the command is a default.
pub(super) fn note_plant(is_default: bool) {
    IS_PLANT_DEFAULT.store(is_default, Ordering::Relaxed);
}

/// Returns whether the plant of the command is a default, which need not fit the world.
pub(super) fn is_plant_default() -> bool {
    IS_PLANT_DEFAULT.load(Ordering::Relaxed)
}

/// Defaults of a file, empty without one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Defaults {
    /// The file, as a message names it.
    pub(super) file: PathBuf,
    values: Vec<(&'static str, String)>,
}

impl Defaults {
    /// Returns the defaults that hold in a directory.
    ///
    /// The file is in it, or in a parent up to the root of its repository.
    ///
    /// # Errors
    /// The file cannot be read, or it has an unknown key or an invalid value.
    pub(super) fn in_directory(directory: &Path) -> Result<Defaults, Failure> {
        let is_root = |parent: &&Path| parent.join(".git").exists();
        // Outside a repository, a file of a foreign parent must not apply.
        let root = directory.ancestors().find(is_root).unwrap_or(directory);
        let within = |parent: &&Path| parent.starts_with(root);
        let mut files = directory
            .ancestors()
            .take_while(within)
            .map(|parent| parent.join(FILE));
        // A dangling link is an error below, and not an absent file.
        let Some(file) = files.find(|file| file.symlink_metadata().is_ok()) else {
            return Ok(Defaults::default());
        };
        let text = file_text(&file).map_err(|error| {
            Failure::input(
                format!("cannot read `{}`: {error}", file.display()),
                "correct the file with defaults, or remove it",
            )
        })?;
        let values = values(&text).map_err(|problems| ScenarioError {
            file: file.display().to_string(),
            text: text.clone(),
            problems,
        })?;
        Ok(Defaults { file, values })
    }

    /// Returns the value of a setting, as it is typed after an option.
    pub(super) fn value(&self, setting: &str) -> Option<&str> {
        let mut values = self.values.iter();
        let (_, value) = values.find(|(name, _)| *name == setting)?;
        Some(value)
    }

    /// Returns a command and its verbs with these defaults.
    pub(super) fn of_command(&self, command: Command) -> Command {
        let mut with_defaults =
            command.mut_args(|argument| match self.value(argument.get_id().as_str()) {
                // As a default, it yields to typed options and to the environment.
                Some(value) => argument.default_value(value.to_owned()),
                None => argument,
            });
        with_defaults = with_defaults.mut_subcommands(|verb| self.of_command(verb));
        with_defaults
    }
}

/// Parses the file.
fn values(text: &str) -> Result<Vec<(&'static str, String)>, Vec<Problem>> {
    // Parsed with spans, so that an error shows its place.
    let table = DeTable::parse(text).map_err(|error| {
        let start = text.len();
        vec![Problem {
            what: format!("invalid TOML: {}", error.message()),
            // An error without a place is one of the end, such as an open string.
            span: error.span().unwrap_or(start..start),
            label: "here".to_owned(),
            help: Some("write lines such as `jobs = 4`".to_owned()),
        }]
    })?;
    let (mut values, mut problems) = (Vec::new(), Vec::new());
    for (key, value) in table.get_ref() {
        let known = SETTINGS.iter().find(|(name, _)| *name == key.get_ref());
        let Some((name, _)) = known else {
            problems.push(unknown(key.get_ref(), key.span()));
            continue;
        };
        match value_of(name, value.get_ref()) {
            Ok(value) => values.push((*name, value)),
            Err(help) => problems.push(Problem {
                what: format!("invalid value of `{name}`"),
                span: value.span(),
                label: "invalid".to_owned(),
                help: Some(help),
            }),
        }
    }
    // Keys are in alphabetical order there.
    problems.sort_by_key(|problem| problem.span.start);
    if problems.is_empty() {
        Ok(values)
    } else {
        Err(problems)
    }
}

/// Reports a key that is no setting.
fn unknown(key: &str, span: Range<usize>) -> Problem {
    // Either spelling deserves the reason instead of a guess at the key.
    let is_consent = key.replace('-', "_") == "allow_programs";
    let (what, help) = if is_consent {
        (
            format!("`{key}` cannot be a default"),
            "type `--allow-programs` in each command: a file that comes with a project must not \
             consent to start its programs"
                .to_owned(),
        )
    } else {
        let known = SETTINGS.iter().map(|(name, _)| *name);
        (format!("unknown key `{key}`"), guessed(key, "known", known))
    };
    Problem {
        what,
        span,
        label: "not a setting".to_owned(),
        help: Some(help),
    }
}

/// Returns the value of a setting as text, or the fix of an invalid value.
fn value_of(name: &str, value: &DeValue<'_>) -> Result<String, String> {
    match (name, value) {
        ("jobs", DeValue::Integer(number)) => {
            // TOML also has hexadecimal, octal and binary numbers.
            let jobs = u16::from_str_radix(number.as_str(), number.radix());
            let valid = jobs.ok().filter(|jobs| (1..=MOST_JOBS).contains(jobs));
            // The option reads decimal numbers only.
            valid
                .map(|jobs| jobs.to_string())
                .ok_or_else(|| format!("write a whole number from 1 to {MOST_JOBS}"))
        }
        ("jobs", _) => Err(format!("write a whole number from 1 to {MOST_JOBS}")),
        ("plant", _) => {
            let words = PlantKind::VARIANTS.iter().map(<&'static str>::from);
            word_of(value, words.map(str::to_owned).collect())
        }
        _ => {
            // Of the settings, only `color` is left.
            let choices = ColorChoice::value_variants().iter();
            let words = choices.map(ToString::to_string);
            word_of(value, words.collect())
        }
    }
}

/// Returns a word of a list, or the fix.
fn word_of(value: &DeValue<'_>, words: Vec<String>) -> Result<String, String> {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    let written = value
        .as_str()
        .filter(|word| words.iter().any(|it| it == word));
    written
        .map(str::to_owned)
        .ok_or_else(|| format!("write {}", quoted.join(" or ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(text: &str) -> Problem {
        let problems = values(text).expect_err(text);
        assert_eq!(problems.len(), 1, "{text}: {problems:?}");
        problems[0].clone()
    }

    #[test]
    fn a_file_has_defaults_in_the_words_of_the_options() {
        let text = "jobs = 0x10\nplant = \"rigid\" # 3D\ncolor = 'never'\n";
        let found = values(text).expect("sound");
        let value = |name| {
            let mut all = found.iter();
            all.find(|(known, _)| *known == name)
                .map(|(_, value)| value.as_str())
        };
        assert_eq!(value("jobs"), Some("16"));
        assert_eq!(value("plant"), Some("rigid"));
        assert_eq!(value("color"), Some("never"));
        assert_eq!(values(""), Ok(Vec::new()));
    }

    #[test]
    fn mistakes_have_their_place_and_a_fix() {
        for (text, place, says) in [
            ("jobs = 4\njbos = 2", "jbos", "did you mean `jobs`?"),
            ("jobs = 0", "0", "from 1 to 1024"),
            ("jobs = \"4\"", "\"4\"", "from 1 to 1024"),
            (
                "plant = \"ridgid\"",
                "\"ridgid\"",
                "\"rigid\" or \"kinematic\"",
            ),
            ("color = true", "true", "\"auto\" or \"always\""),
            (
                "allow_programs = true",
                "allow_programs",
                "must not consent",
            ),
            (
                "allow-programs = true",
                "allow-programs",
                "must not consent",
            ),
            ("[eval]\nstarts = 3", "eval", "known: jobs, plant, color"),
        ] {
            let problem = problem(text);
            assert_eq!(&text[problem.span.clone()], place, "{text}");
            let help = problem.help.unwrap_or_default();
            assert!(help.contains(says), "{text}: {help}");
        }
        assert!(problem("jobs = ").what.starts_with("invalid TOML"));
    }

    #[test]
    fn the_file_is_in_the_directory_or_between_it_and_the_root_of_its_repository() {
        let scratch = tempfile::tempdir().expect("a directory");
        let (top, inner) = (scratch.path(), scratch.path().join("a/b"));
        std::fs::create_dir_all(&inner).expect("made");
        std::fs::write(top.join(FILE), "jobs = 3").expect("written");
        let jobs = |directory: &Path| {
            let found = Defaults::in_directory(directory).expect("sound");
            found.value("jobs").map(str::to_owned)
        };
        assert_eq!(jobs(top).as_deref(), Some("3"));
        assert_eq!(jobs(&inner), None, "no repository");
        std::fs::create_dir(top.join(".git")).expect("made");
        assert_eq!(jobs(&inner).as_deref(), Some("3"));
        std::fs::create_dir(top.join("a/.git")).expect("made");
        assert_eq!(jobs(&inner), None, "a repository of its own");
    }
}
