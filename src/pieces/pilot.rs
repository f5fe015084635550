//! From a campaign file to a plan that is cut into pieces of about a size.

use std::path::Path;

use super::check::{Checked, check};
use super::dir::PLAN;
use super::engine;
use super::estimate;
use super::plan::{Plan, PlannedAdo, Unit};
use super::play::Stage;
use super::row::RowOutcome;
use crate::campaign::{CampaignError, EgoUnderTest, Watch, consent, on_plant};
use crate::run::{RunDir, RunError, make_dir, write_file};
use crate::scenario::{Scenario, file_text};
use crate::testbench::FaultLog;

/// How long a piece takes, unless told otherwise.
pub const PIECE_S: f64 = 10.0;
/// Starts that a pilot plays of a kind of unit, at most, and for how long.
const PILOT_STARTS: usize = 32;
const PILOT_S: f64 = 1.0;
/// Share of invalid episodes up to which a pilot has nothing to complain of.
const MOST_FAULTY: f64 = 0.99;
/// Bytes of a row, on average.
const ROW_BYTES: f64 = 420.0;

/// What a campaign will take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanCost {
    /// Pieces.
    pub pieces: usize,
    /// Trainings among them.
    pub trainings: usize,
    /// Starts in all.
    pub starts: u64,
    /// Processor time in all.
    pub cpu_s: f64,
    /// Bytes on the disk: pieces and the merged file.
    pub bytes: f64,
    /// Whether it was measured; else guessed from the worlds.
    pub measured: bool,
}

/// Units whose starts take about as long: one of them is measured.
#[derive(PartialEq)]
struct Kind {
    world: usize,
    ado: PlannedAdo,
    /// A program may be far slower than any other ego.
    program: Option<Vec<String>>,
}

/// A campaign that is cut into pieces, before it is written.
pub struct Cut {
    checked: Checked,
    /// What it will take.
    pub cost: PlanCost,
}

impl Plan {
    /// Reads a campaign file and cuts it into pieces of about `piece_s` seconds.
    ///
    /// Without `piece_s` a pilot measures what a start takes, on a few starts of
    /// every world, ado and program as an ego, and pieces take [`PIECE_S`]. With it nothing is
    /// played: the plan follows from the file alone, and is the same anywhere.
    /// `None`: stopped.
    ///
    /// # Errors
    /// The file, or something that it names, is wrong; or an ego never runs in the
    /// pilot.
    pub fn make(
        path: &Path,
        piece_s: Option<f64>,
        allow_programs: bool,
        watch: &Watch<'_>,
    ) -> Result<Option<Cut>, CampaignError> {
        let mut checked = check(path)?;
        let worlds = std::mem::take(&mut checked.worlds);
        checked.worlds = worlds
            .into_iter()
            .map(|it| it.allow_programs(allow_programs))
            .collect();
        let measured = piece_s.is_none();
        let mut known: Vec<(Kind, f64)> = Vec::new();
        let (mut units, mut cpu_s) = (checked.plan.units.clone(), 0.0);
        for (nth, unit) in units.iter_mut().enumerate() {
            (watch.progress)(nth as u64, checked.plan.units.len() as u64);
            let ego = checked.ego(unit)?;
            let kind = Kind {
                world: unit.world,
                ado: unit.ado.clone(),
                program: ego.scenario().program().map(|it| it.command.clone()),
            };
            let known_s = known.iter().find(|(other, _)| measured && *other == kind);
            let start_s = match known_s {
                Some((_, start_s)) => *start_s,
                None => {
                    let Some(start_s) = checked.start_s(unit, ego, measured, watch)? else {
                        return Ok(None);
                    };
                    known.push((kind, start_s));
                    start_s
                }
            };
            let fits = (piece_s.unwrap_or(PIECE_S) / start_s).ceil();
            unit.each = (fits.max(1.0) as usize).min(unit.starts.max(1));
            cpu_s += start_s * unit.starts as f64;
        }
        checked.plan.units = units;
        let plan = &checked.plan;
        for training in &plan.trainings {
            let decisions = checked.worlds[training.world].learner().decisions();
            cpu_s += estimate::training_s(training, decisions);
        }
        let starts: u64 = plan.units.iter().map(|unit| unit.starts as u64).sum();
        let cost = PlanCost {
            pieces: plan.len(),
            trainings: plan.trainings.len(),
            starts,
            cpu_s,
            bytes: 2.0 * ROW_BYTES * starts as f64,
            measured,
        };
        Ok(Some(Cut { checked, cost }))
    }
}

