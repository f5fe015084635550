//! Fig. 1 of the paper: a sequence of actions is good for one start, a policy
//! for all of them.
//!
//! ```sh
//! cargo run --release --example open_loop_vs_policy
//! ```

use brakecheck::rl::Control;
use brakecheck::scene::Start;
use brakecheck::seed::Purpose;
use brakecheck::testbench::{Actor, Aftermath, Episode, Gym, PolicyActor, Replay, play};
use brakecheck::world::{GridChange, Scenario};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = Scenario::load("worlds/grid_hard.ron".as_ref())?;
    let slower = world.with(
        &GridChange {
            ego_step: Some(1),
            ..GridChange::default()
        }
        .into(),
    )?;
    let mut gym = Gym::new(world.bench(), Purpose::Train, 0);
    let mut learner = world.learner().build(world.world().spaces(), 0);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let policy = learner.policy();

    // Record what the policy does from one start.
    let start = Start(vec![0.0, 0.0, 3.0, 3.0]);
    let recorded = from(&world, &start, &mut PolicyActor(&*policy));
    let words: Vec<String> = recorded
        .actions
        .iter()
        .map(|&action| world.action_label(action))
        .collect();
    println!("the policy, from {:?}: {}", start.0, words.join(", "));

    // The same actions elsewhere, and the policy in their place.
    let elsewhere = Start(vec![2.0, 1.0, 0.0, 0.0]);
    for (what, world, start) in [
        ("its own start", &world, &start),
        ("another start", &world, &elsewhere),
        ("its own start, but k = 1", &slower, &start),
    ] {
        let open_loop = from(world, start, &mut Replay::holding(&recorded.actions));
        let closed_loop = from(world, start, &mut PolicyActor(&*policy));
        println!(
            "{what:>26}: the sequence {}, the policy {}",
            outcome(&open_loop),
            outcome(&closed_loop)
        );
    }
    Ok(())
}

fn from(world: &Scenario, start: &Start, ado: &mut dyn Actor) -> Episode {
    play(&mut world.bench(), start, 0, ado, Aftermath::Skip)
}

fn outcome(episode: &Episode) -> &'static str {
    if episode.verdict.is_success() {
        "captures"
    } else {
        "does not"
    }
}
