//! Lanes of a carriageway, from the offsets of vehicles that do not move sideways.

use crate::median::median;
use crate::reference_line::WIDTH_M;

/// Sideways motion in two seconds from which a vehicle is not settled in a lane.
const SETTLED_M: f64 = 0.5;
/// Share of the rows of settled vehicles that lanes have at least.
const SETTLED_SHARE: f64 = 0.5;
/// Offset from the middle of a lane of three quarters of its rows, in metres.
const NEAR_MIDDLE_M: f64 = 1.2;
/// Lane changes per vehicle and kilometre beyond which there are no lanes.
const CHANGES_PER_KM: f64 = 8.0;
/// Width of the bins of offsets.
const BIN_M: f64 = 0.1;
/// Least distance of two lanes.
const LANE_M: f64 = 2.4;
/// Least share of the rows in a lane.
const LANE_SHARE: f64 = 0.005;
/// Offset from the middle of a lane within which a vehicle is in it.
const IN_LANE_M: f64 = 1.9;

/// Lane of a carriageway.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Lane {
    /// Offset of its middle from the line in metres, to the left.
    pub offset_m: f64,
    /// Share of the carriageway's rows within 1.9 m of it.
    pub share: f64,
    /// Deviation of its median per 100 m from the offset, 95 % quantile in metres.
    pub wander_m: f64,
}

/// Track in the frame of its carriageway, a value per sample.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PlacedTrack {
    /// Position of the carriageway in the frame.
    pub carriageway: usize,
    /// Front bumper along the line in metres.
    pub s_m: Vec<f64>,
    /// Box centre to the left of the line in metres.
    pub lateral_m: Vec<f64>,
    /// Lane from the right, 0 first, `None` outside of all lanes.
    pub lane: Vec<Option<u8>>,
}

/// Returns the lane whose middle is nearest, within 1.9 m.
pub(crate) fn lane_at(lanes: &[Lane], lateral_m: f64) -> Option<u8> {
    let far = |lane: &Lane| (lane.offset_m - lateral_m).abs();
    let nearest = lanes
        .iter()
        .enumerate()
        .min_by(|a, b| far(a.1).total_cmp(&far(b.1)))?;
    // A hostile map may have more lanes than a number of a lane can count.
    let lane = u8::try_from(nearest.0).ok()?;
    (far(nearest.1) <= IN_LANE_M).then_some(lane)
}

/// Offsets of rows in which vehicles do not move sideways.
pub(crate) struct SettledRows {
    offsets_m: Vec<f64>,
    /// Number of all rows.
    rows: usize,
}

impl SettledRows {
    pub(crate) fn of(placed: &[(usize, PlacedTrack)], dt_s: f64) -> SettledRows {
        let reach = ((1.0 / dt_s).round() as usize).max(1);
        let mut found = SettledRows {
            offsets_m: Vec::new(),
            rows: 0,
        };
        for (_, track) in placed {
            let own = &track.lateral_m;
            found.rows += own.len();
            let rows = (0..own.len()).filter(|i| is_settled(own, *i, reach));
            found.offsets_m.extend(rows.map(|i| own[i]));
        }
        found
    }

    /// Returns true if the vehicles keep to lanes.
    pub(crate) fn have_lanes(&self, lanes: &[Lane], placed: &[(usize, PlacedTrack)]) -> bool {
        let near = |offset_m: &&f64| {
            let mut lanes = lanes.iter();
            lanes.any(|lane| (lane.offset_m - **offset_m).abs() < NEAR_MIDDLE_M)
        };
        let near = self.offsets_m.iter().filter(near).count() as f64;
        let (mut changes, mut driven_m) = (0.0, 0.0);
        for (_, track) in placed {
            let known = || track.lane.iter().flatten();
            changes += known().zip(known().skip(1)).filter(|(a, b)| a != b).count() as f64;
            let ends = track.s_m.first().zip(track.s_m.last());
            driven_m += ends.map_or(0.0, |(from, to)| (to - from).abs());
        }
        let settled = self.offsets_m.len() as f64;
        // A few changes on a short stretch are a high rate without any
        // meaning.
        let is_calm = changes < 4.0 || changes <= CHANGES_PER_KM * driven_m / 1000.0;
        settled >= SETTLED_SHARE * self.rows as f64 && near >= 0.75 * settled && is_calm
    }
}

/// Returns true if offsets change little within `reach` rows on either side.
pub(crate) fn is_settled(offsets_m: &[f64], at: usize, reach: usize) -> bool {
    let (from, to) = (
        at.saturating_sub(reach),
        (at + reach).min(offsets_m.len() - 1),
    );
    (offsets_m[to] - offsets_m[from]).abs() < SETTLED_M
}

