//! The scene `acc` written by hand, beside the test bench that reads it from a
//! file: `cargo bench --bench hand_loop` prints decisions per second of processor
//! time for 1, 64 and 4,096 environments.
//!
//! The loop does the work of a kinematic episode: two cars in 2D with the limits
//! of engine and tyres, a percept, the law of the ego behind its lag, a trace of
//! 13 finite columns, three rules and an observation. Nothing in it can be
//! changed from outside. `main` checks that both move alike before it measures.

use std::hint::black_box;

use brakecheck::rl::Env;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Gym};
use brakecheck::vector_env::VectorEnv;
use brakecheck::world::{PlantKind, Scenario};
use cpu_time::ProcessTime;

const SAMPLE_S: f64 = 0.05;
const SAMPLES: usize = 300;
const SAMPLES_PER_DECISION: usize = 10;
const LENGTH_M: f64 = 4.54;
const WIDTH_M: f64 = 1.8;
/// Distance from the front bumper to the rear axle, on which the model turns.
const FRONT_TO_REAR_AXLE_M: f64 = 3.62;
const GRIP_MPS2: f64 = 0.9 * 9.81;
const POWER_W_PER_KG: f64 = 100_000.0 / 1500.0;
const ACTIONS_MPS2: [f64; 3] = [-3.0, 0.0, 3.0];
const COLUMNS: usize = 13;
/// Column that is 1 at a contact.
const CONTACT: usize = 1;
const OBSERVED: usize = 5;
/// Runs of every batch, of which the fastest counts.
const TURNS: usize = 5;
/// Largest difference of a column between the loop and the test bench.
const TOLERANCE: f64 = 1e-9;

fn main() {
    assert_same_motion();
    // `cargo test --benches` checks the motion only.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    println!("{:>10} {:>6} {:>12}", "loop", "envs", "decisions/s");
    let world = acc(PlantKind::Kinematic);
    for envs in [1, 64, 4096] {
        let hands: Box<dyn Batch> = Box::new(Hands::new(envs));
        let gyms: Box<dyn Batch> = Box::new(Gyms::new(&world, envs));
        let vector: Box<dyn Batch> = Box::new(Vector::new(&world, envs));
        let names = ["hand", "kinematic", "vector"];
        compare(envs, &names, &mut [hands, gyms, vector]);
    }
}

/// A car on an arc, by the state of its front bumper.
#[derive(Clone, Copy, Default)]
struct Car {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    sin: f64,
    cos: f64,
    speed_mps: f64,
    accel_mps2: f64,
}

impl Car {
    fn new(x_m: f64, speed_mps: f64) -> Car {
        Car {
            x_m,
            speed_mps,
            cos: 1.0,
            ..Car::default()
        }
    }

    /// Returns the acceleration that grip and power leave of a command.
    fn limited_mps2(&self, command_mps2: f64) -> f64 {
        let wanted = command_mps2.clamp(-GRIP_MPS2, GRIP_MPS2);
        let after_mps = self.speed_mps + wanted * SAMPLE_S;
        if wanted <= 0.0 || wanted * after_mps <= POWER_W_PER_KG {
            return wanted;
        }
        let squared = self.speed_mps * self.speed_mps + 2.0 * POWER_W_PER_KG * SAMPLE_S;
        ((squared.sqrt() - self.speed_mps) / SAMPLE_S).min(wanted)
    }

    /// Moves for a sample along an arc, and stops where the speed reaches 0.
    fn advance(&mut self, command_mps2: f64, curvature_per_m: f64) {
        let mut accel_mps2 = self.limited_mps2(command_mps2);
        if self.speed_mps <= 0.0 {
            accel_mps2 = accel_mps2.max(0.0);
        }
        let mut moving_s = SAMPLE_S;
        let mut end_mps = self.speed_mps + accel_mps2 * SAMPLE_S;
        if end_mps <= 0.0 && accel_mps2 < 0.0 {
            (moving_s, end_mps) = (-self.speed_mps / accel_mps2, 0.0);
        }
        let length_m = moving_s * (self.speed_mps + 0.5 * accel_mps2 * moving_s);
        self.follow(length_m, curvature_per_m);
        self.accel_mps2 = (end_mps - self.speed_mps) / SAMPLE_S;
        self.speed_mps = end_mps;
    }

    fn follow(&mut self, length_m: f64, curvature_per_m: f64) {
        // A straight path needs no sine.
        if curvature_per_m == 0.0 {
            self.x_m += length_m * self.cos;
            self.y_m += length_m * self.sin;
            return;
        }
        let half_rad = 0.5 * curvature_per_m * length_m;
        let (middle_sin, middle_cos) = (self.heading_rad + half_rad).sin_cos();
        let (sin, cos) = (self.heading_rad + 2.0 * half_rad).sin_cos();
        // The rear axle runs along the arc, and the bumper is ahead of it.
        self.x_m += length_m * middle_cos + FRONT_TO_REAR_AXLE_M * (cos - self.cos);
        self.y_m += length_m * middle_sin + FRONT_TO_REAR_AXLE_M * (sin - self.sin);
        self.heading_rad += 2.0 * half_rad;
        (self.sin, self.cos) = (sin, cos);
    }

