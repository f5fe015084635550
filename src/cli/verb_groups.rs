//! The list of verbs in the help of the program, in groups.

use clap::Command;

/// Groups of verbs, in the order in which a new user needs them.
const GROUPS: [(&str, &[&str]); 5] = [
    ("First steps", &["new", "check", "worlds", "drive"]),
    (
        "Find failures",
        &["search", "eval", "train", "risk", "campaign"],
    ),
    ("Compare egos", &["gate", "sweep", "harden"]),
    (
        "Look into failures",
        &["replay", "coverage", "view", "export", "report"],
    ),
    (
        "Recordings, tools and tables",
        &[
            "stl",
            "log",
            "serve",
            "lsp",
            "reference",
            "completions",
            "man",
        ],
    ),
];

/// Returns the program with its verbs in groups.
pub(super) fn grouped(program: Command) -> Command {
    // clap cannot group subcommands, so the list is part of the template.
    let header = program.get_styles().get_header();
    let literal = program.get_styles().get_literal();
    let mut list = String::new();
    for (title, verbs) in GROUPS {
        list.push_str(&format!("{header}{title}:{header:#}\n"));
        // A build may lack a verb.
        for verb in verbs
            .iter()
            .filter_map(|name| program.find_subcommand(name))
        {
            let about = verb.get_about().map(ToString::to_string);
            let (name, about) = (verb.get_name(), about.unwrap_or_default());
            // Wide enough for the longest verb, `completions`.
            list.push_str(&format!("  {literal}{name:<12}{literal:#} {about}\n"));
        }
    }
    let options = format!("{header}Options:{header:#}");
    let template = format!(
        "{{about}}\n\n{{usage-heading}} {{usage}}\n\n{list}\n{options}\n{{options}}{{after-help}}"
    );
    program.help_template(template)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_verb_is_in_one_group() {
        let program = Cli::command();
        let mut listed: Vec<&str> = GROUPS
            .iter()
            .flat_map(|(_, verbs)| *verbs)
            .copied()
            .collect();
        let shown = program.get_subcommands().filter(|verb| !verb.is_hide_set());
        let mut verbs: Vec<&str> = shown.map(Command::get_name).collect();
        if cfg!(not(feature = "drive")) {
            listed.retain(|verb| *verb != "drive");
        }
        listed.sort_unstable();
        verbs.sort_unstable();
        assert_eq!(listed, verbs);
    }
}
