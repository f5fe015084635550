//! `export`: what is written, what is refused, and what is said of both.

use super::{brakecheck, code, json, scratch, stderr};

const CRASH: &str = "tests/regressions/acc-nominal-0001.ron";

#[test]
fn a_crash_is_three_files_which_are_named() {
    let dir = scratch();
    let out = dir.path().join("made/here");
    let args = ["export", CRASH, "-o", out.to_str().expect("a path")];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let listed = String::from_utf8(output.stdout).expect("text");
    let names = ["xodr", "xosc", "external.xosc"];
    let files = names.map(|ending| out.join(format!("acc-nominal-0001.{ending}")));
    let lines: Vec<String> = files.iter().map(|it| it.display().to_string()).collect();
    assert_eq!(listed.lines().collect::<Vec<_>>(), lines);
    assert!(files.iter().all(|file| file.is_file()));
    // What has the same name is replaced.
    std::fs::write(&files[0], "stale").expect("written");
    let told = json(&brakecheck(&[&args[..], &["--json"]].concat()));
    assert_eq!(told, serde_json::json!({ "files": lines, "refused": [] }));
    let road = std::fs::read_to_string(&files[0]).expect("a road");
    assert!(road.contains("<OpenDRIVE>"), "{road}");
}

#[test]
fn grids_are_refused_by_name_and_the_others_written() {
    let dir = scratch();
    let kept = dir.path().join("kept");
    std::fs::create_dir(&kept).expect("made");
    let grid = "grid-hard-nominal-cells-0-0000";
    for name in ["acc-nominal-0001", grid] {
        for ending in ["ron", "csv"] {
            let file = format!("{name}.{ending}");
            let from = super::root().join("tests/regressions").join(&file);
            std::fs::copy(from, kept.join(&file)).expect("copied");
        }
    }
    let out = dir.path().join("out");
    let args = ["export", kept.to_str().expect("a path"), "-o"];
    let output = brakecheck(&[&args[..], &[out.to_str().expect("a path"), "--json"]].concat());
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    let told = json(&output);
    assert_eq!(told["files"].as_array().map(Vec::len), Some(3));
    let refused = told["refused"][0]["file"].as_str().expect("a file");
    assert!(refused.ends_with(&format!("{grid}.ron")), "{refused}");
    let said = stderr(&output)
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(
        said.contains("`grid_hard`, and OpenSCENARIO has roads"),
        "{said}"
    );
}

#[test]
fn a_place_that_is_no_directory_is_refused_and_stays() {
    let dir = scratch();
    let file = dir.path().join("file");
    std::fs::write(&file, "precious").expect("written");
    let output = brakecheck(&["export", CRASH, "-o", file.to_str().expect("a path")]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert_eq!(std::fs::read_to_string(&file).expect("there"), "precious");
    let output = brakecheck(&["export", "nowhere", "-o", "somewhere"]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}
