//! Crashes: how severe they are, how small they get, why they happen, whether
//! they persist and which of them are the same.

mod distinct;
mod exporting;
mod found;
mod keeping;
mod labels;
mod openx;
mod osi;
mod own;
mod severity;
mod shrinking;
mod variations;
mod why;
mod xml;

#[track_caller]
fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-9 * (1.0 + b.abs()), "{a}, not {b}");
}
