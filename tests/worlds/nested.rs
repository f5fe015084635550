//! Runs within runs: how far they may go.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use brakecheck::world::{Problem, Scenario};
use brakecheck_world::world::RunsOnDisk;

use super::trained::{PLACED, fake, quick_acc, trained};

/// A world whose blocker is the ado of `run`.
fn among(run: &str, names: &str) -> String {
    let from = "run: \"acc\", names: {\"ego\": \"car\"}";
    assert!(PLACED.contains(from));
    PLACED.replacen(from, &format!("run: {run}, names: {names}"), 1)
}

fn first_problem(dir: &Path, text: &str) -> Problem {
    let file = dir.join("placed.ron").display().to_string();
    let mut error = Scenario::parse_with(&file, text, &RunsOnDisk).expect_err("refused");
    error.problems.remove(0)
}

#[test]
fn a_run_within_itself_is_refused_with_the_chain() {
    let dir = tempfile::tempdir().expect("a directory");
    let at = |name: &str| format!("{:?}", dir.path().join(name).display().to_string());
    fake(&dir.path().join("itself"), &among(&at("itself"), "{}"), b"");
    fake(&dir.path().join("egg"), &among(&at("hen"), "{}"), b"");
    fake(&dir.path().join("hen"), &among(&at("egg"), "{}"), b"");
    fake(&dir.path().join("farm"), &among(&at("./egg"), "{}"), b"");
    // The text that a run directory or a kept counterexample would hold.
    let kept = format!(
        "Kept(from: \"hen\", world: r##\"{}\"##, policy: \"\")",
        among(&at("egg"), "{}")
    );
    let cases = [
        (
            at("itself"),
            "the run `itself` is within itself: itself → itself",
        ),
        (at("egg"), "the run `egg` is within itself: egg → hen → egg"),
        (
            at("farm"),
            "the run `egg` is within itself: farm → ./egg → hen → egg",
        ),
        (
            kept,
            "the run `egg` is within itself: hen → egg → hen → egg",
        ),
    ];
    for (run, expect) in cases {
        let text = among(&run, "{}");
        let problem = first_problem(dir.path(), &text);
        let what = problem
            .what
            .replace(&format!("{}/", dir.path().display()), "");
        assert_eq!(what, expect);
        assert_eq!(text[problem.span.clone()], run);
        assert_eq!(problem.label, "this run");
        let help = problem.help.expect("a cure");
        assert!(help.contains("without the others"), "{help}");
    }
    // A run that is a world of its own accord: `brakecheck check RUN/world.ron`.
    let own = dir.path().join("itself/world.ron");
    let error = Scenario::load(&own).expect_err("refused").to_string();
    assert!(error.contains("is within itself"), "{error}");
}

/// `depth` worlds within each other, the innermost one that of `acc`.
fn chain(depth: usize, policy: &str) -> String {
    let mut run = format!(
        "Kept(from: \"1\", world: r#\"{}\"#, policy: \"{policy}\")",
        quick_acc().text()
    );
    for level in 2..=depth {
        let names = match level {
            2 => "{\"ego\": \"car\"}",
            _ => "{\"blocker\": \"other\"}",
        };
        let hashes = "#".repeat(level);
        let world = among(&run, names).replacen(
            "observe: [\"car.speed\"]",
            "observe: [\"car.speed\", \"car.accel\", \"other.speed\", \"other.accel\", \"time_left\"]",
            1,
        );
        run = format!(
            "Kept(from: \"{level}\", world: r{hashes}\"{world}\"{hashes}, policy: \"{policy}\")"
        );
    }
    among(&run, "{\"blocker\": \"other\"}")
}

#[test]
fn texts_within_texts_end_at_a_limit() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = trained(dir.path());
    let policy = std::fs::read(run.path().join("policy.safetensors")).expect("a policy");
    let policy = STANDARD.encode(policy);
    let deepest = Scenario::parse("deepest.ron", &chain(16, &policy));
    assert!(
        deepest.is_ok(),
        "{:.400}",
        deepest.expect_err("refused").to_string()
    );
    for depth in [500, 17] {
        let policy = if depth == 17 { &policy } else { "" };
        let problem = first_problem(dir.path(), &chain(depth, policy));
        let begins = format!("{depth} → {} → {} → …", depth - 1, depth - 2);
        assert_eq!(
            problem.what,
            format!("more than 16 runs within each other: {begins}")
        );
        assert!(problem.help.is_some());
    }
}
