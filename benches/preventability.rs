//! What it costs to ask whether a contact was preventable.
//!
//! `cargo bench --bench preventability`; the episodes are random ados' contacts
//! on the kinematic plant. `is_avoided_by_any` is for training loops, which keep
//! the replayer; `assess` gives everything, rulebook included.

use brakecheck::ego::ReferenceDriver;
use brakecheck::scene::Motion;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Episode, HeldRandom, motion_of, play};
use brakecheck::world::PlantKind;
use brakecheck::world::{Change, Scenario};
use brakecheck_scene::testbench::actors::HOLD_DECISIONS;
use divan::{Bencher, black_box};

const WORLDS: [&str; 3] = ["acc_plain", "cut_in", "merge_plain"];

fn main() {
    divan::main();
}

fn contact(name: &str) -> (Scenario, Episode, Motion) {
    let path = format!("{}/worlds/{name}.ron", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).expect("a world");
    let change = Change {
        plant: Some(PlantKind::Kinematic),
        ..Change::default()
    };
    let world = Scenario::parse(&path, &text).expect("a world");
    let world = world.with(&change).expect("a change");
    let mut bench = world.bench();
    let actions = bench.spaces().actions;
    let found = (0..1000).find_map(|index| {
        let start = bench.draw(StartKey {
            purpose: Purpose::Train,
            seed: 7,
            index,
        });
        let mut ado = HeldRandom::new(actions, HOLD_DECISIONS);
        let episode = play(&mut bench, &start, index, &mut ado, Aftermath::Play);
        episode.contact.as_ref()?;
        let motion = motion_of(&mut bench, &episode)?;
        Some((episode, motion))
    });
    let (episode, motion) = found.expect("a contact");
    (world, episode, motion)
}

#[divan::bench(args = WORLDS)]
fn is_avoided_by_any(bencher: Bencher, world: &str) {
    let (world, _, motion) = contact(world);
    let mut replayer = world.replayer().expect("a driving world");
    // The two that fail most often, so that both are asked mostly.
    let drivers = [ReferenceDriver::CcLatched, ReferenceDriver::Cc];
    bencher.bench_local(|| replayer.is_avoided_by_any(black_box(&motion), &drivers));
}

#[divan::bench(args = WORLDS)]
fn assess(bencher: Bencher, world: &str) {
    let (world, episode, motion) = contact(world);
    let mut replayer = world.replayer().expect("a driving world");
    bencher.bench_local(|| replayer.assess(black_box(&motion), Some(&episode.trace)));
}
