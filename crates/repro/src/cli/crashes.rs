//! Crashes that reference drivers avoid, world by world.

use serde_json::json;

use super::{Failure, Made, StudyPiece, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{CaseStudies, CrashStudyError, crash_study, crashes_markdown};

/// The worlds whose crashes are worth acting on.
const WORLDS: [&str; 4] = ["acc_iso", "cut_in_clear", "merge_r157", "pedestrian_hit"];

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let runs = study.runs();
    let request = CaseStudies {
        seeds: study.seeds(),
        starts: study.starts(),
        runs: &runs,
    };
    let (mut studies, mut rows) = (Vec::new(), Vec::new());
    for name in &study.worlds_or(WORLDS) {
        let scenario = study.world(name)?;
        let mut depends = DigestProbe::of_training(name);
        // Reference drivers judge every crash, so another driver outdates the rows.
        depends.insert(DigestProbe::Drivers);
        let settings = study.settings(json!({ "starts": request.starts }));
        // The piece is a file, so an interrupted study goes on with the next world.
        let piece = format!("{name}, crashes");
        let made = study.once(&piece, &scenario, &depends, settings, |watch| {
            let found = crash_study(&scenario, &request, watch);
            found.map_err(|error| match error {
                CrashStudyError::Train(error) => error.into(),
                CrashStudyError::Change(error) => {
                    Failure::input(error.to_string(), "use a world with a vehicle as its ego")
                }
            })
        })?;
        let Some(StudyPiece { cpu_s, made }) = made else {
            return Ok(None);
        };
        let only = format!(" --world {name}");
        rows.push(study.row(name, &only, depends, cpu_s, &made));
        studies.push(made);
    }
    Ok(Some(Made {
        rows,
        markdown: format!("With {}.\n\n{}", request.seeds, crashes_markdown(&studies)),
        json: json!({ "crashes": studies }),
    }))
}
