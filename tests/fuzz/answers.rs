//! What a program answers: a command or a named fault, whatever the bytes.
#![cfg(unix)]

use std::path::Path;

use brakecheck::ego::{Command, Controller, Fault, FaultKind, Percept, Process};
use proptest::prelude::*;
use proptest::sample::select;
use serde_json::Value;

use super::corpus::Source;
use super::harness::{Bytes, Seen, Target};
use super::mutate::mutants;

/// Longer than any machine is late: no case waits for it.
const PATIENT_S: f64 = 60.0;
/// Longest line of docs/reference/ego-protocol.md.
const LONGEST: usize = 65_536;

/// A program that answers each question with the bytes of a file, and ends
/// after the fourth, or after one whose line does not end: nobody waits.
fn program(dir: &Path) -> Process {
    let script = "cd \"$0\" && for answer in hello reset first second; do \
                  read -r line || exit; cat $answer; [ ! -e $answer.last ] || exit; done";
    let dir = dir.to_str().expect("a path");
    let mut process = Process::new(["sh", "-c", script, dir]);
    process.timeout_s = PATIENT_S;
    process.allow(true);
    process
}

const HELLO: &str =
    "{\"hello\":{\"protocol\":1,\"name\":\"fake\",\"capabilities\":[\"snapshot\"]}}\n";
const READY: &str = "{\"id\":1,\"ready\":true}\n";
const COAST: &str = "{\"id\":3,\"accel_mps2\":0.5}\n";

/// Answers to the four questions.
fn answers() -> Vec<Source> {
    let steps = [
        "{\"id\":2,\"accel_mps2\":-1.5,\"lateral_mps\":0.25}\n",
        "{\"id\": 2, \"accel_mps2\": 2, \"more\": [1, {\"deep\": null}], \"error\": null}\n",
        "{\"id\":2,\"error\":\"lost the lane\"}\n",
        "{\"accel_mps2\":-19.99,\"id\":2}\r\n",
        "[2,-1.5,0.25]\n",
        "{\"id\":2}\n",
        "{\"id\":2,\"lateral_mps\":1.0,\"accel_mps2\":null}\n",
        "{\"id\":2,\"accel_mps2\":1}\n{\"id\":3,\"accel_mps2\":9}\n",
        "{\"id\":2,\"accel_mps2\":-1e1,\"lateral_mps\":-0}\n",
    ];
    let mut list = vec![Source::new("hello", HELLO), Source::new("reset", READY)];
    list.extend(steps.map(|text| Source::new("first", text)));
    // Longer than what is shown of it, and its bytes are not its characters.
    list.push(Source::new("first", format!("x{}\n", "é".repeat(100))));
    list
}

/// What stands in an answer's place: a text, damaged or not, or raw bytes.
fn bytes() -> impl Strategy<Value = (&'static str, String, Bytes)> {
    let named = |shown: String, name: &str, bytes: Vec<u8>| {
        let name = ["hello", "reset"].into_iter().find(|known| *known == name);
        (name.unwrap_or("first"), shown, Bytes(bytes))
    };
    let list = answers();
    let texts = mutants(list.clone().into()).prop_map(move |mutant| {
        let bytes = mutant.text.clone().into_bytes();
        let source = ["hello", "reset"].map(|name| Source::new(name, ""));
        let name = source.iter().find(|source| mutant.is_of(source));
        named(
            format!("{mutant:?}"),
            name.map_or("first", |source| &source.name),
            bytes,
        )
    });
    let good =
        select(list).prop_map(move |source| named(String::new(), &source.name, source.text.into()));
    let name = || select(vec!["hello", "reset", "first"]);
    let raw = (name(), prop::collection::vec(any::<u8>(), 0..60)).prop_map(|(name, mut bytes)| {
        bytes.push(b'\n');
        (name, "raw".to_owned(), Bytes(bytes))
    });
    let long = (
        name(),
        0..3usize,
        select(vec![0, 1, 4096, LONGEST - 40, LONGEST, 70_000, 200_000]),
    )
        .prop_map(|(name, shape, length)| {
            let filler = |c: char| c.to_string().repeat(length);
            let text = match shape {
                0 => format!(
                    "{{\"id\":2,\"accel_mps2\":1,\"more\":\"{}\"}}\n",
                    filler('x')
                ),
                1 => format!("{}\n", filler('[')),
                _ => format!("x{}\n", filler('é')),
            };
            (name, format!("{length} long"), Bytes(text.into_bytes()))
        });
    prop_oneof![8 => texts, 3 => good, 2 => raw, 1 => long]
}

