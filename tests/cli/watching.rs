//! `check --watch`: a world is checked again when it, or a file that it includes, is saved.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command as Process, Stdio};

use super::{refused, root, scratch};

/// Returns the next line of the program with one of some words.
#[cfg(unix)]
fn until(lines: &mut impl Iterator<Item = std::io::Result<String>>, word: &str) -> String {
    lines
        .map(|line| line.expect("a line"))
        .find(|line| line.contains(word))
        .unwrap_or_else(|| panic!("no line with `{word}`"))
}

#[cfg(unix)]
fn save(path: &Path, text: &str) {
    // In one step, so that no half of it is read.
    let beside = path.with_extension("new");
    std::fs::write(&beside, text).expect("written");
    std::fs::rename(beside, path).expect("renamed");
}

#[cfg(unix)]
#[test]
fn a_watched_world_is_checked_when_it_or_its_road_is_saved() {
    let dir = scratch();
    let (world, road) = (
        dir.path().join("mine.ron"),
        dir.path().join("junction.xodr"),
    );
    for (name, file) in [("junction.ron", &world), ("junction.xodr", &road)] {
        std::fs::copy(root().join("worlds").join(name), file).expect("copied");
    }
    let sound = std::fs::read_to_string(&world).expect("text");
    let mut child = Process::new(assert_cmd::cargo::cargo_bin("brakecheck"))
        .current_dir(dir.path())
        .args(["check", "mine.ron", "--watch"])
        .env("NO_COLOR", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut lines = BufReader::new(child.stdout.take().expect("stdout")).lines();
    let mut errors = BufReader::new(child.stderr.take().expect("stderr")).lines();
    until(&mut lines, " UTC");
    until(&mut lines, "is valid");
    save(&world, &sound.replacen("name:", "nme:", 1));
    until(&mut lines, " UTC");
    until(&mut errors, "mine.ron:");
    save(&world, &sound);
    until(&mut lines, "is valid");
    save(&road, "no road");
    until(&mut errors, "junction.xodr");
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::INT).expect("sent");
    // Nothing waits for a pipe that is full.
    drop((lines, errors));
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}

#[test]
fn only_a_file_is_watched() {
    refused(&["check", "acc", "--watch"], "requires a world file");
    refused(&["check", "--watch"], "required arguments");
}
