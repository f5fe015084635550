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
