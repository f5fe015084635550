//! The paper's own rows of the driving scenes.

use serde_json::json;

use super::{Failure, MOST_SEEDS, Made, ReproduceArgs, headed, once, world};
use crate::{PaperRow, measure_paper_row, paper_rows_markdown};

/// Beyond the paper's numbers of episodes: where the curves still rise.
const MORE: [u64; 4] = [1_000, 2_000, 4_000, 8_000];

/// World, learner (`None` for the world's own), the paper's text, its episodes.
const ROWS: [(&str, Option<&str>, &str, &[u64]); 7] = [
    ("acc", None, "ACC, DQN: 54.8 % in 1.93 h", &[]),
    (
        "acc",
        Some("q_table"),
        "ACC, Q-table: 55.79 % in 4.83 h",
        &[],
    ),
    (
        "acc_plain",
        None,
        "ACC, plain reward and state, all else the default",
        &[],
    ),
    (
        "merge",
        None,
        "merge: 71 / 72.35 / 75.76 % after 106 / 206 / 371 episodes",
        &[106, 206, 371],
    ),
    (
        "merge_plain",
        None,
        "merge, plain reward and state, all else the default",
        &[],
    ),
    (
        "yellow_light",
        Some("dqn"),
        "yellow light: ~60 / 64 % after 162 / 247 episodes",
        &[162, 247],
    ),
    (
        "yellow_light_plain",
        None,
        "yellow light, plain reward and state, all else the default",
        &[],
    ),
];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(MOST_SEEDS);
    let mut measured = Vec::new();
    for (name, learner, paper, episodes) in ROWS {
        let mut scenario = world(args, name)?;
        if let Some(learner) = learner {
            let none = || {
                let what = format!("`{name}` has no learner `{learner}`");
                Failure::input(what, "use the worlds that came with this version")
            };
            scenario = scenario.learning_by(learner).ok_or_else(none)?;
        }
        // Only rows with episode counts have a curve to continue.
        let more = MORE.iter().filter(|_| !episodes.is_empty());
        let episodes: Vec<u64> = episodes.iter().chain(more).copied().collect();
        let row = PaperRow {
            paper,
            scenario: &scenario,
            episodes: &episodes,
        };
        let settings = json!({
            "seeds": seeds.count, "first_seed": seeds.first, "start_seed": seeds.starts,
            "starts": args.starts, "learner": learner, "episodes": episodes,
        });
        let piece = format!("{name}, {}", scenario.learner().name());
        let made = once(args, &piece, &scenario, settings, |watch| {
            Ok(measure_paper_row(&row, seeds, args.starts, watch))
        })?;
        let Some(done) = made else {
            return Ok(None);
        };
        measured.push(done);
    }
    Ok(Some(Made {
        name: "paper-rows",
        markdown: headed(seeds, &paper_rows_markdown(&measured)),
        json: json!({ "paper_rows": measured }),
    }))
}
