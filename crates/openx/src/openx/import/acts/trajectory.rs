//! Trajectories in the acts of a storyboard.

use super::Reader;
use super::script::EntityScript;
use super::script::EventContext;
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::OnWay;
use crate::openx::import::bodies::MostRates;
use crate::openx::import::entity::{ImportedLaw, ImportedStep};
use crate::openx::import::trajectories::TimedPlace;
use crate::road::ChangeShape;

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
        let begins_s = script
            .ends_s
            .filter(|_| step.when.is_none())
            .map(|ends_s| ends_s + step.after_s);
        // Its first step is that of the run.
        let begins_s = begins_s.map(|at_s| if at_s <= SAME_S { 0.0 } else { at_s });
        let (way, times) = ground.followed(it, scope, begins_s)?;
        // The path replaces the placement, so both must agree at the
        // start.
        let off = way.spot().sees(&script.placed.spot);
        if libm::hypot(off.x_m, off.y_m) > SAME_M {
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
                    && way.way.piece_count() == 0 =>
            {
                script.placed.way = Some(way);
                step.laws.push(ImportedLaw::Walk {
                    speed_mps: (to_m - from_m) / lasts_s,
                    way_m: to_m - from_m,
                });
            }
            Some(times) => {
                script.follow(way);
                let laws = script.timed_speeds(&times);
                script.add_steps(&laws, step);
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

    /// Constant speeds between the places of a trajectory with times, with durations.
    fn timed_speeds(&mut self, times: &[TimedPlace]) -> Vec<(ImportedLaw, f64)> {
        self.speeds.now_mps = None;
        let lines = times.windows(2).map(|pair| {
            let lasts_s = pair[1].0 - pair[0].0;
            (speed_law((pair[1].1 - pair[0].1) / lasts_s, None), lasts_s)
        });
        lines.collect()
    }

    /// Changes of speed of a profile of durations and speeds.
    pub(super) fn profile(
        &mut self,
        it: &XmlNode,
        profile: &[(f64, f64)],
        most: MostRates,
    ) -> Result<Vec<(ImportedLaw, f64)>, ImportError> {
        let mut now_mps = self.speeds.now_mps.ok_or_else(|| {
            let help = "begin the profile where the speed is known";
            it.refused(
                "a profile after a speed that depends on the run is not read",
                help,
            )
        })?;
        let mut laws = Vec::new();
        for (lasts_s, to_mps) in profile {
            let rate_mps2 = (*lasts_s > 0.0).then(|| (to_mps - now_mps).abs() / lasts_s);
            let most_mps2 = most.towards(now_mps, *to_mps);
            if rate_mps2.is_some_and(|rate| most_mps2 < rate) {
                let what = format!("a rate above {most_mps2} m/s², which its body may not allow");
                return Err(it.refused(what, "give the entry a longer time"));
            }
            laws.push((
                speed_law(*to_mps, rate_mps2.filter(|rate| *rate > 0.0)),
                *lasts_s,
            ));
            now_mps = *to_mps;
        }
        self.speeds.now_mps = Some(now_mps);
        Ok(laws)
    }

    /// Adds laws with their durations as steps, the first of them to a step.
    pub(super) fn add_steps(&mut self, laws: &[(ImportedLaw, f64)], step: &mut ImportedStep) {
        let mut wait_s = 0.0;
        for (i, (law, lasts_s)) in laws.iter().enumerate() {
            if i == 0 {
                step.laws.push(law.clone());
            } else {
                self.later.push(ImportedStep {
                    when: None,
                    after_s: wait_s,
                    laws: vec![law.clone()],
                    overlaps: false,
                    at: step.at.clone(),
                });
            }
            // A change at a rate lasts as long as the step, and others take no time.
            let is_ramp = matches!(
                law,
                ImportedLaw::Speed {
                    rate_mps2: Some(_),
                    ..
                }
            );
            wait_s = if is_ramp { 0.0 } else { *lasts_s };
        }
    }
}

/// Change to a speed, linearly or at once.
fn speed_law(to_mps: f64, rate_mps2: Option<f64>) -> ImportedLaw {
    ImportedLaw::Speed {
        to_mps,
        relative_to: None,
        rate_mps2,
        shape: ChangeShape::Linear,
    }
}
