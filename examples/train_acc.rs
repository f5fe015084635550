//! Train an ado with the library and meet the first crash it causes.
//!
//! ```sh
//! cargo run --release --example train_acc
//! ```

use brakecheck::rl::Learner;
use brakecheck::rl::{Control, LearnerConfig};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Gym, PolicyActor, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = Scenario::load("worlds/acc.ron".as_ref())?;
    let cheap = world.on(PlantKind::Kinematic);

    // Train on the cheap plant …
    let config: LearnerConfig = world.learner().clone().with_decisions(40_000)?;
    let mut gym = Gym::new(cheap.bench(), Purpose::Train, 0);
    let mut learner: Box<dyn Learner> = config.build(cheap.world().spaces(), 0);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let policy = learner.policy();

    // … and reuse the ado, untouched, on the rigid one.
    let mut bench = world.bench();
    let mut failed = 0;
    for index in 0..100 {
        let key = StartKey {
            purpose: Purpose::Test,
            seed: 0,
            index,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        let mut ado = PolicyActor(&*policy);
        let episode = play(&mut bench, &start, noise, &mut ado, Aftermath::Play);
        failed += u32::from(episode.verdict.is_success());
        if let (1, Some(touch)) = (failed, &episode.contact) {
            println!("first crash from {start:?}: {touch:?}");
        }
    }
    println!("the ego failed from {failed} of 100 starts, every rule kept");
    Ok(())
}
