#![cfg(test)]
#![allow(clippy::print_stdout, reason = "the result of a long search")]
//! Failure of every disk step of a verb, followed by a resumption.
//!
//! The files must equal those of an undisturbed run. The test makes a few steps of each
//! verb fail, chosen by a seeded draw. `BRAKECHECK_CRASHES=all cargo test --release
//! crashes` makes every step fail (CONTRIBUTING.md).

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use rand::RngExt;

use super::terminal::with_jobs;
use super::{Cli, Exit, carry_out};
use crate::run_files::disk_faults::{StepFailure, failing};
use crate::seed::generator;

/// Intervals at which a short training has several lines and checkpoints.
const FREQUENT: &str = "--report-every 7 --checkpoint-every 400";

/// Steps per verb and kind of failure, unless all are requested.
const FEW: usize = 4;

fn shipped(world: &str) -> String {
    format!("{}/worlds/{world}.ron", env!("CARGO_MANIFEST_DIR"))
}

/// Runs a command line, and returns whether it succeeded.
fn run(args: &[String]) -> bool {
    let cli = Cli::try_parse_from(std::iter::once("brakecheck".to_owned()).chain(args.to_vec()))
        .unwrap_or_else(|error| panic!("{args:?}: {error}"));
    let common = cli.verb.common();
    let ended = with_jobs(&common, || carry_out(cli.verb));
    matches!(ended, Ok(Exit::Done))
}

/// Given a directory: a command line that writes into it.
type CommandBuilder<'a> = &'a (dyn Fn(&Path) -> Vec<String> + Sync);

/// A verb, and how to go on with it.
struct KilledVerb<'a> {
    name: &'a str,
    command: CommandBuilder<'a>,
}

impl KilledVerb<'_> {
    /// Returns the current command line, which resumes a training that was begun.
    fn now(&self, dir: &Path) -> Vec<String> {
        let mut command = (self.command)(dir);
        let begun = ["manifest.json", "population.json"].map(|file| dir.join("run").join(file));
        // The other verbs go on by the same command.
        if command[0] == "train" && begun.iter().any(|file| file.exists()) {
            // A training that was killed before its manifest is begun again.
            command.push("--resume".to_owned());
        }
        command
    }

    /// Returns the files of an undisturbed run, and its number of steps.
    fn undisturbed(&self) -> (BTreeMap<PathBuf, Vec<u8>>, u64) {
        let dir = tempfile::tempdir().expect("scratch");
        let command = self.now(dir.path());
        // No run has so many steps, so none fails and all are counted.
        let (done, steps) = failing(dir.path(), u64::MAX, StepFailure::Killed, || run(&command));
        assert!(done, "{}", self.name);
        (files(dir.path()), steps)
    }

    /// Killed or refused at a step, and once more while it goes on.
    fn disturbed(&self, at: u64, how: StepFailure, again: u64) -> BTreeMap<PathBuf, Vec<u8>> {
        let dir = tempfile::tempdir().expect("scratch");
        for at in [at, again] {
            let command = self.now(dir.path());
            failing(dir.path(), at, how, || run(&command));
        }
        let command = self.now(dir.path());
        assert!(run(&command), "{}: {how:?} at {at}: not done", self.name);
        files(dir.path())
    }

    /// Checks all failures, and returns the number of failed steps.
    fn holds(&self) -> usize {
        let mut points = 0;
        let (whole, steps) = self.undisturbed();
        let (again, _) = self.undisturbed();
        // Two undisturbed runs must agree first, or the comparison would prove nothing.
        assert_eq!(files_differing(&whole, &again), [""; 0], "{}", self.name);
        let mut dice = generator("crash points", &[steps]);
        let all = std::env::var("BRAKECHECK_CRASHES").is_ok_and(|asked| asked == "all");
        for how in [StepFailure::Killed, StepFailure::Refused] {
            let mut at: Vec<u64> = (1..=steps).collect();
            if !all {
                at = (0..FEW).map(|_| dice.random_range(1..=steps)).collect();
            }
            for at in at {
                // The resumption is disturbed, too, at another step.
                let again = dice.random_range(1..=steps);
                let other = self.disturbed(at, how, again);
                let differing = files_differing(&whole, &other);
                let place = format!("{}, {how:?} at step {at} and {again} of {steps}", self.name);
                assert!(differing.is_empty(), "{place}: {differing:?}");
                // The resumption failed at a step, too.
                points += 2;
            }
        }
        points
    }
}

