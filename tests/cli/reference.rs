//! Tables of reference, and every key of `--json` beside them.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Output;
use std::sync::LazyLock;

use brakecheck::stats::{Flips, StartOutcome};
use serde_json::{Value, json};

use super::help::verbs;
use super::program::{json as json_of, run_with, scratch, unchecked};
use super::{brakecheck, refused, root};

/// Verbs that print messages of a protocol, or a text for another program.
const WITHOUT_JSON: [&str; 4] = ["serve", "lsp", "completions", "man"];

/// World whose ado observes a derived signal of each unit, in the order of the table.
const DERIVED: &str = r#"Scenario(
    name: "derived", question: "Has each signal the range of its unit?",
    clock: (horizon_s: 10.0, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    road: Straight(lanes: 1, lane_width_m: 3.5, friction: 0.9),
    agents: [
        Vehicle(name: "ego", body: "sedan", lane: 0, start: At(x_m: 0.0, speed_mps: 20.0), drive: Ego(RssDriver())),
        Vehicle(name: "ado", body: "van", lane: 0, start: Ahead(of: "ego", headway_m: 40.0, speed_mps: 20.0),
            drive: Ado(actions: Accelerations([-6.0, 0.0, 2.0]), neutral: 1, observe: ["a", "b", "c", "d", "e"],
                rulebook: [Rule(name: "keeps moving", stl: "always (ado.speed >= 1)")])),
    ],
    signals: {
        "a": "ado.x - ego.x", "b": "ado.speed - ego.speed", "c": "ado.accel + ego.accel",
        "d": "time + time_left", "e": "ado.speed * 2",
    },
    ego_spec: "always (ego.ado.gap >= 0.2)",
)"#;

/// World whose ados observe by default, without its road and its other agents.
const USUAL: &str = r#"Scenario(
    name: "usual", question: "Do ados observe what the table states?",
    clock: (horizon_s: 10.0, decision_s: 0.5, sample_s: 0.05, substeps: 4), plant: Kinematic,
    road: ROAD,
    agents: [
        Vehicle(name: "ego", body: "sedan", lane: 0, start: At(x_m: 0.0, speed_mps: 20.0), drive: Ego(RssDriver())),
        AGENTS
    ],
    sensors: (position_sd_m: 0.1),
    ego_spec: "always (ego.speed >= 1)",
)"#;
const STRAIGHT: &str = "Straight(lanes: 1, lane_width_m: 3.5, friction: 0.8)";
const LANES: &str = "Straight(lanes: 2, lane_width_m: 3.5, friction: 0.8)";
const CURVED: &str =
    "Curved(lanes: 1, lane_width_m: 3.5, friction: 0.8, pieces: [Line(length_m: 80.0)])";
const QUEUE: &str = r#"Vehicle(name: "queue", body: "van", lane: 0, start: At(x_m: 150.0, speed_mps: 0.0), drive: Scripted(Stand)),"#;
const ADO: &str = r#"Vehicle(name: "ado", body: "van", lane: 0, start: Ahead(of: "ego", headway_m: 40.0, speed_mps: 20.0),
            drive: Ado(actions: Accelerations([-3.0, 0.0]), neutral: 1, lag_s: LAG,
                rulebook: [Rule(name: "moves", stl: "always (ado.speed >= 1)")])),"#;
const LIGHT: &str =
    r#"Light(name: "light", line_m: 90.0, drive: Schedule([(0.0, Yellow), (2.0, Red)])),"#;
const FOG: &str = r#"Weather(name: "fog", bounds: (friction: (0.4, 0.8), visibility_m: (35.0, 200.0), noise_scale: (1.0, 3.0)),
            start: (visibility_m: 200.0),
            drive: Ado(actions: Rates([(visibility_mps: -25.0), ()]), neutral: 1,
                rulebook: [Rule(name: "thins", stl: "always (fog.visibility >= 40)")])),"#;
