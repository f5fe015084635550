//! Table I: RQ1 to RQ5 on both readings of the grid world.

use serde_json::json;

use super::{Failure, MOST_SEEDS, Made, ReproduceArgs, once, world};
use crate::{PaperScale, Table1, Table1Error, table1, table1_markdown};

/// The grid worlds of Table I, the headline first.
const WORLDS: [&str; 2] = ["grid_hard", "grid"];

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let request = Table1 {
        seeds: args.seeds_within(MOST_SEEDS),
        scale: PaperScale::PAPER,
    };
    let mut studies = Vec::new();
    for name in WORLDS {
        let scenario = world(args, name)?;
        let settings = json!({
            "seeds": request.seeds.count, "first_seed": request.seeds.first,
            "start_seed": request.seeds.starts,
        });
        let piece = format!("{name}, Table I");
        let made = once(args, &piece, &scenario, settings, |watch| {
            Ok(table1(&scenario, &request, watch)?)
        })?;
        let Some(study) = made else {
            return Ok(None);
        };
        studies.push(study);
    }
    Ok(Some(Made {
        name: "table1",
        markdown: table1_markdown(&studies),
        json: json!({ "table1": studies }),
    }))
}

impl From<Table1Error> for Failure {
    fn from(error: Table1Error) -> Failure {
        match error {
            Table1Error::Train(error) => error.into(),
            Table1Error::NotAGrid(_) | Table1Error::Change(_) | Table1Error::NotSolvable(_) => {
                Failure::input(
                    error.to_string(),
                    "Table I is made from the shipped `grid.ron` and `grid_hard.ron`",
                )
            }
        }
    }
}
