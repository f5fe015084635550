//! Content of an ego's program: its executable and its files, by their SHA-256.
//!
//! A command's text does not change when its program is built anew, so stored results
//! are bound to this content. It covers the executable, the arguments that are files, and
//! the modules beside a Python script that it imports. It does not cover anything that the
//! program loads by itself, such as shared libraries, installed packages and weights.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::disk::write_file;
use super::{OtherProgram, RunError};
use crate::content_hash::{self, fingerprint, sha256};
use crate::ego::Process;
use crate::ron_file::{file_bytes, file_text};
use crate::visible::command_line;

/// File of the programs in a directory of stored results.
pub const FILE: &str = "programs.json";
/// Largest file that is read.
const MOST_BYTES: u64 = 512 << 20;
/// Most files of a program that are read.
const MOST_FILES: usize = 1000;

/// Content of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramContent {
    /// SHA-256 of all its files.
    pub sha256: String,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// SHA-256 of each file, by its name in the command or beside a script.
    pub files: BTreeMap<String, String>,
    /// Parts of the program that are known to be missing, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_covered: Vec<String>,
}

/// Contents of programs by the names of their egos.
pub type ProgramContents = BTreeMap<String, ProgramContent>;

impl ProgramContent {
    /// Reads the content of a program from the disk.
    pub fn of(process: &Process) -> ProgramContent {
        let mut reading = Reading::default();
        let command = &process.command;
        if let Some((program, arguments)) = command.split_first() {
            reading.executable(program);
            // Interpreters take code or a module name after these words, and neither is
            // a file.
            let is_text = |word: &String| word == "-c" || word == "-e" || word == "-m";
            for (word, next) in arguments
                .iter()
                .zip(arguments[1.min(arguments.len())..].iter())
            {
                // A word that exists on the disk is read as an argument below.
                if is_text(word) && !Path::new(next).exists() {
                    let missing = format!("what `{word} {next}` starts or loads");
                    reading.not_covered.push(missing);
                }
            }
            for argument in arguments {
                reading.argument(argument);
            }
        }
        let Reading {
            files, not_covered, ..
        } = reading;
        ProgramContent {
            // A program that is started anew per episode may act otherwise than one that
            // stays.
            sha256: fingerprint(&json!([files, process.fresh])),
            command: command.clone(),
            files,
            not_covered,
        }
    }

    /// Returns the names of the files that differ from those of an earlier content.
    fn changed_since(&self, before: &ProgramContent) -> Vec<String> {
        // Both sides, because a file that was added or left out is a change as well.
        let names: BTreeSet<&String> = self.files.keys().chain(before.files.keys()).collect();
        let differs = |name: &&&String| self.files.get(**name) != before.files.get(**name);
        names
            .iter()
            .filter(differs)
            .map(|it| (*it).clone())
            .collect()
    }
}

/// Files of a program that were read so far.
#[derive(Default)]
struct Reading {
    files: BTreeMap<String, String>,
    not_covered: Vec<String>,
}

impl Reading {
    fn executable(&mut self, program: &str) {
        match resolved(program) {
            Some(path) => self.add(program, &path),
            None => self
                .not_covered
                .push(format!("`{program}`, which is not found")),
        }
    }

    fn argument(&mut self, argument: &str) {
        let path = Path::new(argument);
        if path.is_dir() {
            self.not_covered.push(format!("the files in `{argument}`"));
        } else if path.is_file() {
            self.add(argument, path);
        }
    }

    /// Adds a file, and the modules beside it that it imports.
    fn add(&mut self, name: &str, path: &Path) {
        // Modules may import each other in a cycle.
        if self.files.contains_key(name) {
            return;
        }
        // The size comes before the read, so a huge file never fills the memory.
        let size = path.metadata().map(|meta| meta.len());
        let read = match size {
            Ok(size) if size <= MOST_BYTES && self.files.len() < MOST_FILES => file_bytes(path),
            Ok(_) => {
                let missing = format!("`{name}`, which is beyond {MOST_FILES} files of 512 MiB");
                self.not_covered.push(missing);
                return;
            }
            Err(error) => Err(error),
        };
        match read {
            Ok(bytes) => {
                self.files.insert(name.to_owned(), sha256(&bytes));
                self.imports(path, &bytes);
            }
            Err(error) => self.not_covered.push(format!("`{name}`: {error}")),
        }
    }

    fn imports(&mut self, path: &Path, bytes: &[u8]) {
        let extension = path.extension().and_then(|it| it.to_str());
        let is_python = extension == Some("py") || is_python_script(bytes);
        if !is_python {
            // These languages name the files that they load in ways that are not parsed
            // here.
            if matches!(
                extension,
                Some("sh" | "js" | "mjs" | "rb" | "lua" | "jl" | "pl")
            ) {
                let missing = format!("files that `{}` loads", path.display());
                self.not_covered.push(missing);
            }
            return;
        }
        let beside = path.parent().unwrap_or(Path::new(""));
        for module in imported(&String::from_utf8_lossy(bytes)) {
            let mut file = beside.join(&module);
            // A module may be a package, which is a directory without the extension.
            self.package(&file);
            file.set_extension("py");
            if file.is_file() {
                self.add(&file.display().to_string(), &file);
            }
        }
    }

