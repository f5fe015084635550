//! The floors of ARCHITECTURE.md, checked from the sources.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// A module uses only floors below its own.
const FLOORS: [(&str, u32); 19] = [
    ("seed", 0),
    ("seal", 0),
    ("trace", 0),
    ("rl", 0),
    ("sim", 0),
    ("stl", 1),
    ("ego", 1),
    ("rulebook", 2),
    ("scene", 2),
    ("testbench", 3),
    ("conformance", 3),
    ("scenario", 4),
    ("run", 5),
    ("campaign", 6),
    ("view", 6),
    ("report", 6),
    ("cli", 7),
    ("lib", 8),
    ("main", 8),
];

/// Floors below this one know no files, no clock and no terminal.
const FIRST_WITH_IO: u32 = 4;

/// The ego may be another process: it alone may talk and wait below floor 4.
const MAY_TALK: &str = "src/ego/process";

fn floor(module: &str) -> Option<u32> {
    FLOORS.iter().find(|(m, _)| *m == module).map(|(_, f)| *f)
}

fn sources(dir: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(dir).expect("the source directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Every source file with its module and its lines of library code.
fn library() -> BTreeMap<PathBuf, (String, Vec<(usize, String)>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(&root.join("src"), &mut files);
    let mut library = BTreeMap::new();
    for file in files {
        let relative = file
            .strip_prefix(root)
            .expect("inside the crate")
            .to_owned();
        let module = relative
            .components()
            .nth(1)
            .map(|c| {
                c.as_os_str()
                    .to_string_lossy()
                    .trim_end_matches(".rs")
                    .to_owned()
            })
            .expect("a module");
        let text = fs::read_to_string(&file).expect("a source file");
        // Unit tests stand at the end of a file, or are one.
        let code = match text.starts_with("#![cfg(test)]") {
            true => "",
            false => text.split("#[cfg(test)]\nmod tests").next().unwrap_or(""),
        };
        let lines = code
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.split("//").next().unwrap_or("").to_owned()))
            .collect();
        library.insert(relative, (module, lines));
    }
    library
}

#[test]
fn every_module_stands_on_a_floor() {
    for (path, (module, _)) in library() {
        assert!(
            floor(&module).is_some(),
            "{} is on no floor: add it to ARCHITECTURE.md and to this test",
            path.display()
        );
    }
}

#[test]
fn modules_use_only_floors_below_their_own() {
    let mut wrong = Vec::new();
    for (path, (module, lines)) in library() {
        let own = floor(&module).expect("on a floor");
        for (number, line) in lines {
            for rest in line.split("crate::").skip(1) {
                let used: String = rest
                    .chars()
                    .take_while(|c| c.is_alphanumeric() || *c == '_')
                    .collect();
                let below = floor(&used).is_none_or(|f| f < own);
                if used != module && !below {
                    wrong.push(format!("{}:{number}: {}", path.display(), line.trim()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn below_the_scenario_there_is_no_file_no_clock_and_no_hidden_randomness() {
    const FORBIDDEN: [&str; 8] = [
        "std::fs",
        "std::time",
        "std::env",
        "std::process",
        "println!",
        "rand::rng",
        "thread_rng",
        "from_os_rng",
    ];
    let mut wrong = Vec::new();
    for (path, (module, lines)) in library() {
        let talks = path.starts_with(MAY_TALK);
        if talks || floor(&module).is_some_and(|f| FIRST_WITH_IO <= f) {
            continue;
        }
        for (number, line) in lines {
            if FORBIDDEN.iter().any(|word| line.contains(word)) {
                wrong.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Where test starts are drawn, or told from others: where rates are reported.
/// Whatever tunes, identifies or trains draws from another purpose's stream.
const MAY_TEST: [&str; 6] = [
    "src/seed.rs",
    "src/testbench/gym.rs",
    "src/campaign/behaviours.rs",
    "src/campaign/starts.rs",
    "src/campaign/table1/mod.rs",
    "src/campaign/theorems/transfer.rs",
];

#[test]
fn nothing_that_tunes_draws_a_test_start() {
    let mut wrong = Vec::new();
    for (path, (_, lines)) in library() {
        if MAY_TEST.iter().any(|may| path == Path::new(may)) {
            continue;
        }
        for (number, line) in lines {
            if line.contains("Purpose::Test") || line.contains("Purpose::*") {
                wrong.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn library_code_does_not_unwrap() {
    let mut wrong = Vec::new();
    for (path, (_, lines)) in library() {
        for (number, line) in lines {
            if [
                ".unwrap()",
                ".expect(",
                "todo!(",
                "unimplemented!(",
                "dbg!(",
            ]
            .iter()
            .any(|word| line.contains(word))
            {
                wrong.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn signals_and_robustness_are_double_precision() {
    // f64 in trace, stl and rulebook; f32 in rapier and the networks.
    for (path, (module, lines)) in library() {
        if ["trace", "stl", "rulebook"].contains(&module.as_str()) {
            for (number, line) in lines {
                assert!(!line.contains("f32"), "{}:{number}", path.display());
            }
        }
    }
}
