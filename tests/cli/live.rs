//! `serve` with judged episodes: another simulator moves the ego.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};

use brakecheck::run_dir::RunDir;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Episode, PolicyActor, motion_of, play};
use brakecheck::world::Scenario;
use serde_json::{Value, json};

use super::{brakecheck, code, path, scratch, small_run, stderr};

/// A running `brakecheck serve`.
pub(super) struct Served(Child, BufReader<std::process::ChildStdout>);

impl Served {
    pub(super) fn start(args: &[&str]) -> Served {
        let mut child = Command::new(env!("CARGO_BIN_EXE_brakecheck"))
            .arg("serve")
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let stdout = child.stdout.take().expect("a pipe");
        Served(child, BufReader::new(stdout))
    }

    pub(super) fn ask(&mut self, message: &Value) -> Value {
        let stdin = self.0.stdin.as_mut().expect("a pipe");
        writeln!(stdin, "{message}").expect("written");
        let mut line = String::new();
        self.1.read_line(&mut line).expect("an answer");
        serde_json::from_str(&line).expect("JSON")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.0.stdin.take();
        self.0.wait().expect("it ends");
    }
}

/// Episode of a run's ado against the world's own ego, from a test start of seed 0.
fn at_home(run: &str, index: u64) -> (Scenario, Episode) {
    let run = RunDir::open(run.as_ref()).expect("a run");
    let (world, policy) = (run.scenario().expect("it"), run.policy().expect("it"));
    let mut bench = world.bench();
    let purpose = Purpose::Test;
    let key = StartKey {
        purpose,
        seed: 0,
        index,
    };
    let (start, noise) = (bench.draw(key), bench.noise_of(key));
    let mut actor = PolicyActor(&*policy);
    let episode = play(&mut bench, &start, noise, &mut actor, Aftermath::Play);
    (world, episode)
}

/// Sends the ego of an episode, sample by sample, and returns all answers.
pub(super) fn sent_back(
    served: &mut Served,
    world: &Scenario,
    episode: &Episode,
    index: u64,
) -> Vec<Value> {
    let motion = motion_of(&mut world.bench(), episode).expect("a motion");
    let agents = &world.drive().expect("a road").spec().agents;
    let ego = agents
        .iter()
        .position(|it| it.name == "ego")
        .expect("an ego");
    let mut answers = vec![served.ask(&json!({ "reset": { "index": index } }))];
    for sample in 1..motion.len() {
        let mut state = motion.at(sample)[ego].state;
        if sample + 1 == motion.len() && episode.contact.is_some() {
            // The record ends at the instant of the contact. An ego from outside knows
            // nothing of it and drives on to the end of the sample.
            let before = motion.at(sample - 1)[ego].state;
            let sample_s = world.world().clock().sample_s;
            let gained_mps = before.accel_mps2 * sample_s;
            state = before;
            state.speed_mps += gained_mps;
            state.pose.x_m += (before.speed_mps + 0.5 * gained_mps) * sample_s;
        }
        answers.push(served.ask(&json!({ "sample": { "ego": {
            "x_m": state.pose.x_m, "y_m": state.pose.y_m, "heading_rad": state.pose.heading_rad,
            "speed_mps": state.speed_mps, "accel_mps2": state.accel_mps2,
            "lateral_mps": state.lateral_mps, "yaw_rate_rad_per_s": state.yaw_rate_rad_per_s,
        } } })));
    }
    answers
}

