//! Check of a campaign file, which resolves names and reports mistakes with their place.

mod ados;
mod egos;
mod starts;

use std::path::{Path as FilePath, PathBuf};

use super::file::{BoundaryEntry, CampaignFile, GateEntry, RequestedStarts, WorldEntry};
use super::plan::{FORMAT, Plan, PlannedRun, PlannedTraining, PlannedWorld, Unit};
use super::regulation_boundary;
use crate::campaign::error::CampaignError;
use crate::content_hash::sha256;
use crate::evaluation::GateOn;
use crate::experiment::on_plant;
use crate::ron_file::{LoadError, Problem, ScenarioError, ValuePath, guessed, read_file};
use crate::run_dir::file_name;
use crate::world::Scenario;

/// Largest number of units of a campaign.
const MAX_UNITS: usize = 100_000;

/// Checked campaign: its uncut plan and the files beside it.
pub(super) struct Checked {
    /// Plan in which every unit is a single piece.
    pub plan: Plan,
    /// Text of the campaign file, verbatim.
    pub text: String,
    /// Worlds on the plants of their files.
    pub worlds: Vec<Scenario>,
    /// Run directories of the trained ados.
    pub runs: Vec<PathBuf>,
}

/// Reads and checks a campaign file. Files that it names are relative to it.
pub(super) fn check(path: &FilePath) -> Result<Checked, CampaignError> {
    let (name, text, file) = read_file::<CampaignFile>(path).map_err(|error| match error {
        LoadError::Io { .. } => CampaignError::NoFile(error),
        other => other.into(),
    })?;
    let dir = path.parent().unwrap_or(FilePath::new("")).to_owned();
    Checker {
        source: CampaignText { name, text },
        dir,
        worlds: Vec::new(),
        planned: Vec::new(),
        runs: Vec::new(),
        ados: Vec::new(),
        trainings: Vec::new(),
    }
    .check(file)
}

/// Text of the campaign file, for errors that show the place.
struct CampaignText {
    name: String,
    text: String,
}

impl CampaignText {
    fn wrong(
        &self,
        at: &ValuePath,
        what: impl Into<String>,
        help: Option<String>,
    ) -> CampaignError {
        LoadError::Scenario(Box::new(ScenarioError {
            file: self.name.clone(),
            text: self.text.clone(),
            problems: vec![Problem {
                what: what.into(),
                span: at.find(&self.text),
                label: "here".to_owned(),
                help,
            }],
        }))
        .into()
    }

    /// Returns a function that gives an error its place in the file.
    fn at<E: Into<CampaignError>>(
        &self,
        at: &ValuePath,
    ) -> impl Fn(E) -> CampaignError + use<'_, E> {
        let at = at.clone();
        // Errors with a place of their own, such as those of other files, stay as they are.
        move |error| {
            let error = error.into();
            match error.help() {
                Some(help) => self.wrong(&at, error.to_string(), Some(help)),
                None => error,
            }
        }
    }
}

struct Checker {
    source: CampaignText,
    /// Directory in which files are found.
    dir: PathBuf,
    /// Worlds on the requested plants and on the plants of their files.
    worlds: Vec<(Scenario, Scenario)>,
    planned: Vec<PlannedWorld>,
    runs: Vec<PathBuf>,
    ados: Vec<PlannedRun>,
    trainings: Vec<PlannedTraining>,
}

impl Checker {
    fn check(mut self, file: CampaignFile) -> Result<Checked, CampaignError> {
        let top = ValuePath::top();
        for (nth, entry) in file.worlds.iter().enumerate() {
            self.world(&top.to("worlds").at(nth), entry)?;
        }
        // Worlds come first, because egos, ados and starts are resolved against them.
        self.something_is_played(&file)?;
        let starts = self.starts(&top.to("starts"), &file.starts)?;
        let units = self.units(&file, &starts)?;
        if units.len() > MAX_UNITS {
            let what = format!("{} units are more than {MAX_UNITS}", units.len());
            let help = Some("make several campaigns of it".to_owned());
            return Err(self.source.wrong(&top, what, help));
        }
        let plan = Plan {
            format: FORMAT,
            // The hash is added when the plan is written, over the final text.
            sha256: String::new(),
            brakecheck: env!("CARGO_PKG_VERSION").to_owned(),
            name: file.name,
            worlds: self.planned.clone(),
            ados: std::mem::take(&mut self.ados),
            trainings: std::mem::take(&mut self.trainings),
            starts,
            preventability: file.preventability,
            gate: self.gate(file.gate, file.preventability, &units)?,
            boundary: self.boundary(file.boundary)?,
            units,
        };
        Ok(Checked {
            plan,
            text: self.source.text,
            worlds: self
                .worlds
                .into_iter()
                .map(|(_, as_filed)| as_filed)
                .collect(),
            runs: self.runs,
        })
    }

    fn something_is_played(&self, file: &CampaignFile) -> Result<(), CampaignError> {
        let empty = [
            ("worlds", file.worlds.is_empty()),
            ("egos", file.egos.is_empty()),
            (
                "ados",
                // A world with ados of its own needs no common ones.
                file.ados.is_empty() && file.worlds.iter().any(|it| it.ados.is_empty()),
            ),
        ];
        match empty.into_iter().find(|(_, is_empty)| *is_empty) {
            None => Ok(()),
            Some((field, _)) => {
                let what = format!("`{field}` is empty: nothing would be played");
                Err(self.source.wrong(&ValuePath::top().to(field), what, None))
            }
        }
    }

