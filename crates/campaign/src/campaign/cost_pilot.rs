//! Plan of a campaign that is cut into pieces of similar cost.

use std::collections::BTreeMap;
use std::path::Path;

use super::check::{Checked, check};
use super::dir::PLAN;
use super::error::CampaignError;
use super::plan::{Plan, PlannedAdo, Unit};
use super::play::UnitContext;
use super::{estimate, workflow_files};
use crate::experiment::{EgoUnderTest, TrivialStarts, Watch, consent, on_plant};
use crate::ron_file::file_text;
use crate::run_dir::AdversaryId;
use crate::run_dir::{RunDir, RunError, make_dir, write_file};
use crate::stats::StartOutcome;
use crate::testbench::FaultLog;
use crate::world::Scenario;

/// Default duration of a piece, s.
pub const PIECE_S: f64 = 10.0;
/// Largest number of starts that a pilot plays per kind of unit, and its duration, s.
const PILOT_STARTS: usize = 32;
const PILOT_S: f64 = 1.0;
/// Share of invalid episodes up to which a pilot reports no fault.
const MOST_FAULTY: f64 = 0.99;
/// Mean size of a row in bytes.
const ROW_BYTES: f64 = 420.0;

/// Estimated cost of a campaign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanCost {
    /// Number of pieces.
    pub pieces: usize,
    /// Number of trainings among them.
    pub trainings: usize,
    /// Number of starts.
    pub starts: u64,
    /// Total processor time, s.
    pub cpu_s: f64,
    /// Bytes on disk for the pieces and the merged file.
    pub bytes: f64,
    /// Whether the cost was measured instead of estimated from the worlds.
    pub measured: bool,
}

/// Kind of units with similar cost, of which a single unit is measured.
#[derive(PartialEq)]
struct UnitKind {
    world: usize,
    ado: PlannedAdo,
    /// Command of a program, which may be far slower than any other ego.
    program: Option<Vec<String>>,
}

/// Starts that a pilot played without an adversary, by world and number.
///
/// Each has the duration of its episode, s.
type PlayedAlone = BTreeMap<(usize, usize), (TrivialStarts, f64)>;

/// Campaign that is cut into pieces, before it is written.
pub struct Cut {
    checked: Checked,
    /// Estimated cost.
    pub cost: PlanCost,
}

