//! Decoding of a start: initial state and plan of every agent.

use std::sync::Arc;

use super::layout::DriveLayout;
use super::plan::{MotionPlan, Unmet};
use super::plan_execution::{PlanConstants, PlanRun, PlannedAt};
use super::range::Range;
use super::spec::{DriveSpec, StartPlace};
use crate::scene::Start;
use crate::sim::Pose;
use crate::stl::Monitor;

/// Initial values of an agent, decoded from a start.
#[derive(Clone, Debug)]
pub struct Drawn {
    pub front_m: f64,
    pub lateral_m: f64,
    pub speed_mps: f64,
    pub plan: Option<MotionPlan<f64, ()>>,
}

impl Drawn {
    /// Returns the place of the front and the speed.
    fn planned_at(&self) -> PlannedAt {
        PlannedAt {
            s_m: self.front_m,
            lateral_m: self.lateral_m,
            speed_mps: self.speed_mps,
        }
    }
}

impl DriveSpec {
    /// Returns the parameters of a start.
    pub fn parameters_of(&self, start: &Start) -> Vec<f64> {
        let ranges = self.parameters.values();
        let drawn = ranges.clone().filter(|range| !range.is_fixed()).count();
        // Parameters are the last values of a start before its environment.
        let from = start.0.len().saturating_sub(drawn + self.environment.len());
        let mut drawn = start.0[from..].iter().copied();
        let value = |range: &Range| {
            if range.is_fixed() {
                range.lo
            } else {
                drawn.next().unwrap_or(range.lo)
            }
        };
        ranges.map(value).collect()
    }

    /// Returns the initial values of every agent, in file order.
    pub fn drawn(&self, start: &Start) -> Vec<Drawn> {
        // The order of these reads is that of `axes`, so a start is read as it
        // was drawn.
        let mut drawn = start.0.iter().copied();
        let mut value = |range: Range| {
            if range.is_fixed() {
                range.lo
            } else {
                drawn.next().unwrap_or(range.lo)
            }
        };
        let mut all: Vec<Drawn> = Vec::with_capacity(self.agents.len());
        for (i, agent) in self.agents.iter().enumerate() {
            let front_m = match agent.place {
                StartPlace::At { x_m, .. } => value(x_m),
                // The agent ahead precedes in file order, which loading
                // ensures.
                StartPlace::Ahead { of, headway_m, .. } => all[of].front_m + value(headway_m),
            };
            let lateral_m = value(agent.lateral_m) + self.lane_shift_m(i);
            let speed_mps = value(agent.place.speed_mps());
            let declared = agent.plan();
            all.push(Drawn {
                front_m,
                lateral_m,
                speed_mps,
                plan: declared.map(|plan| plan.map(|_, _, range| value(range))),
            });
        }
        all
    }

    /// Checks that every `meet` of a start is feasible.
    ///
    /// # Errors
    /// The first agent that cannot meet the ego, with the reason and a help.
    pub fn admits(&self, start: &Start) -> Result<(), (usize, Unmet)> {
        let drawn = self.drawn(start);
        let Some(ego) = self.egos().next().map(|ego| &drawn[ego]) else {
            return Ok(());
        };
        let ego = ego.planned_at();
        for (i, at) in drawn.iter().enumerate() {
            if let Some(plan) = &at.plan {
                // No monitors: feasibility does not depend on the formulas of
                // the steps.
                let carried = self.carried(i, Arc::from([]));
                PlanRun::begin(carried, plan.clone(), at.planned_at(), ego)
                    .map_err(|why| (i, why))?;
            }
        }
        Ok(())
    }

    fn carried(&self, agent: usize, whens: Arc<[Option<Monitor>]>) -> PlanConstants {
        let agent = &self.agents[agent];
        let road = agent
            .road
            .checked_sub(1)
            .and_then(|number| self.roads.get_index(number));
        // On a bent road, the middle of a walker keeps the line. Elsewhere its heading
        // never changes, so its front may stand for its middle.
        let bends = road.is_some_and(|(_, road)| !road.pieces.is_empty());
        PlanConstants {
            lever_m: if bends && agent.body.is_on_foot() {
                agent.body.half_length_m()
            } else {
                agent.body.lever_m()
            },
            front_m: agent.body.front_m(),
            length_m: agent.body.length_m,
            width_m: agent.body.width_m,
            facing_rad: agent.facing_rad,
            on_foot: agent.body.is_on_foot(),
            whens,
        }
    }
}

impl DriveLayout {
    /// Begins an agent's plan, if it has one.
    ///
    /// # Errors
    /// The agent cannot meet the ego.
    pub(super) fn begun(
        &self,
        agent: usize,
        drawn: &[Drawn],
    ) -> Result<Option<(PlanRun, Pose)>, Unmet> {
        let (at, ego) = (&drawn[agent], &drawn[self.ego]);
        let Some(plan) = at.plan.clone() else {
            return Ok(None);
        };
        let carried = self.spec.carried(agent, Arc::clone(&self.whens[agent]));
        let mut run = PlanRun::begin(carried, plan, at.planned_at(), ego.planned_at())?;
        let pose = run.pose(self.network.course_of(agent));
        run.begun(pose);
        Ok(Some((run, pose)))
    }
}