#[test]
fn an_ego_from_outside_is_judged_as_the_same_ego_at_home() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    let mut verdicts = std::collections::BTreeSet::new();
    for index in 0..12 {
        let (world, episode) = at_home(&run, index);
        let answers = sent_back(&mut served, &world, &episode, index);
        let column = |name: &str| episode.trace.signal(name).expect("recorded").to_vec();
        let (x_m, speed_mps) = (column("ado.x"), column("ado.speed"));
        // The last sample of a contact is cut short, within the sample.
        for (sample, answer) in answers.iter().enumerate().take(x_m.len() - 1) {
            let ado = &answer["bodies"]["ado"];
            assert_eq!(
                ado["x_m"],
                json!(x_m[sample]),
                "start {index}, sample {sample}"
            );
            assert_eq!(ado["speed_mps"], json!(speed_mps[sample]));
        }
        let last = answers.last().expect("answers");
        assert_eq!(last["done"], true, "start {index}: {last}");
        assert_eq!(last["verdict"], json!(episode.verdict.word()));
        assert_eq!(last["is_success"], json!(episode.verdict.is_success()));
        verdicts.insert(episode.verdict.word());
        assert_eq!(last["contact"].is_null(), episode.contact.is_none());
        if let Some(touch) = &episode.contact {
            let time_s = last["contact"]["time_s"].as_f64().expect("a time");
            assert!(
                (time_s - touch.time_s).abs() < 0.01,
                "{time_s} and {}",
                touch.time_s
            );
        }
        for rule in world.rules() {
            assert!(last["rules"][&rule.name].is_f64(), "{}", rule.name);
        }
        assert_eq!(
            answers[0]["start"].as_object().map(|it| it.len()),
            Some(world.axes().len())
        );
    }
    // Otherwise the comparison shows little.
    assert!(
        verdicts.contains("counterexample") && verdicts.len() > 1,
        "{verdicts:?}"
    );
}

