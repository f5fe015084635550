//! Directory of a plan, and execution of its pieces.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::time::Instant;

use cpu_time::ThreadTime;
use serde_json::json;

use super::error::CampaignError;
use super::piece::{Heading, PieceText, Unusable};
use super::plan::{CampaignPiece, FORMAT, Plan, Unit, Work};
use super::play::{LoadedAdo, UnitContext};
use super::trivial_blocks::TrivialBlocks;
use super::{piece, training};
use crate::content_hash::{check, sha256};
use crate::experiment::{EgoUnderTest, Watch, consent, on_plant};
use crate::ron_file::file_text;
use crate::run_dir::{
    ProgramContents, RunDir, RunError, bind_programs, stored_programs, write_file,
};
use crate::testbench::FaultLog;
use crate::world::Scenario;

/// Name of the plan's file.
pub(super) const PLAN: &str = "plan.json";

/// Planned campaign on disk.
pub struct PlanDir {
    pub(super) dir: PathBuf,
    pub(super) plan: Plan,
    /// Worlds on the plants of their files.
    worlds: Vec<Scenario>,
    /// Worlds on the requested plants.
    played: Vec<Scenario>,
    /// Trivial starts of each world.
    trivial: Vec<TrivialBlocks>,
    /// Largest accepted share of invalid episodes in a piece.
    allowed: f64,
    /// Contents of the programs that are egos, as bound in the directory.
    pub(super) programs: Mutex<ProgramContents>,
}

/// Result of running a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceDone {
    /// The piece existed already, complete and valid.
    Before,
    /// The piece was made by this call.
    Now,
    /// The run was stopped.
    Stopped,
}

impl PlanDir {
    /// Opens the directory of a plan and verifies its files.
    ///
    /// `allow_programs` is the consent to start programs that the campaign names as egos.
    /// `allowed` is the largest accepted share of invalid episodes in a piece.
    ///
    /// # Errors
    /// Returns an error if there is no plan, if the plan or a world was changed, or if
    /// another version made the plan.
    pub fn open(dir: &Path, allow_programs: bool, allowed: f64) -> Result<PlanDir, CampaignError> {
        let path = dir.join(PLAN);
        let read = |path: &Path| {
            file_text(path).map_err(|source| RunError::Io {
                verb: "reading",
                path: path.into(),
                source,
            })
        };
        if !path.is_file() {
            return Err(CampaignError::NoPlan { dir: dir.into() });
        }
        let text = read(&path)?;
        let damaged = |path: &Path, why: String| RunError::Damaged {
            path: path.into(),
            why,
        };
        let plan: Plan =
            serde_json::from_str(&text).map_err(|error| damaged(&path, error.to_string()))?;
        // The seal is verified before anything in the plan is used.
        check(&text, &plan.sha256).map_err(|why| damaged(&path, why))?;
        let version = env!("CARGO_PKG_VERSION");
        // Another version may play differently, and its rows must not be mixed with these.
        if plan.brakecheck != version || plan.format != FORMAT {
            return Err(CampaignError::OtherVersion {
                dir: dir.into(),
                planned: plan.brakecheck,
            });
        }
        let mut worlds = Vec::new();
        let mut played = Vec::new();
        for planned in &plan.worlds {
            let path = dir.join(&planned.file);
            let text = read(&path)?;
            if sha256(text.as_bytes()) != planned.sha256 {
                let why = "it is another world than was planned: restore it, or plan again";
                return Err(damaged(&path, why.to_owned()).into());
            }
            // Consent is never stored in the plan, so each run must give it.
            let world = Scenario::load(&path)?.allow_programs(allow_programs);
            played.push(match planned.plant {
                Some(plant) => on_plant(&world, plant)?,
                None => world.clone(),
            });
            worlds.push(world);
        }
        let trivial = (0..worlds.len()).map(|world| TrivialBlocks::new(dir, &plan, world));
        Ok(PlanDir {
            trivial: trivial.collect(),
            programs: Mutex::new(stored_programs(dir)?.unwrap_or_default()),
            dir: dir.into(),
            plan,
            worlds,
            played,
            allowed,
        })
    }

    /// Returns the plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the path of the directory.
    pub fn path(&self) -> &Path {
        &self.dir
    }

    /// Reads the file of a piece, if it exists and is valid.
    pub(super) fn read(
        &self,
        piece: &CampaignPiece,
    ) -> Result<Result<PieceText, Unusable>, RunError> {
        let question = self.question(&piece.work);
        let read = piece::read(&self.dir, piece.number, &question)?;
        Ok(read.and_then(|text| {
            if text.heading.piece == piece.number {
                Ok(text)
            } else {
                // A file may answer the same question under another piece's name.
                Err(Unusable::Foreign)
            }
        }))
    }

