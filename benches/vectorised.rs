//! Decisions of many environments in one call: `cargo bench --bench vectorised`.
//!
//! Every line is one step of all environments with random actions, in which ended
//! episodes begin anew, and counts decisions. `one_by_one` is the same with a gym for
//! each environment, and `alone` is a single gym.

use brakecheck::rl::{End, Env};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::Gym;
use brakecheck::vector_env::VectorEnv;
use brakecheck::world::{PlantKind, Scenario};
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    divan::main();
}

const WORLDS: [&str; 4] = ["acc", "merge", "sandwich", "cut_in"];

fn shipped(name: &str, plant: PlantKind) -> Scenario {
    let world = Scenario::shipped(name).expect("shipped").expect("valid");
    world.on(plant)
}

/// Random numbers that cost nothing beside a step (Marsaglia's xorshift).
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 20) as usize % sides
    }
}

/// A vector of environments with the buffers of its steps.
struct Vectorised {
    env: VectorEnv,
    observations: Vec<f32>,
    rewards: Vec<f64>,
    ends: Vec<Option<End>>,
    actions: Vec<usize>,
    next: Vec<u64>,
    dice: Dice,
}

impl Vectorised {
    fn new(world: &Scenario, count: usize) -> Vectorised {
        let env = VectorEnv::new(world, count);
        let mut it = Vectorised {
            observations: vec![0.0; count * env.spaces().observation],
            rewards: vec![0.0; count],
            ends: vec![None; count],
            actions: vec![0; count],
            next: vec![0; count],
            dice: Dice(88_172_645_463_325_252),
            env,
        };
        (0..count).for_each(|at| it.begin(at));
        it
    }

    fn begin(&mut self, at: usize) {
        let width = self.env.spaces().observation;
        let key = StartKey {
            purpose: Purpose::Train,
            seed: at as u64,
            index: self.next[at],
        };
        self.next[at] += 1;
        let row = &mut self.observations[at * width..][..width];
        self.env.begin(at, key, row);
    }

    fn step(&mut self) {
        let sides = self.env.spaces().actions;
        for action in &mut self.actions {
            *action = self.dice.roll(sides);
        }
        self.env.step(
            &self.actions,
            &mut self.observations,
            &mut self.rewards,
            &mut self.ends,
        );
        for at in 0..self.ends.len() {
            if self.ends[at].is_some() {
                self.begin(at);
            }
        }
    }
}

fn vectorised(bencher: Bencher, world: &Scenario, count: usize) {
    let mut env = Vectorised::new(world, count);
    // Episodes have then begun at different times.
    (0..60).for_each(|_| env.step());
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| env.step());
}

/// The world of the bar.
#[divan::bench(args = [64, 4096])]
fn acc(bencher: Bencher, count: usize) {
    vectorised(bencher, &shipped("acc", PlantKind::Kinematic), count);
}

/// Other worlds, 4096 environments each.
#[divan::bench(args = WORLDS)]
fn worlds(bencher: Bencher, world: &str) {
    vectorised(bencher, &shipped(world, PlantKind::Kinematic), 4096);
}

/// Gyms, one after the other.
struct Gyms {
    gyms: Vec<Gym>,
    next: Vec<u64>,
    observation: Vec<f32>,
    dice: Dice,
}

impl Gyms {
    fn step(&mut self) {
        for (gym, next) in self.gyms.iter_mut().zip(&mut self.next) {
            let action = self.dice.roll(gym.spaces().actions);
            if gym.step(action, &mut self.observation).end.is_some() {
                *next += 1;
                gym.reset(*next, &mut self.observation);
            }
        }
    }
}

fn gyms(bencher: Bencher, plant: PlantKind, count: usize) {
    let world = shipped("acc", plant);
    let gym = |seed: usize| Gym::new(world.bench(), Purpose::Train, seed as u64);
    let mut gyms = Gyms {
        gyms: (0..count).map(gym).collect(),
        next: vec![0; count],
        observation: vec![0.0; world.world().spaces().observation],
        dice: Dice(88_172_645_463_325_252),
    };
    for gym in &mut gyms.gyms {
        gym.reset(0, &mut gyms.observation);
    }
    (0..60).for_each(|_| gyms.step());
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| gyms.step());
}

/// As many gyms of `acc`.
#[divan::bench(args = [64, 4096])]
fn one_by_one(bencher: Bencher, count: usize) {
    gyms(bencher, PlantKind::Kinematic, count);
}

/// A single gym of `acc`.
#[divan::bench]
fn alone(bencher: Bencher) {
    gyms(bencher, PlantKind::Kinematic, 1);
}

/// 64 environments of `acc` on the rigid plant.
#[divan::bench]
fn rigid_together(bencher: Bencher) {
    vectorised(bencher, &shipped("acc", PlantKind::Rigid), 64);
}

/// A single gym of `acc` on the rigid plant.
#[divan::bench]
fn rigid_alone(bencher: Bencher) {
    gyms(bencher, PlantKind::Rigid, 1);
}
