//! Recorded motions, replayed with a different driver in the ego's place.
//!
//! All agents but the ego move as recorded and react to nothing. Replays use
//! the kinematic plant, whose contacts are exact. Motions recorded on that
//! plant are repeated by their commands, bit for bit. Other motions are
//! repeated by their poses, which are joined by straight lines.

use std::sync::Arc;

use nalgebra::{UnitComplex, Vector2};

use super::layout::DriveLayout;
use super::line_of_sight;
use super::motion::DriveScene;
use super::spec::EgoController;
use super::world::DriveWorld;
use crate::ego::reference::LaneBody;
use crate::road::{Course, OnRoad, Road};
use crate::scene::{BodySample, Motion, Scene, StepOutcome};
use crate::sim::{Body, BodyCommand, BodyState, PlantKind, rotation_by};

impl DriveWorld {
    /// Returns the same world on the kinematic plant, without an ego controller.
    pub fn for_replay(&self) -> DriveWorld {
        let mut layout = DriveLayout::clone(&self.0);
        Arc::make_mut(&mut layout.spec).plant = PlantKind::Kinematic;
        // A replay commands the ego itself, so no program of an ego starts.
        Arc::make_mut(&mut layout.spec).ego.controller = EgoController::Recorded(Arc::from([]));
        DriveWorld(Arc::new(layout))
    }

    /// Returns the position of the ego among the agents.
    pub fn ego(&self) -> usize {
        self.0.ego
    }

    /// Returns the place and motion of an agent's body along the road.
    pub fn lane_body(&self, agent: usize, state: &BodyState) -> LaneBody {
        let at = self.0.network.main().locate(&state.pose);
        in_lane(state, &at, &self.0.spec.agents[agent].body)
    }

    /// Returns which agents the ego sees at a sample of a motion.
    ///
    /// Agents are hidden by the range of the sensors, and in a world with a line of
    /// sight by vehicles. Ignores delay and noise of the sensors, crests and weather.
    pub fn seen(&self, sample: &[BodySample]) -> Vec<bool> {
        let states: Vec<BodyState> = sample.iter().map(|body| body.state).collect();
        line_of_sight::recorded(&self.0.spec, &states, self.0.ego)
    }

    /// Returns whether a replay has all of some signals, by their positions in a row.
    ///
    /// A motion holds neither plans nor actions, so replays keep those of the start.
    pub fn repeats(&self, signals: &[usize]) -> bool {
        let sources = &self.0.sources;
        signals.iter().all(|&signal| match sources.get(signal) {
            Some(source) => !source.is_decided(),
            None => self.repeats(&self.0.derived[signal - sources.len()].signals()),
        })
    }

    /// Returns a motion with commands that repeat it, continued to `samples`.
    ///
    /// After the record, every agent moves sideways to the middle of the next
    /// lane and straight on from there. An agent that braked keeps its
    /// deceleration until it stands. The remaining agents keep their speed.
    pub fn continued(&self, motion: &Motion, samples: usize) -> Motion {
        let spec = &self.0.spec;
        let mut whole = motion.clone();
        let Some(last) = motion.len().checked_sub(1) else {
            return whole;
        };
        // The rigid plant's commands would lead elsewhere on the kinematic one.
        let is_exact = spec.plant == PlantKind::Kinematic;
        let by_commands =
            |body: &BodySample| is_exact && matches!(body.command, Some(BodyCommand::Drive { .. }));
        for sample in 1..=last {
            for body in whole.at_mut(sample) {
                // A jump sweeps no ground, as in the recorded episode.
                if !by_commands(body) && !matches!(body.command, Some(BodyCommand::Jump { .. })) {
                    body.command = Some(BodyCommand::Glide {
                        to: body.state.pose,
                    });
                }
            }
        }
        let ends: Vec<Onward> = motion
            .at(last)
            .iter()
            .enumerate()
            .map(|(agent, body)| {
                let on_foot = spec.agents[agent].body.is_on_foot();
                let course = self.0.network.course_of(agent);
                Onward::new(&body.state, course, spec.road_of(agent), on_foot)
            })
            .collect();
        let mut row = motion.at(last).to_vec();
        for sample in last..samples {
            // A contact ends the record within a sample, whose remainder is
            // continued too.
            let after_s = sample as f64 * spec.clock.sample_s - motion.end_s;
            if after_s <= 0.0 {
                continue;
            }
            for (agent, (body, end)) in row.iter_mut().zip(&ends).enumerate() {
                let state = end.state(after_s, self.0.network.course_of(agent));
                let recorded = &motion.at(last)[agent];
                // The last recorded sample ends early at a contact. Repeating
                // its command still gives the body's exact motion over the
                // whole sample.
                let command = if sample == last && by_commands(recorded) {
                    recorded.command
                } else {
                    Some(BodyCommand::Glide { to: state.pose })
                };
                *body = BodySample { state, command };
            }
            if sample == last {
                whole.at_mut(last).copy_from_slice(&row)
            } else {
                whole.push(&row)
            }
        }
        whole
    }
}

