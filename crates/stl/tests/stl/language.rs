//! The language, form by form.

use brakecheck_stl::trace::{Schema, Signal, Trace};
use brakecheck_stl::{Constants, Expr, Formula, Monitor, Names, Scratch, Settings, TraceEnd};

fn formula(text: &str) -> Formula {
    text.parse()
        .unwrap_or_else(|e: brakecheck_stl::StlError| panic!("{}", e.render(text)))
}

#[test]
fn canonical_texts() {
    let cases = [
        // Aliases.
        ("G x>1", "always (x > 1)"),
        (
            "globally[0,1] alw ev F <> [] x>1",
            "always[0, 1] always eventually eventually eventually always (x > 1)",
        ),
        (
            "alw_[0,1] (x[t] > 0) => ev_[0,2] b",
            "(always[0, 1] (x > 0)) implies (eventually[0, 2] b)",
        ),
        ("H O X Y b", "historically once next prev b"),
        ("sX b and s_prev b", "(s_next b) and (s_prev b)"),
        ("a U b", "a until b"),
        ("a R[1:2] b", "a release[1, 2] b"),
        ("a W b", "a unless b"),
        ("a S[0,end] b", "a since[0, end] b"),
        (
            "!a & ~b && not c /\\ d",
            "(not a) and (not b) and (not c) and d",
        ),
        ("a | b || c \\/ d or e", "a or b or c or d or e"),
        (
            "a -> b => c implies d",
            "a implies (b implies (c implies d))",
        ),
        ("a <-> b <=> c iff d", "((a iff b) iff c) iff d"),
        ("TRUE xor false", "true xor false"),
        (
            "¬a ∧ □b ∨ x ≥ 1 → ◇(x ≠ 2)",
            "(((not a) and (always b)) or (x >= 1)) implies (eventually (x != 2))",
        ),
        (
            "x === 1 and x !== 2 and x == 3 and x != 4",
            "(x == 1) and (x != 2) and (x == 3) and (x != 4)",
        ),
        // Precedence, tightest first.
        ("-x + 2*y < 1", "-x + 2 * y < 1"),
        ("not x > 1 and y < 2", "(not (x > 1)) and (y < 2)"),
        (
            "always[0,2] x > 1 until y < 2",
            "(always[0, 2] (x > 1)) until (y < 2)",
        ),
        (
            "x<2 until y>1 implies z>0",
            "((x < 2) until (y > 1)) implies (z > 0)",
        ),
        ("a until b and c until d", "(a until b) and (c until d)"),
        ("a or b and c", "a or (b and c)"),
        (
            "a xor b iff c implies d or e",
            "a xor (b iff (c implies (d or e)))",
        ),
        ("a since b until c", "a since (b until c)"),
        ("a until b since c", "(a until b) since c"),
        ("a until b until c", "(a until b) until c"),
        ("not always not a", "not always not a"),
        ("(a and b) and (c and d)", "a and b and c and d"),
        // Single letters are operators where they must be.
        ("G > 3 and F < 2", "(G > 3) and (F < 2)"),
        ("G(x > 1)", "always (x > 1)"),
        ("G G", "always G"),
        ("G U x", "G until x"),
        ("G U > 3", "always (U > 3)"),
        ("U U U", "U until U"),
        ("S > 1 S R > 2", "(S > 1) since (R > 2)"),
        ("F - x > 0", "F - x > 0"),
        ("F -x > 0", "eventually (-x > 0)"),
        ("F-x > 0", "F - x > 0"),
        ("X and Y or O", "(X and Y) or O"),
        // Arithmetic.
        ("x/2 > y", "x / 2 > y"),
        (
            "a - (b - c) - d > (e / f) / (g * h)",
            "a - (b - c) - d > e / f / (g * h)",
        ),
        ("-(x + 1) * -2 >= --3", "-(x + 1) * -2 >= 3"),
        (
            "min(x, y, 1) > max(pow(x, 2), sqrt(abs(y)) + exp(z))",
            "min(x, y, 1) > max(pow(x, 2), sqrt(abs(y)) + exp(z))",
        ),
        (".5e-3 < x", "0.0005 < x"),
        // Chains and ranges.
        ("0 < x <= 3 < y", "0 < x <= 3 < y"),
        (
            "x in [-6, 0] and y in [0:d]",
            "(x in [-6, 0]) and (y in [0, d])",
        ),
        // Bounds.
        ("G[0.50,1s] a", "always[0.5, 1 s] a"),
        ("G[100 ms, 2us + 3 ns] a", "always[100 ms, 2 us + 3 ns] a"),
        ("G[0, T - 1*(2+a)] b", "always[0, T - 1 * (2 + a)] b"),
        ("G[T ms, inf] b", "always[T ms, end] b"),
        // Names.
        (
            "ego.speed_x1 > \"a b\" and `until`",
            "(ego.speed_x1 > \"a b\") and \"until\"",
        ),
        // Comments.
        (
            "a # one\n and // two\n b /* three */ or c",
            "(a and b) or c",
        ),
    ];
    for (text, want) in cases {
        let formula = formula(text);
        assert_eq!(formula.to_string(), want, "{text}");
        assert_eq!(want.parse::<Formula>().unwrap(), formula, "{want}");
    }
}

