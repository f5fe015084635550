//! Prints the libraries in the program with their licences, for `THIRD_PARTY.txt`.
//!
//! `cargo run --release --example notices > THIRD_PARTY.txt` reads `cargo metadata` and
//! the licence files of the packages. Run it again after a change of `Cargo.lock`.
//! It fails if a dependency has a licence that is not allowed, comes from elsewhere than
//! the registry, or has no version.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

const HEAD: &str = "\
Libraries in the program and the wheel of brakecheck
====================================================

brakecheck itself has the MIT licence. Its program contains the following libraries, under
the licences below. The vehicle controller of rapier3d is ported and modified from Bullet's
btRaycastVehicle (Bullet Continuous Collision Detection and Physics Library, zlib licence).
The text of PNG and GIF files has the fonts DejaVu Sans Condensed, from the package dejavu.

This file is the output of `cargo run --release --example notices`.
";

/// Licence files of data inside of packages: package and path.
const OF_DATA: [[&str; 2]; 1] = [["dejavu", "assets/dejavu-fonts-ttf-2.37/LICENSE"]];

/// Licences of which each package needs one.
const ALLOWED: [&str; 13] = [
    "MIT",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "CDLA-Permissive-2.0",
    "ISC",
    "MPL-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

fn main() {
    let metadata = metadata();
    let wrong = wrong(&metadata);
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    print!("{}", notices(&metadata));
}

/// Returns the faults of all packages, those of tests and builds included.
fn wrong(metadata: &Value) -> Vec<String> {
    let mut wrong = Vec::new();
    for package in metadata["packages"].as_array().expect("packages") {
        let name = text_of(&package["name"]);
        let Some(source) = package["source"].as_str() else {
            // Its own packages name versions of all others.
            let dependencies = package["dependencies"].as_array().expect("a list");
            let any = dependencies
                .iter()
                .filter(|it| it["req"] == "*" && it["path"].is_null());
            wrong.extend(any.map(|it| format!("{name}: no version of {}", it["name"])));
            continue;
        };
        if !source.starts_with("registry+") {
            wrong.push(format!("{name}: from {source}"));
        }
        let licence = package["license"].as_str().unwrap_or("none");
        let is_allowed = spdx::Expression::parse_mode(licence, spdx::ParseMode::LAX)
            .is_ok_and(|it| it.evaluate(|licence| ALLOWED.contains(&&*licence.to_string())));
        if !is_allowed {
            wrong.push(format!("{name}: licence {licence}"));
        }
    }
    wrong
}

/// Package with its licence.
struct Package {
    title: String,
    licence: String,
    texts: Vec<String>,
}

fn notices(metadata: &Value) -> String {
    let packages = packages(metadata);
    let mut page = String::from(HEAD);
    for package in &packages {
        page += &format!("\n{}: {}", package.title, package.licence);
    }
    page.push('\n');
    let mut users: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in &packages {
        for text in &package.texts {
            users.entry(text).or_default().push(&package.title);
        }
    }
    for (text, users) in users {
        page += &format!("\n{}\n{}\n\n{text}\n", "-".repeat(78), users.join(", "));
    }
    page
}

/// Returns the packages that the program links, by name.
fn packages(metadata: &Value) -> Vec<Package> {
    let linked = linked(metadata);
    let list = metadata["packages"].as_array().expect("packages");
    let mut packages: Vec<Package> = list
        .iter()
        .filter(|it| linked.contains(text_of(&it["id"])) && !it["source"].is_null())
        .map(package)
        .collect();
    packages.sort_by(|a, b| a.title.cmp(&b.title));
    // Some packages, such as rapier3d, name the Apache licence without its text.
    let apache = |text: &&String| text.starts_with("Apache License");
    let mut texts = packages.iter().flat_map(|package| &package.texts);
    let apache = texts.find(apache).expect("an Apache licence").clone();
    for package in &mut packages {
        if package.licence == "Apache-2.0" && package.texts.is_empty() {
            package.texts.push(apache.clone());
        }
    }
    packages
}

fn metadata() -> Value {
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_owned());
    let mut command = Command::new(cargo);
    command.args(["metadata", "--locked", "--format-version", "1"]);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("cargo runs");
    serde_json::from_slice(&output.stdout).expect("metadata")
}

/// Returns the packages on which the program depends, other than for tests and builds.
fn linked(metadata: &Value) -> BTreeSet<&str> {
    let nodes: BTreeMap<&str, &Value> = metadata["resolve"]["nodes"]
        .as_array()
        .expect("nodes")
        .iter()
        .map(|it| (text_of(&it["id"]), it))
        .collect();
    let mut linked = BTreeSet::new();
    let mut open = vec![text_of(&metadata["resolve"]["root"])];
    while let Some(id) = open.pop() {
        if !linked.insert(id) {
            continue;
        }
        for dependency in nodes[id]["deps"].as_array().expect("dependencies") {
            let kinds = dependency["dep_kinds"].as_array().expect("kinds");
            if kinds.iter().any(|kind| kind["kind"].is_null()) {
                open.push(text_of(&dependency["pkg"]));
            }
        }
    }
    linked
}

fn package(value: &Value) -> Package {
    let licence = value["license"].as_str().unwrap_or("see its licence file");
    let manifest = Path::new(text_of(&value["manifest_path"]));
    let directory = manifest.parent().expect("a directory");
    let name = text_of(&value["name"]);
    let of_data = OF_DATA.iter().filter(|[package, _]| *package == name);
    let mut texts = texts(directory, licence);
    texts.extend(of_data.map(|[_, file]| text(&directory.join(file))));
    Package {
        title: format!("{name} {}", text_of(&value["version"])),
        licence: licence.to_owned(),
        texts,
    }
}

/// Returns the texts of the licences of a package, and its notices.
///
/// Of a package with a choice, the text of the MIT licence is enough.
fn texts(directory: &Path, licence: &str) -> Vec<String> {
    let entries = std::fs::read_dir(directory).expect("a package");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("a file").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    let begins = |name: &String, words: &[&str]| {
        let name = name.to_uppercase();
        words.iter().any(|word| name.starts_with(word))
    };
    let mut licences: Vec<&String> = names
        .iter()
        .filter(|name| begins(name, &["LICENSE", "LICENCE", "COPYING", "UNLICENSE"]))
        .filter(|name| directory.join(name).is_file())
        .collect();
    let mit = licences
        .iter()
        .position(|name| name.to_uppercase().contains("MIT"));
    if let (Some(mit), true) = (mit, licence.contains("OR")) {
        licences = vec![licences[mit]];
    }
    let notices = names.iter().filter(|name| begins(name, &["NOTICE"]));
    let files = licences.into_iter().chain(notices);
    files.map(|name| text(&directory.join(name))).collect()
}

/// Returns the text of a file without the whitespace at its lines' ends and its own.
fn text(file: &Path) -> String {
    let bytes = std::fs::read(file).expect("a text");
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    let text = lines.join("\n").trim().to_owned();
    // Copies of the Apache licence differ in their indentation and the appendix.
    if text.starts_with("Apache License") && text.contains("END OF TERMS AND CONDITIONS") {
        let (terms, _) = text.split_once("END OF TERMS").expect("its end");
        let lines: Vec<&str> = terms.lines().map(str::trim).collect();
        return lines.join("\n").trim().to_owned();
    }
    text
}

fn text_of(value: &Value) -> &str {
    value.as_str().expect("a text")
}
