//! Rows, verdicts and intervals against numbers that were worked out on paper.

#[path = "rows/costs.rs"]
mod costs;
#[path = "rows/cut_ins.rs"]
mod cut_ins;
#[path = "rows/evaluating.rs"]
mod evaluating;
#[path = "rows/intervals.rs"]
mod intervals;
#[path = "rows/limited_scene.rs"]
mod limited_scene;
#[path = "rows/natural.rs"]
mod natural;
#[path = "rows/online.rs"]
mod online;
#[path = "rows/reuse.rs"]
mod reuse;
#[path = "rows/scene.rs"]
mod scene;
#[path = "rows/searching.rs"]
mod searching;
#[path = "rows/stepping.rs"]
mod stepping;
#[path = "rows/verdicts.rs"]
mod verdicts;

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a}, not {b}");
}
