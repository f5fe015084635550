//! Broken egos: no verb takes one for an ego that held, or that failed.

use std::path::Path;

use brakecheck::ErrorReport;
use brakecheck::crashes::{RegressionError, Regressions};
use brakecheck::ego::Process;
use brakecheck::run_dir::Counterexample;
use brakecheck::world::Change;
use serde_json::Value;

use super::{brakecheck, code, json, path, root, scratch, small_run, stderr};

/// What a shell program does when it is told hello, reset or step.
struct Fake<'a> {
    hello: &'a str,
    reset: &'a str,
    step: &'a str,
}

/// Only what hangs is worth a short wait; machines are busy.
const HASTY_S: f64 = 0.4;
const PATIENT_S: f64 = 60.0;

const HELLO: &str = r#"echo '{"hello":{"protocol":1,"name":"fake"}}'"#;
const READY: &str = r#"echo "{\"id\":$id,\"ready\":true}""#;
const COAST: &str = r#"echo "{\"id\":$id,\"accel_mps2\":0}""#;

/// A program that keeps the protocol.
const SOUND: Fake<'_> = Fake {
    hello: HELLO,
    reset: READY,
    step: COAST,
};

impl Fake<'_> {
    fn script(&self) -> String {
        let Fake { hello, reset, step } = self;
        format!(
            r#"n=0; while read -r l; do id=${{l#*'"id":'}}; id=${{id%%,*}}; n=$((n+1)); case $l in *'"hello"'*) {hello};; *'"reset"'*) {reset};; *'"step"'*) {step};; *'"close"'*) exit 0;; esac; done"#
        )
    }
}

fn at_hello(hello: &str) -> String {
    Fake { hello, ..SOUND }.script()
}

fn at_reset(reset: &str) -> String {
    Fake { reset, ..SOUND }.script()
}

fn at_step(step: &str) -> String {
    Fake { step, ..SOUND }.script()
}

