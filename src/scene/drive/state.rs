//! What of a driving scene moves, and what signals and percepts read off it.
//!
//! Architecture Invariant: nobody's mind is in here. Signals, percepts and
//! trained ados read it; only the scene that holds it moves it.

use std::sync::Arc;

use super::actions::Turn;
use super::course::OnRoad;
use super::light::Shown;
use super::network::RoadNetwork;
use super::placed::Direction;
use super::planned::PlannedAt;
use super::spec::{Agent, DriveSpec};
use crate::ego::Room;
use crate::sim::{self, Body, BodyId, BodyState, Contact, Ground, Plant, Pose};

/// A driving scene at one sample.
pub(super) struct SceneState {
    pub spec: Arc<DriveSpec>,
    pub network: Arc<RoadNetwork>,
    pub plant: Box<dyn Plant>,
    /// The agents' bodies in the plant, in file order.
    pub bodies: Vec<BodyId>,
    /// What each body does, as of this sample.
    pub states: Vec<BodyState>,
    /// Where on its road each agent is.
    pub on_road: Vec<OnRoad>,
    pub lights: Vec<Shown>,
    /// Where its plan has each agent; empty where nobody has one.
    pub planned: Vec<PlannedAt>,
    /// The numbers of the start, in file order.
    pub parameters: Vec<f64>,
    /// The contact during the last sample.
    pub touch: Option<Contact>,
    /// Samples since the start.
    pub sample: usize,
}

impl SceneState {
    /// An empty road.
    pub fn new(spec: Arc<DriveSpec>, network: Arc<RoadNetwork>) -> SceneState {
        let agents = spec.agents.len();
        SceneState {
            plant: sim::plant(spec.plant, ground(&spec)),
            bodies: Vec::with_capacity(agents),
            states: Vec::with_capacity(agents),
            on_road: Vec::with_capacity(agents),
            lights: Vec::with_capacity(spec.lights.len()),
            planned: Vec::new(),
            parameters: Vec::new(),
            touch: None,
            sample: 0,
            network,
            spec,
        }
    }

    /// Back to t = 0: nobody is there yet, the lights show their first phase.
    pub fn clear(&mut self) {
        self.plant.clear(ground(&self.spec));
        self.bodies.clear();
        self.lights.clear();
        self.lights
            .extend(self.spec.lights.iter().map(Shown::first));
        self.touch = None;
        self.sample = 0;
    }

    /// Puts the next agent's body on the road.
    pub fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) {
        self.bodies.push(self.plant.spawn(body, pose, speed_mps));
    }

    /// Moves the bodies on by one sample, and the scheduled lights with them.
    pub fn advance(&mut self) {
        let clock = self.spec.clock;
        self.touch = self.plant.advance(clock.sample_s, clock.substeps);
        self.sample += 1;
        self.read();
        let time_s = self.time_s();
        for (shown, light) in self.lights.iter_mut().zip(&self.spec.lights) {
            shown.keep_time(light, time_s, self.sample);
        }
    }

    /// A light does what an ado chose.
    pub fn turn(&mut self, light: usize, turn: Turn) {
        self.lights[light].turn(turn, self.sample);
    }

    /// Reads where everybody is off the plant.
    pub fn read(&mut self) {
        self.states.clear();
        self.on_road.clear();
        for (agent, &body) in self.bodies.iter().enumerate() {
            let state = self.plant.state(body);
            self.on_road.push(self.network.locate(agent, &state.pose));
            self.states.push(state);
        }
    }

    /// A copy that continues bit for bit.
    pub fn fork(&self) -> SceneState {
        SceneState {
            spec: Arc::clone(&self.spec),
            network: Arc::clone(&self.network),
            plant: self.plant.fork(),
            bodies: self.bodies.clone(),
            states: self.states.clone(),
            on_road: self.on_road.clone(),
            lights: self.lights.clone(),
            planned: self.planned.clone(),
            parameters: self.parameters.clone(),
            touch: self.touch,
            sample: self.sample,
        }
    }

    /// Where its plan has an agent.
    pub fn planned_of(&self, agent: usize) -> PlannedAt {
        self.planned.get(agent).copied().unwrap_or_default()
    }

    /// Time since the start.
    pub fn time_s(&self) -> f64 {
        self.sample as f64 * self.spec.clock.sample_s
    }

    /// For how long a light has been in its phase.
    pub fn phase_s(&self, light: usize) -> f64 {
        (self.sample - self.lights[light].since) as f64 * self.spec.clock.sample_s
    }

    /// From an agent's front to a stop line along the world's own road; positive
    /// before it.
    pub fn line_m(&self, agent: usize, light: usize) -> f64 {
        let at = match self.spec.agents[agent].road {
            0 => self.on_road[agent],
            _ => self.network.main().locate(&self.states[agent].pose),
        };
        self.spec.lights[light].line_m - at.s_m
    }

    /// Where on the road of `viewer` an agent is.
    pub fn on_road_of(&self, viewer: usize, agent: usize) -> OnRoad {
        match self.network.share_road(viewer, agent) {
            true => self.on_road[agent],
            false => self.network.locate(viewer, &self.states[agent].pose),
        }
    }

    /// Velocity of an agent along and across its road.
    pub fn velocity_mps(&self, agent: usize) -> (f64, f64) {
        self.velocity_along(agent, &self.on_road[agent])
    }

    /// Velocity of an agent along and across the road on which it is `at`.
    pub fn velocity_along(&self, agent: usize, at: &OnRoad) -> (f64, f64) {
        let state = &self.states[agent];
        let (sin, cos) = libm::sincos(at.heading_rad);
        (
            state.speed_mps * cos - state.lateral_mps * sin,
            state.speed_mps * sin + state.lateral_mps * cos,
        )
    }

    /// Clearance to and speed of the next one ahead in an agent's path.
    ///
    /// Where all go along the world's own road that is one whose front is ahead;
    /// else whatever the path of the agent leads to, whichever way it faces.
    pub fn leader_of(&self, agent: usize) -> Option<(f64, f64)> {
        let agents = &self.spec.agents;
        if !agents.iter().all(Agent::is_with_road) {
            return self.nearest_ahead(agent);
        }
        let own = &self.on_road[agent];
        let ahead = (0..agents.len()).filter_map(|i| {
            let other = &self.on_road[i];
            let headway_m = other.s_m - own.s_m;
            let half_m = 0.5 * (agents[i].body.width_m + agents[agent].body.width_m);
            let beside = half_m <= (other.lateral_m - own.lateral_m).abs();
            (0.0 < headway_m && !beside).then_some((i, headway_m))
        });
        let nearest = ahead.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(i, headway_m)| {
            let clearance_m = headway_m - agents[i].body.length_m;
            (clearance_m, self.velocity_mps(i).0)
        })
    }
}

