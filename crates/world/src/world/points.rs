//! Starts of a world as a table.

use indexmap::IndexMap;

use super::check;
use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::ron_file::known_names;
use crate::scene::Start;
use crate::scene::drive::{DriveSpec, EnvironmentQuantity, Range, Sensors};
use crate::world_file::{NumberOrRange, PointsFile};

/// Greatest number of rows: a table contains points, and not a density.
const MAX_ROWS: usize = 100_000;

/// Reads the numbers of a start besides the agents' places.
pub(super) fn parameters(
    problems: &mut Problems,
    path: &ValuePath,
    file: &Ordered<NumberOrRange>,
    taken: &[&str],
) -> IndexMap<String, Range> {
    let file = file.0.iter().map(|(name, NumberOrRange(range))| {
        let place = path.to(name);
        check::free_name(problems, &place, name, taken.contains(&name.as_str()));
        check::range(problems, &place, *range);
        (name.clone(), *range)
    });
    file.collect()
}

/// Reads the rows in the order of the world's axes. Without a table there are none.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    points: Option<&PointsFile>,
    spec: &DriveSpec,
) -> Vec<Start> {
    let Some(points) = points else {
        return Vec::new();
    };
    let axes = spec.axes();
    let known: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
    let list = path.to("axes");
    for (i, name) in points.axes.iter().enumerate() {
        if !known.contains(&name.as_str()) {
            problems.unknown(&list.at(i), "range", name, &known);
        } else if points.axes[..i].contains(name) {
            let what = format!("the axis `{name}` stands there twice");
            problems.add(&list.at(i), what, "second one", None);
        }
    }
    // Every range must have a column, or its value at a point would be
    // undefined.
    if let Some(missing) = known
        .iter()
        .find(|name| !points.axes.iter().any(|it| it == *name))
    {
        let what = format!("the points say nothing of `{missing}`, which is a range");
        let help = format!(
            "{}; or make it a number",
            known_names("axes", known.iter().copied())
        );
        problems.add(&list, what, "not all ranges", Some(help));
    }
    let rows = path.to("rows");
    if points.rows.is_empty() || points.rows.len() > MAX_ROWS {
        let what = format!("a table of {} points", points.rows.len());
        let help =
            format!("1 to {MAX_ROWS} are possible; without `points` all that the ranges give");
        problems.add(&rows, what, "here", Some(help));
    }
    // The columns below are only complete without mistakes.
    if !problems.is_empty() {
        return Vec::new();
    }
    // The file may list the columns in any order, and a start has the world's
    // order.
    let columns: Vec<usize> = known
        .iter()
        .filter_map(|name| points.axes.iter().position(|it| it == name))
        .collect();
    let mut starts = Vec::with_capacity(points.rows.len());
    for (i, row) in points.rows.iter().enumerate() {
        if row.len() != columns.len() {
            let what = format!("{} values for {} axes", row.len(), columns.len());
            problems.add(&rows.at(i), what, "another number", None);
            // The remaining rows probably have the same mistake, and there may
            // be 100 000 of them.
            return Vec::new();
        }
        let values: Vec<f64> = columns.iter().map(|&column| row[column]).collect();
        // The ranges of the world describe X_init, so every point must be
        // within them.
        let mut cells = axes.iter().zip(&values).zip(&columns);
        let outside = cells.find(|((axis, value), _)| !(axis.lo..=axis.hi).contains(*value));
        if let Some(((axis, value), &column)) = outside {
            let what = format!(
                "{value} is outside of {} ..= {}, the range of `{}`",
                axis.lo, axis.hi, axis.name
            );
            let help = "ranges hold all points: widen it".to_owned();
            problems.add(&rows.at(i).at(column), what, "out of range", Some(help));
            return Vec::new();
        }
        if let Some((column, flaw)) = delay_flaw(spec, &values) {
            let place = rows.at(i).at(columns[column]);
            problems.add(&place, flaw, "no multiple", None);
            return Vec::new();
        }
        starts.push(Start(values));
    }
    starts
}

/// Position and problem of a delay that is no multiple of the sample.
fn delay_flaw(spec: &DriveSpec, values: &[f64]) -> Option<(usize, String)> {
    let from = values.len().checked_sub(spec.environment.len())?;
    let mut delays = spec.environment.iter().zip(from..);
    let (_, column) = delays.find(|(it, _)| it.quantity == EnvironmentQuantity::SensorDelay)?;
    let sensors = Sensors {
        delay_s: values[column],
        ..Sensors::default()
    };
    check::sensor_flaw(&sensors, &spec.clock).map(|(_, what, _)| (column, what))
}
