//! Directory of a population, on the disk.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::manifest::{
    ArchiveSummary, FORMAT, PopulationManifest, PopulationMember, PopulationOrigin,
};
use crate::content_hash::sha256;
use crate::ron_file::file_bytes;
use crate::run_dir::{
    MANIFEST, MEMBERS, POPULATION, RunDir, RunError, make_dir, version, write_file,
};
use crate::run_files::append_log::{Growing, Grown, verified};
use crate::run_files::disk::{io_error, is_taken, lock, remove, sweep};
use crate::world::Scenario;

/// Open directory of a population.
#[derive(Debug)]
pub struct PopulationDir {
    path: PathBuf,
    manifest: PopulationManifest,
    coverage: Growing,
    _lock: Option<File>,
}

impl PopulationDir {
    /// Returns whether a directory contains a population.
    pub fn is_population(path: &Path) -> bool {
        path.join(POPULATION).is_file()
    }

    /// Makes a directory for `requested` members and locks it.
    ///
    /// # Errors
    /// It exists with content, or the disk refuses.
    pub fn create(
        path: &Path,
        scenario: &Scenario,
        seed: u64,
        origin: PopulationOrigin,
        requested: usize,
    ) -> Result<PopulationDir, RunError> {
        if is_taken(path) {
            return Err(RunError::Exists { path: path.into() });
        }
        make_dir(path)?;
        // The lock precedes the first file, so that two processes never write both.
        let lock = lock(path)?;
        let log = path.join(origin.curve_file());
        let population = PopulationDir {
            path: path.into(),
            manifest: PopulationManifest {
                format: FORMAT,
                sha256: String::new(),
                brakecheck: version(),
                world: scenario.name().to_owned(),
                world_sha256: sha256(scenario.text.as_bytes()),
                plant: scenario.plant(),
                seed,
                origin,
                requested,
                members: Vec::new(),
                archive: None,
                coverage: Grown::default(),
                finished: false,
            },
            coverage: Growing::new(log),
            _lock: Some(lock),
        };
        // Written at once, so that a killed process leaves a population to resume.
        population.write_manifest()?;
        Ok(population)
    }

    /// Opens a population for reading, and verifies its files and its members' manifests.
    ///
    /// # Errors
    /// The directory contains no population, or a file is damaged.
    pub fn open(path: &Path) -> Result<PopulationDir, RunError> {
        let manifest = PopulationManifest::read(path)?;
        let population = PopulationDir {
            path: path.into(),
            coverage: Growing::new(path.join(manifest.origin.curve_file())),
            manifest,
            _lock: None,
        };
        population.verify()?;
        Ok(population)
    }

    /// Opens a population to continue it.
    ///
    /// Lines of the coverage after the last entry of the manifest are removed.
    ///
    /// # Errors
    /// As [`PopulationDir::open`], or another process trains in it.
    pub fn resume(path: &Path) -> Result<PopulationDir, RunError> {
        // Without a population, no lock file is made.
        PopulationManifest::read(path)?;
        let lock = lock(path)?;
        // Read again under the lock, because another process may have written until then.
        let mut population = PopulationDir::open(path)?;
        population._lock = Some(lock);
        // A killed process may have left unfinished files.
        sweep(path);
        let known = &population.manifest.coverage;
        let log = path.join(population.manifest.origin.curve_file());
        population.coverage = Growing::cut_back(log, known)?;
        Ok(population)
    }

    fn verify(&self) -> Result<(), RunError> {
        let manifest = &self.manifest;
        // Other files of a member are verified by its manifest when the member is opened.
        for (number, member) in manifest.members.iter().enumerate() {
            let file = self.member_path(number).join(MANIFEST);
            self.read_verified(&file, &member.manifest_sha256)?;
        }
        if let Some(archive) = &manifest.archive {
            self.read_verified(&self.path.join(&archive.file), &archive.sha256)?;
        }
        self.curve_bytes().map(|_| ())
    }