const WALKER: &str = r#"Pedestrian(name: "walker", lateral_m: -3.0, facing: Left,
            start: Ahead(of: "ego", headway_m: 50.0, speed_mps: 0.0),
            drive: Ado(actions: Walks([(0.0, 0.0), (0.0, 1.4)]), neutral: 0,
                rulebook: [Rule(name: "stays", stl: "always (walker.lateral <= 9)")])),"#;
const BEND: &str = r#"Road(name: "bend", ahead_m: 60.0, piece_m: 20.0,
            drive: Ado(actions: Curvatures([0.0, 0.0125]), neutral: 0,
                rulebook: [Rule(name: "is wide", stl: "always (bend.radius >= 39.5)")])),"#;

/// Names of keys by verb.
type Keys = BTreeMap<String, BTreeSet<String>>;

fn page(topic: &str) -> Value {
    // Without the check below, which needs a page itself.
    let args = ["reference", topic, "--json"];
    json_of(&unchecked(root(), "brakecheck", &args))
}

fn tables(page: &Value) -> impl Iterator<Item = (&str, &Vec<Value>)> {
    let tables = page["tables"].as_array().expect("tables").iter();
    tables.map(|table| {
        let rows = table["rows"].as_array().expect("rows");
        (table["title"].as_str().expect("a title"), rows)
    })
}

/// Returns the words in code, such as the names in a cell.
fn words(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

fn keys() -> &'static Keys {
    static KEYS: LazyLock<Keys> = LazyLock::new(|| {
        let page = page("json");
        let mut keys = Keys::new();
        for (verbs, rows) in tables(&page) {
            let names = rows
                .iter()
                .flat_map(|row| words(row["key"].as_str().expect("names")));
            let names: Vec<&str> = names.collect();
            for verb in words(verbs) {
                let known = keys.entry(verb.to_owned()).or_default();
                known.extend(names.iter().map(|name| (*name).to_owned()));
            }
        }
        keys
    });
    &KEYS
}

/// Adds the keys of a value that the names lack, without those below them.
fn add_unknown(value: &Value, at: &str, known: &BTreeSet<String>, unknown: &mut BTreeSet<String>) {
    match value {
        Value::Array(all) => all
            .iter()
            .for_each(|it| add_unknown(it, at, known, unknown)),
        Value::Object(fields) => {
            if known.contains(&format!("{at}*")) {
                return;
            }
            for (key, inner) in fields {
                let name = format!("{at}{key}");
                let below = format!("{name}.");
                if known.contains(&name) || known.iter().any(|it| it.starts_with(&below)) {
                    add_unknown(inner, &below, known, unknown);
                } else {
                    unknown.insert(name);
                }
            }
        }
        _ => {}
    }
}

fn unknown(value: &Value, known: &BTreeSet<String>) -> BTreeSet<String> {
    let mut unknown = BTreeSet::new();
    add_unknown(value, "", known, &mut unknown);
    unknown
}

/// Panics if a verb printed a key that the table lacks.
#[track_caller]
pub fn check_keys(args: &[&str], output: &Output) {
    let own: Vec<&str> = args.iter().copied().take_while(|it| *it != "--").collect();
    if !own.contains(&"--json") {
        return;
    }
    // A failure prints no object.
    let Ok(printed) = serde_json::from_slice::<Value>(&output.stdout) else {
        return;
    };
    let Some(at) = own
        .iter()
        .position(|it| *it == "campaign" || keys().contains_key(*it))
    else {
        panic!("{args:?}: `brakecheck reference json` lacks the verb");
    };
    let verb = match &own[at..] {
        ["campaign", step, ..] => format!("campaign {step}"),
        rest => rest[0].to_owned(),
    };
    let unknown = unknown(&printed, &keys()[&verb]);
    assert!(
        unknown.is_empty(),
        "{args:?}: src/cli/reference/keys.txt lacks {unknown:?} of `{verb}`"
    );
}

