//! The floors of ARCHITECTURE.md, checked from the sources.

mod circles;
#[path = "../support/files.rs"]
mod files;
mod names;
mod pages;
mod references;
mod snippets;
mod sources;

use std::path::Path;
use std::sync::LazyLock;

use sources::{Mention, Sources};

/// A module uses only floors below its own.
const FLOORS: [(&str, u32); 45] = [
    ("seed", 0),
    ("content_hash", 0),
    ("visible", 0),
    ("doc_pages", 0),
    ("trace", 0),
    ("sim", 0),
    ("rl", 1),
    ("stl", 1),
    ("ego", 1),
    ("severity", 1),
    ("traffic", 2),
    ("rulebook", 2),
    ("road", 2),
    ("scene", 3),
    ("stats", 3),
    ("natural", 4),
    ("preventability", 4),
    ("grid_solver", 4),
    ("testbench", 5),
    ("conformance", 5),
    ("opendrive", 6),
    ("ron_file", 6),
    ("world", 7),
    ("vector_env", 8),
    ("run_dir", 8),
    ("view", 11),
    ("report", 9),
    ("openx", 9),
    ("experiment", 10),
    ("adversary", 11),
    ("search", 12),
    ("crashes", 13),
    ("training", 14),
    ("population", 15),
    ("surrogate", 15),
    ("theorems", 15),
    ("serving", 15),
    ("risk", 16),
    ("evaluation", 16),
    ("campaign", 17),
    ("internals", 18),
    ("cli", 18),
    ("lib", 19),
    ("repro", 19),
    ("main", 20),
];

/// Floors below this one know no files, no clock and no terminal.
const FIRST_WITH_IO: u32 = 6;

/// The ego may be another process: it alone may talk and wait below floor 5.
const MAY_TALK: &str = "src/ego/process";

/// No file below these uses another one that leads back to it.
const WITHOUT_CIRCLES: [&str; 22] = [
    "crates/stl/src/",
    "crates/traffic/src/",
    "src/rl/",
    "src/road/",
    "src/ron_file/",
    "src/natural/",
    "src/scene/drive/",
    "src/world/",
    "src/view/",
    "src/opendrive/",
    "src/openx/",
    "src/experiment/",
    "src/adversary/",
    "src/search/",
    "src/crashes/",
    "src/training/",
    "src/population/",
    "src/surrogate/",
    "src/theorems/",
    "src/risk/",
    "src/evaluation/",
    "src/campaign/",
];

fn floor(module: &str) -> Option<u32> {
    FLOORS.iter().find(|(m, _)| *m == module).map(|(_, f)| *f)
}

/// The name on a floor of a module, by its path from the crate on.
fn floor_name(module: &[String]) -> &str {
    match module.first().map(String::as_str) {
        Some("brakecheck") => module.get(1).map_or("lib", String::as_str),
        Some("brakecheck_stl") if module.get(1).is_some_and(|name| name == "trace") => "trace",
        Some("brakecheck_stl") => "stl",
        Some("brakecheck_traffic") => "traffic",
        Some("brakecheck_repro") => "repro",
        first => first.unwrap_or("lib"),
    }
}

/// All source files; of a published package, those that it has.
fn texts() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut texts = sources::list(root, "src");
    if !pages::is_published() {
        texts.extend(sources::list(root, "crates/stl/src"));
        texts.extend(sources::list(root, "crates/traffic/src"));
        texts.extend(sources::list(root, "crates/repro/src"));
    }
    texts
}

fn library() -> &'static Sources {
    static LIBRARY: LazyLock<Sources> = LazyLock::new(|| Sources::read(&texts()));
    &LIBRARY
}

fn shown(sources: &Sources, mention: &Mention) -> String {
    let (file, line) = (&sources.files[mention.file], mention.line);
    format!("{file}:{line}: {}", mention.path.join("::"))
}

/// Mentions of a floor that is not below.
fn upward(sources: &Sources) -> Vec<String> {
    let goes_up = |mention: &&Mention| {
        let module = sources.module_of_file(mention.file);
        let own = floor_name(&module);
        let Some((defined, _)) = &mention.defined else {
            return false;
        };
        // Both where it is named and where it comes from.
        [&mention.path, defined].into_iter().any(|used| {
            let (used, is_root) = (floor_name(used), used.len() == 1 && used[0] == "brakecheck");
            let below = floor(used).is_none_or(|f| floor(own).is_some_and(|own| f < own));
            used != own && !below && !is_root
        })
    };
    let mentions = sources.mentions.iter().filter(goes_up);
    mentions.map(|mention| shown(sources, mention)).collect()
}

/// What writes to a terminal, in code that is no comment.
fn writes(text: &str) -> Option<usize> {
    let writes = ["println!(", "print!(", "dbg!(", "io::stdout()"];
    let mut lines = text.lines().map(str::trim_start);
    lines.position(|line| !line.starts_with("//") && writes.iter().any(|word| line.contains(word)))
}

