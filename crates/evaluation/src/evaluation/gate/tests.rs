use proptest::prelude::*;
use strum::VariantArray;

use super::*;
use crate::report::TestOutcome;

/// Outcome, Δv of the contact if any, and label of a start.
type GateSide = (StartOutcome, Option<f64>);

fn contacts(played: &[GateSide]) -> BTreeMap<usize, GateContact> {
    let starts = played.iter().enumerate();
    let contact = |(start, (outcome, delta_v_mps)): (usize, &GateSide)| {
        let failed = *outcome == StartOutcome::Solved;
        let delta_v_mps = delta_v_mps.filter(|_| failed)?;
        Some((
            start,
            GateContact {
                closing_mps: 2.0 * delta_v_mps,
                ego_delta_v_mps: Some(delta_v_mps),
            },
        ))
    };
    starts.filter_map(contact).collect()
}

fn gate(new: &[GateSide], old: &[GateSide]) -> Gate {
    let outcomes = |of: &[GateSide]| of.iter().map(|one| one.0).collect::<Vec<_>>();
    let (new_outcomes, old_outcomes) = (outcomes(new), outcomes(old));
    let (new_contacts, old_contacts) = (contacts(new), contacts(old));
    Gate::of(
        GateEgo {
            name: "new",
            outcomes: &new_outcomes,
            contacts: &new_contacts,
        },
        GateEgo {
            name: "old",
            outcomes: &old_outcomes,
            contacts: &old_contacts,
        },
    )
}

const FAILS: GateSide = (StartOutcome::Solved, None);
const HELD: GateSide = (StartOutcome::Held, None);
const FOUL: GateSide = (StartOutcome::RuleViolation, None);

fn hits(delta_v_mps: f64) -> GateSide {
    (StartOutcome::Solved, Some(delta_v_mps))
}

#[test]
fn only_shown_unavoidable_crashes_are_excused() {
    use Avoidability::{Avoidable, Preventable, Unavoidable, Unknown};
    use GateOn::{Any, Never, Severity, UnlessUnavoidable};
    let closed = |label: Avoidability, on: &[GateOn]| {
        let mut gate = gate(&[FAILS, HELD], &[HELD, HELD]);
        gate.label([label]);
        gate.decided(on).closed_by
    };
    for label in [Preventable, Avoidable, Unknown] {
        assert_eq!(closed(label, &[]), [UnlessUnavoidable], "{label:?}");
    }
    assert!(closed(Unavoidable, &[]).is_empty());
    assert_eq!(closed(Unavoidable, &[Any]), [Any]);
    assert_eq!(
        closed(Preventable, &[GateOn::Preventable]),
        [GateOn::Preventable]
    );
    for label in [Avoidable, Unavoidable, Unknown] {
        assert!(
            closed(label, &[GateOn::Preventable]).is_empty(),
            "{label:?}"
        );
    }
    assert!(closed(Unknown, &[Never]).is_empty());
    // Severity is an addition to the default, unless another value is given.
    assert_eq!(closed(Unknown, &[Severity]), [UnlessUnavoidable]);
    assert!(closed(Unknown, &[Never, Severity]).is_empty());
}

#[test]
fn failures_with_delta_v_up_by_more_than_a_fifth_are_named_and_close_on_request() {
    // The last start could fail newly, so severity alone does not decide.
    let old = [
        hits(2.0),
        hits(2.0),
        hits(2.0),
        FAILS,
        FAILS,
        hits(3.0),
        HELD,
    ];
    let new = [
        hits(2.4),
        hits(2.5),
        hits(5.0),
        hits(0.5),
        FAILS,
        FAILS,
        HELD,
    ];
    let compared = gate(&new, &old);
    let severe: Vec<usize> = compared.more_severe.iter().map(|it| it.start).collect();
    // A rise of just 20 % is none, and a contact after none is one.
    assert_eq!(severe, [1, 2, 3]);
    let worst = MoreSevere::worst(&compared.more_severe).expect("one");
    assert_eq!(
        (worst.start, worst.before_mps, worst.now_mps),
        (2, 2.0, 5.0)
    );
    let open = compared.clone().decided(&[]);
    assert!(!open.is_closed());
    let text = open.to_string();
    assert!(
        text.contains("warning: 3 of the 6 that fail on both fail more severely"),
        "{text}"
    );
    assert!(
        text.contains("start 2: 2.0 m/s before, 5.0 m/s now"),
        "{text}"
    );
    assert!(text.starts_with("gate open\n"), "{text}");
    let closed = compared.decided(&[GateOn::Severity]);
    assert_eq!(closed.closed_by, [GateOn::Severity]);
    let text = closed.to_string();
    assert!(
        text.starts_with("gate closed by 3 starts that fail more severely\n"),
        "{text}"
    );
    assert!(!text.contains("warning"), "{text}");
}

