//! The grid world: exact numbers, theorems, learners, and errors in its files.

mod bisimulation;
mod errors;
mod exact;
mod learning;
mod solver;
mod theorems;

use brakecheck::rl::Policy;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Episode, PolicyActor, play};
use brakecheck::world::AtWall;
use brakecheck::world::{GridChange, Scenario};
use brakecheck_experiment::grid_solver::exact::{Game, UNIT_MOVES};
use brakecheck_experiment::grid_solver::game_graph::{Depth, GameGraph};
use brakecheck_experiment::grid_solver::values::{ValueTable, rewards};
use brakecheck_scene::scene::grid::Arena;
use brakecheck_world::world::scenario_kind::GridScenario;

const A: AtWall = AtWall::Stays;
const B: AtWall = AtWall::FirstInMap;

fn world(wall: AtWall) -> Scenario {
    let (file, text) = match wall {
        AtWall::Stays => ("grid.ron", include_str!("../../worlds/grid.ron")),
        AtWall::FirstInMap => ("grid_hard.ron", include_str!("../../worlds/grid_hard.ron")),
    };
    Scenario::parse(file, text).unwrap_or_else(|error| panic!("{error}"))
}

fn cells(scenario: &Scenario) -> GridScenario<'_> {
    scenario.grid().expect("a grid")
}

fn changed(scenario: &Scenario, change: GridChange) -> Scenario {
    scenario
        .with(&change.into())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The ado that makes the ego fail as soon as it can.
fn soonest(scenario: &Scenario) -> ValueTable {
    let grid = cells(scenario);
    let graph = GameGraph::explore(grid.world(), grid.rulebook(), Depth::Sign);
    ValueTable::soonest(graph.unwrap_or_else(|error| panic!("{error}")))
}

/// V* under a discount.
fn exact(scenario: &Scenario, discount: f64) -> ValueTable {
    let grid = cells(scenario);
    let graph = GameGraph::explore(grid.world(), grid.rulebook(), Depth::Exact)
        .unwrap_or_else(|error| panic!("{error}"));
    ValueTable::exact(graph, discount, rewards(grid.rulebook()))
}

/// n cells a side, an ego of k cells per step, K steps.
fn game(at_wall: AtWall, size: u32, ego_step: u32, steps: u32) -> Game {
    Game {
        arena: Arena {
            size,
            refine: 1,
            ego_step,
            at_wall,
        },
        steps,
        moves: UNIT_MOVES.to_vec(),
    }
}

fn episode(scenario: &Scenario, start: &Start, policy: &dyn Policy) -> Episode {
    let mut ado = PolicyActor(policy);
    play(&mut scenario.bench(), start, 0, &mut ado, Aftermath::Skip)
}

fn captures(scenario: &Scenario, policy: &dyn Policy) -> usize {
    let starts = scenario.starts().expect("a finite world");
    let captured = starts
        .iter()
        .filter(|start| episode(scenario, start, policy).verdict.is_success());
    captured.count()
}
