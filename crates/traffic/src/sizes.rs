//! Sizes of road users against those that vehicles have.

use crate::median::median;
use crate::problem::FileProblem;
use crate::recording::{Class, RoadUserTrack};

/// Width of no vehicle, beyond that of the widest trains, in metres.
const WIDE_M: f64 = 3.5;
/// Width that every car exceeds, in metres.
const NARROW_M: f64 = 1.0;

/// Returns a problem if most vehicles are wider than any, in metres.
pub(crate) fn problem(tracks: &[RoadUserTrack]) -> Option<FileProblem> {
    // Wider than long alone is no sign, as a pedestrian is.
    let is_swapped = |it: &&RoadUserTrack| it.width_m > WIDE_M.max(it.length_m);
    let mut swapped = tracks.iter().filter(is_swapped);
    if let Some(first) = swapped.next()
        && 2 * (1 + swapped.count()) > tracks.len()
    {
        return Some(FileProblem::Wide {
            length_m: first.length_m,
            width_m: first.width_m,
        });
    }
    let vehicles = || tracks.iter().filter(|it| it.class.is_in_lanes());
    let width_m = median(vehicles().map(|it| it.width_m).collect::<Vec<f64>>())?;
    let length_m = median(vehicles().map(|it| it.length_m).collect::<Vec<f64>>())?;
    (width_m > WIDE_M).then_some(FileProblem::Large { length_m, width_m })
}

/// Returns the number of cars that are narrower than any, if most are.
pub(crate) fn narrow(tracks: &[RoadUserTrack]) -> usize {
    let cars = || tracks.iter().filter(|it| it.class == Class::Car);
    let narrow = cars().filter(|it| it.width_m < NARROW_M).count();
    // A few narrow cars are microcars. Most of them are a wrong unit or
    // column.
    if 2 * narrow > cars().count() {
        narrow
    } else {
        0
    }
}
