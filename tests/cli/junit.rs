//! JUnit XML as a CI server reads it: the cases stay, and no open question passes.

use std::collections::{BTreeMap, BTreeSet};

use quick_junit::{NonSuccessKind, Report, TestCaseStatus};

use super::replayed::keep;
use super::{brakecheck, code, json, path, refused, root, scratch, small_run, stderr};

/// The cases of a file by name, each with its outcome and reason.
#[track_caller]
pub(super) fn cases(file: &str) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(file).expect("JUnit");
    let report = Report::deserialize_from_str(&text).expect("well-formed");
    let all = report.test_suites.iter().flat_map(|it| &it.test_cases);
    let mut found = BTreeMap::new();
    for case in all {
        let reason = |message: &Option<quick_junit::XmlString>| {
            let message = message.as_ref().expect("a reason");
            message.as_str().to_owned()
        };
        let outcome = match &case.status {
            TestCaseStatus::Success { .. } => "passed".to_owned(),
            TestCaseStatus::NonSuccess { kind, message, .. } => match kind {
                NonSuccessKind::Failure => format!("failed: {}", reason(message)),
                NonSuccessKind::Error => format!("error: {}", reason(message)),
            },
            TestCaseStatus::Skipped { message, .. } => format!("skipped: {}", reason(message)),
        };
        let before = found.insert(case.name.as_str().to_owned(), outcome);
        assert_eq!(before, None, "{} is there twice", case.name.as_str());
    }
    assert_eq!(report.tests, found.len());
    found
}

fn of<'a>(cases: &'a BTreeMap<String, String>, outcome: &str) -> Vec<&'a String> {
    let with = cases.iter().filter(|(_, it)| it.starts_with(outcome));
    with.map(|(name, _)| name).collect()
}