/// Continuation of a body after the end of its record.
struct Onward {
    at: OnRoad,
    /// Speeds along the road and to the left.
    along_mps: f64,
    across_mps: f64,
    /// Deceleration until it stands, at least 0.
    brake_mps2: f64,
    /// Times at which it stops and at which it reaches the middle of a lane.
    stands_s: f64,
    centred_s: f64,
}

impl Onward {
    fn new(state: &BodyState, course: &Course, road: &Road, on_foot: bool) -> Onward {
        let at = course.locate(&state.pose);
        let [along_mps, across_mps] = at.velocity_mps(state.speed_mps, state.lateral_mps).into();
        let brake_mps2 = (-state.accel_mps2).max(0.0);
        let stands_s = if brake_mps2 == 0.0 {
            f64::INFINITY
        } else {
            along_mps.abs() / brake_mps2
        };
        let lanes = at.lateral_m / road.lane_width_m();
        // A body that moves sideways goes on to the middle of the next lane.
        let next = if across_mps < 0.0 {
            libm::floor(lanes)
        } else {
            libm::ceil(lanes)
        };
        let way_m = (next - lanes) * road.lane_width_m();
        Onward {
            at,
            along_mps,
            across_mps,
            brake_mps2,
            stands_s,
            // People on foot keep to no lane, so they seek no middle of one.
            centred_s: if on_foot || across_mps == 0.0 {
                f64::INFINITY
            } else {
                way_m / across_mps
            },
        }
    }

    fn state(&self, after_s: f64, course: &Course) -> BodyState {
        let braking_s = after_s.min(self.stands_s);
        let direction = if self.along_mps < 0.0 { -1.0 } else { 1.0 };
        let lost_mps = self.brake_mps2 * braking_s;
        let sideways_s = braking_s.min(self.centred_s);
        // A body that moves against the road brakes towards positive s.
        let s_m = self.at.s_m + (self.along_mps - direction * 0.5 * lost_mps) * braking_s;
        let lateral_m = self.at.lateral_m + self.across_mps * sideways_s;
        let is_centred = self.centred_s <= after_s;
        let mut pose = course.pose(s_m, lateral_m);
        // In the middle of its lane a body points along the road, forwards or
        // backwards.
        pose.heading_rad += match (is_centred, direction < 0.0) {
            (false, _) => self.at.heading_rad,
            (true, false) => 0.0,
            (true, true) => core::f64::consts::PI,
        };
        let moves = after_s < self.stands_s;
        let heading = if is_centred {
            UnitComplex::from_cos_sin_unchecked(direction, 0.0)
        } else {
            rotation_by(self.at.heading_rad)
        };
        let along_mps = self.along_mps - direction * lost_mps;
        let across_mps = if moves && !is_centred {
            self.across_mps
        } else {
            0.0
        };
        let velocity_mps = heading.inverse() * Vector2::new(along_mps, across_mps);
        BodyState {
            pose,
            speed_mps: velocity_mps.x,
            lateral_mps: velocity_mps.y,
            yaw_rate_rad_per_s: 0.0,
            accel_mps2: if moves { -self.brake_mps2 } else { 0.0 },
        }
    }
}

/// Returns a body in lane coordinates of its middle, as reference drivers need it.
fn in_lane(state: &BodyState, at: &OnRoad, body: &Body) -> LaneBody {
    let heading = rotation_by(at.heading_rad);
    let lever_mps = state.yaw_rate_rad_per_s * body.half_length_m();
    // Turning moves the front sideways, and not the middle.
    let velocity_mps = heading * Vector2::new(state.speed_mps, state.lateral_mps - lever_mps);
    let front_m = Vector2::new(at.s_m, at.lateral_m);
    LaneBody {
        accel_mps2: state.accel_mps2 * heading.re,
        ..LaneBody::behind_front(front_m, velocity_mps, heading, body.length_m, body.width_m)
    }
}