impl SceneState {
    /// Where somebody on a road is to who drives there.
    fn as_driven(&self, driver: usize, at: OnRoad) -> OnRoad {
        match self.spec.agents[driver].direction {
            Direction::With => at,
            Direction::Against => at.reversed(),
        }
    }

    /// What a body takes up of the road of `driver`, from the middle of the
    /// driver's front and as it drives, and how fast it moves away along it.
    fn room_before(&self, driver: usize, agent: usize) -> (Room, f64) {
        let own = self.as_driven(driver, self.on_road[driver]);
        let at = self.as_driven(driver, self.on_road_of(driver, agent));
        let body = &self.spec.agents[agent].body;
        let front_m = (at.s_m - own.s_m, at.lateral_m - own.lateral_m);
        let room = Room::of(front_m, at.heading_rad, (body.length_m, body.width_m));
        (room, self.velocity_along(agent, &at).0)
    }

    fn nearest_ahead(&self, agent: usize) -> Option<(f64, f64)> {
        let agents = &self.spec.agents;
        let half_m = 0.5 * agents[agent].body.width_m;
        let others = (0..agents.len()).filter(|&i| i != agent);
        let rooms = others.map(|i| self.room_before(agent, i));
        let ahead = rooms.filter(|(room, _)| 0.0 < room.far_m && room.is_within(half_m));
        let ahead = ahead.map(|(room, away_mps)| (room.near_m, away_mps));
        ahead.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Clearance of two bodies along the road of the first, 0 if neither is
    /// behind the other, and how fast it shrinks.
    pub fn closing_along(&self, [a, b]: [usize; 2]) -> (f64, f64) {
        let ((of_a, a_mps), (of_b, b_mps)) = (self.room_before(a, a), self.room_before(a, b));
        let is_ahead = of_a.near_m + of_a.far_m < of_b.near_m + of_b.far_m;
        match is_ahead {
            true => ((of_b.near_m - of_a.far_m).max(0.0), a_mps - b_mps),
            false => ((of_a.near_m - of_b.far_m).max(0.0), b_mps - a_mps),
        }
    }

    /// From an agent's front to where the way of another crosses its own: the
    /// next of these places that it has not left behind, else the last one.
    pub fn conflict_m(&self, [a, b]: [usize; 2]) -> Option<f64> {
        let own_m = self.as_driven(a, self.on_road[a]).s_m;
        let sign = match self.spec.agents[a].direction {
            Direction::With => 1.0,
            Direction::Against => -1.0,
        };
        let crossings = self.network.crossings(a, b);
        let mut ways = crossings.iter().map(|it| sign * it.s_m - own_m);
        let length_m = self.spec.agents[a].body.length_m;
        let next_m = ways.clone().find(|way_m| -length_m <= *way_m);
        next_m.or_else(|| ways.next_back())
    }
}

fn ground(spec: &DriveSpec) -> Ground {
    Ground {
        friction: spec.road.friction(),
    }
}
