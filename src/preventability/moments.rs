//! The moments of a recorded episode at which drivers take over.

use serde::{Deserialize, Serialize};

use crate::ego::reference::{
    DriverModel, Encounter, IdealDriver, LaneBody, RegDriver, RssDriver, TtcReading,
};

/// How far off their lane's middle drivers wander.
const WANDER_M: f64 = 0.375;
/// Braking and acceleration that count.
const NOTABLE_MPS2: f64 = 1.0;
/// How far inside the lane a front tyre is when R157's formula is asked.
const INSIDE_M: f64 = 0.3;
/// For how long the sideways motion must have been visible by then.
const VISIBLE_S: f64 = 0.72;
/// Sideways motion that is visible.
const VISIBLE_MPS: f64 = 0.1;

/// A cut-in as UN R157 ¶5.2.5.2 judges it: when the other is 0.3 m inside.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutIn {
    /// When that was.
    pub time_s: f64,
    /// Time to collision then; `None`: the gap did not close.
    pub ttc_s: Option<f64>,
    /// The time to collision above which the contact must be avoided.
    pub bound_s: f64,
    /// Whether the regulation demands avoidance; if not it demands nothing.
    pub demands_avoidance: bool,
    /// Whether the other kept its speed within 1 m/s² up to then.
    pub constant_speed: bool,
    /// Whether its sideways motion had been visible for 0.72 s.
    pub visible: bool,
}

/// The recorded bodies in lane coordinates: per sample the ego and its traffic.
pub(super) struct LaneRecord {
    pub sample_s: f64,
    pub lane_width_m: f64,
    /// Agents per sample; the first is the ego.
    pub width: usize,
    pub bodies: Vec<LaneBody>,
    /// Whether the ego sees each of them; it sees itself.
    pub seen: Vec<bool>,
}

impl LaneRecord {
    /// The ego and the others at every sample, in order.
    pub fn rows(&self) -> impl Iterator<Item = (LaneBody, &[LaneBody])> {
        let rows = self.bodies.chunks_exact(self.width.max(1));
        rows.filter_map(|row| row.split_first().map(|(ego, others)| (*ego, others)))
    }

    /// The first sample at which `holds` of the ego and somebody whom it sees.
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

    /// t_h: the first sample at which a driver may have something to answer.
    ///
    /// Somebody is ahead, sideways where it counts, and slower or braking.
    pub fn handover(&self) -> Option<usize> {
        self.first(|ego, other| {
            let encounter = self.encounter(ego, *other);
            let slower = 0.0 < encounter.closing_mps() || other.accel_mps2 < -NOTABLE_MPS2;
            let beside_m = RssDriver::default().lateral_m(other.lateral_mps);
            let clearance_m = encounter.clearance_m();
            let near = clearance_m <= 0.0 || clearance_m < beside_m;
            ego.x_m < other.x_m && slower && (near || self.leaves_lane(&ego, other))
        })
    }

    /// Whether the other is off its lane's middle, towards the ego.
    fn leaves_lane(&self, ego: &LaneBody, other: &LaneBody) -> bool {
        let off_m = other.y_m - self.middle_m(other.y_m);
        let towards_m = if other.y_m < ego.y_m { off_m } else { -off_m };
        WANDER_M < towards_m
    }

    /// The middle of the lane in which a lateral position lies.
    fn middle_m(&self, lateral_m: f64) -> f64 {
        libm::round(lateral_m / self.lane_width_m) * self.lane_width_m
    }

    /// t_d: the first sample at which the ideal driver brakes.
    pub fn danger(&self) -> Option<usize> {
        let ideal = IdealDriver::default();
        self.first(|ego, other| {
            ego.x_m <= other.x_m && ideal.danger(&self.encounter(ego, *other)).is_some()
        })
    }

    /// The cut-in of other number `with`, if it came from another lane.
    pub fn cut_in(&self, with: usize) -> Option<CutIn> {
        let others = self.rows().map(|(ego, others)| (ego, others[with]));
        let pairs: Vec<(LaneBody, LaneBody)> = others.collect();
        let inside_m = |(ego, other): &(LaneBody, LaneBody)| {
            let off_m = (other.y_m - self.middle_m(ego.y_m)).abs();
            0.5 * (self.lane_width_m + other.width_m) - off_m
        };
        let sample = pairs.iter().position(|pair| INSIDE_M <= inside_m(pair))?;
        let came = &pairs[..sample];
        let (ego, other) = pairs[sample];
        let is_cut_in = 0 < sample && ego.x_m < other.x_m;
        let encounter = self.encounter(ego, other);
        let ttc_s = encounter.ttc_s();
        let bound_s = RegDriver::default().bound_s(encounter.closing_mps());
        let seen = came.iter().rev();
        let seen = seen.take_while(|(_, other)| VISIBLE_MPS < other.lateral_mps.abs());
        let visible_s = seen.count() as f64 * self.sample_s;
        is_cut_in.then_some(CutIn {
            time_s: sample as f64 * self.sample_s,
            ttc_s: ttc_s.is_finite().then_some(ttc_s),
            bound_s,
            demands_avoidance: bound_s < ttc_s,
            constant_speed: came.iter().all(|it| it.1.accel_mps2.abs() <= NOTABLE_MPS2),
            visible: VISIBLE_S <= visible_s + 1e-9,
        })
    }
}