#[test]
fn one_file_writes_to_the_terminal_and_escapes_what_others_wrote() {
    assert_eq!(
        writes("/// println!(\nlet a = 1;\n    eprintln!(\"{a}\");"),
        Some(2)
    );
    // The messages of a protocol, and a test.
    let may = [
        "src/cli/terminal.rs",
        "src/cli/serve.rs",
        "src/cli/crashes.rs",
    ];
    for (path, text) in texts() {
        if let (Some(line), false) = (writes(&text), may.contains(&path.as_str())) {
            panic!("{path}:{}: printed without being escaped", line + 1);
        }
    }
}

#[test]
fn every_module_stands_on_a_floor() {
    let sources = library();
    for file in 0..sources.files.len() {
        let module = sources.module_of_file(file);
        assert!(
            floor(floor_name(&module)).is_some(),
            "{} is on no floor: add it to ARCHITECTURE.md and to this test",
            sources.files[file]
        );
    }
}

#[test]
fn modules_use_only_floors_below_their_own() {
    let wrong = upward(library());
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
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
fn below_the_scenario_there_is_no_file_no_clock_and_no_hidden_randomness() {
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
        let module = sources.module_of_file(mention.file);
        let below = floor(floor_name(&module)).is_some_and(|f| f < FIRST_WITH_IO);
        let talks = sources.files[mention.file].starts_with(MAY_TALK);
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
    "src/seed.rs",
    "src/testbench/gym.rs",
    "src/experiment/test_starts.rs",
    "src/theorems/transfer.rs",
    "src/campaign/check/egos.rs",
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
        ];
        let ends = ends.iter().filter_map(|end| text.find(end));
        let code = &text[..ends.min().unwrap_or(text.len())];
        for (i, line) in code.lines().enumerate() {
            let line = line.split("//").next().unwrap_or("").trim();
            lines.push((format!("{path}:{}", i + 1), line.to_owned()));
        }
    }
    lines
}

#[test]
fn library_code_does_not_unwrap() {
    const WORDS: [&str; 5] = [
        ".unwrap()",
        ".expect(",
        "todo!(",
        "unimplemented!(",
        "dbg!(",
    ];
    let is_wrong = |(_, line): &(String, String)| WORDS.iter().any(|word| line.contains(word));
    let wrong: Vec<(String, String)> = lines().into_iter().filter(is_wrong).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn episodes_are_played_in_one_parallel_loop() {
    // Benches of a worker's own, the wish to stop, the order of results.
    const LOOP: &str = "src/experiment/episode_loop.rs";
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
        let double = place.starts_with("crates/stl/") || place.starts_with("src/rulebook");
        assert!(!(double && line.contains("f32")), "{place}");
    }
}

/// Where numbers become single: bodies of rapier, observations, what an ado is
/// told, rewards, networks, and pictures.
const MAY_CAST: [&str; 14] = [
    "src/adversary/threshold_rule.rs",
    "src/conformance/policy.rs",
    "src/grid_solver/",
    "src/risk/run.rs",
    "src/risk/value_network.rs",
    "src/rl/",
    "src/scene/drive/observing.rs",
    "src/scene/grid/",
    "src/scene/world.rs",
    "src/sim/rigid/",
    "src/surrogate/",
    "src/testbench/gym.rs",
    "src/view/",
    "src/world/family.rs",
];

#[test]
fn numbers_become_single_in_few_places() {
    let casts = |(place, line): &(String, String)| {
        line.contains("as f32") && !MAY_CAST.iter().any(|may| place.starts_with(may))
    };
    let wrong: Vec<(String, String)> = lines().into_iter().filter(casts).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The platform's functions differ in their last bits; `libm` does not.
#[test]
fn mathematics_is_not_the_platforms() {
    const FUNCTIONS: &str = "acos asin atan atan2 cbrt cos cosh exp exp2 exp_m1 hypot ln ln_1p \
                             log log10 log2 powf sin sin_cos sinh tan tanh";
    // Rotations of nalgebra come from `sim::rotation_by` and `Placement::upright`.
    const OF_ANGLES: [&str; 3] = ["UnitComplex::new(", "_axis_angle(", "euler_angles("];
    let calls = FUNCTIONS.split_whitespace();
    let calls: Vec<String> = calls
        .map(|function| format!(".{function}("))
        .chain(OF_ANGLES.map(str::to_owned))
        .collect();
    let asks = |(place, line): &(String, String)| {
        let drawn = place.starts_with("src/view/");
        !drawn && calls.iter().any(|call| line.contains(call))
    };
    let wrong: Vec<(String, String)> = lines().into_iter().filter(asks).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// In both packages: one is re-exported by the other.
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
    assert!(10 <= seen, "{seen} verbs");
}
