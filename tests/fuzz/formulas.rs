//! Formulas: in any spelling the value by the book, in any damage no panic.

use brakecheck::stl::{Formula, Interval, Names, Scratch, Settings, StlError, TraceEnd, Until};
use brakecheck::trace::{Schema, Signal, Trace};
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::corpus::{self, Source};
use super::harness::{Seen, Target};
use super::mutate::mutants;
use super::naive::{self, Lengths, doubtful, naive, naive_held, rows, wff, zeros};

/// The same word or sign in another spelling (docs/reference/stl.md).
const SPELLINGS: [(&str, &[&str]); 22] = [
    ("always", &["globally", "alw", "G", "[]", "□"]),
    ("eventually", &["ev", "F", "<>", "◇"]),
    ("historically", &["H"]),
    ("once", &["O"]),
    ("next", &["X"]),
    ("prev", &["Y"]),
    ("s_next", &["sX"]),
    ("s_prev", &["sY"]),
    ("until", &["U"]),
    ("unless", &["W"]),
    ("release", &["R"]),
    ("since", &["S"]),
    ("not", &["!", "~", "¬"]),
    ("and", &["&", "&&", "/\\", "∧"]),
    ("or", &["|", "||", "\\/", "∨"]),
    ("implies", &["->", "=>", "→"]),
    ("iff", &["<->", "<=>", "↔"]),
    ("true", &["TRUE", "(0 < 1)"]),
    ("==", &["==="]),
    ("!=", &["!==", "≠"]),
    (">=", &["≥"]),
    ("<=", &["≤"]),
];

/// A formula in canonical words, each respelt as the indices say.
fn respelt(text: &str, choices: &[Index]) -> String {
    let mut choices = choices.iter().cycle();
    let mut words = text.split(' ').map(|word| {
        let open = word.len() - word.trim_start_matches('(').len();
        let rest = &word[open..];
        let plain = rest
            .find('[')
            .map_or(rest, |at| &rest[..at])
            .trim_end_matches(')');
        let Some((_, others)) = SPELLINGS.iter().find(|(known, _)| *known == plain) else {
            return word.to_owned();
        };
        // `true` has a comparison among its spellings: its margin would be 1.
        let others = if plain == "true" {
            &others[..1]
        } else {
            others
        };
        let choice = choices
            .next()
            .map_or(0, |index| index.index(others.len() + 2));
        match others.get(choice) {
            Some(other) => format!("{}{other}{}", &word[..open], &rest[plain.len()..]),
            None => word.to_owned(),
        }
    });
    let first = words.next().unwrap_or_default();
    words.fold(first, |text, word| format!("{text} {word}"))
}

fn spelling() -> impl Strategy<Value = Vec<Index>> {
    prop::collection::vec(any::<Index>(), 1..12)
}

fn modes() -> impl Strategy<Value = (Until, TraceEnd)> {
    let until = select(vec![Until::HalfOpen, Until::Closed]);
    (
        until,
        select(vec![TraceEnd::Truncate, TraceEnd::Strict, TraceEnd::Hold]),
    )
}

