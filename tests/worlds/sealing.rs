//! Damaged files are refused, whichever bit it is; what is resumed is the same.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use brakecheck::cli::Failure;
use brakecheck::crashes::Regressions;
use brakecheck::experiment::Watch;
use brakecheck::run_dir::RequestedTraining;
use brakecheck::run_dir::{Counterexample, RunDir, RunError};
use brakecheck::seed::generator;
use brakecheck::training::{TrainError, TrainRequest, TrainSession};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_training::training::train_loop::train;
use rand::RngExt;
use sha2::{Digest, Sha256};

const ACC: &str = include_str!("../../worlds/acc.ron");

fn quick(decisions: u64) -> Scenario {
    let acc = Scenario::parse("acc.ron", ACC)
        .expect("a world")
        .on(PlantKind::Kinematic);
    acc.training_for(decisions).expect("in range")
}

/// Trains until so many decisions are taken.
fn train_until(scenario: &Scenario, run: &mut RunDir, most: u64) {
    let stop = AtomicBool::new(false);
    let progress = |done: u64, _: u64| stop.store(most <= done, Ordering::Relaxed);
    train(scenario, run, &Watch::new(&progress, &stop)).expect("trained");
}

/// A run in which training was stopped, and a finished one.
fn begun_and_finished(dir: &Path) -> (PathBuf, PathBuf) {
    let world = quick(12_000);
    let made = |name: &str, most: u64| {
        let mut run = RunDir::create(&dir.join(name), &world, 7).expect("a run");
        train_until(&world, &mut run, most);
        run.path().to_owned()
    };
    (made("begun", 9000), made("finished", u64::MAX))
}

/// Everything that a reader of a run verifies.
fn read_all(run: &Path) -> Result<(), RunError> {
    let run = RunDir::open(run)?;
    run.checkpoint()?;
    run.progress()?;
    run.report()?;
    if run.manifest().is_finished() {
        run.policy()?;
        run.counterexamples()?;
    }
    Ok(())
}

/// Flips bits of a file, `stride` apart, and counts those after which `read`
/// finds nothing wrong.
fn accepted(file: &Path, stride: usize, read: impl Fn() -> bool) -> Vec<usize> {
    let whole = fs::read(file).expect("a file");
    let flipped = (0..8 * whole.len())
        .step_by(stride)
        .filter(|bit| {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(file, bytes).expect("written");
            read()
        })
        .collect();
    fs::write(file, whole).expect("written");
    flipped
}

#[test]
fn no_flipped_bit_of_a_run_is_accepted() {
    let dir = tempfile::tempdir().expect("scratch");
    let (begun, finished) = begun_and_finished(dir.path());
    let manifest = RunDir::open(&begun).expect("a run").manifest().clone();
    let (checkpoint, _) = manifest.checkpoint.expect("stopped at a checkpoint");
    for (run, file, stride) in [
        (&begun, "manifest.json", 1),
        (&begun, checkpoint.as_str(), 40_009),
        (&begun, "timing.json", 1),
        (&begun, "progress.jsonl", 211),
        (&finished, "timing.json", 1),
        (&finished, "progress.jsonl", 101),
        (&finished, "manifest.json", 1),
        (&finished, "world.ron", 331),
        (&finished, "policy.safetensors", 5003),
        (&finished, "counterexamples.jsonl", 1009),
    ] {
        read_all(run).expect("whole");
        let accepted = accepted(&run.join(file), stride, || read_all(run).is_ok());
        assert_eq!(accepted, [0usize; 0], "{file}");
    }
}