/// What a program does wrong, how, and the kinds of fault that may be.
type Broken = (&'static str, String, &'static [&'static str]);

/// Everything a program can do wrong, with the words of what may be found.
///
/// Some do two things at once, and either may be noticed first.
fn broken_scripts() -> Vec<Broken> {
    const ENDED: &[&str] = &["ended"];
    const LATE: &[&str] = &["timeout"];
    const PROTOCOL: &[&str] = &["protocol"];
    const ODD: &[&str] = &["implausible"];
    const ERROR: &[&str] = &["error"];
    vec![
        ("exits", "exit 0".to_owned(), ENDED),
        ("exits with 3", "exit 3".to_owned(), ENDED),
        ("complains and exits", "echo boom >&2; exit 1".to_owned(), ENDED),
        ("complains at length", "head -c 300000 /dev/zero >&2; exit 1".to_owned(), &["ended", "timeout"]),
        ("is killed", "kill -9 $$".to_owned(), ENDED),
        ("crashes", "kill -SEGV $$".to_owned(), ENDED),
        ("closes its output", "exec 1>&-; exec sleep 1000".to_owned(), ENDED),
        ("neither reads nor answers", "exec sleep 1000".to_owned(), LATE),
        ("reads and does not answer", "while read -r l; do :; done".to_owned(), LATE),
        ("leaves a child with its output", "sleep 1000 & exit 0".to_owned(), ENDED),
        ("echoes", "exec cat".to_owned(), PROTOCOL),
        ("floods with lines", "exec yes".to_owned(), PROTOCOL),
        ("floods with hellos", format!("while :; do {HELLO}; done"), PROTOCOL),
        ("never ends its line", "head -c 200000 /dev/zero | tr '\\0' 'x'; exec sleep 1000".to_owned(), PROTOCOL),
        ("answers bytes", "printf '\\377\\376\\n'; exec sleep 1000".to_owned(), PROTOCOL),
        ("answers empty lines", "while read -r l; do echo; done".to_owned(), PROTOCOL),
        ("answers half a line", "printf '{\"hello\":'; exec sleep 1000".to_owned(), LATE),
        ("is of the time before hellos", "while read -r l; do case $l in *reset*) echo '{\"ready\":true}';; *) echo '{\"accel_mps2\":0}';; esac; done".to_owned(), PROTOCOL),
        ("speaks version 2", at_hello("echo '{\"hello\":{\"protocol\":2}}'"), PROTOCOL),
        ("speaks version one", at_hello("echo '{\"hello\":{\"protocol\":\"1\"}}'"), PROTOCOL),
        ("speaks no version", at_hello("echo '{\"hello\":{}}'"), PROTOCOL),
        ("says hello twice", at_hello(&format!("{HELLO}; {HELLO}")), PROTOCOL),
        ("is not ready", at_reset("echo \"{\\\"id\\\":$id,\\\"ready\\\":false}\""), PROTOCOL),
        ("does not say ready", at_reset("echo \"{\\\"id\\\":$id}\""), PROTOCOL),
        ("is ready for another", at_reset("echo '{\"id\":77,\"ready\":true}'"), PROTOCOL),
        ("reports an error at reset", at_reset("echo \"{\\\"id\\\":$id,\\\"error\\\":\\\"no map\\\"}\""), ERROR),
        ("exits at reset", at_reset("exit 4"), ENDED),
        ("hangs at reset", at_reset("exec sleep 1000"), LATE),
        ("answers nonsense", at_step("echo nonsense"), PROTOCOL),
        ("answers without a command", at_step("echo \"{\\\"id\\\":$id}\""), PROTOCOL),
        ("answers without a number", at_step("echo '{\"accel_mps2\":0}'"), PROTOCOL),
        ("answers a word", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":\\\"brake\\\"}\""), PROTOCOL),
        ("answers null", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":null}\""), PROTOCOL),
        ("answers NaN", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":NaN}\""), PROTOCOL),
        ("answers 1e999", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":1e999}\""), PROTOCOL),
        ("answers 1e308", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":1e308}\""), ODD),
        ("brakes with 50 m/s²", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":-50}\""), ODD),
        ("jumps aside", at_step("echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":0,\\\"lateral_mps\\\":-50}\""), ODD),
        ("answers twice", at_step(&format!("{COAST}; {COAST}")), PROTOCOL),
        ("answers the question before", at_step("echo \"{\\\"id\\\":$((id-1)),\\\"accel_mps2\\\":0}\""), PROTOCOL),
        ("reports an error", at_step("echo \"{\\\"id\\\":$id,\\\"error\\\":\\\"lost\\\"}\""), ERROR),
        ("hangs at a step", at_step("exec sleep 1000"), LATE),
        ("hangs after ten steps", at_step(&format!("[ $n -gt 12 ] && exec sleep 1000; {COAST}")), LATE),
        ("exits after ten steps", at_step(&format!("[ $n -gt 12 ] && exit 7; {COAST}")), ENDED),
    ]
}

/// A fake as a `Change` in a file, marked so that it is found among processes.
fn change(dir: &tempfile::TempDir, nth: usize, script: &str, mark: &str) -> String {
    timed_change(dir, nth, (script, PATIENT_S), mark)
}

/// The same with a timeout.
fn timed_change(
    dir: &tempfile::TempDir,
    nth: usize,
    (script, timeout_s): (&str, f64),
    mark: &str,
) -> String {
    let file = path(dir, &format!("fake{nth}.ron"));
    let script = format!(": {mark}; {script}");
    let text = format!(
        "Change(controller: Some(Process(command: [\"sh\", \"-c\", r##\"{script}\"##], timeout_s: {timeout_s:.1})))"
    );
    std::fs::write(&file, text).expect("written");
    file
}