/// The table of operators in the documentation, row by row.
#[test]
fn every_operator_by_example() {
    let signals = [
        Signal::real("x", "m", "a number"),
        Signal::boolean("on", "true at 2 s only"),
    ];
    let mut trace = Trace::new(Schema::new(1.0, signals).unwrap().into());
    for (i, x) in [3.0, 1.0, 4.0, 1.0, 5.0].into_iter().enumerate() {
        trace.push(&[x, f64::from(u8::from(i == 2))]).unwrap();
    }
    let rows = include_str!("../../docs/stl.md").lines();
    let mut seen = 0;
    for row in rows.skip_while(|row| !row.starts_with("| form")).skip(2) {
        if !row.starts_with('|') {
            break;
        }
        let cells: Vec<_> = row
            .trim_matches('|')
            .rsplitn(3, '|')
            .map(str::trim)
            .collect();
        let (want, text) = (cells[0], cells[1].trim_matches('`'));
        let want: Vec<f64> = want.split(", ").map(|v| v.parse().unwrap()).collect();
        let monitor = formula(text)
            .bind(trace.schema(), &Constants::new())
            .unwrap();
        assert_eq!(monitor.robustness_all(&trace), want, "{text}");
        seen += 1;
    }
    assert_eq!(seen, 28);
}

#[test]
fn bounds_are_exact() {
    let horizon = |dt: f64, text: &str, t: f64| {
        let schema = Schema::new(dt, [Signal::boolean("b", "")]).unwrap();
        let constants = Constants::from([("T".to_owned(), t)]);
        formula(text)
            .bind(&schema, &constants)
            .unwrap()
            .horizon_samples()
    };
    assert_eq!(horizon(0.1, "G[0, 0.3] b", 0.0), Some(3));
    assert_eq!(
        horizon(0.1, "G[0, T] b", 0.1 * 3.0 - 0.1 * 3.0 + 0.7),
        Some(7)
    );
    assert_eq!(horizon(1.0 / 30.0, "G[0, 1] b", 0.0), Some(30));
    assert_eq!(
        horizon(0.05, "G[0, T] F[100ms, 2 * T / 3] b", 15.0),
        Some(500)
    );
    assert_eq!(horizon(0.05, "G[0, T ms] b", 50.0), Some(1));
    assert_eq!(horizon(1e-9, "G[0, 3us] b", 0.0), Some(3000));
    assert_eq!(horizon(0.1, "G[0, end] b", 0.0), None);
    assert_eq!(horizon(0.1, "once[0, 5] b U[0, 0.2] next b", 0.0), Some(3));
}

