//! Sessions with a language whose mistake is the word `bad`.

use std::io::Cursor as Input;

use serde_json::{Value, json};

use crate::frame::{read_frame, write_frame};
use crate::language::{CheckedText, KnownName, WorldLanguage, WorldProblem};
use crate::session::{SessionEnd, serve};

struct BadWords(Value);

impl WorldLanguage for BadWords {
    fn check(&self, _: &str, text: &str) -> Option<CheckedText> {
        // Like that of worlds, it leaves the mark out, and a file stands for its name.
        let own = text.strip_prefix('\u{feff}').unwrap_or(text);
        let whole = own.replace("\"f.ron\"", "Rule(bad), Rule(2)");
        let problem = |(at, word): (usize, &str)| WorldProblem {
            what: format!("`{word}` is bad"),
            help: Some("write `good`".to_owned()),
            span: at..at + word.len(),
            is_warning: false,
        };
        let problems: Vec<WorldProblem> = whole.match_indices("bad").map(problem).collect();
        let is_sound = problems.is_empty();
        own.contains('(').then(|| CheckedText {
            text: whole,
            problems,
            names: is_sound.then(|| {
                vec![KnownName {
                    name: "ego.speed".to_owned(),
                    unit: "m/s".to_owned(),
                    about: "speed".to_owned(),
                }]
            }),
        })
    }

    fn schema(&self) -> &Value {
        &self.0
    }

    fn stock_names(&self, _: &str) -> Vec<String> {
        Vec::new()
    }
}

/// The messages of the server to raw input, and the end of the session.
fn replies_to(input: Vec<u8>) -> (Vec<Value>, SessionEnd) {
    let language = BadWords(crate::shapes::tests::schema());
    let mut output = Vec::new();
    let end = serve(Input::new(input), &mut output, &language).expect("written");
    let mut output = Input::new(output);
    let mut replies = Vec::new();
    while let Some(message) = read_frame(&mut output).expect("a frame") {
        replies.push(serde_json::from_slice(&message).expect("JSON"));
    }
    (replies, end)
}

fn framed(messages: &[Value]) -> Vec<u8> {
    let mut input = Vec::new();
    for message in messages {
        write_frame(&mut input, &message.to_string()).expect("written");
    }
    input
}

fn request(id: i64, method: &str, params: Value) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params })
}

fn notification(method: &str, params: Value) -> Value {
    json!({ "jsonrpc": "2.0", "method": method, "params": params })
}

fn opened(text: &str) -> Value {
    let document =
        json!({ "uri": "file:///w.ron", "languageId": "ron", "version": 1, "text": text });
    notification("textDocument/didOpen", json!({ "textDocument": document }))
}

fn begin() -> Value {
    request(0, "initialize", json!({ "capabilities": {} }))
}

/// Ranges of the last diagnostics for one open text, as `line:from-line:to`.
#[track_caller]
fn ranges(text: &str) -> Vec<String> {
    let (replies, _) = replies_to(framed(&[begin(), opened(text)]));
    let mut all = replies
        .iter()
        .filter(|it| it["method"] == "textDocument/publishDiagnostics");
    let Some(last) = all.next_back() else {
        return vec!["none".to_owned()];
    };
    let list = last["params"]["diagnostics"].as_array().expect("a list");
    let place = |it: &Value| format!("{}:{}", it["line"], it["character"]);
    list.iter()
        .map(|it| {
            format!(
                "{}-{}",
                place(&it["range"]["start"]),
                place(&it["range"]["end"])
            )
        })
        .collect()
}

#[test]
fn problems_have_their_places() {
    let none: [&str; 0] = [];
    assert_eq!(ranges("S(bad)"), ["0:2-0:5"]);
    assert_eq!(ranges("S(\n  é𝄞 bad,\n bad)"), ["1:6-1:9", "2:1-2:4"]);
    assert_eq!(ranges("\u{feff}S(bad)"), ["0:3-0:6"]);
    assert_eq!(ranges("\u{feff}S(\r\n bad)"), ["1:1-1:4"]);
    assert_eq!(
        ranges("S(\n a: [\"f.ron\"], b: bad,\n)"),
        ["1:5-1:12", "1:18-1:21"]
    );
    assert_eq!(
        ranges("\u{feff}S(a: [\"f.ron\"], b: bad)"),
        ["0:7-0:14", "0:20-0:23"]
    );
    assert_eq!(ranges("S(good)"), none);
}

fn result_of(replies: &[Value], id: i64) -> &Value {
    let reply = replies.iter().find(|it| it["id"] == id);
    &reply.expect("an answer")["result"]
}

fn at(line: u32, character: u32) -> Value {
    json!({
        "textDocument": { "uri": "file:///w.ron" },
        "position": { "line": line, "character": character },
    })
}

#[test]
fn edits_hover_and_completion_follow_the_text() {
    let edit = json!({
        "textDocument": { "uri": "file:///w.ron", "version": 2 },
        "contentChanges": [{
            "range": { "start": { "line": 0, "character": 2 }, "end": { "line": 0, "character": 5 } },
            "text": "plant: R",
        }],
    });
    let (replies, end) = replies_to(framed(&[
        begin(),
        opened("S(bad)"),
        notification("textDocument/didChange", edit),
        request(1, "textDocument/hover", at(0, 4)),
        request(2, "textDocument/completion", at(0, 10)),
        request(3, "textDocument/hover", at(0, 99)),
        request(4, "shutdown", Value::Null),
        notification("exit", Value::Null),
    ]));
    assert_eq!(end, SessionEnd::Orderly);
    let hover = result_of(&replies, 1);
    let markdown = hover["contents"]["value"].as_str().expect("markdown");
    assert!(markdown.starts_with("`plant`: one of Rigid"), "{markdown}");
    assert_eq!(hover["range"]["start"]["character"], 2);
    let items = result_of(&replies, 2)["items"].as_array().expect("items");
    assert_eq!(items[0]["textEdit"]["newText"], "Rigid");
    assert_eq!(items[0]["textEdit"]["range"]["start"]["character"], 9);
    assert_eq!(result_of(&replies, 3), &Value::Null);
}

