//! The command line of a program: its help, its defaults and its errors.

use std::ffi::OsString;

use clap::builder::Resettable;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{
    Arg, ArgAction, ArgMatches, ColorChoice, Command, CommandFactory, FromArgMatches, ValueEnum,
};

use super::defaults::{Defaults, SETTINGS, note_plant};
use super::display::{COLOR, OutputArgs, colour, stdout_columns};
use super::failure::{Exit, Failure};
use super::terminal::Common;
use super::usage_error;

/// Widest text of a help.
const MOST_COLUMNS: usize = 100;
/// Option that lists all options.
const ALL: &str = "--help-all";

/// Command line of a program.
pub trait CommandLine: CommandFactory + FromArgMatches + Send {
    /// Returns the command with the layout of its help.
    fn laid_out(command: Command) -> Command {
        command
    }

    /// Returns the options of the command that all commands share.
    fn common(&self) -> Common;

    /// Returns the options of the command about its output.
    fn output(&self) -> OutputArgs;

    /// Returns whether Ctrl-C makes it stop and save. Other commands just end.
    fn saves_when_interrupted(&self) -> bool;

    /// Carries out the command in the thread pool of the caller.
    ///
    /// # Errors
    ///
    /// Returns an error if the command cannot be carried out.
    fn carry_out(self) -> Result<Exit, Failure>;
}

/// Command line that was read.
pub(super) struct ReadLine<P> {
    pub(super) program: P,
    /// Where the defaults come from, in words.
    pub(super) origins: Vec<String>,
}

/// End of a command before its work.
pub(super) enum Ended {
    /// Help or a version was printed.
    Printed(Exit),
    /// The command line or the file with defaults is invalid.
    Refused(Failure),
}

