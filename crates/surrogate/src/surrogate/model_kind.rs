//! Kinds of stock controllers that are fitted to an ego, with the ranges of their parameters.

use super::fitted_model::FittedModel;
use crate::ego::{Actuated, KINDS};

/// Longest delay of an ego's reaction, s.
const LONGEST_DELAY_S: f64 = 0.75;

/// Ranges of the parameters of stock controllers, by name.
///
/// A kind with any other parameter is not tried.
const RANGES: &[(&str, f64, f64)] = &[
    ("lag_s", 0.0, 1.0),
    ("kp_per_s2", 0.02, 1.5),
    ("kd_per_s", 0.1, 3.0),
    ("standstill_headway_m", 3.0, 20.0),
    ("time_gap_s", 0.1, 3.0),
    ("max_brake_mps2", 2.0, 10.0),
    ("max_accel_mps2", 0.5, 4.0),
    ("filter_brake_mps2", 3.0, 10.0),
    ("filter_margin_m", 0.0, 3.0),
    ("filter_delay_s", 0.0, 1.0),
    ("soft_brake_mps2", 0.5, 5.0),
    ("rear_gap_s", 0.1, 2.0),
    ("desired_speed_mps", 5.0, 50.0),
    ("min_gap_m", 0.1, 6.0),
    ("comfort_brake_mps2", 0.5, 7.0),
    ("reaction_s", 0.05, 1.5),
    ("plan_brake_mps2", 2.0, 9.0),
    ("leader_brake_mps2", 2.0, 9.0),
    ("transition_m", 3.0, 40.0),
    ("form", 0.2, 4.0),
    ("sensitivity_per_s", 0.05, 2.0),
    ("closing_gain_per_s", 0.0, 2.0),
    ("aeb_trigger_mps2", 2.0, 9.0),
    ("aeb_brake_mps2", 0.0, 10.0),
    ("cruise_gain_per_s", 0.1, 2.0),
    ("cruise_limit_mps2", 0.5, 4.0),
    ("trigger_mps2", 1.0, 9.0),
    ("margin_m", 0.0, 5.0),
    ("side_m", 0.0, 1.5),
    ("look_ahead_s", 1.0, 8.0),
    ("threshold_m", 0.0, 10.0),
    ("t_lka_s", 0.0, 4.0),
    ("ttc_s", 0.5, 5.0),
    ("foot_off_mps2", 0.0, 1.0),
    ("jerk_mps3", 2.0, 30.0),
    ("wander_m", 0.1, 1.0),
    ("perceived_m", 0.0, 1.5),
    ("inside_m", 0.0, 1.0),
    ("early_s", 0.0, 2.0),
    ("ego_accel_mps2", 0.0, 3.0),
    ("ego_brake_mps2", 2.0, 9.0),
    ("other_brake_mps2", 2.0, 10.0),
    ("lateral_accel_mps2", 0.1, 2.0),
    ("lateral_margin_m", 0.0, 1.0),
    ("hard_brake_mps2", 3.0, 9.0),
    ("standstill_gap_m", 0.0, 5.0),
    ("safe_margin_m", 0.0, 2.0),
    ("passing_margin_s", 0.0, 1.0),
];

/// Returns all kinds except those in `unknown`.
pub(super) fn kinds_except(unknown: &[&str]) -> Vec<&'static str> {
    let kinds = KINDS.iter().map(|(kind, _)| *kind);
    kinds.filter(|kind| !unknown.contains(kind)).collect()
}

/// Kind of stock controller and the ranges of its parameters.
pub(super) struct ModelKind {
    pub kind: &'static str,
    pub ranges: Vec<(&'static str, f64, f64)>,
}

impl ModelKind {
    /// Returns the kind, or `None` if a range of its parameters is missing.
    pub(super) fn of(&(kind, names): &(&'static str, &[&'static str])) -> Option<ModelKind> {
        let range = |name: &str| RANGES.iter().find(|range| range.0 == name).copied();
        // Every kind is tried with an actuator lag.
        let ranges: Vec<_> = names
            .iter()
            .map(|name| range(name))
            .chain([range("lag_s")])
            .collect::<Option<_>>()?;
        // A kind with the lag as its only parameter cannot be fitted.
        (ranges.len() > 1).then_some(ModelKind { kind, ranges })
    }

    /// Returns the controller at a point of the box.
    ///
    /// Coordinates run from −1 to 1, one per parameter and one for the delay.
    pub(super) fn at(&self, point: &[f64]) -> Option<FittedModel> {
        let within = |at: f64, low: f64, high: f64| low + 0.5 * (at + 1.0) * (high - low);
        let pairs = self.ranges.iter().zip(point);
        let values: Vec<_> = pairs
            .map(|(&(name, low, high), &at)| (name, within(at, low, high)))
            .collect();
        Some(FittedModel {
            controller: Actuated::of_kind(self.kind, &values)?,
            delay_s: within(*point.last()?, 0.0, LONGEST_DELAY_S),
            // Unknown until the controller was compared with the runs.
            unexplained: f64::INFINITY,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Scenario;

    #[test]
    fn every_range_holds_the_parameters_of_the_shipped_egos() {
        let world = Scenario::shipped("acc_structures").expect("shipped");
        for (name, change) in world.expect("sound").reuse() {
            let Some(controller) = &change.controller else {
                continue;
            };
            let kind_name = controller.controller.kind();
            let kind = KINDS
                .iter()
                .find(|other| other.0 == kind_name)
                .and_then(ModelKind::of)
                .expect("tried");
            for parameter in controller.parameters() {
                let mut ranges = kind.ranges.iter();
                let range = ranges.find(|range| range.0 == parameter.name);
                let (_, low, high) = range.expect("a range");
                let holds = (*low..=*high).contains(&parameter.value);
                assert!(holds, "{name}: {} {}", parameter.name, parameter.value);
            }
        }
    }
}