impl Checked {
    fn ego(&self, unit: &Unit) -> Result<EgoUnderTest, CampaignError> {
        let as_filed = &self.worlds[unit.world];
        let played = match self.plan.plant(unit) {
            Some(plant) => on_plant(as_filed, plant)?,
            None => as_filed.clone(),
        };
        let (name, change) = (&unit.ego.name, &unit.ego.change);
        EgoUnderTest::changed(&played, name, change, "mend the campaign")
    }

    /// What a start of a unit takes. `None`: stopped.
    fn start_s(
        &self,
        unit: &Unit,
        ego: EgoUnderTest,
        measured: bool,
        watch: &Watch<'_>,
    ) -> Result<Option<f64>, CampaignError> {
        if !measured {
            return Ok(Some(estimate::start_s(&ego, &unit.ado)));
        }
        let world: &Scenario = &self.worlds[unit.world];
        consent(world, std::slice::from_ref(&ego))?;
        // An ado that is not trained yet takes as long as any that plays an episode.
        let as_played = match &unit.ado {
            PlannedAdo::Trained { .. } | PlannedAdo::Training { .. } => PlannedAdo::Held,
            other => other.clone(),
        };
        let played = Unit {
            ado: as_played,
            ..unit.clone()
        };
        let stage = Stage {
            plan: &self.plan,
            unit: &played,
            world,
            ego,
            ado: None,
        };
        watch.detail(&format!("{}, {}", world.name(), unit.ado.word()));
        let (mut spent_s, mut starts) = (0.0, 0);
        // One fault among the starts is a matter of the piece that has it. An ego
        // that never runs makes no piece at all.
        let faults = FaultLog::allowing(MOST_FAULTY);
        let mut ran = false;
        while starts < PILOT_STARTS.min(unit.starts) && spent_s < PILOT_S {
            // Spread over the starts: those of a grid are not all alike.
            let next = starts * unit.starts / PILOT_STARTS.min(unit.starts);
            let began = std::time::Instant::now();
            let quiet = Watch {
                faults: faults.clone(),
                ..watch.quiet()
            };
            let played = stage.play(next..next + 1, &quiet)?;
            if played.is_none() && watch.interrupted() {
                return Ok(None);
            }
            let rows = played.iter().flat_map(|played| &played.rows);
            ran |= rows
                .into_iter()
                .any(|row| row.outcome != RowOutcome::Invalid);
            spent_s += began.elapsed().as_secs_f64();
            starts += 1;
        }
        if let Some(complaint) = faults.complaint().filter(|_| !ran) {
            let piece = None;
            return Err(CampaignError::Faults { piece, complaint });
        }
        Ok(Some((spent_s / f64::from(starts.max(1) as u32)).max(1e-6)))
    }
}

impl Cut {
    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.checked.plan
    }

    /// Writes the plan, its worlds, its ados and the files of engines into a
    /// directory. The plan itself comes last: without it there is none.
    ///
    /// # Errors
    /// Another campaign is there, or the disk refuses.
    pub fn write(&self, dir: &Path) -> Result<(), CampaignError> {
        let plan = &self.checked.plan;
        let text = plan
            .text()
            .map_err(|error| CampaignError::Fault(error.to_string()))?;
        let path = dir.join(PLAN);
        if let Ok(there) = file_text(&path) {
            return match there == text {
                true => Ok(()),
                false => Err(CampaignError::request(
                    format!("`{}` holds another plan", dir.display()),
                    "go on with that one (`brakecheck campaign run DIR`), or name another directory with `-o`",
                )),
            };
        }
        let write = |name: &str, bytes: &[u8]| -> Result<(), RunError> {
            let path = dir.join(name);
            if let Some(parent) = path.parent() {
                make_dir(parent)?;
            }
            write_file(&path, bytes)
        };
        write("campaign.ron", self.checked.text.as_bytes())?;
        for (planned, world) in plan.worlds.iter().zip(&self.checked.worlds) {
            write(&planned.file, world.text().as_bytes())?;
        }
        for (planned, from) in plan.ados.iter().zip(&self.checked.runs) {
            RunDir::open(from)?.copy_to(&dir.join(&planned.dir))?;
        }
        write("Snakefile", engine::snakefile(plan).as_bytes())?;
        write("slurm.sh", engine::slurm(plan).as_bytes())?;
        write(PLAN, text.as_bytes())?;
        Ok(())
    }
}