/// Returns every file under a directory, without measured values.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut left = vec![dir.to_owned()];
    while let Some(next) = left.pop() {
        for entry in fs::read_dir(&next).expect("a directory").flatten() {
            let path = entry.path();
            if path.is_dir() {
                // Trivial starts that could not be stored change no result.
                if !path.ends_with("trivial") {
                    left.push(path);
                }
                continue;
            }
            // Who made a piece of a campaign, and how long that took.
            if path.to_string_lossy().ends_with(".cost.json") {
                continue;
            }
            let text = fs::read(&path).expect("a file");
            let name = path.strip_prefix(dir).expect("below").to_owned();
            all.insert(name, untimed(&path, text));
        }
    }
    all
}

/// A file without processor times: the only thing that may differ.
fn untimed(path: &Path, bytes: Vec<u8>) -> Vec<u8> {
    let text = match path.extension().and_then(|e| e.to_str()) {
        Some("json" | "md") => String::from_utf8(bytes).expect("text"),
        _ => return bytes,
    };
    // The last column of a Markdown table is the processor time.
    let times = |line: &str| match line.split_once("cpu_s\":") {
        None if line.starts_with('|') => line.rsplitn(3, '|').last().map(str::to_owned),
        _ => None,
    };
    let mut kept = String::new();
    for line in text.lines() {
        let line = unsealed(&times(line).unwrap_or_else(|| line.to_owned()));
        let mut parts = line.split("cpu_s\":");
        kept.push_str(parts.next().unwrap_or_default());
        for part in parts {
            let number = |c: char| c.is_ascii_digit() || " .-+e".contains(c);
            kept.push_str(part.trim_start_matches(number));
        }
        kept.push('\n');
    }
    kept.into_bytes()
}

/// A line without the seal of a file that holds times.
fn unsealed(line: &str) -> String {
    let Some((before, seal)) = line.split_once("\"seal\":") else {
        return line.to_owned();
    };
    let digits = |c: char| c.is_ascii_hexdigit() || " \"".contains(c);
    // The seal is a hash of the content, so it differs with the times.
    format!("{before}{}", seal.trim_start_matches(digits))
}

/// Returns the names of files that are missing or different on either side.
fn files_differing<'a>(
    whole: &'a BTreeMap<PathBuf, Vec<u8>>,
    other: &'a BTreeMap<PathBuf, Vec<u8>>,
) -> Vec<&'a str> {
    let names = whole.keys().chain(other.keys());
    let differing = names.filter(|name| whole.get(*name) != other.get(*name));
    differing.map(|name| name.to_str().unwrap_or("?")).collect()
}

/// Splits a command line into words, with `~` as a blank inside a word.
fn words(text: &str) -> Vec<String> {
    let words = text.split_whitespace();
    words.map(|word| word.replace('~', " ")).collect()
}

fn train(dir: &Path, world: &str, options: &str) -> Vec<String> {
    let run = dir.join("run");
    words(&format!(
        "train {world} -o {} --starts 6 --jobs 1 {FREQUENT} {options}",
        run.display()
    ))
}

/// A run that others begin from or are played on.
fn finished(dir: &Path, world: &str, options: &str) -> PathBuf {
    assert!(run(&train(dir, world, options)), "{world} {options}");
    dir.join("run")
}

/// A training and some pieces.
const CAMPAIGN: &str = r#"Campaign(
    name: "crashes",
    worlds: [(file: "ACC", plant: Kinematic)],
    ados: [Held, Training(seeds: 1, decisions: 1100)],
    starts: Drawn(count: 6, seed: 9),
)"#;

