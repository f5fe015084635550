//! Policies and checkpoints: refused, or a pure choice among the actions.

use std::sync::Arc;

use brakecheck::rl::{
    Bins, DqnSettings, End, Env, LearnerConfig, LearnerSettings, Policy, PpoSettings,
    QTableSettings, Spaces, Step, TensorFile,
};
use brakecheck_rl::rl::list::{load_policy, load_policy_for};
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::corpus::Source;
use super::harness::{Bytes, Seen, Target};
use super::mutate::{Mutant, mutants};

/// A walk of few steps; what is observed is where it is and how long it was.
struct Walk {
    spaces: Spaces,
    place: usize,
    left: usize,
}

impl Walk {
    fn new() -> Walk {
        Walk {
            spaces: Spaces {
                observation: 2,
                actions: 3,
                neutral: 1,
                parts: Vec::new(),
            },
            place: 0,
            left: 0,
        }
    }

    fn observe(&self, obs: &mut [f32]) {
        obs.copy_from_slice(&[self.place as f32 / 4.0 - 1.0, self.left as f32 / 8.0]);
    }
}

impl Env for Walk {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        (self.place, self.left) = (1 + (index % 5) as usize, 8);
        self.observe(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.place = (self.place + action).saturating_sub(1).min(8);
        self.left -= 1;
        self.observe(obs);
        let over = self.left == 0 || self.place == 0 || self.place == 8;
        Step {
            reward: if self.place == 8 { 1.0 } else { -0.1 },
            end: over.then_some(End::Terminated),
        }
    }
}

fn learners() -> Vec<(&'static str, LearnerConfig)> {
    let dqn = DqnSettings {
        decisions: 64,
        hidden: vec![4],
        batch: 4,
        learning_starts: 8,
        capacity: Some(32),
        ..DqnSettings::default()
    };
    let ppo = PpoSettings {
        decisions: 64,
        hidden: vec![4],
        ..PpoSettings::default()
    };
    let bins = Bins {
        low: -1.0,
        high: 1.0,
        count: 6,
    };
    let table = QTableSettings {
        decisions: 64,
        bins: vec![bins],
        ..QTableSettings::default()
    };
    let checked = |settings: LearnerSettings| LearnerConfig::new(settings).expect("in range");
    vec![
        ("dqn", checked(dqn.into())),
        ("ppo", checked(ppo.into())),
        ("q table", checked(table.into())),
    ]
}

/// A safetensors file: its header as a text, and its data.
#[derive(Clone)]
struct Good {
    header: Source,
    data: Vec<u8>,
}

fn goods(checkpoints: bool) -> Vec<Good> {
    let mut goods = Vec::new();
    for (name, config) in learners() {
        let mut learner = config.build(Walk::new().spaces(), 3);
        let mut walk = Walk::new();
        while learner.decisions() < 40 {
            learner.episode(&mut walk);
        }
        let bundle = if checkpoints {
            learner.checkpoint()
        } else {
            learner.policy_bundle()
        };
        let bytes = bundle.to_bytes().expect("bytes");
        let (length, rest) = bytes.split_at(8);
        let length = u64::from_le_bytes(length.try_into().expect("eight")) as usize;
        let header = String::from_utf8(rest[..length].to_vec()).expect("JSON");
        goods.push(Good {
            header: Source::new(name, header),
            data: rest[length..].to_vec(),
        });
    }
    goods
}

/// One change of the bytes.
#[derive(Clone, Debug)]
enum Damage {
    None,
    Flip(Index, u8),
    Truncate(Index),
    Append(usize),
    /// Four bytes of the data become this number.
    Weight(Index, f32),
    /// Eight bytes of the data become this number.
    Counter(Index, u64),
    /// The length of the header is another one.
    Length(u64),
}

fn damage() -> impl Strategy<Value = Damage> {
    let weights = [
        f32::NAN,
        f32::INFINITY,
        -f32::INFINITY,
        f32::MAX,
        f32::MIN,
        1e20,
        -0.0,
        1e-40,
        0.0,
    ];
    let counters = [
        0,
        1,
        u64::MAX,
        1 << 63,
        1 << 32,
        f64::NAN.to_bits(),
        1e308f64.to_bits(),
    ];
    prop_oneof![
        3 => Just(Damage::None),
        2 => (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Flip(at, byte)),
        1 => any::<Index>().prop_map(Damage::Truncate),
        1 => (1..20usize).prop_map(Damage::Append),
        4 => (any::<Index>(), select(weights.to_vec())).prop_map(|(at, w)| Damage::Weight(at, w)),
        2 => (any::<Index>(), select(counters.to_vec())).prop_map(|(at, n)| Damage::Counter(at, n)),
        1 => select(vec![0, 7, 1 << 20, 1 << 40, u64::MAX]).prop_map(Damage::Length),
    ]
}

