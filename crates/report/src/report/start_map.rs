//! Grid of starts as a map: failures of the ego, and the boundary of a regulation.

use maud::{Markup, html};

use super::canvas::{BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, px, svg};

/// Greatest number of labels along an axis.
const MAX_TICKS: usize = 8;

/// Result of a start of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellState {
    /// No tried ado makes the ego fail.
    Holds,
    /// The ego fails, and neither CC_LATCHED nor FSM avoids it, or no judgement exists.
    Fails,
    /// The ego fails where CC_LATCHED or FSM does not.
    FailsPreventably,
    /// The ego fails without an adversary.
    Trivial,
    /// The ego or the physics failed to run.
    Unknown,
}

impl CellState {
    /// All states, with the CSS class of their colour and their legend.
    const ALL: [(CellState, &'static str, &'static str); 5] = [
        (CellState::Holds, "held", "nothing tried makes it fail"),
        (CellState::Fails, "warm", "fails"),
        (CellState::FailsPreventably, "hot", "fails, preventably"),
        (CellState::Trivial, "grey", "fails by itself"),
        (CellState::Unknown, "empty", "did not run"),
    ];

    fn class(self) -> &'static str {
        let mut all = CellState::ALL.iter();
        let found = all.find(|(state, ..)| *state == self);
        found.map_or("empty", |(_, class, _)| class)
    }
}

/// Start of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct MapCell {
    /// Result of the start.
    pub state: CellState,
    /// True if the point of the protocol fails itself, and not only a variation of it.
    pub protocol: bool,
    /// True where the regulation requires the ego to hold. `None` if it is not stated.
    pub inside: Option<bool>,
    /// Tooltip.
    pub about: String,
}

/// Grid of starts of one ego.
#[derive(Clone, Debug, PartialEq)]
pub struct StartMap {
    /// Heading under which the map appears.
    pub group: String,
    /// Title above the picture.
    pub title: String,
    /// Name and unit of the quantity along x, and its values.
    pub x: (String, Vec<f64>),
    /// Name and unit of the quantity along y, and its values.
    pub y: (String, Vec<f64>),
    /// Cells row by row, from the least y.
    pub cells: Vec<MapCell>,
}

/// Picture of a map.
pub(super) fn start_map(map: &StartMap) -> Markup {
    let (columns, rows) = (map.x.1.len().max(1), map.y.1.len().max(1));
    let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
    let width = (right - LEFT) / columns as f64;
    let height = (bottom - TOP) / rows as f64;
    let left = |column: usize| LEFT + width * column as f64;
    let top = |row: usize| bottom - height * (row + 1) as f64;
    // One rectangle behind all cells represents the cells that hold, which
    // keeps the page small.
    let cells = || map.cells.iter().enumerate();
    let at = |nth: usize| (nth % columns, nth / columns);
    svg(
        &map.title,
        html! {
            rect class="held" x=(px(LEFT)) y=(px(TOP)) width=(px(right - LEFT)) height=(px(bottom - TOP)) {}
            @for (nth, cell) in cells().filter(|(_, cell)| cell.state != CellState::Holds) {
                @let (column, row) = at(nth);
                g {
                    title { (cell.about) }
                    rect class=(cell.state.class()) x=(px(left(column))) y=(px(top(row))) width=(px(width - 0.4)) height=(px(height - 0.4)) {}
                    @if cell.protocol {
                        circle class="protocol" cx=(px(left(column) + width / 2.0)) cy=(px(top(row) + height / 2.0)) r=(px(0.28 * width.min(height))) {}
                    }
                }
            }
            @for edge in edges(map, columns) {
                line class="boundary" x1=(px(left(edge.0.0))) x2=(px(left(edge.1.0))) y1=(px(top(edge.0.1) + height)) y2=(px(top(edge.1.1) + height)) {}
            }
            @for tick in ticks(columns) {
                text class="tick" x=(px(left(tick) + width / 2.0)) y=(px(bottom + 13.0)) text-anchor="middle" { (number(map.x.1[tick])) }
            }
            @for tick in ticks(rows) {
                text class="tick" x=(px(LEFT - 5.0)) y=(px(top(tick) + height / 2.0 + 3.5)) text-anchor="end" { (number(map.y.1[tick])) }
            }
            text class="label" x=(px((LEFT + right) / 2.0)) y=(px(bottom + 28.0)) text-anchor="middle" { (map.x.0) }
            text class="label" transform=(format!("translate(12 {}) rotate(-90)", px((TOP + bottom) / 2.0))) text-anchor="middle" { (map.y.0) }
        },
    )
}

/// Legend of the colours and signs of maps.
///
/// `boundary` is the name of the line.
pub(super) fn legend(boundary: Option<&str>) -> Markup {
    let swatch = |inside: Markup| {
        html! { svg class="swatch" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16" { (inside) } }
    };
    html! {
        p class="legend" {
            @for (_, class, words) in CellState::ALL {
                span { (swatch(html! { rect class=(class) width="16" height="16" {} })) (words) }
            }
            span { (swatch(html! { circle class="protocol" cx="8" cy="8" r="4.5" {} })) "even the first ado alone makes it fail" }
            @if let Some(boundary) = boundary {
                span { (swatch(html! { line class="boundary" x1="0" x2="16" y1="8" y2="8" {} })) (boundary) }
            }
        }
    }
}

/// Corner of cells, as column and row from the lower left.
type Corner = (usize, usize);

/// Edges between cells inside and outside of the boundary.
fn edges(map: &StartMap, columns: usize) -> Vec<(Corner, Corner)> {
    // A map with too few cells has no statement there, instead of a panic.
    let inside = |column: usize, row: usize| map.cells.get(row * columns + column)?.inside;
    let rows = map.cells.len() / columns;
    // A cell without a statement has no boundary.
    let differ =
        |one: Option<bool>, other: Option<bool>| one.is_some() && other.is_some() && one != other;
    let mut edges = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let here = inside(column, row);
            if column + 1 < columns && differ(here, inside(column + 1, row)) {
                edges.push(((column + 1, row), (column + 1, row + 1)));
            }
            if row + 1 < rows && differ(here, inside(column, row + 1)) {
                edges.push(((column, row + 1), (column + 1, row + 1)));
            }
        }
    }
    edges
}

/// Indices of the values with a label on the axis.
fn ticks(values: usize) -> impl Iterator<Item = usize> {
    (0..values).step_by(values.div_ceil(MAX_TICKS).max(1))
}

/// Number with as many decimals as needed, three at most.
fn number(value: f64) -> String {
    let rounded = (1e3 * value).round() / 1e3;
    // −0 + 0 is 0, which drops the sign.
    format!("{}", rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_boundary_runs_between_what_is_inside_and_what_is_not() {
        let cell = |inside| MapCell {
            state: CellState::Holds,
            protocol: false,
            inside,
            about: String::new(),
        };
        let map = StartMap {
            group: String::new(),
            title: String::new(),
            x: (String::new(), vec![0.0, 1.0, 2.0]),
            y: (String::new(), vec![0.0, 1.0]),
            // Lower row: out, in, in. Upper row: out, out, in.
            cells: [false, true, true, false, false, true]
                .map(|inside| cell(Some(inside)))
                .to_vec(),
        };
        let found = edges(&map, 3);
        assert_eq!(
            found,
            [((1, 0), (1, 1)), ((1, 1), (2, 1)), ((2, 1), (2, 2))]
        );
        let unsaid = StartMap {
            cells: vec![cell(None); 6],
            ..map
        };
        assert_eq!(edges(&unsaid, 3), []);
    }
}