#[test]
fn no_flipped_bit_of_what_a_checkpoint_vouches_for_is_gone_on_with() {
    let dir = tempfile::tempdir().expect("scratch");
    let (begun, _) = begun_and_finished(dir.path());
    for file in ["progress.jsonl", "counterexamples.jsonl"] {
        let path = begun.join(file);
        assert!(fs::metadata(&path).expect("a file").len() > 0, "{file}");
        let accepted = accepted(&path, 211, || RunDir::resume(&begun).is_ok());
        assert_eq!(accepted, [0usize; 0], "{file}");
        let whole = fs::read(&path).expect("a file");
        fs::write(&path, &whole[..whole.len() - 1]).expect("cut");
        let error = RunDir::resume(&begun).expect_err("cut").to_string();
        assert!(error.contains(file) && error.contains("bytes"), "{error}");
        fs::write(&path, &whole).expect("written");
    }
}

#[test]
fn no_flipped_bit_of_a_kept_counterexample_is_accepted() {
    let dir = tempfile::tempdir().expect("scratch");
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/regressions/acc-nominal-0001");
    let path = dir.path().join("kept.ron");
    let samples = dir.path().join("kept.csv");
    fs::copy(kept.with_extension("ron"), &path).expect("copied");
    fs::copy(kept.with_extension("csv"), &samples).expect("copied");
    let read = || {
        let kept = Counterexample::load(&path)?;
        kept.samples(&path).map(|samples| samples.is_some())
    };
    assert!(read().expect("whole"));
    for (file, stride) in [(&path, 37), (&samples, 101)] {
        let accepted = accepted(file, stride, || read().is_ok());
        assert_eq!(accepted, [0usize; 0], "{}", file.display());
    }
}

/// A large world takes a second to parse, and every ego of an evaluation asks for it.
#[test]
fn the_world_of_an_open_run_is_parsed_once() {
    let dir = tempfile::tempdir().expect("scratch");
    let path = dir.path().join("run");
    drop(RunDir::create(&path, &quick(12_000), 7).expect("a run"));
    let mut run = RunDir::open(&path).expect("a run");
    // Unreadable from here on, so whoever parsed it again would fail.
    let spoil = || fs::write(path.join("world.ron"), "Scenario()").expect("written");
    let before = run.world().expect("a world");
    spoil();
    assert_eq!(run.world().expect("as before").text(), before.text());
    run.allow_programs(true);
    let scenario = run.scenario().expect("as before, with consent");
    assert_eq!(scenario.plant(), run.manifest().plant);

    // A run that was opened before and never asked reads the file as it is now.
    fs::write(path.join("world.ron"), before.text()).expect("restored");
    let late = RunDir::open(&path).expect("a run");
    spoil();
    assert!(matches!(late.world(), Err(RunError::World(_))));
    assert!(matches!(late.world(), Err(RunError::World(_))));
}