#[test]
fn a_key_without_a_line_is_found() {
    let known = ["rows.ego", "rows.faults.kind", "rows.severity.kinds.*"];
    let known = known.map(str::to_owned).into();
    let row = json!({ "ego": "", "faults": [{ "kind": "" }], "severity": { "kinds": { "Rear": { "x": 1 } } } });
    assert_eq!(unknown(&json!({ "rows": [row] }), &known), [].into());
    let row = json!({ "ado": { "x": 1 }, "ego": { "id": 1 }, "faults": [{ "count": 1 }] });
    let found = unknown(&json!({ "rows": [{}, row], "n": 0 }), &known);
    let lacking = ["n", "rows.ado", "rows.ego.id", "rows.faults.count"];
    assert_eq!(found, lacking.map(str::to_owned).into());
}

#[test]
fn every_verb_is_in_the_tables_of_verbs_and_keys() {
    let known: BTreeSet<String> = verbs().iter().map(|words| words.join(" ")).collect();
    let verbs = page("verbs");
    let (_, rows) = tables(&verbs).next().expect("a table");
    let listed = rows
        .iter()
        .flat_map(|row| words(row["verb"].as_str().expect("a verb")));
    let all: BTreeSet<&str> = listed.collect();
    let leaves = known
        .iter()
        .map(String::as_str)
        .filter(|it| *it != "campaign");
    assert_eq!(all, leaves.clone().collect());
    let with_json: BTreeSet<&str> = leaves.filter(|it| !WITHOUT_JSON.contains(it)).collect();
    assert_eq!(
        keys().keys().map(String::as_str).collect::<BTreeSet<_>>(),
        with_json
    );
}

#[test]
fn every_row_has_a_meaning() {
    for (topic, column, least) in [
        ("verbs", "effect", 100),
        ("signals", "meaning", 60),
        ("json", "meaning", 150),
        ("world-file", "meaning", 500),
        ("egos", "meaning", 100),
    ] {
        let page = page(topic);
        let rows = tables(&page).flat_map(|(title, rows)| rows.iter().map(move |row| (title, row)));
        let rows: Vec<(&str, &Value)> = rows.filter(|(_, row)| row.get(column).is_some()).collect();
        assert!(rows.len() >= least, "{topic}: {} rows", rows.len());
        for (title, row) in rows {
            // Words of OpenSCENARIO have the meaning that it gives them, and alternatives
            // without a name that of their type.
            let is_word = row["field"].as_str().is_some_and(|it| {
                !it.contains('.') && !it.trim_matches('`').starts_with(char::is_lowercase)
            });
            let text = row[column].as_str().expect("a text");
            assert!(!text.is_empty() || is_word, "{topic}, {title}: {row}");
        }
    }
}

#[test]
fn the_tables_have_what_the_program_reads() {
    let cell = |topic: &str, title: &str, has: &str| {
        let page = page(topic);
        let found = tables(&page)
            .any(|(it, rows)| it == title && rows.iter().any(|row| row.to_string().contains(has)));
        assert!(found, "{topic}, {title}: {has}");
    };
    cell("egos", "`Idm`", "desired_speed_mps");
    cell("egos", "`CcDriver`", "`0.75`");
    cell("world-file", "`Scenario`", "`question`");
    cell("world-file", "`Cyclist`", "balance_mps");
    cell("world-file", "`AgentFile`", "`Pedestrian.lateral_m`");
    cell("world-file", "`Effect`", "`Teleport`");
    cell("signals", "Driving worlds", "A.B.ttc");
    cell("signals", "Grid worlds", "d_man");
    cell("signals", "Derived signals", "−5 to 5");
    cell("signals", "Default observation", "time_left");
    cell("verbs", "Options", "`--fail-on-counterexample`");
    cell("verbs", "Exit codes", "130");
    cell("verbs", "Reasons of `gate --on`", "`unless-unavoidable`");
    cell("verbs", "Starts of a gate", "no answer");
}