/// The world with a program as its own ego.
fn world(dir: &tempfile::TempDir, script: &str) -> String {
    let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
    let from = text.find("drive: Ego(Acc(").expect("the ego");
    let to = from + text[from..].find(")),").expect("its end") + 3;
    let drive = format!(
        "drive: Ego(Process(command: [\"sh\", \"-c\", r##\"{script}\"##], timeout_s: 60.0)),"
    );
    let text = format!("{}{drive}{}", &text[..from], &text[to..]);
    let rest = text.find("reuse: {").expect("reuse");
    let file = path(dir, "fake-world.ron");
    std::fs::write(&file, format!("{})\n", &text[..rest])).expect("written");
    file
}

/// Processes whose command line has the mark.
fn alive(mark: &str) -> Vec<String> {
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let lines = processes.filter_map(|p| std::fs::read_to_string(p.path().join("cmdline")).ok());
    lines.filter(|line| line.contains(mark)).collect()
}

/// No start counts as solved or held; some are invalid, of one of the kinds.
fn only_invalid(rows: &Value, kinds: &[&str], what: &str) {
    let rows = rows.as_array().expect("rows");
    let played = rows.iter().filter(|row| row["invalid"].as_u64() != Some(0));
    assert!(played.clone().count() > 0, "{what}: nothing is invalid");
    for row in rows {
        assert_eq!(row["successes"], 0, "{what}");
        assert_eq!(row["starts"], 0, "{what}: {}", row["solved"]);
        let solved = row["solved"].as_str().expect("marks");
        assert!(!solved.contains(['0', '1']), "{what}: {solved}");
        for fault in row["faults"].as_array().into_iter().flatten() {
            let kind = fault["kind"].as_str().expect("a kind");
            assert!(kinds.contains(&kind), "{what}: {fault}");
        }
    }
}

#[test]
fn no_verb_takes_a_broken_ego_for_one_that_held_or_failed() {
    let dir = scratch();
    let (run, trained) = small_run(&dir, "run", &[]);
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let kept = root()
        .join("tests/regressions/acc-2D-plant-0002.ron")
        .display()
        .to_string();
    let mark = format!("brakecheck-fake-{}", std::process::id());
    let scripts: Vec<_> = broken_scripts().into_iter().enumerate().collect();
    // They wait more than they compute.
    let meet = |(nth, (what, script, kinds)): &(usize, Broken)| {
        let (nth, what) = (*nth, *what);
        let timeout_s = if kinds.contains(&"timeout") {
            HASTY_S
        } else {
            PATIENT_S
        };
        let ego = timed_change(&dir, nth, (script, timeout_s), &mark);
        let named = |output: &std::process::Output, verb: &str| {
            let said = stderr(output);
            assert_eq!(code(output), 3, "{verb}, {what}: {said}");
            assert!(
                kinds.iter().any(|kind| said.contains(kind)),
                "{verb}, {what}: {said}"
            );
        };
        let eval = brakecheck(&[
            "eval",
            &run,
            "--starts",
            "6",
            "--ego",
            &ego,
            "--allow-programs",
            "--json",
        ]);
        named(&eval, "eval");
        only_invalid(&json(&eval)["rows"], kinds, what);
        let search = brakecheck(&[
            "search",
            "worlds/acc.ron",
            "--plant",
            "kinematic",
            "--starts",
            "4",
            "--ego",
            &ego,
            "--allow-programs",
            "--json",
        ]);
        named(&search, "search");
        only_invalid(&json(&search)["rows"], kinds, what);
        let replay = brakecheck(&["replay", &kept, "--ego", &ego, "--allow-programs"]);
        named(&replay, "replay");
        let program = format!(": {mark}; {script}");
        if !kinds.contains(&"timeout") {
            // What hangs is waited for the usual ten seconds there.
            let check = brakecheck(&["check", "--", "sh", "-c", &program]);
            named(&check, "check");
        }
        let mut process = Process::new(["sh", "-c", &program]);
        process.set("timeout_s", timeout_s).expect("it has one");
        let change = Change {
            controller: Some(process.into()),
            ..Change::default()
        };
        let guard = Regressions::load(&kept).expect("kept").with_change(change);
        let error = guard.allow_programs(true).pass().expect_err(what);
        let RegressionError::Invalid { invalid, .. } = &error else {
            panic!("{what}: {error}");
        };
        assert!(
            kinds.iter().any(|kind| invalid[0].contains(kind)),
            "{what}: {error}"
        );
    };
    std::thread::scope(|scope| {
        for part in scripts.chunks(scripts.len().div_ceil(6)) {
            scope.spawn(|| part.iter().for_each(meet));
        }
    });
    assert_eq!(alive(&mark), Vec::<String>::new());
}

