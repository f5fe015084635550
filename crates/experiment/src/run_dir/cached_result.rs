//! Finished work, kept so that an interrupted campaign can continue.

use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::manifest::settings_of;
use super::{ProgramContent, RunError};
use crate::content_hash;
use crate::content_hash::sha256;
use crate::ron_file::file_bytes;
use crate::run_files::disk::{file_name, io_error, make_dir, write_file};
use crate::world::Scenario;

/// Piece of work: a file, and the question that it answers.
///
/// A file is reused only for the same question about the same world file, with
/// the same defaults and program version. The content of an external ego
/// program is part of the question.
#[derive(Clone, Debug)]
pub struct CachedResult {
    path: PathBuf,
    request: Value,
}

impl CachedResult {
    /// Returns the work of a name in a directory, for a world and its settings.
    pub fn new(dir: &Path, name: &str, scenario: &Scenario, settings: Value) -> CachedResult {
        let mut request = json!({
            "brakecheck": env!("CARGO_PKG_VERSION"),
            "world_sha256": sha256(scenario.text.as_bytes()),
            "settings_sha256": settings_of(scenario),
            "name": name,
            "asked": settings,
        });
        if let Some(program) = scenario.program() {
            // The world file names the program, and its content may change beside it.
            request["program_sha256"] = json!(ProgramContent::of(program).sha256);
        }
        CachedResult {
            path: dir.join(format!("{}.json", file_name(name))),
            request,
        }
    }

    /// Returns the result, if it is there and answers this question.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses, or the file is damaged
    /// ([`RunError::Damaged`]).
    pub fn read<T: DeserializeOwned>(&self) -> Result<Option<T>, RunError> {
        let bytes = match file_bytes(&self.path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            read => read.map_err(io_error("reading", &self.path))?,
        };
        let damaged = |why: String| RunError::Damaged {
            path: self.path.clone(),
            why,
        };
        let json = |error: serde_json::Error| damaged(error.to_string());
        let text = String::from_utf8(bytes).map_err(|error| damaged(error.to_string()))?;
        let mut kept: Value = serde_json::from_str(&text).map_err(json)?;
        // The file is read as a tree, which would let an unknown field pass.
        let known = ["asked", "made", "seal", "sha256"];
        let mut fields = kept.as_object().into_iter().flatten();
        if let Some((name, _)) = fields.find(|(name, _)| !known.contains(&name.as_str())) {
            return Err(damaged(format!("unknown field `{name}`")));
        }
        // Checked before the hash: work for another question is stale, not
        // damaged.
        if kept["asked"] != self.request {
            return Ok(None);
        }
        let found = self.hash(&kept["made"]);
        if kept["sha256"] != found {
            let stated = &kept["sha256"];
            return Err(damaged(format!(
                "it was changed since it was written: SHA-256 is {found}, it says {stated}"
            )));
        }
        // A missing seal is checked as an empty one, and fails.
        let seal = kept["seal"].as_str().unwrap_or_default();
        content_hash::check(&text, seal).map_err(damaged)?;
        let made = serde_json::from_value(kept["made"].take());
        made.map(Some).map_err(json)
    }

    /// Keeps a result, and replaces older work of that name.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn write<T: Serialize>(&self, made: &T) -> Result<(), RunError> {
        if let Some(dir) = self.path.parent() {
            make_dir(dir)?;
        }
        let made = serde_json::to_value(made).map_err(|error| RunError::Damaged {
            path: self.path.clone(),
            why: error.to_string(),
        })?;
        let hash = self.hash(&made);
        let kept = json!({
            "asked": self.request,
            "made": made,
            "seal": content_hash::BLANK,
            "sha256": hash,
        });
        // The seal comes after the result, which may be a row of zeros.
        let sealed = content_hash::seal_last(&kept.to_string());
        write_file(&self.path, sealed.as_bytes())
    }

    /// Hash of question and result, without processor times.
    ///
    /// Equal work has equal hashes. The seal covers the complete file,
    /// including the times.
    fn hash(&self, made: &Value) -> String {
        let mut made = made.clone();
        forget_times(&mut made);
        sha256(format!("{}{made}", self.request).as_bytes())
    }
}

