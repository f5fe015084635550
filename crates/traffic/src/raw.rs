//! Rows of road users as they are read, in seconds and metres.

use std::f64::consts::PI;

use crate::recording::{Class, ReadCounts};

/// Greatest distance from the origin of the file, beyond which nothing on Earth is.
pub(crate) const FARTHEST_M: f64 = 1.0e8;

/// Share by which the lengths of a road user may vary.
const VARYING: f64 = 0.2;

/// Recorded vector of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RawVector {
    Unknown,
    Along(f64),
    Components(f64, f64),
}

/// Row of a road user, in seconds and metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawRow {
    pub(crate) time_s: f64,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) heading_rad: Option<f64>,
    pub(crate) velocity: RawVector,
    pub(crate) acceleration: RawVector,
    pub(crate) marked: bool,
    /// Length and width in metres, 0 if they are not recorded.
    pub(crate) size_m: [f64; 2],
    /// Class of this row, `None` where only shares of all rows are known.
    pub(crate) class: Option<Class>,
}

/// Point of a road user whose positions are recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum RawReference {
    #[default]
    Centre,
    Front,
    /// The box centre lies this far ahead and to the left of it.
    CentreAt {
        ahead_m: f64,
        left_m: f64,
    },
}

impl RawReference {
    /// Returns how far the centre is ahead and to the left.
    pub(crate) fn centre_m(self, length_m: f64) -> (f64, f64) {
        match self {
            RawReference::Centre => (0.0, 0.0),
            RawReference::Front => (-0.5 * length_m, 0.0),
            RawReference::CentreAt { ahead_m, left_m } => (ahead_m, left_m),
        }
    }
}

/// Rows of a road user, in any order.
#[derive(Clone, Debug, Default)]
pub(crate) struct RawTrack {
    pub(crate) id: Vec<u8>,
    pub(crate) reference: RawReference,
    pub(crate) rows: Vec<RawRow>,
    /// Sum per class.
    pub(crate) shares: [f64; Class::ALL.len()],
    /// Length and width for rows without a size, `None` for those of the class.
    pub(crate) size_m: Option<[f64; 2]>,
}

impl RawTrack {
    /// Returns the mean length and width of rows, and whether they vary.
    pub(crate) fn size_m(&self, rows: &[RawRow], class: Class) -> ([f64; 2], bool) {
        let known = || {
            rows.iter()
                .filter(|it| it.size_m[0] > 0.0 && it.size_m[1] > 0.0)
        };
        let count = known().count();
        // The meta file, then the class. A single recorded size has priority
        // over both.
        if count == 0 {
            return (self.size_m.unwrap_or_else(|| class.usual_size_m()), false);
        }
        let mean = |axis: usize| known().map(|it| it.size_m[axis]).sum::<f64>() / count as f64;
        let (length_m, width_m) = (mean(0), mean(1));
        let varies = known().any(|it| (it.size_m[0] - length_m).abs() > VARYING * length_m);
        ([length_m, width_m], varies)
    }

    pub(crate) fn has_size(&self) -> bool {
        self.size_m.is_some() || self.rows.iter().any(|it| it.size_m[0] > 0.0)
    }

    /// Returns the most frequent class of rows.
    pub(crate) fn class(&self, rows: &[RawRow]) -> Class {
        let mut shares = [0.0; Class::ALL.len()];
        for class in rows.iter().filter_map(|it| it.class) {
            shares[class as usize] += 1.0;
        }
        // No row states a class, so the sums of the share columns decide.
        if shares.iter().all(|it| *it == 0.0) {
            shares = self.shares;
        }
        let by_share =
            |a: &&Class, b: &&Class| shares[**a as usize].total_cmp(&shares[**b as usize]);
        let best = Class::ALL.iter().max_by(by_share);
        best.copied().unwrap_or_default()
    }

    pub(crate) fn id(&self) -> String {
        String::from_utf8_lossy(&self.id).into_owned()
    }
}

/// All rows of a file.
pub(crate) struct RawTracks {
    pub(crate) tracks: Vec<RawTrack>,
    pub(crate) counts: ReadCounts,
    pub(crate) origin_m: [f64; 2],
    /// Columns and units in words.
    pub(crate) reading: String,
    /// Rate of a column of frames.
    pub(crate) rate_hz: Option<f64>,
}

/// Returns an angle in (−π, π].
pub(crate) fn wrapped(angle_rad: f64) -> f64 {
    let turn = 2.0 * PI;
    let rest = angle_rad.rem_euclid(turn);
    // `rem_euclid` gives [0, 2π), whose upper half is moved below zero.
    if rest > PI { rest - turn } else { rest }
}
