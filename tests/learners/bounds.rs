//! Every setting of every learner: the last value that is allowed, the next not.

use brakecheck::rl::{LearnerConfig, LearnerSettings};

/// Field, then: too small, smallest, largest, too large.
type Bounds = (&'static str, [&'static str; 4]);

const SHARE: [&str; 4] = ["-0.001", "0.0", "1.0", "1.001"];
const COUNT_1E6: [&str; 4] = ["0", "1", "1000000", "1000001"];
const COUNT_1E9: [&str; 4] = ["0", "1", "1000000000", "1000000001"];
const DECISIONS: [&str; 4] = ["0", "1", "1000000000000", "1000000000001"];
const BATCH: [&str; 4] = ["0", "1", "65536", "65537"];
const RATE: [&str; 4] = ["0.9e-9", "1e-9", "1.0", "1.001"];
const HIDDEN: [&str; 4] = [
    "[]",
    "[1]",
    "[1, 1, 1, 1, 1, 1, 1, 4096]",
    "[1, 1, 1, 1, 1, 1, 1, 1, 1]",
];
const WIDTH: [&str; 4] = ["[0]", "[1]", "[4096]", "[4097]"];
const TWO_SIDED_1E6: [&str; 4] = ["0.9e-6", "1e-6", "1e6", "1.1e6"];

const DQN: [Bounds; 23] = [
    ("decisions", DECISIONS),
    ("hidden", HIDDEN),
    ("hidden", WIDTH),
    ("batch", BATCH),
    ("update_every", COUNT_1E6),
    ("learning_starts", COUNT_1E9),
    ("learning_rate", RATE),
    ("final_learning_rate", SHARE),
    ("huber", TWO_SIDED_1E6),
    ("polyak", ["0.9e-6", "1e-6", "1.0", "1.001"]),
    ("discount", SHARE),
    ("steps", COUNT_1E6),
    ("exploration", SHARE),
    ("final_exploration", SHARE),
    ("exploration_fraction", SHARE),
    ("hold", COUNT_1E6),
    ("restart", SHARE),
    ("restart_pool", COUNT_1E9),
    ("priority", SHARE),
    ("correction", SHARE),
    (
        "learning_starts: 500, capacity",
        [
            "Some(499)",
            "Some(500)",
            "Some(1000000000000)",
            "Some(1000000000001)",
        ],
    ),
    ("last_gain", ["-0.001", "0.0", "10.0", "10.001"]),
    ("restart_tries", ["0", "0", "1000000000", "1000000001"]),
];

const PPO: [Bounds; 12] = [
    ("decisions", DECISIONS),
    ("hidden", HIDDEN),
    ("hidden", WIDTH),
    ("horizon", COUNT_1E9),
    ("epochs", ["0", "1", "10000", "10001"]),
    ("batch", BATCH),
    ("learning_rate", RATE),
    ("final_learning_rate", SHARE),
    ("discount", SHARE),
    ("trace", SHARE),
    ("clip", ["0.9e-3", "1e-3", "1.0", "1.001"]),
    ("entropy", ["-0.001", "0.0", "10.0", "10.001"]),
];

const Q_TABLE: [Bounds; 9] = [
    ("decisions", DECISIONS),
    (
        "learning_rate",
        [
            "Constant(0.9e-9)",
            "Constant(1e-9)",
            "Constant(1.0)",
            "Constant(1.001)",
        ],
    ),
    (
        "learning_rate",
        ["Power(-0.001)", "Power(0.0)", "Power(1.0)", "Power(1.001)"],
    ),
    ("discount", SHARE),
    ("initial_value", ["-1.1e6", "-1e6", "1e6", "1.1e6"]),
    ("exploration", SHARE),
    ("final_exploration", SHARE),
    ("exploration_fraction", SHARE),
    ("hold", COUNT_1E6),
];

/// Whether a learner may be configured so, and what is said if not.
fn validated(text: &str) -> Result<(), String> {
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let settings: LearnerSettings = options
        .from_str(text)
        .unwrap_or_else(|e| panic!("{text}: {e}"));
    let checked = LearnerConfig::new(settings);
    assert_eq!(
        checked.is_ok(),
        options.from_str::<LearnerConfig>(text).is_ok()
    );
    checked.map(drop).map_err(|error| {
        assert!(!error.help.is_empty(), "{text}: no cure");
        error.to_string()
    })
}

#[test]
fn the_last_value_in_every_range_is_allowed_and_the_next_is_not() {
    let learners = [
        ("Dqn", "", &DQN[..]),
        ("Ppo", "", &PPO[..]),
        ("Ppo", "", &[("max_gradient", TWO_SIDED_1E6)]),
        (
            "QTable",
            "bins: [(low: 0.0, high: 1.0, count: 2)], ",
            &Q_TABLE[..],
        ),
    ];
    for (learner, other, bounds) in learners {
        for (field, [below, low, high, above]) in bounds {
            let of = |value: &str| validated(&format!("{learner}({other}{field}: {value})"));
            for value in [low, high] {
                assert_eq!(of(value), Ok(()), "{learner}, {field}: {value}");
            }
            for value in [below, above] {
                // A count that may be 0 has nothing below.
                if value == low {
                    continue;
                }
                let told = of(value).expect_err(&format!("{learner}, {field}: {value}"));
                let name = field.rsplit(' ').next().expect("a name");
                assert!(told.contains(name), "{learner}, {field}: {value}: {told}");
            }
        }
    }
}

#[test]
fn cells_of_a_table_have_a_size_and_a_number() {
    let of = |bins: &str| validated(&format!("QTable(bins: [{bins}])"));
    let bin = |low: &str, high: &str, count: u32| {
        of(&format!("(low: {low}, high: {high}, count: {count})"))
    };
    assert_eq!(bin("-1e9", "1e9", 65536), Ok(()));
    assert_eq!(bin("0.0", "0.001", 1), Ok(()));
    assert!(of("").is_err(), "no cells");
    assert!(bin("-1.1e9", "0.0", 2).is_err(), "too low");
    assert!(bin("0.0", "1.1e9", 2).is_err(), "too high");
    assert!(bin("0.0", "1.0", 0).is_err(), "none");
    assert!(bin("0.0", "1.0", 65537).is_err(), "too many");
    assert!(bin("1.0", "1.0", 2).is_err(), "no width");
}
