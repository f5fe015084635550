//! An ego that is another program: what it may do wrong is never a success.

use brakecheck::ego::{FaultKind, Process, exercise};
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};

/// The ACC world with a shell script as the ego; no one consented to it.
fn named_world(script: &str, timeout_s: f64) -> Scenario {
    ended_world(script, timeout_s, "")
}

/// The same world with further fields at its end.
fn ended_world(script: &str, timeout_s: f64, fields: &str) -> Scenario {
    let text = include_str!("../../worlds/acc.ron");
    let from = text.find("drive: Ego(Acc(").expect("the ego");
    let to = from + text[from..].find(")),").expect("its end") + 3;
    let drive = format!(
        "drive: Ego(Process(command: [\"sh\", \"-c\", r##\"{script}\"##], timeout_s: {timeout_s:.1})),"
    );
    let text = format!("{}{drive}{}", &text[..from], &text[to..]);
    // Changes of the controller's parameters do not fit another controller.
    let from = text.find("reuse: {").expect("reuse");
    let text = format!("{}{fields})\n", &text[..from]);
    Scenario::parse("acc.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

fn world(script: &str) -> Scenario {
    named_world(script, 60.0).allow_programs(true)
}

fn coast(world: &Scenario, start: [f64; 3]) -> Episode {
    let mut bench = world.bench();
    let mut actor = Constant(bench.spaces().neutral);
    play(
        &mut bench,
        &Start(start.to_vec()),
        7,
        &mut actor,
        Aftermath::Skip,
    )
}

const FAR: [f64; 3] = [10.0, 50.0, 20.0];

/// A program that keeps the protocol and runs `step` at each sample.
fn answering(step: &str) -> String {
    format!(
        "while read -r l; do id=${{l#*'\"id\":'}}; id=${{id%%,*}}; case $l in \
         *'\"hello\"'*) echo '{{\"hello\":{{\"protocol\":1,\"more\":[1]}}}}';; \
         *'\"reset\"'*) echo \"{{\\\"id\\\":$id,\\\"ready\\\":true,\\\"more\\\":1}}\";; \
         *'\"step\"'*) {step};; *) exit 0;; esac; done"
    )
}

const BRAKES: &str = "echo \"{\\\"more\\\":2,\\\"id\\\":$id,\\\"accel_mps2\\\":-2.0}\"";

#[test]
fn a_program_drives_the_ego() {
    let brakes = world(&answering(BRAKES));
    let episode = coast(&brakes, FAR);
    assert_eq!(episode.fault, None);
    assert!(matches!(episode.verdict, Verdict::Held { .. }));
    let speed = episode.trace.signal("ego.speed").expect("published");
    // From 10 m/s at -2 m/s²: 5 m/s after 2.5 s, and at rest from 5 s on.
    assert!((speed[50] - 5.0).abs() < 0.05, "{}", speed[50]);
    assert!(speed[300].abs() < 1e-6);
    assert!(episode.commands.iter().all(|c| c.accel_mps2 == -2.0));
    // It is asked again and again: a second episode in the same process.
    assert_eq!(coast(&brakes, FAR), episode);
}

#[test]
fn one_program_serves_all_episodes_of_a_worker() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let noting = format!(
        "echo started >> {}; {}",
        file.path().display(),
        answering(BRAKES)
    );
    let world = world(&noting);
    for _ in 0..5 {
        assert_eq!(coast(&world, FAR).fault, None);
    }
    let starts = std::fs::read_to_string(file.path()).expect("readable");
    assert_eq!(starts.lines().count(), 1, "{starts}");
}

#[test]
fn members_of_a_family_begin_every_episode_anew_in_a_world_that_does() {
    let fields = "train_against: Family(friction: (0.6, 1.0)),";
    let world = ended_world("exit 0", 60.0, fields);
    let family = world.family().expect("a family");
    let variant = family.variant(&family.nominal(PlantKind::Kinematic));
    let is_fresh = |world: &Scenario| {
        let member = world.drive().expect("driven").with_member(&variant);
        member.program().expect("a program").fresh
    };
    assert!(!is_fresh(&world));
    assert!(is_fresh(&world.with_fresh_egos()));
}

#[test]
fn another_program_is_no_member_of_a_family_of_one() {
    let fields = "train_against: Family(friction: (0.6, 1.0)),";
    let world = ended_world("exit 0", 60.0, fields);
    let family = world.family().expect("a family");
    let with = |other: &Scenario| Change {
        controller: other.controller(),
        ..Change::default()
    };
    assert!(family.covers(&with(&world)));
    assert!(!family.covers(&with(&named_world("exit 1", 60.0))));
}

#[test]
fn the_commands_of_a_program_repeat_its_episode_without_it() {
    let world = world(&answering(BRAKES));
    let episode = coast(&world, FAR);
    let commands = episode.commands.clone().into();
    let again = coast(&world.allow_programs(false).with_commands(&commands), FAR);
    assert_eq!(again, episode);
    let few = episode.commands[..10].to_vec().into();
    let short = coast(&world.with_commands(&few), FAR);
    assert_eq!(short.fault.map(|fault| fault.kind), Some(FaultKind::Error));
}

#[test]
fn a_program_is_not_started_before_somebody_consents() {
    let episode = coast(&named_world("exit 0", 60.0), FAR);
    assert_eq!(episode.verdict, Verdict::Invalid);
    let fault = episode.fault.expect("a fault");
    assert_eq!(fault.kind, FaultKind::CannotStart);
    assert!(fault.message.contains("not allowed"), "{fault}");
}

#[test]
fn a_fault_tells_kind_cause_and_the_end_of_stderr() {
    let dies =
        answering("head -c 100000 /dev/zero | tr '\\0' '.' >&2; echo last words >&2; exit 3");
    let fault = coast(&world(&dies), FAR).fault.expect("a fault");
    assert_eq!(fault.kind, FaultKind::Ended);
    assert!(fault.message.contains("exit status: 3"), "{fault}");
    assert!(fault.message.contains("at 0.000 s"), "{fault}");
    assert!(fault.stderr.ends_with("last words") && fault.stderr.len() < 5000);
    let lost = answering("echo \"{\\\"id\\\":$id,\\\"error\\\":\\\"no map\\\"}\"");
    let fault = coast(&world(&lost), FAR).fault.expect("a fault");
    assert_eq!(fault.kind, FaultKind::Error);
    assert!(fault.message.contains("no map"), "{fault}");
}

#[test]
fn a_thousand_faults_leave_no_descriptor_and_no_thread() {
    let count = |what: &str| {
        let entries = std::fs::read_dir(format!("/proc/self/{what}"));
        entries.map_or(0, Iterator::count)
    };
    let world = world("exit 3");
    coast(&world, FAR);
    let (descriptors, threads) = (count("fd"), count("task"));
    for _ in 0..1000 {
        assert!(coast(&world, FAR).fault.is_some());
    }
    // Other tests run beside this one; a leak would be a thousand.
    assert!(count("fd") < descriptors + 100);
    assert!(count("task") < threads + 100);
}

#[test]
fn a_program_is_tried_against_the_protocol() {
    let tried = |script: &str| {
        let mut process = Process::new(["sh", "-c", script]);
        process.allow(true);
        exercise(&process)
    };
    let sound = tried(&answering(BRAKES));
    assert!(sound.passed(), "{:?}", sound.findings);
    assert_eq!(sound.findings.len(), 12);
    let wild = tried(&answering(
        "echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":99}\"",
    ));
    let wrong = |done: &brakecheck::ego::Exercise| -> Vec<String> {
        let wrong = done.findings.iter().filter(|found| !found.passed);
        wrong.map(|found| found.what.clone()).collect()
    };
    assert_eq!(wrong(&wild), ["commands what a car can do"]);
    // It counts on through resets.
    let counting = tried(&answering(
        "n=$((n+1)); echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":0.00$((n%7))}\"",
    ));
    assert_eq!(wrong(&counting), ["begins anew when it is reset"]);
    assert_eq!(counting.deterministic, Some(false));
    let kind = counting.unrepeatable.map(|fault| fault.kind);
    assert_eq!(kind, Some(FaultKind::KeptState));
    let stays = answering(BRAKES).replace("*) exit 0;;", "*) exec sleep 1000;;");
    let stays = tried(&format!("trap '' TERM; {stays}; exec sleep 1000"));
    assert_eq!(wrong(&stays), ["ends when it is told to"]);
}

