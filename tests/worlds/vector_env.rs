//! Environments stepped together: the bits of one by one, in every world.

use brakecheck::rl::Env;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::Scratch;
use brakecheck::testbench::Gym;
use brakecheck::vector_env::{EnvLayout, VectorEnv};
use brakecheck::world::{PlantKind, Scenario};
use rand::RngExt;

/// More than one group of lanes, and no multiple of one.
const COUNT: usize = 70;

fn key(environment: usize, index: u64) -> StartKey {
    StartKey {
        purpose: Purpose::Train,
        seed: environment as u64,
        index,
    }
}

fn kinematic(name: &str) -> Scenario {
    let world = Scenario::shipped(name).expect("shipped").expect("valid");
    world.on(PlantKind::Kinematic)
}

/// A shipped world with a change of its text.
fn changed(name: &str, from: &str, to: &str) -> Scenario {
    let world = kinematic(name);
    assert!(world.text().contains(from), "{name} has no {from}");
    let text = world.text().replacen(from, to, 1);
    let world = Scenario::parse("changed.ron", &text).expect("a world");
    world.on(PlantKind::Kinematic)
}

fn assert_same_bits(found: &[f32], want: &[f32], context: &str) {
    let bits = |row: &[f32]| row.iter().map(|it| it.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(found), bits(want), "{context}: {found:?} {want:?}");
}

/// Number of ended episodes, successes, fouls and contacts.
#[derive(Default)]
struct Seen {
    episodes: u32,
    successes: u32,
    fouls: u32,
    contacts: u32,
}

/// Plays random actions in `count` environments and in as many gyms.
fn compare(world: &Scenario, count: usize, steps: usize) -> Seen {
    let mut env = VectorEnv::new(world, count);
    let (width, actions) = (env.spaces().observation, env.spaces().actions);
    let gym = |i: usize| Gym::new(world.bench(), Purpose::Train, i as u64);
    let mut gyms: Vec<Gym> = (0..count).map(gym).collect();
    let (mut observations, mut one) = (vec![0.0; count * width], vec![0.0; width]);
    let (mut rewards, mut ends) = (vec![0.0; count], vec![None; count]);
    let (mut next, mut held) = (vec![0; count], vec![0; count]);
    let mut rng = brakecheck::seed::generator("vector", &[]);
    let (mut seen, mut scratch) = (Seen::default(), Scratch::new());
    for step in 0..steps {
        for i in 0..count {
            let context = format!("{} environment {i}, step {step}", world.name());
            let row = i * width..(i + 1) * width;
            if env.is_over(i) {
                env.begin(i, key(i, next[i]), &mut observations[row.clone()]);
                gyms[i].reset(next[i], &mut one);
                next[i] += 1;
                assert_same_bits(&observations[row], &one, &context);
            }
            // Some keep their actions for a while: chance alone drives few to the end.
            if i % 3 == 0 || step % 6 == 0 {
                held[i] = rng.random_range(0..actions);
            }
        }
        env.step(&held, &mut observations, &mut rewards, &mut ends);
        for (i, gym) in gyms.iter_mut().enumerate() {
            let context = format!("{} environment {i}, step {step}", world.name());
            let want = gym.step(held[i], &mut one);
            assert_same_bits(&observations[i * width..][..width], &one, &context);
            let reward = rewards[i] as f32;
            assert_eq!(reward.to_bits(), want.reward.to_bits(), "{context}");
            assert_eq!(ends[i], want.end, "{context}");
            let bench = gym.bench();
            assert_eq!(env.verdict(i), bench.verdict(), "{context}");
            assert_eq!(env.is_over(i), want.end.is_some(), "{context}");
            let Some(verdict) = bench.verdict() else {
                continue;
            };
            seen.episodes += 1;
            seen.successes += u32::from(verdict.is_success());
            seen.fouls += u32::from(verdict.is_foul());
            seen.contacts += u32::from(bench.contact().is_some());
            if bench.fault().is_none() {
                let spec = &bench.rulebook().spec;
                let rho = spec.robustness(bench.trace(), &mut scratch);
                assert_eq!(env.robustness(i).to_bits(), rho.to_bits(), "{context}");
            }
            if i % 16 == 0 {
                let mut again = world.bench();
                assert!(env.play_again(i, &mut again));
                assert_eq!(again.trace(), bench.trace(), "{context}");
                assert_eq!(again.verdict(), bench.verdict(), "{context}");
            }
        }
    }
    seen
}