fn forget_times(value: &mut Value) {
    match value {
        Value::Object(map) => {
            for (name, value) in map {
                // Names of processor times end so, such as `train_cpu_s`.
                if name.ends_with("cpu_s") {
                    *value = Value::Null
                } else {
                    forget_times(value)
                }
            }
        }
        Value::Array(all) => all.iter_mut().for_each(forget_times),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const WORLD: &str = include_str!("../../../../worlds/acc.ron");

    fn of(dir: &Path, text: &str, seeds: u64) -> CachedResult {
        let scenario = Scenario::parse("acc.ron", text).expect("a world");
        CachedResult::new(dir, "acc, a table", &scenario, json!({ "seeds": seeds }))
    }

    #[test]
    fn work_is_found_again_by_the_very_question_only() {
        let dir = tempfile::tempdir().expect("scratch");
        let work = of(dir.path(), WORLD, 3);
        assert_eq!(work.read::<Vec<f64>>().expect("no file yet"), None);
        work.write(&vec![0.1, 2.0 / 3.0]).expect("written");
        let read = work.read::<Vec<f64>>().expect("readable");
        assert_eq!(read, Some(vec![0.1, 2.0 / 3.0]));
        let other = of(dir.path(), WORLD, 4).read::<Vec<f64>>();
        assert_eq!(other.expect("readable"), None);
        let changed = WORLD.replace("kp_per_s2: 0.3,", "kp_per_s2: 0.31,");
        let other = of(dir.path(), &changed, 3).read::<Vec<f64>>();
        assert_eq!(other.expect("readable"), None);
    }

    #[test]
    fn a_result_of_many_zeros_is_found_again() {
        let dir = tempfile::tempdir().expect("scratch");
        let work = of(dir.path(), WORLD, 3);
        for zeros in [64, 200] {
            let made = "0".repeat(zeros);
            work.write(&made).expect("written");
            assert_eq!(work.read::<String>().expect("readable"), Some(made));
        }
    }

    #[test]
    fn a_number_that_was_changed_is_noticed() {
        let dir = tempfile::tempdir().expect("scratch");
        let work = of(dir.path(), WORLD, 3);
        work.write(&0.25).expect("written");
        let path = dir.path().join("acc--a-table.json");
        let text = fs::read_to_string(&path).expect("kept");
        fs::write(&path, text.replace("0.25", "0.35")).expect("changed");
        let error = work.read::<f64>().expect_err("changed").to_string();
        assert!(error.contains("changed since it was written"), "{error}");
    }

    #[test]
    fn a_damaged_file_is_named() {
        let dir = tempfile::tempdir().expect("scratch");
        let work = of(dir.path(), WORLD, 3);
        work.write(&1.0).expect("written");
        let path = dir.path().join("acc--a-table.json");
        let text = fs::read_to_string(&path).expect("kept");
        fs::write(&path, &text[..text.len() - 4]).expect("cut");
        let error = work.read::<f64>().expect_err("cut off");
        assert!(error.to_string().contains("acc--a-table.json"), "{error}");
    }

    /// Tables are made again from such files, so a killed one must not leave half a result.
    #[test]
    fn work_that_is_killed_at_any_step_is_old_or_new_and_goes_on() {
        use crate::run_files::disk_faults::{StepFailure, failing};

        let write = |dir: &Path, made: f64| of(&dir.join("parts"), WORLD, 3).write(&made).is_ok();
        let undisturbed = tempfile::tempdir().expect("scratch");
        let all = || write(undisturbed.path(), 1.0) && write(undisturbed.path(), 2.0);
        let (done, steps) = failing(undisturbed.path(), u64::MAX, StepFailure::Killed, all);
        assert!(done && steps > 4, "{steps} steps");
        for how in [StepFailure::Killed, StepFailure::Refused] {
            for at in 1..=steps {
                let dir = tempfile::tempdir().expect("scratch");
                let all = || write(dir.path(), 1.0) && write(dir.path(), 2.0);
                let (done, _) = failing(dir.path(), at, how, all);
                let read = of(&dir.path().join("parts"), WORLD, 3)
                    .read::<f64>()
                    .unwrap_or_else(|error| panic!("{how:?} at {at}: {error}"));
                assert!(!done || read == Some(2.0), "{how:?} at {at}: {read:?}");
                assert!(write(dir.path(), 2.0), "{how:?} at {at}");
                let file = |dir: &Path| fs::read(dir.join("parts/acc--a-table.json"));
                let (whole, again) = (file(undisturbed.path()), file(dir.path()));
                assert_eq!(whole.expect("a file"), again.expect("a file"));
            }
        }
    }
}
