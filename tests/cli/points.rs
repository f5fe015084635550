//! Imported scenes: which points a user's program passes, and what becomes of
//! those it fails.

use serde_json::Value;

use super::{brakecheck, code, json, path, refused, root, scratch, stderr};

/// Brakes for whoever is near, with 3 m/s² at most: too little when it is fast.
const WEAK: &str = r#"
import json, sys
for line in sys.stdin:
    message = json.loads(line)
    if "hello" in message:
        answer = {"hello": {"protocol": 1, "name": "weak"}}
    elif "reset" in message:
        answer = {"id": message["id"], "ready": True}
    elif "step" in message:
        ahead = [o for o in message["step"]["others"] if 0.0 < o["headway_m"] < 15.0]
        answer = {"id": message["id"], "accel_mps2": -3.0 if ahead else 0.0}
    else:
        break
    print(json.dumps(answer), flush=True)
"#;

/// Euro NCAP's car-to-car rear stationary as a world: 25 points, whose own ego
/// only coasts.
fn imported(dir: &tempfile::TempDir) -> String {
    let protocol = "tests/data/openx/osc-ncap/OpenSCENARIO/NCAP/CA-FC_2026";
    let world = path(dir, "ccrs.ron");
    let (from, points) = (
        format!("{protocol}/CCRs.xosc"),
        format!("{protocol}/Variations/StandardRange/CCRs.xosc"),
    );
    let made = brakecheck(&["new", &world, "--from", &from, "--points", &points]);
    assert_eq!(code(&made), 0, "{}", stderr(&made));
    let said = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(said.contains("brakecheck eval"), "{said}");
    world
}

fn with_program<'a>(args: &[&'a str], program: &'a str) -> Vec<&'a str> {
    [args, &["--", "python3", program]].concat()
}

fn number(value: &Value) -> u64 {
    value.as_u64().expect("a number")
}

#[test]
fn an_imported_scene_tests_the_program_at_every_point() {
    let dir = scratch();
    let world = imported(&dir);
    let follower = root().join("examples/ego.py").display().to_string();
    let eval = brakecheck(&with_program(&["eval", &world, "--json"], &follower));
    assert_eq!(code(&eval), 0, "{}", stderr(&eval));
    let table = &json(&eval)["points"][0];
    let points = table["points"].as_array().expect("points");
    assert_eq!(points.len(), 25);
    // Its hello has this name.
    assert_eq!(table["ego"], "follower");
    let [passed, failed, invalid] = ["passed", "failed", "invalid"].map(|it| number(&table[it]));
    assert_eq!((passed + failed, invalid), (25, 0));
    // The world's own ego passes none: it is the program that was asked.
    assert!(passed > 0, "{table}");
    let coasting = brakecheck(&["eval", &world, "--json"]);
    assert_eq!(json(&coasting)["points"][0]["passed"], 0);
    // A program that draws without its seed has no result at any point.
    let text = WEAK
        .replace("import json, sys", "import json, random, sys")
        .replace("-3.0 if ahead else 0.0", "random.uniform(-3.0, 0.0)");
    let random = path(&dir, "random.py");
    std::fs::write(&random, text).expect("written");
    let eval = brakecheck(&with_program(&["eval", &world, "--json"], &random));
    assert_eq!(code(&eval), 3, "{}", stderr(&eval));
    let table = &json(&eval)["points"][0];
    let [passed, failed, invalid] = ["passed", "failed", "invalid"].map(|it| number(&table[it]));
    assert_eq!((passed + failed, invalid), (0, 25), "{table}");
    let eval = brakecheck(&with_program(&["eval", &world], &random));
    let said = String::from_utf8_lossy(&eval.stdout).into_owned();
    let why = "no result at any of 25 points: the ego depends on more than the episode (random)";
    assert!(
        said.contains(why) && said.contains("no result: random"),
        "{said}"
    );
    assert!(!said.contains("25 did not run"), "{said}");
}