#[test]
fn programs_that_are_none_cannot_be_started() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    for program in ["/nonexistent", "/", "./Cargo.toml"] {
        let eval = brakecheck(&["eval", &run, "--starts", "6", "--json", "--", program]);
        assert_eq!(code(&eval), 3, "{program}");
        let row = &json(&eval)["rows"][0];
        let message = row["faults"][0]["message"].as_str().expect("a message");
        assert!(message.contains("os error"), "{message}");
        assert_eq!(row["faults"][0]["kind"], "cannot_start", "{program}");
        assert_eq!((&row["starts"], &row["successes"]), (&0.into(), &0.into()));
        // Not even where everything may be invalid: nothing was tested.
        let all = [
            "eval",
            &run,
            "--starts",
            "6",
            "--allow-invalid",
            "1",
            "--",
            program,
        ];
        assert_eq!(code(&brakecheck(&all)), 3, "{program}");
    }
    // A campaign with such an ego is not planned: no piece of it could be made.
    for program in ["[\"/nonexistent\"]", "[\"sh\", \"-c\", \"exit 0\"]"] {
        let ego = path(&dir, "never.ron");
        let change = format!("Change(controller: Some(Process(command: {program})))");
        std::fs::write(&ego, change).expect("written");
        let (file, plan) = (path(&dir, "campaign.ron"), path(&dir, "plan"));
        let text = format!(
            "Campaign(name: \"none\", worlds: [(file: \"acc\", plant: Kinematic)], \
             egos: [Ego(\"{ego}\")], ados: [Held], starts: Drawn(count: 4, seed: 0))"
        );
        std::fs::write(&file, text).expect("written");
        let asked = ["campaign", "plan", &file, "-o", &plan, "--allow-programs"];
        let output = brakecheck(&asked);
        assert_eq!(code(&output), 3, "{program}: {}", stderr(&output));
        assert!(!Path::new(&plan).exists(), "{program}");
    }
    let none = path(&dir, "none.ron");
    std::fs::write(&none, "Change(controller: Some(Process(command: [])))").expect("written");
    let refused = brakecheck(&["eval", &run, "--ego", &none, "--allow-programs"]);
    assert_eq!(code(&refused), 2);
    assert!(
        stderr(&refused).contains("no program is named"),
        "{}",
        stderr(&refused)
    );
}

