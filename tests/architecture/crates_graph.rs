//! Graph of the crates of the workspace, from `cargo metadata`.
//!
//! An arrow leads from a crate to one that uses it, and is left out where a longer path
//! leads there too.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// Crates with the crates that they use.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// Crates that only tests, benchmarks or Python use.
const ABOVE: [&str; 2] = ["brakecheck-python", "brakecheck-repro"];

/// Returns the graph in Mermaid's language.
pub fn mermaid() -> String {
    let graph = graph();
    let mut text = String::from("graph BT\n");
    for (name, uses) in &graph {
        for used in uses {
            let is_longer = |other: &&String| *other != used && reaches(&graph, other, used);
            if !uses.iter().any(|other| is_longer(&other)) {
                // Without spaces, an arrow is no option of a verb to the test of the pages.
                text += &format!("  {used}-->{name}\n");
            }
        }
    }
    text
}

/// Returns whether `from` uses `to`, through others or itself.
fn reaches(graph: &Graph, from: &str, to: &str) -> bool {
    let uses = graph.get(from).into_iter().flatten();
    uses.into_iter()
        .any(|used| used == to || reaches(graph, used, to))
}

/// Returns the crates of this workspace, without those above the facade.
fn graph() -> Graph {
    let cargo = std::env::var("CARGO").unwrap_or("cargo".to_owned());
    let mut command = Command::new(cargo);
    command.args(["metadata", "--no-deps", "--format-version", "1"]);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("cargo runs");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("metadata");
    let packages = metadata["packages"].as_array().expect("packages");
    let name = |value: &Value| value["name"].as_str().expect("a name").to_owned();
    let known: BTreeSet<String> = packages.iter().map(name).collect();
    let short = |name: String| match name.strip_prefix("brakecheck-") {
        Some(short) => short.to_owned(),
        None => name,
    };
    let mut graph = Graph::new();
    for package in packages {
        if ABOVE.contains(&&*name(package)) {
            continue;
        }
        let dependencies = package["dependencies"].as_array().expect("dependencies");
        let uses = dependencies
            .iter()
            .filter(|it| it["kind"].is_null())
            .map(name)
            .filter(|name| known.contains(name));
        graph.insert(short(name(package)), uses.map(short).collect());
    }
    graph
}
