//! Items that the tests, the benchmarks and `crates/repro` of this repository use.
//!
//! The module is not part of the API and has no stability promise. Any release may
//! change or remove an item here.

#![allow(missing_docs)]

pub mod adversary {
    pub use crate::adversary::best_of_n::BestOfN;
    pub use crate::adversary::rollout::{EvalRequest, Evaluated, eval};
}
pub mod crashes {
    pub use crate::crashes::export::openx;
    pub use crate::crashes::minimize::{CLOSING, effort, shrink};
    pub use crate::crashes::perturbation_robustness::persistence;
    pub use crate::crashes::replay::replay;
    pub use crate::crashes::root_cause::{SubstituteDriver, decisive, last_chance, why};
    pub use crate::crashes::save_crashes::{CrashWriter, PERSISTENT, description};
}
pub mod ego {
    pub use crate::ego::takeover::{FullBrake, Takeover};
    pub mod reference {
        pub use crate::ego::reference::{
            CcDriver, CcLaneDriver, CcLatchedDriver, DriverModel, Encounter, FsmDriver,
            IdealDriver, LaneBody, Pedal, Reflexes, RegDriver, Response, RssDriver, TtcReading,
        };
    }
}
pub mod evaluation {
    pub use crate::evaluation::reuse::{
        LEAST_REACHABLE, Relation, ReusedOn, Summary, reused_on, summarise,
    };
}
pub mod experiment {
    pub use crate::experiment::clustering::{CrashFeatures, NEAR, clusters};
    pub use crate::experiment::episode_loop::EpisodeLoop;
}
pub mod grid_solver {
    pub mod bisimulation {
        pub use crate::grid_solver::bisimulation::{Bisimulation, coarse};
    }
    pub mod exact {
        pub use crate::grid_solver::exact::{Game, PositionPolicy, UNIT_MOVES, chase};
    }
    pub mod values {
        pub use crate::grid_solver::values::ValueTable;
    }
}
pub mod natural {
    pub use crate::natural::behaviour::behaviours;
}
pub mod report {
    pub use crate::report::figures::{Behaviour, Distances, figure_2, figure_3, figure_5};
    pub use crate::report::table::{TextTable, WIDTH, terminal_table};
}
pub mod risk {
    pub use crate::risk::{ProposalFault, unchecked_estimate};
}
pub mod rl {
    pub use crate::rl::list::{load_policy, load_policy_for};
    pub mod nn {
        pub use crate::rl::adam::Adam;
        pub use crate::rl::nn::{Mlp, argmax};
    }
    pub mod replay {
        pub use crate::rl::replay::{Batch, EpisodeBuffer, ReplayBuffer, Tail, Transition};
        pub use crate::rl::sum_tree::SumTree;
    }
}
pub mod run_dir {
    pub use crate::run_dir::cached_result::CachedResult;
    pub use crate::run_dir::counterexample::{csv_of, digests_of};
    pub use crate::run_files::disk::make_dir;
    pub use crate::world::RunsOnDisk;
}
pub mod scene {
    pub mod drive {
        pub use crate::road::{
            ChangeShape, Course, CourseError, Direction, Grade, OnRoad, Piece, PlacedRoad,
            Priority, Road, RoadPlace,
        };
        pub use crate::scene::drive::*;
    }
    pub mod grid {
        pub use crate::scene::grid::*;
    }
}
pub mod severity {
    pub use crate::severity::Party;
}
pub mod sim {
    pub use crate::sim::*;
}
pub mod testbench {
    pub use crate::testbench::actors::HOLD_DECISIONS;
    pub use crate::testbench::film::{Film, film, film_beyond};
}
pub mod theorems {
    pub use crate::theorems::{
        Approximation, Theorem1, Theorem2, Theorem3, TheoremOutcome, TheoremsRequest, Witness,
        bisimulations, carry_over, grid_theorems, lifted, optimal_values, theorem_1, theorem_2,
        theorem_3,
    };
}
pub mod training {
    pub use crate::training::goals::GoalTracker;
    pub use crate::training::train_loop::train;
    pub use crate::training::training_egos::TrainingGym;
}
#[cfg(feature = "rerun")]
pub mod view {
    pub use crate::view::panels::entities;
}
pub mod world {
    pub use crate::world::family::{EgoSample, Family};
    pub use crate::world::scenario_kind::GridScenario;
}

/// Returns the limit on how rare the driving of a world's ados may become.
pub fn ado_limit(world: &crate::world::Scenario) -> Option<crate::natural::AdoLimit> {
    world.traffic().limit()
}
