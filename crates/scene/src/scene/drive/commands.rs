//! Commands of a sample: from every decision maker to its body.

use std::sync::Arc;

use nalgebra::Vector2;

use super::actions::Maneuver;
use super::ego_percept;
use super::motion::DriveScene;
use super::names::SignalOwner;
use super::spec::Drive;
use super::state::SceneState;
use super::steering::{CourseAhead, LaneKeeper};
use crate::ego::{Actuator, Command, Fault};
use crate::sim::{BodyCommand, BodyState, rotation_by};

impl SceneState {
    /// Returns what an agent wants to do, `None` if a plan carries it.
    ///
    /// `ego` is the ego's command, and `chosen` the action of an ado.
    #[inline]
    pub fn wish_of(&self, i: usize, ego: Maneuver, chosen: Maneuver) -> Option<Maneuver> {
        let agent = &self.spec.agents[i];
        Some(match &agent.drive {
            // `carry_all` has already commanded the planned bodies.
            Drive::Planned(_) | Drive::Ado { base: Some(_), .. } => return None,
            Drive::Ego => ego,
            Drive::Ado { .. } | Drive::Trained(_) => chosen,
            Drive::Scripted(script) => {
                if agent.body.is_on_foot() {
                    let (along_mps, left_mps) = script.walk_mps(self.time_s());
                    Maneuver::Walk {
                        along_mps,
                        left_mps,
                    }
                } else {
                    let speed_mps = self.states[i].speed_mps;
                    let leader = || self.leader_of(i);
                    Maneuver::Drive {
                        accel_mps2: script.accel_mps2(self.time_s(), speed_mps, leader),
                        lateral_mps: 0.0,
                    }
                }
            }
        })
    }

    /// Returns the acceleration and the curvature that a vehicle is commanded.
    ///
    /// `actuator` and `keeper` are those of the vehicle, which obey its `wish`.
    #[inline]
    pub fn driven(
        &self,
        agent: usize,
        actuator: &mut Actuator,
        keeper: &mut LaneKeeper,
        wish: Command,
    ) -> (f64, f64) {
        let (state, at) = (&self.states[agent], self.on_road[agent]);
        let sample_s = self.spec.clock.sample_s;
        let own = &self.spec.agents[agent];
        let ahead = CourseAhead {
            course: self.network.course_of(agent),
            direction: own.direction,
        };
        let way_m = state.speed_mps * sample_s;
        let driven = own
            .lane_keeping
            .seen(&own.body, &state.pose, at, ahead, way_m);
        (
            actuator.step(wish.accel_mps2),
            keeper.curvature(&driven, state.speed_mps, wish.lateral_mps, sample_s),
        )
    }
}

impl DriveScene {
    /// Sets the actions that the trained ados decide at this sample.
    pub(super) fn decide_trained(&mut self) {
        // Most worlds have none, and this runs at every sample.
        if self.layout.frozen.is_empty() {
            return;
        }
        let layout = Arc::clone(&self.layout);
        for (ado, frozen) in layout.frozen.iter().enumerate() {
            let Some(action) = frozen.act(&self.state, ado, self.noise) else {
                continue;
            };
            // Its policy is read in any case, so that a turn changes no random draw.
            let effective = if self.turn.is_of(ado) {
                action
            } else {
                frozen.neutral
            };
            match (frozen.who, frozen.actions.choice(effective)) {
                (SignalOwner::Light(i), Maneuver::Turn(turn)) => self.state.turn(i, turn),
                (SignalOwner::Agent(i), choice) => {
                    self.chosen[i] = choice;
                    self.state.note_action(i, effective);
                }
                // Invariant: a light's ado has a light's actions.
                (SignalOwner::Light(_), _) => {}
            }
        }
    }

    pub(super) fn command_all(&mut self) -> Result<(), Fault> {
        // All commands derive from the state before the sample. The plant moves
        // only after every agent has decided, so the file order has no effect.
        ego_percept::fill(&mut self.percept, &self.state, self.layout.ego);
        let noise_scale = self
            .state
            .weather
            .map_or(1.0, |weather| weather.noise_scale);
        self.sensing.look(&mut self.percept, noise_scale);
        let command = self.controller.control(&self.percept)?;
        // A NaN command would otherwise reach the physics and be reported as
        // its fault.
        if !command.is_plausible()
            && let Some(fault) = command.flaw()
        {
            let message = format!("{} at {:.3} s", fault.message, self.state.time_s());
            return Err(Fault { message, ..fault });
        }
        // Only the commands of a foreign ego cannot be computed again.
        if self.layout.spec.ego.is_foreign() {
            self.commands.push(command);
        }
        let commanded = Maneuver::Drive {
            accel_mps2: command.accel_mps2,
            lateral_mps: command.lateral_mps,
        };
        self.carry_all();
        for i in 0..self.layout.spec.agents.len() {
            if let Some(wish) = self.state.wish_of(i, commanded, self.chosen[i]) {
                self.command(i, wish);
            }
        }
        Ok(())
    }

    /// Sets the commands of all agents, of which another simulator moves some.
    ///
    /// Those are carried to their given states. An ego without one coasts.
    pub(super) fn command_around(&mut self, given: &[Option<BodyState>]) {
        self.carry_all();
        for i in 0..self.layout.spec.agents.len() {
            if let Some(state) = given.get(i).copied().flatten() {
                let command = BodyCommand::Carry { to: state.pose };
                self.commanded[i] = Some(command);
                self.state.plant.command(self.state.bodies[i], command);
            } else if let Some(wish) = self.state.wish_of(i, Maneuver::NONE, self.chosen[i]) {
                self.command(i, wish);
            }
        }
    }

    fn command(&mut self, agent: usize, wish: Maneuver) {
        let (state, at) = (&self.state.states[agent], self.state.on_road[agent]);
        let command = match wish {
            Maneuver::Drive {
                accel_mps2,
                lateral_mps,
            } => {
                let wish = Command {
                    accel_mps2,
                    lateral_mps,
                };
                let (actuator, keeper) = (&mut self.actuators[agent], &mut self.keepers[agent]);
                let (accel_mps2, curvature_per_m) =
                    self.state.driven(agent, actuator, keeper, wish);
                BodyCommand::Drive {
                    accel_mps2,
                    curvature_per_m,
                }
            }
            Maneuver::Walk {
                along_mps,
                left_mps,
            } => {
                // Walks are given along the road: the body's heading minus its
                // angle to the road is the road's direction.
                let road_rad = state.pose.heading_rad - at.heading_rad;
                let velocity_mps = rotation_by(road_rad) * Vector2::new(along_mps, left_mps);
                BodyCommand::Walk {
                    x_mps: velocity_mps.x,
                    y_mps: velocity_mps.y,
                }
            }
            // Invariant: lights, weather and road have no body.
            Maneuver::Turn(_) | Maneuver::Change(_) | Maneuver::Bend { .. } => return,
        };
        self.commanded[agent] = Some(command);
        let body = self.state.bodies[agent];
        self.state.plant.command(body, command);
    }
}
