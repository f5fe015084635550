//! `brakecheck new`: a small world of one's own, to be changed.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::{Common, Exit, Failure, print_json, talk};
use crate::run::write_file;
use crate::scenario::Scenario;

/// The world that is written; its name is put in.
const WORLD: &str = include_str!("new_world.ron");

#[derive(Args, Debug)]
pub(super) struct NewArgs {
    /// Its name; the file is NAME.ron in this directory.
    name: String,
    /// Print one JSON object on stdout instead of talking.
    #[arg(long)]
    pub(super) json: bool,
}

impl NewArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &NewArgs) -> Result<Exit, Failure> {
    let name = args.name.strip_suffix(".ron").unwrap_or(&args.name);
    let file = format!("{name}.ron");
    // The world's own checks say which names files may have.
    let text = WORLD.replace("NAME", name);
    if Scenario::parse(&file, &text).is_err() {
        return Err(Failure::input(
            format!("`{name}` cannot name a world"),
            "at most 64 letters, digits, _ and -: files are named after it",
        ));
    }
    let path = PathBuf::from(&file);
    if path.symlink_metadata().is_ok() {
        return Err(Failure::input(
            format!("`{file}` is there already, and is left as it is"),
            "choose another name, or move the file away",
        ));
    }
    write_file(&path, text.as_bytes())?;
    match args.json {
        true => print_json(&json!({ "file": file })),
        false => talk::data(&format!(
            "wrote {file}; next: brakecheck check {file}, then brakecheck search {file} --starts 20"
        )),
    }?;
    Ok(Exit::Done)
}