    /// Adds the Python files of a package.
    fn package(&mut self, dir: &Path) {
        let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        // Directories have no fixed order, and the limit on files depends on the order.
        paths.sort();
        for path in paths {
            // A link may lead to a directory above, and the walk would not end.
            let is_link = path.is_symlink();
            if path.extension().is_some_and(|it| it == "py") && path.is_file() {
                self.add(&path.display().to_string(), &path);
            } else if path.is_dir() && !is_link && self.files.len() < MOST_FILES {
                self.package(&path);
            }
        }
    }
}

/// Returns whether a text begins with a line that names Python as its interpreter.
fn is_python_script(bytes: &[u8]) -> bool {
    let line = bytes
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    line.starts_with(b"#!") && String::from_utf8_lossy(line).contains("python")
}

/// Returns the first names of the modules that a Python text imports.
fn imported(text: &str) -> BTreeSet<String> {
    // Names in parentheses may go on over several lines.
    let mut depth = 0_usize;
    let joined: String = text
        .chars()
        .map(|c| {
            match c {
                '(' => depth += 1,
                ')' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if c == '\n' && depth > 0 { ' ' } else { c }
        })
        .collect();
    // A text with an open parenthesis in a comment or a string is read as it is, too.
    let statements = joined.split(['\n', ';']).chain(text.split(['\n', ';']));
    let imports = statements.filter_map(|line| {
        match line.trim_start().split_once(char::is_whitespace)? {
            ("import", names) => Some(names),
            ("from", rest) => match rest.split_once(" import") {
                // The names of a bare `from .` are modules beside the file.
                Some((dots, names)) if dots.trim().trim_matches('.').is_empty() => Some(names),
                Some((name, _)) => Some(name),
                None => Some(rest),
            },
            _ => None,
        }
    });
    let names = imports.flat_map(|names| names.split(','));
    let first = names.filter_map(|name| {
        let name = name.trim_start_matches(|c: char| c.is_whitespace() || c == '.' || c == '(');
        let end = name.find(|c: char| !(c.is_alphanumeric() || c == '_'));
        let first = &name[..end.unwrap_or(name.len())];
        (!first.is_empty()).then(|| first.to_owned())
    });
    first.collect()
}

/// Returns the file of a program, found as a shell does.
fn resolved(program: &str) -> Option<PathBuf> {
    if program.contains('/') {
        let path = PathBuf::from(program);
        return path.is_file().then_some(path);
    }
    let path = std::env::var_os("PATH")?;
    let mut candidates = std::env::split_paths(&path).map(|dir| dir.join(program));
    candidates.find(|path| path.is_file())
}

/// Binds the results in a directory to the contents of the programs that give them.
///
/// The first call writes the contents, and later ones compare them. `has_results` is true
/// if the directory has results already.
///
/// # Errors
/// A program has another content than in the directory, or it has results without one. The
/// disk refuses, or the file is damaged.
pub fn bind_programs(
    dir: &Path,
    programs: &ProgramContents,
    has_results: bool,
) -> Result<(), RunError> {
    // Results of other egos need no such file, and none is written.
    if programs.is_empty() {
        return Ok(());
    }
    let Some(before) = stored_programs(dir)? else {
        return match programs.iter().next() {
            // Nothing shows which program made the results, so they cannot be continued.
            Some((ego, program)) if has_results => Err(other_program(dir, ego, program, None)),
            _ => write_file(&dir.join(FILE), text_of(programs).as_bytes()),
        };
    };
    let joined = joined_programs(dir, &before, programs)?;
    // An unchanged file needs no write, which a full disk could refuse.
    if joined == before {
        return Ok(());
    }
    write_file(&dir.join(FILE), text_of(&joined).as_bytes())
}

/// Returns the programs of a directory together with further ones. Nothing is written.
///
/// # Errors
/// A program has another content than in `before`.
pub fn joined_programs(
    dir: &Path,
    before: &ProgramContents,
    programs: &ProgramContents,
) -> Result<ProgramContents, RunError> {
    let mut joined = before.clone();
    for (ego, program) in programs {
        match before.get(ego) {
            Some(was) if was.sha256 != program.sha256 => {
                return Err(other_program(dir, ego, program, Some(was)));
            }
            Some(_) => {}
            None => {
                joined.insert(ego.clone(), program.clone());
            }
        }
    }
    Ok(joined)
}

fn other_program(
    dir: &Path,
    ego: &str,
    program: &ProgramContent,
    was: Option<&ProgramContent>,
) -> RunError {
    RunError::OtherProgram(Box::new(OtherProgram {
        path: dir.into(),
        ego: ego.to_owned(),
        command: command_line(&program.command),
        was: was.map(|it| it.sha256.clone()),
        is: program.sha256.clone(),
        changed: was.map_or_else(Vec::new, |it| program.changed_since(it)),
    }))
}

/// Returns the contents of programs that a directory's results are bound to, if any.
///
/// # Errors
/// The file cannot be read or is damaged.
pub fn stored_programs(dir: &Path) -> Result<Option<ProgramContents>, RunError> {
    let path = dir.join(FILE);
    if !path.exists() {
        return Ok(None);
    }
    let damaged = |why: String| RunError::Damaged {
        path: path.clone(),
        why,
    };
    let text = file_text(&path).map_err(|error| damaged(error.to_string()))?;
    let file: ProgramsFile =
        serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
    content_hash::check(&text, &file.sha256).map_err(damaged)?;
    Ok(Some(file.programs))
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProgramsFile {
    programs: ProgramContents,
    sha256: String,
}

fn text_of(programs: &ProgramContents) -> String {
    let blank = content_hash::BLANK;
    // Sealed at the end, because names before the hash may contain as many zeros.
    content_hash::seal_last(&format!(
        "{}\n",
        json!({ "programs": programs, "sha256": blank })
    ))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn content(command: &[String]) -> ProgramContent {
        ProgramContent::of(&Process::new(command))
    }

    #[test]
    fn every_file_of_a_program_is_part_of_it_and_others_are_not() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = |name: &str| dir.path().join(name).display().to_string();
        let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).expect("it");
        fs::create_dir_all(dir.path().join("net/deep")).expect("made");
        write("ego.py", "import json, helper\nfrom net.deep import x\n");
        write("helper.py", "import more as m\n");
        write("more.py", "");
        write("net/__init__.py", "");
        write("net/deep/a.py", "");
        write("other.py", "");
        write("weights.bin", "1");
        let command = ["python3".to_owned(), file("ego.py"), file("weights.bin")];
        let before = content(&command);
        assert_eq!(before, content(&command));
        assert_eq!(before.files.len(), 7, "{:?}", before.files.keys());
        assert_eq!(before.not_covered, Vec::<String>::new());
        for name in [
            "ego.py",
            "helper.py",
            "more.py",
            "net/deep/a.py",
            "weights.bin",
        ] {
            let text = fs::read_to_string(dir.path().join(name)).expect("there");
            write(name, &format!("{text}\n"));
            let after = content(&command);
            assert_ne!(after.sha256, before.sha256, "{name}");
            assert_eq!(after.changed_since(&before), [file(name)]);
            write(name, &text);
        }
        write("other.py", "x = 1");
        assert_eq!(before, content(&command));
    }

    #[test]
    fn imports_are_found_in_every_form() {
        let text = "import a, b.c as d; import e\nfrom . import f as g, h\nfrom .i import j\n\
                    from k.l import m\n  from .. import (n,\n    o)  # (\nimport p\nimported = q";
        let found: Vec<String> = imported(text).into_iter().collect();
        assert_eq!(found, ["a", "b", "e", "f", "h", "i", "k", "n", "o", "p"]);
    }

    #[test]
    fn what_is_not_covered_is_named() {
        let words = |command: &[&str]| {
            let command: Vec<String> = command.iter().map(|it| (*it).to_owned()).collect();
            content(&command).not_covered.join("; ")
        };
        assert_eq!(
            words(&["sh", "-c", "./ego --fast"]),
            "what `-c ./ego --fast` starts or loads"
        );
        assert!(words(&["/none/ego"]).contains("not found"));
        assert!(words(&["sh", "/"]).contains("the files in `/`"));
    }

    #[test]
    fn results_are_bound_to_the_content_of_their_program() {
        let dir = tempfile::tempdir().expect("scratch");
        let ego = dir.path().join("ego").display().to_string();
        let bind = |text: &str, has_results: bool| {
            fs::write(&ego, text).expect("written");
            let programs = [("mine".to_owned(), content(std::slice::from_ref(&ego)))];
            bind_programs(dir.path(), &programs.into(), has_results)
        };
        let error = bind("1", true).expect_err("whose results?").to_string();
        assert!(error.contains("without"), "{error}");
        bind("1", false).expect("bound");
        bind("1", true).expect("the same");
        let error = bind("2", true).expect_err("rebuilt").to_string();
        let digest = |text: &str| {
            fs::write(&ego, text).expect("written");
            content(std::slice::from_ref(&ego)).sha256
        };
        for part in [&digest("1")[..16], &digest("2")[..16], &ego[..]] {
            assert!(error.contains(part), "{error}");
        }
        let path = dir.path().join(FILE);
        let text = fs::read_to_string(&path).expect("there");
        fs::write(&path, text.replacen("ego", "eGo", 1)).expect("changed");
        let error = bind("1", true).expect_err("damaged").to_string();
        assert!(error.contains(FILE), "{error}");
    }
}
