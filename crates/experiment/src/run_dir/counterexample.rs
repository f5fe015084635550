//! Counterexamples as files: start, actions, world and expected outcome.
//!
//! A kept counterexample is self-contained, because it includes the text of the
//! world. `NAME.csv` beside `NAME.ron` has every sample, so a replay that
//! differs can name the first differing signal.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use super::about::About;
use super::{RunError, trace_of_csv, write_file};
use crate::content_hash;
use crate::content_hash::sha256;
use crate::ego::Command;
use crate::ron_file::ScenarioError;
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::run_files::disk::read_text;
use crate::scene::{ContactEvent, Dynamics, Start};
use crate::testbench::{Episode, film_beyond};
use crate::trace::Trace;
use crate::world::{Change, ChangeError, Scenario};

/// Version of the file. Other versions are refused.
const FORMAT: u32 = 2;

/// First column of the samples. A signal of that name is the same column.
const TIME: &str = "time";

/// Recorded episode with everything that its replay requires.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counterexample {
    /// Version of the file.
    pub format: u32,
    /// SHA-256 of the file with zeros in its place. `None` until it is written.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// SHA-256 of the samples beside the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub samples_sha256: Option<String>,
    /// Version of the program that recorded it.
    pub brakecheck: String,
    /// Name of the world.
    pub world: String,
    /// Name of the ego: `nominal`, or that of a change.
    pub ego: String,
    /// Difference from the world's own ego and surroundings.
    pub change: Change,
    /// Plant of the recording.
    pub plant: Dynamics,
    /// Name of the ados' method.
    pub ado: String,
    /// Start, by name of the axis.
    pub start: IndexMap<String, f64>,
    /// Seed of all noise in the episode.
    pub noise: u64,
    /// Joint actions of the ados, one per decision.
    pub actions: Vec<usize>,
    /// Verdict of the recording.
    pub verdict: Verdict,
    /// ρ(ψ_ego) of the judged samples.
    pub robustness: f64,
    /// Number of samples that determine the verdict.
    pub judged: usize,
    /// First contact, if any.
    pub contact: Option<ContactEvent>,
    /// State of the rules up to the contact. `None` if it was not recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules_until_contact: Option<RulesUntilContact>,
    /// Commands of an external ego, sample by sample.
    ///
    /// Each has an acceleration in m/s² and a lateral speed in m/s. With them
    /// the world's side is repeated bit for bit, whatever the ego commands
    /// today.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ego_commands: Vec<(f64, f64)>,
    /// Recorded signals in order.
    ///
    /// Signals of later versions are not compared.
    pub signals: Vec<String>,
    /// Digests of the samples, with eight hexadecimal digits each.
    pub digests: String,
    /// Motion after the contact, as the text of a table in CSV.
    ///
    /// One row per sample with its time since the contact, and of every agent the
    /// centre `x y z` in metres and the orientation as a quaternion `qx qy qz qw`. Empty
    /// without such a motion, and in files of earlier versions.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub motion_after_contact: String,
    /// Facts about the counterexample. `None` if they were not determined.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<About>,
    /// World file, verbatim.
    pub world_file: String,
}

/// Returns whether a text begins as kept files of this format do, or is cut off before.
fn begins_as_kept(text: &str) -> bool {
    let head = format!("(format:{FORMAT},");
    let visible = text.chars().filter(|c| !c.is_whitespace());
    let begin: String = visible.take(head.len()).collect();
    head.starts_with(&begin)
}

