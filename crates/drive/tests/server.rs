//! The page's server: what a page gets, and who gets nothing.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use brakecheck_drive::drive::{DriveEnded, DriveSettings, Sandbox, serve};
use brakecheck_world::world::Scenario;
use serde_json::{Value, json};

/// Address of a served page: host and port, and the token.
struct Page {
    host: String,
    token: String,
}

fn served(test: impl FnOnce(&Page)) -> DriveEnded {
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    let sandbox = Sandbox::new(world, "ego").expect("a driving world");
    let dir = tempfile::tempdir().expect("a directory");
    let settings = DriveSettings {
        keep: dir.path().join("driven"),
        seed: 0,
        index: 0,
        watch: None,
    };
    let stop = AtomicBool::new(false);
    let (told, address) = channel();
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| {
            let ready = |address: &str| told.send(address.to_owned()).expect("a listener");
            serve(sandbox, settings, 0, &stop, &ready, &|_| {})
        });
        let address = address.recv().expect("an address");
        let rest = address.strip_prefix("http://").expect("http");
        let (host, token) = rest.split_once('/').expect("a token");
        // A test that fails must not leave the server running.
        struct Stop<'a>(&'a AtomicBool);
        impl Drop for Stop<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
            }
        }
        let _stop = Stop(&stop);
        test(&Page {
            host: host.to_owned(),
            token: token.trim_end_matches('/').to_owned(),
        });
        drop(_stop);
        serving.join().expect("no panic").expect("served")
    })
}