#[test]
fn a_kept_episode_of_another_simulator_replays_at_home() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let keep = path(&dir, "kept");
    let mut served = Served::start(&[&run, "--keep", &keep]);
    let mut kept = Vec::new();
    for index in 0..12 {
        let (world, episode) = at_home(&run, index);
        let answers = sent_back(&mut served, &world, &episode, index);
        let last = answers.last().expect("answers");
        if let Some(file) = last["kept"].as_str() {
            assert!(
                last["home_off_m"].as_f64().expect("a distance") < 0.05,
                "{last}"
            );
            assert!(episode.verdict.is_success());
            kept.push(file.to_owned());
        }
    }
    drop(served);
    assert!(!kept.is_empty());
    for file in &kept {
        let output = brakecheck(&["view", file, "-o", &path(&dir, "crash.svg")]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
    // The ego of the other simulator is not here, which a replay must not hide.
    let output = brakecheck(&["replay", &keep]);
    assert!(
        stderr(&output).contains("which is in no file: the world's own ego was replayed"),
        "{}",
        stderr(&output)
    );
    let output = brakecheck(&["replay", &keep, "--expect", "recorded"]);
    assert_eq!((code(&output), stderr(&output)), (0, String::new()));
    // An export takes only what repeats bit for bit.
    let output = brakecheck(&["export", &keep, "-o", &path(&dir, "scenarios"), "--osi"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let files = std::fs::read_dir(path(&dir, "scenarios"))
        .expect("a directory")
        .count();
    assert_eq!(files, 4 * kept.len());
}

#[test]
fn mistakes_in_judged_episodes_are_answered() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    let ego = json!({ "x_m": 1.0, "y_m": 0.0, "heading_rad": 0.0, "speed_mps": 20.0 });
    for (message, says) in [
        (json!({ "sample": { "ego": ego } }), "requires an episode"),
        (
            json!({ "reset": { "start": { "ado.headway": 30.0 } } }),
            "missing axis",
        ),
        (
            json!({ "reset": { "start": { "ufo": 1.0 } } }),
            "unknown axis `ufo`",
        ),
        (json!({ "reset": { "index": -1 } }), "`reset`"),
    ] {
        let error = served.ask(&message)["error"].to_string();
        assert!(error.contains(says), "{message}: {error}");
    }
    assert_eq!(
        served.ask(&json!({ "reset": { "index": 0 } }))["ready"],
        true
    );
    for (message, says) in [
        (json!({ "sample": {} }), "missing state of the ego `ego`"),
        (
            json!({ "sample": { "ego": { "x_m": 1.0 } } }),
            "missing field `y_m`",
        ),
        (
            json!({ "sample": { "ego": ego, "ufo": ego } }),
            "unknown agent `ufo`",
        ),
    ] {
        let error = served.ask(&message)["error"].to_string();
        assert!(error.contains(says), "{message}: {error}");
    }
}

/// A jump is no motion, so it makes no counterexample either.
#[test]
fn a_motion_that_contradicts_its_speeds_is_not_played() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    let begun = served.ask(&json!({ "reset": { "index": 0 } }));
    let ego = &begun["bodies"]["ego"];
    let [x_m, y_m, speed_mps] =
        ["x_m", "y_m", "speed_mps"].map(|key| ego[key].as_f64().expect("a number"));
    let moved = |ahead_m: f64, heading_rad: f64, speed_mps: f64| {
        let (x_m, y_m) = (x_m + ahead_m, y_m);
        json!({ "sample": { "ego": {
            "x_m": x_m, "y_m": y_m, "heading_rad": heading_rad, "speed_mps": speed_mps,
        } } })
    };
    let way_m = 0.05 * speed_mps;
    for (message, says) in [
        (moved(499.0, 0.0, speed_mps), "moved by 499.00 m in 0.05 s"),
        (moved(499.0, 0.0, 9964.0), "a speed of 9964 m/s"),
        (moved(-499.0, 0.0, speed_mps), "moved by 499.00 m"),
        (
            moved(way_m, 0.0, 3.6 * speed_mps),
            "its speeds and headings",
        ),
        (moved(way_m, 90.0, speed_mps), "its speeds and headings"),
        (
            moved(2.0 * way_m + 0.3, 0.0, speed_mps),
            "its speeds and headings",
        ),
    ] {
        let answer = served.ask(&message);
        let error = answer["error"].to_string();
        assert!(error.contains(says), "{message}: {answer}");
    }
    let rated = |field: &str, value: f64| {
        let mut message = moved(way_m, 0.0, speed_mps);
        message["sample"]["ego"][field] = json!(value);
        message
    };
    for (message, says) in [
        (
            rated("accel_mps2", 1000.5),
            "`sample`: `ego` has `accel_mps2` = 1000.5: give m/s², from -1000 to 1000",
        ),
        (rated("accel_mps2", -1e300), "from -1000 to 1000"),
        (
            rated("yaw_rate_rad_per_s", -30.5),
            "has `yaw_rate_rad_per_s` = -30.5: give rad/s, from -30 to 30",
        ),
    ] {
        let answer = served.ask(&message);
        let error = answer["error"].to_string();
        assert!(error.contains(says), "{message}: {answer}");
    }
    // The refused samples left the episode where it was.
    let answer = served.ask(&moved(way_m, 0.0, speed_mps));
    assert_eq!(answer["time_s"], 0.05, "{answer}");
}

#[test]
fn a_derived_signal_follows_from_those_that_it_reads() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let mut served = Served::start(&[&run]);
    let hello = served.ask(&json!({ "hello": { "protocol": 1 } }))["hello"].clone();
    let derived = hello["derived"].as_array().expect("a list");
    let headway = derived
        .iter()
        .find(|it| it["name"] == "headway")
        .expect("headway");
    assert!(
        headway["expr"]
            .as_str()
            .is_some_and(|it| it.contains("ado.x")),
        "{headway}"
    );
    assert_eq!(hello["agents"][0]["role"], "ego");
    assert!(
        hello["rules"][0]["stl"]
            .as_str()
            .is_some_and(|it| it.contains("always"))
    );
    let speeds =
        json!({ "ego.speed": 22.0, "ado.speed": 18.0, "ego.accel": 0.0, "time_left": 10.0 });
    let mut said = std::collections::BTreeSet::new();
    for headway_m in [8.0, 15.0, 30.0, 60.0] {
        let (mut named, mut places) = (speeds.clone(), speeds.clone());
        named["headway"] = json!(headway_m);
        places["ego.x"] = json!(100.0);
        places["ado.x"] = json!(100.0 + headway_m);
        let named = served.ask(&json!({ "decide": named }));
        let places = served.ask(&json!({ "decide": places }));
        assert_eq!(named["value"], places["value"], "{named} and {places}");
        said.insert(named["value"].to_string());
    }
    assert!(said.len() > 1, "the distance changes nothing");
}
