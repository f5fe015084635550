//! The driving worlds: several training seeds each, beside baselines.

use serde_json::json;

use super::{Failure, Made, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{
    CaseStudies, WorldResult, case_studies_markdown, case_study, deeper_search, trained_contacts,
};

/// The driving worlds of the table, in its order.
const WORLDS: [&str; 10] = [
    "acc",
    "merge_fair",
    "merge",
    "yellow_light",
    "yellow_light_fixed",
    "pedestrian",
    "cut_in",
    "sandwich",
    "light_ado",
    "bend",
];

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let runs = study.runs();
    let request = CaseStudies {
        seeds: study.seeds(),
        starts: study.starts(),
        runs: &runs,
    };
    let (mut studies, mut results, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for name in &study.worlds_or(WORLDS) {
        let scenario = study.world(name)?;
        let mut depends = DigestProbe::of_training(name);
        let settings = || study.settings(json!({ "starts": request.starts }));
        // The piece is a file name, so an interrupted table resumes by world.
        let piece = format!("{name}, case study");
        let made = study.once(&piece, &scenario, &depends, settings(), |watch| {
            Ok(case_study(&scenario, &request, watch)?)
        })?;
        let piece = format!("{name}, three switches");
        let deeper = study.once(&piece, &scenario, &depends, settings(), |watch| {
            Ok(deeper_search(&scenario, &request, watch)?)
        })?;
        // The pieces above ask no reference driver, and outlive a change of them.
        depends.insert(DigestProbe::Drivers);
        let piece = format!("{name}, contacts");
        let contacts = study.once(&piece, &scenario, &depends, settings(), |watch| {
            Ok(trained_contacts(&scenario, &request, watch)?)
        })?;
        let (Some(made), Some(contacts), Some(deeper)) = (made, contacts, deeper) else {
            return Ok(None);
        };
        // Intervals follow from the rows, so a kept piece gets those of this version.
        let measured = made.made.with_intervals();
        let result = WorldResult::of(&measured, &contacts.made, deeper.made);
        // The clock of a piece misses the trainings that an earlier command finished.
        let cpu_s = measured.cpu_s() + contacts.cpu_s + deeper.cpu_s;
        let only = format!(" --world {name}");
        rows.push(study.row(name, &only, depends, cpu_s, &result));
        results.push(result);
        studies.push(measured);
    }
    Ok(Some(Made {
        rows,
        markdown: format!(
            "With {}.\n\n{}",
            request.seeds,
            case_studies_markdown(&studies, &results)
        ),
        json: json!({ "case_studies": studies, "worlds": results }),
    }))
}
