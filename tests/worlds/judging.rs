//! The two judges on hand-made traces.

use std::sync::Arc;

use brakecheck::rulebook::{Counts, Judge, JudgeKind, Reward, Rule, Rulebook, Stop, Verdict};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::{Constants, Formula, Scratch};
use brakecheck::testbench::{Aftermath, HeldRandom, play};
use brakecheck::trace::{Schema, Signal, Trace};

fn schema() -> Arc<Schema> {
    let signals = [
        Signal::real("d", "m", "distance"),
        Signal::real("v", "m/s", "speed"),
        Signal::real("g", "", "goal"),
    ];
    Arc::new(Schema::new(1.0, signals).expect("a schema"))
}

fn rulebook(judge: JudgeKind, rules: &[&str]) -> Rulebook {
    let constants = Constants::from([("T".to_owned(), 4.0)]);
    let bind = |text: &str| {
        let formula: Formula = text.parse().expect("a formula");
        formula.bind(&schema(), &constants).expect("it binds")
    };
    Rulebook {
        spec: bind("always[0, T] d >= 1"),
        rules: rules
            .iter()
            .enumerate()
            .map(|(priority, text)| Rule {
                name: (*text).to_owned(),
                ado: "ado".to_owned(),
                priority,
                monitor: bind(text),
            })
            .collect(),
        judge,
        counts: Counts::Violation,
        reward: Reward::default(),
    }
}

/// Judges rows (d, v, g); `contact` ends the motion after the last of them.
fn judged(book: &Rulebook, rows: &[[f64; 3]], contact: bool) -> (usize, Verdict) {
    let mut trace = Trace::new(schema());
    let mut judge = Judge::new(book, 5);
    for (i, row) in rows.iter().enumerate() {
        trace.push(row).expect("finite");
        let last = i + 1 == rows.len();
        let stop = match (last, contact) {
            (true, true) => Some(Stop::Contact),
            (true, false) => Some(Stop::Horizon),
            _ => None,
        };
        if let Some(verdict) = judge.push(book, &trace, row, stop) {
            return (i, verdict);
        }
    }
    panic!("no verdict at the stop");
}

const SLOW: &str = "always[0, T] v <= 10";
const STEADY: &str = "always[0, T] v >= 2";
const GOAL: &str = "eventually[0, T] g >= 1";

#[test]
fn the_prefix_is_judged_at_the_first_decided_sample() {
    let book = rulebook(JudgeKind::UntilViolation, &[SLOW, STEADY]);
    let foul = |rule, forfeited| Verdict::Foul { rule, forfeited };
    type Case<'a> = (&'a str, &'a [[f64; 3]], bool, usize, Verdict);
    let cases: [Case; 8] = [
        (
            "violated while all rules are kept",
            &[[5.0, 5.0, 0.0], [0.25, 5.0, 0.0], [9.0, 99.0, 0.0]],
            false,
            1,
            Verdict::Counterexample { by: 0.75 },
        ),
        (
            "a rule broken before",
            &[[5.0, 5.0, 0.0], [5.0, 11.0, 0.0], [0.0, 5.0, 0.0]],
            false,
            1,
            foul(0, 2),
        ),
        (
            "a rule broken on the same sample is a foul",
            &[[5.0, 5.0, 0.0], [0.0, 1.0, 0.0]],
            false,
            1,
            foul(1, 1),
        ),
        (
            "two rules broken at once: the more important one counts",
            &[[5.0, 5.0, 0.0], [5.0, 1.0, 0.0], [5.0, 12.0, 0.0]],
            false,
            1,
            foul(1, 1),
        ),
        (
            "a rule at its bound exactly is not kept",
            &[[5.0, 5.0, 0.0], [5.0, 10.0, 0.0]],
            false,
            1,
            foul(0, 2),
        ),
        (
            "the spec at its bound exactly is held",
            &[[5.0, 5.0, 0.0], [1.0, 5.0, 0.0]],
            false,
            1,
            Verdict::Held { margin: 0.0 },
        ),
        (
            "contact without a violation is held",
            &[[5.0, 5.0, 0.0], [3.0, 5.0, 0.0]],
            true,
            1,
            Verdict::Held { margin: 2.0 },
        ),
        (
            "the horizon without a violation is held",
            &[
                [5.0, 5.0, 0.0],
                [4.0, 5.0, 0.0],
                [3.0, 5.0, 0.0],
                [3.5, 5.0, 0.0],
                [4.0, 5.0, 0.0],
            ],
            false,
            4,
            Verdict::Held { margin: 2.0 },
        ),
    ];
    for (what, rows, contact, at, expect) in cases {
        assert_eq!(judged(&book, rows, contact), (at, expect), "{what}");
    }
}