#[test]
fn a_training_goes_on_only_as_what_it_was_begun_as() {
    let dir = tempfile::tempdir().expect("scratch");
    let (begun, finished) = begun_and_finished(dir.path());
    let run = RunDir::resume(&begun).expect("a run");
    let world = quick(12_000);
    let differences = |scenario: &Scenario, seed| {
        let asked = RequestedTraining {
            scenario,
            seed,
            ego: None,
        };
        let found = run.differences(asked).expect("compared");
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(differences(&world, 7), [""; 0]);
    assert_eq!(differences(&world, 8), ["seed: 7, now 8"]);
    assert_eq!(
        differences(&quick(12_100), 7),
        ["learner.Dqn.decisions: 12000, now 12100"]
    );
    let text = ACC.replace("\"v_lim\": 30.0", "\"v_lim\": 31.0");
    let mut other = Scenario::parse("acc.ron", &text).expect("a world");
    other = other.learning_with(world.learner().clone());
    let told = differences(&other, 7);
    assert!(
        told[0].starts_with("world file, line ") && told[0].contains("31.0"),
        "{told:?}"
    );
    assert_eq!(told[1], "plant: kinematic, now rigid");
    drop(run);

    let mut run = RunDir::resume(&begun).expect("a run");
    let stop = AtomicBool::new(false);
    let watch = Watch::new(&|_, _| {}, &stop);
    match train(&quick(12_100), &mut run, &watch) {
        Err(TrainError::Run(RunError::Differs { differences, .. })) => {
            assert_eq!(differences.len(), 1, "{differences:?}");
        }
        other => panic!("{other:?}"),
    }
    // As what it was: the bytes of the training that nobody stopped, also of a
    // run that was opened for reading.
    drop(run);
    train_until(&world, &mut RunDir::open(&begun).expect("a run"), u64::MAX);
    for file in [
        "manifest.json",
        "policy.safetensors",
        "progress.jsonl",
        "counterexamples.jsonl",
    ] {
        let bytes = |run: &Path| fs::read(run.join(file)).expect("a file");
        assert!(bytes(&begun) == bytes(&finished), "{file}");
    }
}

#[test]
fn any_seed_may_be_asked_for_when_a_training_goes_on() {
    let dir = tempfile::tempdir().expect("scratch");
    let (begun, _) = begun_and_finished(dir.path());
    let refused = |seed| {
        let request = TrainRequest {
            seed,
            ..TrainRequest::default()
        };
        let session = TrainSession::resume(&quick(12_000), &begun, &request);
        session.err().map(|error| error.to_string())
    };
    assert_eq!(refused(None), None);
    assert_eq!(refused(Some(7)), None);
    let told = refused(Some(0)).expect("another seed");
    assert!(told.contains("seed: 7, now 0"), "{told}");
}

/// Every file below a directory.
fn files(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).expect("a directory").flatten();
    let mut all: Vec<PathBuf> = entries
        .flat_map(|entry| match entry.path() {
            path if path.is_dir() => files(&path),
            path => vec![path],
        })
        .collect();
    all.sort();
    all
}

/// What all verbs together read of a finished run, as text: equal texts, equal
/// figures.
fn told(run: &Path) -> Result<String, Failure> {
    let opened = RunDir::open(run)?;
    let manifest = opened.manifest();
    let policy = opened.policy_bundle()?.to_bytes().expect("a bundle");
    let mut told = format!("{manifest:?} {:?}", manifest.cpu_s);
    told.push_str(&format!("{:?} {:?}", opened.progress()?, opened.report()?));
    told.push_str(&format!("{:?}", opened.counterexamples()?));
    told.push_str(&format!("{policy:?} {}", opened.scenario()?.text()));
    drop(RunDir::resume(run)?);
    let kept = Regressions::load(run.join("episodes")).map_err(Failure::from)?;
    for one in kept.kept() {
        let samples = one.counterexample.samples(&one.path)?;
        told.push_str(&format!("{:?} {:?}", one.counterexample, samples.is_some()));
    }
    Ok(told)
}