/// What the document says of an answer to question 2, read as any JSON.
fn by_the_document(line: &[u8]) -> Result<Option<(f64, f64)>, FaultKind> {
    let unsure = |line: &[u8]| {
        // A key that is given twice is not spoken of.
        let text = String::from_utf8_lossy(line).into_owned();
        ["\"id\"", "\"accel_mps2\"", "\"lateral_mps\"", "\"error\""]
            .iter()
            .any(|key| text.matches(key).count() > 1)
    };
    let Ok(Value::Object(answer)) = serde_json::from_slice(line) else {
        return Err(FaultKind::Protocol);
    };
    if unsure(line) {
        return Ok(None);
    }
    let given = |key: &str| answer.get(key).filter(|value| !value.is_null());
    if answer.get("id").and_then(Value::as_u64) != Some(2) {
        return Err(FaultKind::Protocol);
    }
    let number = |key: &str| match given(key) {
        None => Ok(None),
        Some(value) => value.as_f64().map(Some).ok_or(FaultKind::Protocol),
    };
    let (accel, lateral) = (number("accel_mps2")?, number("lateral_mps")?);
    if answer.get("lateral_mps").is_some_and(Value::is_null) {
        return Err(FaultKind::Protocol);
    }
    match given("error") {
        Some(Value::String(_)) => return Err(FaultKind::Error),
        Some(_) => return Err(FaultKind::Protocol),
        None => {}
    }
    let accel = accel.ok_or(FaultKind::Protocol)?;
    Ok(Some((accel, lateral.unwrap_or(0.0))))
}

/// The faults that a program which says something wrong and ends may meet.
const FAULTS: [FaultKind; 3] = [FaultKind::Protocol, FaultKind::Ended, FaultKind::Error];

fn named(fault: &Fault) {
    assert!(FAULTS.contains(&fault.kind), "{fault:?}");
    assert!(
        !fault.message.is_empty() && fault.message.len() < 2000,
        "{fault:?}"
    );
    assert!(!fault.message.contains('\n'), "{fault:?}");
}

#[test]
fn any_answer_is_a_command_or_a_named_fault() {
    let dir = tempfile::tempdir().expect("a directory");
    let write =
        |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).expect("written");
    let target = Target {
        name: "answer",
        cases: 150,
        // A program that hangs costs a minute each time.
        shrinks: 5,
        least_percent: (5, 30),
    };
    let percept = Percept {
        sample_s: 0.1,
        ..Percept::default()
    };
    target.run(&bytes(), |(name, _, Bytes(bytes))| {
        write("hello", HELLO.as_bytes());
        write("reset", READY.as_bytes());
        write("first", b"{\"id\":2,\"accel_mps2\":1}\n");
        write("second", COAST.as_bytes());
        write(name, bytes);
        for known in ["hello", "reset", "first"] {
            let last = dir.path().join(format!("{known}.last"));
            if known == *name && !bytes.contains(&b'\n') {
                std::fs::write(last, "").expect("written")
            } else {
                let _ = std::fs::remove_file(last);
            }
        }
        // Of its own pool: what waits there from a case before has ended.
        let mut ego = program(dir.path()).controller();
        ego.reset(5);
        let answer = ego.control(&percept);
        if let Err(fault) = &answer {
            named(fault);
        }
        let end = bytes.iter().position(|byte| *byte == b'\n');
        let (line, more) = bytes.split_at(end.unwrap_or(bytes.len()));
        if *name == "first" && line.len() < LONGEST {
            first_answer(&answer, line, end.is_some());
        }
        if line.len() > LONGEST {
            assert!(answer.is_err(), "a line of {} bytes", line.len());
        }
        let Ok(command) = answer else {
            return Seen::Refused;
        };
        // What is beyond any car is found where commands are used.
        let Command {
            accel_mps2,
            lateral_mps,
        } = command;
        let beyond = accel_mps2.abs() > 20.0 || lateral_mps.abs() > 20.0;
        assert_eq!(command.flaw().is_some(), beyond);
        // A second line comes unasked; a long one may still be on its way.
        let second = ego.control(&percept);
        match &second {
            Err(fault) => named(fault),
            Ok(command) => assert_eq!(*command, Command::accelerate(0.5)),
        }
        let unasked = more.len() > 1;
        assert!(!unasked || second.is_err(), "two answers to one question");
        assert!(unasked || second.is_ok(), "{second:?}");
        ego.finish();
        Seen::Accepted
    });
}

/// Readers of JSON take a list for an object; the document does not.
#[test]
fn a_list_is_no_answer() {
    let dir = tempfile::tempdir().expect("a directory");
    let answers = [
        ("hello", HELLO),
        ("reset", READY),
        ("first", " [2,-1.5,0.25]\n"),
    ];
    for (name, answer) in answers {
        std::fs::write(dir.path().join(name), answer).expect("written");
    }
    let mut ego = program(dir.path()).controller();
    ego.reset(5);
    let fault = ego.control(&Percept::default()).expect_err("a list");
    assert_eq!(fault.kind, FaultKind::Protocol, "{fault}");
    assert!(fault.message.contains("an answer is an object"), "{fault}");
}

fn first_answer(answer: &Result<Command, Fault>, line: &[u8], ended: bool) {
    if !ended {
        let kind = answer.as_ref().map_err(|fault| fault.kind);
        // The answer to the next question ends the line, or the program ends.
        assert!(
            matches!(kind, Err(FaultKind::Ended | FaultKind::Protocol)),
            "{answer:?}"
        );
        return;
    }
    match (by_the_document(line), answer) {
        (Err(kind), Err(fault)) => {
            let both = fault.kind == FaultKind::Error && kind == FaultKind::Protocol;
            assert!(fault.kind == kind || both, "{fault:?} and {kind:?}");
        }
        (Ok(Some((accel, lateral))), Ok(command)) => {
            let told = (command.accel_mps2, command.lateral_mps);
            assert_eq!(told, (accel, lateral));
        }
        (Ok(None), _) => {}
        (want, got) => panic!("{got:?} where the document says {want:?}"),
    }
}
