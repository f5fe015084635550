//! Numbers of a world that differ between its points.

use brakecheck_traffic::{SituationPlan, rounded};

use super::{file_name, plain};
use crate::ron_file::ValuePath;
use crate::scene::drive::Range;
use crate::world_file::{NumberOrRange, PointsFile, TextComment};

/// Axis of a world, with its value at each point.
struct PointColumn {
    axis: String,
    values: Vec<f64>,
}

/// Columns of a table of points.
#[derive(Default)]
pub(super) struct PointColumns(Vec<PointColumn>);

impl PointColumns {
    /// Returns a number, or the range of an axis if it differs.
    pub(super) fn number(
        &mut self,
        axis: &str,
        values: impl Iterator<Item = f64>,
    ) -> NumberOrRange {
        self.number_from(0.0, axis, values)
    }

    /// As `number`, for an axis whose values are relative to another origin.
    pub(super) fn number_from(
        &mut self,
        origin: f64,
        axis: &str,
        values: impl Iterator<Item = f64>,
    ) -> NumberOrRange {
        // Rounded first, so that the range and the rows have the same digits.
        let values: Vec<f64> = values.map(rounded).collect();
        let lo = values.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // An axis of one value would be a dimension without an extent.
        if lo == hi {
            return lo.into();
        }
        self.0.push(PointColumn {
            axis: axis.to_owned(),
            // The file states offsets from a lane, and axes of a start state
            // positions on the road.
            values: values.into_iter().map(|it| origin + it).collect(),
        });
        NumberOrRange(Range { lo, hi })
    }

    /// Returns the table of `count` points, `None` without an axis.
    pub(super) fn table(&self, count: usize) -> Option<PointsFile> {
        let row = |i: usize| self.0.iter().map(|it| it.values[i]).collect();
        (!self.0.is_empty()).then(|| PointsFile {
            axes: self.0.iter().map(|it| it.axis.clone()).collect(),
            rows: (0..count).map(row).collect(),
        })
    }
}

/// Returns a comment per row of a table: the origin of its situation.
pub(super) fn row_comments(situations: &[SituationPlan]) -> impl Iterator<Item = TextComment> {
    let rows = ValuePath::top().to("points").to("rows");
    situations.iter().enumerate().map(move |(i, it)| {
        let origin = format!(
            "{}, at {:.2} s: {} ahead of the ego, which replaces {}",
            file_name(&it.source),
            it.time_s,
            plain(&it.planned),
            plain(&it.replaced)
        );
        TextComment::new(rows.at(i), origin)
    })
}
