//! What of a driving scene moves, and what signals and percepts read off it.
//!
//! Architecture Invariant: nobody's mind is in here. Signals, percepts and
//! trained ados read it; only the scene that holds it moves it.

use std::sync::Arc;

use super::actions::Turn;
use super::course::{Course, OnRoad};
use super::light::Shown;
use super::spec::DriveSpec;
use crate::sim::{self, Body, BodyId, BodyState, Contact, Ground, Plant, Pose};

/// A driving scene at one sample.
pub(super) struct SceneState {
    pub spec: Arc<DriveSpec>,
    pub plant: Box<dyn Plant>,
    /// The agents' bodies in the plant, in file order.
    pub bodies: Vec<BodyId>,
    /// What each body does, as of this sample.
    pub states: Vec<BodyState>,
    /// Where on the road each agent is.
    pub on_road: Vec<OnRoad>,
    pub lights: Vec<Shown>,
    /// The contact during the last sample.
    pub touch: Option<Contact>,
    /// Samples since the start.
    pub sample: usize,
}

impl SceneState {
    /// An empty road.
    pub fn new(spec: Arc<DriveSpec>) -> SceneState {
        let agents = spec.agents.len();
        SceneState {
            plant: sim::plant(spec.plant, ground(&spec)),
            bodies: Vec::with_capacity(agents),
            states: Vec::with_capacity(agents),
            on_road: Vec::with_capacity(agents),
            lights: Vec::with_capacity(spec.lights.len()),
            touch: None,
            sample: 0,
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
    pub fn advance(&mut self, course: &Course) {
        let clock = self.spec.clock;
        self.touch = self.plant.advance(clock.sample_s, clock.substeps);
        self.sample += 1;
        self.read(course);
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
    pub fn read(&mut self, course: &Course) {
        self.states.clear();
        self.on_road.clear();
        for &body in &self.bodies {
            let state = self.plant.state(body);
            self.on_road.push(course.locate(&state.pose));
            self.states.push(state);
        }
    }

    /// A copy that continues bit for bit.
    pub fn fork(&self) -> SceneState {
        SceneState {
            spec: Arc::clone(&self.spec),
            plant: self.plant.fork(),
            bodies: self.bodies.clone(),
            states: self.states.clone(),
            on_road: self.on_road.clone(),
            lights: self.lights.clone(),
            touch: self.touch,
            sample: self.sample,
        }
    }

    /// Time since the start.
    pub fn time_s(&self) -> f64 {
        self.sample as f64 * self.spec.clock.sample_s
    }

    /// For how long a light has been in its phase.
    pub fn phase_s(&self, light: usize) -> f64 {
        (self.sample - self.lights[light].since) as f64 * self.spec.clock.sample_s
    }

    /// From an agent's front to a stop line along the road; positive before it.
    pub fn line_m(&self, agent: usize, light: usize) -> f64 {
        self.spec.lights[light].line_m - self.on_road[agent].s_m
    }

    /// Velocity of an agent along and across the road.
    pub fn velocity_mps(&self, agent: usize) -> (f64, f64) {
        let (state, at) = (&self.states[agent], &self.on_road[agent]);
        let (sin, cos) = libm::sincos(at.heading_rad);
        (
            state.speed_mps * cos - state.lateral_mps * sin,
            state.speed_mps * sin + state.lateral_mps * cos,
        )
    }

    /// Clearance to and speed of the next one ahead in an agent's path.
    pub fn leader_of(&self, agent: usize) -> Option<(f64, f64)> {
        let agents = &self.spec.agents;
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

fn ground(spec: &DriveSpec) -> Ground {
    Ground {
        friction: spec.road.friction(),
    }
}