#[test]
fn a_world_whose_own_ego_is_broken_neither_trains_nor_reports() {
    let dir = scratch();
    let broken = at_step("echo boom >&2; exit 7");
    let world = world(&dir, &broken);
    let check = brakecheck(&["check", &world, "--allow-programs", "--json"]);
    assert_eq!(code(&check), 3, "{}", stderr(&check));
    assert_eq!(json(&check)["programs"][0]["fault"]["kind"], "ended");
    assert_eq!(json(&check)["programs"][0]["hello"]["name"], "fake");
    let run = path(&dir, "run");
    let train = [
        "train",
        &world,
        "-o",
        &run,
        "--plant",
        "kinematic",
        "--decisions",
        "500",
        "--allow-programs",
    ];
    let trained = brakecheck(&train);
    assert_eq!(code(&trained), 3, "{}", stderr(&trained));
    // The same where training would begin with a search.
    let text = std::fs::read_to_string(&world).expect("a world");
    let lines = text.lines().filter(|line| !line.contains("learner: Dqn("));
    let searching = path(&dir, "searching.ron");
    std::fs::write(&searching, lines.collect::<Vec<_>>().join("\n")).expect("written");
    let searched = path(&dir, "searched");
    let mut train = train;
    (train[1], train[3]) = (&searching, &searched);
    let trained = brakecheck(&train);
    assert_eq!(code(&trained), 3, "{}", stderr(&trained));
    assert!(stderr(&trained).contains("boom"), "{}", stderr(&trained));
    assert!(
        stderr(&trained).contains("exit status: 7"),
        "{}",
        stderr(&trained)
    );
    assert!(stderr(&trained).contains("boom"), "{}", stderr(&trained));
    // What was there is kept: the mended ego goes on.
    let manifest = std::fs::read_to_string(dir.path().join("run/manifest.json"));
    assert!(manifest.is_ok());

    let kept = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
    let reused = kept.replacen(
        "reuse: {",
        &format!("reuse: {{ \"broken\": Change(controller: Some(Process(command: [\"sh\", \"-c\", r##\"{broken}\"##]))),"),
        1,
    );
    let (world, run) = (path(&dir, "reused.ron"), path(&dir, "sound"));
    std::fs::write(&world, &reused).expect("written");
    let options = [
        "--plant",
        "kinematic",
        "--decisions",
        "2000",
        "--starts",
        "5",
    ];
    let trained = brakecheck(&[&["train", &world, "-o", &run][..], &options].concat());
    assert_eq!(code(&trained), 0, "{}", stderr(&trained));
    let report = ["report", &run, "--starts", "10", "--reuse-starts", "5"];
    assert_eq!(code(&brakecheck(&report)), 2, "nobody allowed its programs");
    let report = brakecheck(&[&report[..], &["--allow-programs"]].concat());
    assert_eq!(code(&report), 3, "{}", stderr(&report));
    let junit = std::fs::read_to_string(dir.path().join("sound/report.junit.xml")).expect("it");
    assert!(
        junit.contains("<error ") && junit.contains("type=\"ended\""),
        "{junit}"
    );
    let page = std::fs::read_to_string(dir.path().join("sound/report.html")).expect("it");
    assert!(page.contains("exit status: 7"), "the page tells of it");

    // On a page of the broken ego alone, no share is known and nothing was kept.
    let file = path(&dir, "broken.html");
    let asked = ["report", &run, "--ego", "broken", "--allow-programs"];
    let starts = ["--starts", "3", "--reuse-starts", "3", "-o", &file];
    let report = brakecheck(&[&asked[..], &starts].concat());
    assert_eq!(code(&report), 3, "{}", stderr(&report));
    let page = std::fs::read_to_string(&file).expect("it");
    assert!(page.contains("No test start has a result."), "{page}");
    assert!(!page.contains("on none of the test starts"), "{page}");
    let tiles = page.split("class=\"tiles\"").nth(1).expect("tiles");
    let shares = tiles.split("<h2>").next().unwrap_or_default();
    assert_eq!(shares.matches("<b>–</b>").count(), 4, "{shares}");
    assert!(!shares.contains("0.0 %"), "{shares}");
}

#[test]
fn an_ego_that_fails_now_and_then_is_in_no_rate_and_may_be_allowed() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    // It dies in its third episode, and again in every third after that.
    let third = format!("r=$((${{r:-0}}+1)); [ $r -gt 2 ] && exit 9; {READY}");
    let ego = change(&dir, 0, &at_reset(&third), "now-and-then");
    let eval = |allow: &str| {
        brakecheck(&[
            "eval",
            &run,
            "--starts",
            "12",
            "--ego",
            &ego,
            "--allow-programs",
            "--json",
            "--jobs",
            "1",
            "--allow-invalid",
            allow,
        ])
    };
    let strict = eval("0");
    assert_eq!(code(&strict), 3, "{}", stderr(&strict));
    let row = json(&strict)["rows"][0].clone();
    let count = |key: &str| row[key].as_u64().expect(key);
    assert!(count("invalid") > 0 && count("starts") > 0, "{row}");
    let solved = row["solved"].as_str().expect("marks");
    let marks = |mark: char| solved.chars().filter(|m| *m == mark).count() as u64;
    assert_eq!(
        (marks('x'), marks('0') + marks('1')),
        (count("invalid"), count("starts"))
    );
    assert_eq!(count("starts") + count("invalid") + count("trivial"), 12);
    assert_eq!(row["faults"][0]["count"], row["invalid"]);
    let lenient = eval("0.5");
    assert_eq!(code(&lenient), 0, "{}", stderr(&lenient));
    assert_eq!(json(&lenient)["rows"][0]["solved"], row["solved"]);
}

