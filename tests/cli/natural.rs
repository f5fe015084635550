//! Ados within a rate of events among real drivers.

use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};

#[test]
fn a_training_within_a_limit_keeps_it_in_its_run() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &["--natural", "20"]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let rates = |more: &[&str]| {
        let asked = ["eval", &run, "--starts", "20", "--json"];
        let rows = json(&brakecheck(&[&asked[..], more].concat()))["rows"]
            .clone()
            .as_array()
            .expect("rows")
            .clone();
        let rate = |row: &serde_json::Value| row["naturalness"]["limit_per_1000_km"].as_f64();
        rows.iter().filter_map(rate).collect::<Vec<_>>()
    };
    assert_eq!(rates(&[]), [20.0]);
    // Another limit at test time needs no other training.
    assert_eq!(rates(&["--natural", "5,50"]), [5.0, 50.0]);
    // It goes on as it was begun only.
    let resumed = [
        "train",
        "acc",
        "-o",
        &run,
        "--resume",
        "--plant",
        "kinematic",
    ];
    refused(
        &[&resumed[..], &["--natural", "3"]].concat(),
        "natural driving",
    );
}

/// Naturalness in the labels of the crashes that a search keeps.
fn kept(more: &[&str]) -> Vec<serde_json::Value> {
    let dir = scratch();
    let kept = path(&dir, "kept");
    let asked = [
        "search",
        "cut_in",
        "--plant",
        "kinematic",
        "--switches",
        "1",
    ];
    let keep = [
        "--starts",
        "40",
        "--details",
        "--keep",
        &format!("{kept},all"),
    ];
    let found = brakecheck(&[&asked[..], &keep, more].concat());
    assert_eq!(code(&found), 0, "{}", stderr(&found));
    assert_eq!(stderr(&found).contains("drivers of"), !more.is_empty());
    let replayed = json(&brakecheck(&["replay", &kept, "--json"]));
    let rows = replayed["rows"].as_array().expect("rows").iter();
    rows.map(|row| row["about"]["naturalness"].clone())
        .collect()
}

#[test]
fn kept_crashes_state_how_rare_their_ados_drove_if_asked() {
    assert!(kept(&[]).iter().all(serde_json::Value::is_null));
    let asked = kept(&["--traffic", "motorway"]);
    // The data begins at 12.4 m/s.
    let (inside, outside): (Vec<_>, Vec<_>) =
        asked.iter().partition(|known| known["outside"].is_null());
    assert!(!inside.is_empty() && !outside.is_empty());
    for known in inside {
        assert!(known["surprise_decades"].as_f64().is_some(), "{known}");
    }
    for known in outside {
        let words = known["outside"][0].as_str().expect("words");
        assert!(words.contains("covers"), "{words}");
        let numbers = [
            &known["per_1000_km"],
            &known["surprise_decades"],
            &known["rarest"],
        ];
        assert!(numbers.iter().all(|it| it.is_null()), "{known}");
    }
}

#[test]
fn limits_that_cannot_be_are_refused() {
    let dir = scratch();
    let search = ["search", "acc", "--starts", "5", "--natural"];
    let with = |more: &[&'static str]| [&search[..], more].concat();
    refused(&with(&["0"]), "above 0");
    refused(&with(&["some"]), "above 0");
    refused(&with(&["1,2", "--keep", "kept"]), "one rate");
    refused(
        &with(&["1", "--traffic", "none.ron"]),
        "cannot read the traffic model",
    );
    let broken = path(&dir, "broken.ron");
    std::fs::write(&broken, "TrafficModel(").expect("written");
    refused(
        &[&with(&["1"])[..], &["--traffic", &broken]].concat(),
        "invalid traffic model",
    );
    refused(
        &["search", "pedestrian", "--natural", "1"],
        "no ado drives a vehicle",
    );
    refused(&["train", "acc", "--natural", "1,2"], "one rate");
}
