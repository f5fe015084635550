//! Differences between a run's beginning and the current request.
//!
//! A training only continues as it began: with the same version on the same
//! kind of machine, the same world and the same settings. Otherwise it would
//! end in a policy that no single command reproduces.

use serde_json::Value;

use super::manifest::settings_of;
use super::{ChangedEgo, RunDifference, RunDir, RunError};
use crate::content_hash::sha256;
use crate::natural::NaturalTraining;
use crate::world::{Scenario, TrainingGoal};

/// Requested training.
#[derive(Clone, Copy, Debug)]
pub struct RequestedTraining<'a> {
    /// World, with its plant, its learner and its training opponent.
    pub scenario: &'a Scenario,
    /// Training seed.
    pub seed: u64,
    /// Changed ego. `None` for the world's own.
    pub ego: Option<&'a ChangedEgo>,
}

impl RunDir {
    /// Returns the differences between a requested training and this run.
    ///
    /// # Errors
    ///
    /// Returns an error if the run's world file cannot be read.
    pub fn differences(
        &self,
        requested: RequestedTraining<'_>,
    ) -> Result<Vec<RunDifference>, RunError> {
        let begun = self.manifest();
        let scenario = requested.scenario;
        let mut found = self.differences_in_learning(scenario)?;
        let mut compare = |what: &str, begun: String, now: String| {
            if begun != now {
                let what = what.to_owned();
                found.push(RunDifference { what, begun, now });
            }
        };
        compare("seed", begun.seed.to_string(), requested.seed.to_string());
        compare(
            "plant",
            begun.plant.to_string(),
            scenario.plant().to_string(),
        );
        let learner = |name: &Option<String>| match name {
            Some(name) => format!("`{name}`"),
            None => "the world's own".to_owned(),
        };
        compare(
            "learner",
            learner(&begun.learner),
            learner(&scenario.learning),
        );
        compare(
            "trained against",
            begun.against.to_string(),
            scenario.against.to_string(),
        );
        let natural = |natural: Option<&NaturalTraining>| match natural {
            Some(natural) => natural.to_string(),
            None => "no limit".to_owned(),
        };
        // Compared by value, because the words have only the first digits of a hash.
        let now = NaturalTraining::of(scenario.traffic());
        if begun.natural != now {
            let (begun, now) = (natural(begun.natural.as_ref()), natural(now.as_ref()));
            compare("natural driving", begun, now);
        }
        let left_out = |name: &Option<String>| match name {
            Some(name) => format!("`{name}`"),
            None => "nothing".to_owned(),
        };
        compare(
            "left out",
            left_out(&begun.left_out),
            left_out(&scenario.left_out),
        );
        let ego = |ego: Option<&ChangedEgo>| match ego {
            Some(ego) => format!("`{}`", ego.name),
            None => "nominal".to_owned(),
        };
        compare("ego", ego(begun.ego.as_ref()), ego(requested.ego));
        // Other names are a difference already, which says more than their fields.
        if let (Some(was), Some(is)) = (&begun.ego, requested.ego)
            && was.name == is.name
        {
            // A file of the same name may hold another change.
            let value = |ego: &ChangedEgo| serde_json::to_value(&ego.change).unwrap_or_default();
            let mut note = |what, begun, now| found.push(RunDifference { what, begun, now });
            leaves("ego", &value(was), &value(is), &mut note);
        }
        // Only the hash of the settings is kept. It is compared last, because
        // any difference above explains it.
        let settings = settings_of(scenario);
        if found.is_empty()
            && begun
                .settings_fingerprint
                .as_ref()
                .is_some_and(|was| *was != settings)
        {
            found.push(RunDifference {
                what: "settings of the learner or the family".to_owned(),
                begun: begun.settings_fingerprint.clone().unwrap_or_default(),
                now: settings,
            });
        }
        Ok(found)
    }

    /// Returns the differences that every training is checked for.
    ///
    /// These are the world file and the learner's settings and, until training
    /// is finished, the program.
    ///
    /// # Errors
    ///
    /// Returns an error if the run's world file cannot be read.
    pub fn differences_in_learning(
        &self,
        scenario: &Scenario,
    ) -> Result<Vec<RunDifference>, RunError> {
        let begun = self.manifest();
        let mut found = Vec::new();
        let mut note = |what: String, begun: String, now: String| {
            found.push(RunDifference { what, begun, now });
        };
        // Other versions may use a finished policy.
        if !begun.is_finished() {
            let (version, target) = (super::version(), super::target());
            if begun.brakecheck != version {
                note("version".to_owned(), begun.brakecheck.clone(), version);
            }
            if begun.target != target {
                note("machine".to_owned(), begun.target.clone(), target);
            }
        }
        if begun.world_sha256 != sha256(scenario.text.as_bytes()) {
            let kept = self.read_text("world.ron")?;
            let (line, begun, now) = first_line(&kept, &scenario.text);
            note(format!("world file, line {line}"), begun, now);
        }
        let goals = |goals: &[TrainingGoal]| {
            if goals.is_empty() {
                "none".to_owned()
            } else {
                let words: Vec<&str> = goals.iter().map(<&str>::from).collect();
                words.join(" and ")
            }
        };
        if begun.goals != scenario.goals {
            let (begun, now) = (goals(&begun.goals), goals(&scenario.goals));
            note("training goals".to_owned(), begun, now);
        }
        let now = serde_json::to_value(&scenario.learner).unwrap_or_default();
        leaves("learner", &begun.settings, &now, &mut note);
        Ok(found)
    }

