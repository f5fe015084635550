//! Variation files: points at which a scenario is run.

use std::path::Path;

use crate::opendrive::error::ImportError;
use crate::opendrive::files::Files;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Greatest number of points.
pub(super) const MAX_POINTS: usize = 100_000;
/// Greatest number of elements of the scenario that are read at all points together.
const MAX_READ: usize = 15_000_000;
/// Greatest number of values that all points set together.
const MAX_VALUES: usize = 2_000_000;
/// Help about distributions.
const KINDS: &str = "write a `DistributionSet`, a `DistributionRange` or a `ValueSetDistribution`";

/// Values that a point sets, as written and in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportedPoint(pub Vec<(String, String)>);

/// Returns the number of points at which a scenario of some elements is read.
pub(super) fn most_points(elements: usize) -> usize {
    MAX_POINTS.min(MAX_READ / elements.max(1))
}

/// Points of a file: the product of its axes, of which the last varies fastest.
///
/// # Errors
///
/// Returns an error for other distributions and for more than `most` points.
pub(super) fn read(
    path: &Path,
    files: Files<'_>,
    most: usize,
) -> Result<Vec<ImportedPoint>, ImportError> {
    let root = XmlNode::read(path, "OpenSCENARIO", files)?;
    let list = root.child("ParameterValueDistribution").ok_or_else(|| {
        let what = "it has no `ParameterValueDistribution`: it is no variation file";
        root.refused(
            what,
            "name the scenario with --from, and its variations with --points",
        )
    })?;
    let mut points = vec![ImportedPoint::default()];
    for kind in &list.children {
        match kind.name.as_str() {
            "Deterministic" => {}
            // The caller names the scenario, so its path in this file says nothing more.
            "ScenarioFile" => continue,
            _ => return Err(kind.refused("only deterministic distributions are read", KINDS)),
        }
        for axis in &kind.children {
            let values = axis_of(axis)?;
            // Checked before the product is built, which could exhaust the
            // memory.
            if points.len() * values.len() > most {
                let help = "split the file, or lengthen its steps";
                let size = if most < MAX_POINTS {
                    " of a scenario of this size"
                } else {
                    ""
                };
                return Err(axis.refused(format!("more than {most} points{size}"), help));
            }
            let longest = values.iter().map(Vec::len).max().unwrap_or(0);
            let values_each = longest + points.first().map_or(0, |point| point.0.len());
            if points.len() * values.len() * values_each > MAX_VALUES {
                let help = "split the file, or set fewer parameters";
                let what = format!("more than {MAX_VALUES} values of all points");
                return Err(axis.refused(what, help));
            }
            let product = points.iter().flat_map(|point| {
                values.iter().map(|value| {
                    let set = point.0.iter().chain(value).cloned();
                    ImportedPoint(set.collect())
                })
            });
            points = product.collect();
        }
    }
    Ok(points)
}

/// Values that each step of an axis sets.
fn axis_of(axis: &XmlNode) -> Result<Vec<Vec<(String, String)>>, ImportError> {
    match axis.name.as_str() {
        "DeterministicSingleParameterDistribution" => {
            let name = axis.need("parameterName")?;
            let values = match axis.only()? {
                set if set.name == "DistributionSet" => {
                    let values = set
                        .all("Element")
                        .map(|it| it.need("value"))
                        .map(|value| value.map(str::to_owned));
                    values.collect::<Result<Vec<_>, _>>()?
                }
                range if range.name == "DistributionRange" => range_of(range)?,
                other => return Err(other.refused("such a distribution is not read", KINDS)),
            };
            let values = values.into_iter();
            Ok(values.map(|value| vec![(name.to_owned(), value)]).collect())
        }
        "DeterministicMultiParameterDistribution" => {
            let sets = axis
                .inner("ValueSetDistribution")?
                .all("ParameterValueSet")
                .map(|set| {
                    let values = set.all("ParameterAssignment").map(|it| {
                        Ok((
                            it.need("parameterRef")?.to_owned(),
                            it.need("value")?.to_owned(),
                        ))
                    });
                    values.collect::<Result<Vec<_>, _>>()
                });
            sets.collect()
        }
        _ => Err(axis.refused("such a distribution is not read", KINDS)),
    }
}

/// Values of a range, including both ends.
fn range_of(range: &XmlNode) -> Result<Vec<String>, ImportError> {
    let limits = range.inner("Range")?;
    let plain = ParameterScope::default();
    let lower = plain.number(limits, "lowerLimit")?;
    let upper = plain.number(limits, "upperLimit")?;
    let step = plain.number(range, "stepWidth")?;
    // A small surplus keeps the upper limit: (upper − lower) / step may be just
    // below a whole number.
    let count = ((upper - lower) / step + 1e-9).floor();
    if step <= 0.0 || !(0.0..MAX_POINTS as f64).contains(&count) {
        let what = format!("a range from {lower} to {upper} in steps of {step}");
        let help = format!("write a step above 0 that makes at most {MAX_POINTS} points");
        return Err(range.refused(what, &help));
    }
    // Multiples of the step and not repeated sums, whose errors would add up.
    let values = (0..=count as u32).map(|i| (lower + f64::from(i) * step).to_string());
    Ok(values.collect())
}