/// A crash is red for one ego and green for a better one, under the same name.
#[test]
fn a_fixed_crash_turns_green_and_does_not_vanish() {
    let names = ["acc-nominal-0001", "acc-nominal-0002"];
    let (dir, kept, _) = keep(&names);
    let xml = path(&dir, "replay.xml");
    let replay = |more: &[&str]| {
        let output = brakecheck(&[&["replay", &kept, "--junit", &xml], more].concat());
        (code(&output), cases(&xml))
    };
    let (exit, red) = replay(&[]);
    assert_eq!((exit, of(&red, "failed").len()), (1, 2), "{red:?}");
    assert_eq!(red.keys().collect::<Vec<_>>(), names);
    let gentle = path(&dir, "gentle.ron");
    let change = "Change(ego: (time_gap_s: 3.0, standstill_headway_m: 12.0))";
    std::fs::write(&gentle, change).expect("written");
    let (exit, green) = replay(&["--ego", &gentle]);
    assert_eq!((exit, of(&green, "passed").len()), (0, 2), "{green:?}");
    assert!(red.keys().eq(green.keys()));
    // A record that is repeated is what was asked for, although the ego fails.
    let (exit, recorded) = replay(&["--expect", "recorded"]);
    assert_eq!(
        (exit, of(&recorded, "passed").len()),
        (0, 2),
        "{recorded:?}"
    );
    // A program that never runs leaves errors, also for crashes that were not replayed.
    let output = brakecheck(&["replay", &kept, "--junit", &xml, "--", "./nothing-here"]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let broken = cases(&xml);
    assert_eq!(of(&broken, "error").len(), 2, "{broken:?}");
    assert!(red.keys().eq(broken.keys()));
    // The page of the directory has the same cases.
    let html = path(&dir, "page.html");
    let output = brakecheck(&["report", &kept, "-o", &html, "--ego", &gentle]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(cases(&path(&dir, "page.junit.xml")), green);
    let page = std::fs::read_to_string(&html).expect("a page");
    assert!(page.contains("0 of 2 still fail, 2 fixed"));
    assert_eq!(page.matches("<figure class=\"film\"").count(), 2);
}

#[test]
fn a_search_has_a_case_per_start_named_as_the_file_of_its_crash() {
    let dir = scratch();
    let [xml, kept] = ["search.xml", "kept"].map(|name| path(&dir, name));
    let search = |ego: &str| {
        let plain = ["search", "acc", "--plant", "kinematic", "--starts", "12"];
        let more = ["--ego", ego, "--junit", &xml, "--keep", &kept];
        let output = brakecheck(&[&plain[..], &more].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        cases(&xml)
    };
    let found = search("nominal");
    assert_eq!(found.len(), 12);
    let failed = of(&found, "failed");
    let files = std::fs::read_dir(&kept).expect("kept").flatten();
    let stems = files
        .map(|file| file.path())
        .filter(|file| file.extension().is_some_and(|it| it == "ron"));
    let stems: Vec<String> = stems
        .map(|file| {
            file.file_stem()
                .expect("a name")
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    assert!(!stems.is_empty());
    assert!(
        stems.iter().all(|stem| failed.contains(&stem)),
        "{stems:?} {failed:?}"
    );
}

/// A space and a hyphen are the same character of a file name.
#[test]
fn egos_whose_files_would_have_one_name_keep_cases_and_files_of_their_own() {
    let dir = scratch();
    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
    let rest = text.find("reuse: {").expect("reuse");
    let egos = r#"reuse: {
        "weak brakes": Change(ego: (max_brake_mps2: 4.0)),
        "weak-brakes": Change(ego: (max_brake_mps2: 3.0)),
    })"#;
    let [world, xml, kept] = ["acc.ron", "search.xml", "kept"].map(|name| path(&dir, name));
    std::fs::write(&world, format!("{}{egos}\n", &text[..rest])).expect("written");
    let plain = ["search", &world, "--plant", "kinematic", "--starts", "12"];
    let more = ["--ego", "all", "--junit", &xml, "--keep", &kept];
    let output = brakecheck(&[&plain[..], &more].concat());
    let said = stderr(&output);
    assert_eq!(code(&output), 0, "{said}");
    let names: Vec<String> = cases(&xml).into_keys().collect();
    assert_eq!(names.len(), 36, "{names:?}");
    for ego in ["weak brakes", "weak-brakes"] {
        let ending = format!(" of {ego}");
        let of_ego = names.iter().filter(|name| name.ends_with(&ending));
        assert_eq!(of_ego.count(), 12, "{names:?}");
        assert!(
            said.contains(&format!("counterexamples of `{ego}`")),
            "{said}"
        );
    }
    // Both have kept the same starts, and neither counts a file of the other.
    assert!(!said.contains("from earlier commands"), "{said}");
    let files = std::fs::read_dir(&kept).expect("kept").flatten();
    let second = files.filter(|file| file.file_name().to_string_lossy().ends_with("-2.ron"));
    assert!(second.count() > 0, "no start is kept of both");
}

#[test]
fn a_gate_has_a_case_of_its_own_and_one_per_start() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let [xml, file, harder] = ["gate.xml", "gate.json", "harder.ron"].map(|name| path(&dir, name));
    std::fs::write(&harder, "Change(ego: (max_brake_mps2: 7.2))").expect("written");
    let gate = |ego: &str, before: &str| {
        let asked = ["gate", &run, "--starts", "120", "--ego", ego, "--on", "any"];
        let more = ["--baseline-ego", before, "--junit", &xml, "--json"];
        let output = brakecheck(&[&asked[..], &more].concat());
        std::fs::write(&file, &output.stdout).expect("written");
        (
            code(&output),
            json(&output)["gates"][0].clone(),
            cases(&xml),
        )
    };
    let (exit, worse, closed) = gate("nominal", &harder);
    let newly = worse["newly_failing"].as_array().expect("a list").len();
    assert_eq!(exit, 1, "{worse}");
    // The gate itself is one more.
    assert_eq!(
        (closed.len(), of(&closed, "failed").len()),
        (121, newly + 1),
        "{closed:?}"
    );
    assert!(closed["gate"].starts_with("failed: gate closed by"));
    let foul = worse["outcomes"].as_array().expect("a list").iter();
    let fouls = foul.filter(|it| *it == "foul").count();
    let open = closed
        .values()
        .filter(|it| it.starts_with("skipped: no answer"));
    assert_eq!(open.count(), fouls);

    // The page and its JUnit file are made of the JSON alone.
    let output = brakecheck(&["report", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(cases(&path(&dir, "gate.junit.xml")), closed);
    let page = std::fs::read_to_string(path(&dir, "gate.html")).expect("a page");
    assert!(page.contains("gate closed by") && page.contains("newly failing"));
    let text = std::fs::read_to_string(&file).expect("JSON");
    for (from, to, says) in [
        (
            "\"newly_failing\":[{",
            "\"newly_failing\":[],\"x\":[{",
            "does not count",
        ),
        ("\"gates\":[{", "\"gates\":[],\"x\":[{", "it has no gate"),
        (
            "\"now\":\"fails\"",
            "\"now\":\"wins\"",
            "unknown outcome `wins`",
        ),
    ] {
        let other = path(&dir, "other.json");
        assert!(text.contains(from), "{from}");
        std::fs::write(&other, text.replace(from, to)).expect("written");
        refused(&["report", &other], says);
    }
    refused(&["report", &file, "--scenarios"], "are for runs");
    refused(&["report", &file, "--ego", "nominal"], "takes no `--ego`");
}

#[test]
fn a_risk_without_a_result_is_an_error_in_its_file_and_on_its_page() {
    let dir = scratch();
    let [xml, file] = ["risk.xml", "risk.json"].map(|name| path(&dir, name));
    let plain = [
        "risk",
        "acc",
        "--traffic",
        "examples/traffic/acc.ron",
        "--plant",
        "kinematic",
    ];
    let few = [
        "--budget",
        "1000",
        "--natural-runs",
        "600",
        "--junit",
        &xml,
        "--json",
    ];
    let baseline = ["--baseline-ego", "wet road", "--at-most", "1.5"];
    let output = brakecheck(&[&plain[..], &few, &baseline].concat());
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let found = cases(&xml);
    let names = ["estimate of nominal", "estimate of wet road"];
    assert!(
        names.iter().all(|name| found.contains_key(*name)),
        "{found:?}"
    );
    assert_eq!(found.len(), 3);
    assert!(of(&found, "passed").len() < 2, "{found:?}");
    assert!(found["ratio of nominal to wet road at most 1.5"].starts_with("error"));
    std::fs::write(&file, &output.stdout).expect("written");
    let output = brakecheck(&["report", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    // The JSON has the limit, so no case is missing.
    assert_eq!(cases(&path(&dir, "risk.junit.xml")), found);
    let page = std::fs::read_to_string(path(&dir, "risk.html")).expect("a page");
    assert!(page.contains("fails in at most") && page.contains("Risk of nominal"));
    std::fs::write(&file, "{\"egos\": 3}").expect("written");
    refused(&["report", &file], "is no result of `gate` or `risk`");
}

/// The page of a run with another ego is about that ego alone.
#[test]
fn a_run_is_reported_with_an_ego_of_the_users() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let program = path(&dir, "coast.py");
    let text = r#"
import json, sys
for message in map(json.loads, sys.stdin):
    if "close" in message: break
    answer = {"id": message.get("id"), "ready": True}
    if "hello" in message: answer = {"hello": {"protocol": 1, "name": "coast"}}
    elif "step" in message: answer = {"id": message["id"], "accel_mps2": 0.0}
    print(json.dumps(answer), flush=True)
"#;
    std::fs::write(&program, text).expect("written");
    let html = path(&dir, "mine.html");
    let asked = [
        "report",
        &run,
        "-o",
        &html,
        "--starts",
        "20",
        "--reuse-starts",
        "4",
    ];
    let output = brakecheck(&[&asked[..], &["--", "python3", &program]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let page = std::fs::read_to_string(&html).expect("a page");
    assert!(page.contains("ego coast"));
    let found = cases(&path(&dir, "mine.junit.xml"));
    assert_eq!(found.len(), 20, "{found:?}");
    assert!(found.keys().all(|name| name.contains("coast")), "{found:?}");
    assert!(!of(&found, "failed").is_empty(), "{found:?}");
}

#[test]
fn rows_of_two_seeds_have_cases_of_their_own() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let rows = ["0", "1"].map(|seed| {
        let asked = ["eval", &run, "--starts", "6", "--seed", seed, "--json"];
        let output = brakecheck(&asked);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let file = path(&dir, &format!("rows{seed}.json"));
        std::fs::write(&file, &output.stdout).expect("written");
        file
    });
    let html = path(&dir, "page.html");
    let given = ["--rows", &rows[0], "--rows", &rows[1]];
    let asked = ["report", &run, "-o", &html, "--starts", "6"];
    let output = brakecheck(&[&asked[..], &given].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = std::fs::read_to_string(path(&dir, "page.junit.xml")).expect("JUnit");
    let report = Report::deserialize_from_str(&text).expect("well-formed");
    let cases = report.test_suites.iter().flat_map(|it| &it.test_cases);
    let names: BTreeSet<(String, String)> = cases
        .map(|case| {
            let class = case.classname.as_ref().expect("a class");
            (class.as_str().to_owned(), case.name.as_str().to_owned())
        })
        .collect();
    assert!(report.tests >= 12, "{text}");
    assert_eq!(names.len(), report.tests, "{text}");
}