    /// Returns a unit per ego and ado, world by world.
    fn units(
        &mut self,
        file: &CampaignFile,
        starts: &RequestedStarts,
    ) -> Result<Vec<Unit>, CampaignError> {
        let mut units: Vec<Unit> = Vec::new();
        for world in 0..self.worlds.len() {
            let egos = self.egos(world, &file.egos)?;
            let ados = self.ados(world, &file.worlds[world].ados, &file.ados)?;
            let count = starts.count(&self.worlds[world].1);
            for ego in &egos {
                units.extend(ados.iter().map(|ado| Unit {
                    world,
                    ego: ego.clone(),
                    ado: ado.clone(),
                    starts: count,
                    // One piece per unit, until the pilot knows the cost of a start.
                    each: count.max(1),
                }));
            }
        }
        Ok(units)
    }

    fn gate(
        &self,
        gate: Option<GateEntry>,
        preventability: bool,
        units: &[Unit],
    ) -> Result<Option<(String, Vec<GateOn>)>, CampaignError> {
        let Some(gate) = gate else {
            return Ok(None);
        };
        let GateEntry { baseline, on, .. } = gate;
        // Without the reference drivers no failure counts as preventable. The default gate
        // counts unknown crashes, so it closes on every new failure then.
        if on == GateOn::Preventable && !preventability {
            let what = "a gate on preventable failures judges none without `preventability: true`";
            let help = "write `preventability: true` at the top of the file, or leave out `on: Preventable`";
            let at = ValuePath::top().to("gate");
            return Err(self.source.wrong(&at, what, Some(help.into())));
        }
        let mut known: Vec<&str> = units.iter().map(|it| it.ego.name.as_str()).collect();
        // Every ego is in a unit per ado, and an error should list it once.
        known.sort_unstable();
        known.dedup();
        // A misspelt baseline would compare nothing and let every change pass.
        if known.contains(&baseline.as_str()) {
            if known.len() == 1 {
                let what = format!("`{baseline}` is the only ego, so the gate compares nothing");
                let help = "list the ego to compare with it under `egos`, or leave out `gate`";
                let at = ValuePath::top().to("gate");
                return Err(self.source.wrong(&at, what, Some(help.to_owned())));
            }
            self.gates_every_world(&baseline, units)?;
            let severity = gate.severity.then_some(GateOn::Severity);
            return Ok(Some((baseline, [on].into_iter().chain(severity).collect())));
        }
        let help = guessed(&baseline, "egos", known);
        let what = format!("no ego of the campaign is called `{baseline}`");
        let at = ValuePath::top().to("gate").to("baseline");
        Err(self.source.wrong(&at, what, Some(help)))
    }

    /// Refuses a world without the baseline, whose egos no gate would compare.
    ///
    /// `all` may name an ego that only some worlds have.
    fn gates_every_world(&self, baseline: &str, units: &[Unit]) -> Result<(), CampaignError> {
        for (nth, (world, _)) in self.worlds.iter().enumerate() {
            let mut of_world = units.iter().filter(|unit| unit.world == nth);
            if !of_world.any(|unit| unit.ego.name == baseline) {
                let what = format!("`{}` has no ego `{baseline}` to compare with", world.name());
                let help = "name an ego that every world has, or make a campaign per world";
                let at = ValuePath::top().to("gate").to("baseline");
                return Err(self.source.wrong(&at, what, Some(help.to_owned())));
            }
        }
        Ok(())
    }

    fn boundary(
        &self,
        boundary: Option<BoundaryEntry>,
    ) -> Result<Option<(String, String)>, CampaignError> {
        let Some(BoundaryEntry { name, stl }) = boundary else {
            return Ok(None);
        };
        // The formula must bind in every world, since each world has a map.
        for (world, _) in &self.worlds {
            regulation_boundary::monitor(world, &stl).map_err(|error| {
                let at = ValuePath::top().to("boundary").to("stl");
                let what = format!("in `{}`: {error}", world.name());
                let help = error.help().map(ToString::to_string);
                self.source.wrong(&at, what, help)
            })?;
        }
        Ok(Some((name, stl)))
    }

    fn world(&mut self, at: &ValuePath, entry: &WorldEntry) -> Result<(), CampaignError> {
        let path = self.dir.join(&entry.file);
        let shipped = || Scenario::shipped(&entry.file).and_then(Result::ok);
        // A file takes precedence over a shipped world of the same name.
        let as_filed = if path.is_file() {
            Scenario::load(&path)?
        } else {
            shipped().ok_or_else(|| {
                let what = format!("there is no world `{}`", path.display());
                let known = guessed(&entry.file, "shipped worlds", known_worlds());
                let help = format!("name a file beside the campaign's; {known}");
                self.source.wrong(&at.to("file"), what, Some(help))
            })?
        };
        let played = match entry.plant {
            Some(plant) => on_plant(&as_filed, plant).map_err(self.source.at(&at.to("plant")))?,
            None => as_filed.clone(),
        };
        let (name, plant) = (as_filed.name(), played.plant());
        // Rows name worlds by name and plant, so the same world may appear on both plants.
        let same =
            |(other, _): &(Scenario, Scenario)| other.name() == name && other.plant() == plant;
        if self.worlds.iter().any(same) {
            let what = format!("two worlds are called `{name}`, on the same plant");
            let help = "rows tell them apart by their `name` and `plant`".to_owned();
            return Err(self.source.wrong(at, what, Some(help)));
        }
        let nth = self.planned.len();
        self.planned.push(PlannedWorld {
            name: name.to_owned(),
            // The number keeps the names of the copies distinct.
            file: format!("worlds/{nth}-{}.ron", file_name(name)),
            sha256: sha256(as_filed.text().as_bytes()),
            plant: entry.plant,
        });
        self.worlds.push((played, as_filed));
        Ok(())
    }
}

fn known_worlds() -> Vec<&'static str> {
    Scenario::shipped_names().collect()
}
