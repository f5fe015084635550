//! Kept counterexamples: refused, or replayed in the world that is in them.

use brakecheck::crashes::SavedCounterexample;
use brakecheck::rulebook::Verdict;
use brakecheck::run_dir::{Counterexample, KeptError};
use brakecheck::trace::Trace;
use brakecheck_crashes::crashes::replay::replay;
use brakecheck_experiment::run_dir::counterexample::digests_of;
use brakecheck_experiment::run_dir::motion_after_contact;

use super::corpus::{self, Source};
use super::harness::{Seen, Target};
use super::mutate::{mutants, without_a_number};

/// Physics steps of a replay at most.
const AFFORDABLE: u64 = 30_000;

/// Most of them are changed in the recording only, not in its world.
fn recordings() -> Vec<Source> {
    let whole = corpus::files("tests/regressions", "ron");
    let heads: Vec<Source> = whole
        .iter()
        .map(|source| source.clone().before("    digests: "))
        .collect();
    // As it would be of a program as the ego, and of a changed one.
    let told = heads
        .iter()
        .filter(|head| head.text.contains("ego: {},"))
        .map(|head| {
            let text = head.text.replacen("ego: {},", "ego: {\"lag_s\": 0.3},", 1);
            let commands = "    ego_commands: [(0.5, 0.0), (-2.0, 0.25), (1.0, 0.0)],\n";
            Source {
                name: format!("{} and commands", head.name),
                text: text + commands,
                tail: head.tail.clone(),
            }
        });
    let told: Vec<Source> = told.collect();
    assert!(!told.is_empty());
    [heads.clone(), heads, told, whole].concat()
}

#[test]
fn any_kept_file_is_refused_or_replays_alike_each_time() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("mutant.ron");
    let target = Target {
        name: "kept",
        cases: 100,
        shrinks: 100,
        least_percent: (10, 20),
    };
    target.run(&mutants(recordings().into()), |mutant| {
        std::fs::write(&path, corpus::resealed(&mutant.text)).expect("written");
        let Ok(counterexample) = Counterexample::load(&path) else {
            return Seen::Refused;
        };
        finite(&counterexample);
        let scenario = match counterexample.scenario(&path) {
            Ok(scenario) => scenario,
            Err(KeptError::World { source, .. }) => {
                return super::worlds::refused(&source, &counterexample.world_file);
            }
            Err(error) => {
                assert!(!error.to_string().is_empty());
                return Seen::Refused;
            }
        };
        let Ok(start) = counterexample.start(&scenario, &path) else {
            return Seen::Refused;
        };
        let axes = scenario.axes();
        let mut inside = axes.iter().zip(&start.0);
        assert!(inside.all(|(axis, value)| axis.lo <= *value && *value <= axis.hi));
        let actions = scenario.spaces().actions;
        assert!(
            counterexample
                .actions
                .iter()
                .all(|action| *action < actions)
        );
        let clock = *scenario.world().clock();
        let steps = clock.samples() as u64 * u64::from(clock.substeps);
        if steps * scenario.repeats().runs as u64 > AFFORDABLE {
            return Seen::Accepted;
        }
        let kept = SavedCounterexample {
            path: path.clone(),
            counterexample,
        };
        let first = replay(&kept, scenario.clone()).unwrap_or_else(|error| panic!("{error}"));
        let second = replay(&kept, scenario.clone()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(first.episode, second.episode);
        let then = &kept.counterexample.motion_after_contact;
        let goes_on_alike = then.is_empty()
            || motion_after_contact(&scenario, &first.episode).unwrap_or_default() == *then;
        let same = goes_on_alike && recorded_alike(&kept.counterexample, &first.episode.trace);
        // With commands in it another episode is compared: those repeated.
        if kept.counterexample.ego_commands.is_empty() {
            assert_eq!(first.first_difference.is_none(), same);
            assert!(same || !first.identical);
        }
        assert_eq!(first.identical, second.identical);
        let success = matches!(first.episode.verdict, Verdict::Counterexample { .. });
        assert_eq!(first.still_fails(), success);
        Seen::Accepted
    });
}

/// Whether the digests are those of the signals that it names.
fn recorded_alike(kept: &Counterexample, trace: &Trace) -> bool {
    let schema = trace.schema();
    let named = kept.signals.iter().map(|name| schema.position(name));
    let columns: Option<Vec<usize>> = if kept.signals.is_empty() {
        Some((0..schema.len()).collect())
    } else {
        named.collect()
    };
    columns.is_some_and(|columns| digests_of(trace, &columns) == kept.digests)
}

/// What a world is begun and moved with is a number.
fn finite(kept: &Counterexample) {
    let commands = kept
        .ego_commands
        .iter()
        .flat_map(|&(accel, lateral)| [accel, lateral]);
    let changed = kept.change.ego.0.values().copied();
    let mut numbers = kept.start.values().copied().chain(changed).chain(commands);
    assert!(numbers.all(f64::is_finite));
}

#[test]
fn no_number_of_a_start_a_change_or_a_command_may_be_none() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join("none.ron");
    let told = recordings()
        .into_iter()
        .filter(|source| source.name.starts_with("acc") && source.text.contains("ego_commands"));
    let (mut refused, mut read) = (0, 0);
    for source in told {
        for text in without_a_number(&source.text) {
            let text = corpus::resealed(&(text + &source.tail));
            std::fs::write(&path, text).expect("written");
            match Counterexample::load(&path) {
                Ok(counterexample) => {
                    finite(&counterexample);
                    read += 1;
                }
                Err(_) => refused += 1,
            }
        }
    }
    // A robustness may be infinite.
    assert!(refused > 20 && read > 0, "{refused} and {read}");
}