fn number<const N: usize>(bytes: &mut [u8], from: usize, at: &Index, number: [u8; N]) {
    let places = bytes.len().saturating_sub(from) / N;
    if places > 0 {
        let start = from + N * at.index(places);
        bytes[start..start + N].copy_from_slice(&number);
    }
}

impl Damage {
    /// The file with this header, damaged.
    fn of(&self, header: &str, data: &[u8]) -> Vec<u8> {
        let length = match self {
            Damage::Length(length) => *length,
            _ => header.len() as u64,
        };
        let mut bytes = [&length.to_le_bytes(), header.as_bytes(), data].concat();
        let begin = 8 + header.len();
        match self {
            Damage::None | Damage::Length(_) => {}
            Damage::Flip(at, byte) => {
                let at = at.index(bytes.len());
                bytes[at] ^= byte;
            }
            Damage::Truncate(at) => bytes.truncate(at.index(bytes.len())),
            Damage::Append(more) => bytes.extend(std::iter::repeat_n(7, *more)),
            Damage::Weight(at, weight) => number(&mut bytes, begin, at, weight.to_le_bytes()),
            Damage::Counter(at, counter) => number(&mut bytes, begin, at, counter.to_le_bytes()),
        }
        bytes
    }
}

/// Files with a damaged header, damaged data, or both.
fn files(goods: Vec<Good>) -> impl Strategy<Value = (Option<Mutant>, Damage, Bytes)> {
    let headers: Arc<[Source]> = goods.iter().map(|good| good.header.clone()).collect();
    let whole = any::<Index>();
    let goods: Arc<[Good]> = goods.into();
    let damaged = goods.clone();
    prop_oneof![
        3 => (mutants(headers), damage()).prop_map(move |(mutant, damage)| {
            let good = goods.iter().find(|good| mutant.is_of(&good.header));
            let bytes = damage.of(&mutant.text, good.map_or(&[], |good| &good.data));
            (Some(mutant), damage, Bytes(bytes))
        }),
        4 => (whole, damage()).prop_map(move |(which, damage)| {
            let good = which.get(&damaged);
            let bytes = damage.of(&good.header.text, &good.data);
            (None, damage, Bytes(bytes))
        }),
    ]
}

/// Every byte string is a bundle of finite numbers, or refused.
fn read(bytes: &[u8]) -> Option<TensorFile> {
    let bundle = match TensorFile::from_bytes(bytes) {
        Ok(bundle) => bundle,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return None;
        }
    };
    let header = String::from_utf8_lossy(&bytes[8..]);
    for name in bundle.names() {
        let given = header.matches(&format!("\"{name}\":{{")).count();
        assert!(given <= 1, "{name} is given {given} times");
        let shape = bundle.shape(name).expect("named").to_vec();
        let reals = bundle.get::<f32>(name, &shape).unwrap_or(&[]);
        assert!(reals.iter().all(|value| value.is_finite()), "{name}");
        let reals = bundle.get::<f64>(name, &shape).unwrap_or(&[]);
        assert!(reals.iter().all(|value| value.is_finite()), "{name}");
    }
    let again = bundle.to_bytes().expect("bytes");
    assert_eq!(TensorFile::from_bytes(&again).as_ref(), Ok(&bundle));
    Some(bundle)
}

/// Whatever it sees, it chooses among its actions, and the same again.
fn acts(policy: &dyn Policy, spaces: &Spaces) {
    let odd = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.3,
        1e-30,
        1e6,
        -1e6,
        f32::MAX,
        f32::MIN,
    ];
    for first in odd {
        for second in odd {
            let obs: Vec<f32> = [first, second]
                .into_iter()
                .cycle()
                .take(spaces.observation)
                .collect();
            let action = policy.act(&obs);
            assert!(action < spaces.actions, "{action} at {obs:?}");
            assert_eq!(policy.act(&obs), action);
            let _ = policy.value(&obs);
        }
    }
}