/// A directory with all that is in it, unless it is there.
fn copied(from: &Path, to: &Path) {
    if to.exists() {
        return;
    }
    fs::create_dir_all(to).expect("a directory");
    for entry in fs::read_dir(from).expect("a directory").flatten() {
        let (path, to) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copied(&path, &to)
        } else {
            fs::copy(&path, &to).expect("copied");
        }
    }
}

#[test]
fn whoever_is_killed_at_any_step_ends_in_the_same_files() {
    let scratch = tempfile::tempdir().expect("scratch");
    let grid = shipped("grid");
    let worlds = scratch.path().join("worlds");
    fs::create_dir(&worlds).expect("a directory");
    let acc = worlds.join("acc.ron").display().to_string();
    let text = fs::read_to_string(shipped("acc")).expect("a world");
    let quick = text
        // Small trainings keep the steps on the disk and drop the computation.
        .replace("Dqn(decisions: 300_000)", "Dqn(decisions: 900)")
        .replace("horizon_s: 15.0", "horizon_s: 8.0");
    fs::write(&acc, quick).expect("written");
    let short = "--plant kinematic --decisions 1200 --seed 3";
    let nominal = finished(&scratch.path().join("nominal"), &acc, short);
    for file in ["counterexamples.jsonl", "progress.jsonl"] {
        // An empty file would hide differences.
        let length = fs::metadata(nominal.join(file)).expect("a file").len();
        assert_ne!(length, 0, "{file}");
    }

    let on_a_grid = |dir: &Path| train(dir, &grid, "--decisions 1100 --seed 5");
    let on_a_road = |dir: &Path| train(dir, &acc, short);
    let distinct = "--plant kinematic --decisions 500 --seed 3 --distinct 2";
    let population = |dir: &Path| train(dir, &acc, distinct);
    let from = format!("{short} --ego longer~gap --from {}", nominal.display());
    let fine_tuned = |dir: &Path| {
        if dir.join("run/manifest.json").exists() {
            train(dir, &acc, short)
        } else {
            train(dir, &acc, &from)
        }
    };
    let kept = |dir: &Path| {
        let (run, keep) = (nominal.display(), dir.join("kept"));
        let keep = keep.display();
        words(&format!(
            "eval {run} --starts 10 --keep {keep},most=4 --jobs 1"
        ))
    };
    let campaign = scratch.path().join("campaign.ron");
    fs::write(&campaign, CAMPAIGN.replace("ACC", &acc)).expect("written");
    let planned = |dir: &Path| {
        let (file, plan) = (campaign.display(), dir.join("plan"));
        let plan = plan.display();
        words(&format!("campaign plan {file} -o {plan} --piece-s 0.001"))
    };
    let made = scratch.path().join("made");
    assert!(run(&planned(&made)));
    let plan = made.join("plan");
    let pieces = |dir: &Path| {
        copied(&plan, &dir.join("plan"));
        words(&format!(
            "campaign run {} --jobs 1 {FREQUENT}",
            dir.join("plan").display()
        ))
    };
    let whole = scratch.path().join("whole");
    assert!(run(&pieces(&whole)));
    let merged = |dir: &Path| {
        copied(&whole.join("plan"), &dir.join("plan"));
        words(&format!("campaign merge {}", dir.join("plan").display()))
    };
    let cases: [(&str, CommandBuilder<'_>); 8] = [
        ("train, grid", &on_a_grid),
        ("train, acc", &on_a_road),
        ("train --from", &fine_tuned),
        ("train --distinct", &population),
        ("eval --keep", &kept),
        ("campaign plan", &planned),
        ("campaign run", &pieces),
        ("campaign merge", &merged),
    ];
    let points = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        let points = &points;
        for (name, command) in cases {
            scope
                // Each case has directories of its own, so cases can run side by side.
                .spawn(move || {
                    points.fetch_add(KilledVerb { name, command }.holds(), Ordering::Relaxed)
                });
        }
    });
    println!("{} steps failed", points.into_inner());
}
