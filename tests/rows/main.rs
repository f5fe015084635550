//! Rows, verdicts and intervals against numbers that were worked out on paper.

mod costs;
mod cut_ins;
mod evaluating;
mod intervals;
mod limited_scene;
mod natural;
mod online;
mod reuse;
mod scene;
mod searching;
mod stepping;
mod verdicts;

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a}, not {b}");
}
