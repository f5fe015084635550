//! An ego against the one before it, and over a range of a parameter.

use std::collections::BTreeSet;

use super::{brakecheck, code, json as json_of, path, refused, scratch, small_run, stderr};
use serde_json::{Value, json};

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
        (code(&output), json_of(&output)["gates"][0].clone())
    };
    let (better_exit, better) = gate(&harder, "nominal", "any");
    let (worse_exit, worse) = gate("nominal", &harder, "any");
    // A start on which the ado breaks its rule is neither failing nor fixed.
    let fixed_or_open = |gate: &Value| -> BTreeSet<u64> {
        let open = gate["no_answer"]
            .as_array()
            .expect("a list")
            .iter()
            .filter(|it| it["before"] == "fails")
            .map(|it| it["start"].as_u64().expect("a start"));
        starts(gate, "newly_fixed")
            .into_iter()
            .chain(open)
            .collect()
    };
    assert_eq!(starts(&better, "newly_failing"), fixed_or_open(&worse));
    assert_eq!(fixed_or_open(&better), starts(&worse, "newly_failing"));
    assert!(starts(&worse, "newly_failing").is_disjoint(&starts(&worse, "newly_fixed")));
    assert_eq!(better["p_value"], worse["p_value"]);
    let failing = starts(&worse, "newly_failing").len();
    let fixed = starts(&worse, "newly_fixed").len();
    assert!(fixed < failing, "softer brakes fail more often: {worse}");
    let list = worse["newly_failing"].as_array().expect("a list");
    let unanswered = list.iter().filter(|it| it["before"] == "foul").count();
    assert_eq!(
        worse["p_value"],
        brakecheck::stats::mcnemar(failing - unanswered, fixed)
    );
    assert_eq!(worse_exit, 1);
    assert_eq!(better_exit, i32::from(fixed > 0));
    // All but shown-unavoidable crashes close it unless asked otherwise.
    let (exit, default) = gate("nominal", &harder, "unless-unavoidable");
    let list = default["newly_failing"].as_array().expect("a list");
    let blocking = list.iter().filter(|it| it["unavoidable"] != true).count();
    assert_eq!(exit, i32::from(blocking > 0));
    let by = &default["newly_failing_by"];
    let count = |label: &str| by[label].as_u64().expect("a count") as usize;
    let all = ["preventable", "avoidable", "unavoidable", "unknown"].map(count);
    assert_eq!(all.iter().sum::<usize>(), failing);
    assert_eq!(all[0] + all[1] + all[3], blocking);
    // Only what CC_LATCHED or FSM would have avoided counts if asked.
    let (exit, preventable) = gate("nominal", &harder, "preventable");
    let list = preventable["newly_failing"].as_array().expect("a list");
    let any = list.iter().any(|flipped| flipped["preventable"] == true);
    assert_eq!(exit, i32::from(any));
    let (exit, severe) = gate("nominal", &harder, "never");
    assert_eq!((exit, severe["closed_by"].clone()), (0, json!([])));
    // Softer brakes also make common failures more severe, which closes it on request.
    let more_severe = severe["more_severe"].as_array().expect("a list");
    assert!(!more_severe.is_empty(), "{severe}");
    for one in more_severe {
        let speed = |key: &str| one[key].as_f64().expect("a speed");
        assert!(1.2 * speed("before_mps") < speed("now_mps"), "{one}");
    }
    let (exit, severe) = gate("nominal", &harder, "never,severity");
    assert_eq!(
        (exit, severe["closed_by"].clone()),
        (1, json!(["severity"]))
    );

    // In words; and what cannot be compared is refused.
    let asked = ["gate", &run, "--starts", "20", "--ego", &harder];
    let output = brakecheck(&[&asked[..], &["--baseline-ego", "nominal"]].concat());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.starts_with("gate ") && text.contains("McNemar"),
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

/// No driver model judges a crash with a pedestrian, which is no excuse.
#[test]
fn a_gate_closes_on_crashes_that_no_driver_model_can_judge() {
    let dir = scratch();
    let run = path(&dir, "run");
    let trained = brakecheck(&[
        "train",
        "pedestrian",
        "-o",
        &run,
        "--decisions",
        "1k",
        "--starts",
        "20",
    ]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let [blind, equal] = ["blind.ron", "equal.ron"].map(|name| path(&dir, name));
    let coast = "Change(controller: Coast(accel_mps2: 0.0, lag_s: 0.0))";
    std::fs::write(&blind, coast).expect("written");
    let gate = |ego: &str, before: &str, more: &[&str]| {
        let asked = ["gate", &run, "--starts", "40", "--ego", ego, "--json"];
        let output = brakecheck(&[&asked[..], &["--baseline-ego", before], more].concat());
        (code(&output), json_of(&output)["gates"][0].clone())
    };
    let (exit, worse) = gate(&blind, "nominal", &[]);
    let by = &worse["newly_failing_by"];
    assert!(by["unknown"].as_u64().expect("a count") > 0, "{worse}");
    assert_eq!(by["preventable"], 0);
    assert_eq!(
        (exit, worse["closed_by"].clone()),
        (1, json!(["unless-unavoidable"]))
    );
    assert_eq!(gate(&blind, "nominal", &["--on", "preventable"]).0, 0);
    // A better ego passes, and an equal one.
    assert_eq!(gate("nominal", &blind, &[]).0, 0);
    std::fs::write(&equal, "Change(ego: (trigger_mps2: 3.0))").expect("written");
    assert_eq!(gate(&equal, "nominal", &["--on", "any,severity"]).0, 0);
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
    let swept = &json_of(&output)["swept"];
    let points = swept["points"].as_array().expect("points");
    let values: Vec<f64> = points.iter().filter_map(|p| p["value"].as_f64()).collect();
    assert_eq!(values, [0.3, 1.1, 1.9, 2.7]);
    let failing: Vec<u64> = points
        .iter()
        .filter_map(|p| p["failing"].as_u64())
        .collect();
    assert!(failing[0] > 0 && failing[3] < failing[0], "{failing:?}");
    let safe = points.iter().rev().take_while(|p| p["failing"] == 0).last();
    assert_eq!(
        swept["safe_from"],
        safe.map_or(Value::Null, |p| p["value"].clone())
    );
    let svg = std::fs::read_to_string(&curve).expect("a curve");
    assert!(svg.contains("time_gap_s") && svg.contains("<svg"));
    let text =
        String::from_utf8_lossy(&brakecheck(&[&asked[..], &over].concat()).stdout).into_owned();
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
            "unless-unavoidable, preventable, any, never, severity",
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

#[test]
fn an_ego_that_changes_nothing_is_named() {
    let dir = scratch();
    let same = path(&dir, "same.ron");
    std::fs::write(&same, "Change()").expect("written");
    for (ego, is_named) in [(same.as_str(), true), ("nominal", false)] {
        let asked = ["search", "acc", "--starts", "1", "--plant", "kinematic"];
        let output = brakecheck(&[&asked[..], &["--ego", ego]].concat());
        let message = stderr(&output);
        assert_eq!(code(&output), 0, "{message}");
        assert_eq!(message.contains("changes nothing"), is_named, "{message}");
    }
}
