//! One suite over every shipped world: determinism, bounds, finiteness, forks.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Episode, HeldRandom, Testbench, play};
use brakecheck::world::PlantKind;

fn key(purpose: Purpose, index: u64) -> StartKey {
    StartKey {
        purpose,
        seed: 7,
        index,
    }
}

fn episode(bench: &mut Testbench, index: u64) -> Episode {
    let key = key(Purpose::Test, index);
    let (start, noise) = (bench.draw(key), bench.noise_of(key));
    let mut actor = HeldRandom::new(bench.spaces().actions, 5);
    play(bench, &start, noise, &mut actor, Aftermath::Play)
}

#[test]
fn equal_keys_give_equal_episodes_whatever_was_played_before() {
    for (name, world) in super::shipped() {
        for plant in [PlantKind::Rigid, PlantKind::Kinematic] {
            let world = world.on(plant);
            let (mut once, mut again) = (world.bench(), world.bench());
            for index in [3, 1, 4] {
                episode(&mut again, index);
            }
            for index in 0..4 {
                assert_eq!(
                    episode(&mut once, index),
                    episode(&mut again, index),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn starts_lie_in_their_box_and_purposes_do_not_share_any() {
    for (name, world) in super::shipped() {
        let bench = world.bench();
        let mut seen = std::collections::HashSet::new();
        for purpose in [Purpose::Train, Purpose::Calibration, Purpose::Test] {
            for index in 0..200 {
                let start = bench.draw(key(purpose, index));
                assert_eq!(start.0.len(), bench.axes().len());
                for (value, axis) in start.0.iter().zip(bench.axes()) {
                    assert!((axis.lo..=axis.hi).contains(value), "{name}: {}", axis.name);
                }
                let bits: Vec<u64> = start.0.iter().map(|v| v.to_bits()).collect();
                // A finite world has too few starts not to draw one again.
                let fresh = seen.insert(bits) || world.starts().is_some();
                assert!(fresh, "{name}: a start is drawn twice");
            }
        }
    }
}

#[test]
fn observations_are_scaled_and_rows_have_the_declared_length() {
    for (name, world) in super::shipped() {
        let mut bench = world.bench();
        let mut obs = vec![0.0; bench.spaces().observation];
        // Where the whole run is judged, cars drive on and apart.
        let most = match world.rulebook().judge {
            brakecheck::rulebook::JudgeKind::WholeRun => 20.0,
            _ => 10.0,
        };
        for index in 0..20 {
            let played = episode(&mut bench, index);
            bench.observe(&mut obs);
            assert!(
                obs.iter().all(|v| v.is_finite() && v.abs() < most),
                "{name}: {obs:?}"
            );
            assert!(played.trace.len() <= bench.clock().samples());
            assert!(played.judged >= 1 && played.judged <= played.trace.len());
        }
    }
}

#[test]
fn a_fork_goes_on_bit_for_bit() {
    for (name, world) in super::shipped() {
        for plant in [PlantKind::Rigid, PlantKind::Kinematic] {
            let mut bench = world.on(plant).bench();
            let key = key(Purpose::Test, 0);
            bench.begin(&bench.draw(key), bench.noise_of(key), Aftermath::Skip);
            let last = bench.spaces().actions - 1;
            (0..5).for_each(|_| bench.decide(last));
            let mut fork = bench.fork().expect("stock egos can be copied");
            for action in [last, 0, last, 0] {
                bench.decide(action);
                fork.decide(action);
            }
            assert_eq!(bench.trace(), fork.trace(), "{name}");
            assert_eq!(bench.verdict(), fork.verdict(), "{name}");
        }
    }
}

#[test]
fn the_neutral_action_leaves_speeds_alone() {
    // "Coast" is zero net acceleration: a coasting ado keeps its speed.
    let world = super::acc();
    for plant in [PlantKind::Rigid, PlantKind::Kinematic] {
        let mut bench = world.on(plant).bench();
        let neutral = bench.spaces().neutral;
        let key = key(Purpose::Test, 3);
        bench.begin(&bench.draw(key), 0, Aftermath::Skip);
        while !bench.is_done() {
            bench.decide(neutral);
        }
        let speeds = bench.trace().signal("ado.speed").expect("published");
        let spread = speeds
            .iter()
            .fold(0.0f64, |s, v| s.max((v - speeds[0]).abs()));
        assert!(spread < 1e-3, "{plant:?}: {spread} m/s");
    }
}
