//! Starts whose outcome depends on the plant, world by world.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, once, settings, world};
use crate::{PlantRow, plant_row, plants_markdown, with_validated_bodies};
use brakecheck::experiment::test_starts;
use brakecheck::scene::Dynamics;
use brakecheck::world::Scenario;

/// Test starts per world, at most.
const MOST_STARTS: usize = 100;

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(1);
    let starts = args.starts.min(MOST_STARTS);
    let mut rows: Vec<PlantRow> = Vec::new();
    for name in args.worlds_or(Scenario::shipped_names()) {
        let scenario = world(args, &name)?;
        // Grid worlds have no plant.
        if ![Dynamics::Rigid, Dynamics::Kinematic].contains(&scenario.plant()) {
            continue;
        }
        let validated = with_validated_bodies(&scenario)?;
        let own = settings(seeds, json!({ "starts": starts, "table": "plants" }));
        let made = once(args, &format!("{name}, plants"), &scenario, own, |watch| {
            let drawn = test_starts(&scenario, seeds.starts, starts, watch);
            Ok(drawn.and_then(|drawn| plant_row(&scenario, validated.as_ref(), &drawn, watch)))
        })?;
        let Some(row) = made else {
            return Ok(None);
        };
        rows.push(row);
    }
    Ok(Some(Made {
        name: "plants",
        markdown: format!(
            "With test starts of seed {}.\n\n{}",
            seeds.starts,
            plants_markdown(&rows)
        ),
        json: json!({ "plants": rows }),
    }))
}