#[test]
fn bounds_are_samples_or_their_times_in_milliseconds() {
    let bind = |dt_s: f64, text: &str| {
        let schema = Schema::new(dt_s, [Signal::boolean("b", "")]).unwrap();
        let bound = formula(text).bind(&schema, &Constants::new());
        bound.map(|it| it.horizon_samples())
    };
    let (film, television) = (1.0 / 30.0, 1001.0 / 30_000.0);
    for (dt_s, text, samples) in [
        (film, "G[0, 0.033] b", 1),
        (film, "G[0, 0.0667] b", 2),
        (film, "G[0, 0.967] b", 29),
        (film, "G[0, 67 ms] b", 2),
        (television, "G[0, 1.001] b", 30),
    ] {
        assert_eq!(bind(dt_s, text).unwrap(), Some(samples), "{text}");
    }
    // One second lies a millisecond beside the nearest sample of 29.97 Hz.
    for (dt_s, text) in [
        (television, "G[0, 1] b"),
        (film, "G[0, 0.05] b"),
        (film, "G[0, 0.034] b"),
        (0.05, "G[0, 0.0503] b"),
        // In milliseconds, every bound would be a sample.
        (1.0 / 1200.0, "G[0, 0.002] b"),
    ] {
        let error = bind(dt_s, text).unwrap_err();
        assert!(error.to_string().contains("is not a multiple"), "{text}");
        assert!(
            error.help().unwrap().contains("the neighbours are"),
            "{text}"
        );
    }
}

#[test]
fn names_mean_signals_then_constants_then_formulas() {
    let schema = Schema::new(1.0, [Signal::real("x", "", "")]).unwrap();
    let names = Names {
        constants: Constants::from([("x".into(), 9.0), ("c".into(), 2.0)]),
        formulas: [
            ("near".to_owned(), formula("x < c")),
            ("twice".to_owned(), formula("near and always near")),
        ]
        .into(),
    };
    let mut trace = Trace::new(schema.clone().into());
    trace.push(&[1.5]).unwrap();
    trace.push(&[1.0]).unwrap();
    let monitor = formula("twice")
        .bind_with(&schema, &names, &Settings::default())
        .unwrap();
    assert_eq!(monitor.robustness(&trace, &mut Scratch::new()), 0.5);
    assert_eq!(monitor.signals(), [0]);
}

#[test]
fn strict_and_weak_comparisons_differ_in_truth_only() {
    let schema = Schema::new(1.0, [Signal::real("x", "", "")]).unwrap();
    let mut trace = Trace::new(schema.into());
    trace.push(&[2.0]).unwrap();
    let mut scratch = Scratch::new();
    let cases = [
        ("x >= 2", true),
        ("x > 2", false),
        ("x == 2", true),
        ("x != 2", false),
        ("not x > 2", true),
    ];
    for (text, holds) in cases {
        let monitor = formula(text)
            .bind(trace.schema(), &Constants::new())
            .unwrap();
        assert_eq!(monitor.robustness(&trace, &mut scratch), 0.0, "{text}");
        assert_eq!(monitor.satisfied(&trace, &mut scratch), holds, "{text}");
    }
}

