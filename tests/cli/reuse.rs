//! One ado on many egos: blocks, what happens without an adversary, means.

use super::{brakecheck, code, json, path, root, scratch, small_run, stderr};
use serde_json::Value;

#[test]
fn the_table_of_many_egos_is_summed_up_from_its_rows() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let asked = |starts| {
        let mut args = vec!["eval", &run, "--starts", starts, "--ego", "all"];
        args.extend(["--ado", "trained", "--ado", "hold", "--search", "1"]);
        args
    };
    let text = brakecheck(&[&asked("3")[..], &["--details"]].concat());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    for block in ["# the ego it was trained against", "reused zero-shot"] {
        assert!(text.contains(block), "{text}");
    }
    let output = brakecheck(&[&asked("16")[..], &["--json"]].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let all = json(&output);
    let egos = all["egos"].as_array().expect("egos");
    assert_eq!(egos[0]["relation"], "trained");
    assert!(egos[1..].iter().all(|ego| ego["relation"] == "zero_shot"));

    // Every start that an ego fails alone or that anybody solves is counted.
    let rows: Vec<&Value> = all["rows"].as_array().expect("rows").iter().collect();
    let of = |ego: &Value, ado: &str| -> Value {
        let row = rows
            .iter()
            .find(|r| r["ego"] == ego["ego"] && r["ado"] == ado);
        (*row.expect("a row")).clone()
    };
    for ego in egos {
        assert_eq!(ego["reachable"], of(ego, "search")["success_rate"]);
        let union = ego["union"].as_f64().expect("a share");
        for ado in ["trained", "hold", "search"] {
            assert!(of(ego, ado)["success_rate"].as_f64().expect("a rate") <= union);
        }
    }

    // The mean recall is over the egos of which a tenth is reachable.
    let telling: Vec<&Value> = egos[1..]
        .iter()
        .filter(|ego| ego["reachable"].as_f64().expect("a share") >= 0.1)
        .collect();
    let recalls: Vec<f64> = telling
        .iter()
        .map(|ego| of(ego, "trained")["recall"].as_f64().expect("recall"))
        .collect();
    let mean = recalls.iter().sum::<f64>() / recalls.len() as f64;
    let summary = all["summary"].as_array().expect("summary");
    let of_block = |ado: &str| {
        let mut found = summary.iter();
        found
            .find(|sum| sum["relation"] == "zero_shot" && sum["ado"] == ado)
            .expect("a summary")
    };
    let trained = of_block("trained");
    assert_eq!(trained["egos_with_recall"], telling.len());
    assert!((trained["recall_mean"].as_f64().expect("a mean") - mean).abs() < 1e-12);
    assert!(trained["reference_minus"].is_null());
    let [difference, interval] = [0, 1].map(|i| &of_block("hold")["reference_minus"][i]);
    let difference = difference.as_f64().expect("a difference");
    assert!(interval[0].as_f64() <= Some(difference) && Some(difference) <= interval[1].as_f64());
}

#[test]
fn an_ado_is_trained_anew_for_a_changed_ego_once() {
    let dir = scratch();
    // The world's learner trains anew: a short one.
    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("a world");
    let quick = text.replace("Dqn(decisions: 300_000)", "Dqn(decisions: 12_000)");
    assert_ne!(quick, text);
    let (world, run) = (path(&dir, "acc.ron"), path(&dir, "run"));
    std::fs::write(&world, quick).expect("written");
    let train = ["train", &world, "-o", &run, "--plant", "kinematic"];
    let trained = brakecheck(&[&train[..], &["--starts", "5"]].concat());
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let mut args = vec!["eval", &run, "--starts", "30", "--ego", "softer brakes"];
    args.extend(["--ado", "trained", "--ado", "retrained", "--json"]);
    let first = brakecheck(&args);
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    let rows = json(&first)["rows"].clone();
    assert_eq!(rows[1]["ado"], "retrained");
    assert_ne!(rows[0]["solved"], rows[1]["solved"]);

    // It is kept, and the second evaluation trains nothing.
    let own = std::path::Path::new(&run).join("retrained/softer-brakes-kinematic");
    let policy = || std::fs::metadata(own.join("policy.safetensors")).expect("a policy");
    let written = policy().modified().expect("a time");
    let again = json(&brakecheck(&args));
    assert_eq!(again["rows"][1]["solved"], rows[1]["solved"]);
    assert_eq!(policy().modified().expect("a time"), written);

    // The nominal ego has the trained ado itself.
    let nominal = brakecheck(&[
        "eval",
        &run,
        "--starts",
        "5",
        "--ado",
        "retrained",
        "--json",
    ]);
    let nominal = json(&nominal);
    assert_eq!(nominal["rows"].as_array().map(Vec::len), Some(0));
}

#[test]
fn all_ados_are_the_trained_one_the_baselines_and_the_rivals() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let output = brakecheck(&["eval", &run, "--starts", "8", "--ado", "all", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let rows = json(&output)["rows"].clone();
    let rows = rows.as_array().expect("rows");
    let ados: Vec<&str> = rows.iter().filter_map(|row| row["ado"].as_str()).collect();
    let baselines = ["trained", "hold", "random", "constant"];
    let rivals = ["switch", "heuristic", "replay", "replays"];
    assert_eq!(ados, [&baselines[..], &rivals[..]].concat());
}
