//! `brakecheck completions`: verbs, options and values for shells.

use clap::Args;
use clap_complete::Shell;

use super::Cli;
use super::command_line;
use super::failure::{Exit, Failure};
use super::terminal;

#[derive(Args, Debug)]
pub(super) struct CompletionsArgs {
    /// Shell that reads them.
    #[arg(value_enum)]
    shell: Shell,
}

pub(super) fn run(args: &CompletionsArgs) -> Result<Exit, Failure> {
    // A shell completes the options of `--help-all`, too.
    let mut command = command_line::command::<Cli>(true);
    let name = command.get_name().to_owned();
    // Rendered into memory, because text reaches a terminal through `terminal` only.
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, name, &mut script);
    // A script is UTF-8, so no byte of it is lost.
    terminal::data(String::from_utf8_lossy(&script).trim_end())?;
    Ok(Exit::Done)
}