    /// Returns the valid part of the growing file.
    ///
    /// # Errors
    /// It is missing or damaged.
    pub(super) fn curve_bytes(&self) -> Result<Vec<u8>, RunError> {
        let manifest = &self.manifest;
        let log = self.path.join(manifest.origin.curve_file());
        verified(&log, &manifest.coverage, manifest.finished)
    }

    /// Appends lines to the growing file and records them.
    ///
    /// # Errors
    /// The disk refuses.
    pub(super) fn record(&mut self, lines: &str) -> Result<(), RunError> {
        self.append_coverage(lines)?;
        self.write_manifest()
    }

    fn read_verified(&self, file: &Path, expected: &str) -> Result<Vec<u8>, RunError> {
        let bytes = file_bytes(file).map_err(io_error("reading", file))?;
        let found = sha256(&bytes);
        if found == expected {
            return Ok(bytes);
        }
        Err(RunError::Damaged {
            path: file.into(),
            why: format!("SHA-256 is {found}, `{POPULATION}` says {expected}"),
        })
    }

    /// Returns the path of the directory.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the manifest.
    pub fn manifest(&self) -> &PopulationManifest {
        &self.manifest
    }

    /// Returns the directory of a member, from 0, finished or not.
    pub fn member_path(&self, number: usize) -> PathBuf {
        self.path.join(MEMBERS).join(format!("{number:03}"))
    }

    /// Opens the first `count` finished members, or all if there are fewer.
    ///
    /// # Errors
    /// A member is damaged.
    pub fn members(&self, count: usize) -> Result<Vec<RunDir>, RunError> {
        let count = count.min(self.manifest.members.len());
        let members = (0..count).map(|number| RunDir::open(&self.member_path(number)));
        members.collect()
    }

    /// Records the next member, whose training is finished.
    ///
    /// # Errors
    /// Its training is not finished, or the disk refuses.
    pub fn add_member(&mut self) -> Result<(), RunError> {
        let path = self.member_path(self.manifest.members.len());
        // An unfinished training has no policy.
        RunDir::open(&path)?.policy_bundle()?;
        let file = path.join(MANIFEST);
        let bytes = file_bytes(&file).map_err(io_error("reading", &file))?;
        self.manifest.members.push(PopulationMember {
            manifest_sha256: sha256(&bytes),
        });
        self.write_manifest()
    }

