//! Limits on how rare the behaviour of an ado may become.

use crate::braking::MotionMeter;
use crate::model::TrafficModel;
use crate::rarity::CutInState;
use crate::starts::StartState;

/// Limit on the rarity of events, for a mask on actions.
///
/// An action is allowed if the event that it starts or continues is still at least as
/// frequent as the limit. An event only becomes rarer as it grows, so no look-ahead is
/// needed. Keeping the speed is always allowed.
///
/// ```
/// use brakecheck_driver_model::{MotionMeter, NaturalLimit, TrafficModel};
///
/// let model = TrafficModel::motorway();
/// let limit = NaturalLimit::new(&model, 3.0);
/// let mut meter = MotionMeter::new(30.0);
/// meter.push(0.0);
/// assert!(limit.allows_acceleration(&meter, -1.0));
/// assert!(!limit.allows_acceleration(&meter, -9.0));
/// assert!(limit.allows_acceleration(&meter, 0.0));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct NaturalLimit<'a> {
    model: &'a TrafficModel,
    per_1000_km: f64,
}

impl<'a> NaturalLimit<'a> {
    /// Creates a limit at a rate per 1,000 km.
    pub fn new(model: &'a TrafficModel, per_1000_km: f64) -> NaturalLimit<'a> {
        NaturalLimit { model, per_1000_km }
    }

    /// Returns true if the limit is below the rates that the data supports.
    pub fn is_extrapolated(&self) -> bool {
        self.per_1000_km < self.model.supported_per_1000_km()
    }

    /// Returns true if a decision of 0.5 s with this acceleration is allowed.
    ///
    /// `meter` has the vehicle's decisions so far.
    pub fn allows_acceleration(&self, meter: &MotionMeter, accel_mps2: f64) -> bool {
        if accel_mps2 == 0.0 {
            return true;
        }
        // A copy: the action is only tried.
        let mut after = *meter;
        after.push(accel_mps2);
        // Both, since an action may continue one event while it ends the
        // other.
        self.allows_braking(&after) && self.allows_speeding_up(&after)
    }

    fn allows_braking(&self, after: &MotionMeter) -> bool {
        after.braking.event().is_none_or(|event| {
            let peak = self.model.braking_peak.rate_of(event.peak_mps2);
            let loss = self.model.braking_loss.rate_of(event.speed_lost_mps);
            self.per_1000_km <= peak.rate.min(loss.rate)
        })
    }

    fn allows_speeding_up(&self, after: &MotionMeter) -> bool {
        let tail = self.model.acceleration_peak.as_ref();
        let event = tail.zip(after.acceleration.event());
        event.is_none_or(|(tail, event)| self.per_1000_km <= tail.rate_of(event.peak_mps2).rate)
    }

    /// Returns true if crossing the line in front of a follower is allowed.
    ///
    /// A model without cut-ins allows none.
    pub fn allows_cut_in(&self, state: &CutInState) -> bool {
        let rated = self.model.cut_in(state.needed_mps2());
        // At the limit itself an event is still allowed.
        rated.is_some_and(|it| self.per_1000_km <= it.per_1000_km.rate)
    }

    /// Returns true if a start is among the recorded ones.
    ///
    /// `one_in` is the number of followed moments of which at least one is as tight.
    pub fn allows_start(&self, start: &StartState, one_in: f64) -> bool {
        // A product and no quotient, because the share may be 0.
        one_in * self.model.starts.rarity_of(start).share >= 1.0
    }
}
