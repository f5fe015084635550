//! The paper's settings: squared loss, a step per decision, a random table, a
//! floor under the exploration.

use brakecheck::rl::{End, LearnerConfig, LearnerSettings, Spaces, TensorFile};

use crate::config;
use crate::scripted::{Episode, Scripted, level};

fn spaces() -> Spaces {
    Spaces {
        observation: 1,
        actions: 2,
        neutral: 0,
        parts: Vec::new(),
    }
}

/// The gradient of one update on one transition of action 0 that pays 3 and
/// ends, where Q was (0.5, 0): a tenth of it is Adam's first mean.
fn gradient(loss: &str) -> f64 {
    let ron = format!(
        "Dqn(decisions: 1000, hidden: [1], exploration: 0.0, final_exploration: 0.0, batch: 4, \
         update_every: 1, newest: true, learning_starts: 1, steps: 1, {loss})"
    );
    let learner = config(&ron);
    let mut checkpoint = learner.build(&spaces(), 5).checkpoint();
    for net in ["online", "target"] {
        level(&mut checkpoint, net, &[0.5, 0.0]);
    }
    let mut learner = learner.restore(&spaces(), &checkpoint).unwrap();
    learner.episode(&mut Scripted::new(&spaces(), |_| Episode::paying(3.0)));
    let found = learner.checkpoint();
    let mean = found.get::<f32>("adam/mean/1/bias", &[2]).unwrap();
    assert_eq!(mean[1], 0.0, "{loss}: an action that was not taken");
    10.0 * f64::from(mean[0])
}

#[test]
fn the_gradient_of_each_loss_is_its_central_difference() {
    // δ = 0.5 − 3 lies beyond every threshold here but the last.
    let squared = |error: f64| 0.5 * error * error;
    let huber = |threshold: f64| {
        move |error: f64| {
            if error.abs() <= threshold {
                squared(error)
            } else {
                threshold * (error.abs() - 0.5 * threshold)
            }
        }
    };
    let slope = |loss: &dyn Fn(f64) -> f64| (loss(-2.5 + 1e-6) - loss(-2.5 - 1e-6)) / 2e-6;
    for (ron, expected) in [
        ("loss: Squared", slope(&squared)),
        // The threshold is Huber's alone.
        ("loss: Squared, huber: 0.25", slope(&squared)),
        ("loss: Huber", slope(&huber(1.0))),
        ("loss: Huber, huber: 0.25", slope(&huber(0.25))),
        ("huber: 10.0", slope(&huber(10.0))),
    ] {
        let found = gradient(ron);
        assert!(
            (found - expected).abs() < 1e-5,
            "{ron}: {found}, not {expected}"
        );
    }
}

/// A checkpoint after one episode of five decisions, and the numbers of updates
/// and of transitions in it.
fn after_five(ron: &str, end: End) -> (TensorFile, u64, usize) {
    let mut learner = config(ron).build(&spaces(), 5);
    learner.episode(&mut Scripted::new(&spaces(), |_| Episode {
        observations: (0..=5).map(|t| vec![t as f32]).collect(),
        rewards: vec![0.0, 0.0, 0.0, 0.0, 1.0],
        end,
    }));
    let found = learner.checkpoint();
    let kept = found.shape("replay/actions").map_or(0, |shape| shape[0]);
    let updates = found.one("adam/steps").unwrap();
    (found, updates, kept)
}

#[test]
fn the_newest_transition_is_learned_from_at_once() {
    let newest = "Dqn(hidden: [1], batch: 1, discount: 0.5, update_every: 1, learning_starts: 1, \
                  steps: 1, newest: true)";
    let (found, updates, kept) = after_five(newest, End::Terminated);
    assert_eq!((updates, kept), (5, 5));
    let rows = found.get::<f32>("replay/rows", &[5, 4]).unwrap();
    for (t, row) in rows.chunks_exact(4).enumerate() {
        let (reward, discount) = if t == 4 { (1.0, 0.0) } else { (0.0, 0.5) };
        assert_eq!(row, [t as f32, t as f32 + 1.0, reward, discount]);
    }
    // A batch of one is the newest alone: every priority is that of its own error,
    // and none is the 1 that it came with.
    let priorities = found.get::<f64>("replay/priorities", &[5]).unwrap();
    assert!(priorities.iter().all(|one| *one != 1.0), "{priorities:?}");
    // An end that is none of the world's is bootstrapped; a fault teaches nothing.
    let (found, _, _) = after_five(newest, End::Truncated);
    let rows = found.get::<f32>("replay/rows", &[5, 4]).unwrap();
    assert_eq!(rows[19], 0.5);
    assert_eq!(after_five(newest, End::Aborted).2, 4);
    // Without it the first updates come after the first episode.
    let later = newest.replace(", newest: true", "");
    let (_, updates, kept) = after_five(&later, End::Terminated);
    assert_eq!((updates, kept), (0, 5));
}

