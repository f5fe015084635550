//! A program under test: how it is run, and how it answers.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

use super::reference::check_keys;

#[track_caller]
pub fn run_in(dir: &Path, program: &str, args: &[&str]) -> Output {
    let output = unchecked(dir, program, args);
    if program == "brakecheck" {
        check_keys(args, &output);
    }
    output
}

/// Runs a program without a look at its keys.
pub fn unchecked(dir: &Path, program: &str, args: &[&str]) -> Output {
    Command::cargo_bin(program)
        .expect("the program")
        .current_dir(dir)
        .env("NO_COLOR", "1")
        .args(args)
        .output()
        .expect("it runs")
}

/// Runs brakecheck with these of the variables that it knows.
pub fn run_with(dir: &Path, variables: &[(&str, &str)], args: &[&str]) -> Output {
    let known = [
        "NO_COLOR",
        "CLICOLOR",
        "CLICOLOR_FORCE",
        "COLUMNS",
        "BRAKECHECK_JOBS",
        "BRAKECHECK_PLANT",
        "BRAKECHECK_COLOR",
    ];
    let mut command = Command::cargo_bin("brakecheck").expect("the program");
    for name in known {
        command.env_remove(name);
    }
    command
        .current_dir(dir)
        .envs(variables.iter().copied())
        .args(args)
        .output()
        .expect("it runs")
}

/// Runs brakecheck with a text as standard input.
pub fn run_piped(dir: &Path, args: &[&str], input: &str) -> Output {
    Command::cargo_bin("brakecheck")
        .expect("the program")
        .current_dir(dir)
        .env("NO_COLOR", "1")
        .args(args)
        .write_stdin(input)
        .output()
        .expect("it runs")
}

pub fn code(output: &Output) -> i32 {
    output.status.code().expect("an exit code")
}

/// Standard error, in which long messages are one line again.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ")
}

pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("no JSON ({e}): {}", stderr(output)))
}

/// A scratch directory of its own for one test.
pub fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a scratch directory")
}

pub fn path(dir: &tempfile::TempDir, name: &str) -> String {
    dir.path().join(name).display().to_string()
}
