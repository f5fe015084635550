//! The changed copy of the crate, and its test programs.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use super::find::Mutant;
use super::switch::{Switched, switched};

pub type Fallible<T> = Result<T, Box<dyn Error>>;

/// The module that is added to the copy, which knows who is on.
const MODULE: &str = include_str!("mutant.rs.txt");

/// What is no source: built or recorded things.
const NOT_COPIED: [&str; 4] = ["target", "runs", "crashes", "reproduced"];
/// Candidates that are compiled in beyond the asked number, in percent: so
/// many may fail to compile without a further round.
const SPARE: usize = 20;

/// A mutant of the draw, whose id is its place in it, from 1.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Drawn {
    pub id: u32,
    /// The file, from the crate's root.
    pub file: String,
    pub mutant: Mutant,
}

/// Where the copy is made.
#[derive(Debug)]
pub struct Workshop {
    /// The crate that is copied.
    pub root: PathBuf,
    pub copy: PathBuf,
    /// Cargo's directory for the copy.
    pub target: PathBuf,
}

/// The mutants that compile, and what runs them.
#[derive(Debug)]
pub struct Built {
    /// The first asked ones of the draw that compile.
    pub mutants: Vec<Drawn>,
    /// Ids of those before the last of them that do not.
    pub dropped: Vec<u32>,
    /// Test programs by suite.
    pub programs: BTreeMap<String, PathBuf>,
    /// Names the state of all files of the copy.
    pub fingerprint: String,
}

impl Workshop {
    /// Compiles the first `count` mutants of a draw that can be compiled; those
    /// known not to are kept in a file.
    pub fn build(
        &self,
        draw: &[Drawn],
        count: usize,
        suites: &[String],
        dropped_file: &Path,
    ) -> Fallible<Built> {
        let known = fs::read_to_string(dropped_file).unwrap_or_default();
        let mut dropped: BTreeSet<u32> = serde_json::from_str(&known).unwrap_or_default();
        let fingerprint = loop {
            let alive = draw.iter().filter(|it| !dropped.contains(&it.id));
            let candidates: Vec<&Drawn> = alive.take(count + count * SPARE / 100 + 1).collect();
            let sources = self.switched(&candidates)?;
            let fingerprint = self.write(&sources, draw.len())?;
            eprintln!("compiling {} candidates …", candidates.len());
            let blamed = self.compile(&sources)?;
            if blamed.is_empty() {
                break fingerprint;
            }
            eprintln!("  do not compile: {blamed:?}");
            dropped.extend(blamed);
            fs::write(dropped_file, serde_json::to_string(&dropped)?)?;
        };
        let alive = draw.iter().filter(|it| !dropped.contains(&it.id));
        let mutants: Vec<Drawn> = alive.take(count).cloned().collect();
        let end = mutants.last().map_or(0, |last| last.id);
        Ok(Built {
            mutants,
            dropped: dropped.range(..end).copied().collect(),
            programs: self.programs(suites)?,
            fingerprint,
        })
    }

    /// The changed sources by file.
    fn switched(&self, candidates: &[&Drawn]) -> Fallible<BTreeMap<String, Switched>> {
        let mut by_file: BTreeMap<&str, Vec<(u32, &Mutant)>> = BTreeMap::new();
        for drawn in candidates {
            let mutant = (drawn.id, &drawn.mutant);
            by_file.entry(&drawn.file).or_default().push(mutant);
        }
        by_file
            .into_iter()
            .map(|(file, mutants)| {
                let source = fs::read_to_string(self.root.join(file))?;
                Ok((file.to_string(), switched(&source, &mutants)))
            })
            .collect()
    }