/// The same number of columns under other names, or in another order, is
/// another run; a verdict on it would be about the wrong signal.
#[test]
fn a_trace_of_other_signals_is_refused() {
    let named = |names: [&str; 2], dt_s: f64| {
        let signals = names.map(|name| Signal::real(name, "m", "a number"));
        let mut trace = Trace::new(Schema::new(dt_s, signals).unwrap().into());
        trace.push(&[1.0, 5.0]).unwrap();
        trace
    };
    let trace = named(["x", "y"], 1.0);
    let monitor = formula("always (x >= 0)")
        .bind(trace.schema(), &Constants::new())
        .unwrap();
    // Declared apart, or with other units, but the same rows.
    assert_eq!(monitor.robustness_all(&named(["x", "y"], 1.0)), [1.0]);
    let kinds = [
        Signal::real("x", "km", "a number"),
        Signal::boolean("y", "a word"),
    ];
    let mut other = Trace::new(Schema::new(1.0, kinds).unwrap().into());
    other.push(&[2.0, 1.0]).unwrap();
    assert_eq!(monitor.robustness_all(&other), [2.0]);

    type Use = fn(&Monitor, &Trace) -> String;
    let uses: [Use; 7] = [
        |monitor, trace| monitor.robustness(trace, &mut Scratch::new()).to_string(),
        |monitor, trace| monitor.satisfied(trace, &mut Scratch::new()).to_string(),
        |monitor, trace| format!("{:?}", monitor.robustness_all(trace)),
        |monitor, trace| format!("{:?}", monitor.interval(trace, &mut Scratch::new())),
        |monitor, trace| monitor.explain(trace).to_string(),
        |monitor, trace| format!("{:?}", monitor.secondary(trace)),
        |monitor, trace| format!("{:?}", monitor.invariant(trace)),
    ];
    let others = [
        (named(["y", "x"], 1.0), "[y, x] every 1 s"),
        (named(["x", "z"], 1.0), "[x, z] every 1 s"),
        (named(["x", "y"], 0.5), "[x, y] every 0.5 s"),
    ];
    for (other, met) in &others {
        for judge in uses {
            let judged = std::panic::catch_unwind(|| judge(&monitor, other));
            let said = judged.unwrap_err().downcast::<String>().unwrap();
            let want = format!("a monitor for [x, y] every 1 s met a trace of {met}");
            assert_eq!(*said, want);
        }
    }
}

#[test]
fn the_end_of_the_trace() {
    let schema = Schema::new(1.0, [Signal::real("x", "", "")]).unwrap();
    let mut trace = Trace::new(schema.into());
    for x in [3.0, 1.0, 4.0] {
        trace.push(&[x]).unwrap();
    }
    let rho = |text: &str, end: TraceEnd| {
        let settings = Settings {
            end,
            ..Settings::default()
        };
        let monitor = formula(text)
            .bind_with(trace.schema(), &Names::default(), &settings)
            .unwrap();
        monitor.robustness(&trace, &mut Scratch::new())
    };
    use TraceEnd::{Hold, Strict, Truncate};
    for (text, truncate, hold, strict) in [
        ("always[0, 5] x > 0", 1.0, 1.0, f64::NEG_INFINITY),
        ("always[3, 5] x > 0", f64::INFINITY, 4.0, f64::NEG_INFINITY),
        ("eventually[0, 5] x > 0", 4.0, 4.0, 4.0),
        (
            "eventually[3, 5] x > 0",
            f64::NEG_INFINITY,
            4.0,
            f64::NEG_INFINITY,
        ),
        ("always x > 0", 1.0, 1.0, 1.0),
        ("always[0, 2] x > 0", 1.0, 1.0, 1.0),
    ] {
        assert_eq!(
            (rho(text, Truncate), rho(text, Hold), rho(text, Strict)),
            (truncate, hold, strict),
            "{text}"
        );
    }
}

#[test]
fn expressions() {
    let schema = Schema::new(
        1.0,
        [
            Signal::real("ado.x", "m", ""),
            Signal::real("ego.x", "m", ""),
        ],
    )
    .unwrap();
    let expr: Expr = "max(ado.x - ego.x, c) / 2".parse().unwrap();
    assert_eq!(expr.signals(), ["ado.x", "ego.x", "c"]);
    let bound = expr
        .bind(&schema, &Constants::from([("c".into(), 1.0)]))
        .unwrap();
    assert_eq!(
        (bound.eval(&[9.0, 4.0]), bound.eval(&[4.0, 9.0])),
        (2.5, 0.5)
    );
    assert_eq!(
        "x > 1".parse::<Expr>().unwrap_err().to_string(),
        "a number is expected here"
    );
    assert_eq!(
        "y + 1"
            .parse::<Expr>()
            .unwrap()
            .bind(&schema, &Constants::new())
            .unwrap_err()
            .span(),
        0..1
    );
}