#[test]
fn worlds_of_vehicles_are_laid_out_in_lanes() {
    let in_lanes = |name: &&str| {
        let world = kinematic(name);
        VectorEnv::new(&world, 1).layout() == EnvLayout::Lanes
    };
    let lanes: Vec<_> = Scenario::shipped_names().filter(in_lanes).collect();
    for name in ["acc", "merge", "sandwich", "cut_in"] {
        assert!(lanes.contains(&name), "{name} is not among {lanes:?}");
    }
    for name in ["grid", "pedestrian", "yellow_light", "wet_bend"] {
        assert!(!lanes.contains(&name), "{name} is among {lanes:?}");
    }
    let rigid = Scenario::shipped("acc").expect("shipped").expect("valid");
    assert_eq!(VectorEnv::new(&rigid, 1).layout(), EnvLayout::Benches);
}

/// Every way for an episode to end has to occur, or the comparison shows little.
#[test]
fn the_lanes_of_acc_have_the_bits_of_gyms() {
    let seen = compare(&kinematic("acc"), COUNT, 120);
    assert!(0 < seen.successes && 0 < seen.fouls, "{}", seen.successes);
    // Without a headway to keep, episodes end in contacts.
    let crash = changed("acc", "\"d_safe\": 4.7", "\"d_safe\": -90.0");
    let seen = compare(&crash, COUNT, 120);
    assert!(0 < seen.contacts);
}

#[test]
fn the_lanes_of_other_worlds_have_the_bits_of_gyms() {
    for name in ["merge", "sandwich", "cut_in"] {
        let seen = compare(&kinematic(name), COUNT, 80);
        assert!(COUNT as u32 / 2 < seen.episodes, "{name}");
    }
}

#[test]
fn sensors_with_noise_and_delay_have_the_bits_of_gyms() {
    let judge = "judge: UntilViolation,";
    let sensors = "sensors: (delay_s: 0.2, position_sd_m: 0.5, speed_sd_mps: 0.3),";
    let world = changed("acc", judge, &format!("{judge}\n    {sensors}"));
    assert_eq!(VectorEnv::new(&world, 1).layout(), EnvLayout::Lanes);
    compare(&world, COUNT, 60);
}

#[test]
fn every_shipped_world_has_the_bits_of_gyms() {
    for name in Scenario::shipped_names() {
        // Grids have cells instead of a plant.
        let world = Scenario::shipped(name).expect("shipped").expect("valid");
        let world = if name.starts_with("grid") {
            world
        } else {
            world.on(PlantKind::Kinematic)
        };
        compare(&world, 5, 60);
    }
}

/// Thousands of environments have to fit into the cache.
#[test]
fn an_environment_of_acc_takes_less_than_eight_kilobytes() {
    let world = kinematic("acc");
    let mut env = VectorEnv::new(&world, 128);
    let width = env.spaces().observation;
    let mut row = vec![0.0; width];
    (0..128).for_each(|i| env.begin(i, key(i, 0), &mut row));
    let (mut observations, mut rewards) = (vec![0.0; 128 * width], [0.0; 128]);
    let mut ends = [None; 128];
    for _ in 0..30 {
        env.step(&[1; 128], &mut observations, &mut rewards, &mut ends);
    }
    let bytes = env.bytes_per_environment().expect("in lanes");
    // The columns alone, so that nothing was forgotten: 23 numbers per vehicle.
    assert!((400..8000).contains(&bytes), "{bytes} bytes");
}

#[test]
#[should_panic(expected = "an action that does not exist")]
fn an_action_beyond_the_last_one_is_refused() {
    let mut env = VectorEnv::new(&kinematic("acc"), 1);
    let mut observation = vec![0.0; env.spaces().observation];
    env.begin(0, key(0, 0), &mut observation);
    env.step(&[3], &mut observation, &mut [0.0], &mut [None]);
}