    /// Makes the copy equal to the crate with these sources; what is equal
    /// already keeps its time, so that cargo compiles it no second time.
    fn write(&self, sources: &BTreeMap<String, Switched>, ids: usize) -> Fallible<String> {
        let mut contents: BTreeMap<PathBuf, Vec<u8>> = BTreeMap::new();
        for file in list(&self.root)? {
            let content = fs::read(self.root.join(&file))?;
            contents.insert(file, content);
        }
        for (file, switched) in sources {
            contents.insert(file.into(), switched.text.clone().into_bytes());
        }
        let module = MODULE.replace("COUNT", &(ids + 1).to_string());
        for sources in libraries(&self.root)? {
            contents.insert(sources.join("mutant.rs"), module.clone().into_bytes());
            let head = contents.get_mut(&sources.join("lib.rs"));
            head.ok_or("no lib.rs")?.extend(b"\nmod mutant;\n");
        }

        fs::create_dir_all(&self.copy)?;
        for stray in list(&self.copy)?
            .iter()
            .filter(|file| !contents.contains_key(*file))
        {
            fs::remove_file(self.copy.join(stray))?;
        }
        let mut parts = Vec::new();
        for (file, content) in &contents {
            let to = self.copy.join(file);
            if fs::read(&to).ok().as_ref() != Some(content) {
                fs::create_dir_all(to.parent().unwrap_or(&self.copy))?;
                fs::write(&to, content)?;
            }
            parts.push(file.to_string_lossy().into_owned().into_bytes());
            parts.push(content.clone());
        }
        Ok(digest(&parts))
    }

    fn cargo(&self, verb: &[&str]) -> std::io::Result<Command> {
        let mut cargo = Command::new(std::env::var("CARGO").unwrap_or("cargo".into()));
        cargo
            .args(verb)
            .args(["--release", "--message-format=json", "--target-dir"])
            .arg(&self.target)
            .env("CARGO_INCREMENTAL", "1")
            .current_dir(&self.copy)
            .stderr(Stdio::null());
        for sources in libraries(&self.root)? {
            let package = match sources.strip_prefix("crates") {
                Ok(below) => {
                    let name = below.iter().next().unwrap_or_default();
                    format!("brakecheck-{}", name.to_string_lossy().replace('_', "-"))
                }
                Err(_) => "brakecheck".to_owned(),
            };
            let profile = format!("profile.release.package.{package}");
            cargo
                .args(["--config", &format!("{profile}.opt-level=1")])
                .args(["--config", &format!("{profile}.codegen-units=64")]);
        }
        Ok(cargo)
    }

    /// Compiles the library; the ids that are to blame where it fails.
    fn compile(&self, sources: &BTreeMap<String, Switched>) -> Fallible<BTreeSet<u32>> {
        let output = self
            .cargo(&[
                "build",
                "--lib",
                "--workspace",
                "--exclude",
                "brakecheck-python",
            ])?
            .output()?;
        if output.status.success() {
            return Ok(BTreeSet::new());
        }
        let errors: Vec<Value> = messages(&output.stdout)
            .map(|mut m| m["message"].take())
            .filter(|m| m["level"] == "error")
            .collect();
        let mut blamed = BTreeSet::new();
        for error in &errors {
            let switches = |(file, span)| sources.get(&file).map(|s| s.blamed(&span));
            let mut found = places(error).into_iter().filter_map(switches);
            blamed.extend(found.find(|ids| !ids.is_empty()).unwrap_or_default());
        }
        if blamed.is_empty() {
            let first = errors.first().and_then(|e| e["rendered"].as_str());
            return Err(first.unwrap_or("cargo build fails in the copy").into());
        }
        Ok(blamed)
    }