    /// Returns the hash of everything that the result of a piece depends on.
    ///
    /// The content of a program is part of it, as bound in this directory.
    pub(super) fn question(&self, work: &Work) -> String {
        // A poisoned lock has complete contents, because each write is a single call.
        let programs = self.programs.lock().unwrap_or_else(PoisonError::into_inner);
        self.question_with(work, &programs)
    }

    /// Returns the hash as in [`PlanDir::question`], with the contents of other programs.
    pub(super) fn question_with(&self, work: &Work, programs: &ProgramContents) -> String {
        let question = self.plan.question(work);
        let Work::Starts { unit, .. } = work else {
            return question;
        };
        let unit = self.plan.units.get(*unit);
        match unit.and_then(|unit| programs.get(&self.program_name(unit))) {
            Some(program) => sha256(format!("{question}{}", program.sha256).as_bytes()),
            None => question,
        }
    }

    /// Returns the name of a unit's ego among the programs of the campaign.
    fn program_name(&self, unit: &Unit) -> String {
        format!("{} in {}", unit.ego.name, self.played(unit).name())
    }

    /// Binds the pieces to the contents of the programs that are their egos.
    ///
    /// # Errors
    /// Returns an error if a program has another content than that of earlier pieces.
    pub(super) fn bind_programs(&self, watch: &Watch<'_>) -> Result<(), CampaignError> {
        let mut contents = ProgramContents::new();
        for unit in &self.plan.units {
            let name = self.program_name(unit);
            // Many units share an ego, and the files of its program are hashed once.
            if contents.contains_key(&name) {
                continue;
            }
            if let Some(content) = self.ego(unit)?.program_content() {
                if !content.not_covered.is_empty() {
                    let missing = content.not_covered.join("; ");
                    watch.note(&format!(
                        "warning: the pieces of `{name}` are not bound to {missing}"
                    ));
                }
                contents.insert(name, content);
            }
        }
        // Before the first piece a changed program is no contradiction and is bound anew.
        let has_pieces = self.dir.join(piece::PIECES).exists();
        bind_programs(&self.dir, &contents, has_pieces)?;
        let programs = self.programs.lock();
        programs
            .unwrap_or_else(PoisonError::into_inner)
            .extend(contents);
        Ok(())
    }

    /// Makes a piece unless it exists.
    ///
    /// # Errors
    /// Returns an error if the number is unknown, if a required training is unfinished, if
    /// the ego does not run, or if a file cannot be written.
    pub fn run_piece(&self, number: usize, watch: &Watch<'_>) -> Result<PieceDone, CampaignError> {
        let Some(piece) = self
            .plan
            .piece(number)
            .filter(|it| it.number < self.plan.len())
        else {
            return Err(CampaignError::NoPiece {
                number,
                pieces: self.plan.len(),
            });
        };
        // A piece's question contains the program's hash, so the read below needs the
        // binding.
        self.bind_programs(watch)?;
        // An existing piece is never made again, so retries of an engine are harmless.
        if self.read(&piece)?.is_ok() {
            return Ok(PieceDone::Before);
        }
        self.make(&piece, watch)
    }

    /// Plays or trains a piece and writes its file.
    pub(super) fn make(
        &self,
        piece: &CampaignPiece,
        watch: &Watch<'_>,
    ) -> Result<PieceDone, CampaignError> {
        let began = Instant::now();
        // Faults are counted per piece, so an ego that does not run spoils only its own pieces.
        let own = Watch {
            faults: FaultLog::allowing_in_part(self.allowed),
            ..watch.quiet()
        };
        let question = self.question(&piece.work);
        let (rows, policy_sha256, cpu_s) = match &piece.work {
            Work::Training(training) => {
                let clock = ThreadTime::now();
                let Some(run) = self.train(*training, &own)? else {
                    return Ok(PieceDone::Stopped);
                };
                let spent_s = clock.elapsed().as_secs_f64();
                (Vec::new(), run.manifest().policy_sha256.clone(), spent_s)
            }
            Work::Starts { unit, starts } => {
                let stage = self.stage(*unit)?;
                let blocks = &self.trivial[stage.unit.world];
                let trivial = blocks.of(starts, &self.plan, stage.world, &own);
                let played = stage.play(starts.clone(), trivial, &own)?;
                let hash = stage.ado.map(|ado| ado.sha256);
                // The fault check comes before the rows, so a faulty piece leaves no file.
                if let Some(complaint) = own.faults.complaint() {
                    return Err(CampaignError::Faults {
                        piece: Some(piece.number),
                        complaint,
                    });
                }
                let Some(played) = played else {
                    return Ok(PieceDone::Stopped);
                };
                (played.rows, hash, played.cpu_s)
            }
        };
        let heading = Heading {
            piece: piece.number,
            question,
            policy_sha256,
        };
        piece::write(&self.dir, &heading, &rows)?;
        self.note_cost(piece, began, cpu_s)?;
        Ok(PieceDone::Now)
    }

