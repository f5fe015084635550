//! Selection of the plant on which a model matches its world.

use super::dataset::RecordedRun;
use super::surrogate_sim::{ModelBench, VARIATIONS};
use crate::sim::PlantKind;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// Largest difference of a coordinate between the plants, m.
const ALIKE_M: f64 = 0.005;

/// Returns the plant on which plans are judged.
///
/// The kinematic plant is about ten times as fast. It is used if all vehicles move on it
/// as on the world's own plant in these runs.
/// Along a lane both plants agree. A lane change differs by some centimetres on the rigid
/// plant, and centimetres decide whether a rule is kept.
pub(super) fn judged_on(world: &Scenario, runs: &[RecordedRun]) -> Option<PlantKind> {
    let own = world.drive()?.plant;
    let Some(columns) = places(world) else {
        return Some(own);
    };
    let (mut there, mut here) = (ModelBench::on(world, own)?, ModelBench::quick(world)?);
    let alike = |run: &RecordedRun| {
        for model in [&mut there, &mut here] {
            model.begin(run.from(), &run.so_far, None, VARIATIONS[0]);
        }
        // Beyond the recorded motion no ego is there to compare with.
        let samples = run.so_far.motion.len();
        columns.iter().all(|&column| {
            let of = |bench: &Testbench| bench.trace().column(column).to_vec();
            let pairs = of(&there.bench).into_iter().zip(of(&here.bench));
            pairs.take(samples).all(|(a, b)| (a - b).abs() <= ALIKE_M)
        })
    };
    let is_own = own == PlantKind::Kinematic;
    Some(if is_own || runs.iter().all(alike) {
        PlantKind::Kinematic
    } else {
        own
    })
}

/// Returns the columns of all published positions.
fn places(world: &Scenario) -> Option<Vec<usize>> {
    let schema = world.world().schema();
    let agents = world.drive()?.agents.iter();
    let names = agents.flat_map(|agent| ["x", "y"].map(|axis| format!("{}.{axis}", agent.name)));
    names.map(|name| schema.position(&name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Watch;
    use crate::surrogate::dataset::{alike, starts};

    fn judged(name: &str, plant: PlantKind, actions: &[usize]) -> Option<PlantKind> {
        let world = Scenario::shipped(name).expect("shipped").expect("sound");
        let world = world.on(plant);
        let from = starts(&world, 6, 8);
        judged_on(&world, &alike(&world, actions, &from, &Watch::unwatched()))
    }

    #[test]
    fn only_where_nobody_skids_a_plan_is_judged_on_the_kinematic_plant() {
        use PlantKind::{Kinematic, Rigid};
        assert_eq!(judged("acc", Rigid, &[0, 0, 2, 1]), Some(Kinematic));
        assert_eq!(judged("acc", Kinematic, &[0]), Some(Kinematic));
        let merging = [1, 4, 4];
        assert_eq!(judged("cut_in", Rigid, &merging), Some(Rigid));
        assert_eq!(judged("cut_in", Kinematic, &merging), Some(Kinematic));
        // This world has no driving scene.
        assert_eq!(judged("grid", Rigid, &[0]), None);
    }
}
