//! The test bench step by step, and as learners see it.

use brakecheck::rl::{End, Env};
use brakecheck::rulebook::{RulesUntilContact, Verdict};
use brakecheck::scene::Start;
use brakecheck::seed::Purpose;
use brakecheck::testbench::{Aftermath, Constant, Episode, FaultLog, Gym, Replay, play};
use brakecheck::world::Scenario;

use super::near;
use super::scene::{Quirky, SUBSTEPS, altered, chase, paper, paper_of};

fn played(world: &Scenario, h: f64, action: usize, aftermath: Aftermath) -> Episode {
    let start = Start(vec![h]);
    play(
        &mut world.bench(),
        &start,
        1,
        &mut Constant(action),
        aftermath,
    )
}

/// Nothing is paid on the way; the last step pays the reward of the verdict, and the
/// problem is over then: the horizon is part of it, so nothing is cut off.
#[test]
fn learners_are_paid_once_at_the_end() {
    let world = chase();
    let mut gym = Gym::new(world.bench(), Purpose::Train, 3);
    gym.keep_successes();
    let mut obs = [0.0; 2];
    let (mut decisions, mut steps, mut solved) = (0, 0, Vec::new());
    let mut ends = [0; 3];
    for index in 0..60 {
        let action = (index % 5) as usize;
        gym.reset(index, &mut obs);
        let key = gym.key(index);
        let h = gym.bench().draw(key).0[0];
        assert!((f64::from(obs[0]) - (h - 20.0) / 20.0).abs() < 1e-5);
        let seen = paper(h, false, |_, _| action);
        let length = seen.samples.div_ceil(2);
        for decision in 1..=length {
            let step = gym.step(action, &mut obs);
            decisions += 1;
            if decision < length {
                assert_eq!((step.reward, step.end), (0.0, None), "{h} m, {action}");
                continue;
            }
            assert_eq!(step.end, Some(End::Terminated), "{h} m, {action}");
            let reward = f64::from(step.reward);
            assert!((reward - seen.reward()).abs() < 1e-5, "{reward}, {seen:?}");
        }
        steps += SUBSTEPS * seen.samples;
        if seen.success {
            solved.push((decisions, index, h, -seen.robustness, length as usize));
        }
        ends[usize::from(seen.success) + 2 * usize::from(seen.foul.is_some())] += 1;
        assert_eq!(
            (gym.spent().decisions, gym.spent().physics_steps),
            (decisions, steps)
        );
    }
    assert!(ends.iter().all(|n| *n > 5), "{ends:?}");
    let kept = gym.take_successes();
    assert_eq!(kept.len(), solved.len());
    for (kept, (decisions, index, h, by, length)) in kept.iter().zip(solved) {
        assert_eq!((kept.decisions, kept.index), (decisions, index));
        assert_eq!(kept.start, Start(vec![h]));
        assert_eq!(kept.actions, vec![(index % 5) as usize; length]);
        near(kept.by, by);
    }
    assert!(gym.take_successes().is_empty());
}

#[test]
fn an_episode_in_which_the_ego_fails_is_aborted_and_pays_nothing() {
    let world = Quirky::failing_from(&[]).drives(&altered(&[("(11.0, 60.0)", "(20.1, 20.9)")]));
    let failing = Quirky::failing_from(&[20.0]).drives(&world);
    for (world, fails) in [(&world, false), (&failing, true)] {
        let mut gym = Gym::new(world.bench(), Purpose::Train, 3);
        gym.tell_faults(FaultLog::allowing(0.5));
        gym.keep_successes();
        let mut obs = [0.0; 2];
        gym.reset(0, &mut obs);
        let mut last = gym.step(3, &mut obs);
        while last.end.is_none() {
            assert_eq!(last.reward, 0.0);
            last = gym.step(3, &mut obs);
        }
        let expected = if fails { End::Aborted } else { End::Terminated };
        assert_eq!(last.end, Some(expected));
        assert_eq!(last.reward == 0.0, fails);
        assert_eq!(gym.take_successes().is_empty(), fails);
        // Three samples are answered and a fourth begun: two decisions.
        assert_eq!(gym.spent().decisions == 2, fails);
        assert_eq!(gym.spent().physics_steps == 4 * SUBSTEPS, fails);
    }
}