#[test]
fn any_policy_file_is_refused_or_acts_within_its_actions() {
    let target = Target {
        name: "policy",
        cases: 3000,
        shrinks: 2000,
        least_percent: (20, 20),
    };
    let spaces = Walk::new().spaces;
    target.run(&files(goods(false)), |(_, _, Bytes(bytes))| {
        let Some(bundle) = read(bytes) else {
            return Seen::Refused;
        };
        let Ok(policy) = load_policy_for(&spaces, &bundle) else {
            // It may be of other spaces, or none: to be told, not to be run.
            let _ = load_policy(&bundle);
            return Seen::Refused;
        };
        acts(&*policy, &spaces);
        for (_, config) in learners() {
            if let Ok(mut learner) = config.build_from(&spaces, 1, &bundle) {
                learner.episode(&mut Walk::new());
            }
        }
        Seen::Accepted
    });
}

#[test]
fn any_checkpoint_is_refused_or_trains_on() {
    let target = Target {
        name: "checkpoint",
        cases: 2000,
        shrinks: 2000,
        least_percent: (20, 20),
    };
    let spaces = Walk::new().spaces;
    target.run(&files(goods(true)), |(_, _, Bytes(bytes))| {
        let Some(bundle) = read(bytes) else {
            return Seen::Refused;
        };
        let configs = learners();
        let mut restored = configs
            .iter()
            .filter_map(|(_, config)| config.restore(&spaces, &bundle).ok());
        let Some(mut learner) = restored.next() else {
            return Seen::Refused;
        };
        acts(&*learner.policy(), &spaces);
        learner.episode(&mut Walk::new());
        acts(&*learner.policy(), &spaces);
        Seen::Accepted
    });
}

/// Shapes as nobody writes them: of no element, or of any number of axes.
#[test]
fn any_bundle_of_known_names_is_refused_or_acts() {
    let target = Target {
        name: "bundle",
        cases: 3000,
        shrinks: 2000,
        least_percent: (5, 20),
    };
    let size = || {
        select(vec![
            0,
            1,
            2,
            2,
            3,
            3,
            4,
            8,
            1 << 20,
            1 << 33,
            usize::MAX >> 3,
            usize::MAX,
        ])
    };
    let shape = || {
        prop_oneof![
            3 => Just(None),
            2 => prop::collection::vec(size(), 0..4).prop_map(Some),
        ]
    };
    let inputs = (0..3usize, prop::collection::vec(shape(), 12), -2.0..2.0f32);
    let spaces = Walk::new().spaces;
    target.run(&inputs, |(kind, shapes, value)| {
        let (_, config) = &learners()[*kind];
        let good = config.build(&spaces, 1).policy_bundle();
        let mut bundle = TensorFile::new(good.meta());
        for (name, other) in good.names().zip(shapes.iter().cycle()) {
            let own = good.shape(name).expect("named").to_vec();
            let shape = other.clone().unwrap_or_else(|| own.clone());
            let count = shape
                .iter()
                .try_fold(1usize, |product, n| product.checked_mul(*n));
            let Some(count) = count.filter(|count| *count < 1000) else {
                return Seen::Refused;
            };
            let numbers = good.get::<f32>(name, &own).is_ok();
            match (
                numbers,
                good.get::<f64>(name, &own),
                good.get::<u64>(name, &own),
            ) {
                (true, ..) => bundle.put(name, &shape, vec![*value; count]),
                (_, Ok(values), _) if shape == own => bundle.put(name, &shape, values.to_vec()),
                (_, _, Ok(values)) if shape == own => bundle.put(name, &shape, values.to_vec()),
                (_, Ok(_), _) => bundle.put(name, &shape, vec![f64::from(*value); count]),
                (_, _, Ok(_)) => bundle.put(name, &shape, vec![1u64; count]),
                _ => bundle.put(name, &shape, vec![1u32; count]),
            }
        }
        let Some(bundle) = bundle.to_bytes().ok().and_then(|bytes| read(&bytes)) else {
            return Seen::Refused;
        };
        match load_policy_for(&spaces, &bundle) {
            Ok(policy) => {
                acts(&*policy, &spaces);
                Seen::Accepted
            }
            Err(_) => Seen::Refused,
        }
    });
}
