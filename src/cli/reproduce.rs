//! `brakecheck reproduce`: a verb of earlier versions, refused with its new command.

use clap::Args;

use super::failure::Failure;
use crate::visible::command_line;

/// Whatever an earlier version took.
#[derive(Args, Debug)]
pub(super) struct RefusedArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    words: Vec<String>,
}

/// Refusal of `reproduce WHAT`.
pub(super) fn refusal(args: &RefusedArgs) -> Failure {
    let words = if args.words.is_empty() {
        "WHAT".to_owned()
    } else {
        command_line(&args.words)
    };
    Failure::input(
        "`reproduce` moved to the package `brakecheck-repro`, which is not published",
        "run this in a copy of the repository:",
    )
    .with_command(&format!(
        "cargo run --release -p brakecheck-repro -- {words}"
    ))
}