#[test]
fn severity_decides_where_the_baseline_fails_from_every_start() {
    let old = [hits(2.0), hits(2.0), hits(2.0), hits(2.0)];
    let worse = [hits(9.0), hits(9.0), hits(1.0), hits(2.0)];
    let decided = gate(&worse, &old).decided(&[]);
    assert_eq!(decided.closed_by, [GateOn::Severity]);
    let text = decided.to_string();
    let end = "gate closed by 2 starts that fail more severely, since no start is left to \
               fail newly: the baseline fails from all";
    assert!(text.starts_with(end) && !text.contains("warning"), "{text}");
    // As many better as worse ones, be they gentler or fixed.
    for new in [
        [hits(9.0), hits(9.0), hits(1.0), hits(1.0)],
        [hits(9.0), hits(9.0), HELD, hits(1.0)],
    ] {
        assert!(!gate(&new, &old).decided(&[]).is_closed(), "{new:?}");
    }
    // One start that could have failed newly makes severity a warning again.
    let with_one_held = [hits(2.0), hits(2.0), hits(2.0), HELD];
    let fixed = [hits(9.0), hits(9.0), hits(2.0), HELD];
    assert!(!gate(&fixed, &with_one_held).decided(&[]).is_closed());
    // Reasons that were chosen by name are taken by their word.
    assert!(!gate(&worse, &old).decided(&[GateOn::Any]).is_closed());
}

#[test]
fn the_json_and_the_text_count_unknown_crashes_apart() {
    use Avoidability::{Avoidable, Preventable, Unavoidable, Unknown};
    let mut compared = gate(&[FAILS; 7], &[HELD; 7]);
    compared.label([
        Preventable,
        Avoidable,
        Unavoidable,
        Unavoidable,
        Unknown,
        Unknown,
        Unknown,
    ]);
    let decided = compared.decided(&[]);
    let text = decided.to_string();
    assert!(
        text.contains(
            "7 newly failing (1 preventable, 1 avoided by other drivers only, 2 unavoidable, \
             3 unknown)"
        ),
        "{text}"
    );
    assert!(
        text.starts_with(
            "gate closed by 5 newly failing starts that are not shown to be unavoidable\n"
        ),
        "{text}"
    );
    let json = serde_json::to_value(&decided).expect("JSON");
    assert_eq!(
        json["newly_failing_by"],
        serde_json::json!({"preventable": 1, "avoidable": 1, "unavoidable": 2, "unknown": 3})
    );
    assert_eq!(json["closed_by"], serde_json::json!(["unless-unavoidable"]));
    let starts = json["newly_failing"].as_array().expect("a list");
    let flags = |nth: usize| {
        (
            starts[nth]["preventable"].clone(),
            starts[nth]["unavoidable"].clone(),
        )
    };
    assert_eq!(flags(0), (true.into(), false.into()));
    assert_eq!(flags(2), (false.into(), true.into()));
    assert_eq!(flags(4), (serde_json::Value::Null, serde_json::Value::Null));
    assert_eq!(starts[0]["before"], "held");
    assert_eq!(starts[0]["now"], "fails");
}

