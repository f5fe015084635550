//! Whole updates against numbers computed outside: see golden/update.py.

use std::collections::BTreeSet;

use brakecheck::rl::{Element, End, LearnerRng, Spaces, TensorFile};
use serde_json::Value;

use crate::config;
use crate::scripted::{Episode, Scripted};

const DQN: &str = include_str!("golden/dqn.jsonl");
const PPO: &str = include_str!("golden/ppo.jsonl");

struct Case {
    data: Value,
    spaces: Spaces,
    episode: Episode,
}

fn cases(text: &str) -> Vec<Case> {
    let read = |line| {
        let data: Value = serde_json::from_str(line).unwrap();
        let episode = &data["episode"];
        Case {
            spaces: Spaces {
                observation: whole(&data["spaces"][0]),
                actions: whole(&data["spaces"][1]),
                neutral: 0,
                parts: Vec::new(),
            },
            episode: Episode {
                observations: list(&episode["observations"]).map(floats).collect(),
                rewards: floats(&episode["rewards"]),
                end: match episode["end"].as_str().unwrap() {
                    "Terminated" => End::Terminated,
                    "Truncated" => End::Truncated,
                    other => panic!("{other}"),
                },
            },
            data,
        }
    };
    let cases: Vec<Case> = text.lines().map(read).collect();
    assert_eq!(cases.len(), 3);
    cases
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().unwrap().iter()
}

fn whole(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

fn floats(value: &Value) -> Vec<f32> {
    list(value).map(|x| x.as_f64().unwrap() as f32).collect()
}

fn bundle(case: &Value) -> TensorFile {
    fn put<T: Element>(bundle: &mut TensorFile, name: &str, tensor: &Value, read: fn(&Value) -> T) {
        let shape: Vec<usize> = list(&tensor["shape"]).map(whole).collect();
        bundle.put(name, &shape, list(&tensor["values"]).map(read).collect());
    }
    let mut bundle = TensorFile::new(case["kind"].as_str().unwrap());
    for (name, tensor) in case["before"].as_object().unwrap() {
        match tensor["type"].as_str().unwrap() {
            "f32" => put(&mut bundle, name, tensor, |x| x.as_f64().unwrap() as f32),
            "f64" => put(&mut bundle, name, tensor, |x| x.as_f64().unwrap()),
            "u8" => put(&mut bundle, name, tensor, |x| x.as_u64().unwrap() as u8),
            "u32" => put(&mut bundle, name, tensor, |x| x.as_u64().unwrap() as u32),
            "u64" => put(&mut bundle, name, tensor, |x| x.as_u64().unwrap()),
            other => panic!("{other}"),
        }
    }
    bundle
}

/// The first number of a checkpoint that is not the expected one.
///
/// Single precision keeps seven digits, of which the sums over a batch and a
/// layer lose one or two; and 1 − 0.999 in it is 0.001 less 1.3e-5 of that. So
/// numbers agree to 2e-5 of the largest in the tensor.
fn difference(found: &TensorFile, after: &Value) -> Option<String> {
    fn wide<T: Element + Into<f64>>(found: &TensorFile, name: &str, shape: &[usize]) -> Vec<f64> {
        let numbers = found.get::<T>(name, shape).unwrap();
        numbers.iter().map(|x| (*x).into()).collect()
    }
    for (name, tensor) in after.as_object().unwrap() {
        let shape: Vec<usize> = list(&tensor["shape"]).map(whole).collect();
        let got = match tensor["type"].as_str().unwrap() {
            "f32" => wide::<f32>(found, name, &shape),
            "f64" => wide::<f64>(found, name, &shape),
            "u32" => wide::<u32>(found, name, &shape),
            "u64" => {
                let numbers = found.get::<u64>(name, &shape).unwrap();
                numbers.iter().map(|x| *x as f64).collect()
            }
            other => panic!("{other}"),
        };
        let want: Vec<f64> = list(&tensor["values"])
            .map(|x| x.as_f64().unwrap())
            .collect();
        let largest = want.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        for (at, (got, want)) in got.iter().zip(&want).enumerate() {
            let close = (got - want).abs() <= 2e-5 * largest;
            if !close {
                return Some(format!("{name}[{at}] is {got}, not {want}"));
            }
        }
    }
    None
}

/// Plays the episode from the checkpoint; which outcome came, or what is
/// wrong with each that these actions could have had.
fn outcome(case: &Case, seed: Option<u64>) -> Result<usize, String> {
    let mut before = bundle(&case.data);
    if let Some(seed) = seed {
        LearnerRng::new(seed).save(&mut before);
    }
    let mut learner = config(case.data["learner"].as_str().unwrap())
        .restore(&case.spaces, &before)
        .unwrap();
    let mut env = Scripted::new(&case.spaces, |_| case.episode.clone());
    learner.episode(&mut env);
    let (found, actions) = (learner.checkpoint(), serde_json::json!(env.actions));
    let mut wrong = Vec::new();
    for (index, outcome) in list(&case.data["outcomes"]).enumerate() {
        if outcome["actions"] == actions {
            match difference(&found, &outcome["after"]) {
                None => return Ok(index),
                Some(what) => wrong.push(what),
            }
        }
    }
    Err(format!("{actions}: {}", wrong.join("; ")))
}

#[test]
fn one_update_of_dqn_is_what_the_papers_say() {
    for case in cases(DQN) {
        if let Err(wrong) = outcome(&case, None) {
            panic!("{}: {wrong}", case.data["name"]);
        }
    }
}

#[test]
fn one_update_of_ppo_is_what_the_papers_say() {
    for case in cases(PPO) {
        // Actions and minibatches are drawn: every seed gives one outcome.
        let mut met = BTreeSet::new();
        for seed in 0..100 {
            match outcome(&case, Some(seed)) {
                Ok(index) => met.insert(index),
                Err(wrong) => panic!("{}, seed {seed}: {wrong}", case.data["name"]),
            };
        }
        // Two actions and 36 ways to cut the rollout in two shuffled epochs: a
        // hundred seeds meet most, but one order for both epochs only 12.
        let outcomes = list(&case.data["outcomes"]).count();
        assert!(outcomes != 72 || met.len() > 40, "{} met", met.len());
    }
}

#[test]
fn an_updated_rollout_is_forgotten_and_a_short_one_kept() {
    let case = &cases(PPO)[0];
    let ron = case.data["learner"].as_str().unwrap();
    for (horizon, kept) in [(8, 0), (9, 0), (10, 9)] {
        let mut learner = config(&ron.replace("horizon: 9", &format!("horizon: {horizon}")))
            .restore(&case.spaces, &bundle(&case.data))
            .unwrap();
        learner.episode(&mut Scripted::new(&case.spaces, |_| case.episode.clone()));
        let found = learner.checkpoint();
        let steps: u64 = found.one("actor_adam/steps").unwrap();
        assert_eq!(found.shape("rollout/actions"), Some(&[kept][..]));
        assert_eq!(steps, if kept == 0 { 4 + 3 } else { 4 });
    }
}
