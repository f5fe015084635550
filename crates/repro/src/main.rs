//! The program; see the package's `cli` module.

use std::process::ExitCode;

fn main() -> ExitCode {
    brakecheck_repro::main()
}
