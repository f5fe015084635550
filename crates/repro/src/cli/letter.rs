//! The paper's learning to the letter, and the way from it to the defaults.

use std::collections::BTreeSet;

use serde_json::json;

use super::{Failure, Made, StudyRun};
use crate::record::probe::DigestProbe;
use crate::{
    CaseStudies, JUDGES, LETTER_PATHS, LetterBaselines, LetterError, LetterPath, LetterRow,
    LetterStudy, LetterStudyError, letter_baselines, letter_markdown, letter_row,
};
use brakecheck::experiment::test_starts;

pub(super) fn run(study: &StudyRun<'_>) -> Result<Option<Made>, Failure> {
    let (mut studies, mut recorded) = (Vec::new(), Vec::new());
    let paths = LETTER_PATHS.iter().enumerate();
    for (at, path) in paths.filter(|(_, path)| study.wants(path.world)) {
        let letter = study.world(path.world)?;
        let last = path.changes.len();
        let steps: Vec<usize> = if study.args.every_step {
            (0..=last).collect()
        } else {
            path.ends().collect()
        };
        // The probe of a step covers its world and its learner, which have no others here.
        let mut depends = BTreeSet::from([DigestProbe::Search, DigestProbe::Intervals]);
        depends.extend(steps.iter().map(|step| DigestProbe::Letter {
            path: at,
            step: *step,
        }));
        // Before the steps, which are compared with the search among these rows.
        let Some((baselines, first_s)) = baselines(study, path, letter.text())? else {
            return Ok(None);
        };
        let steps = LetterSteps {
            path,
            steps,
            depends: &depends,
            baselines: &baselines,
        };
        let Some((rows, second_s)) = steps.rows(study, letter.text())? else {
            return Ok(None);
        };
        let made = LetterStudy {
            world: path.world.to_owned(),
            learner: path.learner.map(str::to_owned),
            switches: path.switches,
            baselines,
            rows,
        };
        let name = format!("{} {}", path.world, path.learner_name());
        let only = format!(" --world {}", path.world);
        let cpu_s = first_s + second_s;
        recorded.push(study.row(&name, &only, depends.clone(), cpu_s, &made.ends()));
        studies.push(made);
    }
    Ok(Some(Made {
        rows: recorded,
        markdown: format!("With {}.\n\n{}", study.seeds(), letter_markdown(&studies)),
        json: json!({ "letter": studies }),
    }))
}

/// Plays a search and untrained ados under both judges, and returns `None` if stopped.
fn baselines(
    study: &StudyRun<'_>,
    path: &LetterPath,
    text: &str,
) -> Result<Option<(Vec<LetterBaselines>, f64)>, Failure> {
    // Baselines need no learner: paths of one world share them.
    let first = LETTER_PATHS.iter().position(|it| it.world == path.world);
    let letter = DigestProbe::Letter {
        path: first.unwrap_or_default(),
        step: 0,
    };
    let depends = BTreeSet::from([DigestProbe::Search, letter]);
    let unlearned = (LetterPath {
        learner: None,
        changes: &[],
        ..*path
    })
    .steps(text)?;
    let (mut baselines, mut cpu_s) = (Vec::new(), 0.0);
    for judge in JUDGES {
        // Step 0 is the letter itself, without any change.
        let scenario = unlearned[0].judged_by(judge)?;
        let own = json!({ "starts": study.starts(), "switches": path.switches });
        let piece = format!("{}, {judge}", path.world);
        let made =
            study.once(&piece, &scenario, &depends, study.settings(own), |watch| {
                let starts = test_starts(&scenario, study.seeds().starts, study.starts(), watch);
                Ok(starts
                    .and_then(|starts| letter_baselines(&scenario, path.switches, &starts, watch)))
            })?;
        let Some(made) = made else {
            return Ok(None);
        };
        cpu_s += made.cpu_s;
        baselines.push(made.made);
    }
    Ok(Some((baselines, cpu_s)))
}

/// Steps of a path that are trained.
struct LetterSteps<'a> {
    path: &'a LetterPath,
    steps: Vec<usize>,
    depends: &'a BTreeSet<DigestProbe>,
    baselines: &'a [LetterBaselines],
}

impl LetterSteps<'_> {
    /// Returns a row for each step, with the processor time. `None`: stopped.
    fn rows(
        &self,
        study: &StudyRun<'_>,
        text: &str,
    ) -> Result<Option<(Vec<LetterRow>, f64)>, Failure> {
        let learner = self.path.learner_name();
        let (mut rows, mut cpu_s) = (Vec::new(), 0.0);
        let all = self.path.steps(text)?;
        for &at in &self.steps {
            let step = &all[at];
            let scenario = step.scenario()?;
            let own = json!({ "starts": study.starts() });
            let piece = format!("{}, {learner}, step {at}", self.path.world);
            let runs = study.runs().join(format!("{learner}-step-{at}"));
            let request = CaseStudies {
                seeds: study.seeds(),
                starts: study.starts(),
                // Steps of a path train in worlds of the same name, so each needs a
                // directory.
                runs: &runs,
            };
            let settings = study.settings(own);
            let made = study.once(&piece, &scenario, self.depends, settings, |watch| {
                Ok(letter_row(step, self.baselines, &request, watch)?)
            })?;
            let Some(made) = made else {
                return Ok(None);
            };
            cpu_s += made.cpu_s;
            rows.push(made.made);
        }
        Ok(Some((rows, cpu_s)))
    }
}

impl From<LetterError> for Failure {
    fn from(error: LetterError) -> Failure {
        match error {
            LetterError::World(error) => error.into(),
            other => Failure::input(
                other.to_string(),
                "use the worlds that came with this version",
            ),
        }
    }
}

impl From<LetterStudyError> for Failure {
    fn from(error: LetterStudyError) -> Failure {
        match error {
            LetterStudyError::Step(error) => error.into(),
            LetterStudyError::Train(error) => error.into(),
        }
    }
}
