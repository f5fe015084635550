//! World and trained ado of a run, and copies of both.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use brakecheck_driver_model::{ModelError, TrafficModel};

use super::{RunDir, RunError};
use crate::natural::NaturalTraining;
use crate::rl::{LearnerConfig, Policy, TensorFile, load_policy_for};
use crate::ron_file::LoadError;
use crate::run_files::disk::{io_error, make_dir, write_file};
use crate::run_files::{BANK, KNOWN, MANIFEST, TIMING};
use crate::world::Scenario;

impl RunDir {
    /// Returns the world of the training, on its plant.
    ///
    /// # Errors
    ///
    /// Returns an error if this version cannot use the world file.
    pub fn scenario(&self) -> Result<Scenario, RunError> {
        let world = self.world()?;
        // The world file names its own plant, and a training may have chosen another.
        Ok(match self.manifest.plant.plant() {
            Some(plant) => world.on(plant),
            None => world,
        })
    }

    /// Consents to start the programs that the world and its changes name.
    pub fn allow_programs(&mut self, allowed: bool) {
        // A parsed world takes the consent over, so it is not parsed again.
        if let Some(world) = self.world.take() {
            self.world = OnceLock::from(world.allow_programs(allowed));
        }
        self.programs_allowed = allowed;
    }

    /// Makes foreign egos of the world and its changes begin every episode anew.
    pub fn begin_egos_anew(&mut self) {
        if let Some(world) = self.world.take() {
            self.world = OnceLock::from(world.with_fresh_egos());
        }
        self.fresh_egos = true;
    }

    /// Returns the world on the plant of its file.
    ///
    /// It is read and parsed at the first call only, because a dry run of a large
    /// world takes a second.
    ///
    /// # Errors
    ///
    /// Returns an error if this version cannot use the world file.
    pub fn world(&self) -> Result<Scenario, RunError> {
        if let Some(world) = self.world.get() {
            return Ok(world.clone());
        }
        let world = self.parse_world()?;
        // Another thread may have parsed it meanwhile, and both then share one.
        Ok(self.world.get_or_init(|| world).clone())
    }

    /// Reads and parses the world file.
    fn parse_world(&self) -> Result<Scenario, RunError> {
        let file = self.path.join("world.ron");
        match Scenario::load(&file) {
            Ok(scenario) => {
                let allowed = scenario.allow_programs(self.programs_allowed);
                let own = if self.fresh_egos {
                    allowed.with_fresh_egos()
                } else {
                    allowed
                };
                let world = self.as_learned(own)?;
                self.as_limited(world)
            }
            Err(LoadError::Io { source, .. }) => Err(io_error("reading", &file)(source)),
            Err(LoadError::Scenario(error)) => Err(RunError::World(error)),
        }
    }

    /// Returns the world with the limit on the ado's driving of the manifest.
    fn as_limited(&self, world: Scenario) -> Result<Scenario, RunError> {
        let Some(natural) = &self.manifest.natural else {
            return Ok(world);
        };
        trained_naturally(&world, natural).map_err(|error| RunError::Damaged {
            path: self.path.join("manifest.json"),
            why: error.to_string(),
        })
    }

    /// Returns the world with the goals, the learner and the family of the manifest.
    fn as_learned(&self, world: Scenario) -> Result<Scenario, RunError> {
        // The world and its goals fitted when the training began, so a misfit is damage.
        let goals = world.training_towards(&self.manifest.goals);
        let world = goals.map_err(|error| RunError::Damaged {
            path: self.path.join("manifest.json"),
            why: error.what,
        })?;
        let against = self.manifest.against;
        if !against.is_nominal() {
            let left_out = self.manifest.left_out.as_deref();
            let whole_or_less = match left_out {
                Some(structure) => world.leaving_out(structure),
                None => Some(world),
            };
            let learned = whole_or_less.and_then(|world| world.training_against(against));
            return learned.ok_or_else(|| RunError::Damaged {
                path: self.path.join("manifest.json"),
                why: format!("its world lacks the family that the {against} ado was trained on"),
            });
        }
        // A policy per ado may be an option of the training, of which the world says nothing.
        let settings = serde_json::from_value::<LearnerConfig>(self.manifest.settings.clone());
        // Settings of another version may not parse. The name of the learner then
        // decides.
        if let Ok(learner) = settings
            && learner.is_per_ado()
        {
            return Ok(world.learning_with(learner));
        }
        let Some(name) = &self.manifest.learner else {
            return Ok(world);
        };
        world.learning_by(name).ok_or_else(|| RunError::Damaged {
            path: self.path.join("manifest.json"),
            why: format!("its world has no learner `{name}`"),
        })
    }

    /// Returns the trained ado.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished or the file is damaged.
    pub fn policy(&self) -> Result<Box<dyn Policy>, RunError> {
        let (scenario, bundle) = (self.scenario()?, self.policy_bundle()?);
        load_policy_for(scenario.spaces(), &bundle).map_err(self.damaged("policy.safetensors"))
    }

    /// Returns the trained ado as stored.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished or the file is damaged.
    pub fn policy_bundle(&self) -> Result<TensorFile, RunError> {
        TensorFile::from_bytes(&self.policy_bytes()?).map_err(self.damaged("policy.safetensors"))
    }

    pub(super) fn policy_bytes(&self) -> Result<Vec<u8>, RunError> {
        let Some(expected) = &self.manifest.policy_sha256 else {
            return Err(self.unfinished());
        };
        self.read_verified("policy.safetensors", Some(expected))
    }

    /// Copies the files that playing the trained ado requires.
    ///
    /// These are the world, the policy, the manifest, and the other files that it seals as
    /// a whole, since a run without one of them is damaged.
    ///
    /// # Errors
    ///
    /// Returns an error if training has not finished, a file is damaged or
    /// writing fails.
    pub fn copy_to(&self, path: &Path) -> Result<(), RunError> {
        // All files are read first, so that a refusal leaves no directory.
        let policy = self.policy_bytes()?;
        let mut files = vec![
            ("world.ron", self.read_text("world.ron")?.into_bytes()),
            ("policy.safetensors", policy),
        ];
        let sealed = [
            ("from.safetensors", &self.manifest.from_sha256),
            (BANK, &self.manifest.bank_sha256),
            (KNOWN, &self.manifest.known_sha256),
        ];
        for (name, seal) in sealed {
            // A run that was begun without such a file names no hash of it.
            if seal.is_some() {
                files.push((name, self.read_verified(name, seal.as_deref())?));
            }
        }
        // The manifest is last: without it the directory is no run.
        for name in [TIMING, MANIFEST] {
            if self.path.join(name).is_file() {
                files.push((name, self.read_text(name)?.into_bytes()));
            }
        }
        make_dir(path)?;
        for (name, bytes) in files {
            write_file(&path.join(name), &bytes)?;
        }
        Ok(())
    }
}

/// Returns the world with the traffic and the limit of a training.
pub fn trained_naturally(
    world: &Scenario,
    training: &NaturalTraining,
) -> Result<Scenario, ModelError> {
    let model = TrafficModel::parse(&training.traffic)?;
    Ok(world
        .in_traffic(Arc::new(model))
        .naturally(training.per_1000_km))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_of_an_unfinished_run_leaves_no_directory() {
        let dir = tempfile::tempdir().expect("scratch");
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let run = RunDir::create(&dir.path().join("run"), &world, 7).expect("begun");
        let copy = dir.path().join("copy");
        let refused = run.copy_to(&copy);
        assert!(matches!(refused, Err(RunError::Unfinished { .. })));
        assert!(!copy.exists());
    }
}
