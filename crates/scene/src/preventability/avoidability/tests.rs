use super::*;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::{DriverOutcome, NotApplicable};

/// Assessment with a label, in which some drivers avoid the crash.
fn judged(label: Label, avoiding: &[ReferenceDriver]) -> Preventability {
    let outcome = |driver: &ReferenceDriver| DriverOutcome {
        avoided: avoiding.contains(driver),
        margin: None,
        contact: None,
        saved_mps: 0.0,
        reacted_s: None,
        rules_kept: None,
        robustness: None,
    };
    let panel = crate::preventability::PANEL.iter();
    Preventability {
        label,
        not_applicable: None,
        handover: panel.map(|driver| (*driver, outcome(driver))).collect(),
        ..Preventability::not_applicable(NotApplicable::NoContact)
    }
}

#[test]
fn only_a_crash_that_no_driver_avoids_is_unavoidable() {
    use Avoidability::{Avoidable, Preventable, Unavoidable, Unknown};
    use ReferenceDriver::{Cc, CcLatched, Fsm, Rss};
    let self_inflicted = Preventability {
        self_inflicted: true,
        ..judged(Label::UnavoidableByBraking, &[])
    };
    let cases = [
        (judged(Label::AvoidedBySome, &[Fsm]), Preventable),
        (judged(Label::AvoidedBySome, &[CcLatched, Rss]), Preventable),
        (judged(Label::AvoidedBySome, &[Cc, Rss]), Avoidable),
        (judged(Label::OnlyByPerfect, &[]), Avoidable),
        (judged(Label::OnlyByForesight, &[]), Unavoidable),
        (judged(Label::UnavoidableByBraking, &[]), Unavoidable),
        (self_inflicted, Avoidable),
        (
            Preventability::not_applicable(NotApplicable::OnFoot),
            Unknown,
        ),
    ];
    for (judged, expected) in cases {
        let found = judged.avoidability();
        assert_eq!(found, expected, "{judged}");
        let row = Avoidability::of_row(found.preventable(), found.unavoidable());
        assert_eq!(row, found);
    }
    assert_eq!(Unknown.preventable(), None);
    assert_eq!(Unknown.unavoidable(), None);
}

#[test]
fn a_line_names_the_drivers_that_avoid_it_and_those_that_do_not() {
    use crate::preventability::outcome::Exoneration;
    use ReferenceDriver::{Cc, Fsm};
    let some = judged(Label::AvoidedBySome, &[Cc, Fsm]);
    let said = "avoided by 2 of 6 reference drivers (CC, FSM), \
                not by CC_LANE, CC_LATCHED, REG, RSS";
    assert_eq!(some.to_string(), said);
    assert_eq!(some.any_driver(), Some(Cc));
    let both = Preventability {
        self_inflicted: true,
        exonerated: Some(Exoneration::Standing),
        ..some
    };
    let more = "; self-inflicted; not the ego's fault: the ego stands";
    assert_eq!(both.to_string(), format!("{said}{more}"));
    let all = judged(Label::AvoidedByAll, &crate::preventability::PANEL);
    assert!(!all.to_string().contains("not by"), "{all}");
    let none = Preventability::not_applicable(NotApplicable::OnFoot);
    let said = "reference drivers: not applicable, since a pedestrian was hit";
    assert_eq!((none.to_string().as_str(), none.any_driver()), (said, None));
    assert_eq!((none.human_model_avoids(), none.who_avoids()), (None, None));
}