#[test]
fn any_formula_has_the_value_of_the_definition_however_it_is_read() {
    let target = Target {
        name: "formula",
        cases: 2000,
        shrinks: 4000,
        least_percent: (100, 0),
    };
    // Whether every comparison in it always has a value.
    let sure = wff().prop_map(|wff| (wff, true));
    let formulas = prop_oneof![3 => sure, 1 => doubtful().prop_map(|wff| (wff, false))];
    let runs = prop_oneof![3 => rows(), 1 => zeros()];
    let inputs = (formulas, spelling(), runs, modes());
    target.run(&inputs, |((wff, sure), spelling, rows, (until, end))| {
        let closed = *until == Until::Closed;
        let n = rows.len();
        let by_the_book = |rows: &[[f64; 3]]| match end {
            TraceEnd::Hold => naive_held(wff, rows, closed),
            _ => {
                let bounded = if *end == TraceEnd::Strict {
                    usize::MAX
                } else {
                    rows.len()
                };
                let lengths = Lengths {
                    bounded,
                    unbounded: rows.len(),
                    closed,
                };
                naive(wff, rows, lengths)[0].0
            }
        };
        let want = by_the_book(rows);
        let text = respelt(&wff.text(), spelling);
        let formula: Formula = text
            .parse()
            .unwrap_or_else(|e: StlError| panic!("{}", e.render(&text)));
        assert_eq!(formula, wff.formula(), "{text}");
        assert_eq!(
            formula.to_string().parse::<Formula>().as_ref(),
            Ok(&formula),
            "{text}"
        );
        let settings = naive::settings(*until, *end);
        let monitor = formula
            .bind_with(&naive::schema(), &Names::default(), &settings)
            .unwrap_or_else(|e| panic!("{}", e.render(&text)));
        let trace = naive::trace(rows);
        let mut scratch = Scratch::new();
        assert_eq!(monitor.robustness(&trace, &mut scratch), want, "{text}");
        let truth = monitor.satisfied(&trace, &mut scratch);
        assert!(want == 0.0 || truth == (want > 0.0), "{text}");
        explained(&monitor.explain(&trace), want);
        // Online: exactly the interval of the definition at every prefix.
        let (mut unknown, mut known) = (monitor.online(), monitor.online_for(n));
        for i in 0..n {
            let loose = unknown.push(&rows[i]).expect("a sample");
            let tight = known.push(&rows[i]).expect("a sample");
            assert!(
                loose.contains(want) && tight.contains(want),
                "{text} after {i}"
            );
            let lengths = |bounded, unbounded| Lengths {
                bounded,
                unbounded,
                closed,
            };
            let prefix = naive::trace(&rows[..=i]);
            assert_eq!(
                loose,
                monitor.interval(&prefix, &mut scratch),
                "{text} after {i}"
            );
            if *sure && *end != TraceEnd::Hold {
                let (lo, hi) = naive(wff, &rows[..=i], lengths(usize::MAX, usize::MAX))[0];
                assert_eq!(loose, Interval { lo, hi }, "{text} after {i}");
            }
            if *sure && *end == TraceEnd::Truncate && i + 1 < n {
                let (lo, hi) = naive(wff, &rows[..=i], lengths(n, n))[0];
                assert_eq!(tight, Interval { lo, hi }, "{text} after {i} of {n}");
            }
            assert_eq!(
                unknown.clone().finish(),
                by_the_book(&rows[..=i]),
                "{text} to {i}"
            );
        }
        assert_eq!(known.interval(), Interval { lo: want, hi: want }, "{text}");
        Seen::Accepted
    });
}

/// One value all the way down, and the leaf's is that of the run.
fn explained(explanation: &brakecheck::stl::Explanation, want: f64) {
    assert_eq!(explanation.robustness, want);
    for step in &explanation.path {
        assert_eq!(step.value.abs(), want.abs(), "{explanation}");
    }
    assert!(serde_json::to_string(explanation).is_ok());
}

/// Formulas of the worlds, of the documents and of the vectors.
fn texts() -> Vec<Source> {
    let quoted = corpus::worlds().into_iter().flat_map(|world| {
        let mut pieces = world.text.split('"').skip(1).step_by(2);
        let mut texts = Vec::new();
        for piece in &mut pieces {
            if piece.parse::<Formula>().is_ok() && piece.contains(' ') {
                texts.push(Source::new(world.name.clone(), piece));
            }
        }
        texts
    });
    let page = std::fs::read_to_string(corpus::root().join("docs/reference/stl.md"));
    let spans: Vec<String> = page
        .expect("the page")
        .split('`')
        .skip(1)
        .step_by(2)
        .map(|s| s.replace("\\|", "|"))
        .collect();
    let told = spans
        .into_iter()
        .filter(|text| text.parse::<Formula>().is_ok())
        .map(|text| Source::new("docs/reference/stl.md", text));
    let vectors: Vec<Source> =
        std::fs::read_to_string(corpus::root().join("tests/stl/agreed.jsonl"))
            .expect("vectors")
            .lines()
            .step_by(10)
            .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"))
            .map(|line| Source::new("agreed.jsonl", line["formula"].as_str().expect("a text")))
            .collect();
    quoted.chain(told).chain(vectors).collect()
}