/// Returns the peaks of offsets from right to left, with their counts.
///
/// A peak has at least the share `least` of all offsets within 1 m.
pub(crate) fn peaks(offsets: &[f64], least: f64) -> Vec<(f64, usize)> {
    let bins = (2.0 * WIDTH_M / BIN_M) as usize;
    let mut counts = vec![0.0_f64; bins];
    // Also keeps NaN out, which no comparison accepts.
    for offset in offsets.iter().filter(|it| it.abs() < WIDTH_M) {
        let bin = ((offset + WIDTH_M) / BIN_M) as usize;
        // The largest offset below the width may round into a bin too many.
        counts[bin.min(bins - 1)] += 1.0;
    }
    let smooth: Vec<f64> = (0..bins as isize)
        .map(|i| {
            // A triangle of ±0.6 m, because the counts of single bins are
            // noisy.
            let weight = |k: isize| f64::from(7 - k.unsigned_abs() as i32);
            let at = |k: isize| counts.get((i + k) as usize).copied().unwrap_or(0.0);
            (-6..=6).map(|k| weight(k) * at(k)).sum()
        })
        .collect();
    let mut order: Vec<usize> = (1..bins - 1)
        // One strict comparison, so that a plateau is one peak.
        .filter(|i| smooth[i - 1] <= smooth[*i] && smooth[i + 1] < smooth[*i])
        .collect();
    // The highest first, because a lane excludes lower peaks beside it.
    order.sort_by(|a, b| smooth[*b].total_cmp(&smooth[*a]));
    let mut found: Vec<(f64, usize)> = Vec::new();
    for i in order {
        let middle_m = (i as f64 + 0.5) * BIN_M - WIDTH_M;
        let near = |it: &&f64| (*it - middle_m).abs() < 1.0;
        let count = offsets.iter().filter(near).count();
        let is_apart = found.iter().all(|it| (it.0 - middle_m).abs() >= LANE_M);
        if is_apart && least * offsets.len() as f64 <= count as f64 {
            found.push((middle_m, count));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// Returns the lanes and the share of rows in none of them.
///
/// The lanes have the given offsets, or those of the peaks.
pub(crate) fn lanes(
    placed: &[(usize, PlacedTrack)],
    settled: &SettledRows,
    length_m: f64,
    offsets_m: Option<&[f64]>,
) -> (Vec<Lane>, f64) {
    let fitted = || {
        let peaks = peaks(&settled.offsets_m, LANE_SHARE);
        peaks.into_iter().map(|it| it.0).collect()
    };
    let offsets_m: Vec<f64> = offsets_m.map_or_else(fitted, <[f64]>::to_vec);
    let mut lanes: Vec<Lane> = offsets_m
        .into_iter()
        .map(|offset_m| Lane {
            offset_m,
            share: 0.0,
            wander_m: 0.0,
        })
        .collect();
    let pieces = (length_m / 100.0).ceil().max(1.0) as usize;
    let mut rows: Vec<Vec<Vec<f64>>> = vec![vec![Vec::new(); pieces]; lanes.len()];
    let mut counts = vec![0_usize; lanes.len()];
    for (_, track) in placed {
        for (s, lateral_m) in track.s_m.iter().zip(&track.lateral_m) {
            let Some(lane) = lane_at(&lanes, *lateral_m) else {
                continue;
            };
            counts[usize::from(lane)] += 1;
            let piece = ((s / 100.0).max(0.0) as usize).min(pieces - 1);
            rows[usize::from(lane)][piece].push(*lateral_m);
        }
    }
    for ((lane, rows), count) in lanes.iter_mut().zip(rows).zip(&counts) {
        // Of all rows and not of those in lanes, so that the shares and
        // `outside` sum to 1.
        lane.share = *count as f64 / settled.rows.max(1) as f64;
        let medians = rows
            .into_iter()
            // The median of a few rows is the wish of one driver, not the place of the lane.
            .filter(|it| it.len() >= 100)
            .filter_map(median);
        let mut wander: Vec<f64> = medians.map(|it| (it - lane.offset_m).abs()).collect();
        wander.sort_by(f64::total_cmp);
        // Not the greatest deviation, which a single short piece can cause.
        let at = (0.95 * wander.len().saturating_sub(1) as f64).ceil() as usize;
        lane.wander_m = wander.get(at).copied().unwrap_or(0.0);
    }
    let inside: usize = counts.iter().sum();
    (lanes, 1.0 - inside as f64 / settled.rows.max(1) as f64)
}
