//! `serve` with untrained ados, at other steps and on slopes.

use brakecheck::experiment::{EgoUnderTest, test_start};
use brakecheck::search::JointActions;
use brakecheck::testbench::{Aftermath, Replay, play};
use brakecheck::world::Scenario;
use serde_json::{Value, json};

use super::live::{Served, sent_back};
use super::{brakecheck, code, path, refusal, root, scratch, small_run, stderr};

/// A shipped world on the kinematic plant, with more fields, in a directory.
fn kinematic(dir: &tempfile::TempDir, name: &str, more: &str) -> String {
    let text = std::fs::read_to_string(root().join(format!("worlds/{name}.ron")));
    let text = text.expect("the world").replacen("Rigid", "Kinematic", 1);
    let file = path(dir, &format!("{name}.ron"));
    let with = text.replacen("    agents: [", &format!("    {more}\n    agents: ["), 1);
    std::fs::write(&file, with).expect("written");
    file
}

/// Plays an episode in which the ego keeps its speed, with a sample per step.
fn coasted(served: &mut Served, reset: &Value) -> Vec<Value> {
    let mut answers = vec![served.ask(&json!({ "reset": reset }))];
    let begun = answers[0].clone();
    let number = |key: &str| begun["bodies"]["ego"][key].as_f64().expect("a number");
    let step_s = begun["step_s"].as_f64().expect("a step");
    while answers.last().expect("answers")["done"] == false {
        let way_m = answers.len() as f64 * step_s * number("speed_mps");
        let answer = served.ask(&json!({ "sample": { "ego": {
            "x_m": number("x_m") + way_m, "y_m": number("y_m"), "heading_rad": 0.0,
            "speed_mps": number("speed_mps"),
        } } }));
        assert!(answer["error"].is_null(), "{answer}");
        answers.push(answer);
    }
    answers
}

/// The ados decide at the same instants whatever the step, on the signals of that instant.
#[test]
fn another_step_changes_neither_the_times_nor_the_choices_of_decisions() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    let mut chosen = std::collections::BTreeSet::new();
    for index in 0..6 {
        let own = coasted(&mut served, &json!({ "index": index }));
        let last_s = |answers: &[Value]| answers.last().expect("them")["time_s"].clone();
        for (step_s, per_decision) in [(0.05, 10), (0.01, 50), (0.1, 5), (0.25, 2), (0.5, 1)] {
            let answers = coasted(&mut served, &json!({ "index": index, "step_s": step_s }));
            assert_eq!(answers[0]["step_s"], json!(step_s));
            assert_eq!(answers[0]["start"], own[0]["start"]);
            let what = format!("start {index}, step {step_s}");
            for (i, answer) in answers.iter().enumerate() {
                let time_s = answer["time_s"].as_f64().expect("a time");
                assert!((time_s - i as f64 * step_s).abs() < 1e-9, "{what}");
                // Between two decisions the action is held.
                if i % per_decision != 0 {
                    assert_eq!(
                        answer["action"],
                        answers[i - 1]["action"],
                        "{what}, {time_s}"
                    );
                }
            }
            let decided = answers.iter().step_by(per_decision);
            for (decision, (answer, at_home)) in decided.zip(own.iter().step_by(10)).enumerate() {
                let is_last = |answer: &Value| answer["done"] == true;
                if is_last(answer) || is_last(at_home) {
                    break;
                }
                assert_eq!(answer["action"], at_home["action"], "{what}, {decision}");
                let x_m = |answer: &Value| answer["bodies"]["ado"]["x_m"].as_f64().expect("x");
                assert!(
                    (x_m(answer) - x_m(at_home)).abs() < 0.05,
                    "{what}, {decision}"
                );
                chosen.insert(answer["action"].to_string());
            }
            if step_s == 0.05 {
                assert_eq!(answers, own, "{what}");
            }
            // A verdict needs the sample at which it is certain, and steps are coarser.
            let off_s = last_s(&answers).as_f64().zip(last_s(&own).as_f64());
            assert!(off_s.is_some_and(|(a, b)| (a - b).abs() <= 0.5), "{what}");
        }
    }
    assert!(chosen.len() > 1, "{chosen:?}");
}

#[test]
fn a_step_that_does_not_fit_is_answered_with_the_reason() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    for (step_s, says) in [
        (json!(0), "`step_s` = 0 is no time: give seconds, above 0"),
        (json!(-0.05), "`step_s` = -0.05 is no time"),
        (json!(20.0), "longer than the episode of 15 s"),
        (
            json!(0.3),
            "is no part of 0.5 s, the time between two decisions: give 0.5 / n, such as 0.25",
        ),
        (json!(1.0), "is no part of 0.5 s"),
        (json!(0.0001), "is below 0.001 s"),
        (json!("fast"), "`reset`: invalid type"),
    ] {
        let answer = served.ask(&json!({ "reset": { "index": 0, "step_s": step_s } }));
        let error = answer["error"].as_str().unwrap_or_default();
        assert!(error.contains(says), "{step_s}: {answer}");
        let answer = served.ask(&json!({ "sample": {} }));
        assert!(
            answer["error"].to_string().contains("requires an episode"),
            "{answer}"
        );
    }
}

#[test]
fn a_counterexample_at_another_step_is_kept_at_the_step_of_its_world() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    for step_s in [0.01, 0.1] {
        let keep = path(&dir, &format!("kept {step_s}"));
        let mut served = Served::start(&[&run, "--keep", &keep]);
        let mut kept = 0;
        for index in 0..8 {
            let answers = coasted(&mut served, &json!({ "index": index, "step_s": step_s }));
            let last = answers.last().expect("answers");
            if last["kept"].is_string() {
                assert!(
                    last["home_off_m"].as_f64().expect("a distance") < 0.1,
                    "{last}"
                );
                kept += 1;
            }
        }
        drop(served);
        assert!(kept > 0, "{step_s}");
        let output = brakecheck(&["replay", &keep, "--expect", "recorded"]);
        assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    }
}

