//! Definition 4 by hand: rules in their order, the edges, and the reward.

use std::sync::Arc;

use brakecheck::rulebook::{Counts, Judge, JudgeKind, Reward, Rule, Rulebook, Stop, Verdict};
use brakecheck::stl::{Constants, Formula, Scratch};
use brakecheck::trace::{Schema, Signal, Trace};

use super::near;

fn schema() -> Arc<Schema> {
    let signals = [
        Signal::real("d", "m", "distance"),
        Signal::real("v", "m/s", "speed of one ado"),
        Signal::real("w", "m/s", "speed of another"),
        Signal::real("g", "", "goal"),
    ];
    Arc::new(Schema::new(1.0, signals).expect("a schema"))
}

const SAMPLES: usize = 5;

/// Rules with their priorities; ψ_ego is d ≥ 1.
fn rulebook(judge: JudgeKind, rules: &[(&str, usize)]) -> Rulebook {
    let constants = Constants::from([("T".to_owned(), 4.0)]);
    let bind = |text: &str| {
        let formula: Formula = text.parse().expect("a formula");
        formula.bind(&schema(), &constants).expect("it binds")
    };
    let rule = |(text, priority): &(&str, usize)| Rule {
        name: (*text).to_owned(),
        ado: if text.contains('w') { "other" } else { "ado" }.to_owned(),
        priority: *priority,
        monitor: bind(text),
    };
    Rulebook {
        spec: bind("always[0, T] d >= 1"),
        rules: rules.iter().map(rule).collect(),
        judge,
        counts: Counts::Violation,
        reward: Reward::default(),
    }
}

/// Judges rows of the four signals with a judge; says after which sample.
fn judge(judge: &mut Judge, book: &Rulebook, rows: &[[f64; 4]], stop: Stop) -> (usize, Verdict) {
    let mut trace = Trace::new(schema());
    for (i, row) in rows.iter().enumerate() {
        trace.push(row).expect("finite");
        let stop = (i + 1 == rows.len()).then_some(stop);
        if let Some(verdict) = judge.push(book, &trace, row, stop) {
            return (i, verdict);
        }
    }
    panic!("no verdict at the stop");
}

/// Rows of d and v, with w = 5 and no goal.
fn dv(rows: &[(f64, f64)]) -> Vec<[f64; 4]> {
    rows.iter().map(|(d, v)| [*d, *v, 5.0, 0.0]).collect()
}

const SLOW: &str = "always[0, T] v <= 10";
const STEADY: &str = "always[0, T] v >= 2";
const OTHER: &str = "always[0, T] w <= 8";
const GOAL: &str = "eventually[0, T] g >= 1";
const SOON: &str = "eventually[0, 2] g >= 1";

fn foul(rule: usize, forfeited: usize) -> Verdict {
    Verdict::Foul { rule, forfeited }
}