    /// Writes machine and cost of a piece to a file beside it.
    ///
    /// The merge does not read this file.
    fn note_cost(&self, piece: &CampaignPiece, began: Instant, cpu_s: f64) -> Result<(), RunError> {
        let path = piece::path_of(&self.dir, piece.number).with_extension("cost.json");
        // Only Linux has this file. Elsewhere the name stays empty, because costs are no
        // results.
        let machine = fs::read_to_string("/proc/sys/kernel/hostname");
        let cost = json!({
            "machine": machine.as_deref().map_or("", str::trim),
            "target": std::env::consts::ARCH,
            "wall_s": began.elapsed().as_secs_f64(),
            "cpu_s": cpu_s,
        });
        write_file(&path, format!("{cost}\n").as_bytes())
    }

    fn train(&self, nth: usize, watch: &Watch<'_>) -> Result<Option<RunDir>, CampaignError> {
        let planned = &self.plan.trainings[nth];
        let path = training::dir_of(&self.dir, &self.plan, planned);
        training::train(&path, &self.played[planned.world], planned, watch)
    }

    /// Assembles a unit with its ego and its ado.
    fn stage(&self, unit: usize) -> Result<UnitContext<'_>, CampaignError> {
        let unit = &self.plan.units[unit];
        let (world, ego) = (&self.worlds[unit.world], self.ego(unit)?);
        let ado = self.ado(unit)?;
        consent(world, std::slice::from_ref(&ego))?;
        Ok(UnitContext {
            plan: &self.plan,
            unit,
            world,
            ego,
            ado,
        })
    }

    pub(super) fn ego(&self, unit: &Unit) -> Result<EgoUnderTest, CampaignError> {
        let (name, change) = (&unit.ego.name, &unit.ego.change);
        let help = "the plan was made with another world";
        Ok(EgoUnderTest::changed(
            &self.played[unit.world],
            name,
            change,
            help,
        )?)
    }

    /// Returns the world of a unit on the plant of its file.
    pub(super) fn world(&self, unit: &Unit) -> &Scenario {
        &self.worlds[unit.world]
    }

    /// Returns the world of a unit on the requested plant.
    pub(super) fn played(&self, unit: &Unit) -> &Scenario {
        &self.played[unit.world]
    }

    /// Loads the trained ado of a unit, if any.
    fn ado(&self, unit: &Unit) -> Result<Option<LoadedAdo>, CampaignError> {
        let (run, planned) = match (unit.ado.run, unit.ado.training) {
            (Some(run), _) => {
                let run = &self.plan.ados[run];
                let there = training::finished(&self.dir.join(&run.dir))?;
                (there, Some(&run.policy_sha256))
            }
            (None, Some(training)) => (self.trained(training)?, None),
            (None, None) => return Ok(None),
        };
        let sha256 = run.manifest().policy_sha256.clone().unwrap_or_default();
        // The copy in the plan's directory may have been replaced since.
        if planned.is_some_and(|planned| *planned != sha256) {
            return Err(RunError::Damaged {
                path: run.path().into(),
                why: "it is another ado than was planned".to_owned(),
            }
            .into());
        }
        Ok(Some(LoadedAdo {
            policy: run.policy()?,
            seed: run.manifest().seed,
            sha256,
        }))
    }

    /// Opens the finished training that a piece depends on.
    fn trained(&self, training: usize) -> Result<RunDir, CampaignError> {
        let planned = &self.plan.trainings[training];
        let path = training::dir_of(&self.dir, &self.plan, planned);
        training::finished(&path).map_err(|error| match error {
            // Only these two are mended by running the training, and a damaged run is
            // not.
            RunError::NotARun { .. } | RunError::Unfinished { .. } => {
                CampaignError::Untrained { training, error }
            }
            other => other.into(),
        })
    }
}