#[test]
fn points_that_fail_are_kept_shown_replayed_exported_reported_and_gated() {
    let dir = scratch();
    let world = imported(&dir);
    // Its name reaches the page, but not as a browser or a terminal would obey it. A hello
    // with control characters has no name.
    let weak = path(&dir, "weak\u{202e}\u{9b}1m.py");
    let hostile = WEAK.replace("\"weak\"", "\"weak\\u009b1m\"");
    assert_ne!(hostile, WEAK);
    std::fs::write(&weak, hostile).expect("written");
    let kept = path(&dir, "kept");
    let asked = [
        "eval",
        &world,
        "--json",
        "--keep",
        &kept,
        "--fail-on-counterexample",
    ];
    let eval = brakecheck(&with_program(&asked, &weak));
    assert_eq!(code(&eval), 1, "{}", stderr(&eval));
    let table = json(&eval)["points"][0].clone();
    let [passed, failed] = ["passed", "failed"].map(|it| number(&table[it]));
    assert!(passed > 0 && failed > 0 && passed + failed == 25, "{table}");
    let files = std::fs::read_dir(&kept)
        .expect("kept")
        .filter_map(Result::ok)
        .map(|it| it.path())
        .filter(|it| it.extension().is_some_and(|it| it == "ron"));
    assert_eq!(files.count() as u64, failed);

    let recorded = brakecheck(&["replay", &kept, "--expect", "recorded"]);
    assert_eq!(code(&recorded), 0, "{}", stderr(&recorded));
    let live = brakecheck(&with_program(&["replay", &kept, "--json"], &weak));
    assert_eq!(code(&live), 1, "{}", stderr(&live));
    assert_eq!(json(&live)["in_all"]["still_fail"], failed);
    let picture = path(&dir, "crash.svg");
    let view = brakecheck(&["view", &kept, "-o", &picture]);
    assert_eq!(code(&view), 0, "{}", stderr(&view));
    let scenarios = path(&dir, "scenarios");
    let export = brakecheck(&["export", &kept, "-o", &scenarios]);
    assert_eq!(code(&export), 0, "{}", stderr(&export));

    let page = path(&dir, "page.html");
    let report = brakecheck(&with_program(&["report", &world, "-o", &page], &weak));
    assert_eq!(code(&report), 0, "{}", stderr(&report));
    let junit = std::fs::read_to_string(path(&dir, "page.junit.xml")).expect("JUnit");
    assert_eq!(junit.matches("<testcase").count(), 25);
    assert_eq!(junit.matches("<failure").count() as u64, failed);
    let shown = std::fs::read_to_string(&page).expect("the page");
    assert!(shown.contains("25 points") && shown.contains(r"weak\u{202e}\u{9b}1m.py"));
    for text in [&shown, &junit] {
        assert!(!text.contains(['\u{202e}', '\u{9b}']));
    }

    // A search leaves out what the program itself fails, and says how much.
    let search = brakecheck(&with_program(&["search", &world, "--json"], &weak));
    assert_eq!(code(&search), 0, "{}", stderr(&search));
    let row = &json(&search)["rows"][0];
    assert_eq!(
        (number(&row["starts"]), number(&row["trivial"])),
        (passed, failed)
    );
    assert_eq!(row["fails_alone"]["starts"], failed);
}

