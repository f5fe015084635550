//! `brakecheck reference`: tables of what the program knows, as Markdown or as data.

mod egos;
mod gates;
mod json_keys;
mod page;
mod shapes;
mod signals;
mod verbs;
mod world_file;

use clap::{Args, Command, ValueEnum};

use super::Cli;
use super::command_line;
use super::common::print_json;
use super::failure::{Exit, Failure};
use super::headings::OUTPUT;
use super::terminal::{self, Common};
use page::{ReferencePage, ReferenceTable};

#[derive(Args, Debug)]
pub(super) struct ReferenceArgs {
    /// Tables to print [default: list the topics].
    #[arg(value_enum)]
    topic: Option<ReferenceTopic>,
    /// Print one JSON object on stdout instead of Markdown.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
}

impl ReferenceArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            ..Common::default()
        }
    }
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum ReferenceTopic {
    /// Verbs, their options, exit codes and outcomes of a gate.
    Verbs,
    /// Signals that formulas use and that ados observe.
    Signals,
    /// Keys that `--json` prints.
    Json,
    /// Fields of world files.
    WorldFile,
    /// Stock egos and their parameters.
    Egos,
}

pub(super) fn run(args: &ReferenceArgs) -> Result<Exit, Failure> {
    let page = match args.topic {
        None => topics(),
        Some(ReferenceTopic::Verbs) => verbs::page(&program()),
        Some(ReferenceTopic::Signals) => signals::page()?,
        Some(ReferenceTopic::Json) => json_keys::page(),
        Some(ReferenceTopic::WorldFile) => world_file::page(),
        Some(ReferenceTopic::Egos) => egos::page(),
    };
    if args.json {
        print_json(&page.to_json())?;
    } else {
        // The last line feed is added by the printing.
        terminal::data(page.to_markdown().trim_end())?;
    }
    Ok(Exit::Done)
}

/// Returns the command line with all options.
fn program() -> Command {
    let mut program = command_line::command::<Cli>(true);
    // Otherwise verbs lack the options of the program.
    program.build();
    program
}

/// Returns the list of topics.
fn topics() -> ReferencePage {
    let values = ReferenceTopic::value_variants().iter();
    let rows = values.filter_map(ValueEnum::to_possible_value).map(|it| {
        let about = it.get_help().map(ToString::to_string).unwrap_or_default();
        vec![format!("`{}`", it.get_name()), about]
    });
    let table = ReferenceTable::new("", &["topic", "content"], rows);
    ReferencePage {
        title: "Reference",
        about: "`brakecheck reference TOPIC` prints the tables of a topic.".to_owned(),
        tables: vec![table],
    }
}