#[test]
fn an_ego_that_ends_at_once_never_passes_whatever_is_allowed() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &[]);
    let kept = path(&dir, "kept");
    let keep = format!("{kept},most=1");
    brakecheck(&["eval", &run, "--starts", "12", "--keep", &keep]);
    // The nominal ego ran in the same commands, and must not excuse this one.
    for verb in [
        &["eval", &run, "--starts", "6"][..],
        &["search", &run, "--starts", "3"],
        &[
            "gate",
            &run,
            "--starts",
            "6",
            "--baseline-ego",
            "longer gap",
        ],
        &["replay", &kept],
    ] {
        let rest = ["--allow-invalid", "1", "--", "sh", "-c", "exit 0"];
        let output = brakecheck(&[verb, &rest].concat());
        assert_eq!(code(&output), 3, "{verb:?}: {}", stderr(&output));
    }
    // A run that was cut off has no robustness.
    let output = brakecheck(&["replay", &kept, "--json", "--", "sh", "-c", "exit 0"]);
    let rows = json(&output)["rows"].as_array().expect("rows").clone();
    assert!(rows.iter().all(|row| row["robustness"].is_null()));
}

#[test]
fn nothing_that_a_file_names_is_started_without_consent() {
    let dir = scratch();
    let (run, _) = small_run(&dir, "run", &["--seed", "1"]);
    let marker = dir.path().join("started");
    let touch = format!("touch {}", marker.display());
    let ego = change(&dir, 0, &touch, "consent");
    let world = world(&dir, &touch);
    let kept = root().join("tests/regressions/acc-2D-plant-0002.ron");
    let mut with_program = Counterexample::load(&kept).expect("kept");
    let program = Process::new(["sh", "-c", &touch]);
    with_program.change.controller = Some(program.into());
    let samples = with_program.samples(&kept).expect("whole").expect("there");
    let tampered = path(&dir, "tampered.ron");
    with_program
        .save(Path::new(&tampered), &samples)
        .expect("written");
    let out = path(&dir, "out.rrd");
    let trained = path(&dir, "trained");
    let mut asked: Vec<Vec<&str>> = vec![
        vec!["check", &world],
        vec!["train", &world, "-o", &trained],
        vec!["train", "worlds/acc.ron", "-o", &trained, "--ego", &ego],
        vec!["search", &world],
        vec!["search", "worlds/acc.ron", "--ego", &ego],
        vec!["search", &run, "--ego", &ego],
        vec!["eval", &run, "--ego", &ego],
        vec!["eval", &run, "--ego", &ego, "--theorems"],
        vec![
            "replay",
            "tests/regressions/acc-2D-plant-0002.ron",
            "--ego",
            &ego,
        ],
        vec!["replay", &tampered],
        vec!["replay", &tampered, "--expect", "recorded"],
    ];
    if cfg!(feature = "rerun") {
        asked.push(vec!["view", &tampered, "-o", &out]);
        asked.push(vec![
            "view",
            "tests/regressions/acc-2D-plant-0002.ron",
            "--ego",
            &ego,
            "-o",
            &out,
        ]);
    }
    for args in &asked {
        let output = brakecheck(args);
        let wanted = if args[0] == "check" { 0 } else { 2 };
        assert_eq!(code(&output), wanted, "{args:?}: {}", stderr(&output));
        assert!(!marker.exists(), "{args:?} started the program");
    }
    let named = brakecheck(&["replay", &tampered]);
    assert!(stderr(&named).contains("touch") && stderr(&named).contains("--allow-programs"));
    let listed = brakecheck(&["check", &world, "--json"]);
    assert_eq!(json(&listed)["programs"][0]["started"], false);
    let guard = Regressions::load(&tampered).expect("kept");
    // A test that returns the error prints what the command line does.
    let printed = ErrorReport::from(guard.pass().expect_err("no consent"));
    assert_eq!(format!("{printed:?}").trim(), stderr(&named).trim());
    assert!(matches!(
        guard.pass(),
        Err(RegressionError::NotAllowed { .. })
    ));
    assert!(matches!(
        guard.reproduce(),
        Err(RegressionError::NotAllowed { .. })
    ));
    assert!(!marker.exists());
    // And with it they are: the marker is no accident.
    brakecheck(&["replay", &tampered, "--allow-programs"]);
    assert!(marker.exists());
}