    /// Refuses to continue as a different training.
    ///
    /// # Errors
    ///
    /// Returns [`RunError::Differs`] if there are differences.
    pub fn must_be_of(&self, requested: RequestedTraining<'_>) -> Result<(), RunError> {
        self.refuse(self.differences(requested)?)
    }

    /// Returns an error for a list of differences, unless it is empty.
    pub fn refuse(&self, differences: Vec<RunDifference>) -> Result<(), RunError> {
        if differences.is_empty() {
            Ok(())
        } else {
            Err(RunError::Differs {
                path: self.path().into(),
                differences,
            })
        }
    }
}

/// First line in which two texts differ, counted from 1.
fn first_line(begun: &str, now: &str) -> (usize, String, String) {
    let (mut old, mut new) = (begun.lines(), now.lines());
    for line in 1.. {
        let shown = |text: Option<&str>| match text {
            Some(text) => format!("`{}`", text.trim()),
            None => "the end".to_owned(),
        };
        match (old.next(), new.next()) {
            (None, None) => break,
            (was, is) if was != is => return (line, shown(was), shown(is)),
            _ => {}
        }
    }
    // The texts differ in line ends only.
    (begun.lines().count(), "as it was".into(), "as it is".into())
}

/// Reports every value in which two trees of settings differ.
fn leaves(path: &str, begun: &Value, now: &Value, note: &mut impl FnMut(String, String, String)) {
    match (begun, now) {
        (Value::Object(old), Value::Object(new)) => {
            let names = old
                .keys()
                .chain(new.keys().filter(|name| !old.contains_key(*name)));
            for name in names {
                let side = |map: &serde_json::Map<String, Value>| {
                    // A setting of another version is missing on one side, and reads as
                    // null there.
                    map.get(name).cloned().unwrap_or_default()
                };
                leaves(&format!("{path}.{name}"), &side(old), &side(new), note);
            }
        }
        _ if begun == now => {}
        _ => note(path.to_owned(), begun.to_string(), now.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_setting_that_differs_is_named_with_both_values() {
        let begun = json!({ "Dqn": { "decisions": 300, "hidden": [64, 64], "huber": 1.0 } });
        let now = json!({ "Dqn": { "decisions": 300, "hidden": [64], "steps": 3, "huber": 1.0 } });
        let mut found = Vec::new();
        leaves("learner", &begun, &now, &mut |what, begun, now| {
            found.push(format!("{what}: {begun}, now {now}"));
        });
        assert_eq!(
            found,
            [
                "learner.Dqn.hidden: [64,64], now [64]",
                "learner.Dqn.steps: null, now 3"
            ]
        );
    }

    /// A change of a default is refused, whatever types are called.
    #[test]
    fn settings_that_a_world_file_leaves_open_must_be_as_they_were() {
        let (dir, text) = (
            tempfile::tempdir().expect("scratch"),
            include_str!("../../../../worlds/acc.ron"),
        );
        let world = Scenario::parse("acc.ron", text).expect("a world");
        let mut run = RunDir::create(&dir.path().join("run"), &world, 7).expect("begun");
        let requested = || RequestedTraining {
            scenario: &world,
            seed: 7,
            ego: None,
        };
        run.must_be_of(requested()).expect("the same");
        // Another version of the program had another default of the family.
        let mut family = serde_json::json!({ "learner": world.learner, "family": world.family() });
        assert_eq!(
            crate::content_hash::fingerprint(&family),
            settings_of(&world)
        );
        family["family"]["nominal_share"] = json!(0.25);
        run.manifest.settings_fingerprint = Some(crate::content_hash::fingerprint(&family));
        let error = run.must_be_of(requested()).expect_err("another family");
        assert!(
            error.to_string().contains("the learner or the family"),
            "{error}"
        );
        // An earlier version noted nothing that could be compared.
        run.manifest.settings_fingerprint = None;
        run.must_be_of(requested()).expect("not known to differ");
    }

    /// A run directory that was begun holds this: it changes when a setting is
    /// added that is always written, and not when a type is renamed.
    #[test]
    fn the_identity_of_settings_lasts() {
        let learner = crate::rl::LearnerConfig::new(crate::rl::DqnSettings::default());
        let learner = json!(learner.expect("in range"));
        assert_eq!(
            crate::content_hash::fingerprint(&learner),
            "57004fdae0b031ed5999275518ccc9c78350110c9fc180749b1e5dd8e128919f"
        );
    }

    #[test]
    fn the_first_line_that_differs_is_shown() {
        let shown = |(line, begun, now): (usize, String, String)| format!("{line}: {begun} {now}");
        assert_eq!(shown(first_line("a\n b\nc", "a\n d\nc")), "2: `b` `d`");
        assert_eq!(shown(first_line("a\n", "a\nb\n")), "2: the end `b`");
        assert_eq!(shown(first_line("a\nb", "a\nb\n")), "2: as it was as it is");
    }
}
