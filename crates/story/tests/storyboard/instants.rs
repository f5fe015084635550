//! Results do not depend on the sample time, and clones continue to the bit.

use proptest::prelude::*;

use crate::toy::{Played, Toy, event, events, speed, when};

/// Events that depend on each other's motion.
fn cascade(headway_s: f64, slow_mps: f64, delay_s: f64) -> String {
    let closes = format!(
        "edge: Rising, is: ByEntity(entities: [\"a\"], condition: TimeHeadway(entity: \"b\", \
         freespace: true, rule: LessThan, value_s: {headway_s:?}))"
    );
    let is_slow = format!(
        "is: ByEntity(entities: [\"a\"], condition: Speed(rule: LessThan, value_mps: {slow_mps:?}))"
    );
    let later = format!(
        "delay_s: {delay_s:?}, is: StoryboardElementState(element: \"brake\", state: RunningState)"
    );
    let parallel = "priority: Parallel,";
    events(
        &[
            event("brake", &(speed(2.0, 3.0) + &when(&closes))),
            event("slow", &(parallel.to_owned() + &when(&is_slow))),
            event("later", &(parallel.to_owned() + &when(&later))),
            event(
                "again",
                &(speed(15.0, 1.0)
                    + &when("is: StoryboardElementState(element: \"slow\", state: CompleteState)")),
            ),
        ]
        .join(", "),
    )
}

fn toy() -> Toy {
    Toy::new(&[(0.0, 20.0), (60.0, 10.0), (0.0, 0.0)]).with_accel(1, -0.5)
}

fn instants(text: &str, sample_s: f64) -> Vec<(String, f64)> {
    let played = Played::play(text, toy(), 10.0, sample_s);
    let names = ["brake", "slow", "later", "again", "act"];
    names.iter().flat_map(|name| played.of(name)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_sample_time_has_no_effect(
        headway_s in 0.5..2.0_f64,
        slow_mps in 3.0..19.0_f64,
        delay_s in 0.0..1.0_f64,
    ) {
        let text = cascade(headway_s, slow_mps, delay_s);
        let fine = instants(&text, 0.01);
        prop_assert!(fine.len() >= 8, "{:?}", fine);
        for sample_s in [0.1, 0.05, 0.025] {
            let coarse = instants(&text, sample_s);
            prop_assert_eq!(fine.len(), coarse.len());
            for (a, b) in fine.iter().zip(&coarse) {
                prop_assert!(a.0 == b.0 && (a.1 - b.1).abs() < 1e-3, "{:?} {:?}", a, b);
            }
        }
    }

    #[test]
    fn a_clone_continues_to_the_bit(
        headway_s in 0.5..2.0_f64,
        slow_mps in 3.0..19.0_f64,
        delay_s in 0.0..1.0_f64,
        fork in 1..99_usize,
    ) {
        let text = cascade(headway_s, slow_mps, delay_s);
        let straight = Played::play(&text, toy(), 10.0, 0.1);
        let mut before = Played::play(&text, toy(), 0.0, 0.1);
        before.on(0, fork, 0.1);
        let mut forked = Played {
            board: before.board.clone(),
            run: before.run.clone(),
            toy: before.toy.clone(),
            changes: before.changes.clone(),
        };
        // The other branch plays on and must not reach into this one.
        before.on(fork, 100, 0.1);
        forked.on(fork, 100, 0.1);
        prop_assert_eq!(&forked.changes, &before.changes);
        prop_assert_eq!(&forked.changes, &straight.changes);
    }
}

#[test]
fn a_trigger_within_a_sample_is_exact() {
    // 56 m between the boxes, closing at 10 m/s and faster: known in closed form.
    let played = Played::play(&cascade(1.0, 19.0, 0.0), toy(), 10.0, 0.1);
    let root_s = (-10.0 + (100.0_f64 + 2.0 * 0.5 * 36.0).sqrt()) / 0.5;
    let found_s = played.of("brake")[0].1;
    assert!((found_s - root_s).abs() < 1e-6, "{found_s} {root_s}");
}