#[test]
fn a_violation_waits_until_every_rule_is_satisfied_on_the_prefix() {
    let book = rulebook(JudgeKind::UntilViolation, &[GOAL]);
    let rows = [[5.0, 5.0, 0.0], [0.0, 5.0, 0.0], [5.0, 5.0, 3.0]];
    let expect = (2, Verdict::Counterexample { by: 1.0 });
    assert_eq!(judged(&book, &rows, false), expect);
    // A goal that is never reached is a foul at the horizon, not before.
    let rows = [[5.0, 5.0, 0.0], [0.0, 5.0, 0.0], [5.0, 5.0, 0.0]];
    let foul = Verdict::Foul {
        rule: 0,
        forfeited: 1,
    };
    assert_eq!(judged(&book, &rows, false), (2, foul));
}

#[test]
fn after_a_success_the_first_rule_lost_for_good_is_named() {
    // Whoever is fast must reach the goal within a second.
    const ANSWERS: &str = "always[0, T] (v <= 6 or eventually[0, 1] g >= 1)";
    let rules = [SLOW, STEADY, ANSWERS];
    let success = [[5.0, 5.0, 0.0], [0.25, 5.0, 0.0]];
    type Case<'a> = (&'a str, [[f64; 3]; 2], [Option<usize>; 2]);
    let cases: [Case; 5] = [
        ("all kept", [[0.0, 5.0, 0.0], [0.0, 5.0, 0.0]], [None, None]),
        ("lost", [[0.0, 5.0, 0.0], [0.0, 1.0, 0.0]], [None, Some(1)]),
        ("open", [[0.0, 5.0, 0.0], [0.0, 7.0, 0.0]], [None, None]),
        (
            "open, then lost",
            [[0.0, 7.0, 0.0], [0.0, 5.0, 0.0]],
            [None, Some(2)],
        ),
        (
            "open, then kept",
            [[0.0, 7.0, 0.0], [0.0, 5.0, 2.0]],
            [None, None],
        ),
    ];
    for (what, rows, expect) in cases {
        for kind in [JudgeKind::UntilViolation, JudgeKind::WholeRun] {
            let book = rulebook(kind, &rules);
            let mut judge = Judge::new(&book, 5);
            let mut trace = Trace::new(schema());
            for row in &success {
                trace.push(row).expect("finite");
                judge.push(&book, &trace, row, None);
            }
            let lost = rows.map(|row| judge.push_after(&book, &row));
            let expect = match kind {
                JudgeKind::UntilViolation => expect,
                JudgeKind::WholeRun | JudgeKind::UntilContact => [None, None],
            };
            assert_eq!(lost, expect, "{what}");
        }
    }
    // Of two at once the more important one, whatever their order.
    let mut book = rulebook(JudgeKind::UntilViolation, &[SLOW, "always[0, T] g <= 1"]);
    book.rules[0].priority = 1;
    book.rules[1].priority = 0;
    let mut judge = Judge::new(&book, 5);
    assert_eq!(judge.push_after(&book, &[5.0, 11.0, 2.0]), Some(1));
}

#[test]
fn rules_of_equal_priority_are_forfeited_together() {
    let mut book = rulebook(JudgeKind::UntilViolation, &[SLOW, STEADY, GOAL]);
    for (rule, priority) in book.rules.iter_mut().zip([0, 1, 1]) {
        rule.priority = priority;
    }
    assert_eq!(
        (0..3).map(|rule| book.forfeited(rule)).collect::<Vec<_>>(),
        [3, 2, 2]
    );
}

