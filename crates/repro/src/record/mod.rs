//! Measured rows with their origin, one file in `results/` per study.

mod origin;
pub(crate) mod probe;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use brakecheck::run_dir::{RunError, write_file};
use brakecheck_files::content_hash::fingerprint;
use brakecheck_files::run_files::disk::make_dir;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

pub(crate) use origin::RowOrigin;
use probe::DigestProbe;

/// Folder of the files, below the root of the repository.
const FOLDER: &str = "results";

/// Row as a study makes it.
pub(crate) struct NewRow {
    /// Name within the study.
    pub name: String,
    /// Command that makes it, without the program.
    pub command: String,
    /// Seeds in words.
    pub seeds: String,
    /// Everything that could change its numbers.
    pub depends: BTreeSet<DigestProbe>,
    /// Processor time, s. `None`: not measured.
    pub cpu_s: Option<f64>,
    /// Numbers of the row.
    pub data: Value,
}

/// Row of a file in `results/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ResultRow {
    /// Name within the study.
    pub name: String,
    /// Command that made it, without the program.
    pub command: String,
    /// Seeds in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub seeds: String,
    /// Program and machine.
    #[serde(flatten)]
    pub origin: RowOrigin,
    /// Processor time, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_s: Option<f64>,
    /// Digests at the time of the measurement, by probe.
    ///
    /// A row without any is of an earlier version, because no probe can vouch for it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub depends: BTreeMap<String, String>,
    /// Numbers of the row.
    pub data: Value,
    /// Hash of all other fields.
    pub seal: String,
}

/// Error of a file in `results/`.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The disk refuses.
    #[error(transparent)]
    Disk(#[from] RunError),
    /// The file cannot be read.
    #[error("cannot read `{}`: {error}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        error: std::io::Error,
    },
    /// A file is not of this format.
    #[error("`{}` is damaged: {error}", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        error: serde_json::Error,
    },
    /// A row was edited.
    #[error("row `{row}` of `{}` was changed since it was measured", path.display())]
    Edited {
        /// Path of the file.
        path: PathBuf,
        /// Name of the row.
        row: String,
    },
    /// The numbers of a row do not have the form of their table.
    #[error("`{field}` in row `{row}` of `{}` cannot be read: {error}", path.display())]
    Form {
        /// Path of the file.
        path: PathBuf,
        /// Name of the row.
        row: String,
        /// Name of the field.
        field: String,
        /// Reason.
        error: serde_json::Error,
    },
    /// A page lacks a comment between which its table stands.
    #[error("`{}` lacks the comment `{comment}`", path.display())]
    NoBorder {
        /// Path of the page.
        path: PathBuf,
        /// The comment.
        comment: &'static str,
    },
    /// A row names a probe of another version.
    #[error("row `{row}` depends on an unknown probe `{probe}`")]
    UnknownProbe {
        /// Name of the row.
        row: String,
        /// The probe.
        probe: String,
    },
}

impl ResultRow {
    /// Hash of all fields but the seal.
    fn hash(&self) -> String {
        let mut value = json!(self);
        if let Some(fields) = value.as_object_mut() {
            fields.remove("seal");
        }
        // A short prefix is enough against edits by hand.
        fingerprint(&value)[..16].to_owned()
    }

    fn sealed(mut self) -> ResultRow {
        self.seal = self.hash();
        self
    }

    /// Returns the probes whose digests differ now, or that no longer exist.
    pub(crate) fn changed(&self, now: &BTreeMap<String, String>) -> Vec<&str> {
        let differs = |(probe, digest): &(&String, &String)| now.get(*probe) != Some(digest);
        let changed = self.depends.iter().filter(differs);
        changed.map(|(probe, _)| probe.as_str()).collect()
    }

    /// Returns whether the numbers are those of this version.
    pub(crate) fn is_fresh(&self, now: &BTreeMap<String, String>) -> bool {
        // No probe vouches for a row that was entered by hand.
        !self.depends.is_empty() && self.changed(now).is_empty()
    }

    /// Returns the numbers of a row of a study.
    ///
    /// # Errors
    /// They are of another format.
    pub(crate) fn read<T: DeserializeOwned>(&self, study: &str) -> Result<T, RecordError> {
        T::deserialize(&self.data).map_err(|error| RecordError::Form {
            path: Path::new(FOLDER).join(format!("{study}.json")),
            row: self.name.clone(),
            field: self.unread_field::<T>(),
            error,
        })
    }

    /// Returns the name of the field at which reading fails.
    fn unread_field<T: DeserializeOwned>(&self) -> String {
        // Errors of values have no place, and those of a text have its line.
        let text = serde_json::to_string_pretty(&self.data).unwrap_or_default();
        let error = serde_json::from_str::<T>(&text).err();
        let message = error.as_ref().map_or(String::new(), ToString::to_string);
        let missing = message.split_once("missing field `");
        if let Some((name, _)) = missing.and_then(|(_, rest)| rest.split_once('`')) {
            return name.to_owned();
        }
        let indent = |line: &str| line.len() - line.trim_start().len();
        let most = error.map_or(0, |error| error.line());
        let lines: Vec<&str> = text.lines().take(most).collect();
        let depth = lines.last().map_or(0, |line| indent(line));
        // The elements of a list are below its name, and deeper.
        let mut above = lines.iter().rev().filter(|line| indent(line) <= depth);
        let name = above.find_map(|line| {
            let key = line.trim_start().strip_prefix('"')?;
            key.split_once("\": ").map(|(name, _)| name.to_owned())
        });
        name.unwrap_or_else(|| "data".to_owned())
    }
}