#[test]
fn an_ego_that_alternates_gives_no_result_and_its_crash_is_kept_for_good() {
    let dir = scratch();
    // Every other episode it coasts, every other it brakes.
    let moody = Fake {
        reset: &format!("r=$((1-${{r:-0}})); {READY}"),
        step: "echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":$((r*-6))}\"",
        ..SOUND
    };
    let (run, _) = small_run(&dir, "run", &[]);
    let ego = change(&dir, 0, &moody.script(), "moody");
    let crashes = path(&dir, "crashes");
    let eval = brakecheck(&[
        "eval",
        &run,
        "--starts",
        "10",
        "--ego",
        &ego,
        "--allow-programs",
        "--jobs",
        "1",
        "--details",
        "--keep",
        &crashes,
    ]);
    assert_eq!(code(&eval), 3, "{}", stderr(&eval));
    assert!(
        stderr(&eval).contains("keeps state over `reset`"),
        "{}",
        stderr(&eval)
    );
    // Nothing is claimed that nobody could ask.
    assert!(stderr(&eval).contains("not deterministic"));
    assert!(!stderr(&eval).contains("no single action"));
    // The world's side repeats what the ego commanded, without the ego.
    let recorded = brakecheck(&["replay", &crashes, "--expect", "recorded", "--json"]);
    assert_eq!(code(&recorded), 0, "{}", stderr(&recorded));
    let rows = json(&recorded)["rows"].as_array().expect("rows").clone();
    assert!(!rows.is_empty() && rows.iter().all(|row| row["identical"] == true));
    // One process for all files: every other replay brakes instead.
    let live = brakecheck(&["replay", &crashes, "--allow-programs", "--json"]);
    let rows = json(&live)["rows"].as_array().expect("rows").clone();
    assert!(
        rows.iter().all(|row| row["repeats_by_commands"] == true),
        "{rows:?}"
    );
    // A run in which the ego commanded otherwise is not the recorded one.
    let as_recorded = |row: &serde_json::Value| row["identical"] == row["ego_as_recorded"];
    assert!(rows.iter().all(as_recorded), "{rows:?}");
    if rows.len() > 1 {
        assert!(
            rows.iter().any(|row| row["ego_as_recorded"] == false),
            "{rows:?}"
        );
    }
}

/// A world with repeats, and a program as its ego.
struct RepeatedWorld {
    dir: tempfile::TempDir,
    world: String,
    ego: String,
}

impl RepeatedWorld {
    fn new(program: &Fake<'_>, repeats: &str) -> RepeatedWorld {
        let dir = scratch();
        let text = std::fs::read_to_string(root().join("worlds/acc.ron")).expect("the world");
        let text = text.replacen("plant: Rigid,", &format!("plant: Kinematic, {repeats},"), 1);
        let world = path(&dir, "repeated.ron");
        std::fs::write(&world, text).expect("written");
        let ego = change(&dir, 0, &program.script(), "moody");
        RepeatedWorld { dir, world, ego }
    }