#[test]
fn a_flip_in_any_file_of_a_run_is_refused_by_its_name() {
    let dir = tempfile::tempdir().expect("scratch");
    let path = dir.path().join("run");
    let request = TrainRequest {
        seed: Some(7),
        ..TrainRequest::default()
    };
    let watch = Watch::unwatched();
    let mut session = TrainSession::begin(&quick(6000), &path, &request).expect("begun");
    session.train(&watch).expect("trained");
    let closing = session.evaluate(40, &watch).expect("evaluated");
    session.keep(&closing.expect("not stopped")).expect("kept");
    drop(session);
    let whole = told(&path).unwrap_or_else(|failure| panic!("{failure:?}"));
    // Stored trivial starts are played again if they are damaged, which their own tests show.
    let mut files = files(&path);
    files.retain(|file| !file.starts_with(path.join("trivial")));
    let names: Vec<String> = files
        .iter()
        .map(|file| {
            file.file_name()
                .expect("a name")
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    for name in ["report.json", "timing.json", "progress.jsonl", "world.ron"] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
    assert!(names.iter().any(|name| name.ends_with(".csv")), "{names:?}");
    let mut dice = generator("flips", &[41]);
    let mut refused = 0;
    for (file, name) in files.iter().zip(&names) {
        let bytes = fs::read(file).expect("a file");
        if bytes.is_empty() {
            continue;
        }
        for _ in 0..25 {
            let mut flipped = bytes.clone();
            let at = dice.random_range(0..flipped.len());
            flipped[at] ^= 1 << dice.random_range(0..8);
            fs::write(file, &flipped).expect("written");
            match told(&path) {
                Ok(now) => panic!(
                    "{name}, byte {at}: accepted, same figures: {}",
                    now == whole
                ),
                Err(failure) => {
                    let said = format!("{failure:?}");
                    assert!(said.contains(name.as_str()), "{name}, byte {at}: {said}");
                }
            }
            refused += 1;
        }
        fs::write(file, &bytes).expect("written");
    }
    assert!(refused >= 300, "{refused} flips");
    assert!(told(&path).expect("whole again") == whole);
}

/// A file without its seal is refused, and so is a run directory of another layout.
#[test]
fn no_seal_is_shed_and_other_formats_are_refused() {
    let dir = tempfile::tempdir().expect("scratch");
    let (_, finished) = begun_and_finished(dir.path());
    let refused = |name: &str, text: &str, why: &str| {
        let file = finished.join(name);
        let whole = fs::read(&file).ok();
        fs::write(&file, text).expect("written");
        let error = read_all(&finished).expect_err(name).to_string();
        assert!(error.contains(name) && error.contains(why), "{error}");
        // Every verb that opens the run refuses it, and not only those that read the file.
        assert!(RunDir::open(&finished).is_err(), "{name}");
        match whole {
            Some(bytes) => fs::write(&file, bytes).expect("written"),
            None => fs::remove_file(&file).expect("there"),
        }
    };
    refused("timing.json", "{\"cpu_s\":12.5}", "seal");
    refused("report.json", "[]", "damaged");
    let manifest = fs::read_to_string(finished.join("manifest.json")).expect("a manifest");
    for format in [1, 2, 4] {
        let other = manifest.replacen("\"format\": 3", &format!("\"format\": {format}"), 1);
        let why = format!("format {format} is not 3");
        refused("manifest.json", &resealed(&other), &why);
    }
    let mut unsealed: serde_json::Value = serde_json::from_str(&manifest).expect("JSON");
    unsealed
        .as_object_mut()
        .expect("an object")
        .remove("sha256");
    refused("manifest.json", &unsealed.to_string(), "sha256");
    fs::remove_file(finished.join("timing.json")).expect("there");
    let error = RunDir::open(&finished).expect_err("no time");
    let said = error.to_string();
    assert!(
        said.contains("timing.json` is damaged: it is missing"),
        "{error}"
    );
    // It is a state of the disk, and no mistake of the command line.
    assert!(matches!(error, RunError::Damaged { .. }), "{error}");

    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/regressions/acc-nominal-0001.ron");
    let text = fs::read_to_string(kept).expect("a kept file");
    let is_hash = |line: &&str| line.trim_start().starts_with("sha256:");
    let lines: Vec<&str> = text.lines().filter(|line| !is_hash(line)).collect();
    let unsealed = lines.join("\n");
    let first = unsealed.replacen("format: 2", "format: 1", 1);
    for (text, why) in [
        (&unsealed, "its SHA-256 is missing"),
        (
            &first,
            "has format 1 of kept counterexamples, and this version reads 2",
        ),
    ] {
        let path = dir.path().join("kept.ron");
        fs::write(&path, text).expect("written");
        let error = Counterexample::load(&path).expect_err(why).to_string();
        assert!(error.contains(why), "{error}");
    }
}

/// A manifest that was changed on purpose, with the hash that belongs to it.
fn resealed(text: &str) -> String {
    let value: serde_json::Value = serde_json::from_str(text).expect("JSON");
    let hash = value["sha256"].as_str().expect("sealed");
    let blank = text.replacen(hash, &"0".repeat(64), 1);
    let found = Sha256::digest(blank.as_bytes());
    let digits: String = found.iter().map(|byte| format!("{byte:02x}")).collect();
    blank.replacen(&"0".repeat(64), &digits, 1)
}