#[test]
fn the_exit_code_of_a_finding_has_the_cases_of_the_document() {
    let page = page("verbs");
    let (_, rows) = tables(&page)
        .find(|(title, _)| *title == "Exit codes")
        .expect("a table");
    let row = rows.iter().find(|row| row["code"] == "1").expect("a row");
    let shown: Vec<&str> = words(row["meaning"].as_str().expect("a text")).collect();
    let text = std::fs::read_to_string(root().join("docs/reference/files.md")).expect("a page");
    let line = text.lines().find(|line| line.starts_with("| 1 |"));
    let stated: Vec<&str> = words(line.expect("a row")).collect();
    assert_eq!(shown, stated);
}

#[test]
fn the_ranges_of_derived_signals_are_those_of_worlds() {
    let dir = scratch();
    std::fs::write(dir.path().join("derived.ron"), DERIVED).expect("a file");
    let checked = json_of(&unchecked(
        dir.path(),
        "brakecheck",
        &["check", "derived.ron", "--json"],
    ));
    let observed = checked["observed"].as_array().expect("observed signals");
    let ranges: Vec<String> = observed
        .iter()
        .map(|it| format!("{} to {}", it["lo"], it["hi"]).replace(".0", ""))
        .map(|it| it.replace('-', "−"))
        .collect();
    let page = page("signals");
    let (_, rows) = tables(&page)
        .find(|(title, _)| *title == "Derived signals")
        .expect("a table");
    let stated: Vec<&str> = rows
        .iter()
        .filter_map(|row| row["default range"].as_str())
        .collect();
    assert_eq!(ranges, stated);
}

/// Returns the names of what an ado of a world observes.
fn observed(world: &str) -> BTreeSet<String> {
    let dir = scratch();
    std::fs::write(dir.path().join("usual.ron"), world).expect("a file");
    let args = ["check", "usual.ron", "--json"];
    let checked = json_of(&unchecked(dir.path(), "brakecheck", &args));
    let all = checked["observed"].as_array().expect("signals").iter();
    all.map(|it| it["name"].as_str().expect("a name").to_owned())
        .collect()
}

#[test]
fn the_table_of_observed_signals_is_what_ados_observe() {
    let page = page("signals");
    let (_, rows) = tables(&page)
        .find(|(title, _)| *title == "Default observation")
        .expect("a table");
    // Parts of a world: the row, its letter and the name that stands for the letter.
    let always = [(4, "", ""), (8, "", "")];
    let ado = ADO.replace("LAG", "0.0");
    let beside_queue = [QUEUE, &ado].concat();
    let slow = [LIGHT, FOG, &ADO.replace("LAG", "0.5")].concat();
    let worlds = [
        (
            STRAIGHT,
            &*beside_queue,
            vec![(0, "B", "queue"), (1, "B", "ado")],
        ),
        (
            STRAIGHT,
            &*slow,
            vec![
                (1, "B", "ado"),
                (3, "B", "ado"),
                (5, "L", "light"),
                (6, "W", "fog"),
            ],
        ),
        (LANES, &*ado, vec![(1, "B", "ado"), (2, "B", "ado")]),
        (
            STRAIGHT,
            WALKER,
            vec![(1, "B", "walker"), (2, "B", "walker")],
        ),
        (CURVED, BEND, vec![(7, "R", "bend")]),
    ];
    let mut used = BTreeSet::new();
    for (road, agents, parts) in &worlds {
        let mut stated = BTreeSet::new();
        for (row, letter, name) in parts.iter().chain(&always) {
            used.insert(*row);
            let signals = words(rows[*row]["signals"].as_str().expect("signals"));
            stated.extend(signals.map(|signal| {
                let segments = signal.split('.');
                let named = segments.map(|part| if part == *letter { *name } else { part });
                named.collect::<Vec<&str>>().join(".")
            }));
        }
        let world = USUAL.replace("ROAD", road).replace("AGENTS", agents);
        assert_eq!(observed(&world), stated, "{world}");
    }
    assert_eq!(used, (0..rows.len()).collect(), "a row without a world");
}

