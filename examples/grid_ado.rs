//! Train a grid ado with the library and reuse it on a larger map.
//!
//! ```sh
//! cargo run --release --example grid_ado
//! ```

use brakecheck::rl::Control;
use brakecheck::seed::Purpose;
use brakecheck::testbench::{Aftermath, Gym, PolicyActor, play};
use brakecheck::world::{GridChange, Scenario};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = Scenario::load("worlds/grid_hard.ron".as_ref())?;
    let mut gym = Gym::new(world.bench(), Purpose::Train, 0);
    let mut learner = world.learner().build(world.world().spaces(), 0);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let policy = learner.policy();
    for size in [4, 5, 10] {
        let change = GridChange {
            size: Some(size),
            ..GridChange::default()
        };
        let world = world.with(&change.into())?;
        let starts = world.starts().unwrap_or_default();
        let mut bench = world.bench();
        let captured = starts.iter().filter(|start| {
            let mut ado = PolicyActor(&*policy);
            play(&mut bench, start, 0, &mut ado, Aftermath::Skip)
                .verdict
                .is_success()
        });
        println!(
            "n = {size}: {} of {} starts",
            captured.count(),
            starts.len()
        );
    }
    Ok(())
}