/// The world's own ego passes no point: it must not say which are left out.
#[test]
fn a_campaign_judges_every_point_by_the_ego_that_it_names() {
    let dir = scratch();
    let world = imported(&dir);
    let weak = path(&dir, "weak.py");
    std::fs::write(&weak, WEAK).expect("written");
    let ego = path(&dir, "weak.ron");
    let change = format!(
        "Change(controller: Some(Process(command: [\"python3\", \"{weak}\"], timeout_s: 60.0)))"
    );
    std::fs::write(&ego, change).expect("written");
    let campaign = path(&dir, "campaign.ron");
    let text = format!(
        "Campaign(name: \"points\", worlds: [(file: \"{world}\")], egos: [Ego(\"{ego}\")], \
         ados: [Neutral], starts: Drawn(count: 25, seed: 0))"
    );
    std::fs::write(&campaign, text).expect("written");
    let plan = path(&dir, "plan");
    let steps: [&[&str]; 3] = [
        &["plan", &campaign, "-o", &plan, "--piece-s", "10"],
        &["run", &plan],
        &["merge", &plan, "--json"],
    ];
    let mut outputs = steps.iter().map(|step| {
        let output = brakecheck(&[&["campaign"], *step, &["--allow-programs"]].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        output
    });
    let merged = json(&outputs.nth(2).expect("merged"));
    let row = &merged["summary"]["rows"][0];
    let eval = brakecheck(&with_program(&["eval", &world, "--json"], &weak));
    let table = &json(&eval)["points"][0];
    let [fails, trivial, starts] = ["successes", "trivial", "starts"].map(|it| number(&row[it]));
    assert_eq!((fails, trivial, starts), (number(&table["failed"]), 0, 25));
    assert!(fails > 0 && fails < 25, "{row}");
}

#[test]
fn a_world_where_something_kept_is_asked_for_is_refused_with_the_way_there() {
    let dir = scratch();
    let world = imported(&dir);
    let asked: [&[&str]; 4] = [
        &["view", &world],
        &["replay", &world],
        &["export", &world, "-o", "scenarios"],
        &["view", "acc"],
    ];
    for args in asked {
        let said = refused(args, "is a world");
        assert!(said.contains("--keep kept"), "{said}");
    }
    refused(
        &["report", "worlds/acc.ron"],
        "brakecheck train worlds/acc.ron",
    );
}

/// One program in an ordinary world: the nominal ego says what is left out, and
/// on how many starts the program itself fails stands beside it.
#[test]
fn both_counts_of_starts_that_fail_alone_are_printed() {
    let dir = scratch();
    let weak = path(&dir, "weak.py");
    std::fs::write(&weak, WEAK).expect("written");
    let asked = [
        "search",
        "acc",
        "--plant",
        "kinematic",
        "--starts",
        "12",
        "--switches",
        "0",
    ];
    let search = brakecheck(&with_program(&asked, &weak));
    assert_eq!(code(&search), 0, "{}", stderr(&search));
    let said = String::from_utf8_lossy(&search.stdout).into_owned();
    let mut lines = said.lines();
    let opening = lines.find(|it| it.contains("fails without an adversary"));
    let opening = opening.expect("both counts");
    assert!(opening.contains("`weak` itself: "), "{opening}");
}

#[test]
fn points_without_an_answer_are_neither_passed_nor_a_success() {
    let dir = scratch();
    let world = path(&dir, "far.ron");
    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
    let points = "points: (axes: [\"ego.speed\", \"ado.headway\", \"ado.speed\"], rows: [[10.0, \
                  40.0, 20.0], [10.0, 30.0, 20.0]]), agents: [";
    // The neutral ado keeps its 20 m/s and so breaks its rule after 3 s.
    let text = text
        .replacen("agents: [", points, 1)
        .replacen("plant: Rigid", "plant: Kinematic", 1)
        .replacen("ado.speed <= v_lim", "ado.x <= 100", 1);
    std::fs::write(&world, text).expect("written");
    let eval = brakecheck(&["eval", &world, "--json"]);
    assert_eq!(code(&eval), 3, "{}", stderr(&eval));
    let table = &json(&eval)["points"][0];
    let counts = ["passed", "failed", "no_answer", "invalid"].map(|it| number(&table[it]));
    assert_eq!(counts, [0, 0, 2, 0], "{table}");
    assert!(table["points"][0].get("varied").is_none(), "{table}");

    let page = path(&dir, "page.html");
    let report = brakecheck(&["report", &world, "-o", &page]);
    assert_eq!(code(&report), 3, "{}", stderr(&report));
    let junit = std::fs::read_to_string(path(&dir, "page.junit.xml")).expect("JUnit");
    let cases = ["<testcase", "<skipped"].map(|tag| junit.matches(tag).count());
    assert_eq!(cases, [2, 2], "{junit}");
    refused(&["report", &world, "--reuse-starts", "3"], "is a world");
}
