//! `brakecheck lsp`: world files in editors.

use std::io;

use brakecheck_lsp::{CheckedText, KnownName, SessionEnd, WorldLanguage, WorldProblem, serve};
use clap::Args;
use serde_json::Value;

use super::failure::{Exit, Failure};
use super::terminal::Common;
use crate::experiment::NeutralRule;
use crate::risk::{RiskTraffic, RiskTrafficError};
use crate::ron_file::{LoadError, Problem, did_you_mean, first_word};
use crate::sim::Body;
use crate::world::{RunsOnDisk, Scenario};
use crate::world_file;

/// First words of worlds.
const KINDS: [&str; 2] = ["Scenario", "Grid"];

#[derive(Args, Debug)]
pub(super) struct LspArgs {
    /// Accepted because some editors add it: the server knows no other way.
    #[arg(long, hide = true)]
    stdio: bool,
}

impl LspArgs {
    pub(super) fn common(&self) -> Common {
        Common::default()
    }
}

#[allow(clippy::disallowed_methods, reason = "messages of the protocol")]
pub(super) fn run(_: &LspArgs) -> Result<Exit, Failure> {
    let worlds = Worlds {
        schema: world_file::schema(),
    };
    let input = io::BufReader::new(io::stdin());
    match serve(input, &mut io::stdout().lock(), &worlds) {
        Ok(SessionEnd::Orderly) => Ok(Exit::Done),
        // The protocol wants this code of a session without `shutdown`.
        Ok(SessionEnd::Abrupt) => Ok(Exit::Counterexample),
        Err(error) => Err(Failure::fault(
            format!("writing to the editor failed: {error}"),
            Some("start the server again".to_owned()),
        )),
    }
}

/// Worlds as `check` knows them. No method starts a program.
struct Worlds {
    schema: Value,
}

impl WorldLanguage for Worlds {
    fn check(&self, file: &str, text: &str) -> Option<CheckedText> {
        if !is_world(text) {
            return None;
        }
        Some(match Scenario::parse_with(file, text, &RunsOnDisk) {
            Ok(world) => checked(&world),
            Err(error) => CheckedText {
                problems: shown(error.problems, false).collect(),
                // Places of problems count in the text with its included files.
                text: error.text,
                // A world with a mistake may lack signals, so no list of them is right.
                names: None,
            },
        })
    }

    fn schema(&self) -> &Value {
        &self.schema
    }

    fn stock_names(&self, field: &str) -> Vec<String> {
        match field {
            "body" | "ego_body" => Body::shipped_names().map(str::to_owned).collect(),
            _ => Vec::new(),
        }
    }
}

/// Returns whether a text begins as a world, typing errors included.
fn is_world(text: &str) -> bool {
    // Editors open RON files of all kinds, and only worlds are to be marked.
    let own = text.strip_prefix('\u{feff}').unwrap_or(text);
    first_word(own).is_some_and(|word| did_you_mean(&own[word], KINDS).is_some())
}

/// Returns the statements of `check` about a world that can be used.
fn checked(world: &Scenario) -> CheckedText {
    let mut problems: Vec<WorldProblem> = traffic_problems(world);
    problems.extend(shown(world.warnings.clone(), true));
    // It has no place, so the world's first word is marked.
    let top = first_word(&world.text).unwrap_or_default();
    problems.extend(NeutralRule::of(world).map(|rule| WorldProblem {
        what: rule.to_string(),
        help: Some(rule.help().to_owned()),
        span: top,
        is_warning: true,
    }));
    CheckedText {
        text: world.text.clone(),
        problems,
        names: Some(names(world)),
    }
}

/// Mistakes in the world's traffic, which `risk` reads.
fn traffic_problems(world: &Scenario) -> Vec<WorldProblem> {
    match RiskTraffic::of_world(world) {
        Ok(_) => Vec::new(),
        Err(RiskTrafficError::File(LoadError::Scenario(error))) => {
            shown(error.problems, false).collect()
        }
        Err(error) => vec![WorldProblem {
            what: error.to_string(),
            help: None,
            span: first_word(&world.text).unwrap_or_default(),
            is_warning: false,
        }],
    }
}

fn shown(problems: Vec<Problem>, is_warning: bool) -> impl Iterator<Item = WorldProblem> {
    problems.into_iter().map(move |problem| WorldProblem {
        what: problem.what,
        help: problem.help,
        span: problem.span,
        is_warning,
    })
}

/// Signals and constants that formulas may use.
fn names(world: &Scenario) -> Vec<KnownName> {
    let signals = world.signals().into_iter().map(|(signal, _)| KnownName {
        name: signal.name,
        unit: signal.unit.into_owned(),
        about: signal.about,
    });
    let constants = world.names.constants.iter().map(|(name, value)| KnownName {
        name: name.clone(),
        unit: String::new(),
        about: format!("constant {value}"),
    });
    signals.chain(constants).collect()
}
