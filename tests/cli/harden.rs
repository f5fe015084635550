//! Hardening: what is refused, what is found, and what is written.

use std::path::Path;

use super::answers::answers;
use super::{brakecheck, code, json, path, refused, scratch, stderr};

const TRAFFIC: &str = "examples/traffic/acc.ron";

/// A follower whose gap decides, and whose label does nothing.
const PROGRAM: &str = r#"
import json, sys
gap_s = 0.0
for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        names = [("gap_s", 0.2, 2.6, 0.2), ("label", 0.0, 9.0, 1.0)]
        declared = [dict(zip(("name", "lo", "hi", "default"), one)) for one in names]
        answer = {"hello": {"protocol": 1, "name": "tunable", "parameters": declared}}
    elif "reset" in message:
        gap_s = message["reset"]["parameters"]["gap_s"]
        answer = {"id": message["id"], "ready": True}
    elif "step" in message:
        own, others = message["step"]["own"], message["step"]["others"]
        accel = 0.0
        for lead in others[:1]:
            wish = 5.7 + gap_s * own["speed_mps"]
            closing = own["speed_mps"] - lead["speed_mps"]
            accel = 0.6 * (lead["headway_m"] - wish) - 1.2 * closing
        answer = {"id": message["id"], "accel_mps2": max(-6.0, min(2.5, accel))}
    else:
        break
    print(json.dumps(answer), flush=True)
"#;

/// Few starts and decisions in a short world, whose ego is at risk within seconds.
fn short_world(dir: &tempfile::TempDir) -> String {
    let world = path(dir, "short.ron");
    let text = std::fs::read_to_string(super::root().join("worlds/acc.ron")).expect("a world");
    let text = text
        .replace("name: \"acc\"", "name: \"short\"")
        .replace("horizon_s: 15.0", "horizon_s: 8.0")
        .replace(
            "x_m: 0.0, speed_mps: (5.0, 25.0)",
            "x_m: 0.0, speed_mps: (14.0, 18.0)",
        )
        .replace(
            "headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)",
            "headway_m: (16.0, 40.0), speed_mps: (14.0, 18.0)",
        );
    std::fs::write(&world, text).expect("written");
    world
}

fn hardened<'a>(world: &'a str, out: &'a str, more: &[&'a str]) -> std::process::Output {
    let mut args = vec!["harden", world, "-o", out, "--plant", "kinematic"];
    args.extend([
        "--traffic",
        TRAFFIC,
        "--decisions",
        "6000",
        "--starts",
        "60",
    ]);
    args.extend([
        "--search-starts",
        "30",
        "--natural-runs",
        "40",
        "--rounds",
        "1",
    ]);
    args.extend(more);
    brakecheck(&args)
}

#[test]
fn questions_without_a_possible_answer_are_refused() {
    let dir = scratch();
    let out = path(&dir, "out");
    let asked = |more: &[&str], says: &str| {
        refused(&[&["harden", "acc", "-o", &out], more].concat(), says);
        assert!(!Path::new(&out).exists(), "{says}");
    };
    asked(&["--over", "ego.gap=0..1"], "no parameter `gap`");
    asked(&["--over", "ego.time_gap_s=1..2"], "is 0.5, outside 1..2");
    asked(&["--keep-below", "braking"], "is no limit on a measure");
    asked(&["--keep-below", "ego.sped=3"], "ego.sped");
    asked(&["--ego", "all"], "is more than one ego");
    asked(&["--reduction", "1.5"], "a share above 0");
    asked(
        &["--", "python3", "examples/ego.py"],
        "no parameter that may change",
    );
    refused(&["harden", "grid", "-o", &out], "is a grid");
    std::fs::create_dir(&out).expect("made");
    std::fs::write(Path::new(&out).join("mine"), "x").expect("written");
    refused(&["harden", "acc", "-o", &out], "has content");
}

