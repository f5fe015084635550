//! Standard input in the place of a file, and shipped worlds as files.

use super::program::{code, json, run_piped, scratch, stderr};
use super::{brakecheck_in, refusal, refused, root};

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).expect(file)
}

#[test]
fn a_world_is_checked_and_searched_from_standard_input() {
    let world = text("worlds/acc.ron");
    let output = run_piped(root(), &["check", "-", "--json"], &world);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["world"], "acc");
    let broken = world.replace("ado.speed <= v_lim", "ado.speed <= v_limit");
    let output = run_piped(root(), &["check", "-"], &broken);
    refusal(&output, "standard input:36:92");
    let search = "search - --plant kinematic --method hold --starts 2 --budget 1 --json";
    let output = run_piped(root(), &search.split(' ').collect::<Vec<_>>(), &world);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["rows"][0]["world"], "acc");
    let output = run_piped(root(), &["check", "-"], "");
    refusal(&output, "standard input");
}

#[test]
fn a_kept_counterexample_is_replayed_from_standard_input() {
    let kept = text("tests/regressions/acc-nominal-0001.ron");
    let output = run_piped(
        root(),
        &["replay", "-", "--expect", "recorded", "--json"],
        &kept,
    );
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let file = "tests/regressions/acc-nominal-0001.ron";
    refused(&["view", file, "3", "-o", "3.svg"], "no episode 3");
    let dir = scratch();
    let output = run_piped(dir.path(), &["view", "-", "-o", "crash.svg"], &kept);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(dir.path().join("crash.svg").is_file());
    let output = run_piped(dir.path(), &["replay", "-", "3"], &kept);
    refusal(&output, "has one counterexample, and no `3`");
    let output = run_piped(dir.path(), &["view", "-", "3", "-o", "3.svg"], &kept);
    refusal(&output, "has one counterexample, and no `3`");
    let output = run_piped(dir.path(), &["replay", "-"], "no kept file");
    refusal(&output, "standard-input.ron");
}

#[test]
fn recordings_and_scenarios_come_from_standard_input() {
    let dir = scratch();
    let mut rows = "time,id,x,y,heading,speed,length,width\n".to_owned();
    for i in 0..100 {
        let t = 0.1 * f64::from(i);
        for (id, x) in [("1", 0.0), ("2", 30.0)] {
            rows += &format!("{t:.1},{id},{:.2},0,0,20,4.5,1.8\n", x + 20.0 * t);
        }
    }
    let output = run_piped(dir.path(), &["log", "-", "--json"], &rows);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(
        json(&output)["recordings"].as_array().map(Vec::len),
        Some(1)
    );
    // The model has the hash of each recording, which takes a second reading.
    let output = run_piped(dir.path(), &["log", "-", "--fit", "model.ron"], &rows);
    refusal(&output, "reads a recording twice");
    let output = run_piped(dir.path(), &["log", "-", "-"], &rows);
    refusal(&output, "was read already");
    let imports = root().join("tests/worlds/imports");
    let scene = text("tests/worlds/imports/base.xosc").replace("<!--global-->", "");
    let road = dir.path().join("straight.xodr");
    std::fs::copy(imports.join("straight.xodr"), road).expect("copied");
    let output = run_piped(dir.path(), &["new", "mine", "--from", "-"], &scene);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(dir.path().join("mine.ron").is_file());
}

#[test]
fn shipped_worlds_are_listed_printed_and_copied_with_their_roads() {
    let dir = scratch();
    let run = |args: &[&str]| brakecheck_in(dir.path(), args);
    let output = run(&["worlds"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let list = String::from_utf8_lossy(&output.stdout).into_owned();
    for line in list.lines() {
        assert!(line.chars().count() <= 100, "{line}");
    }
    let worlds = json(&run(&["worlds", "--json"]))["worlds"].clone();
    let worlds = worlds.as_array().expect("worlds");
    assert_eq!(worlds.len(), list.lines().count());
    for (name, kind) in [("acc", "road"), ("grid", "grid"), ("ncap/cpna", "points")] {
        let world = worlds.iter().find(|it| it["name"] == name).expect(name);
        assert_eq!(world["kind"], kind, "{name}");
        assert!(
            world["question"]
                .as_str()
                .expect("a question")
                .ends_with('?')
        );
    }
    let printed = run(&["worlds", "acc"]);
    assert_eq!(
        String::from_utf8_lossy(&printed.stdout),
        text("worlds/acc.ron")
    );
    let copied = run(&["worlds", "junction", "-o", "mine.ron"]);
    assert_eq!(code(&copied), 0, "{}", stderr(&copied));
    for (file, source) in [
        ("mine.ron", "worlds/junction.ron"),
        ("junction.xodr", "worlds/junction.xodr"),
    ] {
        let copy = std::fs::read_to_string(dir.path().join(file)).expect(file);
        assert_eq!(copy, text(source), "{file}");
    }
    assert_eq!(code(&run(&["check", "mine.ron"])), 0);
    refusal(
        &run(&["worlds", "acc", "-o", "mine.ron"]),
        "is there already",
    );
    refusal(&run(&["worlds", "jnction"]), "did you mean `junction`?");
}
