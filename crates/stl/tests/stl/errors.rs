//! What a user sees who got it wrong.

use brakecheck_stl::trace::{Schema, Signal};
use brakecheck_stl::{Constants, Formula, Names, Settings, StlError};

fn schema() -> Schema {
    let signals = [
        Signal::real("ego.speed", "m/s", "the ego's speed"),
        Signal::real("ado.speed", "m/s", "the ado's speed"),
        Signal::real("headway", "m", "front to front"),
        Signal::boolean("red", "whether the light is red"),
    ];
    Schema::new(0.05, signals).unwrap()
}

const FORMULAS: [(&str, &str); 4] = [
    ("safe", "headway >= d_safe"),
    ("loop", "safe and pool"),
    ("pool", "always loop"),
    ("typo", "eventually hedway > 1"),
];

fn names() -> Names {
    Names {
        constants: Constants::from([
            ("d_safe".into(), 4.7),
            ("T".into(), 15.0),
            ("bad".into(), f64::INFINITY),
        ]),
        formulas: FORMULAS
            .map(|(name, text)| (name.to_owned(), text.parse().unwrap()))
            .into(),
    }
}

fn error(text: &str) -> StlError {
    let bound = text
        .parse::<Formula>()
        .and_then(|f| f.bind_with(&schema(), &names(), &Settings::default()));
    bound.map(|_| ()).expect_err(text)
}

#[test]
fn all_of_them() {
    let texts = [
        // Tokens.
        "",
        "headway > 3 @ 4",
        "headway = 3",
        "\"headway > 3",
        "headway > 3 /* why",
        "headway > 1e999",
        // Syntax.
        "always[0, T] (headway >= d_safe",
        "always[0, T] headway >= d_safe)",
        "always[0, T (headway >= d_safe)",
        "headway > ",
        "and headway > 3",
        "headway > 3 headway < 5",
        "headway > 3 untl red",
        "2headway > 3",
        "headway[0, 2] > 3",
        "rise[0, 1] red",
        "next[0, 1] red",
        "prev[0, 1] red",
        "not[0, 1] red",
        "red and[0, 1] red",
        "red ||[0, T] red",
        "red implies[0, 1] red",
        "red ->[0, 0.5 s] red",
        "red iff[0, inf] red",
        "red xor[0, red",
        "alwyas[0, 2] (headway > 3)",
        "alwyas (headway > 3)",
        "alwyas headway > 3",
        "sqr(headway) > 3",
        "pow(headway) > 3",
        "headway in 3",
        // Sorts.
        "headway + 1",
        "always headway",
        "(headway > 3) > 2",
        "(headway > 3) + 1 > 2",
        "(headway > 3) == (ego.speed > 1)",
        "headway => 3",
        "-red",
        "red > 0",
        "d_safe",
        "safe > 1",
        // Names.
        "hedway > 3",
        "speed > 3",
        "always[0, t] red",
        "always[0, headway] red",
        "loop",
        "red or typo",
        "headway > bad",
        // Bounds.
        "always[0, 0.12] red",
        "always[-1, 2] red",
        "always[2, 1] red",
        "always[2:500ms] red",
        "always[inf, 2] red",
        "always[0] red",
        "always[0, 1e9] red",
        "always[0, T/0] red",
        "always[0, 0.33333333333333333333] red",
        "headway / (T - 15) > 1",
        "sqrt(0 - 1) > headway",
    ];
    let drawn: Vec<String> = texts
        .iter()
        .map(|text| {
            let error = error(text);
            let named = FORMULAS
                .iter()
                .find(|(name, _)| error.formula() == Some(name));
            error.render(named.map_or(text, |(_, text)| text))
        })
        .collect();
    insta::assert_snapshot!(drawn.join("\n"));
}