    /// Returns the curvature that leads back to the middle of the lane.
    ///
    /// In `acc` it stays 0: both cars begin in the middle and run straight.
    fn curvature_per_m(&self) -> f64 {
        -0.02 * self.y_m - 0.3 * self.heading_rad
    }

    fn centre_m(&self) -> (f64, f64) {
        let back_m = 0.5 * LENGTH_M;
        (self.x_m - back_m * self.cos, self.y_m - back_m * self.sin)
    }
}

/// The ego's view of itself and of the car ahead.
struct Percept {
    speed_mps: f64,
    headway_m: f64,
    lateral_m: f64,
    lead_mps: f64,
}

impl Percept {
    fn of(ego: &Car, ado: &Car) -> Percept {
        let (dx_m, dy_m) = (ado.x_m - ego.x_m, ado.y_m - ego.y_m);
        Percept {
            speed_mps: ego.speed_mps,
            headway_m: dx_m * ego.cos + dy_m * ego.sin,
            lateral_m: dy_m * ego.cos - dx_m * ego.sin,
            lead_mps: ado.speed_mps,
        }
    }

    /// Returns the command of the ego of the world `acc`.
    fn accel_mps2(&self) -> f64 {
        if self.headway_m <= 0.0 || WIDTH_M <= self.lateral_m.abs() {
            return 0.0;
        }
        let reference_m = 5.7 + 0.5 * self.speed_mps;
        let wish_mps2 =
            0.3 * (self.headway_m - reference_m) + 1.2 * (self.lead_mps - self.speed_mps);
        wish_mps2.clamp(-6.0, 2.5)
    }
}

/// The end of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Success,
    RuleViolation,
    Held,
}

/// One environment of the scene.
struct HandLoop {
    ego: Car,
    ado: Car,
    lagged_mps2: f64,
    decay: f64,
    least_headway_m: f64,
    trace: Vec<[f64; COLUMNS]>,
    end: Option<End>,
    seed: u64,
}

impl HandLoop {
    fn new(seed: u64) -> HandLoop {
        let mut made = HandLoop {
            ego: Car::default(),
            ado: Car::default(),
            lagged_mps2: 0.0,
            decay: (-SAMPLE_S / 0.4).exp(),
            least_headway_m: f64::INFINITY,
            trace: Vec::with_capacity(SAMPLES + 1),
            end: None,
            seed,
        };
        made.reset();
        made
    }

