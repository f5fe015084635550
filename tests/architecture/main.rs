//! The rules of ARCHITECTURE.md that neither Cargo nor a lint holds, checked from the sources.

mod circles;
mod crates_graph;
mod files;
mod habits;
mod names;
mod pages;
mod references;
mod snippets;
mod sources;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use habits::Habit;
use sources::{Mention, Sources};

/// Crates that know no files, no clock and no terminal.
const WITHOUT_IO: [&str; 9] = [
    "crates/driver_model/src/",
    "crates/ego/src/",
    "crates/rl/src/",
    "crates/road/src/",
    "crates/scene/src/",
    "crates/sim/src/",
    "crates/stats/src/",
    "crates/stl/src/",
    "crates/story/src/",
];

/// The ego may be another process: it alone may talk and wait in these crates.
const MAY_TALK: &str = "crates/ego/src/ego/process";

/// No file below these uses another one that leads back to it.
const WITHOUT_CIRCLES: [&str; 24] = [
    "crates/story/src/",
    "crates/stl/src/",
    "crates/driver_model/src/",
    "crates/traffic/src/",
    "crates/rl/src/rl/",
    "crates/road/src/road/",
    "crates/files/src/ron_file/",
    "crates/scene/src/natural/",
    "crates/scene/src/scene/drive/",
    "crates/world/src/world/",
    "crates/view/src/view/",
    "crates/road/src/opendrive/",
    "crates/crashes/src/openx/",
    "crates/experiment/src/experiment/",
    "crates/experiment/src/adversary/",
    "crates/experiment/src/search/",
    "crates/crashes/src/crashes/",
    "crates/training/src/training/",
    "crates/training/src/population/",
    "crates/surrogate/src/surrogate/",
    "crates/evaluation/src/theorems/",
    "crates/risk/src/risk/",
    "crates/evaluation/src/evaluation/",
    "crates/campaign/src/campaign/",
];

/// All source files; of a published package, those that it has.
fn texts() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut texts = sources::list(root, "src");
    if !pages::is_published() {
        for name in crates(root) {
            texts.extend(sources::list(root, &format!("crates/{name}/src")));
        }
    }
    texts
}

/// Names of the directories below `crates`, in order.
fn crates(root: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(root.join("crates")).expect("a directory");
    let mut names: Vec<String> = entries
        .map(|entry| entry.expect("an entry").file_name())
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn library() -> &'static Sources {
    static LIBRARY: LazyLock<Sources> = LazyLock::new(|| Sources::read(&texts()));
    &LIBRARY
}

fn shown(sources: &Sources, mention: &Mention) -> String {
    let (file, line) = (&sources.files[mention.file], mention.line);
    format!("{file}:{line}: {}", mention.path.join("::"))
}

#[test]
fn the_page_has_the_graph_of_the_crates() {
    if pages::is_published() {
        return;
    }
    let page = files::read(&files::root().join("ARCHITECTURE.md"));
    let (_, graph) = page.split_once("```mermaid\n").expect("a graph");
    let (graph, _) = graph.split_once("```").expect("its end");
    assert_eq!(graph, crates_graph::mermaid());
    for name in crates(files::root()) {
        let line = format!("`{name}`");
        let known = page.contains(&line) || page.contains(&format!("`crates/{name}`"));
        assert!(known, "ARCHITECTURE.md lacks {line}");
    }
}