#[test]
fn repeats_are_checked_and_read_in_both_ways() {
    let with = |repeats: &str| {
        let text = include_str!("../../worlds/acc.ron").replacen(
            "plant: Rigid,",
            &format!("plant: Rigid,\n    {repeats},"),
            1,
        );
        Scenario::parse("acc.ron", &text)
    };
    let five = with("repeats: 5").expect("sound").repeats();
    assert_eq!((five.runs, five.gate), (5, 1));
    let three = with("repeats: (runs: 5, gate: 3)")
        .expect("sound")
        .repeats();
    assert_eq!((three.runs, three.gate), (5, 3));
    for wrong in [
        "repeats: 0",
        "repeats: 5000000000",
        "repeats: (runs: 2, gate: 3)",
    ] {
        assert!(with(wrong).is_err(), "{wrong}");
    }
}

/// The keys of a JSON value, with those of everything in it.
fn keys(value: &serde_json::Value, at: &str, found: &mut Vec<String>) {
    match value {
        serde_json::Value::Object(map) => map.iter().for_each(|(key, value)| {
            let at = format!("{at}.{key}");
            keys(value, &at, found);
            found.push(at);
        }),
        serde_json::Value::Array(list) => list.iter().for_each(|value| keys(value, at, found)),
        _ => {}
    }
}

