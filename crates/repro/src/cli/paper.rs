//! The paper's own rows of the driving scenes that no other study has.

use std::collections::BTreeSet;

use serde_json::json;

use super::{Failure, Made, StudyPiece, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{PaperRow, measure_paper_row, paper_rows_markdown};
use brakecheck::world::PlantKind;

/// Beyond the paper's numbers of episodes: where the curves still rise.
const MORE: [u64; 4] = [1_000, 2_000, 4_000, 8_000];

/// Row of the paper.
struct OfPaper {
    world: &'static str,
    /// Learner of the row. `None`: the world's own.
    learner: Option<&'static str>,
    /// The paper's text.
    paper: &'static str,
    /// The paper's numbers of episodes.
    episodes: &'static [u64],
    /// Plant of training and test. `None`: the world's own.
    plant: Option<PlantKind>,
}

const ROWS: [OfPaper; 3] = [
    OfPaper {
        world: "acc",
        learner: Some("q_table"),
        paper: "ACC, Q-table: 55.79 % in 4.83 h",
        episodes: &[],
        // A table takes millions of decisions, which are slow on rigid bodies.
        plant: Some(PlantKind::Kinematic),
    },
    OfPaper {
        world: "merge",
        learner: None,
        paper: "merge: 71 / 72.35 / 75.76 % after 106 / 206 / 371 episodes",
        episodes: &[106, 206, 371],
        plant: None,
    },
    OfPaper {
        world: "yellow_light",
        learner: Some("dqn"),
        paper: "yellow light: ~60 / 64 % after 162 / 247 episodes",
        episodes: &[162, 247],
        plant: None,
    },
];

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let seeds = study.seeds();
    let (mut measured, mut rows) = (Vec::new(), Vec::new());
    for of in ROWS.iter().filter(|row| study.wants(row.world)) {
        let mut scenario = study.world(of.world)?;
        if let Some(learner) = of.learner {
            let none = || {
                let what = format!("`{}` has no learner `{learner}`", of.world);
                Failure::input(what, "use the worlds that came with this version")
            };
            scenario = scenario.learning_by(learner).ok_or_else(none)?;
        }
        if let Some(plant) = of.plant {
            scenario = scenario.on(plant);
        }
        // Only rows with episode counts have a curve to continue.
        let more = MORE.iter().filter(|_| !of.episodes.is_empty());
        let episodes: Vec<u64> = of.episodes.iter().chain(more).copied().collect();
        let row = PaperRow {
            paper: of.paper,
            scenario: &scenario,
            episodes: &episodes,
        };
        let learner = DigestProbe::Learner {
            world: of.world.to_owned(),
            learner: of.learner.map(str::to_owned),
        };
        // Nothing is searched here, so the probe of searches is left out.
        let world = DigestProbe::World(of.world.to_owned());
        let depends = BTreeSet::from([world, learner, DigestProbe::Intervals]);
        let settings = study.settings(json!({
            "starts": study.starts(), "learner": of.learner, "episodes": episodes,
        }));
        let name = format!("{} {}", of.world, scenario.learner().name());
        let piece = format!("{}, {}", of.world, scenario.learner().name());
        let made = study.once(&piece, &scenario, &depends, settings, |watch| {
            Ok(measure_paper_row(&row, seeds, study.starts(), watch))
        })?;
        let Some(StudyPiece { cpu_s, made }) = made else {
            return Ok(None);
        };
        let only = format!(" --world {}", of.world);
        rows.push(study.row(&name, &only, depends, cpu_s, &made));
        measured.push(made);
    }
    Ok(Some(Made {
        rows,
        markdown: format!("With {seeds}.\n\n{}", paper_rows_markdown(&measured)),
        json: json!({ "paper_rows": measured }),
    }))
}
