//! `lsp`: an editor of world files, over the pipes of the program.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use super::{brakecheck, path, root, scratch};

/// Server with its pipes, as an editor holds it.
struct Editor {
    server: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Editor {
    /// Starts the server and initializes it.
    fn open(dir: &Path) -> Editor {
        let mut server = Command::new(env!("CARGO_BIN_EXE_brakecheck"))
            .args(["lsp", "--stdio"])
            .current_dir(dir)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it starts");
        let to = server.stdin.take().expect("a pipe");
        let from = BufReader::new(server.stdout.take().expect("a pipe"));
        let mut editor = Editor { server, to, from };
        let capabilities = editor.request("initialize", json!({ "capabilities": {} }));
        assert_eq!(
            capabilities["capabilities"]["textDocumentSync"]["change"],
            2
        );
        editor.notify("initialized", json!({}));
        editor
    }

    fn send(&mut self, message: &Value) {
        let text = message.to_string();
        write!(self.to, "Content-Length: {}\r\n\r\n{text}", text.len()).expect("sent");
        self.to.flush().expect("sent");
    }

    fn notify(&mut self, method: &str, params: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    /// The next message of the server.
    fn next(&mut self) -> Value {
        let mut line = String::new();
        self.from.read_line(&mut line).expect("a header");
        let length = line.trim().strip_prefix("Content-Length: ");
        let length: usize = length.expect("a length").parse().expect("a number");
        let mut text = vec![0; length + 2];
        self.from.read_exact(&mut text).expect("a message");
        serde_json::from_slice(&text).expect("JSON")
    }

    fn request(&mut self, method: &str, params: Value) -> Value {
        self.send(&json!({ "jsonrpc": "2.0", "id": method, "method": method, "params": params }));
        loop {
            let message = self.next();
            if message["id"] == method {
                return message["result"].clone();
            }
        }
    }

    /// Opens a file with a text, and returns the diagnostics.
    fn show(&mut self, file: &str, text: &str) -> Vec<Value> {
        let uri = format!("file://{file}");
        let document = json!({ "uri": uri, "languageId": "ron", "version": 1, "text": text });
        self.notify("textDocument/didOpen", json!({ "textDocument": document }));
        self.diagnostics(&uri)
    }

    fn diagnostics(&mut self, uri: &str) -> Vec<Value> {
        loop {
            let message = self.next();
            if message["method"] == "textDocument/publishDiagnostics" {
                assert_eq!(message["params"]["uri"], uri);
                let list = message["params"]["diagnostics"].as_array();
                return list.expect("a list").clone();
            }
        }
    }

    /// The exit code after `exit`.
    fn exit(mut self) -> Option<i32> {
        self.notify("exit", Value::Null);
        self.server.wait().expect("it ends").code()
    }
}

fn line_column(diagnostic: &Value) -> (u64, u64) {
    let start = &diagnostic["range"]["start"];
    let number = |key: &str| start[key].as_u64().expect("a number") + 1;
    (number("line"), number("character"))
}

/// Place of a text in another, as the protocol counts, behind `into` bytes of it.
fn at(file: &str, text: &str, wanted: &str, into: usize) -> Value {
    let byte = text.find(wanted).expect(wanted) + into;
    let before = &text[..byte];
    let line = before.matches('\n').count();
    let column = before.rsplit('\n').next().map_or(0, str::len);
    json!({
        "textDocument": { "uri": format!("file://{file}") },
        "position": { "line": line, "character": column },
    })
}

const ACC: &str = include_str!("../../worlds/acc.ron");

#[test]
fn an_editor_shows_the_problems_of_check_at_their_places() {
    let dir = scratch();
    let file = path(&dir, "acc.ron");
    let broken = [
        ACC.replace("horizon_s: 15.0", "horizon: 15.0"),
        ACC.replace("\"sedan\"", "\"sedna\""),
        ACC.replace("always[0, T] (headway", "always[0, T] (hedway"),
        ACC.replacen("Scenario(", "Scenaro(", 1),
    ];
    let mut editor = Editor::open(dir.path());
    for text in &broken {
        assert_ne!(text, ACC);
        std::fs::write(&file, text).expect("written");
        let wanted = super::json(&brakecheck(&["check", &file, "--json"]));
        let wanted = wanted["problems"].as_array().expect("a list");
        let shown = editor.show(&file, text);
        assert_eq!(shown.len(), wanted.len(), "{shown:?}");
        for (one, wanted) in shown.iter().zip(wanted) {
            let number = |key: &str| wanted[key].as_u64().expect("a number");
            assert_eq!(
                line_column(one),
                (number("line"), number("column")),
                "{one}"
            );
            let message = one["message"].as_str().expect("a text");
            let what = wanted["what"].as_str().expect("a text");
            assert!(message.starts_with(what), "{message}");
            let help = wanted["help"].as_str().unwrap_or_default();
            assert!(message.ends_with(help), "{message}");
            assert_eq!(one["severity"], 1);
        }
    }
    // A mark at the start moves no line, and one column of the first.
    let world = &ACC[ACC.find("Scenario(").expect("there")..];
    let marked = format!("\u{feff}{}", world.replacen("Scenario(", "Scenaro(", 1));
    let shown = editor.show(&path(&dir, "marked.ron"), &marked);
    assert_eq!(line_column(&shown[0]), (1, 2), "{shown:?}");
    // Repaired: the worlds' warnings remain.
    let uri = format!("file://{file}");
    let change = json!({
        "textDocument": { "uri": uri, "version": 2 },
        "contentChanges": [{ "text": ACC }],
    });
    editor.notify("textDocument/didChange", change);
    let shown = editor.diagnostics(&uri);
    assert_eq!(shown, [] as [Value; 0]);
    editor.request("shutdown", Value::Null);
    assert_eq!(editor.exit(), Some(0));
}

#[test]
fn a_problem_of_an_included_file_is_at_its_name() {
    let dir = scratch();
    let file = path(&dir, "mine.ron");
    let text = ACC.replacen("rulebook: [", "rulebook: [\"rules.ron\", ", 1);
    let rules = "RuleFile(rules: [\n    Rule(name: \"a\", stl: \"ado.speed >\"),\n])";
    std::fs::write(path(&dir, "rules.ron"), rules).expect("written");
    let mut editor = Editor::open(dir.path());
    let shown = editor.show(&file, &text);
    let message = shown[0]["message"].as_str().expect("a text");
    assert!(message.contains("rules.ron"), "{message}");
    let line = text.lines().position(|line| line.contains("rules.ron"));
    assert_eq!(line_column(&shown[0]).0 as usize, line.expect("there") + 1);
    // A sound file moves the problems behind it in its line, and the editor sees no such move.
    let rules = rules.replace("ado.speed >", "ado.speed > -100");
    std::fs::write(path(&dir, "rules.ron"), rules).expect("written");
    let wrong = text.replacen(
        "\"rules.ron\", ",
        "\"rules.ron\", Rule(name: \"x\", stl: \"sped > 1\"), ",
        1,
    );
    let shown = editor.show(&path(&dir, "wrong.ron"), &wrong);
    let place = at("", &wrong, "sped > 1", 0);
    let found = shown
        .iter()
        .find(|it| it["message"].as_str().is_some_and(|it| it.contains("sped")));
    let start = found.map(|it| &it["range"]["start"]);
    assert_eq!(start, Some(&place["position"]), "{shown:?}");
    // Without `shutdown`, the code is that of a broken session.
    assert_eq!(editor.exit(), Some(1));
}

#[test]
fn fields_variants_and_signals_are_explained_and_completed() {
    let dir = scratch();
    let file = path(&dir, "acc.ron");
    let mut editor = Editor::open(dir.path());
    editor.show(&file, ACC);
    let mut hover = |wanted: &str, into| {
        let answer = editor.request("textDocument/hover", at(&file, ACC, wanted, into));
        answer["contents"]["value"]
            .as_str()
            .unwrap_or_default()
            .to_owned()
    };
    let field = hover("horizon_s", 2);
    assert!(field.starts_with("`horizon_s`: number in s\n\n"), "{field}");
    let variant = hover("UntilViolation", 2);
    assert!(variant.starts_with("`UntilViolation`"), "{variant}");
    let signal = hover("ego.speed", 2);
    assert!(signal.starts_with("`ego.speed` in m/s\n\n"), "{signal}");
    assert_eq!(hover("// ", 1), "");
    let mut labels = |wanted: &str, into| {
        let answer = editor.request("textDocument/completion", at(&file, ACC, wanted, into));
        let items = answer["items"].as_array().expect("items").clone();
        let label = |item: &Value| item["label"].as_str().expect("a text").to_owned();
        items.iter().map(label).collect::<Vec<String>>()
    };
    let fields = labels("    question:", 0);
    assert!(fields.contains(&"wind".to_owned()), "{fields:?}");
    assert!(!fields.contains(&"clock".to_owned()), "{fields:?}");
    let kinds = labels("Vehicle(", 0);
    assert!(kinds.contains(&"Pedestrian".to_owned()), "{kinds:?}");
    let egos = labels("drive: Ego(", "drive: Ego(".len());
    assert!(egos.contains(&"IsoAcc".to_owned()), "{egos:?}");
    let bodies = labels("\"sedan\"", 1);
    assert!(bodies.contains(&"van".to_owned()), "{bodies:?}");
    let signals = labels("headway >=", 1);
    assert!(signals.contains(&"ego.speed".to_owned()), "{signals:?}");
    editor.request("shutdown", Value::Null);
    assert_eq!(editor.exit(), Some(0));
}

#[test]
fn files_that_are_no_worlds_are_left_alone_and_no_program_starts() {
    let dir = scratch();
    let mut editor = Editor::open(dir.path());
    let (other, world) = (path(&dir, "other.ron"), path(&dir, "world.ron"));
    let uri = format!("file://{other}");
    let document = json!({ "uri": uri, "languageId": "ron", "version": 1, "text": "Rules(a: 1)" });
    editor.notify("textDocument/didOpen", json!({ "textDocument": document }));
    let proof = path(&dir, "started");
    let start = ACC.find("drive: Ego(").expect("there") + "drive: Ego(".len();
    let length = ACC[start..].find("))").expect("there") + 1;
    let program = format!("Process(command: [\"touch\", {proof:?}])");
    // Without the changed egos, whose parameters a program has not.
    let end = ACC.find("    learner: ").expect("there");
    let text = format!("{}{program}{})", &ACC[..start], &ACC[start + length..end]);
    // The first diagnostics are those of the world: the other file has none.
    let shown = editor.show(&world, &text);
    let errors: Vec<&Value> = shown.iter().filter(|it| it["severity"] == 1).collect();
    assert!(errors.is_empty(), "{errors:?}");
    assert!(!Path::new(&proof).exists(), "a program was started");
    editor.request("shutdown", Value::Null);
    assert_eq!(editor.exit(), Some(0));
}

/// Sends bytes after the first message, and returns the exit code and the answers.
fn hostile(bytes: &[u8]) -> (Option<i32>, String) {
    let mut editor = Editor::open(root());
    // A server that ends early does not read the rest.
    let _ = editor.to.write_all(bytes);
    drop(editor.to);
    let mut answers = String::new();
    editor.from.read_to_string(&mut answers).expect("text");
    (editor.server.wait().expect("it ends").code(), answers)
}

#[test]
fn hostile_frames_are_answered_or_end_the_session() {
    let framed = |text: &str| format!("Content-Length: {}\r\n\r\n{text}", text.len()).into_bytes();
    let deep = "[".repeat(100_000);
    let open = |text: &str| {
        let document = json!({ "uri": "file:///w.ron", "text": text });
        let params = json!({ "textDocument": document });
        json!({ "method": "textDocument/didOpen", "params": params }).to_string()
    };
    let cases: [(Vec<u8>, &str); 12] = [
        (
            b"Content-Length: 18446744073709551615\r\n\r\n{}".to_vec(),
            "of at most",
        ),
        (b"Content-Length: -5\r\n\r\n".to_vec(), "no length"),
        (b"Content-Length: 9\r\n\r\n{}".to_vec(), "ends within"),
        (b"X: 1\r\n\r\n".to_vec(), "no `Content-Length`"),
        (vec![b'a'; 1 << 20], "a line of more"),
        (
            "A: b\r\n".repeat(100_000).into_bytes(),
            "more than 16 lines",
        ),
        (framed(&deep), "-32700"),
        (framed("{\"id\": 1, \"method\": \"unknown\"}"), "-32601"),
        (framed("{\"id\": [], \"method\": \"exit\"}"), "-32600"),
        (framed("\"\\ud800\""), "error"),
        (
            framed(&open(&format!("Scenario({}", "(".repeat(1 << 20)))),
            "publishDiagnostics",
        ),
        (
            framed(&open("Scenario(\u{0}\u{feff}")),
            "publishDiagnostics",
        ),
    ];
    for (bytes, says) in cases {
        let (code, answers) = hostile(&bytes);
        assert_eq!(code, Some(1), "{says}");
        assert!(answers.contains(says), "{says}: {answers}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn large_messages_take_no_memory() {
    let mut editor = Editor::open(root());
    let peak_kib = |server: &Child| -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", server.id()));
        let status = status.expect("a process");
        let line = status.lines().find(|line| line.starts_with("VmHWM:"));
        let number = line.and_then(|line| line.split_whitespace().nth(1));
        number.expect("a peak").parse().expect("a number")
    };
    let before_kib = peak_kib(&editor.server);
    let bytes = 256 << 20;
    write!(editor.to, "Content-Length: {bytes}\r\n\r\n").expect("sent");
    let part = vec![b' '; 1 << 20];
    for _ in 0..256 {
        editor.to.write_all(&part).expect("sent");
    }
    editor.request("shutdown", Value::Null);
    let grown_kib = peak_kib(&editor.server) - before_kib;
    assert!(grown_kib < 32 << 10, "{grown_kib} KiB");
    assert_eq!(editor.exit(), Some(0));
}
