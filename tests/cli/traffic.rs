//! Ados that are trained as declared traffic, given that the ego fails.

use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};
use serde_json::Value;

const TRAFFIC: &str = "examples/traffic/acc.ron";

fn eval(run: &str, more: &[&str]) -> Value {
    let asked = ["eval", run, "--starts", "30", "--json"];
    let found = brakecheck(&[&asked[..], more].concat());
    assert_eq!(code(&found), 0, "{}", stderr(&found));
    json(&found)
}

fn actions_of(row: &Value) -> &Value {
    &row["success_rate"]
}

#[test]
fn traffic_that_fails_is_trained_kept_with_its_rates_and_played_as_any_ado() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &["--traffic", TRAFFIC]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let answer = json(&trained);
    let traffic = &answer["traffic"];
    assert!(traffic["runs"].as_u64() > Some(1000), "{traffic}");
    // Nearly all of its decisions are those of the traffic, and it fails far more often.
    assert!(traffic["usual"].as_f64() > Some(0.9), "{traffic}");
    assert!(traffic["failures"].as_u64() > Some(100), "{traffic}");
    let risk = traffic["risk"]["probability"].as_f64().expect("a rate");
    assert!(risk > 1e-6 && risk < 1e-2, "{traffic}");
    let kinds = traffic["likeliest"].as_array().expect("kinds");
    let rates: f64 = kinds
        .iter()
        .filter_map(|kind| kind["likelihood"]["per_run"].as_f64())
        .sum();
    assert!((rates / risk - 1.0).abs() < 1e-6, "{rates} of {risk}");

    // The likeliest crash of each kind is kept with its rate, and plays as any kept crash.
    let kept = format!("{run}/episodes");
    let replayed = json(&brakecheck(&["replay", &kept, "--json"]));
    let rows = replayed["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), kinds.len().min(5));
    for row in rows {
        let likelihood = &row["about"]["traffic"];
        assert_eq!(likelihood["source"], "example by hand, not measured");
        assert!(likelihood["log10_probability"].as_f64() < Some(0.0));
    }

    // Drawn actions depend on the start alone.
    let one = eval(&run, &["--jobs", "1"]);
    let two = eval(&run, &["--jobs", "2"]);
    let success = |answer: &Value| actions_of(&answer["rows"][0]).clone();
    assert_eq!(success(&one), success(&two));
    assert_eq!(one["rows"][0]["method"], "traffic");

    // A finished training stays as it is, with and without its traffic.
    let again = [
        "train",
        "acc",
        "--plant",
        "kinematic",
        "-o",
        &run,
        "--resume",
    ];
    for more in [&["--traffic", TRAFFIC][..], &[]] {
        let resumed = brakecheck(&[&again[..], more].concat());
        assert_eq!(code(&resumed), 0, "{}", stderr(&resumed));
    }
    refused(
        &[&again[..], &["--traffic", "examples/traffic/other.ron"]].concat(),
        "cannot read",
    );
}

#[test]
fn a_trained_traffic_drives_in_another_world() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &["--traffic", TRAFFIC]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let text = include_str!("../../worlds/acc.ron");
    let from = text.find("drive: Ado(").expect("an ado");
    let to = from
        + text[from..]
            .find("            ),\n        ),")
            .expect("its end");
    let placed = format!(
        "{}drive: Trained(run: {run:?}, rules: Judged{}",
        &text[..from],
        &text[to..]
    );
    let world = path(&dir, "placed.ron");
    std::fs::write(&world, placed).expect("written");
    let asked = [
        "eval",
        &world,
        "--plant",
        "kinematic",
        "--starts",
        "60",
        "--json",
    ];
    let played = brakecheck(&asked);
    assert_eq!(code(&played), 0, "{}", stderr(&played));
    let rows = json(&played)["rows"].clone();
    let rows = rows.as_array().expect("rows");
    let composed = rows.iter().find(|row| row["ado"] == "composed");
    let rate = composed.expect("a row")["success_rate"].as_f64();
    assert!(rate > Some(0.1), "{rows:?}");
}

#[test]
fn traffic_excludes_what_its_law_cannot_follow() {
    let dir = scratch();
    let run = path(&dir, "run");
    let train = ["train", "acc", "-o", &run, "--traffic", TRAFFIC];
    let with = |more: &[&'static str]| [&train[..], more].concat();
    refused(&with(&["--learner", "q_table"]), "brings the learner");
    refused(&with(&["--goal", "severe"]), "brings the learner");
    refused(&with(&["--distinct", "2"]), "one ado against one ego");
    refused(&with(&["--league", "2"]), "one ado against one ego");
    refused(&with(&["--against", "wide"]), "one ado against one ego");
    refused(&with(&["--natural", "1"]), "laws of its own");
    refused(
        &["train", "acc", "-o", &run, "--temperature", "1"],
        "requires `--traffic`",
    );
    refused(
        &["train", "acc", "-o", &run, "--prior", "0.5"],
        "`--prior` requires `--traffic`",
    );
    refused(&with(&["--prior", "2"]), "from 0 to 1");
    refused(
        &["train", "acc", "-o", &run, "--traffic", "world"],
        "declares no traffic",
    );
    // Weather has no body whose last action a signal could tell.
    assert!(!std::path::Path::new(&run).exists());
}