/// −3 from 18.01 m: headway(2) is 10.01, so ψ_ego is lost at 2.25 s, the first rule at
/// 8/3 s, and they touch after (√81.82 − 1)/3 = 2.6818 s: it is lost at the contact.
#[test]
fn an_episode_ends_where_paper_ends_it() {
    let world = chase();
    let skipped = played(&world, 18.01, 4, Aftermath::Skip);
    let whole = played(&world, 18.01, 4, Aftermath::Play);
    for episode in [&skipped, &whole] {
        assert!(episode.verdict.is_success());
        // headway(2.25) = 18.01 − 2.25 − 7.59375 = 8.16625.
        near(episode.robustness, 8.16625 - 10.0);
        assert_eq!(episode.judged, 10);
        assert_eq!(episode.start, Start(vec![18.01]));
    }
    assert_eq!((skipped.trace.len(), whole.trace.len()), (10, 12));
    assert_eq!(
        (skipped.physics_steps, whole.physics_steps),
        (9 * SUBSTEPS, 11 * SUBSTEPS)
    );
    assert_eq!((skipped.actions.len(), whole.actions.len()), (5, 6));
    assert_eq!((skipped.contact, skipped.rules_until_contact), (None, None));
    let touch = whole.contact.as_ref().expect("a contact");
    let touch_s = (81.82_f64.sqrt() - 1.0) / 3.0;
    near(touch.time_s, touch_s);
    near(touch.closing_speed_mps, 81.82_f64.sqrt());
    let broken = RulesUntilContact::Broken {
        rule: "keeps moving".to_owned(),
        ado: "ado".to_owned(),
        time_s: touch.time_s,
    };
    assert_eq!(whole.rules_until_contact, Some(broken));
    assert!(whole.is_foul_before_contact());
    // From 21.51 m the contact comes at 3.05 s; the rule is lost at the sample before.
    let later = played(&world, 21.51, 4, Aftermath::Play);
    let Some(RulesUntilContact::Broken { time_s, .. }) = later.rules_until_contact else {
        panic!("{:?}", later.rules_until_contact);
    };
    assert_eq!(time_s, 2.75);
    // From 16.01 m it is kept: the contact comes at 2.45 s.
    let kept = played(&world, 16.01, 4, Aftermath::Play);
    assert_eq!(kept.rules_until_contact, Some(RulesUntilContact::Kept));
    assert!(!kept.is_foul_before_contact());
    // From 26.51 m and −2 there is no contact, and nothing to be followed up to it.
    let none = played(&world, 26.51, 3, Aftermath::Play);
    assert!(none.verdict.is_success() && none.contact.is_none());
    assert_eq!((none.rules_until_contact, none.trace.len()), (None, 17));
}

/// Held and foul runs are not played on; a foul ends at its sample.
#[test]
fn only_a_success_has_an_aftermath() {
    let world = chase();
    let foul = played(&world, 30.01, 4, Aftermath::Play);
    let verdict = Verdict::Foul {
        rule: 0,
        forfeited: 2,
    };
    assert_eq!(
        (foul.verdict, foul.judged, foul.trace.len()),
        (verdict, 12, 12)
    );
    let foul = played(&world, 30.01, 0, Aftermath::Play);
    let verdict = Verdict::Foul {
        rule: 1,
        forfeited: 1,
    };
    assert_eq!((foul.verdict, foul.trace.len()), (verdict, 2));
    let held = played(&world, 30.01, 2, Aftermath::Play);
    assert_eq!((held.judged, held.trace.len()), (17, 17));
    let Verdict::Held { margin } = held.verdict else {
        panic!("{:?}", held.verdict);
    };
    near(margin, 30.01 - 12.0 - 10.0);
    near(held.robustness, 8.01);
    // At the horizon its rule is at the bound exactly: that is broken.
    let at_bound = played(&world, 30.01, 3, Aftermath::Play);
    let verdict = Verdict::Foul {
        rule: 0,
        forfeited: 2,
    };
    assert_eq!((at_bound.verdict, at_bound.judged), (verdict, 17));
}

