//! Kept counterexamples replay bit for bit, on any x86-64 machine.

use std::sync::Arc;

use brakecheck::crashes::Regressions;
use brakecheck::crashes::SavedCounterexample;
use brakecheck::rulebook::JudgeKind;
use brakecheck::run_dir::trace_of_csv;
use brakecheck::stl::Scratch;
use brakecheck::trace::Trace;
use brakecheck::world::Scenario;
use brakecheck_experiment::run_dir::counterexample::digests_of;

fn kept() -> Regressions {
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regressions");
    Regressions::load(dir).expect("kept counterexamples")
}

fn name(kept: &SavedCounterexample) -> String {
    let stem = kept.path.file_stem().expect("a file");
    stem.to_string_lossy().into_owned()
}

#[test]
fn kept_counterexamples_replay_bit_for_bit() {
    kept().reproduce().unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn signals_that_were_added_later_are_not_recorded_into_their_rows() {
    for kept in kept().kept() {
        let world = kept.counterexample.scenario(&kept.path).expect("a world");
        let now: Vec<&str> = world
            .world()
            .schema()
            .signals()
            .iter()
            .map(|signal| signal.name.as_str())
            .collect();
        assert_eq!(kept.counterexample.signals, now, "{}", name(kept));
    }
}

#[test]
fn they_still_fail_the_ego_they_were_recorded_with() {
    let error = kept().pass().expect_err("the ego is as it was");
    assert!(error.to_string().contains("still fails"), "{error}");
}

/// The world in a file, and the samples beside it as that world's signals.
fn recorded(kept: &SavedCounterexample) -> (Scenario, Trace) {
    let world = kept.counterexample.scenario(&kept.path).expect("a world");
    let csv = std::fs::read_to_string(kept.path.with_extension("csv")).expect("samples");
    let stored = trace_of_csv(&csv, None).expect("samples");
    let schema = world.world().schema();
    let mut trace = Trace::new(Arc::clone(schema));
    let columns: Vec<&[f64]> = schema
        .signals()
        .iter()
        .map(|signal| stored.signal(&signal.name).expect("recorded"))
        .collect();
    for sample in 0..stored.len() {
        let row: Vec<f64> = columns.iter().map(|column| column[sample]).collect();
        trace.push(&row).expect("finite");
    }
    let all: Vec<usize> = (0..schema.len()).collect();
    assert_eq!(digests_of(&trace, &all), kept.counterexample.digests);
    (world, trace)
}

#[test]
fn every_one_violates_the_specification_with_every_rule_kept_until_then() {
    let mut scratch = Scratch::new();
    for kept in kept().kept() {
        let (world, mut trace) = recorded(kept);
        let (name, file, book) = (name(kept), &kept.counterexample, world.rulebook());
        trace.truncate(file.judged);
        assert_eq!(trace.len(), file.judged, "{name}");
        assert_eq!(
            book.judge_whole(&trace, &mut scratch),
            file.verdict,
            "{name}"
        );
        let robustness = book.spec.robustness(&trace, &mut scratch);
        assert!(robustness < 0.0 && robustness == file.robustness, "{name}");
        assert!(!book.rules.is_empty(), "{name}");
        for rule in &book.rules {
            let margin = rule.monitor.robustness(&trace, &mut scratch);
            assert!(margin > 0.0, "{name}: `{}` {margin}", rule.name);
        }
        // No sample earlier the verdict was open, unless it waits for the contact.
        if world.rulebook().judge == JudgeKind::UntilContact {
            continue;
        }
        trace.truncate(file.judged - 1);
        let before = book.judge_whole(&trace, &mut scratch);
        assert!(!before.is_success(), "{name}: {before:?}");
    }
}

/// Which of them end in contact, and whether the rules held up to it.
const CONTACTS: &str = "\
acc-2D-plant-0002: kept
acc-nominal-0001: kept
acc-nominal-0002: kept
acc-wet-road-0001: kept
acc_iso-nominal-0005: kept
bend-3D-plant-0001: no contact
bend-nominal-0001: no contact
cut_in-nominal-0000: kept
cut_in-nominal-0001: kept
cut_in_clear-idm-0074: kept
grid-hard-nominal-cells-0-0000: kept
grid-hard-nominal-cells-0-0001: kept
light_ado-nominal-0000: no contact
light_ado-nominal-0001: no contact
merge-nominal-0000: kept
merge-nominal-0001: no contact
merge_fair-nominal-0000: kept
merge_fair-nominal-0001: kept
pedestrian-nominal-0001: no contact
pedestrian-nominal-0004: no contact
sandwich-nominal-0000: kept
sandwich-nominal-0001: kept
yellow_light-nominal-0001: no contact
yellow_light-nominal-0003: no contact
";

#[test]
fn those_with_a_contact_keep_or_break_their_rules_until_it_as_listed() {
    let mut listed = String::new();
    for replayed in kept().replay().expect("replayed") {
        let stem = replayed.path.file_stem().expect("a file").to_string_lossy();
        let episode = &replayed.episode;
        let rules = episode.rules_until_contact.as_ref();
        assert_eq!(episode.contact.is_some(), rules.is_some(), "{stem}");
        listed.push_str(&match rules {
            None => format!("{stem}: no contact\n"),
            Some(rules) => format!("{stem}: {rules}\n"),
        });
    }
    assert_eq!(listed, CONTACTS, "\n{listed}");
}

#[test]
fn the_recorded_samples_say_the_same_of_the_rules_until_contact() {
    let regressions = kept();
    let replayed = regressions.replay().expect("replayed");
    for (kept, replayed) in regressions.kept().iter().zip(replayed) {
        let Some(rules) = replayed.episode.rules_until_contact else {
            continue;
        };
        let (world, trace) = recorded(kept);
        let samples = world.world().clock().samples();
        let mut row = vec![0.0; trace.schema().len()];
        let lost = world.rulebook().rules.iter().any(|rule| {
            let mut monitor = rule.monitor.online_for(samples);
            (0..trace.len()).any(|sample| {
                trace.read_row(sample, &mut row);
                monitor.push(&row).expect("a sample").hi <= 0.0
            })
        });
        assert_eq!(lost, !rules.is_kept(), "{}", name(kept));
    }
}