#[test]
fn an_untrained_world_is_served_with_other_players() {
    let dir = scratch();
    let file = kinematic(&dir, "acc", "");
    let mut neutral = Served::start(&[&file]);
    let hello = neutral.ask(&json!({ "hello": { "protocol": 1 } }))["hello"].clone();
    assert_eq!(
        (&hello["ado"], &hello["origin"]),
        (&json!("neutral"), &Value::Null)
    );
    let error = neutral.ask(&json!({ "decide": {} }))["error"].to_string();
    assert!(
        error.contains("`decide` requires a trained ado, and these are `neutral`"),
        "{error}"
    );
    let answers = coasted(&mut neutral, &json!({ "index": 0 }));
    assert!(
        answers
            .iter()
            .all(|it| it["action"] == hello["neutral"] && it["value"].is_null())
    );
    assert!(answers[0].get("found").is_none(), "{}", answers[0]);
    let mut random = Served::start(&[&file, "--ado", "random"]);
    let answers = coasted(&mut random, &json!({ "index": 0 }));
    assert!(answers.iter().any(|it| it["action"] != hello["neutral"]));
}

/// The searched sequence makes the world's own ego fail, so the same motion fails here.
#[test]
fn searched_ados_play_the_sequence_that_makes_the_own_ego_fail() {
    let dir = scratch();
    let file = kinematic(&dir, "acc", "");
    let world = Scenario::load(file.as_ref()).expect("a world");
    let mut served = Served::start(&[&file, "--ado", "search"]);
    let mut found = 0;
    for index in 0..6 {
        let begun = served.ask(&json!({ "reset": { "index": index } }));
        let ego = EgoUnderTest::nominal(&world);
        let (start, noise) = test_start(&world, 0, index as usize).expect("a start");
        let actions = JointActions::searched(&ego, &start, noise);
        assert_eq!(begun["found"], json!(actions.is_some()), "{begun}");
        let Some(JointActions::Sequence(actions)) = actions else {
            continue;
        };
        found += 1;
        let mut actor = Replay::holding(&actions);
        let mut bench = world.bench();
        let episode = play(&mut bench, &start, noise, &mut actor, Aftermath::Play);
        let answers = sent_back(&mut served, &world, &episode, index);
        let last = answers.last().expect("answers");
        assert_eq!(last["verdict"], "counterexample", "{last}");
    }
    assert!(found > 1, "{found}");
}

#[test]
fn what_cannot_be_served_untrained_is_refused() {
    let output = brakecheck(&["serve", "grid"]);
    refusal(&output, "`grid` is a grid world");
    let output = brakecheck(&["serve", "acc", "--ado", "trained"]);
    refusal(
        &output,
        "`acc` is a world, and a trained ado requires its run",
    );
    let output = brakecheck(&["serve", "nowhere.ron"]);
    refusal(&output, "nowhere.ron");
}

/// Heights and angles of bodies on a road that climbs and leans, on both plants.
#[test]
fn bodies_have_the_height_and_the_tilt_of_their_road() {
    let dir = scratch();
    let (rise, bank) = (0.06, 0.02);
    let slopes = format!("grades: [(0.0, {rise})], banks: [(0.0, {bank})],");
    let file = kinematic(&dir, "cut_in", &slopes);
    let rigid = path(&dir, "rigid.ron");
    let text = std::fs::read_to_string(&file).expect("the world");
    std::fs::write(&rigid, text.replacen("Kinematic", "Rigid", 1)).expect("written");
    for (file, off_m, off_rad) in [(&file, 1e-9, 1e-9), (&rigid, 0.05, 0.01)] {
        let mut served = Served::start(&[file]);
        let answers = coasted(&mut served, &json!({ "index": 1 }));
        assert!(answers.len() > 20);
        for answer in &answers {
            for name in ["ego", "ado"] {
                let body = &answer["bodies"][name];
                let number = |key: &str| body[key].as_f64().expect("a number");
                let height_m = rise * number("x_m") + bank * number("y_m");
                assert!(
                    (number("z_m") - height_m).abs() < off_m,
                    "{file}, {name}: {body}"
                );
                // Uphill the front is higher, and the left side of a road that leans to the right.
                assert!(
                    (number("pitch_rad") + rise.atan()).abs() < off_rad,
                    "{file}: {body}"
                );
                assert!(
                    (number("roll_rad") - bank.atan()).abs() < off_rad,
                    "{file}: {body}"
                );
            }
        }
    }
    let flat = kinematic(&dir, "acc", "");
    let body = &coasted(&mut Served::start(&[&flat]), &json!({ "index": 0 }))[3]["bodies"]["ado"];
    assert_eq!(
        [&body["z_m"], &body["pitch_rad"], &body["roll_rad"]].map(|it| it.as_f64().map(f64::abs)),
        [Some(0.0); 3]
    );
}

#[test]
fn a_world_along_lanes_of_a_file_has_its_origin_there() {
    let mut served = Served::start(&["junction"]);
    let origin = served.ask(&json!({ "hello": { "protocol": 1 } }))["hello"]["origin"].clone();
    assert_eq!(origin["file"], "junction.xodr", "{origin}");
    for key in ["x_m", "y_m", "z_m", "heading_rad"] {
        assert!(origin[key].is_number(), "{origin}");
    }
}
