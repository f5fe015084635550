//! How fast the learners are: `cargo bench --bench learners`.
//!
//! Throughput is printed as items per second: updates, actions, decisions.

use brakecheck::rl::{
    Control, DqnSettings, End, Env, LearnerConfig, LearnerRng, LearnerSettings, PpoSettings,
    QTableSettings, Spaces, Step,
};
use brakecheck_rl::rl::adam::Adam;
use brakecheck_rl::rl::nn::{Mlp, argmax};
use brakecheck_rl::rl::replay::{Batch, ReplayBuffer, Transition};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

/// The networks of recipe R on the cruise-control scene.
const SIZES: [usize; 4] = [5, 64, 64, 3];
const BATCH: usize = 64;

fn normal(n: usize) -> Vec<f32> {
    let mut dice = LearnerRng::new(1);
    (0..n).map(|_| dice.normal() as f32).collect()
}

/// Forward, backward and Adam on a batch of 64.
#[divan::bench]
fn update(bencher: Bencher) {
    let mut net = Mlp::orthogonal(&SIZES, 0.01, &mut LearnerRng::new(1));
    let mut adam = Adam::new(net.parameters().len());
    let mut gradient = vec![0.0; net.parameters().len()];
    let mut tape = net.tape(BATCH);
    let inputs = normal(BATCH * SIZES[0]);
    bencher.counter(ItemsCount::new(1u32)).bench_local(|| {
        net.forward(&inputs, BATCH, &mut tape);
        let (values, out) = net.output_and_gradient(BATCH, &mut tape);
        for (value, out) in values.iter().zip(out) {
            *out = value / BATCH as f32;
        }
        net.backward(&inputs, BATCH, &mut tape, &mut gradient);
        adam.step(net.parameters_mut(), &gradient, 1e-5);
    });
}

/// The greedy action for one observation.
#[divan::bench]
fn act(bencher: Bencher) {
    let net = Mlp::orthogonal(&SIZES, 1.0, &mut LearnerRng::new(1));
    let inputs = normal(SIZES[0]);
    let counter = ItemsCount::new(1u32);
    bencher
        .counter(counter)
        .bench(|| net.evaluate(black_box(&inputs), argmax));
}

/// A prioritised batch of 64 out of 300000, and its new priorities.
#[divan::bench]
fn replay(bencher: Bencher) {
    let (mut dice, row) = (LearnerRng::new(1), [0.0; SIZES[0]]);
    let mut replay = ReplayBuffer::new(SIZES[0], 300_000, 0.6);
    for slot in 0..300_000 {
        let (observation, next) = (&row, &row);
        replay.push(Transition {
            observation,
            action: 0,
            reward: 0.0,
            next,
            discount: 1.0,
        });
        replay.prioritise(slot, dice.unit() as f32);
    }
    let mut batch = Batch::default();
    bencher.counter(ItemsCount::new(1u32)).bench_local(|| {
        replay.sample(BATCH, 0.4, &mut dice, &mut batch);
        batch.errors.resize(BATCH, 0.3);
        replay.prioritise_all(&mut batch.slots, &mut batch.errors);
    });
}

const DECISIONS: u64 = 20_000;

/// Deciding and learning, on an environment that costs next to nothing.
#[divan::bench(sample_count = 5)]
fn dqn_decisions(bencher: Bencher) {
    train(bencher, DqnSettings::default());
}

/// Deciding and learning, on an environment that costs next to nothing.
#[divan::bench(sample_count = 5)]
fn ppo_decisions(bencher: Bencher) {
    train(bencher, PpoSettings::default());
}

/// Deciding and learning, on an environment that costs next to nothing.
#[divan::bench(sample_count = 5)]
fn q_table_decisions(bencher: Bencher) {
    train(bencher, QTableSettings::default());
}

fn train(bencher: Bencher, settings: impl Into<LearnerSettings>) {
    let config = LearnerConfig::new(settings).expect("in range");
    let config = config.with_decisions(DECISIONS).expect("in range");
    bencher.counter(ItemsCount::new(DECISIONS)).bench(|| {
        let mut env = Drift::new();
        let mut learner = config.build(env.spaces(), 1);
        learner.train(&mut env, &mut |_| Control::Continue);
        learner.decisions()
    });
}

/// A point that is pushed left or right for 30 decisions.
struct Drift {
    spaces: Spaces,
    place: f32,
    speed: f32,
    decision: u32,
}

impl Drift {
    fn new() -> Drift {
        let spaces = Spaces {
            observation: SIZES[0],
            actions: SIZES[3],
            neutral: 1,
            parts: Vec::new(),
        };
        Drift {
            spaces,
            place: 0.0,
            speed: 0.0,
            decision: 0,
        }
    }

    fn observe(&self, obs: &mut [f32]) {
        let time = self.decision as f32 / 30.0;
        obs.copy_from_slice(&[self.place, self.speed, time, self.place * self.speed, 1.0]);
    }
}

impl Env for Drift {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        (self.place, self.speed) = ((index % 17) as f32 / 17.0, 0.0);
        self.decision = 0;
        self.observe(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.speed += 0.05 * (action as f32 - 1.0);
        self.place += 0.1 * self.speed;
        self.decision += 1;
        self.observe(obs);
        let end = (self.decision == 30).then_some(End::Terminated);
        Step {
            reward: if end.is_some() {
                0.5 - self.place.abs()
            } else {
                0.0
            },
            end,
        }
    }
}
