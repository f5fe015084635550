//! Canvas of the pictures: its size, its margins and its frame in SVG.

use maud::{Markup, html};

/// Size of the canvas in its own units.
pub(super) const WIDTH: f64 = 420.0;
pub(super) const HEIGHT: f64 = 264.0;
/// Margins for axes and titles.
pub(super) const LEFT: f64 = 46.0;
pub(super) const RIGHT: f64 = 12.0;
pub(super) const TOP: f64 = 26.0;
pub(super) const BOTTOM: f64 = 52.0;

/// Wraps a picture and its title.
pub(super) fn svg(title: &str, inside: Markup) -> Markup {
    html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label=(title) {
            text class="title" x=(px(LEFT)) y="15" { (title) }
            (inside)
        }
    }
}

/// Position on the canvas with one decimal.
pub(super) fn px(value: f64) -> String {
    let rounded = (10.0 * value).round() / 10.0;
    // −0 + 0 is 0, which drops the sign.
    format!("{}", rounded + 0.0)
}
