//! `brakecheck notices`: the libraries in the program and their licences.

use clap::Args;

use super::failure::{Exit, Failure};
use super::terminal;

/// The output of `cargo run --release --example notices`.
const NOTICES: &str = include_str!("../../THIRD_PARTY.txt");

#[derive(Args, Debug)]
pub(super) struct NoticesArgs {}

pub(super) fn run(_: &NoticesArgs) -> Result<Exit, Failure> {
    // The last line feed is added by the printing.
    terminal::data(NOTICES.trim_end())?;
    Ok(Exit::Done)
}