#[test]
fn starts_without_an_answer_are_said_and_never_fixed() {
    let invalid = (StartOutcome::Invalid, None);
    let uncounted = (StartOutcome::Uncounted, None);
    let new = [FOUL, FOUL, FAILS, uncounted, invalid];
    let old = [FAILS, HELD, FOUL, FAILS, HELD];
    let decided = gate(&new, &old).decided(&[]);
    assert_eq!(decided.gate.newly_fixed.len(), 1);
    let text = decided.to_string();
    for part in [
        "4 starts: 1 newly failing",
        "no answer from 2 starts",
        "(1 of them fail on `old`",
        "1 of the newly failing have no answer on `old`",
        "1 of the newly fixed still violate the specification",
        "`new` did not run from 1 start, `old` from 0",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn failures_without_an_adversary_close_it_too() {
    let mut compared = gate(&[FOUL, HELD], &[FAILS, HELD]);
    compared.without_adversary = Some(Box::new(gate(&[FAILS, HELD], &[HELD, HELD])));
    let decided = compared.clone().decided(&[]);
    assert_eq!(decided.closed_by, [GateOn::UnlessUnavoidable]);
    let text = decided.to_string();
    assert!(
        text.contains("without an adversary, 2 starts: 1 newly failing (0 preventable"),
        "{text}"
    );
    let json = serde_json::to_value(&decided).expect("JSON");
    let alone = &json["without_adversary"];
    assert_eq!(alone["newly_failing"].as_array().map(Vec::len), Some(1));
    assert!(!compared.decided(&[GateOn::Never]).is_closed());
}

/// The baseline fails from every start by itself, so severity decides there.
#[test]
fn severity_without_an_adversary_closes_it_too() {
    let mut compared = gate(&[HELD], &[HELD]);
    compared.without_adversary = Some(Box::new(gate(&[hits(9.0)], &[hits(2.0)])));
    let decided = compared.clone().decided(&[]);
    assert_eq!(decided.closed_by, [GateOn::Severity]);
    assert_eq!(decided.contradiction(), None);
    let text = decided.to_string();
    assert!(
        text.starts_with("gate closed by 0, and without an adversary 1, starts that fail more"),
        "{text}"
    );
    assert!(!compared.decided(&[GateOn::Any]).is_closed());
}

#[test]
fn a_gate_without_any_answer_says_so_and_is_not_open() {
    let decided = gate(&[FOUL, FOUL], &[FAILS, HELD]).decided(&[]);
    assert!(decided.gate.is_unanswered());
    assert!(decided.decision().starts_with("without an answer"));
    assert!(!gate(&[HELD], &[HELD]).is_unanswered());
    assert!(!gate(&[FAILS], &[FOUL]).is_unanswered());
}

fn played() -> impl Strategy<Value = GateSide> {
    use StartOutcome::{Held, Invalid, RuleViolation, Solved, Uncounted};
    let outcome = prop::sample::select(vec![Solved, Held, RuleViolation, Uncounted, Invalid]);
    (outcome, prop::option::of(0.0..20.0f64))
}

fn reasons() -> impl Strategy<Value = Vec<GateOn>> {
    prop::collection::vec(prop::sample::select(GateOn::VARIANTS.to_vec()), 0..4)
}

fn label() -> impl Strategy<Value = Avoidability> {
    use Avoidability::{Avoidable, Preventable, Unavoidable, Unknown};
    prop::sample::select(vec![Preventable, Avoidable, Unavoidable, Unknown])
}

proptest! {
    #[test]
    fn an_equal_ego_never_closes(
        starts in prop::collection::vec(played(), 0..30),
        on in reasons(),
    ) {
        let compared = gate(&starts, &starts);
        prop_assert!(!compared.clone().decided(&on).is_closed());
        prop_assert_eq!(compared.p_value, 1.0);
    }

    #[test]
    fn more_failing_starts_never_open(
        starts in prop::collection::vec((played(), played(), label()), 1..30),
        on in reasons(),
        which in any::<prop::sample::Index>(),
    ) {
        let (new, old, labels) = split(&starts);
        let labelled = |new: &[GateSide]| {
            let mut gate = gate(new, &old);
            let starts: Vec<usize> = gate.newly_failing.iter().map(|it| it.start).collect();
            gate.label(starts.into_iter().map(|start| labels[start]));
            gate.decided(&on)
        };
        let before = labelled(&new);
        let mut worse = new.clone();
        let at = which.index(worse.len());
        // A failure of the old ego stays one, perhaps more severe.
        worse[at] = (StartOutcome::Solved, worse[at].1);
        let after = labelled(&worse);
        prop_assert!(!before.is_closed() || after.is_closed());
        for reason in &before.closed_by {
            prop_assert!(after.closed_by.contains(reason));
        }
    }
}

fn split(
    starts: &[(GateSide, GateSide, Avoidability)],
) -> (Vec<GateSide>, Vec<GateSide>, Vec<Avoidability>) {
    let new = starts.iter().map(|it| it.0).collect();
    let old = starts.iter().map(|it| it.1).collect();
    (new, old, starts.iter().map(|it| it.2).collect())
}

#[test]
fn a_gate_without_an_answer_is_not_open() {
    let [open, unanswered, closed] =
        [HELD, FOUL, FAILS].map(|new| gate(&[new], &[HELD]).decided(&[]));
    assert!(unanswered.gate.is_unanswered() && closed.is_closed());
    assert_eq!(
        gates_verdict(&[open.clone(), open.clone()]),
        "all 2 gates are open"
    );
    assert_eq!(
        gates_verdict(&[open.clone(), unanswered.clone()]),
        "0 of 2 gates closed, 1 without an answer"
    );
    let table = gate_table(&[open.clone(), unanswered.clone()]).to_markdown();
    assert!(
        table.contains("| open |") && table.contains("| no answer |"),
        "{table}"
    );
    assert_eq!(
        gates_verdict(&[closed, unanswered, open]),
        "1 of 3 gates closed: `new`, 1 without an answer"
    );
}

#[test]
fn a_failure_is_not_called_old_if_the_baseline_did_not_run() {
    let why = |old: GateSide| {
        let mut compared = gate(&[FAILS, HELD], &[old, HELD]);
        compared.outcomes = vec![FAILS.0, HELD.0];
        let suite = compared.decided(&[]).suite("acc");
        // The case of the gate itself is the first.
        match &suite.cases[1].outcome {
            TestOutcome::Skipped(why) => why.clone(),
            other => format!("{other:?}"),
        }
    };
    assert_eq!(why(FAILS), "fails on the baseline ego, too");
    let unknown = why((StartOutcome::Invalid, None));
    assert!(unknown.ends_with("or that did not run"), "{unknown}");
}

#[test]
fn an_edited_decision_contradicts_its_starts() {
    let read = |edit: &dyn Fn(&mut serde_json::Value)| {
        let mut compared = gate(&[FAILS, HELD], &[HELD, HELD]);
        compared.without_adversary = Some(Box::new(gate(&[FAILS, HELD], &[HELD, HELD])));
        let mut value = serde_json::to_value(compared.decided(&[GateOn::Any])).expect("JSON");
        edit(&mut value);
        serde_json::from_value::<DecidedGate>(value)
    };
    let sound = read(&|_| ()).expect("a gate");
    assert_eq!((sound.contradiction(), sound.is_closed()), (None, true));
    let opened = read(&|gate| gate["closed_by"] = serde_json::json!([]));
    let why = opened.expect("a gate").contradiction().expect("edited");
    assert_eq!(why, "`closed_by` is [], but `on` and the starts give [any]");
    let alone = read(&|gate| gate["without_adversary"]["closed_by"] = serde_json::json!([]));
    let why = alone.expect("a gate").contradiction().expect("edited");
    assert!(
        why.starts_with("`without_adversary`: `closed_by` is []"),
        "{why}"
    );
    let without = read(&|gate| {
        gate.as_object_mut().expect("an object").remove("on");
    });
    assert!(without.is_err());
}
