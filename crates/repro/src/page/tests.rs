//! Pages and recorded rows of this version, and faults that must not pass.

use std::path::PathBuf;
use std::sync::OnceLock;

use serde_json::{Value, json};

use super::*;
use crate::record::NewRow;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn recorded() -> Results {
    Results::read(&root()).expect("sealed files")
}

/// Digests of this version, which take some seconds.
fn digests() -> &'static BTreeMap<String, String> {
    static DIGESTS: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    DIGESTS.get_or_init(|| recorded().digests().expect("known probes"))
}

fn pages(digests: &BTreeMap<String, String>) -> ResultPages {
    ResultPages::of(&root(), &recorded(), digests).expect("pages")
}

fn committed(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).expect("a page")
}

/// The page shows a row of an earlier version with its mark, so it cannot look fresh.
#[test]
fn the_pages_are_those_of_the_recorded_rows_and_of_this_version() {
    for (file, text) in pages(digests()).files() {
        let differs = committed(file)
            .lines()
            .zip(text.lines())
            .find(|(old, new)| old != new)
            .map(|(old, new)| format!("\n- {old}\n+ {new}"));
        assert!(
            committed(file) == text,
            "{file} is not made from results/*.json by this version: \
             run `cargo run --release -p brakecheck-repro -- page`{}",
            differs.unwrap_or_default()
        );
    }
}

#[test]
fn a_changed_digest_marks_its_rows() {
    let mut changed = digests().clone();
    let acc = changed.get_mut("world acc").expect("a probe of acc");
    acc.replace_range(0..1, if acc.starts_with('0') { "1" } else { "0" });
    let [(_, page), (_, readme)] = [0, 1].map(|at| {
        let pages = pages(&changed);
        let (file, text) = pages.files()[at];
        (file, text.to_owned())
    });
    for text in [&page, &readme] {
        let row = text.lines().find(|line| {
            let cell = line.trim_start_matches(['|', ' ']).split('|').next();
            line.starts_with('|')
                && cell.is_some_and(|cell| cell.trim().trim_end_matches(" †") == "acc")
        });
        assert!(row.is_some_and(|row| row.contains(OLD)), "{row:?}");
        assert!(
            text.contains("acc: of an earlier version, changed since: world acc"),
            "{text}"
        );
    }
    assert_ne!(page, committed(RESULTS));
    assert_ne!(readme, committed(README));
}

#[test]
fn a_table_without_rows_is_named_as_such() {
    for empty in ["", "\n\n", "|a|b|\n|---|---|\n\n† of an earlier version."] {
        assert_eq!(shown(empty), NOTHING, "{empty:?}");
    }
    assert_eq!(shown("|a|\n|---|\n|1|\n"), "|a|\n|---|\n|1|");
    assert_eq!(shown("- acc: version 0.2.0\n"), "- acc: version 0.2.0");
}

#[test]
fn a_readme_without_a_border_of_its_table_is_refused() {
    let [begin, end] = BORDERS;
    let page = format!("a\n{begin}\nold\n{end}\nb\n");
    let filled = between(&page, "new\n").expect("both borders");
    assert_eq!(filled, format!("a\n{begin}\nnew\n{end}\nb\n"));
    for comment in BORDERS {
        let error = between(&page.replace(comment, ""), "new").expect_err("a lacking border");
        assert_eq!(
            error.to_string(),
            format!("`README.md` lacks the comment `{comment}`")
        );
    }
}

#[test]
fn an_edited_row_is_refused() {
    let folder = tempfile::tempdir().expect("scratch");
    let results = folder.path().join("results");
    std::fs::create_dir(&results).expect("a folder");
    let text = committed("results/case-studies.json");
    let at = text.find("\"trivial\":").expect("a number") + "\"trivial\":".len();
    let edited = format!("{}9{}", &text[..at], &text[at..]);
    for (text, is_sound) in [(&text, true), (&edited, false)] {
        std::fs::write(results.join("case-studies.json"), text).expect("written");
        let read = Results::read(folder.path());
        assert_eq!(read.is_ok(), is_sound, "{read:?}");
    }
}