impl Plan {
    /// Reads a campaign file and cuts it into pieces of about `piece_s` seconds.
    ///
    /// Without `piece_s` a pilot measures the cost of a start. It plays a few starts per world,
    /// ado and program as an ego, and pieces take 10 s.
    /// With `piece_s` no start is played, so the plan follows from the file alone.
    /// `None`: stopped.
    ///
    /// # Errors
    /// Returns an error if the file or a file that it names is invalid, or if an
    /// ego never runs in the pilot.
    pub fn make(
        path: &Path,
        piece_s: Option<f64>,
        allow_programs: bool,
        watch: &Watch<'_>,
    ) -> Result<Option<Cut>, CampaignError> {
        let mut checked = check(path)?;
        // The check starts no program, so the consent is added only for the pilot.
        let worlds = std::mem::take(&mut checked.worlds);
        checked.worlds = worlds
            .into_iter()
            .map(|it| it.allow_programs(allow_programs))
            .collect();
        let measured = piece_s.is_none();
        let mut known: Vec<(UnitKind, f64)> = Vec::new();
        let mut alone = PlayedAlone::new();
        let (mut units, mut cpu_s) = (checked.plan.units.clone(), 0.0);
        for (nth, unit) in units.iter_mut().enumerate() {
            (watch.progress)(nth as u64, checked.plan.units.len() as u64);
            let ego = checked.ego(unit)?;
            let kind = UnitKind {
                world: unit.world,
                ado: unit.ado.clone(),
                program: ego.scenario().program().map(|it| it.command.clone()),
            };
            // Estimates are cheap and differ by ego, so only measurements are reused.
            let known_s = known.iter().find(|(other, _)| measured && *other == kind);
            let start_s = match known_s {
                Some((_, start_s)) => *start_s,
                None => {
                    let alone = measured.then_some(&mut alone);
                    let Some(start_s) = checked.start_s(unit, ego, alone, watch)? else {
                        return Ok(None);
                    };
                    known.push((kind, start_s));
                    start_s
                }
            };
            // The pieces of a world's first unit play its trivial starts for all its units.
            let before = &checked.plan.units[..nth];
            // Outcomes of a program are not stored, so each of its units plays the
            // trivial starts again.
            let is_program = checked.worlds[unit.world].program().is_some();
            let is_first = is_program || !before.iter().any(|other| other.world == unit.world);
            let alone_s = match (is_first, measured) {
                (false, _) => 0.0,
                (true, false) => estimate::alone_s(&checked.worlds[unit.world]),
                (true, true) => mean_s(&alone, unit.world),
            };
            let start_s = start_s + alone_s;
            let fits = (piece_s.unwrap_or(PIECE_S) / start_s).ceil();
            // Every piece has a start at least and no more starts than its unit.
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
            // Rows are stored twice: in the pieces and in the merged file.
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
        let help = "mend the campaign";
        Ok(EgoUnderTest::changed(&played, name, change, help)?)
    }

    /// Returns the cost of a start of a unit, s, without its episode in `alone`.
    ///
    /// It is measured with `alone`, which gets the starts, and estimated without. `None`:
    /// stopped.
    fn start_s(
        &self,
        unit: &Unit,
        ego: EgoUnderTest,
        alone: Option<&mut PlayedAlone>,
        watch: &Watch<'_>,
    ) -> Result<Option<f64>, CampaignError> {
        let Some(alone) = alone else {
            return Ok(Some(estimate::start_s(&ego, &unit.ado.id)));
        };
        let world: &Scenario = &self.worlds[unit.world];
        consent(world, std::slice::from_ref(&ego))?;
        // An untrained ado costs about as much as any other ado that plays a whole episode.
        let as_played = match &unit.ado.id {
            AdversaryId::Trained => AdversaryId::Hold.into(),
            _ => unit.ado.clone(),
        };
        let played = Unit {
            ado: as_played,
            ..unit.clone()
        };
        let stage = UnitContext {
            plan: &self.plan,
            unit: &played,
            world,
            ego,
            ado: None,
        };
        watch.detail(&format!("{}, {}", world.name(), unit.ado.id));
        let (mut spent_s, mut alone_s, mut starts) = (0.0, 0.0, 0);
        // One fault among the starts is a matter of the piece that has it. An ego
        // that never runs makes no piece at all.
        let faults = FaultLog::allowing(MOST_FAULTY);
        let mut ran = false;
        while starts < PILOT_STARTS.min(unit.starts) && spent_s + alone_s < PILOT_S {
            // Spread over the starts, because those of a grid differ.
            let next = starts * unit.starts / PILOT_STARTS.min(unit.starts);
            let began = std::time::Instant::now();
            let trivial = self.trivial(unit.world, next, alone, watch);
            alone_s += began.elapsed().as_secs_f64();
            let began = std::time::Instant::now();
            // Faults are accepted here, because the pieces themselves report them.
            let quiet = Watch {
                faults: faults.clone(),
                ..watch.quiet()
            };
            let played = stage.play(next..next + 1, trivial, &quiet)?;
            if played.is_none() && watch.interrupted() {
                return Ok(None);
            }
            let rows = played.iter().flat_map(|played| &played.rows);
            ran |= rows
                .into_iter()
                .any(|row| row.outcome != StartOutcome::Invalid);
            spent_s += began.elapsed().as_secs_f64();
            starts += 1;
        }
        if let Some(complaint) = faults.complaint().filter(|_| !ran) {
            let piece = None;
            return Err(CampaignError::Faults { piece, complaint });
        }
        // The floor bounds the number of starts per piece.
        Ok(Some((spent_s / f64::from(starts.max(1) as u32)).max(1e-6)))
    }

    /// Returns whether a start is trivial, from an earlier unit of its world if possible.
    fn trivial(
        &self,
        world: usize,
        start: usize,
        alone: &mut PlayedAlone,
        watch: &Watch<'_>,
    ) -> TrivialStarts {
        let scenario = &self.worlds[world];
        if scenario.judges_each_ego() {
            return TrivialStarts::default();
        }
        if let Some((known, _)) = alone.get(&(world, start)) {
            return known.clone();
        }
        let began = std::time::Instant::now();
        // The unit plays a start with a fault again, and reports it.
        let apart = Watch {
            faults: FaultLog::allowing(1.0),
            ..watch.quiet()
        };
        let points = self.plan.starts.of(scenario, start..start + 1);
        let played = TrivialStarts::default()
            .play(scenario, &points, &apart)
            .unwrap_or_default();
        let spent_s = began.elapsed().as_secs_f64();
        alone.insert((world, start), (played.clone(), spent_s));
        played
    }
}

/// Returns the mean duration of a world's episodes without an adversary, s.
fn mean_s(alone: &PlayedAlone, world: usize) -> f64 {
    let of_world = alone.range((world, 0)..(world + 1, 0));
    let spent: Vec<f64> = of_world.map(|(_, (_, spent_s))| *spent_s).collect();
    spent.iter().sum::<f64>() / spent.len().max(1) as f64
}

impl Cut {
    /// Returns the plan.
    pub fn plan(&self) -> &Plan {
        &self.checked.plan
    }

    /// Writes the plan, its worlds, its ados and the engine files to a directory.
    ///
    /// # Errors
    /// Returns an error if the directory holds another plan or a file cannot be written.
    pub fn write(&self, dir: &Path) -> Result<(), CampaignError> {
        let plan = &self.checked.plan;
        let text = plan
            .text()
            .map_err(|error| CampaignError::Fault(error.to_string()))?;
        let path = dir.join(PLAN);
        // Writing the same plan again changes nothing, so the command can be repeated.
        if let Ok(there) = file_text(&path) {
            return if there == text {
                Ok(())
            } else {
                Err(CampaignError::OtherPlan { dir: dir.into() })
            };
        }
        let write = |name: &str, bytes: &[u8]| -> Result<(), RunError> {
            let path = dir.join(name);
            if let Some(parent) = path.parent() {
                make_dir(parent)?;
            }
            write_file(&path, bytes)
        };
        // The request is kept beside the plan, so a reader finds comments that the plan
        // does not have.
        write("campaign.ron", self.checked.text.as_bytes())?;
        for (planned, world) in plan.worlds.iter().zip(&self.checked.worlds) {
            write(&planned.file, world.text().as_bytes())?;
        }
        for (planned, from) in plan.ados.iter().zip(&self.checked.runs) {
            RunDir::open(from)?.copy_to(&dir.join(&planned.dir))?;
        }
        write("Snakefile", workflow_files::snakefile(plan).as_bytes())?;
        write("slurm.sh", workflow_files::slurm(plan).as_bytes())?;
        // The plan comes last, so an interrupted write leaves no plan.
        write(PLAN, text.as_bytes())?;
        Ok(())
    }
}
