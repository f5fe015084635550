//! rapier's pipeline makes every step of the rigid plant.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Testbench};
use brakecheck::world::{PlantKind, Scenario};

fn shipped(name: &str) -> Scenario {
    Scenario::shipped(name).expect("shipped").expect("valid")
}

fn begin(bench: &mut Testbench, index: u64) {
    let key = StartKey {
        purpose: Purpose::Calibration,
        seed: 0,
        index,
    };
    let (start, noise) = (bench.draw(key), bench.noise_of(key));
    bench.begin(&start, noise, Aftermath::Play);
}

#[test]
fn every_substep_of_the_scenes_of_the_paper_is_a_step_of_rapier() {
    for name in ["acc", "merge", "yellow_light"] {
        let mut bench = shipped(name).on(PlantKind::Rigid).bench();
        let (actions, mut stepped) = (bench.spaces().actions, 0);
        for index in 0..5 {
            begin(&mut bench, index);
            while !bench.is_done() {
                bench.decide(index as usize % actions);
                let (ours, theirs) = (bench.physics_steps(), bench.rapier_steps());
                let left = ours - theirs;
                // The sample of a contact ends early.
                let substeps = u64::from(bench.clock().substeps);
                let most = if bench.contact().is_some() {
                    substeps
                } else {
                    1
                };
                assert!(left < most, "{name}: {theirs} of {ours} steps");
                stepped = stepped.max(theirs);
            }
        }
        assert!(stepped > 100, "{name}: {stepped}");
    }
}

#[test]
fn the_kinematic_plant_needs_no_rapier() {
    let mut bench = shipped("acc").on(PlantKind::Kinematic).bench();
    begin(&mut bench, 0);
    bench.decide(0);
    assert!(bench.physics_steps() > 0 && bench.rapier_steps() == 0);
}
