//! An ego against the one before it, and over a range of a parameter.

use std::collections::BTreeSet;

use super::{brakecheck, code, json, path, refused, scratch, small_run, stderr};
use serde_json::Value;

/// The shipped ego, braking a fifth harder.
const HARDER: &str = "Change(ego: (max_brake_mps2: 7.2))";

fn starts(gate: &Value, which: &str) -> BTreeSet<u64> {
    let list = gate[which].as_array().expect("a list");
    let starts = list.iter().map(|flipped| flipped["start"].as_u64());
    starts.collect::<Option<_>>().expect("positions")
}

#[test]
fn a_gate_and_its_opposite_mirror_each_other() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let harder = path(&dir, "harder.ron");
    std::fs::write(&harder, HARDER).expect("written");
    let gate = |ego: &str, before: &str, on: &str| {
        let asked = ["gate", &run, "--starts", "120", "--ego", ego];
        let gated = ["--baseline-ego", before, "--on", on, "--json"];
        let output = brakecheck(&[&asked[..], &gated].concat());
        (code(&output), json(&output)["gates"][0].clone())
    };
    let (better_exit, better) = gate(&harder, "nominal", "any");
    let (worse_exit, worse) = gate("nominal", &harder, "any");
    assert_eq!(
        starts(&better, "newly_failing"),
        starts(&worse, "newly_fixed")
    );
    assert_eq!(
        starts(&better, "newly_fixed"),
        starts(&worse, "newly_failing")
    );
    assert!(starts(&worse, "newly_failing").is_disjoint(&starts(&worse, "newly_fixed")));
    assert_eq!(better["p_value"], worse["p_value"]);
    let failing = starts(&worse, "newly_failing").len();
    let fixed = starts(&worse, "newly_fixed").len();
    assert!(fixed < failing, "softer brakes fail more often: {worse}");
    assert_eq!(worse["p_value"], brakecheck::stats::mcnemar(failing, fixed));
    assert_eq!(worse_exit, 1);
    assert_eq!(better_exit, i32::from(0 < fixed));
    // Only what CC_LATCHED or FSM would have avoided counts unless asked.
    let (exit, preventable) = gate("nominal", &harder, "preventable");
    let list = preventable["newly_failing"].as_array().expect("a list");
    let any = list.iter().any(|flipped| flipped["preventable"] == true);
    assert_eq!(exit, i32::from(any));
    assert_eq!(gate("nominal", &harder, "never").0, 0);

    // In words; and what cannot be compared is refused.
    let asked = ["gate", &run, "--starts", "20", "--ego", &harder];
    let output = brakecheck(&[&asked[..], &["--baseline-ego", "nominal"]].concat());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains("newly failing") && text.contains("McNemar"),
        "{text}"
    );
    for (ego, before, says) in [
        ("nominal", "nominal", "compared with itself"),
        ("nominal", "all", "more than one ego"),
        ("nominal", "nominel", "no ego `nominel`"),
    ] {
        refused(
            &["gate", &run, "--ego", ego, "--baseline-ego", before],
            says,
        );
    }
}

#[test]
fn a_sweep_says_from_where_on_an_ego_is_safe() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let curve = path(&dir, "curve.svg");
    let asked = [
        "sweep", &run, "--starts", "40", "--ado", "trained", "--ado", "hold",
    ];
    let over = ["--over", "ego.time_gap_s=0.3..2.7:4"];
    let output = brakecheck(&[&asked[..], &over, &["--curve", &curve, "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let swept = &json(&output)["swept"];
    let points = swept["points"].as_array().expect("points");
    let values: Vec<f64> = points.iter().filter_map(|p| p["value"].as_f64()).collect();
    assert_eq!(values, [0.3, 1.1, 1.9, 2.7]);
    let failing: Vec<u64> = points
        .iter()
        .filter_map(|p| p["failing"].as_u64())
        .collect();
    assert!(0 < failing[0] && failing[3] < failing[0], "{failing:?}");
    let safe = points.iter().rev().take_while(|p| p["failing"] == 0).last();
    assert_eq!(
        swept["safe_from"],
        safe.map_or(Value::Null, |p| p["value"].clone())
    );
    let svg = std::fs::read_to_string(&curve).expect("a curve");
    assert!(svg.contains("time_gap_s") && svg.contains("<svg"));
    let text = brakecheck(&[&asked[..], &over].concat());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains("95 % interval") && text.contains("0.3"),
        "{text}"
    );
    for (over, says) in [
        ("ego.time_gap=0.3..1", "no parameter `time_gap`"),
        ("time_gap_s=0.3..1", "is no sweep"),
        ("ego.time_gap_s=-1..1:3", "below 0"),
    ] {
        refused(&["sweep", &run, "--over", over], says);
    }
}

#[test]
fn a_gate_and_a_sweep_require_a_run_and_their_option() {
    let over = "ego.time_gap_s=0.3..1";
    let cases: [(&[&str], &str); 6] = [
        (
            &["gate", "acc", "--baseline-ego", "nominal"],
            "train an ado first",
        ),
        (
            &["sweep", "worlds/acc.ron", "--over", over],
            "train an ado first",
        ),
        (&["gate", "runs/none"], "--baseline-ego <NAME|FILE.ron>"),
        (&["sweep", "runs/none"], "--over <ego.NAME=LO..HI[:N]>"),
        (
            &[
                "gate",
                "runs/none",
                "--baseline-ego",
                "nominal",
                "--on",
                "all",
            ],
            "preventable, any, never",
        ),
        (
            &["search", "acc", "--keep", "kept,mots=3"],
            "unknown setting `mots=3`, known are most=N, all, as-found and runs=N",
        ),
    ];
    for (args, says) in cases {
        refused(args, says);
    }
}
