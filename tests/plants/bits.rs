//! Equal calls, equal bits: on forks, on threads, after a clear.

use super::*;

/// A mixed scene: everything spawns, everybody gets commands of some interest.
fn mixed(kind: PlantKind) -> Box<dyn Plant> {
    let mut plant = plant(kind, Ground { friction: 0.8 });
    for (index, name) in ["sedan", "van", "truck", "motorcycle"]
        .into_iter()
        .enumerate()
    {
        let lane_m = 3.5 * index as f64;
        plant.spawn(&body(name), at(0.0, lane_m, 0.0), 10.0 + 2.0 * index as f64);
    }
    plant.spawn(&body("pedestrian"), at(60.0, -5.0, 1.57), 0.0);
    plant
}

fn stir(plant: &mut dyn Plant, samples: core::ops::Range<usize>) -> Vec<BodyState> {
    let mut states = Vec::new();
    for sample in samples {
        let wave = (sample as f64 * 0.13).sin();
        for index in 0..4 {
            plant.command(BodyId(index), drive(3.0 * wave, 0.002 * wave));
        }
        let (x_mps, y_mps) = (0.2, 1.5 * wave);
        plant.command(BodyId(4), BodyCommand::Walk { x_mps, y_mps });
        plant.advance(SAMPLE_S, 4);
        states.extend((0..5).map(|index| plant.state(BodyId(index))));
    }
    assert!(plant.sound());
    states
}

#[test]
fn equal_calls_give_equal_bits_on_any_thread() {
    for kind in KINDS {
        let run = move || stir(mixed(kind).as_mut(), 0..100);
        let want = run();
        let threads: Vec<_> = (0..2).map(|_| std::thread::spawn(run)).collect();
        for thread in threads {
            assert!(thread.join().expect("no panic") == want, "{kind:?}");
        }
    }
}

#[test]
fn a_fork_continues_bit_for_bit() {
    for kind in KINDS {
        let mut plant = mixed(kind);
        stir(plant.as_mut(), 0..37);
        let mut fork = plant.fork();
        let twice = fork.fork();
        assert!(
            stir(plant.as_mut(), 37..80) == stir(fork.as_mut(), 37..80),
            "{kind:?}"
        );
        let mut twice = twice;
        assert!(
            stir(twice.as_mut(), 37..80) == stir(mixed_at(kind, 37).as_mut(), 37..80),
            "{kind:?}"
        );
    }
}

fn mixed_at(kind: PlantKind, samples: usize) -> Box<dyn Plant> {
    let mut plant = mixed(kind);
    stir(plant.as_mut(), 0..samples);
    plant
}

#[test]
fn a_cleared_plant_is_as_good_as_new() {
    for kind in KINDS {
        let mut plant = mixed(kind);
        stir(plant.as_mut(), 0..50);
        plant.command(BodyId(0), drive(f64::NAN, 0.0));
        plant.clear(DRY);
        assert!(plant.sound());
        let id = plant.spawn(&body("sedan"), Pose::default(), 20.0);
        let mut fresh = Alone::new(kind, DRY, "sedan", 20.0);
        plant.command(id, drive(-3.0, 0.01));
        let states = fresh.run(drive(-3.0, 0.01), 1.0);
        for state in states {
            plant.advance(SAMPLE_S, 4);
            assert!(plant.state(id) == state, "{kind:?}");
        }
    }
}
