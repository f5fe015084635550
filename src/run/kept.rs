//! Counterexamples as files: start, actions, world and what they must give.
//!
//! A kept counterexample is self-contained: the world's text is in it. Beside
//! `NAME.ron` stands `NAME.csv` with every sample, so that a replay that
//! differs can name the first signal that does.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::{RunError, write_file};
use crate::ego::Command;
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::scenario::{Change, ChangeError, Scenario, ScenarioError};
use crate::scene::{Dynamics, Start, Touch};
use crate::testbench::Episode;
use crate::trace::Trace;

/// Version of the file; another one is refused.
const FORMAT: u32 = 1;

/// A recorded episode and everything needed to play it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counterexample {
    /// Version of the file.
    pub format: u32,
    /// Version of the program that recorded it.
    pub brakecheck: String,
    /// Name of the world.
    pub world: String,
    /// Which ego: `nominal`, or the name of a change.
    pub ego: String,
    /// How it differed from the world's own ego and surroundings.
    pub change: Change,
    /// Which physics.
    pub plant: Dynamics,
    /// Which ado.
    pub ado: String,
    /// The start, by name of the axis.
    pub start: IndexMap<String, f64>,
    /// Seed of all noise in it.
    pub noise: u64,
    /// The ados' joint actions, one per decision.
    pub actions: Vec<usize>,
    /// How it was judged.
    pub verdict: Verdict,
    /// ρ(ψ_ego) of the judged samples.
    pub robustness: f64,
    /// Samples on which the verdict rests.
    pub judged: usize,
    /// The first contact, if the agents touched.
    pub contact: Option<Touch>,
    /// Whether the rules held up to the contact; older files do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules_until_contact: Option<RulesUntilContact>,
    /// What an ego that nobody here wrote commanded, sample by sample:
    /// acceleration in m/s² and speed across the road in m/s. With these the
    /// world's side is repeated bit for bit, whatever the ego answers today.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ego_commands: Vec<(f64, f64)>,
    /// One digest of eight hexadecimal digits per sample.
    pub digests: String,
    /// The world file, verbatim.
    pub world_file: String,
}

/// A kept counterexample could not be used.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    /// It could not be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The file is no counterexample.
    #[error("`{path}` is no kept counterexample: {why}")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        why: String,
    },
    /// The world in it is not usable.
    #[error("the world in `{path}`: {source}")]
    World {
        /// The file.
        path: PathBuf,
        /// What is wrong in it.
        source: Box<ScenarioError>,
    },
    /// The recorded change does not fit the world in it.
    #[error("the change in `{path}`: {source}")]
    Change {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ChangeError,
    },
}

impl Counterexample {
    /// Records an episode of `scenario`, which is its world after `change`.
    pub fn record(
        scenario: &Scenario,
        ego: &str,
        change: &Change,
        ado: &str,
        episode: &Episode,
    ) -> Counterexample {
        let axes = scenario.axes();
        let names = axes.iter().map(|axis| axis.name.clone());
        Counterexample {
            format: FORMAT,
            brakecheck: env!("CARGO_PKG_VERSION").to_owned(),
            world: scenario.name.clone(),
            ego: ego.to_owned(),
            change: change.clone(),
            plant: scenario.plant(),
            ado: ado.to_owned(),
            start: names.zip(episode.start.0.iter().copied()).collect(),
            noise: episode.noise,
            actions: episode.actions.clone(),
            verdict: episode.verdict,
            robustness: episode.robustness,
            judged: episode.judged,
            contact: episode.contact.clone(),
            rules_until_contact: episode.rules_until_contact.clone(),
            ego_commands: episode
                .commands
                .iter()
                .map(|command| (command.accel_mps2, command.lateral_mps))
                .collect(),
            digests: digests_of(&episode.trace),
            world_file: scenario.text.clone(),
        }
    }

    /// Whether verdict, robustness, contact and the rules up to it are those of
    /// `episode`; its samples are compared elsewhere.
    pub(crate) fn is_of(&self, episode: &Episode) -> bool {
        // Older files do not say what became of the rules.
        let rules = self.rules_until_contact.as_ref();
        let rules_agree = rules.is_none() || rules == episode.rules_until_contact.as_ref();
        episode.verdict == self.verdict
            && episode.robustness.to_bits() == self.robustness.to_bits()
            && episode.contact == self.contact
            && episode.judged == self.judged
            && rules_agree
    }

    /// Reads a kept counterexample.
    ///
    /// # Errors
    /// It cannot be read, or it is none.
    pub fn load(path: &Path) -> Result<Counterexample, KeptError> {
        let text = std::fs::read_to_string(path).map_err(|source| RunError::Io {
            verb: "reading",
            path: path.into(),
            source,
        })?;
        let format = |why: String| KeptError::Format {
            path: path.into(),
            why,
        };
        let kept: Counterexample =
            ron::from_str(&text).map_err(|error| format(error.to_string()))?;
        if kept.format != FORMAT {
            return Err(format(format!("format {} is not {FORMAT}", kept.format)));
        }
        let changed = kept.change.ego.0.values().copied();
        let commands = kept.ego_commands.iter();
        let commands = commands.flat_map(|&(accel, lateral)| [accel, lateral]);
        let mut numbers = kept.start.values().copied().chain(changed).chain(commands);
        if numbers.any(|value| !value.is_finite()) {
            return Err(format("a value in it is not finite".to_owned()));
        }
        Ok(kept)
    }

