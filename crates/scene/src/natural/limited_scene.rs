//! Scene whose ados drive within a limit on how rare their driving may become.

use std::sync::Arc;

use super::AdoLimit;
use super::vehicle_meter::VehicleMeter;
use crate::ego::Command;
use crate::rl::Spaces;
use crate::scene::drive::{Actions, Drive, DriveSpec, DriveWorld};
use crate::scene::{
    AfterContact, Axis, BodySample, BodyState, Clock, Frame, Scene, SceneGeometry, Start,
    StepOutcome,
};
use crate::seed::StartKey;
use crate::trace::Schema;
use brakecheck_driver_model::{CUT_IN_GAP_M, CutInState, NaturalLimit};

/// Driving scene with the actions that a limit allows.
pub struct LimitedScene {
    /// Scene whose actions are limited.
    pub scene: Box<dyn Scene>,
    /// Limit on the ados.
    pub limit: AdoLimit,
    /// World of the scene.
    pub world: DriveWorld,
    /// Ados that drive vehicles.
    pub ados: Vec<LimitedVehicle>,
    /// Motion of all bodies at the last sample.
    pub bodies: Vec<BodySample>,
}

/// Ado that drives a vehicle.
#[derive(Clone)]
pub struct LimitedVehicle {
    /// Number of the agent.
    pub agent: usize,
    /// Driving so far.
    pub meter: VehicleMeter,
    /// Acceleration that its last action added to its plan, 0 without a plan.
    pub added_mps2: f64,
}

impl LimitedScene {
    /// Limits a driving scene. A scene without roads is returned as it is.
    pub fn around(scene: Box<dyn Scene>, limit: &AdoLimit) -> Box<dyn Scene> {
        match scene.driven() {
            None => scene,
            Some(world) => Box::new(LimitedScene {
                scene,
                limit: limit.clone(),
                world,
                ados: Vec::new(),
                bodies: Vec::new(),
            }),
        }
    }

    fn read(&mut self) {
        self.bodies.clear();
        self.scene.bodies(&mut self.bodies);
    }

    /// Reads the bodies after a sample into the meters of the ados.
    fn measure(&mut self) {
        self.read();
        for ado in &mut self.ados {
            ado.meter.push(self.bodies[ado.agent].state.speed_mps);
        }
    }

    /// Returns the actions of one set that are allowed.
    fn allowed_of(&self, agent: usize, actions: &Actions, neutral: usize) -> Vec<bool> {
        let ado = self.ados.iter().find(|ado| ado.agent == agent);
        let allows = |action: usize| match (ado, actions.motion(action)) {
            // The neutral action is always allowed, so that no ado is left
            // without one.
            _ if action == neutral => true,
            (Some(ado), Some(wish)) => self.allows(ado, wish),
            // Nothing is known about people on foot.
            _ => true,
        };
        (0..actions.len()).map(allows).collect()
    }

    /// Returns whether an ado may accelerate and move sideways like this.
    pub fn allows(&self, ado: &LimitedVehicle, wish: Command) -> bool {
        let spec = self.world.spec();
        let limit = NaturalLimit::new(&self.limit.model, self.limit.per_1000_km);
        // A deviation is added to what the plan does, and drivers are rated by the sum.
        let plan_mps2 = match spec.agents[ado.agent].plan() {
            Some(_) => self.bodies[ado.agent].state.accel_mps2 - ado.added_mps2,
            // Without a plan its action is the whole acceleration.
            None => 0.0,
        };
        let all = Command {
            accel_mps2: plan_mps2 + wish.accel_mps2,
            ..wish
        };
        let decision_s = spec.clock.decision_s;
        let brakes = ado.meter.allows(&limit, all.accel_mps2, decision_s);
        brakes
            && self
                .cut_in(ado.agent, all, decision_s)
                .is_none_or(|state| limit.allows_cut_in(&state))
    }

    /// Returns the worst state of the ego if an agent crosses into its lane.
    ///
    /// `None` if it crosses no line in front of the ego during the decision.
    pub fn cut_in(&self, agent: usize, driven: Command, decision_s: f64) -> Option<CutInState> {
        let Command {
            accel_mps2,
            lateral_mps: left_mps,
        } = driven;
        let spec = self.world.spec();
        let ego = spec.egos().next()?;
        if left_mps == 0.0 || !spec.agents[agent].is_with_road() {
            return None;
        }
        let [own, seen] = [agent, ego].map(|i| {
            let state = self.bodies[i].state;
            (self.world.course().locate(&state.pose), state.speed_mps)
        });
        // The lane in which the ego is now. It may leave it before the crossing.
        let lane_m = spec.road.lane_middle_m(spec.road.lane_at(seen.0.lateral_m));
        let off_m = own.0.lateral_m - lane_m;
        let half_m = 0.5 * spec.road.lane_width_m();
        let after_m = off_m + left_mps * decision_s;
        // It begins beside the lane and ends inside, from either side.
        let crosses = half_m <= off_m.abs() && after_m * off_m.signum() < half_m;
        let gap_m = own.0.s_m - spec.agents[agent].body.length_m - seen.0.s_m;
        let is_behind = own.0.s_m < seen.0.s_m - spec.agents[ego].body.length_m;
        if !crosses || is_behind || gap_m > CUT_IN_GAP_M {
            return None;
        }
        // The crossing comes at the end of the decision at the latest.
        let now_mps = seen.1 - own.1;
        // An ado that accelerates only widens the gap, so the worst case
        // counts braking.
        let then_mps = now_mps - accel_mps2.min(0.0) * decision_s;
        Some(CutInState {
            // The gap may grow until then, and the smaller one is the worse.
            gap_m: gap_m.min(gap_m - then_mps * decision_s).max(0.0),
            closing_mps: then_mps,
            lateral_mps: left_mps,
        })
    }
}

