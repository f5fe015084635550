//! Recorded traffic in `log`, `new --from-log` and `stl --log`.

use serde_json::Value;

use super::{brakecheck, code, json, refused, stderr, write};

/// Two cars on one lane, the second 30 m behind the first, which brakes.
pub(super) fn recording() -> String {
    let mut text = "time,id,x,y,heading,speed,length,width\n".to_owned();
    let (mut lead_m, mut own_m) = (134.0, 100.0);
    for i in 0..300 {
        let time_s = 0.05 * f64::from(i);
        // It loses 2 m/s in a second, and gains them again after another.
        let lead_mps = match i {
            100..120 => 28.0 - 0.1 * f64::from(i - 99),
            120..140 => 26.0,
            140..160 => 26.0 + 0.1 * f64::from(i - 139),
            _ => 28.0,
        };
        text += &format!("{time_s:.2},lead,{lead_m:.3},0,0,{lead_mps},4,1.8\n");
        text += &format!("{time_s:.2},own,{own_m:.3},0,0,28,4,1.8\n");
        lead_m += 0.05 * lead_mps;
        own_m += 0.05 * 28.0;
    }
    text
}

fn folder() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("tracks.csv");
    write(&file, recording().as_bytes());
    let file = file.display().to_string();
    (folder, file)
}