/// Written by hand: rules, rows, how it stops; until the violation, and as a whole.
#[test]
fn verdicts_are_those_on_paper() {
    use Stop::{Contact, Horizon};
    let fine = (5.0, 5.0);
    type Case<'a> = (
        &'a str,
        &'a [(&'a str, usize)],
        Vec<[f64; 4]>,
        Stop,
        (usize, Verdict),
        Verdict,
    );
    let success = |by| Verdict::Counterexample { by };
    let held = |margin| Verdict::Held { margin };
    let both: &[(&str, usize)] = &[(SLOW, 0), (STEADY, 1)];
    let cases: Vec<Case> = vec![
        (
            "a rule at 0 is lost, and at once",
            both,
            dv(&[fine, (5.0, 2.0), (0.0, 5.0), fine, fine]),
            Horizon,
            (1, foul(1, 1)),
            foul(1, 1),
        ),
        (
            "a rule at 0 on the first sample is lost there",
            both,
            dv(&[(5.0, 10.0), fine, fine, fine, fine]),
            Horizon,
            (0, foul(0, 2)),
            foul(0, 2),
        ),
        (
            "a rule at 0 on the last sample is lost there",
            both,
            dv(&[fine, fine, fine, fine, (5.0, 10.0)]),
            Horizon,
            (4, foul(0, 2)),
            foul(0, 2),
        ),
        (
            "the specification at 0 is held, to the end",
            both,
            dv(&[fine, (1.0, 5.0), fine, (1.0, 5.0), fine]),
            Horizon,
            (4, held(0.0)),
            held(0.0),
        ),
        (
            "the least bit below 0 is a violation",
            both,
            dv(&[fine, (1.0 - f64::EPSILON, 5.0), fine, fine, fine]),
            Horizon,
            (1, success(f64::EPSILON)),
            success(f64::EPSILON),
        ),
        (
            "a violation counts as deep as it was by then",
            both,
            dv(&[fine, (0.5, 5.0), (-3.0, 5.0), fine, fine]),
            Horizon,
            (1, success(0.5)),
            success(4.0),
        ),
        (
            "a rule that is broken after the violation counts for the whole run only",
            both,
            dv(&[fine, (0.5, 5.0), (-3.0, 11.0), fine, fine]),
            Horizon,
            (1, success(0.5)),
            foul(0, 2),
        ),
        (
            "violated and broken on one sample is a foul",
            both,
            dv(&[fine, (0.0, 12.0), fine, fine, fine]),
            Horizon,
            (1, foul(0, 2)),
            foul(0, 2),
        ),
        (
            "the second of two violations does not matter",
            both,
            dv(&[fine, (0.75, 5.0), (2.0, 5.0), (0.0, 5.0), fine]),
            Horizon,
            (1, success(0.25)),
            success(1.0),
        ),
        (
            "broken at once, the more important rule is the one, wherever it stands",
            &[(STEADY, 2), (SLOW, 1), ("always[0, T] d <= 9", 0)],
            dv(&[fine, (9.5, 12.0), fine, fine, fine]),
            Horizon,
            (1, foul(2, 3)),
            foul(2, 3),
        ),
        (
            "as a whole the more important rule is the one, though it is broken later",
            both,
            dv(&[fine, (5.0, 1.0), (5.0, 12.0), fine, fine]),
            Horizon,
            (1, foul(1, 1)),
            foul(0, 2),
        ),
        (
            "equals count together",
            &[(SLOW, 1), (STEADY, 1), (OTHER, 0), (GOAL, 3)],
            dv(&[fine, (5.0, 1.0), fine, fine, fine]),
            Horizon,
            (1, foul(1, 3)),
            // As a whole the first of equals; the goal was never reached, but ranks lower.
            foul(1, 3),
        ),
        (
            "the rules of every ado count",
            &[(SLOW, 0), (OTHER, 1)],
            vec![[5.0, 5.0, 5.0, 0.0], [0.0, 5.0, 8.5, 0.0]],
            Horizon,
            (1, foul(1, 1)),
            foul(1, 1),
        ),
        (
            "a contact is no violation, and has nothing against open rules",
            &[(GOAL, 0)],
            dv(&[fine, (3.0, 5.0)]),
            Contact,
            (1, held(2.0)),
            foul(0, 1),
        ),
        (
            "the horizon has",
            &[(GOAL, 0)],
            dv(&[fine, (3.0, 5.0), fine, fine, fine]),
            Horizon,
            (4, foul(0, 1)),
            foul(0, 1),
        ),
        (
            "a contact that violates while the goal is open shows nothing",
            &[(GOAL, 0)],
            dv(&[fine, (0.0, 5.0)]),
            Contact,
            (1, held(0.0)),
            foul(0, 1),
        ),
        (
            "a contact that violates with all rules kept is a success",
            both,
            dv(&[fine, (0.0, 5.0)]),
            Contact,
            (1, success(1.0)),
            success(1.0),
        ),
        (
            "a contact on whose sample a rule breaks is a foul",
            both,
            dv(&[fine, (0.0, 10.0)]),
            Contact,
            (1, foul(0, 2)),
            foul(0, 2),
        ),
        (
            "a violation waits for the goal, and is as deep as it was",
            &[(GOAL, 0)],
            vec![
                [5.0, 5.0, 5.0, 0.0],
                [0.0, 5.0, 5.0, 0.0],
                [5.0, 5.0, 5.0, 0.5],
                [5.0, 5.0, 5.0, 1.0],
                [5.0, 5.0, 5.0, 2.0],
            ],
            Horizon,
            // At g = 1 the goal is at 0: not yet kept.
            (4, success(1.0)),
            success(1.0),
        ),
        (
            "a goal that can no longer be reached is lost when its time is over",
            &[(SOON, 0)],
            dv(&[fine, fine, fine, (0.0, 5.0), fine]),
            Horizon,
            (2, foul(0, 1)),
            foul(0, 1),
        ),
        (
            "a goal at 0 for all its time is lost as well",
            &[(SOON, 0)],
            vec![[5.0, 5.0, 5.0, 1.0]; 5],
            Horizon,
            (2, foul(0, 1)),
            foul(0, 1),
        ),
        (
            "nobody has rules: the specification alone decides",
            &[],
            dv(&[fine, (2.5, 5.0), fine, fine, fine]),
            Horizon,
            (4, held(1.5)),
            held(1.5),
        ),
        (
            "what is undefined keeps no rule",
            &[("always[0, T] (d - d) / (v - 5) <= 3", 0)],
            dv(&[(5.0, 4.0), (5.0, 5.0), (0.0, 4.0), fine, fine]),
            Horizon,
            (1, foul(0, 1)),
            foul(0, 1),
        ),
    ];
    for (what, rules, rows, stop, prefix, whole) in cases {
        let book = rulebook(JudgeKind::UntilViolation, rules);
        let mut online = Judge::new(&book, SAMPLES);
        assert_eq!(judge(&mut online, &book, &rows, stop), prefix, "{what}");
        // A judge that starts again knows nothing of a run that was lost.
        let lost = [[0.0, 5.0, 9.0, 0.0], [0.0, 99.0, 9.0, 0.0]];
        online.reset();
        judge(&mut online, &book, &lost, Stop::Contact);
        online.reset();
        assert_eq!(
            judge(&mut online, &book, &rows, stop),
            prefix,
            "{what}, again"
        );

        let book = rulebook(JudgeKind::WholeRun, rules);
        let expect = (rows.len() - 1, whole);
        let mut at_end = Judge::new(&book, SAMPLES);
        assert_eq!(
            judge(&mut at_end, &book, &rows, stop),
            expect,
            "{what}, as a whole"
        );
        let mut trace = Trace::new(schema());
        for row in &rows {
            trace.push(row).expect("finite");
        }
        let seen = book.judge_whole(&trace, &mut Scratch::new());
        assert_eq!(seen, whole, "{what}, finished");
    }
}

