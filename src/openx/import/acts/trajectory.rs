//! Trajectories in the acts of a storyboard.

use super::Reader;
use super::script::EntityScript;
use super::script::EventContext;
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::OnWay;
use crate::openx::import::entity::{ImportedLaw, ImportedStep};
use crate::openx::import::trajectories::TimedPlace;
use crate::scene::drive::ChangeShape;

/// Tolerance in metres between the start of a path and the entity's place.
const SAME_M: f64 = 0.01;
/// Latest begin in seconds of a trajectory that counts as that of the run.
const SAME_S: f64 = 0.02;

impl Reader<'_> {
    /// Reads the trajectory of an entity that has stood at its start so far.
    pub(super) fn trajectory(
        &mut self,
        who: usize,
        context: &EventContext<'_>,
        it: &XmlNode,
        step: &mut ImportedStep,
    ) -> Result<(), ImportError> {
        let (scope, ground) = (context.scope, self.ground);
        let script = &mut self.scripts[who];
        let (way, times) = ground.followed(it, scope)?;
        // The path replaces the placement, so both must agree at the
        // start.
        let off = way.spot().sees(&script.placed.spot);
        if SAME_M < libm::hypot(off.x_m, off.y_m) {
            let what = format!(
                "a way that begins {:.3} m from the place of an agent",
                libm::hypot(off.x_m, off.y_m)
            );
            let help = "begin the trajectory where the entity is placed";
            return Err(it.refused(what, help));
        }
        let begins_now = step.when.is_none() && step.after_s <= SAME_S;
        if !begins_now && script.speeds.now_mps != Some(0.0) {
            let help = "let it stand until then, or begin the trajectory at the start";
            return Err(it.refused(
                "a trajectory of an agent that moves already is not read",
                help,
            ));
        }
        match times {
            // A walk stops at its end.
            Some(times)
                if let [(_, from_m), (lasts_s, to_m)] = times[..]
                    && script.on_foot
                    && way.way.pieces.is_empty() =>
            {
                script.placed.way = Some(way);
                step.laws.push(ImportedLaw::Walk {
                    speed_mps: (to_m - from_m) / lasts_s,
                    way_m: to_m - from_m,
                });
            }
            Some(times) => {
                script.follow(way);
                script.timed_steps(&times, step);
            }
            None => script.follow(way),
        }
        Ok(())
    }
}

impl EntityScript {
    /// Puts the entity on a path, which it follows to its end.
    fn follow(&mut self, way: OnWay) {
        self.placed.spot = way.spot();
        self.placed.way = Some(way);
        self.placed.lane = None;
        self.follows = true;
    }

    /// Adds a speed for each line between two places with times.
    fn timed_steps(&mut self, times: &[TimedPlace], step: &mut ImportedStep) {
        let mut wait_s = 0.0;
        for pair in times.windows(2) {
            let lasts_s = pair[1].0 - pair[0].0;
            let law = ImportedLaw::Speed {
                to_mps: (pair[1].1 - pair[0].1) / lasts_s,
                relative_to: None,
                rate_mps2: None,
                shape: ChangeShape::Linear,
            };
            if wait_s == 0.0 {
                step.laws.push(law);
            } else {
                self.timed.push(ImportedStep {
                    when: None,
                    after_s: wait_s,
                    laws: vec![law],
                    overlaps: false,
                });
            }
            wait_s = lasts_s;
        }
    }
}