#[test]
fn longer_returns_than_one_step_are_refused_with_the_newest_transition() {
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let settings: LearnerSettings = options.from_str("Dqn(newest: true)").unwrap();
    let error = LearnerConfig::new(settings).unwrap_err();
    assert_eq!(
        error.to_string(),
        "learner field `steps` is 3 with `newest: true`; write `steps: 1`"
    );
}

/// What a table holds after one still decision of action 0 or 1, by seed; the
/// learning rate is too small to be seen.
fn drawn(ron: &str, seed: u64) -> Vec<f32> {
    let mut learner = config(ron).build(&spaces(), seed);
    learner.episode(&mut Scripted::new(&spaces(), |_| Episode {
        observations: (0..=40).map(|t| vec![t as f32 / 20.0 - 1.0]).collect(),
        ..Episode::still(40)
    }));
    let found = learner.checkpoint();
    let shape = found.shape("values").unwrap_or(&[]).to_vec();
    found.get::<f32>("values", &shape).unwrap().to_vec()
}

#[test]
fn a_random_table_is_as_its_seed_and_within_its_range() {
    let ron = "QTable(learning_rate: Constant(1e-9), initial_value: 2.0, initial_spread: 0.5)";
    let found = drawn(ron, 7);
    assert_eq!(found, drawn(ron, 7));
    assert_ne!(found, drawn(ron, 8));
    assert!(found.iter().all(|value| (1.5..=2.5).contains(value)));
    let [least, greatest] = [f32::min, f32::max].map(|of| found.iter().copied().fold(2.0, of));
    assert!(least < 1.7 && greatest > 2.3, "{found:?}");
    // Neither action is the better one in every cell: a random table has no bias.
    let first = found.chunks_exact(2).filter(|row| row[0] > row[1]).count();
    assert!(first > 0 && first < found.len() / 2, "{found:?}");
    let flat = drawn(&ron.replace("0.5", "0.0"), 7);
    assert!(flat.iter().all(|value| (value - 2.0).abs() < 1e-6));
}

#[test]
fn a_table_learns_from_each_decision_as_it_is_taken_or_from_the_end() {
    // With α = ½ and one reward at the end, Watkins's step changes the last cell
    // alone; learned backwards the reward reaches all five: 1/2, 1/4, ….
    for (backward, expected) in [
        (false, [0.0, 0.0, 0.0, 0.0, 0.5]),
        (true, [0.03125, 0.0625, 0.125, 0.25, 0.5]),
    ] {
        let ron = format!(
            "QTable(learning_rate: Constant(0.5), exploration: 0.0, final_exploration: 0.0, \
             backward: {backward}, bins: [(low: 0.0, high: 6.0, count: 6)])"
        );
        let mut learner = config(&ron).build(&spaces(), 1);
        learner.episode(&mut Scripted::new(&spaces(), |_| Episode {
            observations: (0..=5).map(|t| vec![t as f32]).collect(),
            rewards: vec![0.0, 0.0, 0.0, 0.0, 1.0],
            end: End::Terminated,
        }));
        let policy = learner.policy();
        let values = [0.0, 1.0, 2.0, 3.0, 4.0].map(|x| policy.value(&[x]));
        assert_eq!(values, expected, "backward: {backward}");
    }
}

/// schedules.rs holds the shares of actions to ε; here ε is what it should be.
#[test]
fn the_letter_worlds_keep_every_action_likely_to_the_end_of_training() {
    for name in ["acc_letter", "merge_letter", "yellow_light_letter"] {
        let world = brakecheck::world::Scenario::shipped(name).unwrap().unwrap();
        for learner in [world.learner(), &world.learners()["q_table"]] {
            let mut checkpoint = learner.build(&spaces(), 1).checkpoint();
            checkpoint.put("counters", &[3], vec![learner.decisions(), 9, 0]);
            let ended = learner.restore(&spaces(), &checkpoint).unwrap();
            assert!(ended.finished());
            assert_eq!(ended.exploration(), 0.1, "{name}");
        }
    }
}