impl Page {
    fn send(&self, text: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.host).expect("a connection");
        let patience = Some(Duration::from_secs(20));
        stream.set_read_timeout(patience).expect("a timeout");
        // A server that refuses early may not read to the end.
        let _ = stream.write_all(text.as_bytes());
        stream
    }

    /// Returns the status and the body of an answer.
    fn answer(&self, text: &str) -> (u16, String) {
        let mut answer = String::new();
        let _ = self.send(text).read_to_string(&mut answer);
        let status = answer.split(' ').nth(1).and_then(|it| it.parse().ok());
        let body = answer.split_once("\r\n\r\n").map_or("", |it| it.1);
        (status.unwrap_or(0), body.to_owned())
    }

    fn get(&self, path: &str, headers: &str) -> u16 {
        self.answer(&format!("GET {path} HTTP/1.1\r\n{headers}\r\n"))
            .0
    }

    fn post(&self, body: &Value) -> (u16, String) {
        let (host, token, body) = (&self.host, &self.token, body.to_string());
        self.answer(&format!(
            "POST /{token}/do HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n\
             Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        ))
    }

    fn events(&self) -> Events {
        let (host, token) = (&self.host, &self.token);
        let stream = self.send(&format!(
            "GET /{token}/events HTTP/1.1\r\nHost: {host}\r\n\r\n"
        ));
        let mut events = Events(BufReader::new(stream), 0);
        events.1 = events.wait("page").as_u64().expect("a number");
        events
    }
}

/// Stream of messages, and the number of its page.
struct Events(BufReader<TcpStream>, u64);

impl Events {
    /// Returns the content of the next message of a kind.
    fn wait(&mut self, kind: &str) -> Value {
        loop {
            let mut line = String::new();
            assert!(
                self.0.read_line(&mut line).expect("a message") > 0,
                "the stream ended"
            );
            let Some(data) = line.strip_prefix("data: ") else {
                continue;
            };
            let mut message: Value = serde_json::from_str(data).expect("JSON");
            if let Some(content) = message.get_mut(kind) {
                return content.take();
            }
        }
    }
}

#[test]
fn a_page_drives_by_messages_alone() {
    let served = served(|page| {
        let mut events = page.events();
        let me = events.1;
        let stage = events.wait("stage");
        assert_eq!(stage["world"], "acc");
        assert_eq!(events.wait("frames").as_array().map(Vec::len), Some(1));
        assert_eq!(events.wait("state")["wheel"], me);
        // The keys first, then a sample: the ego is faster after some of them.
        let ask = |ask: Value| assert_eq!(page.post(&json!({"page": me, "ask": ask})).0, 200);
        ask(json!({"keys": {"accel_mps2": 3.0}}));
        let mut speeds = Vec::new();
        for sample in 1..=15 {
            ask(json!("step"));
            let frame = events.wait("frame");
            assert_eq!(frame["sample"], sample);
            speeds.push(frame["speeds_mps"][0].as_f64().expect("a speed"));
        }
        assert!(speeds[14] > speeds[0] + 0.5, "{speeds:?}");
        ask(json!({"back": 3}));
        assert_eq!(events.wait("frames").as_array().map(Vec::len), Some(4));
        // In real time: at a speed of 8, a second of the world takes an eighth.
        ask(json!({"speed": 8.0}));
        ask(json!({"run": true}));
        let last = loop {
            let frame = events.wait("frame");
            if !frame["outcome"].is_null() {
                break frame;
            }
        };
        let verdict = last["outcome"]["verdict"]
            .as_str()
            .expect("a word")
            .to_owned();
        ask(json!("keep"));
        match verdict.as_str() {
            "counterexample" => assert!(events.wait("kept").is_string()),
            _ => assert!(
                events
                    .wait("note")
                    .as_str()
                    .is_some_and(|it| it.contains("only"))
            ),
        }
        let mut setup = stage["setup"].clone();
        setup["start"][0] = json!(1e12);
        ask(json!({"begin": setup}));
        assert!(
            events
                .wait("note")
                .as_str()
                .is_some_and(|it| it.contains("outside"))
        );
    });
    assert_eq!(served.pages, 1);
}

#[test]
fn a_start_has_its_number_until_it_has_values_of_your_own() {
    served(|page| {
        let mut events = page.events();
        let me = events.1;
        let ask = |ask: Value| assert_eq!(page.post(&json!({"page": me, "ask": ask})).0, 200);
        let first = events.wait("stage")["setup"].clone();
        assert_eq!(events.wait("state")["number"], 0);
        ask(json!({"start": 7}));
        let setup = events.wait("stage")["setup"].clone();
        assert_ne!(setup["start"], first["start"]);
        // A page reads numbers with 53 bits, which a seed exceeds.
        assert!(setup["noise"].is_string());
        assert_eq!(events.wait("state")["number"], 7);
        ask(json!("next"));
        assert_eq!(events.wait("state")["number"], 8);
        // The way back to a number gives the same start, and the values of a number are it.
        ask(json!({"start": 7}));
        assert_eq!(events.wait("stage")["setup"], setup);
        ask(json!({"begin": setup}));
        events.wait("stage");
        assert_eq!(events.wait("state")["number"], 7);
        let mut own = setup.clone();
        own["start"][0] = first["start"][0].clone();
        ask(json!({"begin": own}));
        events.wait("stage");
        assert_eq!(events.wait("state")["number"], Value::Null);
        ask(json!({"start": 1_000_000}));
        let note = events.wait("note");
        assert!(note.as_str().is_some_and(|it| it.contains("no start")));
        assert_eq!(events.wait("state")["number"], Value::Null);
    });
}

#[test]
fn chosen_players_drive_the_next_start() {
    served(|page| {
        let mut events = page.events();
        let me = events.1;
        let ask = |ask: Value| assert_eq!(page.post(&json!({"page": me, "ask": ask})).0, 200);
        let first = events.wait("stage")["setup"].clone();
        assert_eq!(
            (&first["ego"], &first["ado"]),
            (&json!("you"), &json!("search"))
        );
        ask(json!({"players": {"ego": "nominal", "ado": "neutral"}}));
        ask(json!("next"));
        let second = events.wait("stage");
        let setup = &second["setup"];
        assert_eq!(
            (&setup["ego"], &setup["ado"]),
            (&json!("nominal"), &json!("neutral"))
        );
        assert_ne!(setup["start"], first["start"]);
        assert_eq!(second["search_found"], Value::Null);
        // They stay, and values of a parameter are theirs.
        ask(
            json!({"players": {"ego": "nominal", "ado": "neutral", "ego_values": {"time_gap_s": 0.75}}}),
        );
        ask(json!({"start": 5}));
        assert_eq!(
            events.wait("stage")["setup"]["ego_values"]["time_gap_s"],
            0.75
        );
        ask(json!("next"));
        assert_eq!(
            events.wait("stage")["setup"]["ego_values"]["time_gap_s"],
            0.75
        );
        assert_eq!(events.wait("state")["number"], 6);
        // Who is unknown is refused, and the present start stays with its number.
        ask(json!({"players": {"ego": "no_such", "ado": "neutral"}}));
        ask(json!("next"));
        let note = events.wait("note");
        assert!(
            note.as_str().is_some_and(|it| it.contains("no_such")),
            "{note}"
        );
        assert_eq!(events.wait("state")["number"], 6);
        ask(json!("next"));
        assert_eq!(events.wait("stage")["setup"]["ego"], "nominal");
        assert_eq!(events.wait("state")["number"], 7);
    });
}

#[test]
fn a_second_page_watches_until_the_first_is_gone() {
    served(|page| {
        let mut first = page.events();
        first.wait("state");
        let mut second = page.events();
        second.wait("frames");
        let step = |by: u64| page.post(&json!({"page": by, "ask": "step"})).0;
        assert_eq!(step(second.1), 400, "it is not at the wheel");
        assert_eq!(step(first.1), 200);
        assert_eq!(first.wait("frame")["sample"], 1);
        assert_eq!(
            second.wait("frame")["sample"],
            1,
            "it sees what the first does"
        );
        let me = second.1;
        drop(first);
        // The loss shows with the next message, and the wheel changes hands.
        while second.wait("state")["wheel"] != me {}
        assert_eq!(step(me), 200);
        assert_eq!(
            second.wait("frame")["sample"],
            2,
            "the episode is still there"
        );
    });
}

#[test]
fn nobody_else_gets_in() {
    served(|page| {
        let (host, token) = (&page.host, &page.token);
        let own = format!("Host: {host}\r\n");
        let root = format!("/{token}/");
        assert_eq!(token.len(), 32, "128 bits");
        assert_eq!(page.get(&root, &own), 200);
        for file in ["style.css", "drive.js", "panel.js", "scene3d.js"] {
            assert_eq!(page.get(&format!("{root}{file}"), &own), 200, "{file}");
        }
        // No token, another token, no host, another host (rebinding), another site.
        assert_eq!(page.get("/", &own), 404);
        let other = format!("/{}/", "0".repeat(32));
        assert_eq!(page.get(&other, &own), 404);
        assert_eq!(page.get(&root, ""), 403);
        assert_eq!(page.get(&root, "Host: evil.example\r\n"), 403);
        let port = host.split(':').nth(1).expect("a port");
        assert_eq!(
            page.get(&root, &format!("Host: evil.example:{port}\r\n")),
            403
        );
        assert_eq!(
            page.get(&root, &format!("{own}Origin: http://evil.example\r\n")),
            403
        );
        assert_eq!(page.get(&root, &format!("{own}Origin: null\r\n")), 403);
        assert_eq!(
            page.get(&root, &format!("{own}Origin: http://{host}\r\n")),
            200
        );
        // No file of the disk.
        for path in [
            "../Cargo.toml",
            "..%2fCargo.toml",
            "etc/passwd",
            "/etc/passwd",
            "do",
            "x",
        ] {
            assert_ne!(page.get(&format!("{root}{path}"), &own), 200, "{path}");
        }
        let long = format!("GET {root}{} HTTP/1.1\r\n{own}\r\n", "a".repeat(100_000));
        assert_ne!(page.answer(&long).0, 200);
        let post = |head: &str, body: &str| {
            let length = body.len();
            page.answer(&format!(
                "POST {root}do HTTP/1.1\r\n{own}{head}Content-Length: {length}\r\n\r\n{body}"
            ))
        };
        let json = "Content-Type: application/json\r\n";
        assert_eq!(post("Content-Type: text/plain\r\n", "{}").0, 400);
        assert_eq!(post(json, &"x".repeat(100_000)).0, 413);
        for body in [
            "",
            "{",
            "[]",
            "{\"page\":1}",
            "{\"page\":1,\"ask\":\"fly\"}",
            "\u{0}",
        ] {
            assert_eq!(post(json, body).0, 400, "{body:?}");
        }
        assert_eq!(
            page.answer(&format!("DELETE {root} HTTP/1.1\r\n{own}\r\n"))
                .0,
            405
        );
        // After all of it the page is still there.
        page.events().wait("stage");
    });
}