/// All measured rows, by study.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Results(BTreeMap<String, Vec<ResultRow>>);

impl Results {
    /// Reads all files below a root. Without the folder there are none.
    pub(crate) fn read(root: &Path) -> Result<Results, RecordError> {
        let folder = root.join(FOLDER);
        let unreadable = |error| RecordError::Read {
            path: folder.clone(),
            error,
        };
        let mut all = BTreeMap::new();
        // Before the first measurement there is no folder.
        if !folder.is_dir() {
            return Ok(Results(all));
        }
        for entry in folder.read_dir().map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            // The folder may hold notes beside the rows.
            if path.extension().is_none_or(|ending| ending != "json") {
                continue;
            }
            let study = path.file_stem().unwrap_or_default().to_string_lossy();
            all.insert(study.into_owned(), read(&path)?);
        }
        Ok(Results(all))
    }

    /// Returns the rows of a study, in order.
    pub(crate) fn of(&self, study: &str) -> &[ResultRow] {
        self.0.get(study).map_or(&[], Vec::as_slice)
    }

    /// Returns all rows with their studies.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&str, &ResultRow)> {
        let studies = self.0.iter();
        studies.flat_map(|(study, rows)| rows.iter().map(move |row| (study.as_str(), row)))
    }

    /// Replaces rows of a study by new ones of the same names, and writes the file.
    pub(crate) fn record(
        &mut self,
        root: &Path,
        study: &str,
        rows: Vec<NewRow>,
    ) -> Result<(), RecordError> {
        // Taken once, so that all rows of a command have one origin.
        let origin = RowOrigin::here(root);
        let mut probes: BTreeSet<DigestProbe> = BTreeSet::new();
        probes.extend(rows.iter().flat_map(|row| row.depends.iter().cloned()));
        // Rows are recorded by the program that measured them, so its digests are theirs.
        let digests = probe::digests(&probes);
        let kept = self.0.entry(study.to_owned()).or_default();
        for new in rows {
            let digest_of = |probe: &DigestProbe| {
                let name = probe.to_string();
                // Invariant: the digests are those of all probes of these rows.
                let digest = digests.get(&name).cloned().unwrap_or_default();
                (name, digest)
            };
            let row = ResultRow {
                depends: new.depends.iter().map(digest_of).collect(),
                name: new.name,
                command: new.command,
                seeds: new.seeds,
                origin: origin.clone(),
                // Fractions of a second are noise, and would change the file at each
                // measurement.
                cpu_s: new.cpu_s.map(|cpu_s| cpu_s.round()),
                data: rounded(new.data),
                // The hash leaves this field out, and `sealed` fills it in.
                seal: String::new(),
            }
            .sealed();
            // Rows of other names stay, since a command may measure a part of a study.
            kept.retain(|old| old.name != row.name);
            kept.push(row);
        }
        // The order of measurements must not show as a change of the file.
        kept.sort_by(|a, b| a.name.cmp(&b.name));
        write(&root.join(FOLDER).join(format!("{study}.json")), kept)
    }

    /// Returns the digests of all probes that rows depend on, as of this program.
    pub(crate) fn digests(&self) -> Result<BTreeMap<String, String>, RecordError> {
        let mut probes = BTreeSet::new();
        for (_, row) in self.rows() {
            for name in row.depends.keys() {
                let probe = name.parse().map_err(|()| RecordError::UnknownProbe {
                    row: row.name.clone(),
                    probe: name.clone(),
                })?;
                probes.insert(probe);
            }
        }
        Ok(probe::digests(&probes))
    }
}

fn read(path: &Path) -> Result<Vec<ResultRow>, RecordError> {
    let text = std::fs::read_to_string(path).map_err(|error| RecordError::Read {
        path: path.to_owned(),
        error,
    })?;
    let rows: Vec<ResultRow> =
        serde_json::from_str(&text).map_err(|error| RecordError::Damaged {
            path: path.to_owned(),
            error,
        })?;
    match rows.iter().find(|row| row.seal != row.hash()) {
        Some(row) => Err(RecordError::Edited {
            path: path.to_owned(),
            row: row.name.clone(),
        }),
        None => Ok(rows),
    }
}

/// Writes rows, each on a line of its own, so that a change of one shows as one.
fn write(path: &Path, rows: &[ResultRow]) -> Result<(), RecordError> {
    if let Some(folder) = path.parent() {
        make_dir(folder)?;
    }
    let lines: Vec<String> = rows
        .iter()
        .map(|row| {
            let mut value = json!(row);
            // Otherwise a feature of the JSON crate decides the order of the keys.
            value.sort_all_objects();
            value.to_string()
        })
        .collect();
    // A row per line, so that a change of one row is a change of one line.
    let text = format!("[\n{}\n]\n", lines.join(",\n"));
    Ok(write_file(path, text.as_bytes())?)
}

/// Rounds all numbers to five decimals, which no table shows.
fn rounded(value: Value) -> Value {
    match value {
        // Whole numbers are counts and seeds, of which each digit matters.
        Value::Number(number) if number.is_f64() => {
            let number = number.as_f64().unwrap_or_default();
            json!((number * 1e5).round() / 1e5)
        }
        Value::Array(all) => all.into_iter().map(rounded).collect(),
        Value::Object(map) => {
            let fields = map.into_iter();
            Value::Object(fields.map(|(name, it)| (name, rounded(it))).collect())
        }
        other => other,
    }
}
