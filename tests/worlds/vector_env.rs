//! Environments stepped together: the bits of one by one, in every world.

use std::sync::Arc;

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::rl::{End, Env};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::Scratch;
use brakecheck::testbench::{FaultLog, Gym};
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

/// Number of ended episodes, successes, fouls, contacts and faults.
#[derive(Default)]
struct Seen {
    episodes: u32,
    faults: u32,
    /// Episodes that the first sample after the start decides.
    at_once: u32,
    successes: u32,
    fouls: u32,
    contacts: u32,
}

/// Plays random actions in `count` environments and in as many gyms.
fn compare(world: &Scenario, count: usize, steps: usize) -> Seen {
    let mut env = VectorEnv::new(world, count);
    let (width, actions) = (env.spaces().observation, env.spaces().actions);
    let gym = |i: usize| {
        let mut gym = Gym::new(world.bench(), Purpose::Train, i as u64);
        // Faults are compared too, so no gym gives up.
        gym.tell_faults(FaultLog::allowing(1.0));
        gym
    };
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
                assert!(env.robustness(i).is_nan(), "{context}");
                continue;
            };
            seen.episodes += 1;
            seen.successes += u32::from(verdict.is_success());
            seen.fouls += u32::from(verdict.is_foul());
            seen.contacts += u32::from(bench.contact().is_some());
            seen.at_once += u32::from(bench.trace().len() <= 2);
            if bench.fault().is_none() {
                let spec = &bench.rulebook().spec;
                let rho = spec.robustness(bench.trace(), &mut scratch);
                assert_eq!(env.robustness(i).to_bits(), rho.to_bits(), "{context}");
            } else {
                seen.faults += 1;
                assert!(env.robustness(i).is_nan(), "{context}");
            }
            let (key, actions) = env.played(i).expect("an episode");
            assert_eq!(key, self::key(i, next[i] - 1), "{context}");
            assert_eq!(actions.last(), Some(&(held[i] as u32)), "{context}");
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
    assert!(seen.successes > 0 && seen.fouls > 0, "{}", seen.successes);
    // Without a headway to keep, episodes end in contacts.
    let crash = changed("acc", "\"d_safe\": 4.7", "\"d_safe\": -90.0");
    let seen = compare(&crash, COUNT, 120);
    assert!(seen.contacts > 0);
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

/// Two lanes that are narrower than usual, and an ego that measures from its lane's middle.
const BRIEFED: &str = r#"
Scenario(name: "briefed", question: "Does the ego yield to a car beside its narrow lane?",
    clock: (horizon_s: 8.0, decision_s: 0.25, sample_s: 0.05, substeps: 4), plant: Kinematic,
    road: Straight(lanes: 2, lane_width_m: 3.1, friction: 0.9),
    agents: [
        Vehicle(name: "ego", body: "sedan", lane: 0, start: At(x_m: 0.0, speed_mps: (15.0, 25.0)), drive: Ego(CcLaneDriver())),
        Vehicle(name: "ado", body: "sedan", lane: 1, start: Ahead(of: "ego", headway_m: (10.0, 30.0), speed_mps: (10.0, 20.0)),
            drive: Ado(
                actions: Grid(accelerations: [-4.0, 0.0, 2.0], lateral: [Hold, Right], lateral_mps: 1.5, lateral_lag_s: 0.3),
                neutral: 1,
                rulebook: [Rule(name: "does not stop on the road", stl: "always (ado.speed >= 1)")]))],
    ego_spec: "always (ego.ado.gap >= 0.2)")
"#;