/// Reads a command line.
pub(super) fn read<P: CommandLine>(
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<ReadLine<P>, Ended> {
    let arguments = with_help_as_option(arguments.into_iter().collect());
    // A directory that no longer exists has no file with defaults.
    let directory = std::env::current_dir().unwrap_or_default();
    // A help is printed even if this file is invalid.
    let (defaults, refused) = match Defaults::in_directory(&directory) {
        Ok(defaults) => (defaults, None),
        Err(failure) => (Defaults::default(), Some(failure)),
    };
    // Colours hold for the errors of the command line, too.
    colour(color_choice(&arguments, &defaults));
    // The long help is looked for before parsing, because its layout is part of the
    // parser.
    let mut command = defaults
        .of_command(command::<P>(own_words(&arguments).any(|word| word == ALL)))
        // Lines as wide as a large screen are hard to read.
        .term_width(stdout_columns().min(MOST_COLUMNS));
    let read = command.try_get_matches_from_mut(&arguments);
    let matches = read.map_err(|error| ended(&error, &command, &arguments))?;
    if let Some(failure) = refused {
        return Err(Ended::Refused(failure));
    }
    // An unset variable of a script must not test the world's own ego instead.
    if arguments.last().is_some_and(|word| word == "--") {
        return Err(Ended::Refused(Failure::input(
            "missing command after `--`",
            "write the command of your program, or leave out `--`",
        )));
    }
    let program = P::from_arg_matches(&matches);
    Ok(ReadLine {
        program: program.map_err(|error| ended(&error, &command, &arguments))?,
        origins: origins(&matches, &defaults),
    })
}

/// Returns the command with its help.
///
/// Options with a heading are hidden, unless `shows_all`.
pub(super) fn command<P: CommandLine>(shows_all: bool) -> Command {
    let help = Arg::new("help")
        .short('h')
        .long("help")
        .action(ArgAction::HelpShort)
        .global(true)
        .help("Print the first options");
    let help_all = Arg::new("help-all")
        .long("help-all")
        .action(ArgAction::HelpLong)
        .global(true)
        .help("Print all options, with details");
    let command = P::laid_out(P::command())
        // The flag of clap prints another page for `-h` than for `--help`.
        .disable_help_flag(true)
        // `help VERB` is rewritten as an option, so that both print the same page.
        .disable_help_subcommand(true)
        .arg(help)
        .arg(help_all);
    shaped(command, shows_all)
}

/// Hides options with a heading, and takes negative numbers as values.
fn shaped(command: Command, shows_all: bool) -> Command {
    let argument = |given: Arg| {
        let argument = without_empty_variable(given);
        let is_hidden = !shows_all && argument.get_help_heading().is_some();
        let shown = if is_hidden {
            argument.hide(true)
        } else {
            argument
        };
        // Otherwise clap takes the minus of `-3` for the start of an option.
        if shown.get_action().takes_values() {
            shown.allow_negative_numbers(true)
        } else {
            shown
        }
    };
    // `campaign` has verbs of its own, so every level is shaped.
    command
        .mut_args(argument)
        .mut_subcommands(|verb| shaped(verb, shows_all))
}

/// Forgets the environment variable of an argument if it is empty.
///
/// CI systems set a variable without a value to the empty text.
fn without_empty_variable(argument: Arg) -> Arg {
    let variable = argument.get_env().and_then(std::env::var_os);
    match variable.filter(|value| value.is_empty()) {
        Some(_) => argument.env(Resettable::Reset),
        None => argument,
    }
}

/// Returns `VERB --help` for `help VERB`.
fn with_help_as_option(arguments: Vec<OsString>) -> Vec<OsString> {
    // Options of the program may stand before the verb.
    let is_verb = |at: &usize| {
        // This is the only option of the program that takes a value in front of a verb.
        // The search begins at 1, so there always is a word before.
        let is_value = arguments[at - 1] == "--color";
        !is_value && !arguments[*at].as_encoded_bytes().starts_with(b"-")
    };
    let first = (1..arguments.len()).find(is_verb);
    let Some(at) = first.filter(|at| arguments[*at] == "help") else {
        return arguments;
    };
    let mut others = arguments;
    others.remove(at);
    // The option is global, so it may follow the verbs.
    others.push("--help".into());
    others
}

/// Returns the words before those of a program after `--`.
fn own_words(arguments: &[OsString]) -> impl Iterator<Item = &str> {
    let words = arguments.iter().take_while(|word| *word != "--");
    // Options are ASCII, so a word that is not UTF-8 cannot be one.
    words.filter_map(|word| word.to_str())
}

/// Returns the choice of colours before anything is parsed, which may fail.
fn color_choice(arguments: &[OsString], defaults: &Defaults) -> ColorChoice {
    let mut typed = None;
    let mut words = own_words(arguments);
    while let Some(word) = words.next() {
        // The last of several counts, as clap decides.
        if word == "--color" {
            typed = words.next();
        } else if let Some(choice) = word.strip_prefix("--color=") {
            typed = Some(choice);
        }
    }
    let variable = std::env::var(COLOR).ok().filter(|it| !it.is_empty());
    // The same precedence as clap's: typed, environment, default.
    let choice = typed.or(variable.as_deref()).or(defaults.value("color"));
    let known = choice.and_then(|word| ColorChoice::from_str(word, true).ok());
    // An invalid choice is ignored here, because the parser reports it.
    known.unwrap_or_default()
}

/// Prints a help, or returns the error of a command line.
fn ended(error: &clap::Error, command: &Command, arguments: &[OsString]) -> Ended {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            // A closed pipe is the reader's choice.
            let _ = error.print();
            Ended::Printed(Exit::Done)
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            // No work was requested, so a script must not take this for success.
            Ended::Printed(Exit::Input)
        }
        _ => Ended::Refused(usage_error::failure(error, command, arguments)),
    }
}

/// Returns where each setting of the command comes from, if it was not typed.
fn origins(matches: &ArgMatches, defaults: &Defaults) -> Vec<String> {
    let mut of_verb = matches;
    // clap copies global options into the innermost verb, so its values decide.
    while let Some((_, inner)) = of_verb.subcommand() {
        of_verb = inner;
    }
    let origin = |of: &(&str, &str)| {
        let (setting, variable) = *of;
        // Other verbs lack the option.
        of_verb.try_contains_id(setting).ok()?;
        let value = of_verb.get_raw(setting)?.next()?.display().to_string();
        match of_verb.value_source(setting)? {
            ValueSource::EnvVariable => Some(format!("`--{setting} {value}` is from {variable}")),
            ValueSource::DefaultValue => {
                // A default of the program itself needs no mention.
                defaults.value(setting)?;
                let file = defaults.file.display();
                Some(format!("`--{setting} {value}` is from `{file}`"))
            }
            _ => None,
        }
    };
    let origins: Vec<String> = SETTINGS.iter().filter_map(origin).collect();
    // A default plant is dropped in worlds without plants, and a typed one is refused
    // there.
    note_plant(origins.iter().any(|it| it.starts_with("`--plant")));
    origins
}
