//! `brakecheck export`: kept counterexamples as files for other tools.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::common::print_json;
use super::failure::{Exit, Failure};
use super::headings::{OUTPUT, RUNNING};
use super::kept_input;
use super::output_path::new_dir;
use super::terminal::{self, Common};
use crate::crashes::{ExportSettings, Exports, NotExported, export_with};

#[derive(Args, Debug)]
pub(super) struct ExportArgs {
    /// A kept counterexample (- is stdin), a directory of them, or a run directory.
    #[arg(value_name = "FILE|DIR|RUN")]
    what: PathBuf,
    /// The directory to write into, where files of the same names are replaced.
    #[arg(short, long, value_name = "DIR", value_parser = new_dir())]
    output: PathBuf,
    /// Also write each crash as an OSI trace: `NAME.mcap`.
    #[arg(long)]
    osi: bool,
    /// Print one JSON object on stdout instead of a list.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
    /// Start the program that a kept file names as the ego.
    #[arg(long, help_heading = RUNNING)]
    allow_programs: bool,
}

impl ExportArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            allow_programs: self.allow_programs,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &ExportArgs) -> Result<Exit, Failure> {
    let regressions = kept_input::find(&args.what, None)?.allow_programs(args.allow_programs);
    let settings = ExportSettings { osi: args.osi };
    let Exports { files, refused } = export_with(&regressions, &args.output, settings)?;
    let files: Vec<String> = files.iter().map(|it| it.display().to_string()).collect();
    if args.json {
        print_json(&json!({
            "files": files,
            "refused": refused.iter().map(refusal).collect::<Vec<_>>(),
        }))?;
    } else if !files.is_empty() {
        // Without files there would be an empty line.
        terminal::data(&files.join("\n"))?;
    }
    if refused.is_empty() {
        Ok(Exit::Done)
    } else {
        // The exported files stay, and the exit code shows that some are missing.
        Err(refused.into())
    }
}

fn refusal(refused: &NotExported) -> serde_json::Value {
    let file = refused.path.display().to_string();
    json!({ "file": file, "why": refused.why.to_string() })
}