#[test]
fn edits_that_would_take_hours_close_the_document() {
    let large = "good\n".repeat(200_000);
    let edit = json!({ "range": { "start": { "line": 9, "character": 0 },
        "end": { "line": 9, "character": 1 } }, "text": "b" });
    let edits = |count: usize| {
        let document = json!({ "uri": "file:///w.ron", "version": 2 });
        let changes = json!({ "textDocument": document, "contentChanges": vec![&edit; count] });
        notification("textDocument/didChange", changes)
    };
    let warned = |count: usize| -> Vec<String> {
        let (replies, _) = replies_to(framed(&[begin(), opened(&large), edits(count)]));
        let shown = replies
            .iter()
            .filter_map(|it| it["params"]["message"].as_str());
        shown.map(str::to_owned).collect()
    };
    assert_eq!(
        warned(2000),
        ["2000 edits of a world of 1002000 bytes at once: open it again"]
    );
    assert_eq!(warned(2), [""; 0]);
}

#[test]
fn problems_disappear_with_their_cause() {
    let document = json!({ "textDocument": { "uri": "file:///w.ron" } });
    let whole = |text: &str| {
        let mut change = document.clone();
        change["contentChanges"] = json!([{ "text": text }]);
        notification("textDocument/didChange", change)
    };
    let close = notification("textDocument/didClose", document.clone());
    let shown = |messages: &[Value]| -> Vec<usize> {
        let (replies, _) = replies_to(framed(messages));
        let lists = replies
            .iter()
            .filter_map(|it| it["params"]["diagnostics"].as_array());
        lists.map(Vec::len).collect()
    };
    assert_eq!(
        shown(&[begin(), opened("S(bad"), whole("S(good")]).last(),
        Some(&0)
    );
    assert_eq!(shown(&[begin(), opened("no world, bad")]), [0usize; 0]);
    // The check may come before the end of the document, whose problems then disappear.
    let closed = shown(&[begin(), opened("S(bad"), close]);
    assert!(matches!(closed[..], [] | [.., 0]), "{closed:?}");
}

#[test]
fn wrong_messages_are_refused_and_the_session_goes_on() {
    let cases = [
        ("{", -32700),
        ("\u{0}", -32700),
        ("[]", -32600),
        ("[{\"id\": 1}]", -32600),
        ("{}", -32600),
        ("{\"id\": {}, \"method\": \"x\"}", -32600),
        ("{\"id\": 1, \"method\": 2}", -32600),
        ("{\"id\": 7, \"method\": \"unknown\"}", -32601),
        ("{\"id\": 7, \"method\": \"textDocument/hover\"}", -32602),
        (
            "{\"id\": 7, \"method\": \"textDocument/hover\", \"params\": {\"position\": -1}}",
            -32602,
        ),
        ("{\"id\": 7, \"method\": \"initialize\"}", -32601),
    ];
    for (message, code) in cases {
        let mut input = framed(&[begin()]);
        write_frame(&mut input, message).expect("written");
        input.extend(framed(&[request(9, "shutdown", Value::Null)]));
        let (replies, end) = replies_to(input);
        assert_eq!(end, SessionEnd::Abrupt);
        let [_, refused, after] = &replies[..] else {
            panic!("{message}: {replies:?}");
        };
        assert_eq!(refused["error"]["code"], code, "{message}: {refused}");
        assert_eq!(after["id"], 9, "{message}");
    }
}

#[test]
fn requests_need_a_session() {
    let hover = request(1, "textDocument/hover", at(0, 0));
    let (replies, end) = replies_to(framed(&[hover.clone(), notification("exit", Value::Null)]));
    assert_eq!(replies[0]["error"]["code"], -32002);
    assert_eq!(end, SessionEnd::Abrupt);
    let (replies, _) = replies_to(framed(&[
        begin(),
        request(2, "shutdown", Value::Null),
        hover,
    ]));
    assert_eq!(replies[2]["error"]["code"], -32600);
    // Silent: cancellations, answers and unknown notifications.
    let (replies, _) = replies_to(framed(&[
        begin(),
        notification("$/cancelRequest", json!({ "id": 0 })),
        json!({ "jsonrpc": "2.0", "id": 3, "result": null }),
        notification("unknown", Value::Null),
        notification("textDocument/didOpen", Value::Null),
    ]));
    assert_eq!(replies.len(), 1);
}

#[test]
fn any_bytes_end_in_answers() {
    // A fixed linear congruence, so that a failure comes again.
    let mut state = 7u64;
    let mut next = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize
    };
    let sound = framed(&[
        begin(),
        opened("S(plant: Rigid, ego_spec: \"always (ego.speed > 0)\")"),
        request(1, "textDocument/completion", at(0, 9)),
        request(2, "shutdown", Value::Null),
    ]);
    for _ in 0..2000 {
        let mut input = sound.clone();
        for _ in 0..1 + next() % 5 {
            let place = next() % input.len();
            match next() % 4 {
                0 => input[place] = next() as u8,
                1 => input.truncate(place + 1),
                2 => drop(input.remove(place)),
                _ => input.insert(place, b"(\"{[:,\r\n0"[next() % 9]),
            }
            if input.is_empty() {
                break;
            }
        }
        let _ = replies_to(input);
    }
    for _ in 0..200 {
        let bytes = (0..next() % 300).map(|_| next() as u8).collect();
        let _ = replies_to(bytes);
    }
}
