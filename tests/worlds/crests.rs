//! A crest takes load off the tyres, which only the rigid plant shows.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Replay, play};
use brakecheck::world::{PlantKind, Scenario};

const STARTS: u64 = 3;
/// Pieces of one bend, which is as much as the rulebook lets the road turn.
const BEND: usize = 3;

/// Returns on how many starts a bend of some place makes the ego leave its lane.
fn solved(world: &Scenario) -> usize {
    let mut bench = world.bench();
    let mut is_solved = |index| {
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed: 0,
            index,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        (2..9).any(|straight| {
            let mut actions = vec![0; straight];
            actions.extend([1; BEND]);
            let mut ado = Replay::then(&actions, 0);
            let episode = play(&mut bench, &start, noise, &mut ado, Aftermath::Skip);
            episode.verdict.is_success()
        })
    };
    (0..STARTS).filter(|index| is_solved(*index)).count()
}

#[test]
fn a_bend_on_a_crest_takes_a_car_out_of_its_lane_on_the_rigid_plant_only() {
    let world = Scenario::shipped("crest_bend")
        .expect("shipped")
        .expect("valid");
    assert_eq!(solved(&world), STARTS as usize);
    assert_eq!(solved(&world.on(PlantKind::Kinematic)), 0);
    // Without the vertical curve's crest the same bends are harmless.
    let text = include_str!("../../worlds/crest_bend.ron");
    let level = text
        .replace("grades: [(0.0, 0.12), (170.0, -0.12)],", "")
        .replace("vertical_curve_m: 36.0,", "");
    assert_ne!(text, level);
    let level = Scenario::parse("level.ron", &level).expect("valid");
    assert_eq!(solved(&level), 0);
}

/// What the kinematic plant does not show, it may not screen out.
#[test]
fn sequences_are_screened_on_level_roads_only() {
    let shipped = |name| Scenario::shipped(name).expect("shipped").expect("valid");
    assert!(shipped("crest_bend").screening().is_none());
    assert!(shipped("acc").screening().is_some());
    assert!(
        shipped("acc")
            .on(PlantKind::Kinematic)
            .screening()
            .is_none()
    );
    assert!(shipped("grid").screening().is_none());
}