/// Failure to use a kept counterexample.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    /// Failure to read or write the file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The file is not a counterexample.
    #[error("`{path}` is no kept counterexample: {why}")]
    Format {
        /// File.
        path: PathBuf,
        /// Invalid content.
        why: String,
    },
    /// The file is of another version of the program.
    #[error("`{path}` has format {found} of kept counterexamples, and this version reads {reads}", reads = FORMAT)]
    Version {
        /// File.
        path: PathBuf,
        /// Format of the file.
        found: u32,
    },
    /// The world in the file is not usable.
    #[error("the world in `{path}`: {source}")]
    World {
        /// File.
        path: PathBuf,
        /// Error of the world.
        source: Box<ScenarioError>,
    },
    /// The recorded change does not fit the world in the file.
    #[error("the change in `{path}`: {source}")]
    Change {
        /// File.
        path: PathBuf,
        /// Error of the change.
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
        let recorded = Counterexample {
            format: FORMAT,
            sha256: None,
            samples_sha256: None,
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
            // These three follow from the samples, and `as_now` fills them in.
            signals: Vec::new(),
            digests: String::new(),
            motion_after_contact: String::new(),
            about: None,
            world_file: scenario.text.clone(),
        };
        recorded.as_now(scenario, episode)
    }

    /// Returns the counterexample with the samples and the motion after the contact as
    /// of this version.
    pub fn as_now(&self, scenario: &Scenario, episode: &Episode) -> Counterexample {
        let trace = &episode.trace;
        let signals = trace.schema().signals().iter();
        let all: Vec<usize> = (0..signals.len()).collect();
        Counterexample {
            format: FORMAT,
            sha256: None,
            samples_sha256: Some(sha256(csv_of(trace).as_bytes())),
            signals: signals.map(|signal| signal.name.clone()).collect(),
            digests: digests_of(trace, &all),
            motion_after_contact: motion_after_contact(scenario, episode).unwrap_or_default(),
            ..self.clone()
        }
    }

    /// Returns true if the outcome equals that of `episode`.
    ///
    /// It compares verdict, robustness, contact and the rules up to it. Samples
    /// are compared elsewhere.
    pub fn is_of(&self, episode: &Episode) -> bool {
        // A file without the rules up to the contact says nothing about them.
        let rules = self.rules_until_contact.as_ref();
        let rules_agree = rules.is_none() || rules == episode.rules_until_contact.as_ref();
        let contact_agrees = match (&episode.contact, &self.contact) {
            (Some(now), Some(then)) => now.is_as_recorded(then),
            (now, then) => now == then,
        };
        episode.verdict == self.verdict
            // Bits, since a replay repeats the recording exactly.
            && episode.robustness.to_bits() == self.robustness.to_bits()
            && contact_agrees
            && episode.judged == self.judged
            && rules_agree
    }

    /// Reads a kept counterexample.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or is not a counterexample.
    pub fn load(path: &Path) -> Result<Counterexample, KeptError> {
        Counterexample::parse(path, &read_text(path)?)
    }

    /// Reads a kept counterexample from the text of its file, which errors name `path`.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is not a counterexample.
    pub fn parse(path: &Path, text: &str) -> Result<Counterexample, KeptError> {
        let format = |why: String| KeptError::Format {
            path: path.into(),
            why,
        };
        let damaged = |why| RunError::Damaged {
            path: path.into(),
            why,
        };
        let kept: Counterexample = ron::from_str(text).map_err(|error| {
            if begins_as_kept(text) {
                KeptError::from(damaged(format!("it is cut off or was edited, {error}")))
            } else {
                format(error.to_string())
            }
        })?;
        if kept.format != FORMAT {
            return Err(KeptError::Version {
                path: path.into(),
                found: kept.format,
            });
        }
        // A file without its hash fails the check, since a kept one always has it.
        let hash = kept.sha256.as_deref().unwrap_or_default();
        content_hash::check(text, hash).map_err(damaged)?;
        let changed = kept.change.ego.0.values().copied();
        let commands = kept
            .ego_commands
            .iter()
            .flat_map(|&(accel, lateral)| [accel, lateral]);
        let mut numbers = kept.start.values().copied().chain(changed).chain(commands);
        // RON reads `inf` and `NaN`, and neither belongs in a start or a command.
        if numbers.any(|value| !value.is_finite()) {
            return Err(format("a value in it is not finite".to_owned()));
        }
        Ok(kept)
    }

    /// Returns the samples beside a kept file.
    ///
    /// `None` if there are none. A replay then cannot name the first differing
    /// signal.
    ///
    /// # Errors
    ///
    /// Returns an error if the samples were changed, or are not valid.
    pub fn samples(&self, path: &Path) -> Result<Option<Trace>, KeptError> {
        let Some(text) = self.samples_text(path)? else {
            return Ok(None);
        };
        let trace = trace_of_csv(&text, None).map_err(|error| KeptError::Format {
            path: path.with_extension("csv"),
            why: error.to_string(),
        })?;
        Ok(Some(trace))
    }

    /// Returns the text of the samples, if it is unchanged.
    pub fn samples_text(&self, path: &Path) -> Result<Option<String>, KeptError> {
        let path = path.with_extension("csv");
        if !path.exists() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        let found = sha256(text.as_bytes());
        match &self.samples_sha256 {
            Some(recorded) if *recorded != found => {
                let why = format!("SHA-256 is {found}, the file beside it says {recorded}");
                Err(RunError::Damaged { path, why }.into())
            }
            _ => Ok(Some(text)),
        }
    }

    /// Writes `STEM.ron` into a directory and returns its path.
    ///
    /// If another counterexample has that name, it writes `STEM-2.ron` and so
    /// on.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn save_as(&self, dir: &Path, stem: &str, trace: &Trace) -> Result<PathBuf, KeptError> {
        let mut file = dir.join(format!("{stem}.ron"));
        let mut number = 1;
        // Writing the same counterexample again replaces its file.
        while file.exists() && !self.is_kept_in(&file) {
            number += 1;
            file = dir.join(format!("{stem}-{number}.ron"));
        }
        self.save(&file, trace)?;
        Ok(file)
    }

    /// Returns true if a file contains this counterexample.
    fn is_kept_in(&self, file: &Path) -> bool {
        // A counterexample in memory has no hash yet.
        let unsealed = |kept: &Counterexample| Counterexample {
            sha256: None,
            ..kept.clone()
        };
        let kept = Counterexample::load(file);
        kept.is_ok_and(|kept| unsealed(&kept) == unsealed(self))
    }

    /// Writes the samples as CSV beside `path`, then `path` itself.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn save(&self, path: &Path, trace: &Trace) -> Result<(), KeptError> {
        let pretty = ron::ser::PrettyConfig::new()
            // The world's text stays readable without escapes.
            .escape_strings(false)
            .compact_arrays(true);
        let blank = Counterexample {
            sha256: Some(content_hash::BLANK.to_owned()),
            ..self.clone()
        };
        let text =
            ron::ser::to_string_pretty(&blank, pretty).map_err(|error| KeptError::Format {
                path: path.into(),
                why: error.to_string(),
            })?;
        // The file that completes the pair is written last.
        write_file(&path.with_extension("csv"), csv_of(trace).as_bytes())?;
        write_file(path, content_hash::seal(&text).as_bytes())?;
        Ok(())
    }

    /// Returns the world of the recording, with its ego.
    ///
    /// # Errors
    ///
    /// Returns an error if this version cannot use the world or the change.
    pub fn scenario(&self, path: &Path) -> Result<Scenario, KeptError> {
        let world = self.nominal(path)?;
        world
            .with(&self.change)
            .map_err(|source| KeptError::Change {
                path: path.into(),
                source,
            })
    }

    /// Returns whether the recorded ego is in no file, as that of another simulator.
    ///
    /// `world` is that of the recording.
    pub fn is_ego_absent(&self, world: &Scenario) -> bool {
        let is_named = self.ego == "nominal" || world.reuse().contains_key(&self.ego);
        let is_unchanged = self.change == Change::default() && world.program().is_none();
        !self.ego_commands.is_empty() && !is_named && is_unchanged
    }

    /// Returns the commands of an external ego.
    pub fn commands(&self) -> Option<Arc<[Command]>> {
        let commands = self
            .ego_commands
            .iter()
            .map(|&(accel_mps2, lateral_mps)| Command {
                accel_mps2,
                lateral_mps,
            });
        (!self.ego_commands.is_empty()).then(|| commands.collect())
    }

    /// Returns the world on the plant of the recording, with the world's own ego.
    ///
    /// # Errors
    ///
    /// Returns an error if this version cannot use the world.
    pub fn nominal(&self, path: &Path) -> Result<Scenario, KeptError> {
        // The world is part of the kept file, so its errors name that file.
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

    /// Returns the start in the order of the world's axes.
    ///
    /// # Errors
    ///
    /// Returns an error for a missing value, a value outside of its range, or
    /// an invalid action.
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
        // Every axis has a value, so a surplus value belongs to no axis.
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

/// Returns the motion after the contact of an episode as the text of a table.
///
/// `None` if nothing moves after it. [`Counterexample::motion_after_contact`] has the
/// columns.
pub fn motion_after_contact(scenario: &Scenario, episode: &Episode) -> Option<String> {
    episode.contact.as_ref()?;
    // A program is not started again: its commands are in the episode.
    let mut bench = scenario.repeating(episode).bench();
    let after = film_beyond(&mut bench, episode).after?;
    let agents = bench.stage().agents;
    let mut text = String::from("time");
    for agent in &agents {
        for column in ["x", "y", "z", "qx", "qy", "qz", "qw"] {
            text.push(',');
            text += &csv_name(&format!("{}.{column}", agent.name));
        }
    }
    for (index, frame) in after.frames.iter().enumerate() {
        // Time is i · dt. Rounding removes the digits that binary fractions add.
        let time_s = ((index + 1) as f64 * after.sample_s * 1e9).round() / 1e9;
        text += &format!("\n{time_s}");
        for placement in &frame.placements {
            let numbers = placement.centre_m.iter().chain(&placement.rotation.coords);
            // The shortest text of a number has all of its bits.
            numbers.for_each(|number| text += &format!(",{number}"));
        }
    }
    Some(text)
}

/// Digests of all samples, of the given columns in their order.
///
/// Each digest has eight hexadecimal digits.
pub fn digests_of(trace: &Trace, columns: &[usize]) -> String {
    let columns: Vec<&[f64]> = columns.iter().map(|&at| trace.column(at)).collect();
    // Eight digits stand for a sample.
    let mut text = String::with_capacity(8 * trace.len());
    for sample in 0..trace.len() {
        // FNV-1a (Fowler, Noll, Vo) over the bits of the row.
        let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
        let row = columns.iter().map(|column| column[sample]);
        // The byte order is fixed, so digests are the same on all machines.
        for byte in row.flat_map(|value| value.to_bits().to_le_bytes()) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        // The fold keeps the high bits, which a plain cut would lose.
        text.push_str(&format!("{:08x}", (hash ^ (hash >> 32)) as u32));
    }
    text
}

/// Returns a name as a field of CSV, in quotes where it contains a separator (RFC 4180).
///
/// Semicolons and tabs separate the fields of tables, too.
fn csv_name(name: &str) -> Cow<'_, str> {
    if name.contains([',', ';', '\t', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", name.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(name)
    }
}

/// Trace as CSV: a time column, then all other signals, exactly.
pub fn csv_of(trace: &Trace) -> String {
    let mut text = String::from(TIME);
    let signals = trace.schema().signals().iter().enumerate();
    let others: Vec<usize> = signals
        .filter(|(_, signal)| signal.name != TIME)
        .map(|(column, signal)| {
            text.push(',');
            text.push_str(&csv_name(&signal.name));
            column
        })
        .collect();
    text.push('\n');
    for sample in 0..trace.len() {
        // Time is i · dt. Rounding removes the digits that binary fractions
        // add.
        let time_s = (sample as f64 * trace.dt_s() * 1e9).round() / 1e9;
        text.push_str(&time_s.to_string());
        for &column in &others {
            text.push(',');
            text.push_str(&trace.column(column)[sample].to_string());
        }
        text.push('\n');
    }
    text
}
