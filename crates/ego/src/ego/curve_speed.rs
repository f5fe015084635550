//! Curve speed control: slows down for the bends that it looks ahead for.
//!
//! A bend of curvature κ allows v = √(a_y / |κ|), with a_y the accepted lateral
//! acceleration. A bend that begins at a distance d allows √(v² + 2 b d) now,
//! with b the planned braking. The controller drives at the least of these speeds
//! over its preview and at most at its desired speed. It keeps its lane and ignores
//! other road users.

use super::parameters::parameters;
use super::{Briefing, Command, Controller, Fault, Own, Percept, RoadPiece};

parameters! {
    /// Drives at a desired speed, and slower in the bends within its preview.
    pub struct CurveSpeed {
        /// Speed on a straight road, m/s.
        desired_speed_mps, at_least 0.1;
        /// Gain on the speed error, 1/s.
        cruise_gain_per_s, at_least 0.0;
        /// Greatest acceleration, m/s².
        max_accel_mps2, at_least 0.0;
        /// Hardest braking, m/s².
        max_brake_mps2, at_least 0.0;
        /// Lateral acceleration that it accepts in bends, m/s².
        side_accel_mps2, at_least 0.1;
        /// Braking that it plans before bends, m/s².
        plan_brake_mps2, at_least 0.0;
        /// Time ahead for which it regards the road, s.
        preview_s, at_least 0.0;
    }
}

/// The controller with its map.
#[derive(Clone, Debug)]
pub(super) struct CurveDriver {
    spec: CurveSpeed,
    pieces: Vec<RoadPiece>,
}

impl CurveSpeed {
    pub(super) fn build(&self) -> CurveDriver {
        CurveDriver {
            spec: self.clone(),
            pieces: Vec::new(),
        }
    }

    /// Returns the speed that a piece of road allows at a place.
    ///
    /// `None` if the piece is behind or beyond the preview.
    fn allowed_mps(&self, own: &Own, piece: &RoadPiece) -> Option<f64> {
        let to_m = piece.from_s_m + piece.length_m - own.s_m;
        let from_m = (piece.from_s_m - own.s_m).max(0.0);
        if to_m <= 0.0 || self.preview_s * own.speed_mps < from_m {
            return None;
        }
        // A straight piece divides by 0 and allows an infinite speed, which
        // `min` ignores.
        let bend2 = self.side_accel_mps2 / piece.curvature_per_m.abs();
        Some((bend2 + 2.0 * self.plan_brake_mps2 * from_m).sqrt())
    }
}

impl Controller for CurveDriver {
    fn brief(&mut self, briefing: &Briefing) {
        self.pieces.clone_from(&briefing.road.pieces);
    }

    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let (spec, own) = (&self.spec, &percept.own);
        let allowed = self
            .pieces
            .iter()
            .filter_map(|piece| spec.allowed_mps(own, piece));
        let wanted_mps = allowed.fold(spec.desired_speed_mps, f64::min);
        let wish_mps2 = spec.cruise_gain_per_s * (wanted_mps - own.speed_mps);
        Ok(Command::accelerate(
            wish_mps2.clamp(-spec.max_brake_mps2, spec.max_accel_mps2),
        ))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_counts_from_its_preview_on_until_its_end() {
        let law = CurveSpeed {
            desired_speed_mps: 20.0,
            cruise_gain_per_s: 1.0,
            max_accel_mps2: 2.0,
            max_brake_mps2: 4.0,
            side_accel_mps2: 2.0,
            plan_brake_mps2: 2.0,
            preview_s: 2.0,
        };
        let mut driver = law.build();
        let mut briefing = Briefing::default();
        briefing.road.pieces = vec![RoadPiece {
            from_s_m: 100.0,
            length_m: 50.0,
            curvature_per_m: -0.02,
        }];
        driver.brief(&briefing);
        let mut wish = |s_m: f64, speed_mps: f64| {
            let own = Own {
                s_m,
                speed_mps,
                ..Own::default()
            };
            let percept = Percept {
                own,
                ..Percept::default()
            };
            driver.control(&percept).expect("a command").accel_mps2
        };
        // 41 m before it, 40 m are regarded.
        assert_eq!(wish(59.0, 20.0), 0.0);
        // √(2 / 0.02 + 2 · 2 · 36) = √244 = 15.6 m/s, so it brakes with 4 m/s² at most.
        assert_eq!(wish(64.0, 20.0), -4.0);
        // √(2 / 0.02 + 2 · 2 · 28) = √212 at 28 m, within the preview of 30 m.
        assert!((wish(72.0, 15.0) - (212.0_f64.sqrt() - 15.0)).abs() < 1e-12);
        // √(2 / 0.02) = 10 m/s in the bend, and 20 m/s behind it.
        assert!(wish(149.9, 10.0).abs() < 1e-12);
        assert_eq!(wish(150.0, 10.0), 2.0);
    }
}