    fn with_ego<'a>(&'a self, words: &[&'a str]) -> std::process::Output {
        let of_ego = [
            "--ego",
            &self.ego,
            "--allow-programs",
            "--jobs",
            "1",
            "--json",
        ];
        brakecheck(&[words, &of_ego].concat())
    }

    /// Returns the row of the constant ado, from an evaluation with this exit code.
    fn row(&self, exit: i32) -> Value {
        let run = path(&self.dir, "run");
        let train = ["train", &self.world, "-o", &run, "--decisions", "2000"];
        let trained = brakecheck(&[&train[..], &["--starts", "6", "--json"]].concat());
        assert_eq!(code(&trained), 0, "{}", stderr(&trained));
        let eval = self.with_ego(&["eval", &run, "--starts", "12", "--ado", "constant"]);
        assert_eq!(code(&eval), exit, "{}", stderr(&eval));
        json(&eval)["rows"][0].clone()
    }
}

#[test]
fn repeats_play_a_random_ego_several_times_and_gate_on_some_of_its_runs() {
    // It coasts or brakes by a draw at the start, and adds a draw of up to 4 m/s² at each
    // step: without it, runs that differ by one draw alone could look like those of a clock.
    let random = Fake {
        reset: &format!("w=$(($(od -An -N2 -tu2 /dev/urandom)+0)); r=$((w%2)); {READY}"),
        step: "w=$(((w*1103515245+12345)%2147483648)); echo \
               \"{\\\"id\\\":$id,\\\"accel_mps2\\\":$((w/65536%801-400*(1+r)))e-2}\"",
        ..SOUND
    };
    // It coasts into a braking leader in about every other run: a failure where one
    // of four is enough, and more rarely where three are needed.
    let [any, most] = ["repeats: 4", "repeats: (runs: 4, gate: 3)"]
        .map(|repeats| RepeatedWorld::new(&random, repeats).row(0));
    for row in [&any, &most] {
        assert_eq!(row["repeats"]["runs"], 4, "{row}");
        assert_eq!(row["sims_per_start"], 4.0, "{row}");
        let differing = row["repeats"]["differing"].as_u64().expect("a number");
        assert!(differing > 0, "{row}");
        let share = row["repeats"]["failing_share"].as_f64().expect("a share");
        assert!(share > 0.0 && share < 1.0, "{row}");
    }
    let (any, most) = (&any["successes"], &most["successes"]);
    assert!(most.as_u64() < any.as_u64(), "{most} of {any}");
}

#[test]
fn repeats_are_played_and_cure_no_state_over_resets() {
    let moody = Fake {
        reset: &format!("r=$((1-${{r:-0}})); {READY}"),
        step: "echo \"{\\\"id\\\":$id,\\\"accel_mps2\\\":$((r*-6))}\"",
        ..SOUND
    };
    // It coasts into a braking leader in every other run, so a start has no answer.
    for repeats in ["repeats: 4", "repeats: (runs: 4, gate: 3)"] {
        let repeated = RepeatedWorld::new(&moody, repeats);
        let search = [
            "search",
            &repeated.world,
            "--method",
            "hold",
            "--budget",
            "2",
        ];
        let search = repeated.with_ego(&[&search[..], &["--starts", "6"]].concat());
        // Repeats do not cure state over resets.
        assert_eq!(code(&search), 3, "{}", stderr(&search));
        let row = repeated.row(3);
        assert_eq!(row["sims_per_start"], 4.0, "{row}");
        assert_eq!(
            (&row["starts"], &row["successes"]),
            (&0.into(), &0.into()),
            "{row}"
        );
        assert!(
            row["repeats"].is_null() && row["success_rate"].is_null(),
            "{row}"
        );
        assert_eq!(row["faults"][0]["kind"], "kept_state", "{row}");
    }
}
