//! End of `--help`: an example per verb, exit codes and documents.

use super::failure::Exit;

/// Behind the list of verbs.
pub(super) const SHORT: &str = "\
Begin with `brakecheck new mine`. `brakecheck VERB --help` explains a verb";

/// Exit codes with their meanings.
pub(super) const EXIT_CODES: [(Exit, &str); 6] = [
    (Exit::Done, "done"),
    (
        Exit::Counterexample,
        "a counterexample with `--fail-on-counterexample`, a kept crash that still fails in \
         `replay`, a closed `gate`, a `harden` without a confirmed change, or a ratio above \
         `--at-most`",
    ),
    (
        Exit::Input,
        "invalid input: the message shows the place and a fix",
    ),
    (
        Exit::Fault,
        "the ego, the disk or the program failed, or a result was refused",
    ),
    (Exit::NotIdentical, "a replay differs from its record"),
    (Exit::Interrupted, "interrupted, with finished work kept"),
];

/// Returns the text behind the list of all options.
pub(super) fn all() -> String {
    let line = |(exit, about): &(Exit, &str)| format!("  {:<4} {about}\n", *exit as u8);
    let codes: String = EXIT_CODES.iter().map(line).collect();
    format!("Exit codes:\n{codes}\n{ALL}")
}

const ALL: &str = "\
First steps:
  brakecheck new mine
  brakecheck check mine.ron
  brakecheck search mine.ron --starts 20

Defaults, each overridden by the next: `brakecheck.toml` in this directory or its repository,
the variables BRAKECHECK_JOBS, BRAKECHECK_PLANT and BRAKECHECK_COLOR, the options.
Documents: docs/README.md beside the source, and `brakecheck VERB --help`.
The paper's tables and figures: crates/repro/README.md.
Libraries in this program, with their licences: `brakecheck notices`.";

pub(super) const NEW: &str = "Examples:\n  brakecheck new mine\n  brakecheck new follow --from-log tracks.csv --kind following -o worlds\n\nDocuments: docs/guide/worlds.md, docs/guide/recordings.md";
pub(super) const WORLDS: &str = "Examples:\n  brakecheck worlds acc\n  brakecheck worlds junction -o mine.ron\n\nDocuments: docs/guide/worlds.md";
pub(super) const COMPLETIONS: &str = "Examples:\n  brakecheck completions zsh\n  source <(brakecheck completions bash)\n\nDocuments: docs/README.md";
pub(super) const MAN: &str = "Examples:\n  brakecheck man -o ~/.local/share/man/man1\n  brakecheck man | man -l -\n\nDocuments: docs/README.md";
pub(super) const REFERENCE: &str = "Examples:\n  brakecheck reference signals\n  brakecheck reference verbs --json\n\nDocuments: docs/README.md";
pub(super) const CHECK: &str = "Example:\n  brakecheck check worlds/acc.ron\n\nDocuments: docs/guide/worlds.md, docs/reference/ego-protocol.md";
pub(super) const TRAIN: &str = "Examples:\n  brakecheck train worlds/acc.ron -o runs/acc --decisions 300k\n  brakecheck train worlds/acc.ron -o runs/acc --rerun - | rerun -\n\nDocuments: docs/background/learners.md";
pub(super) const EVAL: &str = "Example:\n  brakecheck eval runs/acc --ego all --search 2 --keep kept\n\nDocuments: docs/guide/reuse.md, docs/guide/crashes.md";
pub(super) const GATE: &str = "Examples:\n  brakecheck gate runs/acc --ego new.ron --baseline-ego nominal\n  brakecheck gate runs/acc --baseline-ego old.ron -- python3 ego.py\n\nDocuments: docs/background/claims.md";
pub(super) const SWEEP: &str = "Example:\n  brakecheck sweep runs/acc --over ego.time_gap_s=0.3..1.5:7 --curve curve.svg\n\nDocuments: docs/background/claims.md";
pub(super) const HARDEN: &str = "Examples:\n  brakecheck harden acc --traffic examples/traffic/acc.ron\n  brakecheck harden runs/acc --keep-below braking=105%\n  brakecheck harden runs/acc -- python3 examples/egos/tunable.py\n\nDocuments: docs/guide/harden.md";
pub(super) const SEARCH: &str =
    "Example:\n  brakecheck search worlds/acc.ron --starts 50\n\nDocuments: docs/guide/search.md";
pub(super) const RISK: &str = "Example:\n  brakecheck risk acc --traffic examples/traffic/acc.ron --plant kinematic --budget 50000\n\nDocuments: docs/guide/risk.md";
pub(super) const COVERAGE: &str = "Examples:\n  brakecheck coverage runs/acc\n  brakecheck coverage kept\n\nDocuments: docs/guide/coverage.md";
pub(super) const REPLAY: &str =
    "Example:\n  brakecheck replay kept --expect recorded\n\nDocuments: docs/guide/crashes.md";
