use super::*;
use crate::ego::FaultKind;
use crate::natural::Naturalness;
use crate::severity::{RiskCurve, Side};

/// Keys that `brakecheck reference json` prints.
const KEYS: &str = include_str!("../../../../../src/cli/reference/keys.txt");

/// A row in which no key is left out.
fn complete() -> Row {
    let speed = Some(ClosingSpeed {
        median: 1.0,
        p90: 2.0,
    });
    Row {
        world: String::new(),
        plant: Dynamics::Rigid,
        judge: JudgeKind::UntilViolation,
        ego: String::new(),
        ado: AdversaryId::Trained,
        method: String::new(),
        train_seed: Some(0),
        warning: Some(CalibrationWarning {
            what: String::new(),
            help: String::new(),
        }),
        start_seed: 0,
        starts: 1,
        trivial: 0,
        fails_alone: Some(FailsAlone {
            starts: 0,
            left_out: true,
        }),
        successes: 0,
        success_rate: 0.0,
        ci95: Some([0.0, 1.0]),
        partial: Some(Partial { decided: 1, of: 2 }),
        specification: String::new(),
        counts: Some(String::new()),
        at_most: Some(1.0),
        recall: Some(0.0),
        beyond_search: Some(0),
        foul_rate: 0.0,
        violations: vec![BrokenRule {
            ado: String::new(),
            rule: String::new(),
            starts: 1,
        }],
        uncounted: Some(0),
        foul_before_contact_rate: Some(0.0),
        contact_rate: 0.0,
        closing_speed_mps: speed,
        success_closing_mps: speed,
        success_contacts: Some(SuccessContacts {
            contacts: 1,
            sides: BTreeMap::from([(Side::Front, 1)]),
            ego_at_rest: 0,
            hit_from_behind: 0,
            judged: 1,
            avoided: 1,
            not_judged: 1,
        }),
        severity: Some(ContactSeverity {
            kinds: BTreeMap::new(),
            struck_from_behind: 0.0,
            ego_delta_v_mps: 0.0,
            max_injury_risk: BTreeMap::from([(RiskCurve::OccupantMais3, 0.0)]),
        }),
        kinds: vec![FailureCount {
            leaf: String::new(),
            contact: Some(Default::default()),
            starts: 1,
        }],
        distinct: Some(1),
        naturalness: Some(NaturalnessOfRow {
            limit_per_1000_km: Some(1.0),
            successes: 1,
            outside_data: 0,
            median: Some(Naturalness {
                model: String::new(),
                ado: String::new(),
                rarest: Some(String::new()),
                per_1000_km: Some(1.0),
                surprise_decades: Some(1.0),
                outside: vec![String::new()],
            }),
        }),
        invalid: 1,
        faults: vec![FaultCount {
            kind: FaultKind::Timeout,
            message: String::new(),
            stderr: "late".to_owned(),
            first_start: 0,
            count: 1,
        }],
        repeats: Some(Repeated {
            runs: 1,
            gate: 1,
            failing_share: 0.0,
            ci95: [0.0, 1.0],
            differing: 0,
        }),
        sims_per_start: 1.0,
        max_sims_per_start: None,
        physics_steps: 0,
        cpu_s: 0.0,
        anytime: vec![Anytime {
            budget: 1,
            successes: 0,
            success_rate: 0.0,
            ci95: [0.0, 1.0],
            sims_per_start: 1.0,
        }],
        unconfirmed: Some(Unconfirmed {
            sequences: 0,
            starts: 0,
        }),
        solved: Outcomes::default(),
    }
}

/// Keys of the row, and those of its objects and of the objects in its lists.
fn keys(row: &Row) -> Vec<String> {
    let row = serde_json::to_value(row).expect("a row");
    let mut keys = Vec::new();
    for (key, value) in row.as_object().expect("an object") {
        let inner = value.get(0).unwrap_or(value).as_object();
        let inner = inner.into_iter().flat_map(|inner| inner.keys());
        keys.extend(inner.map(|inner| format!("{key}.{inner}")));
        keys.push(key.clone());
    }
    keys
}

#[test]
fn an_interrupted_search_gives_no_recall() {
    let marks = |text: &str| text.parse::<Outcomes>().expect("marks");
    let compared_with = |own: &str, search: &str| {
        let mut row = Row {
            solved: marks(own),
            recall: None,
            beyond_search: None,
            ..complete()
        };
        row.compare_with_search(&marks(search));
        (row.recall, row.beyond_search)
    };
    let compared = |search: &str| compared_with("1010t", search);
    assert_eq!(compared("1100t"), (Some(0.5), Some(1)));
    assert_eq!(compared("110-t"), (None, None));
    assert_eq!(compared("0000t"), (None, Some(2)));
    // An ado that was interrupted has solved too few.
    assert_eq!(compared_with("1---t", "1100t"), (None, None));
}

#[test]
fn every_key_of_a_row_is_in_the_table_of_json_keys() {
    let keys = keys(&complete());
    assert!(keys.len() > 60, "{keys:?}");
    let names = KEYS.lines().filter_map(|line| line.split_once(" |"));
    let names: Vec<&str> = names.flat_map(|(names, _)| names.split(", ")).collect();
    for key in keys {
        // A key has a line, or those below it have.
        let name = format!("rows.{key}");
        let below = format!("{name}.");
        let is_known = |it: &&str| **it == name || it.starts_with(&below);
        assert!(
            names.iter().any(is_known),
            "src/cli/reference/keys.txt lacks `{name}`"
        );
    }
}