#[test]
fn limits() {
    let mut settings = Settings::default();
    settings.limits.operators = 5;
    let bind = |text: &str, settings: &Settings| {
        let formula: Formula = text.parse().unwrap();
        formula
            .bind_with(&schema(), &names(), settings)
            .map(|_| ())
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        bind("red or red or red or red or red", &settings),
        "the formula has more than 5 operators"
    );
    settings = Settings {
        rho_max: Some(-1.0),
        ..Settings::default()
    };
    assert_eq!(
        bind("red", &settings),
        "rho_max must be positive and finite, not -1"
    );
    settings = Settings::default();
    settings.limits.horizon_samples = 100;
    assert_eq!(
        bind("always[0, 4] always[0, 4] red", &settings),
        "the formula looks further than 100 samples"
    );
    let parse = |text: &str| text.parse::<Formula>().unwrap_err().to_string();
    assert_eq!(
        parse(&"(".repeat(100_000)),
        "the text is 100000 bytes long; the limit is 65536"
    );
    assert_eq!(
        parse(&"(".repeat(10_000)),
        "this is nested deeper than 100 levels"
    );
    assert_eq!(
        parse(&"not ".repeat(10_000)),
        "this is nested deeper than 100 levels"
    );
    assert_eq!(
        parse(&format!("{} > 1", vec!["x"; 1000].join("+"))),
        "this is nested deeper than 100 levels"
    );
    assert_eq!(
        parse(&format!("{}x > 1", "-".repeat(10_000))),
        "this is nested deeper than 100 levels"
    );
    assert_eq!(
        parse(&format!("G[0,{}1] x", "(".repeat(10_000))),
        "this is nested deeper than 100 levels"
    );
    assert_eq!(
        parse(&format!("G[0,{}] x", ["1"; 100].join("+"))),
        "this time is too complicated"
    );
    // A long conjunction is not deep.
    let many = vec!["x > 1"; 5000].join(" and ");
    assert_eq!(
        many.parse::<Formula>()
            .unwrap()
            .to_string()
            .matches("and")
            .count(),
        4999
    );
}

/// Everything at the limit of depth fits the stack of a test's thread.
#[test]
fn as_deep_as_allowed() {
    let text = |n: usize| {
        let mut text = format!("{} > 1", vec!["headway"; 20].join(" - "));
        for i in 0..n {
            text = match i % 4 {
                0 => format!("not ({text})"),
                1 => format!("eventually[0, 1] ({text})"),
                2 => format!("(red) since[0, 1] ({text})"),
                _ => format!("({text}) until[0, 1] (red)"),
            };
        }
        text
    };
    let deep = text(79);
    let formula: Formula = deep.parse().unwrap();
    assert!(text(80).parse::<Formula>().is_err());
    assert_eq!(formula.to_string().parse::<Formula>().unwrap(), formula);

    let inner = text(70);
    let outer = (0..60).fold("inner".to_owned(), |text, _| {
        format!("always[0, 1] ({text})")
    });
    let outest = (0..60).fold("outer".to_owned(), |text, _| format!("rise ({text})"));
    let names = Names {
        formulas: [("inner", inner), ("outer", outer), ("outest", outest)]
            .map(|(name, text)| (name.to_owned(), text.parse().unwrap()))
            .into(),
        ..Names::default()
    };
    let bind = |text: &str| {
        let formula: Formula = text.parse().unwrap();
        formula.bind_with(&schema(), &names, &Settings::default())
    };
    assert_eq!(
        bind("always always always always always always always outest")
            .map(|_| ())
            .unwrap_err()
            .to_string(),
        "the formula is nested deeper than 200 levels"
    );
    let monitor = bind("always always always always always always outest").unwrap();
    let mut trace = brakecheck_stl::trace::Trace::new(schema().into());
    let mut online = monitor.online();
    for _ in 0..30 {
        trace.push(&[1.0, 2.0, 3.0, 1.0]).unwrap();
        online.push(&[1.0, 2.0, 3.0, 1.0]).unwrap();
    }
    let value = monitor.robustness(&trace, &mut brakecheck_stl::Scratch::new());
    assert_eq!(online.finish(), value);
    assert_eq!(monitor.explain(&trace).robustness, value);
}

#[test]
fn ends_of_a_range_in_the_wrong_order_are_refused() {
    for (text, range, help) in [
        ("headway in [5, 1]", "5, 1", "write [1, 5]"),
        (
            "not (headway in [d_safe, -1])",
            "d_safe, -1",
            "write [-1, d_safe]",
        ),
    ] {
        let error = error(text);
        assert_eq!((&text[error.span()], error.help()), (range, Some(help)));
    }
    // One number, and ends that depend on signals.
    for text in ["headway in [5, 5]", "headway in [ego.speed, 1]"] {
        let formula: Formula = text.parse().unwrap();
        let bound = formula.bind_with(&schema(), &names(), &Settings::default());
        assert!(bound.is_ok(), "{text}");
    }
}
