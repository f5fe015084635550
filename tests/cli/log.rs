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
    let lanes = recording["carriageways"][0]["lanes"].as_array();
    let lanes = lanes.expect("lanes");
    assert_eq!(lanes.len(), 2);
    assert_eq!(lanes[1]["offset_m"], 3.5);
    assert_eq!(lanes[0]["share"], 1.0);
    assert_eq!(recording["followings"], 1);
    let far = folder.path().join("far.xodr");
    write(&far, road(500.0).as_bytes());
    let far = far.display().to_string();
    refused(&["log", &file, "--road", &far], "no vehicle of");
}