    /// Draws a value by splitmix64.
    fn draw(&mut self, least: f64, most: f64) -> f64 {
        self.seed = self.seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.seed ^ (self.seed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        let share = ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
        least + (most - least) * share
    }

    fn reset(&mut self) {
        let ego_mps = self.draw(5.0, 25.0);
        let headway_m = self.draw(8.0, 60.0);
        let ado_mps = self.draw(5.0, 25.0);
        self.begin(ego_mps, headway_m, ado_mps);
    }

    fn begin(&mut self, ego_mps: f64, headway_m: f64, ado_mps: f64) {
        self.ego = Car::new(0.0, ego_mps);
        self.ado = Car::new(headway_m, ado_mps);
        self.lagged_mps2 = 0.0;
        self.least_headway_m = f64::INFINITY;
        self.trace.clear();
        self.end = None;
        self.record(false);
    }

    fn time_left_s(&self) -> f64 {
        (SAMPLES + 1 - self.trace.len()) as f64 * SAMPLE_S
    }

    fn touches(&self) -> bool {
        let ((ax, ay), (bx, by)) = (self.ego.centre_m(), self.ado.centre_m());
        let (dx_m, dy_m) = ((ax - bx).abs(), (ay - by).abs());
        dx_m < LENGTH_M && dy_m < WIDTH_M
    }

    /// Appends a row to the trace and judges it.
    fn record(&mut self, contact: bool) {
        let (ego, ado) = (&self.ego, &self.ado);
        let headway_m = ado.x_m - ego.x_m;
        let time_left_s = self.time_left_s() - SAMPLE_S;
        let row = [
            time_left_s,
            f64::from(u8::from(contact)),
            ego.x_m,
            ego.y_m,
            ego.heading_rad,
            ego.speed_mps,
            ego.accel_mps2,
            ado.x_m,
            ado.y_m,
            ado.heading_rad,
            ado.speed_mps,
            ado.accel_mps2,
            headway_m,
        ];
        assert!(row.iter().all(|value| value.is_finite()), "{row:?}");
        self.trace.push(row);
        self.least_headway_m = self.least_headway_m.min(headway_m);
        self.end = if headway_m < 4.7 {
            Some(End::Success)
        } else if ado.speed_mps < 0.1 || 30.0 < ado.speed_mps {
            Some(End::RuleViolation)
        } else if self.trace.len() == SAMPLES + 1 {
            Some(End::Held)
        } else {
            None
        };
    }

    /// Takes a decision, and returns the reward and whether the episode ended.
    fn step(&mut self, action: usize, obs: &mut [f32]) -> (f32, bool) {
        for _ in 0..SAMPLES_PER_DECISION {
            let wish_mps2 = Percept::of(&self.ego, &self.ado).accel_mps2();
            self.lagged_mps2 = wish_mps2 + (self.lagged_mps2 - wish_mps2) * self.decay;
            let (ego_per_m, ado_per_m) = (self.ego.curvature_per_m(), self.ado.curvature_per_m());
            self.ego.advance(self.lagged_mps2, ego_per_m);
            self.ado.advance(ACTIONS_MPS2[action], ado_per_m);
            self.record(self.touches());
            if self.end.is_some() {
                break;
            }
        }
        self.observe(obs);
        (self.reward(), self.end.is_some())
    }

    fn reward(&self) -> f32 {
        let by_m = 4.7 - self.least_headway_m;
        let reward = match self.end {
            None => 0.0,
            Some(End::RuleViolation) => -1.0,
            Some(End::Success) => 0.5 + 0.5 * (by_m / 10.0).tanh(),
            Some(End::Held) => -0.5 + 0.5 * (by_m / 10.0).tanh(),
        };
        reward as f32
    }

    /// Writes the five observed signals, each scaled to −1 to 1.
    fn observe(&self, obs: &mut [f32]) {
        let scaled = |value: f64, least: f64, most: f64| {
            (2.0 * (value - least) / (most - least) - 1.0) as f32
        };
        obs[0] = scaled(self.ado.x_m - self.ego.x_m, 0.0, 100.0);
        obs[1] = scaled(self.ego.speed_mps, 0.0, 30.0);
        obs[2] = scaled(self.ado.speed_mps, 0.0, 30.0);
        obs[3] = scaled(self.ego.accel_mps2, -5.0, 5.0);
        obs[4] = scaled(self.time_left_s() - SAMPLE_S, 0.0, 15.0);
    }
}

fn acc(plant: PlantKind) -> Scenario {
    let text = include_str!("../worlds/acc.ron");
    Scenario::parse("acc.ron", text).expect("shipped").on(plant)
}

/// Plays the same starts and actions on both, and compares every column.
fn assert_same_motion() {
    let mut bench = acc(PlantKind::Kinematic).bench();
    let mut hand = HandLoop::new(0);
    let mut obs = [0.0; OBSERVED];
    let mut ends = Vec::new();
    for episode in 0..64 {
        let start = [(); 3].map(|()| hand.draw(0.0, 1.0));
        let (ego_mps, ado_mps) = (5.0 + 20.0 * start[0], 5.0 + 20.0 * start[2]);
        let headway_m = 8.0 + 52.0 * start[1];
        hand.begin(ego_mps, headway_m, ado_mps);
        let start = Start(vec![ego_mps, headway_m, ado_mps]);
        bench.begin(&start, 0, Aftermath::Skip);
        for action in actions(episode) {
            let (_, over) = hand.step(action, &mut obs);
            bench.decide(action);
            assert_eq!(over, bench.is_done(), "episode {episode}");
            if over {
                break;
            }
        }
        ends.extend(hand.end);
        assert_eq!(bench.trace().len(), hand.trace.len());
        for column in 0..COLUMNS {
            let ours = bench.trace().column(column);
            for (ours, row) in ours.iter().zip(&hand.trace) {
                // The test bench stops at the contact, the loop at the next sample.
                if row[CONTACT] == 1.0 && column != CONTACT {
                    continue;
                }
                let apart = (ours - row[column]).abs();
                assert!(apart < TOLERANCE, "column {column}: {ours}, {row:?}");
            }
        }
    }
    // Otherwise a branch was never compared.
    for end in [End::Success, End::RuleViolation, End::Held] {
        assert!(ends.contains(&end), "no episode ended in {end:?}");
    }
}

/// Actions of an episode, held for two decisions each.
fn actions(episode: u64) -> impl Iterator<Item = usize> {
    let mut hand = HandLoop::new(episode.wrapping_mul(977));
    let mut held = 0;
    (0..SAMPLES / SAMPLES_PER_DECISION).map(move |decision| {
        if decision % 2 == 0 {
            held = hand.draw(0.0, 3.0) as usize % 3;
        }
        held
    })
}

/// Environments that are stepped together, once each per call.
trait Batch {
    fn step(&mut self, actions: &[usize]);
}

/// Environments of the loop, with their observations.
struct Hands {
    all: Vec<HandLoop>,
    obs: Vec<f32>,
}

impl Hands {
    fn new(envs: usize) -> Hands {
        Hands {
            all: (0..envs as u64).map(HandLoop::new).collect(),
            obs: vec![0.0; OBSERVED * envs],
        }
    }
}

impl Batch for Hands {
    fn step(&mut self, actions: &[usize]) {
        let obs = self.obs.chunks_mut(OBSERVED);
        for ((env, obs), &action) in self.all.iter_mut().zip(obs).zip(actions) {
            if black_box(env.step(action, obs)).1 {
                env.reset();
            }
        }
    }
}

/// Test benches as a learner steps them, each with the number of its episode.
struct Gyms {
    all: Vec<(Gym, u64)>,
    obs: Vec<f32>,
}

impl Gyms {
    fn new(world: &Scenario, envs: usize) -> Gyms {
        let gym = |seed| (Gym::new(world.bench(), Purpose::Train, seed), 0);
        let mut made = Gyms {
            all: (0..envs as u64).map(gym).collect(),
            obs: vec![0.0; OBSERVED * envs],
        };
        let obs = made.obs.chunks_mut(OBSERVED);
        for ((gym, episode), obs) in made.all.iter_mut().zip(obs) {
            gym.reset(*episode, obs);
        }
        made
    }
}

impl Batch for Gyms {
    fn step(&mut self, actions: &[usize]) {
        let obs = self.obs.chunks_mut(OBSERVED);
        for (((gym, episode), obs), &action) in self.all.iter_mut().zip(obs).zip(actions) {
            if black_box(gym.step(action, obs)).end.is_some() {
                *episode += 1;
                gym.reset(*episode, obs);
            }
        }
    }
}

/// The same environments, stepped together.
struct Vector {
    env: VectorEnv,
    observations: Vec<f32>,
    rewards: Vec<f64>,
    ends: Vec<Option<brakecheck::rl::End>>,
    episodes: Vec<u64>,
}

impl Vector {
    fn new(world: &Scenario, envs: usize) -> Vector {
        let mut made = Vector {
            env: VectorEnv::new(world, envs),
            observations: vec![0.0; OBSERVED * envs],
            rewards: vec![0.0; envs],
            ends: vec![None; envs],
            episodes: vec![0; envs],
        };
        (0..envs).for_each(|at| made.reset(at));
        made
    }

