//! Whatever the bytes, an answer and never a panic.

use std::fmt::Write as _;

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Expr, Formula, Names, Scratch, Settings, StlError};
use proptest::prelude::*;

const SEEDS: [&str; 14] = [
    "always[0, T] (headway >= d_safe)",
    "G[0:2](x>1) -> !y",
    "(d_long > 4.7) unless (d_lat <= 1.8)",
    "not eventually[0, 10 s] (red and x in [-6, 0])",
    "0 <= x < 3 until[100ms, 2*T] rise(red) // comment",
    "<>[0, end] []y <-> ~(x - -1 <= abs(y) / 2)",
    "x > 1 since[1, 2] y < 2 xor prev red # why",
    "alw_[0, 3.0] (x[t] > 0) => ev_[0, 1] (min(x, y, 2) != pow(x, 2))",
    "`a b` > 1 /* c */ and \"G\" or F U G S x",
    "x === 1 || y !== 2 && z ≥ 3 ∧ ¬w → □◇v",
    "historically[0, (T - 1) / 2] once[1:1] x > 1e-3",
    "H O X Y G F U R W S",
    "1 + 2 * 3 - 4 / 5",
    "s_next sX s_prev sY next prev x > .5",
];

fn schema() -> Schema {
    let real =
        ["x", "y", "headway", "d_long", "d_lat", "a b", "G"].map(|name| Signal::real(name, "", ""));
    let boolean = ["red", "z", "F"].map(|name| Signal::boolean(name, ""));
    Schema::new(0.1, real.into_iter().chain(boolean)).unwrap()
}

/// Everything that can be done with a text, done.
fn exercise(text: &str) {
    let names = Names {
        constants: Constants::from([("T".into(), 3.0), ("d_safe".into(), 4.7)]),
        formulas: [("w".to_owned(), "x > 1".parse().unwrap())].into(),
    };
    let check = |error: StlError| {
        let span = error.span();
        if error.formula().is_none() {
            assert!(
                span.start <= span.end && span.end <= text.len(),
                "{span:?} in {text:?}"
            );
            assert!(
                text.get(span.clone()).is_some(),
                "{span:?} cuts a character of {text:?}"
            );
        }
        let mut drawn = error.render(text);
        let _ = write!(drawn, "{error} {} {:?}", error.label(), error.help());
    };
    match text.parse::<Expr>() {
        Ok(expr) => {
            assert_eq!(
                expr.to_string().parse::<Expr>().as_ref(),
                Ok(&expr),
                "{text:?}"
            );
            match expr.bind(&schema(), &names.constants) {
                Ok(bound) => drop(bound.eval(&[1.0; 10])),
                Err(error) => check(error),
            }
        }
        Err(error) => check(error),
    }
    let formula = match text.parse::<Formula>() {
        Ok(formula) => formula,
        Err(error) => return check(error),
    };
    let canonical = formula.to_string();
    assert_eq!(
        canonical.parse::<Formula>().as_ref(),
        Ok(&formula),
        "{text:?} as {canonical:?}"
    );
    let monitor = match formula.bind_with(&schema(), &names, &Settings::default()) {
        Ok(monitor) => monitor,
        Err(error) => return check(error),
    };
    let mut trace = Trace::new(schema().into());
    let mut online = monitor.online();
    for i in 0..5 {
        let row: Vec<f64> = (0..10)
            .map(|j| f64::from((i * j) % 3) - f64::from(j == 0))
            .collect();
        trace.push(&row).unwrap();
        online.push(&row).unwrap();
    }
    let value = monitor.robustness(&trace, &mut Scratch::new());
    assert!(!value.is_nan());
    assert_eq!(online.finish(), value, "{text:?}");
    assert_eq!(monitor.explain(&trace).robustness, value);
}

#[test]
fn seeds() {
    SEEDS.into_iter().for_each(exercise);
}

proptest! {
    #![proptest_config(super::cases(20_000))]

    #[test]
    fn any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
        exercise(&String::from_utf8_lossy(&bytes));
    }

    /// Pieces of formulas in any order.
    #[test]
    fn any_pieces(pieces in prop::collection::vec(prop::sample::select(vec![
        "always", "G", "F", "U", "until", "since", "S", "R", "W", "not", "!", "-", "(", ")", "[", "]", ",", ":", "0", "1",
        "0.3", "2 s", "T", "x", "y", "red", ">", "<=", "==", "and", "|", "->", "iff", "xor", "in", "abs(", "min(", "+", "*",
        "/", "true", "inf", "end", "w", "[0,1]", "x > 1", "\"", "#", "\n", "t", "s", "rise", "X", "é",
    ]), 1..14), glue in prop::sample::select(vec![" ", ""])) {
        exercise(&pieces.join(glue));
    }

    /// Formulas with bytes changed, dropped, doubled.
    #[test]
    fn mutants(
        seed in prop::sample::select(SEEDS.to_vec()),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 1..6),
    ) {
        let mut bytes = seed.as_bytes().to_vec();
        for (at, byte, kind) in changes {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 if 1 < bytes.len() => drop(bytes.remove(at)),
                2 => bytes.insert(at, b" ()[]-.:<>!/0x"[usize::from(byte) % 14]),
                _ => { let tail = bytes[at..].to_vec(); bytes.extend(tail); }
            }
        }
        exercise(&String::from_utf8_lossy(&bytes));
    }
}