    /// Appends lines to the coverage. They are valid once the manifest is written.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn append_coverage(&mut self, lines: &str) -> Result<(), RunError> {
        if lines.is_empty() {
            return Ok(());
        }
        self.coverage.append(lines)?;
        self.manifest.coverage = self.coverage.now();
        Ok(())
    }

    /// Writes the archive under a new name, and then removes the old file.
    ///
    /// `describe` gets the name and the SHA-256 of the file.
    ///
    /// # Errors
    /// The disk refuses. The old archive is then still valid.
    pub fn save_archive(
        &mut self,
        name: &str,
        bytes: &[u8],
        describe: impl FnOnce(String, String) -> ArchiveSummary,
    ) -> Result<(), RunError> {
        write_file(&self.path.join(name), bytes)?;
        let summary = describe(name.to_owned(), sha256(bytes));
        let before = self.manifest.archive.replace(summary);
        // Until this, the manifest names the old file, which is removed only afterwards.
        self.write_manifest()?;
        // A file that was written under its old name must stay.
        match before.filter(|before| before.file != name) {
            Some(before) => {
                let path = self.path.join(before.file);
                remove(&path).map_err(io_error("removing", &path))
            }
            None => Ok(()),
        }
    }

    /// Returns the content of the archive's file. `None` if there is none.
    ///
    /// # Errors
    /// The file is missing or damaged.
    pub fn archive_bytes(&self) -> Result<Option<Vec<u8>>, RunError> {
        let archive = self.manifest.archive.as_ref();
        let read = |it: &ArchiveSummary| self.read_verified(&self.path.join(&it.file), &it.sha256);
        archive.map(read).transpose()
    }

    /// Records that the process has ended.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn finish(&mut self) -> Result<(), RunError> {
        self.manifest.finished = true;
        self.write_manifest()
    }

    fn write_manifest(&self) -> Result<(), RunError> {
        let file = self.path.join(POPULATION);
        let text = self.manifest.sealed().map_err(|error| RunError::Damaged {
            path: file.clone(),
            why: error.to_string(),
        })?;
        write_file(&file, text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rl::LearnerConfig;
    use crate::run_dir::Done;

    fn world() -> Scenario {
        Scenario::shipped("acc").expect("shipped").expect("sound")
    }

    /// A finished member of an ado that learned nothing.
    fn train(population: &PopulationDir, number: usize) {
        let world = world();
        let path = population.member_path(number);
        let mut run = RunDir::create(&path, &world, number as u64).expect("a new run");
        let learner = LearnerConfig::default();
        let policy = learner.build(world.spaces(), 1).policy_bundle();
        run.save_policy(&policy, Done::default()).expect("written");
    }

    fn create(path: &Path) -> PopulationDir {
        let origin = PopulationOrigin::Distinct { simulations: 10 };
        PopulationDir::create(path, &world(), 7, origin, 2).expect("created")
    }

    fn archive(file: String, sha256: String) -> ArchiveSummary {
        ArchiveSummary {
            cells: 1,
            failures: 2,
            simulations: 3,
            file,
            sha256,
        }
    }

    #[test]
    fn members_are_ordinary_runs_and_the_directory_is_not() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("population");
        let mut population = create(&path);
        let unfinished = RunDir::create(&population.member_path(0), &world(), 0);
        drop(unfinished.expect("a new run"));
        assert!(population.add_member().is_err(), "no policy yet");
        std::fs::remove_dir_all(population.member_path(0)).expect("removed");
        train(&population, 0);
        population.add_member().expect("finished");
        drop(population);
        let error = RunDir::open(&path).expect_err("a population");
        assert!(matches!(error, RunError::Population { .. }), "{error}");
        assert!(error.help().expect("a fix").contains("members/000"));
        let open = PopulationDir::open(&path).expect("sound");
        assert_eq!(
            (open.manifest().members.len(), open.manifest().requested),
            (1, 2)
        );
        let members = open.members(5).expect("sound");
        assert_eq!(members.len(), 1);
        assert!(members[0].policy_bundle().is_ok());
    }

    #[test]
    fn any_changed_file_is_detected() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("population");
        let mut population = create(&path);
        train(&population, 0);
        population.add_member().expect("finished");
        population.append_coverage("{}\n").expect("written");
        population
            .save_archive("archive-1.json", b"one", archive)
            .expect("written");
        population
            .save_archive("archive-2.json", b"two", archive)
            .expect("written");
        population.finish().expect("written");
        drop(population);
        assert!(!path.join("archive-1.json").exists());
        for name in [
            "population.json",
            "archive-2.json",
            "coverage.jsonl",
            "members/000/manifest.json",
        ] {
            let file = path.join(name);
            let good = std::fs::read(&file).expect("a file");
            let mut bad = good.clone();
            let last = bad.len() - 2;
            bad[last] ^= 1;
            std::fs::write(&file, bad).expect("written");
            assert!(PopulationDir::open(&path).is_err(), "{name}");
            std::fs::write(&file, good).expect("written");
        }
        let open = PopulationDir::open(&path).expect("sound");
        assert_eq!(open.archive_bytes().expect("sound"), Some(b"two".to_vec()));
    }

    #[test]
    fn lines_and_archives_that_the_manifest_does_not_name_are_forgotten() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("population");
        let mut population = create(&path);
        population.append_coverage("{}\n").expect("written");
        population
            .save_archive("archive-1.json", b"one", archive)
            .expect("written");
        // A process that is killed here has written a line that no manifest counts.
        population.append_coverage("torn").expect("written");
        assert!(PopulationDir::resume(&path).is_err(), "in use");
        drop(population);
        let mut again = PopulationDir::resume(&path).expect("sound");
        again.append_coverage("[]\n").expect("written");
        again.finish().expect("written");
        let text = std::fs::read_to_string(path.join("coverage.jsonl")).expect("a file");
        assert_eq!(text, "{}\n[]\n");
        drop(again);
        PopulationDir::open(&path).expect("sound");
    }
}