fn schema() -> Schema {
    let real = [
        "x",
        "y",
        "z",
        "headway",
        "ego.speed",
        "ado.speed",
        "d_long",
        "d_lat",
    ];
    let boolean = ["on", "red", "contact"].map(|name| Signal::boolean(name, ""));
    let signals = real
        .map(|name| Signal::real(name, "", ""))
        .into_iter()
        .chain(boolean);
    Schema::new(0.5, signals).expect("a schema")
}

#[test]
fn any_text_is_a_formula_that_reads_back_or_an_error_with_a_place() {
    let target = Target {
        name: "text",
        cases: 6000,
        shrinks: 4000,
        least_percent: (10, 20),
    };
    let corpus = texts();
    assert!(corpus.len() > 100, "{} formulas", corpus.len());
    target.run(&mutants(corpus.into()), |mutant| {
        let text = mutant.text.as_str();
        let refused = |error: StlError| {
            let span = error.span();
            assert!(
                error.formula().is_some() || text.get(span.clone()).is_some(),
                "{span:?}"
            );
            assert!(!error.render(text).is_empty() && !error.label().is_empty());
            Seen::Refused
        };
        let formula: Formula = match text.parse() {
            Ok(formula) => formula,
            Err(error) => return refused(error),
        };
        let canonical = formula.to_string();
        assert_eq!(
            canonical.parse::<Formula>().as_ref(),
            Ok(&formula),
            "{canonical}"
        );
        let constants = [
            ("T", 15.0),
            ("d_safe", 4.7),
            ("v_min", 0.5),
            ("v_lim", 30.0),
        ];
        let names = Names {
            constants: constants
                .map(|(name, value)| (name.to_owned(), value))
                .into(),
            ..Names::default()
        };
        let monitor = match formula.bind_with(&schema(), &names, &Settings::default()) {
            Ok(monitor) => monitor,
            Err(error) => return refused(error),
        };
        let mut trace = Trace::new(schema().into());
        let (mut online, mut scratch) = (monitor.online(), Scratch::new());
        for i in 0..12u32 {
            let row: Vec<f64> = (0..11u32)
                .map(|j| f64::from((i * (j + 3) + j) % 7) - if j < 8 { 3.0 } else { 0.0 })
                .enumerate()
                .map(|(j, v)| if j < 8 { v } else { v % 2.0 })
                .collect();
            trace.push(&row).expect("finite");
            let interval = online.push(&row).expect("a sample");
            assert_eq!(
                interval,
                monitor.interval(&trace, &mut scratch),
                "{canonical} after {i}"
            );
        }
        let value = monitor.robustness(&trace, &mut scratch);
        assert!(!value.is_nan(), "{canonical}");
        assert_eq!(online.finish(), value, "{canonical}");
        explained(&monitor.explain(&trace), value);
        Seen::Accepted
    });
}

#[test]
fn every_spelling_is_the_same_formula() {
    for (word, others) in SPELLINGS.iter().filter(|(word, _)| *word != "true") {
        let form = |word: &str| {
            if ["==", "!=", ">=", "<="].contains(&word) {
                format!("x {word} 1")
            } else {
                format!("(x > 1) {word} (x < 2)")
            }
        };
        for other in *others {
            let (plain, spelt) = (
                form(word),
                form(word).replace(&format!(" {word} "), &format!(" {other} ")),
            );
            let prefix = plain.parse::<Formula>().is_err();
            let (plain, spelt) = if prefix {
                (format!("{word} (x > 1)"), format!("{other} (x > 1)"))
            } else {
                (plain, spelt)
            };
            assert_eq!(
                plain.parse::<Formula>(),
                spelt.parse::<Formula>(),
                "{spelt}"
            );
        }
    }
}
