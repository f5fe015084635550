//! The leaf, the decisive action and the last chance, against trying everything.

use std::sync::Arc;

use brakecheck::ego::Controller;
use brakecheck::experiment::Watch;
use brakecheck::rulebook::Verdict;
use brakecheck::testbench::{Aftermath, Episode, Replay, play};
use brakecheck::world::Scenario;
use brakecheck_crashes::crashes::minimize::shrink;
use brakecheck_crashes::crashes::root_cause::{SubstituteDriver, decisive, last_chance, why};
use brakecheck_ego::ego::takeover::{FullBrake, Takeover};

use super::found::{acc, acc_found};
use super::near;

fn held(episode: &Episode) -> bool {
    matches!(episode.verdict, Verdict::Held { .. })
}

fn coasting_after(world: &Scenario, of: &Episode, actions: &[usize]) -> Episode {
    let mut bench = world.bench();
    let mut ado = Replay::then(actions, bench.spaces().neutral);
    play(&mut bench, &of.start, of.noise, &mut ado, Aftermath::Skip)
}

#[test]
fn the_leaf_is_that_of_the_specification() {
    let episodes = acc_found();
    let it = why(acc(), &episodes[0], None);
    assert_eq!(it.leaf, "headway >= d_safe");
    let judged_s = (episodes[0].judged - 1) as f64 * 0.05;
    near(it.leaf_s, judged_s);
    let words = it.to_string();
    assert!(
        words.starts_with("`headway >= d_safe` is violated at"),
        "{words}"
    );
    assert!(words.contains("full braking"), "{words}");
}

#[test]
fn the_decisive_action_is_the_earliest_that_avoids_it() {
    let (world, episodes) = (acc(), &acc_found()[..6]);
    let (mut singles, mut stretches) = (0, 0);
    for found in episodes {
        let episode = &shrink(world, found, &Watch::unwatched()).0;
        let avoids = |from: usize, to: usize| {
            let mut actions = episode.actions.clone();
            actions[from..to].fill(1);
            held(&coasting_after(world, episode, &actions))
        };
        let one =
            (0..episode.actions.len()).find(|&at| episode.actions[at] != 1 && avoids(at, at + 1));
        let told = decisive(world, episode);
        match (one, &told) {
            (Some(at), Some(told)) => {
                near(told.from_s, at as f64 * 0.5);
                near(told.until_s, (at + 1) as f64 * 0.5);
                singles += 1;
            }
            (None, Some(told)) => {
                let [from, to] = [told.from_s, told.until_s].map(|s| (s / 0.5).round() as usize);
                assert!(to - from >= 2 && avoids(from, to));
                assert!(
                    episode.actions[from..to]
                        .iter()
                        .all(|a| *a == episode.actions[from])
                );
                stretches += 1;
            }
            (Some(_), None) => panic!("it is decisive, and nobody says so"),
            (None, None) => {}
        }
    }
    assert!(singles + stretches > 0, "nothing was decisive");
}

/// Its own cruise control up to a sample, then all the brakes.
fn braking_from(world: &Scenario, of: &Episode, after: usize) -> bool {
    let spec = world.controller().expect("a stock ego");
    let factory = move || -> Box<dyn Controller> {
        let own = spec.controller.build();
        let brake = FullBrake {
            brake_mps2: 0.9 * 9.81,
        };
        Box::new(Takeover::new(own, Box::new(brake), after))
    };
    let world = world.with_ego("braking", Arc::new(factory));
    held(&coasting_after(&world, of, &of.actions))
}

#[test]
fn the_last_chance_is_the_last_sample_from_which_braking_helps() {
    let (world, episodes) = (acc(), &acc_found()[..4]);
    let driving = world.drive().expect("driven");
    let driver = SubstituteDriver::full_brake(driving);
    let mut seen = 0;
    for episode in episodes {
        let chance = last_chance(driving, episode, &driver);
        let violated = episode.judged - 1;
        near(chance.violated_s, violated as f64 * 0.05);
        let helps = |after: &usize| braking_from(world, episode, *after);
        let last = (0..=violated).rev().find(helps);
        let told = chance.at_s.map(|at_s| (at_s / 0.05).round() as usize);
        assert_eq!(told, last);
        seen += usize::from(last.is_some());
    }
    assert!(seen > 0, "braking never helps");
}

/// Another driver can be asked: one that does nothing has no chance.
#[test]
fn another_driver_may_be_asked() {
    let (world, episodes) = (acc(), acc_found());
    let idle = || -> Box<dyn Controller> { Box::new(FullBrake { brake_mps2: 0.0 }) };
    let driver = SubstituteDriver {
        name: "nobody".to_owned(),
        factory: Arc::new(idle),
    };
    let it = why(world, &episodes[0], Some(&driver));
    let chance = it.last_chance.clone().expect("driven");
    assert_eq!(chance.driver, "nobody");
    // Who does nothing may take over once the rest does not matter, no sooner.
    assert!(
        chance
            .at_s
            .is_none_or(|at_s| chance.violated_s - at_s < 0.5),
        "{it}"
    );
}
