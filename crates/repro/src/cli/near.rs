//! Starts near the failing starts of the paper, for its claim of generalisation.

use serde_json::json;

use super::{Failure, Made, StudyPiece, StudyRun};
use crate::record::probe::DigestProbe;
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

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let (mut all, mut rows) = (Vec::new(), Vec::new());
    for (name, wanted) in FAILING.iter().filter(|(name, _)| study.wants(name)) {
        let scenario = study.world(name)?;
        // A world from `--worlds` may lack these axes.
        let around = start_with(&scenario, wanted).map_err(|error| {
            Failure::input(
                error.to_string(),
                "use the worlds that came with this version",
            )
        })?;
        let depends = DigestProbe::of_training(name);
        let own = json!({ "starts": study.starts(), "deltas": DELTAS });
        let piece = format!("{name}, near starts");
        let made = study.once(&piece, &scenario, &depends, study.settings(own), |watch| {
            near(study, &scenario, &around, watch)
        })?;
        let Some(StudyPiece { cpu_s, made }) = made else {
            return Ok(None);
        };
        let only = format!(" --world {name}");
        rows.push(study.row(name, &only, depends, cpu_s, &made));
        all.push(made);
    }
    Ok(Some(Made {
        rows,
        markdown: format!("With {}.\n\n{}", study.seeds(), near_starts_markdown(&all)),
        json: json!({ "near_starts": all }),
    }))
}

/// Plays the first trained ado near the failing start of a world. `None` if stopped.
fn near(
    study: &StudyRun<'_>,
    scenario: &Scenario,
    around: &Start,
    watch: &Watch<'_>,
) -> Result<Option<NearFailing>, Failure> {
    let seeds = study.seeds();
    let (path, _) = trained_run(scenario, seeds.first, &study.runs(), watch)?;
    let starts = test_starts(scenario, seeds.starts, study.starts(), watch);
    // An interrupted training has no policy.
    let (Some(starts), false) = (starts, watch.stopped()) else {
        return Ok(None);
    };
    let run = RunDir::open(&path)?;
    let policy = run.policy()?;
    let alumnus = TrainedPolicy {
        policy: &*policy,
        seed: run.manifest().seed,
        // The starts of a training follow from its seed and the number of its episodes.
        episodes: run.manifest().episodes,
    };
    Ok(near_starts(
        scenario, alumnus, around, &starts, &DELTAS, watch,
    ))
}