#[test]
fn a_row_whose_numbers_are_of_another_form_is_refused_by_its_field() {
    let results = recorded();
    let sound = &results.of("planners")[0];
    let error = |data: Value| {
        let row = ResultRow {
            data,
            ..sound.clone()
        };
        let read = row.read::<crate::near::NearFailing>("near-starts");
        read.expect_err("another form").to_string()
    };
    let acc = &results.of("near-starts")[0].data;
    let changed = |change: fn(&mut Value)| {
        let mut data = acc.clone();
        change(&mut data);
        error(data)
    };
    let begins = |field: &str| {
        let row = &sound.name;
        format!("`{field}` in row `{row}` of `results/near-starts.json` cannot be read: ")
    };
    let of_name = changed(|it| it["starts"] = json!("many"));
    assert!(of_name.starts_with(&begins("starts")), "{of_name}");
    let of_list = changed(|it| it["rows"][0]["ci95"][1] = json!("wide"));
    assert!(of_list.starts_with(&begins("ci95")), "{of_list}");
    let of_map = changed(|it| it["world"] = json!({ "name": "acc" }));
    assert!(of_map.starts_with(&begins("world")), "{of_map}");
    let of_nothing = error(json!({}));
    assert!(of_nothing.starts_with(&begins("world")), "{of_nothing}");
}

#[test]
fn recorded_rows_are_replaced_by_name_and_read_again() {
    let folder = tempfile::tempdir().expect("scratch");
    let row = |name: &str, data: Value| NewRow {
        name: name.to_owned(),
        command: "near-starts --world acc".to_owned(),
        seeds: "training seed 300".to_owned(),
        depends: [crate::record::probe::DigestProbe::Intervals].into(),
        cpu_s: Some(3.4),
        data,
    };
    let mut results = Results::default();
    let third = json!({ "share": 1.0 / 3.0 });
    for rows in [
        vec![row("b", third.clone()), row("a", json!(1))],
        vec![row("a", json!({ "share": 0.5 }))],
    ] {
        results
            .record(folder.path(), "study", rows)
            .expect("recorded");
    }
    let again = Results::read(folder.path()).expect("readable");
    assert_eq!(again, results);
    let data: Vec<&Value> = again.of("study").iter().map(|row| &row.data).collect();
    assert_eq!(
        data,
        [&json!({ "share": 0.5 }), &json!({ "share": 0.33333 })]
    );
    let now = again.digests().expect("known probes");
    assert!(again.rows().all(|(_, row)| row.is_fresh(&now)));
    assert!(again.rows().all(|(_, row)| !row.is_fresh(&BTreeMap::new())));
}

/// Numbers of the page come from the rows, so its text has none but names.
#[test]
fn the_text_of_the_page_has_no_numbers() {
    let names = [
        "95 %",
        "UN R157",
        "Seeds from 100 on",
        "Recall of 3",
        "100 runs",
        "40 starts",
        "Table I",
        "brakecheck-repro",
    ];
    let mut text = TEXT.to_owned();
    for name in names {
        text = text.replace(name, "");
    }
    let tables = tables::all(&RecordedRows {
        results: &recorded(),
        digests: digests(),
    });
    for (name, _) in tables.expect("rows of their forms") {
        let hole = format!("{{{{{name}}}}}");
        assert_eq!(text.matches(&hole).count(), 1, "{hole}");
        text = text.replace(&hole, "");
    }
    assert!(!text.contains("{{"), "{text}");
    let numbers: Vec<&str> = text
        .split_whitespace()
        .filter(|word| word.contains(|letter: char| letter.is_ascii_digit()))
        .collect();
    assert!(numbers.is_empty(), "{numbers:?}");
}

/// The page states this of the harder reading, in words.
#[test]
fn an_optimal_ado_captures_from_all_starts() {
    let results = recorded();
    for row in results
        .of("table1")
        .iter()
        .filter(|row| row.name == "grid_hard")
    {
        let captures: crate::table1::GridCaptures = row.read("table1").expect("captures");
        let mut optima = captures.cells.iter().map(|cell| cell.references.optimum);
        assert!(optima.all(|optimum| optimum == 1.0));
    }
}

#[test]
fn the_page_is_short_and_has_its_rows() {
    let page = committed(RESULTS);
    let words = page.split_whitespace().count();
    assert!(words <= 2_200, "{words} words");
    // Other studies have tables of some of their rows.
    for study in ["case-studies", "crashes", "structures", "planners"] {
        for row in recorded().of(study) {
            assert!(page.contains(&row.name), "{study}, {}", row.name);
        }
    }
}
