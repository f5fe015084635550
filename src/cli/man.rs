//! `brakecheck man`: manual pages of the program and of each verb.

use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_mangen::Man;

use super::Cli;
use super::command_line;
use super::failure::{Exit, Failure};
use super::terminal;
use crate::run_dir::{make_dir, write_file};

#[derive(Args, Debug)]
pub(super) struct ManArgs {
    /// Directory to write the pages of the program and of each verb into.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

pub(super) fn run(args: &ManArgs) -> Result<Exit, Failure> {
    // A manual lists every option, also those that `--help` hides.
    let mut program = command_line::command::<Cli>(true);
    // Only a built command has the global options in the pages of its verbs.
    program.build();
    let Some(directory) = &args.output else {
        let page = page(&Man::new(program))?;
        // A page is UTF-8, so no byte of it is lost.
        terminal::data(String::from_utf8_lossy(&page).trim_end())?;
        return Ok(Exit::Done);
    };
    make_dir(directory)?;
    let pages = write_pages(&program, directory)?;
    let directory = directory.display();
    terminal::data(&format!("wrote {pages} pages into {directory}"))?;
    Ok(Exit::Done)
}

/// Writes the pages of a command and of its verbs, and returns their number.
fn write_pages(command: &Command, directory: &Path) -> Result<usize, Failure> {
    // The command itself has a page, too.
    let mut pages = 1;
    // A hidden verb is not part of the documented interface.
    for verb in command.get_subcommands().filter(|verb| !verb.is_hide_set()) {
        pages += write_pages(verb, directory)?;
    }
    let manual = Man::new(command.clone());
    write_file(&directory.join(manual.get_filename()), &page(&manual)?)?;
    Ok(pages)
}

fn page(manual: &Man) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    let rendered = manual.render(&mut page);
    // Pages are rendered into memory, so an error is one of the program.
    rendered.map_err(|error| Failure::fault(format!("a page was not rendered: {error}"), None))?;
    Ok(page)
}
