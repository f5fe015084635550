//! What a sample of a scene costs: `cargo bench --bench scenes`.
//!
//! An old world (`acc`) beside the same with a lead car that has a plan, so that
//! what is not used can be seen to cost nothing, in one run on one machine.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use divan::Bencher;
use divan::counter::ItemsCount;

fn main() {
    divan::main();
}

/// `acc` as it is shipped, its lead car keeping its speed.
const ACC: &str = include_str!("../worlds/acc.ron");

fn acc(plant: PlantKind) -> Scenario {
    Scenario::parse("acc.ron", ACC).expect("shipped").on(plant)
}

/// The same with a lead car that is carried along a plan which waits for a
/// formula to the end.
fn planned(plant: PlantKind) -> Scenario {
    let (before, rest) = ACC.split_once("drive: Ado(").expect("an ado");
    let (_, actions) = rest.split_once("actions: Accelerations(").expect("actions");
    let (_, rest) = actions.split_once("]),").expect("their end");
    let (_, rest) = rest.split_once(',').expect("the neutral one");
    let text = format!(
        "{before}drive: Ado(base: Script([(when: \"ego.ado.headway <= -50\")]), \
         actions: Deviate(accelerations: [-3.0, 0.0, 3.0]), neutral: 1,{rest}"
    );
    Scenario::parse("acc.ron", &text)
        .expect("a world")
        .on(plant)
}

/// One episode with the ado\'s neutral action, per sample of it.
fn episodes(bencher: Bencher, world: &Scenario) {
    let mut bench = world.bench();
    let start = bench.draw(StartKey {
        purpose: Purpose::Calibration,
        seed: 0,
        index: 0,
    });
    let mut actor = Constant(1);
    let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Skip);
    let samples = ItemsCount::new(episode.trace.len());
    bencher
        .counter(samples)
        .bench_local(|| play(&mut bench, &start, 0, &mut actor, Aftermath::Skip));
}

/// The shipped world on the kinematic plant.
#[divan::bench]
fn acc_kinematic(bencher: Bencher) {
    episodes(bencher, &acc(PlantKind::Kinematic));
}

/// The shipped world on the rigid plant.
#[divan::bench]
fn acc_rigid(bencher: Bencher) {
    episodes(bencher, &acc(PlantKind::Rigid));
}

/// The lead car along a plan, on the kinematic plant.
#[divan::bench]
fn planned_kinematic(bencher: Bencher) {
    episodes(bencher, &planned(PlantKind::Kinematic));
}

/// The lead car along a plan, on the rigid plant.
#[divan::bench]
fn planned_rigid(bencher: Bencher) {
    episodes(bencher, &planned(PlantKind::Rigid));
}
