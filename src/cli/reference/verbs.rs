//! Verbs, their options and exit codes, from the command line that reads them.

use clap::{Arg, Command};

use super::gates;
use super::page::{ReferencePage, ReferenceTable};
use crate::cli::examples::EXIT_CODES;

/// Most verbs that lack an option and are listed instead of those that have it.
const FEW: usize = 4;

/// Option with the verbs that have it.
struct SharedOption {
    names: String,
    effect: String,
    verbs: Vec<String>,
}

/// Returns the page about a program that is built.
pub(super) fn page(program: &Command) -> ReferencePage {
    let about = "\
`brakecheck VERB --help` prints the first options of a verb, and `--help-all` every option. \
Data is written to stdout, and messages to stderr. \
A file `-` is stdin. \
Numbers may be written as `300k` or `1_000`. \
Relative paths of a command, and the programs of a world, start from the working directory.

If several exit codes apply, the first of 130, 2, 3, 4, 1 is returned.";
    let verbs = leaves(program, "");
    let rows = verbs.iter().map(|(name, verb)| {
        let about = verb
            .get_about()
            .map(ToString::to_string)
            .unwrap_or_default();
        vec![format!("`{name}`"), usage(verb), about, documents(verb)]
    });
    let codes = EXIT_CODES
        .iter()
        .map(|(exit, about)| vec![(*exit as u8).to_string(), (*about).to_owned()]);
    let options = options(&verbs)
        .into_iter()
        .map(|it| vec![it.names, in_words(&it.verbs, &verbs), it.effect]);
    ReferencePage {
        title: "Verbs",
        about: about.to_owned(),
        tables: [
            ReferenceTable::new("Verbs", &["verb", "usage", "effect", "documents"], rows),
            ReferenceTable::new("Exit codes", &["code", "meaning"], codes),
            ReferenceTable::new("Options", &["option", "verbs", "effect"], options),
        ]
        .into_iter()
        .chain(gates::tables())
        .collect(),
    }
}

/// Returns the commands without verbs below them, by their names.
fn leaves<'a>(command: &'a Command, before: &str) -> Vec<(String, &'a Command)> {
    let shown = command.get_subcommands().filter(|verb| !verb.is_hide_set());
    let below = shown.flat_map(|verb| {
        let name = format!("{before}{}", verb.get_name());
        // A verb with verbs below it cannot be run by itself.
        if verb.has_subcommands() {
            leaves(verb, &format!("{name} "))
        } else {
            vec![(name, verb)]
        }
    });
    below.collect()
}

fn usage(verb: &Command) -> String {
    // clap renders a usage only from a command that it may change.
    let usage = verb.clone().render_usage().to_string();
    format!("`{}`", usage.trim_start_matches("Usage: "))
}

/// Returns the documents at the end of a help.
fn documents(verb: &Command) -> String {
    let after_help = verb.get_after_help().map(ToString::to_string);
    let help = after_help.unwrap_or_default();
    let (_, documents) = help.split_once("Documents: ").unwrap_or_default();
    documents.to_owned()
}

/// Returns all arguments, those of most verbs first.
fn options(verbs: &[(String, &Command)]) -> Vec<SharedOption> {
    let mut all: Vec<SharedOption> = Vec::new();
    for (verb, command) in verbs {
        for argument in command.get_arguments().filter(|it| !it.is_hide_set()) {
            let (names, effect) = (names(argument), effect(argument));
            // Verbs may give one name different effects.
            let same = all
                .iter_mut()
                .find(|it| it.names == names && it.effect == effect);
            match same {
                Some(option) => option.verbs.push(verb.clone()),
                None => all.push(SharedOption {
                    names,
                    effect,
                    verbs: vec![verb.clone()],
                }),
            }
        }
    }
    // The sort is stable, so options of as many verbs keep the order of the help.
    all.sort_by_key(|it| std::cmp::Reverse(it.verbs.len()));
    all
}

/// Returns the names of an argument, and its values.
fn names(argument: &Arg) -> String {
    // clap shows an option as `--name <VALUE>`, and leaves out its letter.
    let shown = argument.to_string();
    match argument.get_short() {
        Some(letter) if argument.get_long().is_some() => format!("`-{letter}`, `{shown}`"),
        _ => format!("`{shown}`"),
    }
}

/// Returns the help of an argument, with its values and its default.
fn effect(argument: &Arg) -> String {
    let styled = argument.get_long_help().or(argument.get_help());
    let help = styled.map(ToString::to_string).unwrap_or_default();
    // A cell of a table has one line, so paragraphs become sentences.
    let paragraphs = help.split("\n\n").map(|it| {
        let line = it.split_whitespace().collect::<Vec<_>>().join(" ");
        line.trim_end_matches('.').to_owned()
    });
    let mut text = paragraphs.collect::<Vec<_>>().join(". ");
    if !argument.get_action().takes_values() {
        return text;
    }
    let possible = argument.get_possible_values();
    let described = possible.iter().filter(|it| !it.is_hide_set()).map(|it| {
        let about = it.get_help().map(|about| format!(" ({about})"));
        format!("`{}`{}", it.get_name(), about.unwrap_or_default())
    });
    let values: Vec<String> = described.collect();
    if !values.is_empty() {
        text += &format!(". Values: {}", values.join(", "));
    }
    let stated = argument.get_default_values().iter();
    let defaults: Vec<String> = stated.map(|it| format!("`{}`", it.display())).collect();
    if !defaults.is_empty() {
        text += &format!(". Default: {}", defaults.join(", "));
    }
    text
}

fn in_words(some: &[String], all: &[(String, &Command)]) -> String {
    let names = all.iter().map(|(name, _)| name.as_str());
    let others: Vec<&str> = names
        .filter(|it| !some.iter().any(|name| name == it))
        .collect();
    match others.len() {
        0 => "all".to_owned(),
        few if few <= FEW => format!("all but {}", others.join(", ")),
        _ => some.join(", "),
    }
}
