//! A program under test: how it is run, and how it answers.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

pub fn run_in(dir: &Path, program: &str, args: &[&str]) -> Output {
    Command::cargo_bin(program)
        .expect("the program")
        .current_dir(dir)
        .env("NO_COLOR", "1")
        .args(args)
        .output()
        .expect("it runs")
}

pub fn code(output: &Output) -> i32 {
    output.status.code().expect("an exit code")
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
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