#[test]
fn the_whole_run_counts_under_the_papers_judge() {
    let book = rulebook(JudgeKind::WholeRun, &[SLOW]);
    // The rule is broken after the violation: to the letter that is a foul.
    let rows = [[5.0, 5.0, 0.0], [0.25, 5.0, 0.0], [9.0, 99.0, 0.0]];
    let foul = Verdict::Foul {
        rule: 0,
        forfeited: 1,
    };
    assert_eq!(judged(&book, &rows, false), (2, foul));
    // The deepest violation counts, not the first.
    let rows = [[5.0, 5.0, 0.0], [0.25, 5.0, 0.0], [0.0, 5.0, 0.0]];
    let expect = (2, Verdict::Counterexample { by: 1.0 });
    assert_eq!(judged(&book, &rows, false), expect);
}

#[test]
fn until_contact_all_that_was_played_is_judged() {
    let book = rulebook(JudgeKind::UntilContact, &[SLOW, GOAL]);
    let foul = |rule, forfeited| Verdict::Foul { rule, forfeited };
    let lost = [[5.0, 5.0, 0.0], [0.25, 5.0, 2.0], [0.0, 5.0, 0.0]];
    let mut late = lost;
    late[2][1] = 10.0;
    let cases = [
        // A violation ends nothing: the deepest one counts, at the contact.
        (&lost[..], true, 2, Verdict::Counterexample { by: 1.0 }),
        (&lost[..], false, 2, Verdict::Counterexample { by: 1.0 }),
        // A rule at its bound exactly, on the sample of the contact.
        (&late[..], true, 2, foul(0, 2)),
        // A goal not reached by the contact was not kept.
        (
            &[[5.0, 5.0, 0.0], [0.25, 5.0, 0.0]][..],
            true,
            1,
            foul(1, 1),
        ),
        // What cannot be kept any more ends it before.
        (
            &[[5.0, 11.0, 0.0], [5.0, 5.0, 0.0]][..],
            true,
            0,
            foul(0, 2),
        ),
        (
            &[[5.0, 5.0, 2.0], [3.0, 5.0, 0.0]][..],
            true,
            1,
            Verdict::Held { margin: 2.0 },
        ),
        (
            &[[5.0, 5.0, 2.0], [1.0, 5.0, 0.0]][..],
            true,
            1,
            Verdict::Held { margin: 0.0 },
        ),
    ];
    for (rows, contact, at, expect) in cases {
        assert_eq!(judged(&book, rows, contact), (at, expect), "{rows:?}");
    }
}

#[test]
fn on_the_bench_contact_holds_to_the_horizon_under_the_papers_judge() {
    use brakecheck::scene::Start;
    use brakecheck::testbench::{Aftermath, Constant, play};
    let text = include_str!("../../worlds/acc.ron").replace("UntilViolation", "WholeRun");
    let world = brakecheck::world::Scenario::parse("acc.ron", &text).expect("a sound world");
    let mut bench = world.bench();
    // A hard-braking lead car eight metres ahead of a fast ego.
    let start = Start(vec![25.0, 8.0, 25.0]);
    let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Skip);
    assert!(episode.contact.is_some());
    assert_eq!(episode.trace.len(), 301);
    let headway = episode.trace.signal("headway").expect("derived");
    assert_eq!(headway[300].to_bits(), headway[250].to_bits());
}

#[test]
fn at_the_horizon_the_online_judge_says_what_the_whole_trace_says() {
    let mut judged = 0;
    for (name, world) in super::shipped() {
        let mut bench = world.bench();
        for index in 0..6 {
            let key = StartKey {
                purpose: Purpose::Calibration,
                seed: 5,
                index,
            };
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            let mut held = HeldRandom::new(bench.spaces().actions, 5);
            let episode = play(&mut bench, &start, noise, &mut held, Aftermath::Skip);
            let whole = episode.judged == world.world().clock().samples();
            if whole && episode.contact.is_none() {
                let mut scratch = Scratch::default();
                let verdict = world.rulebook().judge_whole(&episode.trace, &mut scratch);
                assert_eq!(episode.verdict, verdict, "{name}, start {index}");
                judged += 1;
            }
        }
    }
    assert!(judged >= 12, "{judged}");
}
