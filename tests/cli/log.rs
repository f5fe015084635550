//! `brakecheck log` on a small synthetic recording.

use super::{brakecheck, code, json, refused, stderr, write};

/// Two cars on one lane, the second 30 m behind the first, which brakes.
fn recording() -> String {
    let mut text = "time,id,x,y,heading,speed,length,width\n".to_owned();
    let (mut lead_m, mut own_m) = (134.0, 100.0);
    for i in 0..300 {
        let time_s = 0.05 * f64::from(i);
        let lead_mps = if (100..140).contains(&i) { 26.0 } else { 28.0 };
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
fn a_recording_has_lanes_rules_and_worlds() {
    let (folder, file) = folder();
    let worlds = folder.path().join("worlds").display().to_string();
    let args = [
        "log", &file, "--rules", "motorway", "--worlds", &worlds, "--json",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output);
    let recording = &report["recordings"][0];
    assert_eq!(recording["map"], "generic");
    assert_eq!(recording["road_users"], 2);
    assert_eq!(recording["followings"], 1);
    assert_eq!(recording["rules"].as_array().map(Vec::len), Some(10));
    let world = report["worlds"][0]["file"].as_str().expect("a world");
    let check = brakecheck(&["check", world]);
    assert_eq!(code(&check), 0, "{}", stderr(&check));
    // A second run replaces nothing.
    refused(&args, "is there already");
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
        groups += "</Polyline></Shape></Trajectory></Action></Event></Maneuver></ManeuverGroup>\n";
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
