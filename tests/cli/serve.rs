//! `serve`: a trained ado answers another simulator as it plays at home.

use std::io::Write;
use std::process::{Command, Output, Stdio};

use brakecheck::run_dir::RunDir;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::Aftermath;
use serde_json::{Value, json};

use super::{brakecheck, code, path, refusal, scratch, small_run, stderr};

/// Says all lines at once, and reads what is answered.
fn say(args: &[&str], lines: &[u8]) -> (Output, Vec<Value>) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_brakecheck"))
        .arg("serve")
        .args(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut stdin = child.stdin.take().expect("a pipe");
    // Whoever ends early does not read the rest.
    let _ = stdin.write_all(lines);
    drop(stdin);
    let output = child.wait_with_output().expect("it ends");
    let text = String::from_utf8(output.stdout.clone()).expect("text");
    let answers = text
        .lines()
        .map(serde_json::from_str)
        .collect::<Result<_, _>>()
        .expect("JSON lines");
    (output, answers)
}

fn lines(messages: &[Value]) -> Vec<u8> {
    let lines = messages.iter().map(|message| format!("{message}\n"));
    lines.collect::<String>().into_bytes()
}

#[test]
fn a_served_ado_decides_as_at_home_to_the_bit() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let kept = RunDir::open(run.as_ref()).expect("a run");
    let (world, policy) = (kept.scenario().expect("it"), kept.policy().expect("it"));
    let mut bench = world.bench();
    let names: Vec<String> = world
        .world()
        .observed()
        .iter()
        .map(|it| it.name.clone())
        .collect();
    let mut obs = vec![0.0; names.len()];
    let (mut asked, mut wanted) = (Vec::new(), Vec::new());
    for index in 0..6 {
        let (purpose, seed) = (Purpose::Train, 5);
        let key = StartKey {
            purpose,
            seed,
            index,
        };
        bench.begin(&bench.draw(key), bench.noise_of(key), Aftermath::Skip);
        asked.push(json!({ "id": format!("reset {index}"), "reset": {} }));
        wanted.push(json!({ "id": format!("reset {index}"), "ready": true }));
        while !bench.is_done() {
            bench.observe(&mut obs);
            let (action, last) = (policy.act(&obs), bench.trace().len() - 1);
            let signals: serde_json::Map<String, Value> = names
                .iter()
                .filter(|name| index % 2 == 0 || *name != "time_left")
                .map(|name| {
                    let column = bench.trace().signal(name).expect("published");
                    (name.clone(), json!(column[last]))
                })
                .collect();
            let accel_mps2 = [-3.0, 0.0, 3.0][action];
            asked.push(json!({ "id": wanted.len(), "decide": signals, "ignored": 1 }));
            wanted.push(json!({
                "id": wanted.len(), "action": action, "label": world.world().action_label(action),
                "value": policy.value(&obs),
                "ados": { "ado": { "accel_mps2": accel_mps2, "lateral_mps": 0.0 } },
            }));
            bench.decide(action);
        }
    }
    let (output, answers) = say(&[&run], &lines(&asked));
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(answers.len(), wanted.len());
    for (answer, want) in answers.iter().zip(&wanted) {
        assert_eq!(answer, want);
    }
    let different: std::collections::BTreeSet<_> = answers
        .iter()
        .filter_map(|answer| answer["action"].as_u64())
        .collect();
    assert!(different.len() > 1, "{different:?}");
    let counted = format!("{} decisions, 0 messages", wanted.len() - 6);
    assert!(stderr(&output).contains(&counted), "{}", stderr(&output));
}

#[test]
fn hello_tells_what_to_give_and_mistakes_are_answered() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let signals = json!({ "headway": 20, "ego.speed": 10, "ado.speed": 9, "ego.accel": 0 });
    let (output, answers) = say(
        &[&run],
        &lines(&[
            json!({ "hello": { "protocol": 1 } }),
            json!({ "hello": { "protocol": 2 } }),
            json!({ "id": 7, "decide": { "headway": 20.0 } }),
            json!({ "id": 8, "decide": { "headway": "near" } }),
            json!({ "id": 9, "frobnicate": {} }),
            json!({ "decide": signals }),
            json!({ "close": {} }),
            json!({ "decide": signals }),
        ]),
    );
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(answers.len(), 6, "nothing is answered after close");
    let hello = &answers[0]["hello"];
    assert_eq!(
        (&hello["protocol"], &hello["decision_s"]),
        (&json!(1), &json!(0.5))
    );
    assert_eq!(hello["observe"][0]["name"], "headway");
    assert_eq!(hello["observe"][1]["unit"], "m/s");
    assert_eq!(hello["actions"][2]["ados"]["ado"]["accel_mps2"], 3.0);
    assert_eq!(hello["neutral"], 1);
    let errors: Vec<&str> = answers[1..5]
        .iter()
        .map(|answer| answer["error"].as_str().expect("an error"))
        .collect();
    assert!(
        errors[0].contains("say hello with protocol 1"),
        "{errors:?}"
    );
    assert_eq!(
        errors[1],
        "the ado also observes `ego.speed`, `ado.speed`, `ego.accel`"
    );
    assert_eq!(errors[2], "`headway` is no number");
    assert_eq!(errors[3], "known: hello, reset, decide, sample, close");
    assert_eq!(answers[2]["id"], 7);
    assert!(answers[5]["action"].is_u64() && answers[5].get("id").is_none());
    assert!(
        stderr(&output).contains("1 decision, 4 messages"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn what_is_no_message_and_what_is_no_ado_end_with_2() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let long = vec![b' '; 70_000];
    // The limit is within the last character.
    let cut = " ".repeat(65_536) + "é\n";
    let cases: [(&[u8], &str); 6] = [
        (
            b"{\"reset\": {}}\nnonsense\n{\"reset\": {}}\n",
            "line 2 is no message",
        ),
        (b"[1]\n", "line 1 is no message"),
        (b"{\"reset\": \"\xff\"}\n", "not UTF-8"),
        (&long, "longer than 65536 bytes"),
        (cut.as_bytes(), "longer than 65536 bytes"),
        (
            b"{\"reset\": {\"index\": 0, \"step_s\": NaN}}\n",
            "JSON has no NaN",
        ),
    ];
    for (said, why) in cases {
        let (output, answers) = say(&[&run], said);
        refusal(&output, why);
        assert!(answers.last().expect("said")["error"].is_string());
    }
    let none = path(&dir, "none");
    let output = brakecheck(&["serve", &none]);
    refusal(&output, "brakecheck train");
    assert!(output.stdout.is_empty());
}

#[test]
fn a_line_of_the_greatest_length_and_a_message_of_two_kinds_are_answered_once() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut hello = json!({ "hello": { "protocol": 1 }, "decide": {} }).to_string();
    hello.push_str(&" ".repeat(65_536 - hello.len()));
    let (output, answers) = say(&[&run], format!("{hello}\n").as_bytes());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(answers.len(), 1);
    assert!(answers[0]["hello"].is_object());
    // Only `hello` was answered.
    let said = stderr(&output);
    assert!(said.contains("0 decisions, 0 messages"), "{said}");
}

#[test]
fn a_simulator_that_reads_no_answers_ends_it_with_3() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_brakecheck"))
        .args(["serve", "acc"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    drop(child.stdout.take());
    let mut stdin = child.stdin.take().expect("a pipe");
    // The answer to the message has no reader.
    let _ = stdin.write_all(&lines(&[json!({ "hello": { "protocol": 1 } })]));
    drop(stdin);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("the other side is gone"), "{said}");
}
