//! The ado protocol: whatever a simulator says, each message has one answer.

use std::cell::RefCell;
use std::io::Cursor;

use brakecheck::run_dir::RunDir;
use brakecheck::serving::{ServeError, Served, ServedAdo};
use serde_json::{Map, Value, json};

use super::corpus::Source;
use super::files::{run_of, world};
use super::harness::{Seen, Target};
use super::mutate::mutants;

/// Samples that a simulator plays in a good conversation, to the contact and beyond.
const SAMPLES: usize = 60;

/// Plays messages, and returns the answers line by line.
fn answered(
    ado: &mut ServedAdo,
    text: &str,
) -> (Result<Served, ServeError>, Vec<Map<String, Value>>) {
    let mut answers = Vec::new();
    let served = ado.serve(&mut Cursor::new(text.as_bytes()), &mut answers);
    let answers = String::from_utf8(answers).expect("UTF-8");
    let lines = answers
        .lines()
        .map(|line| serde_json::from_str(line).expect("an object"));
    (served, lines.collect())
}

/// Messages of a simulator whose ego keeps its speed, as far as that ado lets it.
fn episode(ado: &mut ServedAdo, index: usize) -> String {
    let reset = json!({ "id": 0, "reset": { "seed": 3, "index": index } }).to_string();
    let (_, answers) = answered(ado, &reset);
    let ego = answers[0]["bodies"]["ego"].clone();
    let number = |key: &str| ego[key].as_f64().expect("a number");
    let (x_m, y_m) = (number("x_m"), number("y_m"));
    let (heading_rad, speed_mps) = (number("heading_rad"), number("speed_mps"));
    let (sin, cos) = heading_rad.sin_cos();
    let mut text = format!("{reset}\n");
    for sample in 1..=SAMPLES {
        let way_m = 0.05 * sample as f64 * speed_mps;
        let state = json!({
            "x_m": x_m + way_m * cos, "y_m": y_m + way_m * sin,
            "heading_rad": heading_rad, "speed_mps": speed_mps,
        });
        text += &json!({ "id": sample, "sample": { "ego": state } }).to_string();
        text.push('\n');
    }
    text
}

fn conversations(ado: &mut ServedAdo) -> Vec<Source> {
    let signals = json!({
        "headway": 20.0, "ego.speed": 10.0, "ado.speed": 9.0, "ego.accel": 0.0, "time_left": 15.0,
    });
    let decided = [
        json!({ "hello": { "protocol": 1 } }),
        json!({ "id": "first", "reset": {} }),
        json!({ "id": 1, "decide": signals }),
        json!({ "id": [2], "decide": signals, "more": { "deep": [null] } }),
        json!({ "reset": { "seed": 4, "start": { "ego.speed": 12.0 } } }),
        json!({ "reset": { "seed": 4, "index": 1, "step_s": 0.25 } }),
        json!({ "decide": signals }),
        json!({ "close": {} }),
    ];
    let lines = decided.iter().map(|message| format!("{message}\n"));
    let mut all = vec![Source::new("decided", lines.collect::<String>())];
    for index in 0..3 {
        all.push(Source::new(format!("episode {index}"), episode(ado, index)));
    }
    all
}

#[test]
fn any_message_of_a_simulator_has_one_answer() {
    let dir = tempfile::tempdir().expect("a directory");
    let run = dir.path().join("run");
    run_of(&world("acc.ron"), &run);
    let mut ado = ServedAdo::of(&RunDir::open(&run).expect("a run"))
        .expect("an ado")
        .keep_in(dir.path().join("kept"));
    let target = Target {
        name: "serve",
        cases: 250,
        shrinks: 200,
        least_percent: (10, 20),
    };
    let sources = conversations(&mut ado);
    // Each case begins with what the one before left, as messages of one simulator do.
    let shared = RefCell::new(ado);
    target.run(&mutants(sources.into()), |mutant| {
        let (served, answers) = answered(&mut shared.borrow_mut(), &mutant.text);
        // What is asked before the end, as JSON has it.
        let lines = mutant
            .text
            .split('\n')
            .filter(|line| !line.trim().is_empty());
        let mut asked = 0;
        let mut is_over = false;
        for (line, answer) in lines.zip(answers.iter().map(Some).chain(std::iter::repeat(None))) {
            let message = serde_json::from_str::<Map<String, Value>>(line);
            let Some(answer) = answer else {
                is_over = message.is_ok_and(|it| it.get("close").is_some_and(|it| !it.is_null()));
                break;
            };
            asked += 1;
            let id = message.ok().and_then(|mut it| it.remove("id"));
            let id = id.filter(|id| !id.is_null());
            // A line that is no message ends the conversation, and its answer has no number.
            let is_last = served.is_err() && asked == answers.len();
            assert!(is_last || answer.get("id") == id.as_ref(), "{answer:?}");
            let has = |key: &&str| answer.contains_key(*key);
            let kinds = ["error", "hello", "ready", "action", "done"];
            assert!(kinds.iter().any(has), "{answer:?}");
        }
        assert_eq!(asked, answers.len(), "an answer to nothing");
        match served {
            Ok(served) => {
                let all = mutant
                    .text
                    .split('\n')
                    .filter(|line| !line.trim().is_empty());
                assert!(
                    is_over || asked == all.count(),
                    "a message without an answer"
                );
                if served.errors == 0 {
                    Seen::Accepted
                } else {
                    Seen::Refused
                }
            }
            Err(error) => {
                let why = error.to_string();
                assert!(matches!(error, ServeError::NoMessage { .. }), "{why}");
                assert!(answers[asked - 1].contains_key("error"), "{why}");
                Seen::Refused
            }
        }
    });
}
