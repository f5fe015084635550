//! Kept counterexamples replay bit for bit, on any x86-64 machine.

use brakecheck::campaign::Regressions;

fn kept() -> Regressions {
    let dir = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regressions");
    Regressions::load(dir).expect("kept counterexamples")
}

#[test]
fn kept_counterexamples_replay_bit_for_bit() {
    kept().reproduce().unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn they_still_fail_the_ego_they_were_recorded_with() {
    let error = kept().pass().expect_err("the ego is as it was");
    assert!(error.to_string().contains("still fails"), "{error}");
}

#[test]
fn every_one_is_a_violation_with_a_contact_and_all_rules_kept() {
    for kept in kept().kept() {
        let counterexample = &kept.counterexample;
        assert!(
            counterexample.verdict.is_success(),
            "{}",
            kept.path.display()
        );
        assert!(counterexample.robustness < 0.0);
        assert!(!counterexample.digests.is_empty());
    }
}
