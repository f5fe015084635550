use super::*;
use crate::run_dir::{Answer, LastChance, Persistence, Variation};

fn variation(fails: Option<bool>, no_answer: Option<NoAnswer>) -> Variation {
    Variation {
        name: "one".to_owned(),
        fails,
        no_answer,
    }
}

#[test]
fn a_broken_rule_confirms_no_failure() {
    let fails = || variation(Some(true), None);
    let rule = || {
        let rule = "stays".to_owned();
        variation(None, Some(NoAnswer::RuleBroken { rule }))
    };
    let fault = || variation(None, Some(NoAnswer::Fault));
    let cases = [
        (vec![fails(), rule()], true),
        (vec![fails(), rule(), rule()], false),
        (vec![fails(), fault(), fault()], true),
        (vec![fails(), variation(Some(false), None)], true),
        (vec![rule()], false),
        (vec![fault()], false),
    ];
    for (variations, expected) in cases {
        let about = About {
            persistence: Some(Persistence { variations }),
            ..About::default()
        };
        assert_eq!(persists(&about), expected, "{about}");
    }
    assert!(persists(&About::default()));
}

/// Full braking may fail where a driver who brakes less avoids the contact.
#[test]
fn a_driver_who_avoids_it_withdraws_that_braking_does_not() {
    let chance = |at_s| LastChance {
        driver: "full braking".to_owned(),
        at_s,
        violated_s: 3.0,
        no_answer: None,
        contact_s: None,
    };
    let why = |at_s| Why {
        leaf: "gap >= 0".to_owned(),
        leaf_s: 3.0,
        decisive: None,
        not_asked: None,
        last_chance: Some(chance(at_s)),
    };
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/regressions/acc_iso-nominal-0005.ron"
    );
    let kept = crate::crashes::Regressions::load(file).expect("a kept counterexample");
    let replayed = kept.replay_recorded().expect("replayed").remove(0);
    let seen = seen_in(&replayed.scenario, &replayed.episode);
    let panel = seen.preventability.clone().expect("a contact");
    let driver = panel.any_driver().expect("a driver").name().to_owned();
    let answer = |why: Why, seen: About| {
        let known = with_cause(Some(why), seen);
        known
            .why
            .and_then(|why| why.last_chance)
            .expect("kept")
            .answer()
    };
    let only = Answer::NoAnswer(NoAnswer::OnlyDriver { driver });
    assert_eq!(answer(why(None), seen.clone()), only);
    assert_eq!(answer(why(Some(1.0)), seen.clone()), Answer::Avoided);
    let nobody = About {
        preventability: Some(world.preventability(&Episode {
            contact: None,
            ..replayed.episode.clone()
        })),
        ..seen
    };
    assert_eq!(answer(why(None), nobody), Answer::NotAvoided);
}