/// ψ_ego asks for 4 m only, which a contact at 4.54 m does not violate. The ado must
/// also be slow in the end, which it is not yet when the two touch.
#[test]
fn a_contact_before_the_verdict_proves_nothing_against_anybody() {
    let words = [
        ("headway >= 10", "headway >= 4"),
        (
            "rulebook: [",
            "rulebook: [ Rule(name: \"yields\", priority: 3, stl: \"eventually[0, T] (ado.speed <= 1)\"),",
        ),
        ("(ado.speed >= 2)", "(ado.speed >= 0.5)"),
    ];
    let world = altered(&words);
    // They touch from 15.01 m at 10 − 3 t with t = (√63.82 − 1)/3 = 2.33 s.
    let episode = played(&world, 15.01, 4, Aftermath::Play);
    let Verdict::Held { margin } = episode.verdict else {
        panic!("{:?}", episode.verdict);
    };
    near(margin, 0.54);
    assert!(episode.contact.is_some());
    // From 59 m, without a contact, whoever has not yielded by the end has fouled.
    let verdict = Verdict::Foul {
        rule: 2,
        forfeited: 1,
    };
    assert_eq!(played(&world, 59.01, 2, Aftermath::Play).verdict, verdict);
    // Judged as a whole, the contact is held to the end: then it never yields.
    let words: Vec<_> = words
        .into_iter()
        .chain([("judge: UntilViolation", "judge: WholeRun")])
        .collect();
    let whole = played(&altered(&words), 15.01, 4, Aftermath::Play);
    assert_eq!((whole.verdict, whole.trace.len()), (verdict, 17));
}

/// Judged as a whole: −3 loses the first rule at 2.75 s if nothing stops it before.
#[test]
fn a_whole_run_is_judged_with_the_contact_held_to_its_end() {
    let world = altered(&[("judge: UntilViolation", "judge: WholeRun")]);
    // Contact at 2.45 s, at a speed above 2 m/s, which is held: a success by 5.46 m.
    let episode = played(&world, 16.01, 4, Aftermath::Play);
    let Verdict::Counterexample { by } = episode.verdict else {
        panic!("{:?}", episode.verdict);
    };
    near(by, 10.0 - 4.54);
    assert_eq!((episode.trace.len(), episode.judged), (17, 17));
    assert_eq!(episode.physics_steps, 10 * SUBSTEPS);
    // Contact at 2.68 s, at less than 2 m/s: a foul.
    let foul = Verdict::Foul {
        rule: 0,
        forfeited: 2,
    };
    assert_eq!(played(&world, 18.01, 4, Aftermath::Play).verdict, foul);
    // Whatever succeeds in the middle must keep its rules to the end: −2 does not.
    assert_eq!(played(&world, 26.51, 3, Aftermath::Play).verdict, foul);
    assert_eq!(played(&world, 26.51, 3, Aftermath::Play).judged, 17);
    // −1 does: 21.01 − 12 = 9.01 m.
    let Verdict::Counterexample { by } = played(&world, 21.01, 2, Aftermath::Play).verdict else {
        panic!("it is solved");
    };
    near(by, 10.0 - 9.01);
}

/// What goes wrong once an ego has failed its specification takes nothing back.
#[test]
fn a_fault_in_the_aftermath_does_not_undo_a_success() {
    // 14.26 m and −3: lost at 1.5 s (14.26 − 1.5 − 3.375 < 10) or before, which is
    // sample 6; the ego fails on its fourth call, after 0.75 s.
    let failing = Quirky::failing_from(&[14.0]).drives(&chase());
    let early = played(&failing, 14.26, 4, Aftermath::Play);
    assert_eq!(
        (early.verdict, early.fault.is_some()),
        (Verdict::Invalid, true)
    );
    let words = [
        ("headway >= 10", "headway >= 13.5"),
        ("(11.0, 60.0)", "(14.0, 60.0)"),
    ];
    let failing = Quirky::failing_from(&[14.0]).drives(&altered(&words));
    // headway(0.5) = 14.26 − 0.5 − 0.375 = 13.385.
    let late = played(&failing, 14.26, 4, Aftermath::Play);
    let Verdict::Counterexample { by } = late.verdict else {
        panic!("{:?}", late.verdict);
    };
    near(by, 0.115);
    assert_eq!((late.judged, late.trace.len()), (3, 4));
    assert!(late.fault.is_some());
}

#[test]
fn a_replay_holds_its_last_action_or_goes_on_with_another() {
    let world = chase();
    let start = Start(vec![25.01]);
    let act = |mut replay: Replay<'_>| {
        let episode = play(&mut world.bench(), &start, 1, &mut replay, Aftermath::Skip);
        episode.actions
    };
    assert_eq!(act(Replay::holding(&[1, 2])), [1, 2, 2, 2, 2, 2, 2, 2]);
    assert_eq!(act(Replay::then(&[2, 2], 1)), [2, 2, 1, 1, 1, 1, 1, 1]);
    let seen = paper_of(25.01, &[1, 2]);
    assert!(!seen.success && seen.foul.is_none());
}