impl DriveScene {
    /// Sets all agents to their states at a sample of a motion.
    ///
    /// At the first sample this is the start of the episode, bit for bit.
    pub fn take_up(&mut self, motion: &Motion, sample: usize) {
        self.reset(&motion.start, 0);
        let recorded = motion.at(sample).iter().map(|body| &body.state);
        // `reset` has already produced this state, and spawning at located
        // coordinates could round differently.
        if self.state.states.iter().eq(recorded) {
            return;
        }
        let layout = Arc::clone(&self.layout);
        self.clear();
        let agents = layout.spec.agents.iter().enumerate();
        for ((i, agent), body) in agents.zip(motion.at(sample)) {
            let lateral_m = layout.network.locate(i, &body.state.pose).lateral_m;
            self.spawn_at(agent, body.state.pose, lateral_m, body.state.speed_mps);
        }
        self.state.sample = sample;
        self.state.read();
        // A fresh body in the plant has neither acceleration nor yaw rate, so
        // the recorded states replace those that were read.
        let recorded = motion.at(sample).iter().map(|body| body.state);
        self.state.states.clear();
        self.state.states.extend(recorded);
    }

    /// Advances by one sample with a given command of the ego.
    ///
    /// All other agents move as in `next`, a sample of a
    /// [continued](DriveWorld::continued) motion.
    pub fn advance_along(&mut self, ego: BodyCommand, next: &[BodySample]) -> StepOutcome {
        for (agent, body) in next.iter().enumerate() {
            let command = if agent == self.layout.ego {
                Some(ego)
            } else {
                body.command
            };
            if let Some(command) = command {
                self.state.plant.command(self.state.bodies[agent], command);
            }
        }
        let flow = self.move_on();
        // For gliding bodies a plant only knows the mean velocity over the sample.
        // The ego does not glide, whatever the record holds for its driver.
        let own = self.layout.ego;
        let carried = self.state.states.iter_mut().zip(next).enumerate();
        for (_, (state, body)) in carried.filter(|(agent, _)| *agent != own) {
            if let Some(BodyCommand::Glide { .. } | BodyCommand::Jump { .. }) = body.command {
                let pose = state.pose;
                *state = BodyState { pose, ..body.state };
            }
        }
        flow
    }

    /// Returns the command that accelerates the ego and keeps it in its lane.
    pub fn keep_lane(&mut self, accel_mps2: f64) -> BodyCommand {
        let ego = self.layout.ego;
        let (at, speed_mps) = (self.state.on_road[ego], self.state.states[ego].speed_mps);
        let sample_s = self.layout.spec.clock.sample_s;
        BodyCommand::Drive {
            accel_mps2,
            curvature_per_m: self.keepers[ego].curvature(&at, speed_mps, 0.0, sample_s),
        }
    }

    /// Returns an agent in lane coordinates.
    pub fn lane_body(&self, agent: usize) -> LaneBody {
        let body = &self.layout.spec.agents[agent].body;
        let at = self.state.on_road_of(self.layout.ego, agent);
        in_lane(&self.state.states[agent], &at, body)
    }

    /// Returns which agents the ego sees now. See [`DriveWorld::seen`].
    pub fn seen(&self) -> Vec<bool> {
        let seen = line_of_sight::perceived(&self.state, self.layout.ego);
        seen.unwrap_or_else(|| vec![true; self.layout.spec.agents.len()])
    }

    /// Returns the world's own road, as the start has it.
    pub fn road(&self) -> &Road {
        &self.layout.spec.road
    }

    /// Returns the curvature of the road beside the ego, positive to the left.
    pub fn curvature_per_m(&self) -> f64 {
        self.state.on_road[self.layout.ego].curvature_per_m
    }

    /// Returns the clearance between the ego and an agent, 0 at a contact.
    pub fn gap_m(&self, agent: usize) -> f64 {
        let ego = self.state.bodies[self.layout.ego];
        self.state.plant.gap_m(ego, self.state.bodies[agent])
    }
}
