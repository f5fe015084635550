//! On which plant a model of a world is true to it.

use super::dataset::Run;
use super::surrogate_sim::{ModelBench, VARIATIONS};
use crate::sim::PlantKind;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// Nobody may be further from where they are on the other plant.
const ALIKE_M: f64 = 0.005;

/// The plant to judge plans on: the kinematic one, which is some ten times as fast,
/// if everybody moves on it as in these runs on the world's own one; else that.
///
/// Along a lane both plants obey alike; who changes lanes on the rigid one is some
/// centimetres elsewhere, and rules are kept or broken by centimetres.
pub(super) fn judged_on(world: &Scenario, runs: &[Run]) -> Option<PlantKind> {
    let own = world.drive()?.plant;
    let Some(columns) = places(world) else {
        return Some(own);
    };
    let (mut there, mut here) = (ModelBench::on(world, own)?, ModelBench::quick(world)?);
    let alike = |run: &Run| {
        for model in [&mut there, &mut here] {
            model.begin(run.from(), &run.so_far, None, VARIATIONS[0]);
        }
        let samples = run.so_far.motion.len();
        columns.iter().all(|&column| {
            let of = |bench: &Testbench| bench.trace().column(column).to_vec();
            let pairs = of(&there.bench).into_iter().zip(of(&here.bench));
            pairs.take(samples).all(|(a, b)| (a - b).abs() <= ALIKE_M)
        })
    };
    let is_own = own == PlantKind::Kinematic;
    Some(match is_own || runs.iter().all(alike) {
        true => PlantKind::Kinematic,
        false => own,
    })
}

/// The columns in which everybody's place is published.
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
        // Nobody drives there.
        assert_eq!(judged("grid", Rigid, &[0]), None);
    }
}
