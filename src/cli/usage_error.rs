//! Errors of the command line, in the form of all errors.

use std::ffi::OsString;
use std::path::Path;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command};

use super::failure::Failure;
use crate::visible::command_line;
use crate::world::Scenario;

/// Returns the failure of a command line that clap refuses.
pub(super) fn failure(error: &clap::Error, command: &Command, arguments: &[OsString]) -> Failure {
    // The rendered text has usage and tips in one form for every kind of error.
    let text = error.render().to_string();
    let mut parts = text.split("\n\n");
    let first = parts.next().unwrap_or_default();
    // A failure is drawn with a mark of its own, so the word of clap is dropped.
    let mut what = first
        .strip_prefix("error: ")
        .unwrap_or(first)
        .trim()
        .to_owned();
    if let Some(variable) = variable_of(error, command, arguments) {
        what.push_str(&format!("\nthe value is that of the variable {variable}"));
    }
    let mut help: Vec<String> = Vec::new();
    for part in parts {
        for line in part.lines() {
            // What follows `--` is often a program, so this is no way to type a value.
            let is_fix = |tip: &&str| !tip.contains("as a value, use");
            if let Some(tip) = line.trim().strip_prefix("tip: ").filter(is_fix) {
                help.push(tip.to_owned());
            }
        }
    }
    let verb = verb_of(command, arguments);
    let likely = match error.kind() {
        ErrorKind::InvalidSubcommand => verb_first(error, command.get_name()),
        ErrorKind::UnknownArgument => former(error, &verb)
            // From the most certain cause to the least, and the first that applies is the
            // help.
            .or_else(|| with_dashes(error, command, arguments))
            .or_else(|| verbs_with(error, command, arguments)),
        _ => None,
    };
    // clap guesses by spelling only, so a known cause replaces its tips.
    if let Some(likely) = likely {
        help = vec![likely];
    }
    let usage = usage_of(&text);
    if let Some(usage) = usage {
        help.push(format!("usage: {usage}"));
    }
    help.push(format!("`{verb} --help` explains it"));
    Failure::input(what, help.join("\n"))
}

/// Returns the usage of a message, in one line.
fn usage_of(text: &str) -> Option<String> {
    let (_, rest) = text.split_once("Usage: ")?;
    let usage = rest.split("\n\n").next().unwrap_or(rest);
    // A usage may be broken over several indented lines.
    Some(usage.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Returns the program with the verbs of a command line, as in `brakecheck campaign run`.
fn verb_of(command: &Command, arguments: &[OsString]) -> String {
    let path = path_of(command, arguments);
    let names: Vec<&str> = path.iter().map(|verb| verb.get_name()).collect();
    names.join(" ")
}

/// Returns the program and the verbs of a command line, the innermost last.
fn path_of<'a>(command: &'a Command, arguments: &[OsString]) -> Vec<&'a Command> {
    let mut path = vec![command];
    let mut last = command;
    for word in arguments.iter().skip(1).filter_map(|word| word.to_str()) {
        match last.find_subcommand(word) {
            Some(verb) => {
                path.push(verb);
                last = verb;
            }
            // Options may stand before a verb, and nothing else.
            None if word.starts_with('-') => {}
            None => break,
        }
    }
    path
}

/// Returns the name of the argument that an error is about, as it was typed.
fn argument_of(error: &clap::Error) -> Option<&str> {
    match error.get(ContextKind::InvalidArg)? {
        // clap adds the value to the name, as in `--jobs <N>`.
        ContextValue::String(name) => name.split([' ', '=']).next(),
        _ => None,
    }
}

/// Options of earlier versions, each with the verb and its successor.
const FORMER: [(&str, &str, &str); 6] = [
    (
        "log",
        "--rules",
        "`brakecheck stl RULES.ron --log FILE.csv`",
    ),
    (
        "log",
        "--worlds",
        "`brakecheck new NAME --from-log FILE.csv`",
    ),
    ("search", "--from", "`--bank RUN`"),
    ("risk", "--natural", "`--natural-runs N`"),
    ("new", "--map", "`--road NAME=FILE.xodr`"),
    (
        "stl",
        "--rules",
        "`brakecheck stl RULES.ron --log FILE.csv`",
    ),
];