/// M of Definition 4, with priorities 0, 1, 1 and 4.
#[test]
fn a_foul_forfeits_its_equals_and_all_below() {
    let rules = [(OTHER, 1), (SLOW, 0), (GOAL, 4), (STEADY, 1)];
    let book = rulebook(JudgeKind::UntilViolation, &rules);
    assert_eq!([0, 1, 2, 3].map(|rule| book.forfeited(rule)), [3, 4, 1, 3]);
}

/// ±0.5 + 0.5 tanh(ρ/10), and −1 − 0.1 (M − 1)/rules below; tanh by its series table:
/// tanh 0.1 = 0.0996679946, tanh 1 = 0.7615941560, tanh 5 = 0.9999092043.
#[test]
fn the_default_reward_is_the_one_on_paper() {
    let reward = Reward::default();
    assert_eq!(reward.rho_max(), 50.0);
    let table = [
        (1.0, 0.549_833_997_3),
        (10.0, 0.880_797_078_0),
        (50.0, 0.999_954_602_1),
        (1e9, 0.999_954_602_1),
        (f64::INFINITY, 0.999_954_602_1),
        (0.0, -0.5),
        (-1.0, -0.549_833_997_3),
        (-10.0, -0.880_797_078_0),
        (f64::NEG_INFINITY, -0.999_954_602_1),
    ];
    for (rho, expected) in table {
        let seen = reward.lawful(rho);
        assert!((seen - expected).abs() < 1e-9, "{rho}: {seen}");
    }
    assert_eq!(reward.lawful(f64::MIN_POSITIVE), 0.5);
    for (forfeited, rules, expected) in [(1, 4, -1.0), (2, 4, -1.025), (4, 4, -1.075), (1, 1, -1.0)]
    {
        near(reward.foul(forfeited, rules), expected);
    }
    let of = |verdict| reward.of(&verdict, 4);
    near(
        of(Verdict::Counterexample { by: 10.0 }).unwrap(),
        0.880_797_078,
    );
    near(of(Verdict::Held { margin: 10.0 }).unwrap(), -0.880_797_078);
    assert_eq!(of(Verdict::Held { margin: 0.0 }), Some(-0.5));
    near(of(foul(2, 3)).unwrap(), -1.05);
    assert_eq!(of(Verdict::Invalid), None);
    let rules = [(OTHER, 1), (SLOW, 0), (GOAL, 4), (STEADY, 1)];
    let book = rulebook(JudgeKind::UntilViolation, &rules);
    near(book.reward_of(&foul(1, 4)).unwrap(), -1.075);
}