#[test]
fn a_recording_has_lanes_and_followings() {
    let (_folder, file) = folder();
    let output = brakecheck(&["log", &file, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output);
    let recording = &report["recordings"][0];
    assert_eq!(recording["map"], "generic");
    assert_eq!(recording["road_users"], 2);
    assert_eq!(recording["followings"], 1);
}

#[test]
fn a_recorded_following_becomes_a_world_that_can_be_searched() {
    let (folder, file) = folder();
    let worlds = folder.path().join("worlds").display().to_string();
    let args = [
        "new",
        "follow",
        "--from-log",
        &file,
        "--kind",
        "following",
        "-o",
        &worlds,
        "--json",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output);
    let world = report["worlds"][0]["file"].as_str().expect("a world");
    assert!(world.ends_with("follow.ron"), "{world}");
    let situation = &report["worlds"][0]["situations"][0];
    assert_eq!(
        (&situation["planned"], &situation["replaced"]),
        (&"lead".into(), &"own".into())
    );
    assert!(situation["worst_m"].as_f64().expect("a distance") < 0.1);
    let check = brakecheck(&["check", world]);
    assert_eq!(code(&check), 0, "{}", stderr(&check));
    assert!(!stderr(&check).contains('⚠'), "{}", stderr(&check));
    let search = brakecheck(&["search", world, "--starts", "1", "--json"]);
    assert_eq!(code(&search), 0, "{}", stderr(&search));
    assert_eq!(json(&search)["rows"][0]["starts"], 1);
    // A second run replaces nothing.
    refused(&args, "is there already");
}

#[test]
fn worlds_that_a_recording_does_not_have_are_refused() {
    let (folder, file) = folder();
    let worlds = folder.path().join("worlds").display().to_string();
    let from = |name: &str, kind: &str, says: &str| {
        let args = [
            "new",
            name,
            "--from-log",
            &file,
            "--kind",
            kind,
            "-o",
            &worlds,
        ];
        refused(&args, says);
    };
    from("cut", "cut-in", "no cut-in");
    from("cross", "crossing", "no crossing");
    from("a/b", "following", "cannot name a world");
    refused(&["new", "a", "--from-log", &file], "--kind");
    assert!(!folder.path().join("worlds").exists());
}

#[test]
fn rules_on_a_recording_are_those_of_a_count_by_hand() {
    let (folder, file) = folder();
    let [junit, report, pictures] = ["rules.xml", "rules.json", "pictures"]
        .map(|name| folder.path().join(name).display().to_string());
    let rules = folder.path().join("rules.ron");
    let text = "RuleFile(rules: [
        Rule(name: \"28 m\", stl: \"always (lead.present implies ego.lead.gap >= 28)\"),
        Rule(name: \"10 m\", stl: \"always (lead.present implies ego.lead.gap >= 10)\"),
    ])";
    write(&rules, text.as_bytes());
    let rules = rules.display().to_string();
    let to_json = format!("--json={report}");
    let args = [
        "stl",
        &rules,
        "--log",
        &file,
        &to_json,
        "--junit",
        &junit,
        "--picture",
        &pictures,
        "--fail-on-counterexample",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    // The table is still there, because the JSON went to a file.
    assert!(String::from_utf8_lossy(&output.stdout).contains("per 1,000 km"));
    let read = |file: &str| std::fs::read_to_string(file).expect(file);
    let report: Value = serde_json::from_str(&read(&report)).expect("JSON");
    let found = &report["recordings"][0]["rules"];
    // The gap falls from 30 m at 5 s to 26 m at 8 s, and stays: it is below 28 m from 6.5 s
    // on, in 170 of 300 samples.
    let broken = &found[0];
    assert_eq!(
        (&broken["episodes"], &broken["vehicles"]),
        (&1.into(), &1.into())
    );
    let share = broken["share"].as_f64().expect("a share");
    assert!((share - 170.0 / 600.0).abs() < 0.005, "{share}");
    let worst = &broken["worst"];
    // Presence is Boolean: as a number it would make ρ 0 here.
    let rho = worst["robustness"].as_f64().expect("ρ");
    assert!((rho + 2.0).abs() < 0.01, "{rho}");
    assert_eq!(
        (&worst["id"], &worst["lead"]),
        (&"own".into(), &"lead".into())
    );
    assert!((6.9..=15.0).contains(&worst["time_s"].as_f64().expect("a time")));
    assert_eq!(
        (&found[1]["episodes"], &found[1]["worst"]),
        (&0.into(), &Value::Null)
    );
    let junit = read(&junit);
    let counts = r#"tests="2" skipped="0" failures="1" errors="0""#;
    assert!(junit.contains(counts), "{junit}");
    let cases: Vec<&str> = junit.split("<testcase ").skip(1).collect();
    let is_failed = |name: &str| {
        let case = cases
            .iter()
            .find(|it| it.starts_with(&format!("name=\"{name}\"")));
        case.expect("a case").contains("<failure")
    };
    assert!(is_failed("28 m") && !is_failed("10 m"), "{junit}");
    let picture = broken["picture"].as_str().expect("a picture");
    assert!(found[1]["picture"].is_null());
    // Both cars, the one with the red edge behind its lead.
    let picture = read(picture);
    assert_eq!(picture.matches("<polygon").count(), 2, "{picture}");
    let x = |is_own: bool| -> f64 {
        let lines = picture.lines().map(str::trim_start);
        let mut boxes = lines.filter(|it| it.starts_with("<polygon"));
        let own = boxes.find(|it| it.contains("#e03131") == is_own);
        let (_, rest) = own.expect("a box").split_once("points=\"").expect("points");
        rest[..rest.find(',').expect("a number")]
            .parse()
            .expect("a number")
    };
    assert!(x(true) + 7.0 * 26.0 < x(false));
}

#[test]
fn rules_come_from_the_shipped_file_or_the_command_line() {
    let (_folder, file) = folder();
    let output = brakecheck(&["stl", "motorway", "--log", &file, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rules = &json(&output)["recordings"][0]["rules"];
    assert_eq!(rules.as_array().map(Vec::len), Some(10));
    let limit = "always (ego.speed <= limit)";
    let args = [
        "stl", limit, "--const", "limit=27", "--log", &file, "--json",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rule = &json(&output)["recordings"][0]["rules"][0];
    assert_eq!(
        (&rule["rule"], &rule["vehicles"]),
        (&limit.into(), &2.into())
    );
    let misspelled = ["--const", "limit=27", "--const", "limt=30", "--log", &file];
    let args = [&["stl", limit][..], &misspelled].concat();
    refused(&args, "nothing uses the constant `limt`");
}

#[test]
fn wrong_rules_are_refused_with_their_place() {
    let (folder, file) = folder();
    let refused_file = |text: &str, says: &str| {
        let rules = folder.path().join("wrong.ron");
        write(&rules, text.as_bytes());
        refused(&["stl", &rules.display().to_string(), "--log", &file], says)
    };
    let said = refused_file(
        "RuleFile(rules: [Rule(name: \"fast\", stl: \"ego.sped > 3\")])",
        "wrong.ron, rule `fast`",
    );
    assert!(said.contains("ego.speed"), "{said}");
    refused_file(
        "RuleFile(rules: [Rule(name: \"a\", stl: \"lead.present == 1 implies ego.lead.gap >= 2\")])",
        "lead.present",
    );
    refused_file("RuleFile(rulez: [])", "wrong.ron`: invalid rule file at 1:");
    refused(
        &["stl", "nowhere.ron", "--log", &file],
        "cannot read `nowhere.ron`",
    );
    refused(&["stl", "ego.sped > 3", "--log", &file], "ego.sped");
    refused(
        &["stl", "x > 3", "--log", &file, "--trace", "a.csv"],
        "cannot be used with",
    );
    refused(&["stl", "x > 3"], "--trace");
}

#[test]
fn one_list_of_rules_serves_a_world_and_a_recording() {
    let (folder, file) = folder();
    let rules = "[Rule(name: \"half a second\", stl: \"always (ego.lead.gap >= 0.5 * ego.speed and ego.lead.ttc >= 1)\")]";
    let path = folder.path().join("rules.ron");
    write(&path, format!("RuleFile(rules: {rules})").as_bytes());
    let output = brakecheck(&["stl", &path.display().to_string(), "--log", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let worlds = folder.path().join("worlds");
    let into = worlds.display().to_string();
    let args = [
        "new",
        "follow",
        "--from-log",
        &file,
        "--kind",
        "following",
        "-o",
        &into,
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let world = worlds.join("follow.ron");
    let text = std::fs::read_to_string(&world).expect("a world");
    let (before, rest) = text.split_once("rulebook: [").expect("a rulebook");
    let (_, after) = rest.split_once("],\n            ),").expect("its end");
    let text = format!("{before}rulebook: {rules},\n            ),{after}");
    write(&world, text.as_bytes());
    let check = brakecheck(&["check", &world.display().to_string()]);
    assert_eq!(code(&check), 0, "{}", stderr(&check));
}

#[test]
fn a_wrong_recording_is_refused_with_its_place() {
    let (folder, _) = folder();
    let path = folder.path().join("wrong.csv");
    let text = recording().replacen("100.000", "east", 1);
    write(&path, text.as_bytes());
    let file = path.display().to_string();
    refused(
        &["log", &file],
        "line 3, column `x`: `east` is not a finite number",
    );
    refused(&["log", "nowhere.csv"], "cannot read `nowhere.csv`");
    refused(&["log", &file, "--map", "nomap"], "cannot read `nomap`");
}

/// A pedestrian and a car whose paths cross, as OpenSCENARIO.
fn scenario() -> String {
    let mut entities = String::new();
    let mut groups = String::new();
    for (name, entry, x, y, x_mps, y_mps) in [
        ("p", "pedestrian_adult", 0.0, -6.0, 0.0, 1.5),
        ("c", "car_white", -65.0, 0.0, 10.0, 0.0),
    ] {
        entities += &format!(
            "<ScenarioObject name=\"{name}\"><CatalogReference catalogName=\"C\" \
             entryName=\"{entry}\"/></ScenarioObject>\n"
        );
        groups += &format!(
            "<ManeuverGroup name=\"g\"><Actors><EntityRef entityRef=\"{name}\"/></Actors>\
             <Maneuver name=\"m\"><Event name=\"e\"><Action name=\"a\">\
             <Trajectory name=\"t\" closed=\"false\"><Shape><Polyline>\n"
        );
        for i in 0..100 {
            let t = 0.1 * f64::from(i);
            let (x, y) = (x + x_mps * t, y + y_mps * t);
            groups +=
                &format!("<Vertex time=\"{t}\"><WorldPosition x=\"{x}\" y=\"{y}\"/></Vertex>\n");
        }
        groups += "</Polyline></Shape></Trajectory><TimeReference><Timing \
             domainAbsoluteRelative=\"absolute\" scale=\"1\" offset=\"0\"/></TimeReference>\
             </Action></Event></Maneuver></ManeuverGroup>\n";
    }
    format!("<OpenSCENARIO><Entities>{entities}</Entities>\n{groups}</OpenSCENARIO>")
}

#[test]
fn the_ending_of_a_recording_selects_its_format() {
    let (folder, _) = folder();
    let place = |name: &str, text: &str| {
        let path = folder.path().join(name);
        write(&path, text.as_bytes());
        path.display().to_string()
    };
    let file = place("drive.xosc", &scenario());
    let output = brakecheck(&["log", &file, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = &json(&output)["recordings"][0];
    assert_eq!(report["map"], "xosc");
    assert_eq!(report["counts"]["assumed_sizes"], 2);
    // The pedestrian leaves the car's strip after 4.0 + 1.15 / 1.5 s, and the car enters
    // that of the pedestrian after 6.5 − 2.55 / 10 s.
    let crossing = &report["crossings"][0];
    assert_eq!(crossing["classes"][0], "pedestrian");
    let pet_s = crossing["least_pet_s"].as_f64().expect("a time");
    assert!((pet_s - 1.478).abs() < 0.01, "{pet_s}");
    refused(&["log", &file, "--map", "dlr"], "is not CSV");
    // CSV under another ending.
    let file = place("tracks.osi", &recording());
    refused(
        &["log", &file],
        "message 1 at byte 0: a length of 1701669236 bytes",
    );
    let file = place("tracks.mcap", &recording());
    refused(&["log", &file], "does not begin as MCAP does");
}

/// A road of two lanes along x, whose right lane has its middle at y = 0.
fn road(left_m: f64) -> String {
    format!(
        r#"<?xml version="1.0"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="6"/>
  <road id="1" length="1000" junction="-1">
    <planView>
      <geometry s="0" x="0" y="{left_m}" hdg="0" length="1000"><line/></geometry>
    </planView>
    <lanes>
      <laneSection s="0">
        <center><lane id="0" type="none"/></center>
        <right>
          <lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
          <lane id="-2" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>
        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"#
    )
}

#[test]
fn lanes_may_come_from_a_map() {
    let (folder, file) = folder();
    let map = folder.path().join("road.xodr");
    write(&map, road(5.25).as_bytes());
    let map = map.display().to_string();
    let output = brakecheck(&["log", &file, "--road", &map, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output);
    let recording = &report["recordings"][0];
    // The fit would find the one lane that is driven.
    let lanes = recording["carriageways"][0]["lanes"]
        .as_array()
        .expect("lanes");
    assert_eq!(lanes.len(), 2);
    assert_eq!(lanes[1]["offset_m"], 3.5);
    assert_eq!(lanes[0]["share"], 1.0);
    assert_eq!(recording["followings"], 1);
    assert_eq!(stderr(&output).matches("left out").count(), 0);
    // A connector of 0.3 m has no direction that counts, and its lanes are not lost silently.
    let start = r#"  <road id="1" length="1000""#;
    let long = road(5.25);
    let at = long.find(start).expect("a road");
    let short = long[at..].replace("</OpenDRIVE>", "");
    let short = short
        .replace("1000", "0.3")
        .replace(r#"id="1""#, r#"id="2""#);
    let both = folder.path().join("both.xodr");
    write(
        &both,
        format!("{}{short}{}", &long[..at], &long[at..]).as_bytes(),
    );
    let both = both.display().to_string();
    let output = brakecheck(&["log", &file, "--road", &both, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("left out: 2 driving lanes of `"),
        "{}",
        stderr(&output)
    );
    assert_eq!(json(&output)["recordings"][0]["followings"], 1);
    let far = folder.path().join("far.xodr");
    write(&far, road(500.0).as_bytes());
    let far = far.display().to_string();
    refused(&["log", &file, "--road", &far], "no vehicle of");
}

#[test]
fn a_recording_and_an_instant_of_it_are_drawn() {
    let (folder, file) = folder();
    let picture = folder.path().join("all.svg").display().to_string();
    let read = || std::fs::read_to_string(&picture).expect("a picture");
    let output = brakecheck(&["log", &file, "--picture", &picture]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let all = read();
    assert!(all.contains("2 road users in 15 s"), "{all}");
    let output = brakecheck(&[
        "log",
        &file,
        "--picture",
        &picture,
        "--at",
        "3",
        "--around",
        "own",
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let instant = read();
    assert_eq!(instant.matches("<polygon").count(), 2, "{instant}");
    assert_eq!(instant.matches("stroke:#e03131").count(), 1, "{instant}");
    let at = ["log", &file, "--picture", &picture, "--at"];
    let refused_at = |more: &[&str], says: &str| refused(&[&at[..], more].concat(), says);
    let said = refused_at(&["99", "--around", "own"], "no road user `own` at 99 s");
    assert!(said.contains("from 0.00 to 14.95 s"), "{said}");
    refused_at(&["-3", "--around", "own"], "no road user `own` at -3 s");
    refused_at(&["3", "--around", "nobody"], "no road user `nobody`");
    refused_at(&["3"], "--around");
    refused(
        &["log", &file, &file, "--picture", &picture],
        "--picture draws one recording, not 2",
    );
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_instead_of_awaited() {
    let (folder, _) = folder();
    let pipe = folder.path().join("pipe.csv");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|it| it.success()));
    refused(
        &["log", &pipe.display().to_string()],
        "it is no ordinary file: a pipe",
    );
}

#[test]
fn what_was_read_and_evaluated_is_said_and_nothing_is_a_failure() {
    let (folder, file) = folder();
    let formula = "always (ego.lead.gap >= 28)";
    let output = brakecheck(&["stl", formula, "--log", &file]);
    let said = stderr(&output);
    for words in [
        "as generic: time `time` in s; box centre `x`, `y` in m",
        "a row per 0.050000 s (20 Hz)",
        "evaluated: 2 tracks of motor vehicles in 600 rows",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let rules = folder.path().join("none.ron");
    write(&rules, b"RuleFile(rules: [])");
    let rules = rules.display().to_string();
    refused(&["stl", &rules, "--log", &file], "there are no rules");
    let walkers = recording()
        .replace("length,width\n", "length,width,class\n")
        .replace(",1.8\n", ",1.8,pedestrian\n");
    let walkers_file = folder.path().join("walkers.csv");
    write(&walkers_file, walkers.as_bytes());
    let map = folder.path().join("map.ron");
    let text = "ColumnMap(time: Seconds(\"time\"), id: \"id\", x: \"x\", y: \"y\", class: Words(\"class\"))";
    write(&map, text.as_bytes());
    let (walkers_file, map) = (
        walkers_file.display().to_string(),
        map.display().to_string(),
    );
    let args = ["stl", formula, "--log", &walkers_file, "--map", &map];
    refused(&args, "has no motor vehicle");
}

#[test]
fn recordings_that_look_like_feet_are_marked() {
    let folder = tempfile::tempdir().expect("a folder");
    let (feet, narrow) = (
        folder.path().join("feet.csv"),
        folder.path().join("narrow.csv"),
    );
    let (mut text, mut small) = ("time,id,x,y\n".to_owned(), recording());
    for (i, id) in (0..120).flat_map(|i| (0..9).map(move |id| (i, id))) {
        let (x, y) = (200 * id + 9 * i, 12 * (id % 3));
        text += &format!("{:.1},{id},{x},{y}\n", 0.1 * f64::from(i));
    }
    small = small.replace(",4,1.8\n", ",1.2,0.55\n");
    write(&feet, text.as_bytes());
    write(&narrow, small.as_bytes());
    for (file, words) in [
        (feet, "lanes 12.0 m apart, as in feet (`length_unit: Feet`"),
        (narrow, "2 cars narrower than 1 m, as sizes in other units"),
    ] {
        let said = stderr(&brakecheck(&["log", &file.display().to_string()]));
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn a_column_map_is_named_for_new_worlds_too() {
    let (folder, file) = folder();
    let worlds = folder.path().join("worlds").display().to_string();
    let args = [
        "new",
        "w",
        "--from-log",
        &file,
        "--kind",
        "following",
        "--map",
        "generic",
    ];
    let output = brakecheck(&[&args[..], &["-o", &worlds]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    refused(&["new", "w", "--map", "generic"], "--from-log");
    // With a scenario the directory is a part of the name.
    for from in [&["--from", "a.xosc"][..], &[]] {
        let args = [&["new", "w", "-o", "out"][..], from].concat();
        refused(&args, "write the directory into the name: out/w");
    }
    refused(&["new", "w", "--road", "r.xodr"], "--road without a file");
}

#[test]
fn a_rule_about_the_lead_does_not_pass_without_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let [file, rules, junit] =
        ["lone.csv", "rules.ron", "rules.xml"].map(|it| folder.path().join(it));
    let rows = recording();
    let alone = rows.lines().filter(|line| !line.contains("lead"));
    let alone: Vec<&str> = alone.collect();
    write(&file, (alone.join("\n") + "\n").as_bytes());
    let text = "RuleFile(rules: [
        Rule(name: \"gap\", stl: \"always (ego.lead.gap >= 28)\"),
        Rule(name: \"guarded\", stl: \"always (lead.present implies ego.lead.gap >= 28)\"),
        Rule(name: \"braking\", stl: \"always (ego.accel >= -2 or lead.present)\"),
    ])";
    write(&rules, text.as_bytes());
    let [file, rules, junit] = [file, rules, junit].map(|it| it.display().to_string());
    let args = ["stl", &rules, "--log", &file, "--json", "--junit", &junit];
    let output = brakecheck(&args);
    let said = stderr(&output);
    assert_eq!(code(&output), 3, "{said}");
    assert!(said.contains("no row answers `gap`, `guarded`,"), "{said}");
    let found = &json(&output)["recordings"][0]["rules"];
    let evaluated = [0, 1, 2].map(|rule| found[rule]["rows_evaluated"].as_u64());
    assert_eq!(evaluated, [Some(0), Some(0), Some(300)]);
    let junit = std::fs::read_to_string(&junit).expect("JUnit");
    let counts = r#"tests="3" skipped="2" failures="0" errors="0""#;
    assert!(junit.contains(counts), "{junit}");
    let output = brakecheck(&["stl", "always (ego.speed <= 30)", "--log", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}