pub(super) const STL: &str = "Examples:\n  brakecheck stl \"always (gap >= 0.5)\" --trace trace.csv --explain\n  brakecheck stl motorway --log tracks.csv --junit rules.xml\n\nDocuments: docs/reference/stl.md, docs/guide/recordings.md";
pub(super) const LOG: &str = "Examples:\n  brakecheck log tracks.csv\n  brakecheck log tracks.csv --fit traffic.ron\n\nDocuments: docs/guide/recordings.md";
pub(super) const REPORT: &str =
    "Example:\n  brakecheck report runs/acc --starts 100\n\nDocuments: docs/guide/report.md";
#[cfg(feature = "drive")]
pub(super) const DRIVE: &str = "Examples:\n  brakecheck drive acc --open\n  brakecheck drive runs/acc\n  brakecheck drive mine.ron --watch\n\nDocuments: docs/guide/drive.md";
pub(super) const VIEW: &str = "Examples:\n  brakecheck view kept 0 -o crash.rrd\n  brakecheck view kept 0 -o crash.svg --beside FSM\n  brakecheck view kept --rerun kept.rrd\n\nDocuments: docs/guide/pictures.md";
pub(super) const EXPORT: &str = "Example:\n  brakecheck export kept -o scenarios\n  esmini --osc scenarios/NAME.xosc --traj_filter 0 --pline_interpolation segment\n\nDocuments: docs/guide/export.md";
pub(super) const SERVE: &str = "Examples:\n  brakecheck serve runs/acc\n  brakecheck serve acc --ado search\n\nDocuments: docs/reference/ado-protocol.md";
pub(super) const LSP: &str =
    "Example:\n  brakecheck lsp --stdio\n\nDocuments: docs/guide/editors.md";

pub(super) const CAMPAIGN: &str = "Example:\n  brakecheck campaign plan campaign.ron -o plan\n  brakecheck campaign run plan\n  brakecheck campaign merge plan\n\nDocuments: docs/guide/campaigns.md";
pub(super) const CAMPAIGN_PLAN: &str = "Examples:\n  brakecheck campaign plan campaign.ron --dry-run\n  brakecheck campaign plan campaign.ron -o plan\n\nDocuments: docs/guide/campaigns.md";
pub(super) const CAMPAIGN_RUN: &str = "Examples:\n  brakecheck campaign run plan\n  brakecheck campaign run plan --partition 2/8\n  brakecheck campaign run plan --piece 7\n\nDocuments: docs/guide/campaigns.md";
pub(super) const CAMPAIGN_MERGE: &str = "Examples:\n  brakecheck campaign merge plan\n  brakecheck campaign merge plan --with copy-of-another-machine\n\nDocuments: docs/guide/campaigns.md";

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use crate::cli::Cli;

    /// The words of a command as a shell would cut them.
    fn words(line: &str) -> Vec<String> {
        let parts = line.split('"').enumerate();
        // Parts at odd positions are inside of quotes.
        let cut = parts.flat_map(|(i, part)| match i % 2 {
            1 => vec![part.to_owned()],
            _ => part.split_whitespace().map(str::to_owned).collect(),
        });
        cut.collect()
    }

    #[test]
    fn every_verb_has_an_example_that_parses() {
        let program = Cli::command();
        for verb in program.get_subcommands().filter(|verb| !verb.is_hide_set()) {
            let name = verb.get_name();
            let help = verb
                .get_after_help()
                .map(ToString::to_string)
                .unwrap_or_default();
            let mut lines = help.lines().map(str::trim);
            let begins = format!("brakecheck {name} ");
            let example = lines
                .find(|line| line.starts_with(&begins))
                .unwrap_or_else(|| panic!("`{name}` has no example: {help:?}"));
            if let Err(error) = Cli::try_parse_from(words(example)) {
                panic!("{example}: {error}");
            }
        }
    }

    #[test]
    fn every_verb_draws_as_many_starts_unless_told_otherwise() {
        let program = Cli::command();
        let verbs = program.get_subcommands().filter_map(|verb| {
            let mut arguments = verb.get_arguments();
            let starts = arguments.find(|argument| argument.get_id() == "starts")?;
            Some((verb.get_name(), starts.get_default_values().to_vec()))
        });
        let drawing: Vec<_> = verbs.collect();
        // Fewer verbs would mean that one of them gives the option another name.
        assert_eq!(drawing.len(), 8, "{drawing:?}");
        for (verb, values) in &drawing {
            assert_eq!(values, &["300"], "{verb}");
        }
    }

    #[test]
    fn documents_that_help_names_are_there() {
        let all = Cli::command();
        let verbs = all
            .get_subcommands()
            .filter_map(|verb| verb.get_after_help());
        let texts = verbs
            .map(ToString::to_string)
            .chain([super::ALL.to_owned(), super::SHORT.to_owned()]);
        for text in texts {
            for word in text
                .split([' ', ',', '\n', ';'])
                .filter(|word| word.starts_with("docs/"))
            {
                let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(word);
                assert!(path.is_file(), "{word}");
            }
        }
    }
}
