//! Learners of single ados in a world file.

use super::check;
use crate::rl::{LearnerConfig, LearnerSettings, PerAdoSettings};
use crate::ron_file::{Problems, ValuePath};
use crate::scene::drive::DriveSpec;
use crate::world_file::ScenarioFile;

/// Returns the learner of a world, in which some ados may have one of their own.
///
/// The others then have the world's, each for itself.
pub(super) fn learner(
    problems: &mut Problems,
    file: &ScenarioFile,
    own: Vec<(String, ValuePath, LearnerSettings)>,
) -> LearnerConfig {
    let top = ValuePath::top().to("learner");
    let common = check::learner(problems, &top, &file.learner);
    if own.is_empty() {
        return common;
    }
    let decisions = common.decisions();
    let mut each = match file.learner.clone() {
        LearnerSettings::PerAdo(each) => each,
        learner => PerAdoSettings {
            decisions,
            learner: Box::new(learner),
            ..PerAdoSettings::default()
        },
    };
    for (name, place, learner) in own {
        // Each at its own place first, as the whole has a single place.
        check::learner(problems, &place, &learner);
        if each.ados.insert(name.clone(), learner).is_some() {
            let what = format!("`{name}` has two learners");
            let help = "leave it out here, or in the `ados` of `learner: PerAdo(…)`".to_owned();
            problems.add(&place, what, "second one", Some(help));
        }
    }
    check::learner(problems, &top, &LearnerSettings::PerAdo(each))
}

/// Refuses learners of ados that a world does not have.
pub(super) fn names(problems: &mut Problems, learner: &LearnerConfig, spec: &DriveSpec) {
    let LearnerSettings::PerAdo(each) = learner.clone().into() else {
        return;
    };
    let known: Vec<&str> = spec.action_sets().map(|(name, ..)| name).collect();
    let unknown = each
        .ados
        .keys()
        .filter(|name| !known.contains(&name.as_str()));
    for name in unknown {
        let place = ValuePath::top().to("learner").to("ados");
        problems.unknown(&place, "ado", name, &known);
    }
}