/// Returns whether a row about starts applies to outcomes of the new ego and the baseline.
fn applies(row: &str, new: StartOutcome, old: StartOutcome) -> bool {
    use StartOutcome::{Invalid, NotReached, RuleViolation, Solved, Trivial};
    let is_missing = |it| matches!(it, Invalid | NotReached);
    let fails = |it| matches!(it, Solved | Trivial);
    match row {
        "an ego or the physics did not run" => is_missing(new) || is_missing(old),
        "both egos fail without an adversary" => (new, old) == (Trivial, Trivial),
        "both fail" => fails(new) && fails(old),
        "the new ego fails, the baseline does not" => fails(new) && !fails(old),
        "an ado breaks its rule against the new ego only" => {
            new == RuleViolation && old != RuleViolation
        }
        "the baseline fails, the new ego does not" => !fails(new) && fails(old),
        "neither fails" => !fails(new) && !fails(old),
        other => panic!("no test knows the row `{other}`"),
    }
}

/// Returns the first words of the effect that the comparison of two egos has.
fn effect(flips: &Flips) -> &'static str {
    let lists = [
        (&flips.both_fail, "fails on both, "),
        (&flips.newly_failing, "newly failing. "),
        (&flips.no_answer, "no answer: "),
        (&flips.newly_fixed, "newly fixed, "),
    ];
    let mut known = lists.iter().filter(|(starts, _)| !starts.is_empty());
    match (known.next(), known.next(), flips.compared) {
        (Some((_, said)), None, 1..) => said,
        (None, None, 1..) => "compared, without an effect",
        (None, None, 0) if flips.new_not_run + flips.old_not_run > 0 => "not compared, and counted",
        (None, None, 0) => "not compared, because ",
        _ => panic!("two effects: {flips:?}"),
    }
}

#[test]
fn the_table_of_starts_is_how_a_gate_compares_them() {
    use StartOutcome::{Held, Invalid, NotReached, RuleViolation, Solved, Trivial, Uncounted};
    let page = page("verbs");
    let (_, rows) = tables(&page)
        .find(|(title, _)| *title == "Starts of a gate")
        .expect("a table");
    let cell = |row: &Value, column: &str| row[column].as_str().expect("a text").to_owned();
    // The last row is of another comparison, without an adversary.
    let (last, compared) = rows.split_last().expect("rows");
    assert!(cell(last, "start").contains("neutral action"), "{last}");
    let outcomes = [
        Solved,
        Held,
        RuleViolation,
        Uncounted,
        Trivial,
        Invalid,
        NotReached,
    ];
    let mut used = BTreeSet::new();
    for (new, old) in outcomes
        .iter()
        .flat_map(|new| outcomes.map(|old| (*new, old)))
    {
        // Ten starts, so that McNemar's test can tell.
        let flips = Flips::of(&[new; 10], &[old; 10]);
        let first = compared
            .iter()
            .position(|row| applies(&cell(row, "start"), new, old));
        let at = first.expect("a row for each pair");
        used.insert(at);
        let stated = cell(&compared[at], "effect");
        let found = effect(&flips);
        assert!(stated.starts_with(found), "{new:?}, {old:?}: {found}");
        if stated.contains("McNemar's p leaves it out") {
            assert_eq!(flips.p_value() < 0.05, old != RuleViolation, "{old:?}");
        }
    }
    assert_eq!(used, (0..compared.len()).collect(), "a row without a pair");
}

#[test]
fn a_page_is_a_markdown_table_and_an_unknown_topic_is_refused() {
    let output = brakecheck(&["reference", "signals"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.starts_with("# Signals\n\nA signal is "), "{text}");
    assert!(
        text.contains("\n| signal | unit | meaning | in traces |\n| --- |"),
        "{text}"
    );
    assert!(text.contains("\n| `A.B.gap` | m | clearance "), "{text}");
    let topics = run_with(root(), &[], &["reference"]);
    let topics = String::from_utf8_lossy(&topics.stdout).into_owned();
    for topic in ["verbs", "signals", "json", "world-file", "egos"] {
        assert!(topics.contains(&format!("\n| `{topic}` | ")), "{topics}");
    }
    let said = refused(&["reference", "signal"], "'signal'");
    assert!(said.contains("signals"), "{said}");
}
