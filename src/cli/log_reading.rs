//! Lines on a reading: what was read, left out and contradictory.

use std::ops::RangeInclusive;

use brakecheck_traffic::{Analysis, ReadCounts};

use super::terminal;
use crate::stl::sampling::rate_of;

/// Distances of adjacent lanes that are widths of lanes in feet, and of none in metres.
// Lanes are 2.7 to 4.6 m wide, which is 9 to 15 ft.
const LANES_IN_FEET: RangeInclusive<f64> = 9.0..=15.0;
/// Median speed that traffic on no public road has, in m/s.
// About 200 km/h.
const FASTEST_MPS: f64 = 55.0;

/// Prints a line each on what was read, left out, corrected and contradictory.
pub(super) fn note(analysis: &Analysis, map: &str) {
    let recording = &analysis.recording;
    let lanes: usize = analysis
        .frame
        .carriageways
        .iter()
        .map(|it| it.lanes.len())
        .sum();
    terminal::note(&format!(
        "read `{}` as {map}: {}; a row per {:.6} s ({}); {} carriageways with {lanes} lanes",
        recording.name,
        recording.reading,
        recording.dt_s,
        rate_of(recording.dt_s),
        analysis.frame.carriageways.len(),
    ));
    let counts = &recording.counts;
    let mut left_out = listed(&left_out(counts));
    left_out.extend(analysis.frame.without_lanes.iter().map(ToString::to_string));
    let mut contradicting = listed(&contradictions(counts));
    contradicting.extend(signs_of_feet(analysis));
    for (title, parts) in [
        ("left out", left_out),
        ("corrected", listed(&corrected(counts))),
        ("contradicts itself", contradicting),
    ] {
        if !parts.is_empty() {
            terminal::note(&format!("{title}: {}", parts.join(", ")));
        }
    }
}

/// Returns quantities that are those of lanes and vehicles in feet.
fn signs_of_feet(analysis: &Analysis) -> Vec<String> {
    let distance_m = analysis.frame.lane_distance_m();
    let wide_m = distance_m.filter(|it| LANES_IN_FEET.contains(it));
    let lanes = wide_m.map(|it| format!("lanes {it:.1} m apart"));
    let speed_mps = analysis.recording.median_speed_mps();
    let fast_mps = speed_mps.filter(|it| *it > FASTEST_MPS);
    let speed = fast_mps.map(|it| format!("a median speed of {it:.0} m/s"));
    let cure = "as in feet (`length_unit: Feet` of a column map)";
    let signs = lanes.into_iter().chain(speed);
    signs.map(|it| format!("{it}, {cure}")).collect()
}

fn left_out(counts: &ReadCounts) -> [(usize, &'static str); 6] {
    [
        (counts.too_fast, "tracks faster than any road user"),
        (counts.displaced, "rows that jump away and come back"),
        (counts.too_short, "tracks of one sample"),
        (counts.without_id, "rows without an identity"),
        (counts.without_motion, "entities without a trajectory"),
        (counts.other_messages, "messages of other channels"),
    ]
}

fn corrected(counts: &ReadCounts) -> [(usize, &'static str); 6] {
    [
        (counts.marked, "rows interpolated by the recorder"),
        (counts.off_grid, "rows off the time grid, interpolated"),
        (counts.holes_filled, "samples filled in short holes"),
        (counts.holes_split, "tracks split at long holes"),
        (counts.unknown_class, "rows of an unknown class"),
        (
            counts.assumed_sizes,
            "road users with the size of their class",
        ),
    ]
}

fn contradictions(counts: &ReadCounts) -> [(usize, &'static str); 7] {
    [
        (counts.jumps, "jumps at which tracks are split"),
        (counts.sideways, "steps that jump to the side"),
        (counts.reused_ids, "identities of a second vehicle"),
        (counts.varying_sizes, "tracks with varying lengths"),
        (
            counts.speeds_off,
            "tracks whose speeds are not those of the positions",
        ),
        (
            counts.headings_off,
            "tracks that head elsewhere than they move",
        ),
        (
            counts.narrow,
            "cars narrower than 1 m, as sizes in other units are (`length_unit` of a column map)",
        ),
    ]
}

fn listed(parts: &[(usize, &'static str)]) -> Vec<String> {
    // Kinds that did not occur would hide those that did.
    let some = parts.iter().filter(|(count, _)| *count > 0);
    some.map(|(count, what)| format!("{count} {what}"))
        .collect()
}
