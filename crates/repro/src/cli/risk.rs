//! Risks in declared traffic, beside counted natural runs.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, headed, once, world};
use crate::{
    COUNTED_PIECE, CountedRuns, RiskCase, RiskSeed, RiskStudy, counted_piece, risk_markdown,
    risk_seed,
};
use brakecheck::risk::{RiskTraffic, ValueKind};
use brakecheck::world::{PlantKind, Scenario};
use brakecheck_risk::risk::ProposalFault;

/// Estimates of a case, at most.
const MOST_SEEDS: u64 = 100;
/// Natural runs that are counted per test start of the command line.
const COUNTED_PER_START: usize = 20_000;
/// First seed of counted runs.
const FIRST_COUNTED: u64 = 1_000_000;

/// Budget with which naive proposals give no good estimate, and natural runs within it.
const FEW_RUNS: Option<[usize; 2]> = Some([10_000, 1_000]);

const ACC: RiskCase = RiskCase {
    name: "acc",
    world: "acc",
    text: None,
    traffic: include_str!("../../../../examples/traffic/acc.ron"),
    plant: PlantKind::Kinematic,
    learn_on: None,
    value: ValueKind::Network,
    fault: None,
    budget: None,
};
const CUT_IN: RiskCase = RiskCase {
    name: "cut_in",
    world: "cut_in",
    traffic: include_str!("../../../../examples/traffic/cut_in.ron"),
    ..ACC
};
/// World of two cars whose failures are independent.
const TWO_CARS: RiskCase = RiskCase {
    name: "two_cars",
    world: "two_cars",
    text: Some(include_str!("../../worlds/two_cars.ron")),
    traffic: include_str!("../../worlds/two_cars_traffic.ron"),
    ..ACC
};
/// Cases, of which `--world` chooses some by name.
const CASES: [RiskCase; 15] = [
    ACC,
    CUT_IN,
    RiskCase {
        name: "pedestrian",
        world: "pedestrian",
        traffic: include_str!("../../../../examples/traffic/pedestrian.ron"),
        ..ACC
    },
    RiskCase {
        name: "oncoming",
        world: "oncoming",
        traffic: include_str!("../../../../examples/traffic/oncoming.ron"),
        ..ACC
    },
    RiskCase {
        name: "sandwich",
        world: "sandwich",
        traffic: include_str!("../../../../examples/traffic/sandwich.ron"),
        ..ACC
    },
    RiskCase {
        name: "merge",
        world: "merge",
        traffic: include_str!("../../../../examples/traffic/merge.ron"),
        ..ACC
    },
    RiskCase {
        name: "acc-table",
        value: ValueKind::Table,
        ..ACC
    },
    RiskCase {
        name: "cut_in-table",
        value: ValueKind::Table,
        ..CUT_IN
    },
    RiskCase {
        name: "acc-rigid",
        plant: PlantKind::Rigid,
        learn_on: Some(PlantKind::Kinematic),
        ..ACC
    },
    RiskCase {
        name: "cut_in-rigid",
        plant: PlantKind::Rigid,
        learn_on: Some(PlantKind::Kinematic),
        ..CUT_IN
    },
    RiskCase {
        name: "acc-state-blind",
        fault: Some(ProposalFault::StateBlind),
        budget: FEW_RUNS,
        ..ACC
    },
    RiskCase {
        name: "cut_in-state-blind",
        fault: Some(ProposalFault::StateBlind),
        budget: FEW_RUNS,
        ..CUT_IN
    },
    RiskCase {
        name: "cut_in-side-swipes-only",
        fault: Some(ProposalFault::Only("side-swipe")),
        ..CUT_IN
    },
    TWO_CARS,
    RiskCase {
        name: "two_cars-lead-only",
        fault: Some(ProposalFault::Only("lead")),
        ..TWO_CARS
    },
];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(MOST_SEEDS);
    let mut studies = Vec::new();
    for case in CASES.iter().filter(|case| args.wants(case.name)) {
        let scenario = (match case.text {
            Some(text) => Scenario::parse(&format!("{}.ron", case.world), text)?,
            None => world(args, case.world)?,
        })
        .on(case.plant);
        let traffic = case.traffic(&scenario)?;
        let counted = counted(args, case, &scenario, &traffic)?;
        let estimates = estimates(args, case, &scenario, &traffic)?;
        let (Some(counted), Some(seeds)) = (counted, estimates) else {
            return Ok(None);
        };
        studies.push(RiskStudy {
            case: case.name.to_owned(),
            is_faulty: case.fault.is_some(),
            counted,
            seeds,
        });
    }
    Ok(Some(Made {
        name: "risk",
        markdown: headed(seeds, &risk_markdown(&studies)),
        json: json!({ "risk": studies }),
    }))
}

/// Estimates a case with every seed. `None` if interrupted.
fn estimates(
    args: &ReproduceArgs,
    case: &RiskCase,
    scenario: &Scenario,
    traffic: &RiskTraffic,
) -> Result<Option<Vec<RiskSeed>>, Failure> {
    let mut all = Vec::new();
    for seed in args.seeds_within(MOST_SEEDS).trainings() {
        let piece = format!("{}, risk {seed}", case.name);
        let settings = json!({ "traffic": case.traffic });
        let made = once(args, &piece, scenario, settings, |watch| {
            Ok(risk_seed(scenario, traffic, case, seed, watch)?)
        })?;
        let Some(made) = made else {
            return Ok(None);
        };
        all.push(made);
    }
    Ok(Some(all))
}

/// Counts natural runs of a case. `None` if interrupted.
fn counted(
    args: &ReproduceArgs,
    case: &RiskCase,
    scenario: &Scenario,
    traffic: &RiskTraffic,
) -> Result<Option<CountedRuns>, Failure> {
    let mut all = CountedRuns::default();
    // Natural runs do not depend on proposals, and rigid ones would take hours.
    let is_plain = case.plant == PlantKind::Kinematic;
    let pieces = (args.starts * COUNTED_PER_START).div_ceil(COUNTED_PIECE);
    for piece in 0..if is_plain { pieces as u64 } else { 0 } {
        let seed = FIRST_COUNTED + piece;
        let name = format!("{}, counted {piece}", case.world);
        let settings = json!({ "traffic": case.traffic });
        let made = once(args, &name, scenario, settings, |watch| {
            Ok(counted_piece(
                scenario,
                traffic,
                COUNTED_PIECE,
                seed,
                watch,
            )?)
        })?;
        let Some(made) = made else {
            return Ok(None);
        };
        all = all.plus(made);
    }
    Ok(Some(all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_a_world_that_fits_its_traffic() {
        for case in CASES {
            let world = (match case.text {
                Some(text) => Scenario::parse(case.name, text).ok(),
                None => Scenario::shipped(case.world).and_then(Result::ok),
            })
            .unwrap_or_else(|| panic!("{} has no world", case.name));
            let traffic = case.traffic(&world);
            assert!(traffic.is_ok(), "{}: {:?}", case.name, traffic.err());
        }
    }
}
