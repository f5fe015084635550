//! Table I: RQ1 to RQ5 on both readings of the grid world.

use std::collections::BTreeSet;

use serde_json::json;

use super::{Failure, Made, StudyPiece, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{PaperScale, Table1, Table1Error, table1, table1_markdown};

/// The grid worlds of Table I, the headline first.
const WORLDS: [&str; 2] = ["grid_hard", "grid"];

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let request = Table1 {
        seeds: study.seeds(),
        scale: PaperScale::PAPER,
    };
    let (mut studies, mut rows) = (Vec::new(), Vec::new());
    for name in WORLDS {
        let scenario = study.world(name)?;
        let learner = |learner: Option<&str>| DigestProbe::Learner {
            world: name.to_owned(),
            learner: learner.map(str::to_owned),
        };
        let mut depends =
            BTreeSet::from([DigestProbe::World(name.to_owned()), DigestProbe::Intervals]);
        depends.insert(learner(None));
        // Each learner that the world names has rows of its own.
        depends.extend(scenario.learners().keys().map(|key| learner(Some(key))));
        let piece = format!("{name}, Table I");
        // The extent is that of the paper, so only the seeds can differ.
        let settings = study.settings(json!({}));
        let made = study.once(&piece, &scenario, &depends, settings, |watch| {
            Ok(table1(&scenario, &request, watch)?)
        })?;
        let Some(StudyPiece { cpu_s, made }) = made else {
            return Ok(None);
        };
        // The study plays both worlds at once, so no option selects one of them.
        rows.push(study.row(name, "", depends, cpu_s, &made.captures()));
        studies.push(made);
    }
    Ok(Some(Made {
        rows,
        markdown: table1_markdown(&studies),
        json: json!({ "table1": studies }),
    }))
}

impl From<Table1Error> for Failure {
    fn from(error: Table1Error) -> Failure {
        match error {
            Table1Error::Train(error) => error.into(),
            Table1Error::NotAGrid(_)
            | Table1Error::Change(_)
            | Table1Error::NotSolvable(_)
            | Table1Error::Unrelated => Failure::input(
                error.to_string(),
                "Table I is made from the shipped `grid.ron` and `grid_hard.ron`",
            ),
        }
    }
}