fn keys_of(line: &str) -> Vec<String> {
    let value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{line}: {error}"));
    let mut found = Vec::new();
    keys(&value, "", &mut found);
    found.sort();
    found
}

#[test]
fn the_document_shows_what_is_said() {
    let file = tempfile::NamedTempFile::new().expect("a file");
    let heard = file.path().display();
    let noting = answering(BRAKES).replace(
        "while read -r l; do",
        &format!("while read -r l; do printf '%s\\n' \"$l\" >> {heard};"),
    );
    {
        let world = world(&noting);
        assert_eq!(coast(&world, FAR).fault, None);
    }
    let heard = std::fs::read_to_string(file.path()).expect("readable");
    let document = include_str!("../../docs/reference/ego-protocol.md");
    let said: Vec<&str> = document
        .lines()
        .filter_map(|line| line.strip_prefix("> "))
        .collect();
    let mut lines = heard.lines();
    for shown in &said[..4] {
        let line = lines.next().expect("as many lines");
        assert_eq!(keys_of(line), keys_of(shown));
    }
    assert_eq!(heard.lines().next(), said.first().copied());
    assert_eq!(heard.lines().last(), said.last().copied());
}

#[test]
fn the_ego_in_c_keeps_the_protocol() {
    let dir = tempfile::tempdir().expect("a directory");
    let program = dir.path().join("ego").display().to_string();
    // Rust needs a C compiler to link, so there is one.
    let built = std::process::Command::new("cc")
        .args(["-O2", "-Wall", "-Werror", "-o", &program, "examples/ego.c"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status();
    assert!(built.expect("cc").success());
    let mut process = Process::new([program]);
    process.allow(true);
    let done = exercise(&process);
    assert!(done.passed(), "{:?} {:?}", done.findings, done.fault);
}