/// Returns the successor of an option of earlier versions.
fn former(error: &clap::Error, verb: &str) -> Option<String> {
    let option = argument_of(error)?;
    // The verb has the name of the program before it.
    let of_verb = |it: &&(&str, &str, &str)| it.1 == option && verb.ends_with(it.0);
    let (_, _, successor) = FORMER.iter().find(of_verb)?;
    Some(format!("its successor is {successor}"))
}

/// Returns the help for a world or a file in the place of the verb.
fn verb_first(error: &clap::Error, program: &str) -> Option<String> {
    let ContextValue::String(word) = error.get(ContextKind::InvalidSubcommand)? else {
        return None;
    };
    // A shipped name or a file shows that the verb was forgotten, and not misspelled.
    let is_input = Scenario::shipped_text(word).is_some() || Path::new(word).exists();
    is_input.then(|| format!("the verb comes first, as in `{program} check {word}`"))
}

/// Returns the help for a program without the `--` before it.
fn with_dashes(error: &clap::Error, command: &Command, arguments: &[OsString]) -> Option<String> {
    let word = argument_of(error).filter(|word| !word.starts_with('-'))?;
    let verb = path_of(command, arguments).pop()?;
    // A hidden program is accepted only to be refused with a fix.
    let takes_program = verb
        .get_positionals()
        .any(|it| it.is_last_set() && !it.is_hide_set());
    let words = arguments.iter().map(|it| it.to_string_lossy().into_owned());
    let words: Vec<String> = words.collect();
    let at = words.iter().position(|it| it == word)?;
    let (before, program) = words.split_at(at);
    // The name from the help replaces the path that was typed.
    let name = command.get_name().to_owned();
    let before = before.iter().skip(1).cloned();
    let typed: Vec<String> = std::iter::once(name).chain(before).collect();
    takes_program.then(|| {
        format!(
            "a program as the ego comes after `--`: `{} -- {}`",
            // Words with spaces are quoted, so that the line can be copied.
            command_line(&typed),
            command_line(program)
        )
    })
}

/// Returns the verbs that have an option which this verb lacks.
fn verbs_with(error: &clap::Error, command: &Command, arguments: &[OsString]) -> Option<String> {
    let option = argument_of(error)?;
    let is_named = |argument: &Arg| match option.strip_prefix("--") {
        Some(long) => argument.get_long() == Some(long),
        None => argument
            .get_short()
            .is_some_and(|short| option == format!("-{short}")),
    };
    let named = |verb: &&Command| {
        let here = verb.get_arguments().any(is_named);
        here && !verb.is_hide_set()
    };
    let verbs = command.get_subcommands().filter(named);
    let names: Vec<String> = verbs.map(|verb| format!("`{}`", verb.get_name())).collect();
    let verb = verb_of(command, arguments);
    (!names.is_empty()).then(|| {
        let names = names.join(", ");
        format!("`{verb}` has no `{option}`: it is an option of {names}")
    })
}

/// Returns the environment variable with the value that is refused.
fn variable_of(error: &clap::Error, command: &Command, arguments: &[OsString]) -> Option<String> {
    let long = argument_of(error)?.strip_prefix("--")?.to_owned();
    let mut typed = arguments.iter().filter_map(|word| word.to_str());
    let is_typed = typed.any(|word| {
        let name = word.split('=').next().unwrap_or(word);
        // Of the options with a variable, `jobs` alone has a short form.
        name == format!("--{long}") || (long == "jobs" && word.starts_with("-j"))
    });
    // clap names the option for a value of the environment, too, which a user did not
    // type.
    if is_typed {
        return None;
    }
    // One level is enough, because verbs below verbs share these options with others.
    let verbs = std::iter::once(command).chain(command.get_subcommands());
    let mut all = verbs.flat_map(|verb| verb.get_arguments());
    let argument = all.find(|it| it.get_long() == Some(long.as_str()) && it.get_env().is_some())?;
    Some(argument.get_env()?.display().to_string())
}