    fn reset(&mut self, at: usize) {
        let key = StartKey {
            purpose: Purpose::Train,
            seed: at as u64,
            index: self.episodes[at],
        };
        let observation = &mut self.observations[OBSERVED * at..][..OBSERVED];
        self.env.begin(at, key, observation);
    }
}

impl Batch for Vector {
    fn step(&mut self, actions: &[usize]) {
        self.env.step(
            actions,
            &mut self.observations,
            &mut self.rewards,
            &mut self.ends,
        );
        for at in 0..self.ends.len() {
            if black_box(self.ends[at]).is_some() {
                self.episodes[at] += 1;
                self.reset(at);
            }
        }
    }
}

/// Steps a batch for a number of decisions, and returns the processor time.
fn seconds(batch: &mut dyn Batch, envs: usize, decisions: usize) -> f64 {
    let mut hand = HandLoop::new(1);
    let mut draw = |_| hand.draw(0.0, 3.0) as usize % 3;
    let schedule: Vec<Vec<usize>> = (0..64)
        .map(|_| (0..envs).map(&mut draw).collect())
        .collect();
    let begun = ProcessTime::now();
    for step in 0..decisions / envs {
        batch.step(&schedule[step % schedule.len()]);
    }
    begun.elapsed().as_secs_f64()
}

/// Prints the decisions per second of processor time of every batch.
///
/// The batches take turns, so that a slow moment of the machine meets all of them.
fn compare(envs: usize, names: &[&str], batches: &mut [Box<dyn Batch>]) {
    const DECISIONS: usize = 1 << 16;
    // Episodes begin together. After some decisions their ends are spread out.
    for batch in batches.iter_mut() {
        seconds(&mut **batch, envs, 40 * envs);
    }
    let mut least_s = vec![f64::INFINITY; batches.len()];
    for _ in 0..TURNS {
        for (batch, least_s) in batches.iter_mut().zip(&mut least_s) {
            *least_s = least_s.min(seconds(&mut **batch, envs, DECISIONS));
        }
    }
    for (name, least_s) in names.iter().zip(least_s) {
        println!("{name:>10} {envs:>6} {:>12.0}", DECISIONS as f64 / least_s);
    }
}
