//! `brakecheck worlds`: the shipped worlds, listed, printed or copied.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use super::common::print_json;
use super::display::stdout_columns;
use super::failure::{Exit, Failure};
use super::headings::OUTPUT;
use super::new_world;
use super::terminal::{self, Common};
use crate::ron_file::did_you_mean;
use crate::run_dir::write_file;
use crate::world::Scenario;

#[derive(Args, Debug)]
pub(super) struct WorldsArgs {
    /// World to print or to copy, such as acc or ncap/cpna [default: list all].
    name: Option<String>,
    /// File to copy the world into, with the road files that it names beside it.
    #[arg(short, long, value_name = "FILE.ron", requires = "name")]
    output: Option<PathBuf>,
    /// Print one JSON object on stdout instead of lines.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
}

impl WorldsArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            ..Common::default()
        }
    }
}

/// Line of the list.
struct ShippedWorld {
    name: &'static str,
    kind: &'static str,
    question: String,
}

pub(super) fn run(args: &WorldsArgs) -> Result<Exit, Failure> {
    let Some(name) = &args.name else {
        return list(args);
    };
    let plain = name.strip_suffix(".ron").unwrap_or(name);
    let Some(text) = Scenario::shipped_text(plain) else {
        return Err(unknown(name));
    };
    match &args.output {
        Some(file) => copy(args, plain, text, file)?,
        None if args.json => {
            let files: Vec<&str> = Scenario::shipped_files(plain)
                .map(|(file, _)| file)
                .collect();
            print_json(&json!({ "name": plain, "text": text, "files": files }))?;
        }
        None => terminal::data(text.trim_end())?,
    }
    Ok(Exit::Done)
}

fn names() -> impl Iterator<Item = &'static str> {
    Scenario::shipped_names().chain(Scenario::protocol_names())
}

fn unknown(name: &str) -> Failure {
    let guess = did_you_mean(name, names());
    let help = guess.map_or(String::new(), |guess| format!("{guess} "));
    Failure::input(
        format!("unknown world `{name}`"),
        format!("{help}`brakecheck worlds` lists the shipped worlds"),
    )
}

/// Lists all shipped worlds.
fn list(args: &WorldsArgs) -> Result<Exit, Failure> {
    let mut worlds = Vec::new();
    for name in names() {
        let Some(world) = Scenario::shipped(name).transpose()? else {
            // Invariant: the names are those of the lists that are searched.
            continue;
        };
        worlds.push(ShippedWorld {
            name,
            kind: kind(&world),
            question: world.question,
        });
    }
    if args.json {
        let worlds: Vec<_> = worlds
            .iter()
            .map(|it| json!({ "name": it.name, "kind": it.kind, "question": it.question }))
            .collect();
        print_json(&json!({ "worlds": worlds }))?;
        return Ok(Exit::Done);
    }
    // Names are ASCII, so bytes are columns.
    let width = worlds.iter().map(|it| it.name.len()).max().unwrap_or(0);
    let lines: Vec<String> = worlds.iter().map(|it| line(it, width)).collect();
    terminal::data(&lines.join("\n"))?;
    // On stderr, so that stdout has the list alone.
    terminal::note(
        "`brakecheck worlds NAME` prints a world, `-o FILE.ron` copies it, `brakecheck check NAME` \
         explains it",
    );
    Ok(Exit::Done)
}

/// Formats one line, cut where the terminal ends.
fn line(world: &ShippedWorld, width: usize) -> String {
    // `points` is the longest kind, with six letters.
    let whole = format!(
        "{:<width$}  {:<6}  {}",
        world.name, world.kind, world.question
    );
    let columns = stdout_columns();
    match whole.char_indices().nth(columns) {
        None => whole,
        Some(_) => {
            // The last column is for the ellipsis.
            let cut: String = whole.chars().take(columns - 1).collect();
            format!("{cut}…")
        }
    }
}

/// Returns the kind of a world in a word.
fn kind(world: &Scenario) -> &'static str {
    if world.drive().is_none() {
        "grid"
    } else if world.has_points() {
        "points"
    } else {
        "road"
    }
}

/// Copies a world and the road files that it names. No file is overwritten.
fn copy(args: &WorldsArgs, name: &str, text: &str, file: &Path) -> Result<(), Failure> {
    // As in `cp`, a directory is where the file goes, under the name of the world.
    let is_directory = file.is_dir();
    let file = if is_directory {
        // Names of protocol worlds have a folder, as in `ncap/cpna`.
        let stem = name.rsplit('/').next().unwrap_or(name);
        file.join(format!("{stem}.ron"))
    } else {
        file.to_owned()
    };
    let mut files = vec![(file.clone(), text)];
    for (road, content) in Scenario::shipped_files(name) {
        let beside = file.with_file_name(road);
        // A copy of another world may have brought it.
        let is_there = std::fs::read_to_string(&beside).is_ok_and(|it| it == content);
        if !is_there {
            files.push((beside, content));
        }
    }
    // Checked before any is written, so that a refusal leaves no partial copy.
    for (path, _) in &files {
        new_world::refuse_taken(path)?;
    }
    for (path, content) in &files {
        write_file(path, content.as_bytes())?;
    }
    let written: Vec<String> = files.iter().map(|it| it.0.display().to_string()).collect();
    if args.json {
        return print_json(&json!({ "name": name, "files": written }));
    }
    terminal::data(&format!(
        "wrote {}; next: brakecheck check {}",
        written.join(", "),
        file.display()
    ))
}