#[test]
fn a_stock_ego_is_hardened_by_a_file_that_other_verbs_take() {
    let dir = scratch();
    let (world, out) = (short_world(&dir), path(&dir, "out"));
    // A search, because a short training finds too little in this world.
    let over = [
        "--over",
        "ego.time_gap_s=0.4..1.6",
        "--search",
        "1",
        "--json",
    ];
    let loose = [
        "--keep-below",
        "braking=200%",
        "--keep-below",
        "travel-time=150%",
    ];
    let output = hardened(&world, &out, &[&over[..], &loose].concat());
    let found = json(&output);
    assert_eq!(code(&output), 0, "{found}, {}", stderr(&output));
    let best = &found["candidates"][0];
    assert_eq!(best["verdict"], "confirmed", "{found}");
    let gap_s = best["values"]["time_gap_s"].as_f64().expect("a value");
    assert!(gap_s > 0.5 && gap_s < 1.2, "not the largest: {gap_s}");
    let confirmation = &best["confirmation"];
    assert!(confirmation["reduction"].as_f64() >= Some(0.9), "{best}");
    let least = confirmation["reduction_at_least"].as_f64();
    assert!(least < confirmation["reduction"].as_f64(), "{best}");
    // The ado of the confirmation is another one than that of the search.
    assert_eq!(confirmation["new_ado"]["ado"], "ado-1");
    let file = best["file"].as_str().expect("a file");
    let text = std::fs::read_to_string(file).expect("written");
    assert!(text.contains("Change(ego: (time_gap_s: "), "{text}");
    let run = format!("{out}/ado-1");
    let shares = ["nominal", file].map(|ego| {
        let asked = ["search", &world, "--ego", ego, "--starts", "60", "--json"];
        let rows = json(&brakecheck(
            &[&asked[..], &["--plant", "kinematic"]].concat(),
        ));
        rows["rows"][0]["success_rate"].as_f64().expect("a rate")
    });
    assert!(shares[1] < 0.2 * shares[0], "{shares:?}");
    let gate = found["gate"].as_str().expect("a command");
    assert!(
        gate.starts_with(&format!("brakecheck gate {run} --baseline-ego {file}")),
        "{gate}"
    );
    let asked = ["gate", &run, "--baseline-ego", file, "--starts", "60"];
    let gated = brakecheck(&[&asked[..], &["--json"]].concat());
    let answer = &json(&gated)["gates"][0];
    assert_eq!(answer["baseline"], file, "{}", stderr(&gated));
}

#[test]
fn a_change_beyond_the_limits_is_no_result_and_exits_with_1() {
    let dir = scratch();
    let (world, out) = (short_world(&dir), path(&dir, "out"));
    let never = [
        "--keep-below",
        "ego.speed=1",
        "--over",
        "ego.time_gap_s=0.4..1.6:3",
        "--search",
        "1",
    ];
    let output = hardened(&world, &out, &never);
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    answers(&output, &["harden"], "no change is confirmed: ");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(!text.contains("keep it:"), "{text}");
}

#[test]
fn a_program_is_hardened_by_the_parameters_that_it_declares() {
    let dir = scratch();
    let (world, out) = (short_world(&dir), path(&dir, "out"));
    let file = path(&dir, "tunable.py");
    std::fs::write(&file, PROGRAM).expect("written");
    let program = ["--", "python3", &file];
    let check = brakecheck(&[&["check"], &program[..]].concat());
    let said = String::from_utf8_lossy(&check.stdout);
    assert_eq!(code(&check), 0, "{said}");
    let remark = "no other command behind a braking car with:";
    assert!(said.contains(remark) && said.contains(" label "), "{said}");
    let options = ["--over", "ego.gap_s=0.2..2.6:4", "--json"];
    let loose = [
        "--keep-below",
        "braking=300%",
        "--keep-below",
        "travel-time=150%",
    ];
    let asked = [&options[..], &loose, &program].concat();
    let output = hardened(&world, &out, &asked);
    let found = json(&output);
    assert_eq!(code(&output), 0, "{found}, {}", stderr(&output));
    assert_eq!(found["ego"], "tunable");
    let best = &found["candidates"][0];
    let gap_s = best["values"]["gap_s"].as_f64().expect("a value");
    let text = std::fs::read_to_string(best["file"].as_str().expect("a file")).expect("written");
    assert!(text.contains(&format!("\"gap_s\":{gap_s:?}")), "{text}");
    let gate = found["gate"].as_str().expect("a command");
    assert!(
        gate.ends_with(&format!("--allow-programs -- python3 {file}")),
        "{gate}"
    );
}