    /// Compiles the suites that there are.
    fn programs(&self, suites: &[String]) -> Fallible<BTreeMap<String, PathBuf>> {
        let mut verb = vec!["test", "--no-run"];
        if suites.iter().any(|suite| suite.starts_with("brakecheck-")) {
            // With the facade, so that the dependencies keep their features.
            verb.extend(["--lib", "-p", "brakecheck"]);
        }
        let libraries = libraries(&self.root)?;
        for suite in suites.iter().map(|suite| program_of(suite)) {
            let there = libraries.iter().any(|sources| {
                let file = self.copy.join(sources).with_file_name("tests").join(suite);
                file.with_extension("rs").exists() || file.join("main.rs").exists()
            });
            if suite == "lib" {
                // Unit tests of every crate.
                verb.extend(["--lib", "--workspace", "--exclude", "brakecheck-python"]);
            } else if suite.starts_with("brakecheck-") {
                verb.extend(["-p", suite]);
            } else if there {
                verb.extend(["--test", suite]);
            } else {
                eprintln!("there is no suite {suite}");
            }
        }
        let output = self.cargo(&verb)?.output()?;
        let mut programs = BTreeMap::new();
        for message in messages(&output.stdout) {
            if message["message"]["level"] == "error" {
                return Err(message["message"]["rendered"].to_string().into());
            }
            if let Some(program) = message["executable"].as_str()
                && message["profile"]["test"] == true
            {
                let target = &message["target"];
                let name = match target["name"].as_str().unwrap_or_default() {
                    "brakecheck" => "lib",
                    name => name,
                };
                programs.insert(name.to_string(), PathBuf::from(program));
            }
        }
        if suites.iter().all(|suite| suite != "lib") {
            programs.remove("lib");
        }
        Ok(programs)
    }
}

/// The part of a suite that names its program: `worlds` of `worlds:vector_env`.
pub fn program_of(suite: &str) -> &str {
    suite.split_once(':').map_or(suite, |(program, _)| program)
}

/// Files and bytes an error points to, primary spans first.
fn places(error: &Value) -> Vec<(String, Range<usize>)> {
    let mut spans: Vec<&Value> = error["spans"].as_array().into_iter().flatten().collect();
    spans.sort_by_key(|span| span["is_primary"] != true);
    let place = |mut span: &Value| {
        // Out of macros, to where they are called.
        while span["expansion"].is_object() {
            span = &span["expansion"]["span"];
        }
        let byte = |name: &str| span[name].as_u64().unwrap_or(0) as usize;
        let file = span["file_name"].as_str().unwrap_or_default();
        (file.to_string(), byte("byte_start")..byte("byte_end"))
    };
    spans.into_iter().map(place).collect()
}

fn messages(stdout: &[u8]) -> impl Iterator<Item = Value> {
    let lines = stdout.split(|byte| *byte == b'\n');
    lines.filter_map(|line| serde_json::from_slice(line).ok())
}

/// The source folders of all libraries, where the switches of a crate ask which is on.
fn libraries(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut all = vec![PathBuf::from("src")];
    for entry in fs::read_dir(root.join("crates"))? {
        all.push(Path::new("crates").join(entry?.file_name()).join("src"));
    }
    all.retain(|sources| root.join(sources).join("lib.rs").exists());
    all.sort();
    Ok(all)
}

/// All files of a crate that are no built or recorded things, from its root.
pub fn list(root: &Path) -> std::io::Result<Vec<PathBuf>> {
    let (mut files, mut directories) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(directory) = directories.pop() {
        for entry in fs::read_dir(directory)? {
            let path = entry?.path();
            let from_root = path.strip_prefix(root).unwrap_or(&path);
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with('.') || NOT_COPIED.iter().any(|not| from_root == Path::new(not)) {
                continue;
            }
            if path.is_dir() {
                directories.push(path);
            } else {
                files.push(from_root.to_path_buf());
            }
        }
    }
    files.sort();
    Ok(files)
}

/// A short name of some contents.
pub fn digest(parts: &[impl AsRef<[u8]>]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part.as_ref().len().to_le_bytes());
        hash.update(part);
    }
    let digest = hash.finalize();
    digest
        .iter()
        .take(8)
        .map(|byte| format!("{byte:02x}"))
        .collect()
}
