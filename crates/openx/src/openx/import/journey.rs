//! Earliest times at which entities leave their roads.

use super::entity::{ImportedEntity, ImportedLaw, ImportedStep, LateralState};

/// Earliest time in seconds at which an entity has driven `ahead_m`.
///
/// Relative speeds assume an ego that coasts.
pub(super) fn leaves_s(entity: &ImportedEntity, ahead_m: f64, ego_mps: f64) -> f64 {
    let mut journey = Journey {
        time_s: 0.0,
        left_m: ahead_m,
        speed_mps: entity.speed_mps,
        lateral: LateralState::at_start(&entity.placed),
    };
    for (i, step) in entity.steps.iter().enumerate() {
        if step.when.is_some() {
            // A pessimistic bound: the step may begin at any time, so the
            // greatest later speed counts from now on.
            let later = entity.steps[i..]
                .iter()
                .flat_map(|it| &it.laws)
                .filter_map(|law| to_mps(law, ego_mps));
            journey.speed_mps = later.fold(journey.speed_mps, f64::max);
            return journey.leaves_s();
        }
        if let Some(leaves_s) = journey.carry_out(step, ego_mps) {
            return leaves_s;
        }
    }
    journey.leaves_s()
}

/// Initial speed of an entity and those of its steps in m/s, as far as they are known.
pub(super) fn speeds_mps(entity: &ImportedEntity) -> impl Iterator<Item = f64> {
    let laws = entity.steps.iter().flat_map(|step| &step.laws);
    let later = laws.filter_map(|law| to_mps(law, entity.speed_mps));
    later.chain([entity.speed_mps])
}

/// Least of the speeds of an entity in m/s.
pub(super) fn slowest_mps(entity: &ImportedEntity) -> f64 {
    speeds_mps(entity).fold(f64::INFINITY, f64::min)
}

/// Final speed in m/s of a law, beside an ego that coasts.
pub(super) fn to_mps(law: &ImportedLaw, ego_mps: f64) -> Option<f64> {
    match law {
        ImportedLaw::Speed {
            to_mps,
            relative_to,
            ..
        } => {
            let base_mps = relative_to.as_ref().map_or(0.0, |_| ego_mps);
            // A negative sum would reverse, which no plan does.
            Some((base_mps + to_mps).max(0.0))
        }
        ImportedLaw::Walk { .. } | ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. } => {
            None
        }
    }
}

/// Progress of an entity towards the end of its road.
struct Journey {
    time_s: f64,
    left_m: f64,
    speed_mps: f64,
    lateral: LateralState,
}

impl Journey {
    /// Time at which the end is reached at the current speed, in seconds.
    fn leaves_s(&self) -> f64 {
        self.time_s + self.left_m / self.speed_mps
    }

    /// Advances at an evenly changing speed.
    ///
    /// Returns the time at which the end is reached, if it is reached on the
    /// way.
    fn go_on(&mut self, for_s: f64, to_mps: f64) -> Option<f64> {
        let mean_mps = 0.5 * (self.speed_mps + to_mps);
        let way_m = mean_mps * for_s;
        if self.left_m <= way_m {
            // The greater of both speeds gives the earliest time, which is the
            // safe side.
            return Some(self.time_s + self.left_m / self.speed_mps.max(to_mps));
        }
        self.left_m -= way_m;
        self.time_s += for_s;
        self.speed_mps = to_mps;
        None
    }

    /// Executes a step.
    ///
    /// Returns the time at which the end is reached, if it is reached on the
    /// way.
    fn carry_out(&mut self, step: &ImportedStep, ego_mps: f64) -> Option<f64> {
        let waits = self.go_on(step.after_s, self.speed_mps);
        if waits.is_some() {
            return waits;
        }
        let (mut ramp_s, mut aside_s, mut ends_mps) = (0.0, 0.0, self.speed_mps);
        for law in &step.laws {
            let lasts_s = law.lasts_s(Some(self.speed_mps), self.lateral);
            match law {
                ImportedLaw::Speed {
                    rate_mps2, shape, ..
                } => {
                    ends_mps = to_mps(law, ego_mps).unwrap_or(ends_mps);
                    match rate_mps2 {
                        Some(rate_mps2) => {
                            let change_mps = (ends_mps - self.speed_mps).abs();
                            ramp_s = shape.peak() * change_mps / rate_mps2;
                        }
                        None => self.speed_mps = ends_mps,
                    }
                }
                ImportedLaw::LaneChange { by_m, .. } => {
                    aside_s = lasts_s.unwrap_or(0.0);
                    self.lateral.change(*by_m);
                }
                ImportedLaw::Beside { t_m, .. } => {
                    aside_s = lasts_s.unwrap_or(0.0);
                    self.lateral.t_m = t_m + self.lateral.changed_m;
                }
                // Pedestrians stop at the end of their path and never leave a
                // road.
                ImportedLaw::Walk { .. } => return Some(f64::INFINITY),
            }
        }
        if step.overlaps {
            aside_s = 0.0;
        }
        // Laws of one step run at the same time, so the longer one determines
        // its duration.
        let ramp = self.go_on(ramp_s, ends_mps);
        ramp.or_else(|| self.go_on((aside_s - ramp_s).max(0.0), ends_mps))
    }
}