/// The width of its lane is in its briefing.
#[test]
fn an_ego_that_needs_its_briefing_has_the_bits_of_gyms() {
    let world = Scenario::parse("briefed.ron", BRIEFED).expect("a world");
    assert_eq!(VectorEnv::new(&world, 1).layout(), EnvLayout::Lanes);
    let seen = compare(&world, COUNT, 80);
    assert!(seen.episodes > 0);
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

#[test]
#[should_panic(expected = "one entry per environment")]
fn a_missing_reward_is_refused() {
    let mut env = VectorEnv::new(&kinematic("acc"), 2);
    let mut observations = vec![0.0; 2 * env.spaces().observation];
    env.step(&[0; 2], &mut observations, &mut [0.0], &mut [None; 2]);
}

#[test]
#[should_panic(expected = "one entry per environment")]
fn a_missing_observation_is_refused() {
    let mut env = VectorEnv::new(&kinematic("acc"), 2);
    let mut observations = vec![0.0; env.spaces().observation];
    env.step(&[0; 2], &mut observations, &mut [0.0; 2], &mut [None; 2]);
}

#[test]
#[should_panic(expected = "one entry per environment")]
fn a_surplus_action_is_refused() {
    let mut env = VectorEnv::new(&kinematic("acc"), 2);
    let mut observations = vec![0.0; 2 * env.spaces().observation];
    env.step(&[0; 3], &mut observations, &mut [0.0; 2], &mut [None; 2]);
}

/// A lane and a bench each, on the same world.
fn both_layouts() -> [VectorEnv; 2] {
    let world = kinematic("acc");
    let rigid = Scenario::shipped("acc").expect("shipped").expect("valid");
    let all = [world, rigid].map(|world| VectorEnv::new(&world, 3));
    assert_eq!(all[0].layout(), EnvLayout::Lanes);
    assert_eq!(all[1].layout(), EnvLayout::Benches);
    all
}

#[test]
fn an_environment_that_has_not_begun_has_no_episode() {
    for mut env in both_layouts() {
        assert_eq!((env.len(), env.is_empty()), (3, false));
        let world = kinematic("acc");
        let mut bench = world.bench();
        let width = env.spaces().observation;
        env.begin(1, key(1, 0), &mut vec![0.0; width]);
        for at in [0, 2] {
            assert!(env.is_over(at) && env.verdict(at).is_none());
            assert!(env.played(at).is_none() && env.robustness(at).is_nan());
            assert!(!env.play_again(at, &mut bench));
        }
        assert!(!env.is_over(1) && env.robustness(1).is_nan());
        assert_eq!(env.played(1), Some((key(1, 0), &[][..])));
        // Only the environment that has begun moves on.
        let mut observations = vec![7.0; 3 * width];
        let (mut rewards, mut ends) = ([7.0; 3], [Some(End::Aborted); 3]);
        env.step(&[1; 3], &mut observations, &mut rewards, &mut ends);
        assert_eq!((rewards, ends), ([0.0; 3], [None; 3]));
        let untouched = |at: usize| {
            observations[at * width..][..width]
                .iter()
                .all(|it| *it == 7.0)
        };
        assert_eq!([0, 1, 2].map(untouched), [true, false, true]);
    }
    assert!(VectorEnv::new(&kinematic("acc"), 0).is_empty());
}

#[test]
fn an_environment_whose_episode_is_over_stands_still() {
    for mut env in both_layouts() {
        let width = env.spaces().observation;
        let mut observations = vec![0.0; 3 * width];
        for (at, row) in observations.chunks_mut(width).enumerate() {
            env.begin(at, key(at, 0), row);
        }
        let (mut rewards, mut ends) = ([0.0; 3], [None; 3]);
        // The lead car of environment 1 brakes to a standstill, which its rule forbids.
        while ends[1].is_none() {
            env.step(&[1, 0, 1], &mut observations, &mut rewards, &mut ends);
        }
        assert!(rewards[1] <= -1.0 && ends[1] == Some(End::Terminated));
        let before = observations[width..2 * width].to_vec();
        let state = |env: &VectorEnv| {
            let played = env.played(1).map(|(key, actions)| (key, actions.to_vec()));
            (env.verdict(1), env.robustness(1).to_bits(), played)
        };
        let over = state(&env);
        env.step(&[1, 2, 1], &mut observations, &mut rewards, &mut ends);
        assert_eq!((rewards[1], ends[1]), (0.0, None));
        assert_same_bits(&observations[width..2 * width], &before, "over");
        assert_eq!(state(&env), over);
        assert!(env.is_over(1) && !env.is_over(0));
        // A new episode forgets the old one.
        env.begin(1, key(1, 1), &mut observations[width..2 * width]);
        assert!(env.verdict(1).is_none() && env.robustness(1).is_nan());
        assert_eq!(env.played(1), Some((key(1, 1), &[][..])));
    }
}

/// A car commands 20 m/s² at most, so a greater command is a fault.
#[test]
fn a_command_that_no_car_could_follow_aborts_as_in_gyms() {
    let strong = changed("acc", "max_accel_mps2: 2.5", "max_accel_mps2: 30.0");
    assert_eq!(VectorEnv::new(&strong, 1).layout(), EnvLayout::Lanes);
    for (world, count) in [(&strong, COUNT), (&strong.on(PlantKind::Rigid), 8)] {
        let seen = compare(world, count, 60);
        assert!(
            seen.faults > 0 && seen.faults < seen.episodes,
            "{}",
            seen.faults
        );
    }
}

#[test]
fn a_signal_that_is_no_number_aborts_as_in_gyms() {
    // No start is below 8 m. The root has no value below 7 m, which is a fault.
    let headway = "\"headway\": \"ado.x - ego.x\"";
    let root = format!("{headway}, \"root\": \"sqrt(headway - 7)\"");
    let world = changed("acc", headway, &root);
    assert_eq!(VectorEnv::new(&world, 1).layout(), EnvLayout::Lanes);
    let seen = compare(&world, COUNT, 60);
    assert!(
        seen.faults > 0 && seen.faults < seen.episodes,
        "{}",
        seen.faults
    );
}

#[test]
fn an_episode_that_its_first_sample_decides_has_the_bits_of_gyms() {
    // The specification holds at the start, and never at the first sample after it.
    let late = "always[0, T] ((time_left >= T - 0.01) or (headway >= 1000))";
    let lanes = changed("acc", "always[0, T] (headway >= d_safe)", late);
    for (world, count) in [(&lanes, COUNT), (&lanes.on(PlantKind::Rigid), 8)] {
        let seen = compare(world, count, 60);
        assert!(seen.at_once > 0);
        assert_eq!(seen.at_once, seen.episodes);
    }
}

/// A contact ends an episode and is no part of the next one.
#[test]
fn a_contact_is_forgotten_when_an_episode_begins() {
    let crash = changed(
        "acc",
        "always[0, T] (headway >= d_safe)",
        "always[0, T] (not contact)",
    )
    .text()
    .replacen("\"time_left\"]", "\"time_left\", \"contact\"]", 1);
    let crash = Scenario::parse("crash.ron", &crash)
        .expect("a world")
        .on(PlantKind::Kinematic);
    assert_eq!(VectorEnv::new(&crash, 1).layout(), EnvLayout::Lanes);
    let seen = compare(&crash, COUNT, 120);
    assert!(COUNT as u32 / 4 < seen.contacts, "{}", seen.contacts);
}

/// Every quantity that changes besides the vehicles needs a bench.
#[test]
fn worlds_with_anything_but_vehicles_play_on_benches() {
    let judge = "judge: UntilViolation,";
    let with = |field: &str| format!("{judge}\n    {field}");
    let road = "friction: 0.9)";
    let changes = [
        (judge, "judge: UntilContact,".to_owned()),
        (
            judge,
            "judge: UntilContact,\n    counts: Contact(closing_mps: 1.0),".to_owned(),
        ),
        (judge, with("grades: [(0.0, 0.0), (200.0, -0.06)],")),
        (judge, with("wind: (speed_mps: 8.0, from_rad: 1.57),")),
        (judge, with("natural: (per_1000_km: 3.0),")),
        (road, "friction: (0.5, 0.9))".to_owned()),
    ];
    for (from, to) in changes {
        let world = changed("acc", from, &to);
        let env = VectorEnv::new(&world, 1);
        assert_eq!(env.layout(), EnvLayout::Benches, "{to}");
        assert_eq!(env.bytes_per_environment(), None, "{to}");
        compare(&world, 3, 40);
    }
    let own = Arc::new(|| Box::new(Standing) as Box<dyn Controller>);
    let own = kinematic("acc").with_ego("standing", own);
    assert_eq!(VectorEnv::new(&own, 1).layout(), EnvLayout::Benches);
}

/// An ego of the user's own, which may depend on anything.
#[derive(Clone)]
struct Standing;

impl Controller for Standing {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::accelerate(-1.0))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

/// Sensors with noise take more, and a group of one costs what a full one shares.
#[test]
fn the_memory_of_an_environment_counts_its_parts() {
    let bytes = |world: &Scenario, count| {
        let env = VectorEnv::new(world, count);
        env.bytes_per_environment().expect("in lanes")
    };
    let acc = kinematic("acc");
    let (one, many) = (bytes(&acc, 1), bytes(&acc, 64));
    // 64 environments share the columns of one decision, the scene and the percept.
    assert!(many < one, "{many} of {one}");
    assert_eq!(many, bytes(&acc, 128));
    // 46 numbers of the vehicles, and the actions of 30 decisions.
    assert!(8 * 46 + 4 * 30 < many, "{many}");
    let judge = "judge: UntilViolation,";
    let late = format!("{judge}\n    sensors: (delay_s: 0.2),");
    let late = bytes(&changed("acc", judge, &late), 64);
    assert!(many < late, "{late}");
    let longer = bytes(&changed("acc", "horizon_s: 15.0", "horizon_s: 30.0"), 64);
    // Thirty more actions of four bytes.
    assert!(many + 120 <= longer, "{longer}");
}
