//! The paper's remark on generalisation: starts near its failing ones.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, talk, world};
use crate::campaign::{
    Alumnus, Watch, near_starts, near_starts_markdown, start_with, test_starts, trained_run,
};
use crate::run::RunDir;

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
/// The training whose ado is looked at.
const SEED: u64 = 1;
const DELTAS: [f64; 4] = [0.1, 0.03, 0.01, 0.003];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let mut all = Vec::new();
    for (name, wanted) in FAILING {
        let scenario = world(args, name)?;
        let around = start_with(&scenario, &wanted).map_err(|error| {
            Failure::input(
                error.to_string(),
                "use the worlds that came with this version",
            )
        })?;
        let bar = talk::bar(name, 0);
        let watch = Watch {
            progress: &|done, total| {
                bar.set_length(total);
                bar.set_position(done);
            },
            stop: talk::stop(),
        };
        let (path, _) = trained_run(&scenario, SEED, &args.output.join("runs"), &watch)?;
        let starts = test_starts(&scenario, 0, args.starts, &watch);
        let (Some(starts), false) = (starts, talk::stopped()) else {
            talk::say("interrupted: finished trainings are kept; run the same command to go on");
            return Ok(None);
        };
        let run = RunDir::open(&path)?;
        let policy = run.policy()?;
        let alumnus = Alumnus {
            policy: &*policy,
            seed: run.manifest().seed,
            episodes: run.manifest().episodes,
        };
        let near = near_starts(&scenario, alumnus, &around, &starts, &DELTAS, &watch);
        bar.finish_and_clear();
        let Some(near) = near else {
            talk::say("interrupted: nothing is written");
            return Ok(None);
        };
        all.push(near);
    }
    Ok(Some(Made {
        name: "near-starts",
        markdown: near_starts_markdown(&all),
        json: json!({ "near_starts": all }),
    }))
}