#[test]
fn no_file_uses_another_that_leads_back_to_it() {
    let sources = library();
    let mut wrong = String::new();
    for directory in &WITHOUT_CIRCLES {
        for circle in circles::circles(sources, directory) {
            let ties = circles::told(sources, directory, &circle);
            wrong += &format!("{directory}: a circle of {} files\n{ties}", circle.len());
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn below_the_world_there_is_no_file_no_clock_and_no_hidden_randomness() {
    const FORBIDDEN: [&str; 12] = [
        "std::fs",
        "std::time",
        "std::env",
        "std::process",
        "print!",
        "println!",
        "eprint!",
        "eprintln!",
        "dbg!",
        "rand::rng",
        "rand::thread_rng",
        "rand::random",
    ];
    let sources = library();
    let forbidden = |mention: &&Mention| {
        let file = &sources.files[mention.file];
        let below = WITHOUT_IO.iter().any(|own| file.starts_with(own));
        let talks = file.starts_with(MAY_TALK);
        let path = mention.path.join("::");
        let is = |word: &&str| {
            path.strip_prefix(*word)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
        };
        let seeds_itself = path.ends_with("from_os_rng") || path == "std::*";
        below && !talks && (seeds_itself || FORBIDDEN.iter().any(is))
    };
    let wrong: Vec<String> = sources
        .mentions
        .iter()
        .filter(forbidden)
        .map(|m| shown(sources, m))
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Where test starts are drawn, or told from others: where rates are reported.
/// Whatever tunes, adapts or trains draws from another purpose's stream.
const MAY_TEST: [&str; 7] = [
    "crates/stats/src/seed.rs",
    "crates/scene/src/testbench/gym.rs",
    "crates/experiment/src/experiment/test_starts.rs",
    "crates/evaluation/src/theorems/transfer.rs",
    "crates/campaign/src/campaign/check/egos.rs",
    "crates/repro/src/behaviours.rs",
    "crates/repro/src/table1/mod.rs",
];

#[test]
fn nothing_that_tunes_draws_a_test_start() {
    let sources = library();
    let draws = |mention: &&Mention| {
        let tests = mention
            .path
            .windows(2)
            .any(|w| w[0] == "Purpose" && ["Test", "*"].contains(&&*w[1]));
        tests && !MAY_TEST.contains(&&*sources.files[mention.file])
    };
    let wrong: Vec<String> = sources
        .mentions
        .iter()
        .filter(draws)
        .map(|m| shown(sources, m))
        .collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Every line of library code with its place; unit tests stand at the end of a
/// file, or are files.
fn lines() -> Vec<(String, String)> {
    let sources = library();
    let mut lines = Vec::new();
    for (file, (path, text)) in texts().iter().enumerate() {
        if sources.is_for_tests(&sources.module_of_file(file)) {
            continue;
        }
        let ends = [
            "#[cfg(test)]\nmod tests",
            "#[cfg(test)]\npub(super) mod tests",
        ]
        .iter()
        .filter_map(|end| text.find(end));
        let code = &text[..ends.min().unwrap_or(text.len())];
        for (i, line) in code.lines().enumerate() {
            let line = line.split("//").next().unwrap_or("").trim();
            lines.push((format!("{path}:{}", i + 1), line.to_owned()));
        }
    }
    lines
}

#[test]
fn episodes_are_played_in_one_parallel_loop() {
    // Benches of a worker's own, the wish to stop, the order of results.
    const LOOP: &str = "crates/experiment/src/experiment/episode_loop.rs";
    let per_worker = |(_, line): &(String, String)| line.contains("map_init(");
    let wrong: Vec<(String, String)> = lines().into_iter().filter(per_worker).collect();
    assert!(
        wrong.iter().all(|(place, _)| place.starts_with(LOOP)),
        "{wrong:#?}"
    );
    assert_eq!(wrong.len(), 1, "{LOOP} is elsewhere now");
}

#[test]
fn signals_and_robustness_are_double_precision() {
    // f64 in trace, stl and rulebook; f32 in rapier and the networks.
    for (place, line) in lines() {
        let double =
            place.starts_with("crates/stl/") || place.starts_with("crates/scene/src/rulebook");
        assert!(!(double && line.contains("f32")), "{place}");
    }
}

/// Where numbers become single: bodies of rapier, observations, what an ado is
/// told, rewards, networks, and pictures.
const MAY_CAST: [&str; 15] = [
    "crates/conformance/src/conformance/policy.rs",
    "crates/experiment/src/adversary/threshold_rule.rs",
    "crates/experiment/src/grid_solver/",
    // Stamps that were written in single precision.
    "crates/experiment/src/run_dir/samples/time.rs",
    "crates/risk/src/risk/run.rs",
    "crates/risk/src/risk/value_network.rs",
    "crates/rl/src/rl/",
    "crates/scene/src/scene/drive/observing.rs",
    "crates/scene/src/scene/grid/",
    "crates/scene/src/scene/world.rs",
    "crates/scene/src/testbench/gym.rs",
    "crates/sim/src/sim/rigid/",
    "crates/surrogate/src/surrogate/",
    "crates/view/src/view/",
    "crates/world/src/world/family.rs",
];

#[test]
fn numbers_become_single_in_few_places() {
    let casts = |(place, line): &(String, String)| {
        line.contains("as f32") && !MAY_CAST.iter().any(|may| place.starts_with(may))
    };
    let wrong: Vec<(String, String)> = lines().into_iter().filter(casts).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Rotations of nalgebra by an angle use the platform's sine. `pose::rotation_by` and
/// `Placement::upright` do not. A lint (clippy.toml) holds the other functions.
#[test]
fn rotations_are_not_the_platforms() {
    const OF_ANGLES: [&str; 3] = ["UnitComplex::new(", "_axis_angle(", "euler_angles("];
    let asks = |(place, line): &(String, String)| {
        let drawn = place.starts_with("crates/view/");
        !drawn && OF_ANGLES.iter().any(|call| line.contains(call))
    };
    let wrong: Vec<(String, String)> = lines().into_iter().filter(asks).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// In all crates: one re-exports the others.
#[test]
fn no_two_public_types_have_one_name() {
    let twice = names::twice(library(), &texts());
    assert!(twice.is_empty(), "\n{twice:#?}");
}

/// Names of types that several files may define, private ones included.
const MOST_SHARED_NAMES: usize = 7;

#[test]
fn few_types_share_a_name() {
    let shared = names::in_several_files(&texts());
    assert!(shared.len() <= MOST_SHARED_NAMES, "\n{shared:#?}");
}

#[test]
fn names_are_the_fields_words() {
    let private = names::private_words(library(), &texts());
    assert!(private.is_empty(), "\n{private:#?}");
    let wrong = "fn told() {} struct HeardFrom; struct A { met_s: f64 } fn f() { let asked = 1; }";
    let kept = "enum End { Asked } fn cast() {} fn broadcast(metres: f64) {}";
    let sources = Sources::read(&[("src/lib.rs", wrong), ("src/kept.rs", kept)]);
    let found = names::private_words(&sources, &[("src/lib.rs", wrong), ("src/kept.rs", kept)]);
    assert_eq!(found.len(), 4, "{found:?}");
}

/// Lines with each habit that remain, all of them older than the rule.
const MOST_LINES_WITH: [(Habit, usize); 3] = [
    (Habit::ConstantOnTheLeft, 0),
    (Habit::Rebinding, 41),
    (Habit::TupleParameter, 0),
];

#[test]
fn habits_that_hinder_reading_do_not_come_back() {
    let mut found: BTreeMap<Habit, Vec<String>> = BTreeMap::new();
    // A file of unit tests has no attribute of its own: its parent has it.
    let is_product = |(path, _): &(String, String)| !path.ends_with("/tests.rs");
    for (path, text) in texts().into_iter().filter(is_product) {
        for (habit, lines) in habits::habits(&text) {
            let places = lines.into_iter().map(|line| format!("{path}:{line}"));
            found.entry(habit).or_default().extend(places);
        }
    }
    for (habit, most) in MOST_LINES_WITH {
        let places = found.remove(&habit).unwrap_or_default();
        let count = places.len();
        assert!(
            count <= most,
            "{count} {habit:?}, at most {most}: {places:#?}"
        );
    }
}

/// A verb parses, calls the library and prints; what it decides is below.
const MOST_LINES_OF_A_VERB: usize = 40;

#[test]
fn a_verb_is_short() {
    const VERBS: [&str; 3] = ["run", "replay", "view"];
    let mut seen = 0;
    for (path, text) in texts() {
        if !path.starts_with("src/cli/") {
            continue;
        }
        let file = syn::parse_file(&text).expect("a source file");
        for item in &file.items {
            let syn::Item::Fn(verb) = item else { continue };
            if !VERBS.contains(&&*verb.sig.ident.to_string()) {
                continue;
            }
            let lines = verb.block.brace_token.span.close().end().line
                - verb.sig.fn_token.span.start().line;
            assert!(
                lines < MOST_LINES_OF_A_VERB,
                "{path}: `{}` has {lines} lines",
                verb.sig.ident
            );
            seen += 1;
        }
    }
    assert!(seen >= 10, "{seen} verbs");
}
