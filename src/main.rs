//! The command line program; see the crate's `cli` module.

use std::process::ExitCode;

fn main() -> ExitCode {
    brakecheck::cli::main()
}
