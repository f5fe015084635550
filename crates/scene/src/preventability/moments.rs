//! Instants of a recorded episode at which drivers take over.

use serde::{Deserialize, Serialize};

use crate::ego::reference::{
    DriverModel, Encounter, IdealDriver, LaneBody, RegDriver, RssDriver, TtcReading,
};

/// Lateral distance within which drivers wander around their lane's middle.
const WANDER_M: f64 = 0.375;
/// Smallest braking or acceleration that counts.
const NOTABLE_MPS2: f64 = 1.0;
/// Depth of a front tyre inside the lane at which R157's formula applies.
const INSIDE_M: f64 = 0.3;
/// Duration for which the lateral motion must have been visible by then.
const VISIBLE_S: f64 = 0.72;
/// Smallest lateral speed that is visible.
const VISIBLE_MPS: f64 = 0.1;

/// Cut-in as judged by UN R157 ¶5.2.5.2, when the other is 0.3 m inside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CutIn {
    /// Time of that instant.
    pub time_s: f64,
    /// Time to collision at that instant, `None` if the gap did not close.
    pub ttc_s: Option<f64>,
    /// Time to collision above which the contact must be avoided.
    pub bound_s: f64,
    /// True if the regulation demands avoidance. Otherwise it demands nothing.
    pub(crate) demands_avoidance: bool,
    /// True if the other kept its speed within 1 m/s² until then.
    pub(crate) constant_speed: bool,
    /// True if its lateral motion had been visible for 0.72 s.
    pub visible: bool,
}

/// Recorded bodies in lane coordinates: the ego and its traffic per sample.
pub(super) struct LaneRecord {
    pub sample_s: f64,
    pub lane_width_m: f64,
    /// Number of agents per sample. The first is the ego.
    pub width: usize,
    pub bodies: Vec<LaneBody>,
    /// Visibility of each agent for the ego. The ego sees itself.
    pub seen: Vec<bool>,
}

impl LaneRecord {
    /// Returns the ego and the others at every sample, in order.
    pub(super) fn rows(&self) -> impl Iterator<Item = (LaneBody, &[LaneBody])> {
        // `chunks_exact` panics on 0, the width of an empty record.
        let rows = self.bodies.chunks_exact(self.width.max(1));
        rows.filter_map(|row| row.split_first().map(|(ego, others)| (*ego, others)))
    }

    /// Returns the first sample at which `holds` for the ego and an agent that it sees.
    fn first(&self, holds: impl Fn(LaneBody, &LaneBody) -> bool) -> Option<usize> {
        let seen = self.seen.chunks_exact(self.width.max(1));
        let mut rows = self.rows().zip(seen);
        rows.position(|((ego, others), seen)| {
            let mut others = others.iter().zip(seen.iter().skip(1));
            others.any(|(other, seen)| *seen && holds(ego, other))
        })
    }

    fn encounter(&self, ego: LaneBody, other: LaneBody) -> Encounter {
        Encounter {
            ego,
            other,
            accel_mps2: ego.accel_mps2,
            lane_width_m: self.lane_width_m,
            ttc: TtcReading::Closing,
        }
    }

    /// Returns t_h, the first sample at which a driver may have to react.
    ///
    /// An agent is ahead, laterally relevant, and slower or braking.
    pub(super) fn handover(&self) -> Option<usize> {
        self.first(|ego, other| {
            let encounter = self.encounter(ego, *other);
            // A lead that brakes is a danger before it is slower.
            let slower = encounter.closing_mps() > 0.0 || other.accel_mps2 < -NOTABLE_MPS2;
            // Laterally relevant: overlapping, inside RSS's lateral distance, or leaving
            // its lane.
            let beside_m = RssDriver::default().lateral_m(other.lateral_mps);
            let clearance_m = encounter.clearance_m();
            let near = clearance_m <= 0.0 || clearance_m < beside_m;
            ego.x_m < other.x_m && slower && (near || self.leaves_lane(&ego, other))
        })
    }

    /// Returns whether the other is off its lane's middle, towards the ego.
    fn leaves_lane(&self, ego: &LaneBody, other: &LaneBody) -> bool {
        let off_m = other.y_m - self.middle_m(other.y_m);
        let towards_m = if other.y_m < ego.y_m { off_m } else { -off_m };
        towards_m > WANDER_M
    }

    /// Returns the middle of the lane of a lateral position.
    fn middle_m(&self, lateral_m: f64) -> f64 {
        libm::round(lateral_m / self.lane_width_m) * self.lane_width_m
    }

    /// Returns t_d, the first sample at which the ideal driver brakes.
    pub(super) fn danger(&self) -> Option<usize> {
        let ideal = IdealDriver::default();
        self.first(|ego, other| {
            ego.x_m <= other.x_m && ideal.danger(&self.encounter(ego, *other)).is_some()
        })
    }

    /// Returns the cut-in of the agent number `with`, if it came from another lane.
    pub(super) fn cut_in(&self, with: usize) -> Option<CutIn> {
        let others = self.rows().map(|(ego, others)| (ego, others[with]));
        let pairs: Vec<(LaneBody, LaneBody)> = others.collect();
        let inside_m = |(ego, other): &(LaneBody, LaneBody)| {
            let off_m = (other.y_m - self.middle_m(ego.y_m)).abs();
            // Depth of the nearer side inside the ego's lane.
            0.5 * (self.lane_width_m + other.width_m) - off_m
        };
        let sample = pairs.iter().position(|pair| inside_m(pair) >= INSIDE_M)?;
        let came = &pairs[..sample];
        let (ego, other) = pairs[sample];
        // At sample 0 it is already inside, so it did not come from another lane.
        let is_cut_in = sample > 0 && ego.x_m < other.x_m;
        let encounter = self.encounter(ego, other);
        let ttc_s = encounter.ttc_s();
        let bound_s = RegDriver::default().bound_s(encounter.closing_mps());
        // Visibility counts backwards without a gap from the instant of the formula.
        let seen = came
            .iter()
            .rev()
            .take_while(|(_, other)| other.lateral_mps.abs() > VISIBLE_MPS);
        let visible_s = seen.count() as f64 * self.sample_s;
        is_cut_in.then_some(CutIn {
            time_s: sample as f64 * self.sample_s,
            ttc_s: ttc_s.is_finite().then_some(ttc_s),
            bound_s,
            demands_avoidance: bound_s < ttc_s,
            constant_speed: came.iter().all(|it| it.1.accel_mps2.abs() <= NOTABLE_MPS2),
            // 1e-9 absorbs the rounding of samples × period.
            visible: visible_s + 1e-9 >= VISIBLE_S,
        })
    }
}