    /// Writes `STEM.ron` into a directory, or `STEM-2.ron` and so on where
    /// another counterexample has that name already; returns the file.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save_as(&self, dir: &Path, stem: &str, trace: &Trace) -> Result<PathBuf, KeptError> {
        let mut file = dir.join(format!("{stem}.ron"));
        let mut number = 1;
        while file.exists() && Counterexample::load(&file).ok().as_ref() != Some(self) {
            number += 1;
            file = dir.join(format!("{stem}-{number}.ron"));
        }
        self.save(&file, trace)?;
        Ok(file)
    }

    /// Writes `path` and, beside it, the samples as CSV.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn save(&self, path: &Path, trace: &Trace) -> Result<(), KeptError> {
        let pretty = ron::ser::PrettyConfig::new()
            .escape_strings(false)
            .compact_arrays(true);
        let text = ron::ser::to_string_pretty(self, pretty).map_err(|error| KeptError::Format {
            path: path.into(),
            why: error.to_string(),
        })?;
        write_file(path, text.as_bytes())?;
        write_file(&path.with_extension("csv"), csv_of(trace).as_bytes())?;
        Ok(())
    }

    /// The world it was recorded in, its ego as it was then.
    ///
    /// # Errors
    /// The world or the change in it is not usable by this version.
    pub fn scenario(&self, path: &Path) -> Result<Scenario, KeptError> {
        let world = self.nominal(path)?;
        world
            .with(&self.change)
            .map_err(|source| KeptError::Change {
                path: path.into(),
                source,
            })
    }

    /// What the ego commanded, if nobody here wrote it.
    pub fn commands(&self) -> Option<Arc<[Command]>> {
        let commands = self.ego_commands.iter();
        let commands = commands.map(|&(accel_mps2, lateral_mps)| Command {
            accel_mps2,
            lateral_mps,
        });
        (!self.ego_commands.is_empty()).then(|| commands.collect())
    }

    /// The same world on the same plant, with the ego its file names.
    ///
    /// # Errors
    /// The world in it is not usable by this version.
    pub fn nominal(&self, path: &Path) -> Result<Scenario, KeptError> {
        let name = format!("{} (in {})", self.world, path.display());
        let world =
            Scenario::parse(&name, &self.world_file).map_err(|source| KeptError::World {
                path: path.into(),
                source: Box::new(source),
            })?;
        Ok(match self.plant.plant() {
            Some(plant) => world.on(plant),
            None => world,
        })
    }

    /// The start in the order of the world's axes.
    ///
    /// # Errors
    /// An axis has no value, or one outside of its range; an action is none.
    pub fn start(&self, scenario: &Scenario, path: &Path) -> Result<Start, KeptError> {
        let axes = scenario.axes();
        let value = |name: &str| {
            self.start
                .get(name)
                .copied()
                .ok_or_else(|| KeptError::Format {
                    path: path.into(),
                    why: format!("the start lacks `{name}`"),
                })
        };
        let format = |why: String| KeptError::Format {
            path: path.into(),
            why,
        };
        let mut start = Vec::with_capacity(axes.len());
        for axis in &axes {
            let value = value(&axis.name)?;
            if !(axis.lo..=axis.hi).contains(&value) {
                let (name, lo, hi) = (&axis.name, axis.lo, axis.hi);
                return Err(format(format!(
                    "`{name}` = {value} is outside of {lo} ..= {hi}"
                )));
            }
            start.push(value);
        }
        if start.len() != self.start.len() {
            return Err(format(
                "the start names an axis that the world has not".to_owned(),
            ));
        }
        let actions = scenario.world().spaces().actions;
        if let Some(action) = self.actions.iter().find(|action| actions <= **action) {
            return Err(format(format!("action {action} of {actions} actions")));
        }
        Ok(Start(start))
    }
}

/// A digest of eight hexadecimal digits per sample.
pub fn digests_of(trace: &Trace) -> String {
    let mut row = vec![0.0; trace.schema().len()];
    let mut text = String::with_capacity(8 * trace.len());
    for sample in 0..trace.len() {
        trace.read_row(sample, &mut row);
        // FNV-1a (Fowler, Noll, Vo) over the bits of the row.
        let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
        for byte in row.iter().flat_map(|value| value.to_bits().to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        text.push_str(&format!("{:08x}", (hash ^ (hash >> 32)) as u32));
    }
    text
}

/// A trace as CSV: a time column, then every signal, exactly.
pub fn csv_of(trace: &Trace) -> String {
    let mut text = String::from("time");
    for signal in trace.schema().signals() {
        text.push(',');
        text.push_str(&signal.name);
    }
    text.push('\n');
    let mut row = vec![0.0; trace.schema().len()];
    for sample in 0..trace.len() {
        trace.read_row(sample, &mut row);
        // Time is i · dt; rounding hides the dust of binary fractions.
        let time_s = (sample as f64 * trace.dt_s() * 1e9).round() / 1e9;
        text.push_str(&time_s.to_string());
        for value in &row {
            text.push(',');
            text.push_str(&value.to_string());
        }
        text.push('\n');
    }
    text
}
