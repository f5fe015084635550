//! Prints the libraries in the program with their licences, for `THIRD_PARTY.txt`.
//!
//! `cargo run --release --example notices > THIRD_PARTY.txt` reads `cargo metadata` and
//! the licence files of the packages. Run it again after a change of `Cargo.lock`.

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

fn main() {
    print!("{}", notices());
}

/// Package with its licence.
struct Package {
    title: String,
    licence: String,
    texts: Vec<String>,
}

fn notices() -> String {
    let packages = packages();
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
fn packages() -> Vec<Package> {
    let metadata = metadata();
    let linked = linked(&metadata);
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
