//! Starts near the failing starts of the paper, for its claim of generalisation.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, headed, once, world};
use crate::{
    NearFailing, TrainedPolicy, near_starts, near_starts_markdown, start_with, trained_run,
};
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::run_dir::RunDir;
use brakecheck::scene::Start;
use brakecheck::world::Scenario;

/// World, and the paper's failing start (v_ego, v_ado, distance along the road).
///
/// The merge's distance of 16 m is Euclidean, from the next lane.
const FAILING: [(&str, [(&str, f64); 3]); 2] = [
    (
        "acc",
        [
            ("ego.speed", 12.0),
            ("ado.speed", 12.0),
            ("ado.headway", 15.0),
        ],
    ),
    (
        "merge",
        [
            ("ego.speed", 12.0),
            ("ado.speed", 12.0),
            ("ado.headway", 15.612),
        ],
    ),
];
const DELTAS: [f64; 4] = [0.1, 0.03, 0.01, 0.003];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    // One trained ado is looked at: the first.
    let seeds = args.seeds_within(1);
    let mut all = Vec::new();
    for (name, wanted) in FAILING {
        let scenario = world(args, name)?;
        // A world from `--worlds` may lack these axes.
        let around = start_with(&scenario, &wanted).map_err(|error| {
            Failure::input(
                error.to_string(),
                "use the worlds that came with this version",
            )
        })?;
        let settings = json!({
            "seed": seeds.first, "start_seed": seeds.starts, "starts": args.starts,
            "deltas": DELTAS,
        });
        let piece = format!("{name}, near starts");
        let made = once(args, &piece, &scenario, settings, |watch| {
            near(args, &scenario, &around, watch)
        })?;
        let Some(near) = made else {
            return Ok(None);
        };
        all.push(near);
    }
    Ok(Some(Made {
        name: "near-starts",
        markdown: headed(seeds, &near_starts_markdown(&all)),
        json: json!({ "near_starts": all }),
    }))
}

/// Plays the trained ado near the failing start of a world. `None` if stopped.
fn near(
    args: &ReproduceArgs,
    scenario: &Scenario,
    around: &Start,
    watch: &Watch<'_>,
) -> Result<Option<NearFailing>, Failure> {
    let seeds = args.seeds_within(1);
    let (path, _) = trained_run(scenario, seeds.first, &args.output.join("runs"), watch)?;
    let starts = test_starts(scenario, seeds.starts, args.starts, watch);
    // An interrupted training has no policy.
    let (Some(starts), false) = (starts, watch.stopped()) else {
        return Ok(None);
    };
    let run = RunDir::open(&path)?;
    let policy = run.policy()?;
    let alumnus = TrainedPolicy {
        policy: &*policy,
        seed: run.manifest().seed,
        episodes: run.manifest().episodes,
    };
    Ok(near_starts(
        scenario, alumnus, around, &starts, &DELTAS, watch,
    ))
}
