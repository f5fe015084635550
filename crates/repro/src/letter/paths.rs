//! Paths from the paper's setup to the defaults, as edits of world files.

use super::{LetterChange, LetterPath};

/// Observed state of `acc`.
const ACC_STATE: (&str, &str) = (
    r#"["headway", "ego.speed", "ado.speed"]"#,
    r#"["headway", "ego.speed", "ado.speed", "ego.accel", "time_left"]"#,
);
const RHO_10: LetterChange = LetterChange {
    what: "ρ_max 50 → 10",
    edits: &[("rho_max: 50.0", "rho_max: 10.0")],
};
const RHO_1: LetterChange = LetterChange {
    what: "ρ_max 10 → 1",
    edits: &[("rho_max: 10.0", "rho_max: 1.0")],
};
const RHO_50_TO_1: LetterChange = LetterChange {
    what: "ρ_max 50 → 1",
    edits: &[("rho_max: 50.0", "rho_max: 1.0")],
};
const JUDGE: LetterChange = LetterChange {
    what: "judge: the whole run → until the violation",
    edits: &[("judge: WholeRun", "judge: UntilViolation")],
};
const REWARD: LetterChange = LetterChange {
    what: "reward: plain → tanh with a jump",
    edits: &[(
        "Plain(rho_max: 1.0)",
        "Tanh(rho_max: 50.0, scale: 10.0, jump: 0.5)",
    )],
};

// An empty replacement leaves a setting to its default.
const LOSS: (&str, &str) = ("\n        loss: Squared,", "");
const EXPLORATION: (&str, &str) = (
    "\n        exploration: 0.1, final_exploration: 0.1, hold: 1,",
    "",
);
const TARGET: (&str, &str) = (" polyak: 1.0,", "");
const UPDATES: (&str, &str) = (
    "\n        update_every: 1, newest: true, learning_starts: 1, steps: 1,",
    "",
);
const REPLAY: (&str, &str) = ("\n        discount: 0.99, restart: 0.0, priority: 0.0,", "");
const BATCH: (&str, &str) = (" batch: 32,", "");
const RECIPE: &str = "learner: the Dqn recipe (loss, exploration, target, replay, updates, γ)";
const DEFAULT: &str = "learner: the default, Dqfd, for as many decisions";

/// Paths of `repro letter`, change by change.
pub const LETTER_PATHS: [LetterPath; 4] = [
    LetterPath {
        world: "acc_letter",
        learner: None,
        switches: 2,
        changes: &[
            RHO_10,
            RHO_1,
            LetterChange {
                what: "state: and the ego's acceleration, the time left",
                edits: &[ACC_STATE],
            },
            JUDGE,
            REWARD,
            LetterChange {
                what: "loss: squared → Huber 1",
                edits: &[LOSS],
            },
            LetterChange {
                what: "exploration: 0.1 → from 1 to 0.05, held",
                edits: &[EXPLORATION],
            },
            LetterChange {
                what: "target: the same network → one that follows by 0.005",
                edits: &[TARGET],
            },
            LetterChange {
                what: "learner: the rest of the Dqn recipe (batch, updates, replay, γ 1)",
                edits: &[BATCH, UPDATES, REPLAY],
            },
            LetterChange {
                what: DEFAULT,
                // `longest: 1.0` keeps the default learner from training on, for equal
                // decisions.
                edits: &[(
                    "Dqn(\n        decisions: 50_000,\n",
                    "Dqfd(\n        longest: 1.0, decisions: 50_000,\n",
                )],
            },
        ],
    },
    LetterPath {
        world: "merge_letter",
        learner: None,
        switches: 1,
        changes: &[
            RHO_50_TO_1,
            LetterChange {
                what: "state: and closing and lateral speed, acceleration, time left",
                edits: &[(
                    r#"["d_long", "offset", "ego.speed", "ado.speed"]"#,
                    r#"["d_long", "offset", "v_diff", "ego.speed", "ado.lateral_speed", "ego.accel", "time_left"]"#,
                )],
            },
            JUDGE,
            REWARD,
            LetterChange {
                what: RECIPE,
                edits: &[LOSS, EXPLORATION, TARGET, BATCH, UPDATES, REPLAY],
            },
            LetterChange {
                what: DEFAULT,
                edits: &[(
                    "Dqn(\n        decisions: 80_000,\n",
                    "Dqfd(\n        longest: 1.0, decisions: 80_000,\n",
                )],
            },
        ],
    },
    LetterPath {
        world: "yellow_light_letter",
        learner: None,
        switches: 1,
        changes: &[
            RHO_50_TO_1,
            LetterChange {
                what: "state: the line in place of the headway, acceleration, time left",
                edits: &[(
                    r#"["ego.ado.headway", "ego.speed", "ado.speed"]"#,
                    r#"["ado.light.line", "ego.light.line", "ado.speed", "ego.speed", "ego.accel", "time_left"]"#,
                )],
            },
            JUDGE,
            REWARD,
            LetterChange {
                what: RECIPE,
                edits: &[LOSS, EXPLORATION, TARGET, BATCH, UPDATES, REPLAY],
            },
            LetterChange {
                what: DEFAULT,
                edits: &[(
                    "Dqn(\n        decisions: 50_000,\n",
                    "Dqfd(\n        longest: 1.0, decisions: 50_000,\n",
                )],
            },
        ],
    },
    LetterPath {
        world: "acc_letter",
        learner: Some("q_table"),
        switches: 2,
        changes: &[
            RHO_10,
            RHO_1,
            LetterChange {
                what: "state: and the ego's acceleration, the time left",
                edits: &[
                    ACC_STATE,
                    // A table has a count of cells per observed signal, so two more
                    // signals need two.
                    (
                        "[(count: 30), (count: 16), (count: 16)]",
                        "[(count: 30), (count: 16), (count: 16), (count: 5), (count: 30)]",
                    ),
                ],
            },
            JUDGE,
            REWARD,
            LetterChange {
                what: "exploration: 0.1 → from 1 to 0.05, held",
                // `acc` gives its own table this fraction, and the path must end there.
                edits: &[(
                    "\n            exploration: 0.1, final_exploration: 0.1, hold: 1,",
                    "\n            exploration_fraction: 0.8,",
                )],
            },
            LetterChange {
                what: "table: random → −0.5, learned from backwards, γ 1",
                edits: &[
                    (
                        "initial_spread: 1.0, backward: false,",
                        "initial_value: -0.5,",
                    ),
                    ("\n            discount: 0.99,", ""),
                ],
            },
            LetterChange {
                what: "decisions: 0.4 → 4 million, as in `acc`",
                edits: &[("decisions: 400_000", "decisions: 4_000_000")],
            },
        ],
    },
];