/// ρ clamped to ±ρ_max, just inside; a foul costs M ρ_max.
#[test]
fn the_plain_reward_is_definition_4() {
    let reward = Reward::Plain { rho_max: 20.0 };
    assert_eq!(reward.rho_max(), 20.0);
    for rho in [-19.0, -0.25, 0.0, 3.5, 19.9] {
        assert_eq!(reward.lawful(rho), rho);
    }
    for (rho, bound) in [(25.0, 20.0), (f64::INFINITY, 20.0), (-25.0, -20.0)] {
        let seen = reward.lawful(rho);
        assert!(seen.abs() < 20.0 && (seen - bound).abs() < 1e-4, "{seen}");
        assert!((seen as f32).abs() < 20.0, "and as learners see it");
    }
    assert_eq!([1, 2, 3].map(|m| reward.foul(m, 3)), [-20.0, -40.0, -60.0]);
    assert!(reward.foul(1, 3) < reward.lawful(f64::NEG_INFINITY));
    let held = reward.of(&Verdict::Held { margin: 4.0 }, 3);
    assert_eq!(held, Some(-4.0));
    // A steep transform saturates inside the fouls too.
    let steep = Reward::Tanh {
        rho_max: 50.0,
        scale: 0.5,
        jump: 0.0,
        foul_span: 1.0,
    };
    for rho in [50.0, f64::INFINITY, -50.0, f64::NEG_INFINITY] {
        let seen = steep.lawful(rho) as f32;
        assert!(seen.abs() > 0.99999 && seen.abs() < 1.0, "{seen}");
    }
    near(steep.lawful(0.25), 0.5_f64.tanh());
    near(steep.foul(3, 4), -1.5);
    // A wide scale is cut at ρ_max, not at 1.
    let wide = Reward::Tanh {
        rho_max: 5.0,
        scale: 10.0,
        jump: 0.25,
        foul_span: 1.0,
    };
    near(wide.lawful(1e3), 0.25 + 0.75 * 0.462_117_157_3);
}

/// After a success the rules are followed; every word of a verdict is its own.
#[test]
fn only_a_counterexample_is_a_success() {
    let all = [
        (Verdict::Counterexample { by: 1.0 }, "counterexample", true),
        (Verdict::Held { margin: 1.0 }, "held", false),
        (foul(0, 1), "foul", false),
        (Verdict::Invalid, "invalid", false),
    ];
    for (verdict, word, success) in all {
        assert_eq!((verdict.word(), verdict.is_success()), (word, success));
    }
    let book = rulebook(JudgeKind::UntilViolation, &[(STEADY, 1), (SLOW, 0)]);
    let mut judge = Judge::new(&book, SAMPLES);
    let mut trace = Trace::new(schema());
    let row = [0.0, 5.0, 5.0, 0.0];
    trace.push(&row).expect("finite");
    assert!(judge.push(&book, &trace, &row, None).is_some());
    // The bound itself is lost; a rule that was lost stays so.
    assert_eq!(judge.push_after(&book, &[5.0, 5.0, 5.0, 0.0]), None);
    assert_eq!(judge.push_after(&book, &[5.0, 2.0, 5.0, 0.0]), Some(0));
    assert_eq!(judge.push_after(&book, &[5.0, 5.0, 5.0, 0.0]), Some(0));
    assert_eq!(judge.push_after(&book, &[5.0, 10.0, 5.0, 0.0]), Some(1));
}

/// Something must also be reached: what is not yet reached is not violated, not even
/// where the best that can still come is 0, and not because a run before was lost.
#[test]
fn a_specification_is_lost_only_when_nothing_can_save_it() {
    let spec: Formula = "eventually[0, T] g >= 1 and always[0, T] d >= 1"
        .parse()
        .expect("a formula");
    let constants = Constants::from([("T".to_owned(), 4.0)]);
    let mut book = rulebook(JudgeKind::UntilViolation, &[(STEADY, 0)]);
    book.spec = spec.bind(&schema(), &constants).expect("it binds");
    let row = |d: f64, g: f64| [d, 5.0, 5.0, g];
    let never = vec![row(5.0, 0.0); 5];
    let at_bound = [
        row(1.0, 0.0),
        row(5.0, 0.0),
        row(5.0, 3.0),
        row(5.0, 0.0),
        row(5.0, 0.0),
    ];
    let late = [
        row(3.0, 0.0),
        row(5.0, 0.0),
        row(5.0, 0.0),
        row(5.0, 0.0),
        row(5.0, 2.5),
    ];
    let close = [row(5.0, 0.0), row(0.5, 0.0)];
    let cases: [(&[[f64; 4]], usize, Verdict); 4] = [
        // At the first sample at which it is lost the depth is that of the goal.
        (&close, 1, Verdict::Counterexample { by: 1.0 }),
        (&at_bound, 4, Verdict::Held { margin: 0.0 }),
        (&late, 4, Verdict::Held { margin: 1.5 }),
        (&never, 4, Verdict::Counterexample { by: 1.0 }),
    ];
    let mut again = Judge::new(&book, SAMPLES);
    for (rows, at, verdict) in cases {
        again.reset();
        assert_eq!(judge(&mut again, &book, rows, Stop::Horizon), (at, verdict));
    }
}
