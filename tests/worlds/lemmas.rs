//! Lemma 2: a trace that breaks only lesser rules earns strictly more.

use brakecheck::rulebook::{Reward, Verdict};
use proptest::prelude::*;

fn rewards() -> impl Strategy<Value = Reward> {
    prop_oneof![
        (0.1..1e3).prop_map(|rho_max| Reward::Plain { rho_max }),
        (0.1..1e3, 0.1..1e3, 0.0..0.99, 1e-3..1e3).prop_map(|(rho_max, scale, jump, foul_span)| {
            Reward::Tanh {
                rho_max,
                scale,
                jump,
                foul_span,
            }
        }),
    ]
}

/// Robustness values, the awkward ones included.
fn rho() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e4..1e4,
        Just(0.0),
        Just(-0.0),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(f64::MIN_POSITIVE),
    ]
}

/// Shares to which goals are reached, the impossible ones included.
fn shares() -> impl Strategy<Value = f64> {
    prop_oneof![
        0.0..=1.0f64,
        Just(-1.0),
        Just(1e9),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_worse_broken_rule_earns_strictly_less(
        reward in rewards(), a in 1usize..20, more in 1usize..20, lesser in 0usize..20,
    ) {
        let (b, rules) = (a + more, a + more + lesser);
        // M counts forfeited rules: the larger M broke the more important rule.
        let (worse, better) = (reward.foul(b, rules), reward.foul(a, rules));
        prop_assert!(worse < better);
        prop_assert!((worse as f32) < better as f32);
    }

    #[test]
    fn every_lawful_run_earns_strictly_more_than_any_foul(
        reward in rewards(), m in 1usize..20, lesser in 0usize..20, value in rho(),
    ) {
        let (foul, lawful) = (reward.foul(m, m + lesser), reward.lawful(value));
        prop_assert!(foul < lawful);
        // Learners see them in single precision.
        prop_assert!((foul as f32) < lawful as f32);
    }

    #[test]
    fn deeper_violations_never_earn_less(reward in rewards(), x in rho(), y in rho()) {
        let (a, b) = (x.min(y), x.max(y));
        prop_assert!(reward.lawful(a) <= reward.lawful(b));
    }

    #[test]
    fn a_success_earns_more_than_any_held_run(
        reward in rewards(), by in 1e-6..1e3f64, margin in 0.0..1e3f64,
    ) {
        let success = reward.of(&Verdict::Counterexample { by }, 2).unwrap();
        let held = reward.of(&Verdict::Held { margin }, 2).unwrap();
        prop_assert!(held < success);
        prop_assert!(0.0 < success && held <= 0.0);
    }

    /// However far a success reaches the goals of its training: it earns what it
    /// earned without, or more, and more than all that is none.
    #[test]
    fn goals_move_successes_only_and_keep_them_above_everything_else(
        reward in rewards(), by in 1e-6..1e3f64, share in shares(), other in rho(),
        m in 1usize..20, lesser in 0usize..20,
    ) {
        let success = reward.success(by, share);
        let without = reward.of(&Verdict::Counterexample { by }, 2).unwrap();
        prop_assert!(without <= success);
        prop_assert!(0.0 < success as f32);
        let margin = other.abs();
        let others = [
            reward.of(&Verdict::Held { margin }, 2).unwrap(),
            reward.of(&Verdict::Uncounted { by: margin }, 2).unwrap(),
            reward.foul(m, m + lesser),
        ];
        for other in others {
            // Learners see them in single precision.
            prop_assert!((other as f32) < success as f32, "{other} {success}");
        }
        let top = reward.lawful(f64::INFINITY);
        prop_assert!(success <= top && (top - reward.success(by, 1.0)).abs() <= 1e-9 * top);
        prop_assert!(reward.success(by, 0.5 * share) <= success);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Lemma 2's order with what does not count in it: a foul, held, a
    /// violation that does not count, one that does.
    #[test]
    fn what_does_not_count_earns_more_than_held_and_less_than_what_counts(
        (rho_max, scale, jump) in (0.1..1e3f64, 0.1..1e3f64, 1e-2..0.99f64),
        shallow in 1e-6..1e3f64, deep in 1e-6..1e4f64, margin in 0.0..1e3f64,
    ) {
        let reward = Reward::Tanh { rho_max, scale, jump, foul_span: 0.1 };
        let of = |verdict| reward.of(&verdict, 2).unwrap();
        let foul = of(Verdict::Foul { rule: 1, forfeited: 1 });
        let held = of(Verdict::Held { margin });
        let uncounted = of(Verdict::Uncounted { by: deep });
        let counted = of(Verdict::Counterexample { by: shallow });
        let order = [foul, held, uncounted, counted];
        prop_assert!(order.is_sorted_by(|a, b| a < b), "{:?}", order);
        // Learners take what pays more than 0 for a success.
        prop_assert!(uncounted < 0.0 && 0.0 < counted);
        // Learners see them in single precision.
        let [held, uncounted, counted] = [held, uncounted, counted].map(|x| x as f32);
        prop_assert!([held, uncounted, counted].is_sorted_by(|a, b| a < b));
        // Deeper is never worse, counted or not.
        let deeper = of(Verdict::Uncounted { by: shallow.max(deep) });
        let less_deep = of(Verdict::Uncounted { by: shallow.min(deep) });
        prop_assert!(less_deep <= deeper);
    }
}

/// Lemma 2 with the rules, their order and the reward of every shipped world, the
/// paper's plain reward among them.
#[test]
fn every_shipped_world_pays_more_for_breaking_a_lesser_rule_alone() {
    let mut plain = 0;
    for (name, world) in super::shipped() {
        let book = world.rulebook();
        plain += usize::from(matches!(book.reward, Reward::Plain { .. }));
        let pays = |verdict: &Verdict| book.reward_of(verdict).unwrap() as f32;
        let foul = |rule| {
            let forfeited = book.forfeited(rule);
            pays(&Verdict::Foul { rule, forfeited })
        };
        let worst = pays(&Verdict::Held {
            margin: f64::INFINITY,
        });
        for (a, first) in book.rules.iter().enumerate() {
            assert!(foul(a) < worst, "{name}: `{}` and a lawful run", first.name);
            for (b, second) in book.rules.iter().enumerate() {
                if first.priority < second.priority {
                    assert!(foul(a) < foul(b), "{name}: {}, {}", first.name, second.name);
                }
            }
        }
    }
    assert!(plain >= 6, "{plain} worlds with the plain reward");
}

#[test]
fn the_numbers_of_the_default_transform() {
    let reward = Reward::default();
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    close(reward.lawful(10.0), 0.5 + 0.5 * 1f64.tanh());
    close(reward.lawful(-10.0), -0.5 - 0.5 * 1f64.tanh());
    close(reward.lawful(0.0), -0.5);
    close(reward.uncounted(10.0), -0.5 * (1.0 - 1f64.tanh()));
    close(reward.uncounted(0.0), -0.5 * (1.0 - 1e-6));
    close(reward.foul(1, 2), -1.0);
    close(reward.foul(2, 2), -1.05);
    assert_eq!(reward.of(&Verdict::Invalid, 2), None);
}

#[test]
fn definition_4_as_printed() {
    let reward = Reward::Plain { rho_max: 50.0 };
    assert_eq!(reward.lawful(3.0), 3.0);
    assert_eq!(reward.foul(2, 2), -100.0);
    // At M = 1 the penalty is no tie with a lawful run at the clamp.
    assert!(reward.foul(1, 2) < reward.lawful(-1e9));
}

/// Lemma 2 for each ado of a composition, over all sets of broken rules.
#[test]
fn an_ado_that_breaks_a_rule_earns_less_than_one_that_breaks_none_or_a_lesser_one() {
    use brakecheck::rulebook::Rulebook;
    let world = brakecheck::world::Scenario::shipped("sandwich")
        .expect("shipped")
        .expect("sound");
    let rulebook: &Rulebook = world.rulebook();
    let rules = rulebook.rules.len();
    assert_eq!(rules, 5);
    let lawful = [
        Verdict::Counterexample { by: 1e-9 },
        Verdict::Held { margin: 80.0 },
    ];
    for broken in 1u32..1 << rules {
        let broken: Vec<usize> = (0..rules).filter(|i| broken >> i & 1 == 1).collect();
        let first = broken[0];
        let foul = Verdict::Foul {
            rule: first,
            forfeited: rulebook.forfeited(first),
        };
        for ado in ["lead", "tail"] {
            let earned = rulebook.reward_of_ado(ado, &foul, &broken).expect("valid");
            let own = |i: &&usize| rulebook.rules[**i].ado == ado;
            let Some(&worst) = broken.iter().find(own) else {
                // The violation of another ado is no penalty, and no success.
                let barely = rulebook.reward.lawful(0.0);
                assert_eq!(earned, barely);
                continue;
            };
            for verdict in &lawful {
                let lawful = rulebook.reward_of_ado(ado, verdict, &[]).expect("valid");
                assert!(earned < lawful, "{ado} {broken:?} {verdict:?}");
            }
            for lesser in (worst + 1..rules).filter(|i| rulebook.rules[*i].ado == ado) {
                let milder = rulebook
                    .reward_of_ado(ado, &foul, &[lesser])
                    .expect("valid");
                assert!(earned < milder, "{ado} {worst} {lesser}");
            }
        }
    }
}
