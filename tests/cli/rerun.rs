//! Streams for the viewer: bytes on the right output, and results as without them.

use brakecheck::experiment::Watch;
use brakecheck::training::{TrainRequest, TrainSession};
use brakecheck::world::Scenario;

use super::{brakecheck, code, json, path, scratch, stderr};

/// First bytes of a stream, as of an `.rrd` file.
const BEGINNING: &[u8] = b"RRF2";

#[test]
fn a_training_streams_to_stdout_and_prints_its_table_beside() {
    let dir = scratch();
    let train = |name: &str, more: &[&str]| {
        let run = path(&dir, name);
        let mut args = vec!["train", "worlds/acc.ron", "-o", &run, "--starts", "10"];
        args.extend(["--plant", "kinematic", "--decisions", "4000"]);
        args.extend(more);
        let output = brakecheck(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        (
            std::fs::read(path(&dir, name) + "/policy.safetensors").expect("a policy"),
            output,
        )
    };
    let (watched, output) = train("watched", &["--rerun", "-"]);
    assert!(output.stdout.starts_with(BEGINNING));
    let said = stderr(&output);
    assert!(
        said.contains("streamed ") && said.contains("constant"),
        "{said}"
    );
    let file = path(&dir, "live.rrd");
    let (to_file, output) = train("file", &["--rerun", &file, "--json"]);
    assert!(json(&output)["decisions"].as_u64() >= Some(4000));
    assert!(
        std::fs::read(&file)
            .expect("a stream")
            .starts_with(BEGINNING)
    );
    let (alone, _) = train("alone", &[]);
    assert!(
        alone == watched && alone == to_file,
        "a viewer changed the policy"
    );
}

#[test]
fn a_refused_training_of_several_ados_leaves_no_stream() {
    let dir = scratch();
    let (file, run) = (path(&dir, "live.rrd"), path(&dir, "run"));
    // A grid has no cells, and `cut_in` no family.
    for (world, many) in [
        ("worlds/grid.ron", "--distinct"),
        ("worlds/cut_in.ron", "--league"),
    ] {
        let output = brakecheck(&["train", world, many, "2", "-o", &run, "--rerun", &file]);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        assert!(!std::path::Path::new(&file).exists(), "{world}");
    }
}

#[test]
fn rows_do_not_depend_on_a_stream() {
    let dir = scratch();
    let file = path(&dir, "search.rrd");
    let search = |more: &[&str]| {
        let mut args = vec!["search", "worlds/acc.ron", "--starts", "6", "--json"];
        args.extend(["--plant", "kinematic", "--switches", "1"]);
        args.extend(more);
        let output = brakecheck(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let mut rows = json(&output)["rows"].take();
        for row in rows.as_array_mut().expect("rows") {
            row["cpu_s"].take();
        }
        rows
    };
    assert_eq!(search(&["--rerun", &file]), search(&[]));
    assert!(
        std::fs::read(&file)
            .expect("a stream")
            .starts_with(BEGINNING)
    );
}

#[test]
fn all_counterexamples_are_streamed_on_request() {
    let dir = scratch();
    let file = path(&dir, "all.rrd");
    let mut args = vec!["search", "worlds/acc.ron", "--starts", "20", "--json"];
    args.extend(["--plant", "kinematic", "--rerun", &file, "--rerun-all"]);
    let output = brakecheck(&args);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let successes = json(&output)["rows"][0]["successes"].as_u64();
    let count = successes.expect("a number");
    // More than are shown within the share of the processor time.
    assert!(count > 5, "{count}");
    let said = format!("streamed {count} of {count} episodes");
    assert!(stderr(&output).contains(&said), "{}", stderr(&output));
    // It is no option without a stream.
    let output = brakecheck(&["search", "worlds/acc.ron", "--rerun-all"]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[test]
fn a_stream_that_the_disk_refuses_is_a_fault() {
    let dir = scratch();
    let file = path(&dir, "full.rrd");
    std::os::unix::fs::symlink("/dev/full", &file).expect("a link");
    let mut args = vec![
        "search",
        "worlds/acc.ron",
        "--starts",
        "6",
        "--switches",
        "1",
    ];
    args.extend(["--plant", "kinematic", "--rerun", &file]);
    let output = brakecheck(&args);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("cannot be written"));
}

#[test]
fn a_directory_becomes_one_recording() {
    let dir = scratch();
    let file = path(&dir, "all.rrd");
    let output = brakecheck(&["view", "tests/regressions", "--rerun", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let files = std::fs::read_dir(super::root().join("tests/regressions")).expect("a directory");
    let kept = files
        .flatten()
        .filter(|it| it.path().extension().is_some_and(|e| e == "ron"));
    let said = format!("streamed {} episodes", kept.count());
    assert!(stderr(&output).contains(&said), "{}", stderr(&output));
    let one = path(&dir, "one.rrd");
    let output = brakecheck(&["view", "tests/regressions", "1", "--rerun", &one]);
    assert!(
        stderr(&output).contains("streamed 1 episode"),
        "{}",
        stderr(&output)
    );
    let bytes = |file: &str| std::fs::metadata(file).expect("a stream").len();
    assert!(10 * bytes(&one) < bytes(&file));
}

#[test]
fn a_training_can_be_viewed_before_it_ends() {
    let dir = scratch();
    let run = path(&dir, "run");
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    let world = world.on(brakecheck::world::PlantKind::Kinematic);
    let request = TrainRequest {
        decisions: Some(100_000),
        ..TrainRequest::default()
    };
    let mut session = TrainSession::begin(&world, run.as_ref(), &request).expect("begun");
    // Stopped after its first successes, as by Ctrl-C.
    let stop = std::sync::atomic::AtomicBool::new(false);
    let progress = |done: u64, total: u64| {
        if total == 100_000 && done > 8_000 {
            stop.store(true, std::sync::atomic::Ordering::Relaxed);
        }
    };
    let outcome = session
        .train(&Watch::new(&progress, &stop))
        .expect("trained");
    assert!(outcome.interrupted);
    drop(session);
    let file = path(&dir, "newest.rrd");
    let output = brakecheck(&["view", &run, "-o", &file]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = brakecheck(&["view", &run, "--rerun", &file]);
    assert!(
        stderr(&output).contains("streamed 20 episodes"),
        "{}",
        stderr(&output)
    );
    let output = brakecheck(&["view", &run, "99", "-o", &file]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(stderr(&output).contains("number 0 is its newest"));
    let output = brakecheck(&["view", &run, "first", "-o", &file]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
}

#[cfg(not(feature = "connect"))]
#[test]
fn a_connection_needs_its_feature() {
    let args = [
        "search",
        "worlds/acc.ron",
        "--starts",
        "1",
        "--rerun",
        "connect",
    ];
    let output = brakecheck(&args);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(stderr(&output).contains("--features connect"));
}

#[test]
fn requests_without_a_place_for_the_stream_are_refused() {
    let dir = scratch();
    let run = path(&dir, "run");
    let nowhere = path(&dir, "no such directory/live.rrd");
    let cases: [(&[&str], &str); 4] = [
        (&["--rerun", "-", "--json"], "both write to standard output"),
        (&["--rerun", &nowhere], "no such directory"),
        // Another file is never overwritten.
        (&["--rerun", "worlds/acc.ron"], "end it with `.rrd`"),
        (&["--rerun"], "a value is required"),
    ];
    for (more, says) in cases {
        let mut args = vec!["search", "worlds/acc.ron", "--starts", "1"];
        args.extend(more);
        let output = brakecheck(&args);
        assert_eq!(code(&output), 2, "{more:?}: {}", stderr(&output));
        assert!(
            stderr(&output).contains(says),
            "{more:?}: {}",
            stderr(&output)
        );
        // A refused training leaves nothing behind.
        let mut args = vec!["train", "worlds/acc.ron", "-o", &run];
        args.extend(more);
        assert_eq!(code(&brakecheck(&args)), 2, "{more:?}");
        assert!(!std::path::Path::new(&run).exists(), "{more:?}");
    }
}

/// A stream that ends early is no recording, although the command itself went well.
#[cfg(target_os = "linux")]
#[test]
fn a_stream_to_a_full_disk_is_a_failure() {
    let dir = scratch();
    let file = path(&dir, "full.rrd");
    std::os::unix::fs::symlink("/dev/full", &file).expect("a link");
    let plant = ["--starts", "2", "--plant", "kinematic"];
    let output = brakecheck(&[&["search", "acc", "--rerun", &file], &plant[..]].concat());
    let said = stderr(&output);
    assert_eq!(code(&output), 3, "{said}");
    assert!(said.contains("the stream cannot be written"), "{said}");
}