/// Returns the products of the allowed actions of all sets, the first one fastest.
fn joint(sets: &[Vec<bool>]) -> Vec<bool> {
    sets.iter().fold(vec![true], |joint, set| {
        let times = |allowed: &bool| joint.iter().map(|it| *it && *allowed).collect::<Vec<_>>();
        set.iter().flat_map(times).collect()
    })
}

/// Returns the index of each ado among road users, `None` for lights and surroundings.
fn agents_of(spec: &DriveSpec) -> impl Iterator<Item = Option<usize>> {
    let agents = spec.agents.iter().enumerate();
    let ados = agents.filter(|(_, agent)| matches!(agent.drive, Drive::Ado { .. }));
    let users = ados.map(|(i, _)| Some(i));
    // Sets of lights and surroundings follow those of the road users.
    users.chain(std::iter::repeat(None))
}

impl Scene for LimitedScene {
    fn schema(&self) -> &Arc<Schema> {
        self.scene.schema()
    }

    fn spaces(&self) -> &Spaces {
        self.scene.spaces()
    }

    fn clock(&self) -> &Clock {
        self.scene.clock()
    }

    fn axes(&self) -> &[Axis] {
        self.scene.axes()
    }

    fn draw(&self, key: StartKey) -> Start {
        self.scene.draw(key)
    }

    fn reset(&mut self, start: &Start, noise: u64) {
        self.scene.reset(start, noise);
        // The road may be that of the start.
        if let Some(world) = self.scene.driven() {
            self.world = world;
        }
        self.read();
        let spec = self.world.spec();
        let agents = spec.agents.iter().enumerate().zip(&self.bodies);
        let ados = agents.filter_map(|((agent, it), body)| {
            let drives = matches!(it.drive, Drive::Ado { .. }) && !it.body.is_on_foot();
            drives.then(|| LimitedVehicle {
                agent,
                meter: VehicleMeter::new(body.state.speed_mps, spec.clock.sample_s),
                added_mps2: 0.0,
            })
        });
        self.ados = ados.collect();
    }

    fn allowed(&self) -> Option<Vec<bool>> {
        let spec = self.world.spec();
        let sets = spec
            .action_sets()
            .zip(agents_of(spec))
            .map(|((_, actions, neutral), agent)| match agent {
                Some(agent) => self.allowed_of(agent, actions, neutral),
                None => vec![true; actions.len()],
            });
        Some(joint(&sets.collect::<Vec<_>>()))
    }

    fn decide(&mut self, action: usize) {
        let spec = self.world.spec();
        let mut rest = action;
        // Digit by digit, in the order of `joint`.
        for ((_, actions, _), agent) in spec.action_sets().zip(agents_of(spec)) {
            let own = rest % actions.len();
            rest /= actions.len();
            let ado = self.ados.iter_mut().find(|ado| Some(ado.agent) == agent);
            if let (Some(ado), Actions::Deviate(added)) = (ado, actions) {
                ado.added_mps2 = added.at(own).0;
            }
        }
        self.scene.decide(action);
    }

    fn advance(&mut self) -> StepOutcome {
        let outcome = self.scene.advance();
        self.measure();
        outcome
    }

    fn advance_given(&mut self, given: &[Option<BodyState>]) -> Option<StepOutcome> {
        let outcome = self.scene.advance_given(given);
        // Motion that comes from outside is rated as well.
        self.measure();
        outcome
    }

    fn publish(&self, row: &mut [f64]) {
        self.scene.publish(row);
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        self.scene.observe(row, obs);
    }

    fn stage(&self) -> SceneGeometry {
        self.scene.stage()
    }

    fn frame(&self) -> Frame {
        self.scene.frame()
    }

    fn bodies(&self, into: &mut Vec<BodySample>) {
        self.scene.bodies(into);
    }

    fn driven(&self) -> Option<DriveWorld> {
        self.scene.driven()
    }

    fn rapier_steps(&self) -> u64 {
        self.scene.rapier_steps()
    }

    fn after_contact(&self, default_s: f64) -> Option<(AfterContact, Vec<Frame>)> {
        self.scene.after_contact(default_s)
    }

    fn finish(&mut self) {
        self.scene.finish();
    }

    fn commands(&self) -> &[Command] {
        self.scene.commands()
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(LimitedScene {
            scene: self.scene.fork()?,
            limit: self.limit.clone(),
            world: self.world.clone(),
            ados: self.ados.clone(),
            bodies: self.bodies.clone(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_actions_count_the_first_ado_fastest() {
        let sets = [vec![true, false, true], vec![false, true]];
        assert_eq!(joint(&sets), [false, false, false, true, false, true]);
        assert_eq!(joint(&[]), [true]);
    }
}
