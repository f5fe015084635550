//! The moving part of a driving scene, read by signals and percepts.
//!
//! Architecture Invariant: it holds no state of any decision maker. Signals,
//! percepts and trained ados read it. Only the scene that holds it changes it.

use std::sync::Arc;

use nalgebra::Vector2;

use super::actions::PhaseAction;
use super::light::LightState;
use super::plan_execution::PlannedAt;
use super::spec::{Agent, DriveSpec};
use super::surface::surface_of;
use super::weather::WeatherState;
use super::weather_rates::WeatherRates;
use crate::ego::{LaneOccupancy, Phase};
use crate::road::{Direction, OnRoad, RoadNetwork, slope_direction};
use crate::sim::{
    self, Body, BodyId, BodyState, Contact, GRAVITY_MPS2, Ground, GroundSurface, Plant, Pose, Push,
};

/// State of a driving scene at a sample.
pub struct SceneState {
    pub(crate) spec: Arc<DriveSpec>,
    /// Roads at the start of the episode.
    pub network: Arc<RoadNetwork>,
    pub(crate) plant: Box<dyn Plant>,
    /// Surface of the roads, on the rigid plant if they have slopes.
    surface: Option<GroundSurface>,
    /// The agents' bodies in the plant, in file order.
    pub bodies: Vec<BodyId>,
    /// State of each body at this sample.
    pub states: Vec<BodyState>,
    /// Road coordinates of each agent.
    pub on_road: Vec<OnRoad>,
    pub(super) lights: Vec<LightState>,
    /// Weather of this sample, if an ado changes it.
    pub(super) weather: Option<WeatherState>,
    /// Friction that a story has set.
    friction: Option<f64>,
    /// Curvature of the next piece of road, if an ado lays it.
    pub next_curvature_per_m: f64,
    /// Action before the last one, and the last one, of each agent that is an ado.
    pub(super) actions: Vec<[usize; 2]>,
    /// Planned state of each agent. Empty if no agent has a plan.
    pub(super) planned: Vec<PlannedAt>,
    /// Parameters of the start, in file order.
    pub parameters: Vec<f64>,
    /// The contact during the last sample.
    pub touch: Option<Contact>,
    /// Samples since the start.
    pub sample: usize,
}

impl SceneState {
    /// Returns an empty road.
    pub fn new(spec: Arc<DriveSpec>, network: Arc<RoadNetwork>) -> SceneState {
        let agents = spec.agents.len();
        SceneState {
            surface: surface_of(&spec, &network),
            plant: sim::plant(spec.plant, ground(&spec)),
            bodies: Vec::with_capacity(agents),
            states: Vec::with_capacity(agents),
            on_road: Vec::with_capacity(agents),
            lights: Vec::with_capacity(spec.lights.len()),
            weather: None,
            friction: None,
            next_curvature_per_m: 0.0,
            actions: vec![[0; 2]; agents],
            planned: Vec::new(),
            parameters: Vec::new(),
            touch: None,
            sample: 0,
            network,
            spec,
        }
    }

    /// Changes the spec and its roads.
    pub(super) fn change_roads(&mut self, spec: &Arc<DriveSpec>, network: &Arc<RoadNetwork>) {
        self.spec = Arc::clone(spec);
        self.network = Arc::clone(network);
        let surface = surface_of(spec, network);
        // A plane that stays a plane needs no new ground.
        if surface.is_some() || self.surface.is_some() {
            self.plant.lay(surface.as_ref());
        }
        self.surface = surface;
    }

    /// Returns to t = 0 without agents, with the first phases and the first weather.
    pub(super) fn clear(&mut self) {
        self.plant.clear(ground(&self.spec));
        // `Plant::clear` leaves a plane, so the surface is laid again.
        if self.surface.is_some() {
            self.plant.lay(self.surface.as_ref());
        }
        self.bodies.clear();
        self.lights.clear();
        self.lights
            .extend(self.spec.lights.iter().map(LightState::first));
        let weather = self.spec.weather.as_ref();
        self.weather = weather.map(|it| WeatherState::first(it, self.spec.road.friction()));
        // A story sets the friction anew in each episode.
        self.friction = None;
        self.next_curvature_per_m = 0.0;
        self.touch = None;
        self.sample = 0;
        // An ado begins as if it had taken its action without effect.
        let agents = self.spec.agents.iter();
        self.actions.clear();
        self.actions
            .extend(agents.map(|agent| [agent.neutral(); 2]));
    }

    /// Notes the action of a decision.
    pub(super) fn note_action(&mut self, agent: usize, action: usize) {
        let [_, last] = self.actions[agent];
        self.actions[agent] = [last, action];
    }

    /// Returns the ground at this sample.
    pub(super) fn ground(&self) -> Ground {
        match self.weather {
            Some(WeatherState { friction, .. }) => Ground { friction },
            None => Ground {
                friction: self.friction.unwrap_or(self.spec.road.friction()),
            },
        }
    }

    /// Sets the friction of the road from now on. Weather changes it from there.
    pub(super) fn set_friction(&mut self, friction: f64) {
        match &mut self.weather {
            Some(weather) => weather.friction = friction,
            None => self.friction = Some(friction),
        }
        self.plant.set_ground(Ground { friction });
    }

    /// Spawns the body of the next agent.
    pub fn spawn(&mut self, body: &Body, pose: Pose, speed_mps: f64) {
        self.bodies.push(self.plant.spawn(body, pose, speed_mps));
    }

    /// Advances the bodies and the scheduled lights by one sample.
    pub(super) fn advance(&mut self) {
        let clock = self.spec.clock;
        self.push_all();
        self.touch = self.plant.advance(clock.sample_s, clock.substeps);
        self.sample += 1;
        self.read();
        // Lights change after the motion: their phase belongs to the new
        // sample.
        let time_s = self.time_s();
        for (shown, light) in self.lights.iter_mut().zip(&self.spec.lights) {
            shown.keep_time(light, time_s, self.sample);
        }
        // The weather of a row acts until the next row.
        if let (Some(state), Some(weather)) = (&mut self.weather, &self.spec.weather) {
            state.change(weather, clock.sample_s);
            let friction = state.friction;
            self.plant.set_ground(Ground { friction });
        }
    }

    /// Lets slopes and wind act on the bodies for the next sample.
    fn push_all(&mut self) {
        // On level ground in still air, which is usual, nothing pushes.
        if !self.spec.has_slopes() && self.spec.wind.is_none() {
            return;
        }
        let time_s = self.time_s();
        for (i, agent) in self.spec.agents.iter().enumerate() {
            let (at, state) = (&self.on_road[i], &self.states[i]);
            let rise = self.spec.profile_of(agent.road).rise(at.s_m);
            let (rise_sin, load_share) = slope_direction(rise);
            // Downhill is against the road where it rises.
            let downhill_mps2 = GRAVITY_MPS2 * rise_sin;
            let (sin, cos) = libm::sincos(at.heading_rad);
            let wind = self.spec.wind.as_ref();
            let blown = wind.map(|wind| wind.accel_mps2(time_s, &agent.body, state));
            let (along_mps2, left_mps2) = blown.unwrap_or_default();
            let grade_mps2 = [-downhill_mps2 * cos, downhill_mps2 * sin];
            let push = Push {
                along_mps2: along_mps2 + grade_mps2[0],
                left_mps2: left_mps2 + grade_mps2[1],
                grade_mps2,
                load_share,
            };
            self.plant.push(self.bodies[i], push);
        }
    }

    /// Shows a phase of a light from now on.
    pub(super) fn show(&mut self, light: usize, phase: Phase) {
        self.lights[light].set(phase, self.sample);
    }

    /// Applies an ado's action to a light.
    pub(super) fn turn(&mut self, light: usize, turn: PhaseAction) {
        self.lights[light].turn(turn, self.sample);
    }

    /// Sets the rates at which the weather changes from now on.
    pub(super) fn change_weather(&mut self, rates: WeatherRates) {
        if let Some(state) = &mut self.weather {
            state.rates = rates;
        }
    }

    /// Reads the states of all agents from the plant.
    pub(super) fn read(&mut self) {
        self.states.clear();
        self.on_road.clear();
        for (agent, &body) in self.bodies.iter().enumerate() {
            let state = self.plant.state(body);
            self.on_road.push(self.network.locate(agent, &state.pose));
            self.states.push(state);
        }
    }

    /// Returns a copy that continues bit for bit.
    pub(super) fn fork(&self) -> SceneState {
        SceneState {
            spec: Arc::clone(&self.spec),
            network: Arc::clone(&self.network),
            plant: self.plant.fork(),
            surface: self.surface.clone(),
            bodies: self.bodies.clone(),
            states: self.states.clone(),
            on_road: self.on_road.clone(),
            lights: self.lights.clone(),
            weather: self.weather,
            friction: self.friction,
            next_curvature_per_m: self.next_curvature_per_m,
            actions: self.actions.clone(),
            planned: self.planned.clone(),
            parameters: self.parameters.clone(),
            touch: self.touch,
            sample: self.sample,
        }
    }

    /// Returns the planned state of an agent.
    pub(super) fn planned_of(&self, agent: usize) -> PlannedAt {
        self.planned.get(agent).copied().unwrap_or_default()
    }

    /// Returns the time since the start.
    #[inline]
    pub(super) fn time_s(&self) -> f64 {
        // A product and not a sum, so rounding errors do not add up.
        self.sample as f64 * self.spec.clock.sample_s
    }

    /// Returns the time for which a light has been in its phase.
    pub(super) fn phase_s(&self, light: usize) -> f64 {
        (self.sample - self.lights[light].since) as f64 * self.spec.clock.sample_s
    }

    /// Returns the distance from an agent's front to a stop line.
    ///
    /// Along the road of the light, positive before the line.
    pub(super) fn line_m(&self, agent: usize, light: usize) -> f64 {
        let light = &self.spec.lights[light];
        let at = if self.spec.agents[agent].road == light.road {
            self.on_road[agent]
        } else {
            let course = &self.network.courses()[light.road];
            course.locate(&self.states[agent].pose)
        };
        light.line_m - at.s_m
    }

    /// Returns the coordinates of an agent on the road of `viewer`.
    #[inline]
    pub(super) fn on_road_of(&self, viewer: usize, agent: usize) -> OnRoad {
        if self.network.share_road(viewer, agent) {
            self.on_road[agent]
        } else {
            self.network.locate(viewer, &self.states[agent].pose)
        }
    }

    /// Returns the velocity of an agent along and across its road.
    #[inline]
    pub(super) fn velocity_mps(&self, agent: usize) -> Vector2<f64> {
        let state = &self.states[agent];
        self.on_road[agent].velocity_mps(state.speed_mps, state.lateral_mps)
    }

    /// Returns clearance and speed of the next agent ahead in an agent's path.
    ///
    /// If all agents move with the world's own road, that agent's front must be
    /// ahead. Otherwise any body in the path counts, whatever its heading.
    pub(super) fn leader_of(&self, agent: usize) -> Option<(f64, f64)> {
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
            (headway_m > 0.0 && !beside).then_some((i, headway_m))
        });
        // Of equally near agents the first in file order leads, so ties are
        // deterministic.
        let nearest = ahead.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(i, headway_m)| {
            let clearance_m = headway_m - agents[i].body.length_m;
            (clearance_m, self.velocity_mps(i).x)
        })
    }
}

impl SceneState {
    /// Returns a place in the driving direction of an agent.
    fn as_driven(&self, driver: usize, at: OnRoad) -> OnRoad {
        match self.spec.agents[driver].direction {
            Direction::With => at,
            Direction::Against => at.reversed(),
        }
    }

    /// Returns the space that a body occupies before `driver`, and its speed.
    ///
    /// The space is relative to the middle of the driver's front, in its
    /// driving direction. The speed is that at which the body moves away along
    /// the road.
    fn room_before(&self, driver: usize, agent: usize) -> (LaneOccupancy, f64) {
        let own = self.as_driven(driver, self.on_road[driver]);
        let at = self.as_driven(driver, self.on_road_of(driver, agent));
        let body = &self.spec.agents[agent].body;
        let front_m = (at.s_m - own.s_m, at.lateral_m - own.lateral_m);
        let room = LaneOccupancy::of(front_m, at.heading_rad, (body.length_m, body.width_m));
        let state = &self.states[agent];
        (room, at.velocity_mps(state.speed_mps, state.lateral_mps).x)
    }

    fn nearest_ahead(&self, agent: usize) -> Option<(f64, f64)> {
        let agents = &self.spec.agents;
        let half_m = 0.5 * agents[agent].body.width_m;
        let others = (0..agents.len()).filter(|&i| i != agent);
        let rooms = others.map(|i| self.room_before(agent, i));
        // Bodies that are wholly behind the front are no leaders.
        let ahead = rooms
            .filter(|(room, _)| room.far_m > 0.0 && room.is_within(half_m))
            .map(|(room, away_mps)| (room.near_m, away_mps));
        ahead.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns the clearance of two bodies along the road of the first.
    ///
    /// The second value is the closing speed. The clearance is 0 if the bodies
    /// overlap along the road.
    pub(super) fn closing_along(&self, [a, b]: [usize; 2]) -> (f64, f64) {
        let ((of_a, a_mps), (of_b, b_mps)) = (self.room_before(a, a), self.room_before(a, b));
        // Compares the middles of both bodies, doubled.
        let is_ahead = of_a.near_m + of_a.far_m < of_b.near_m + of_b.far_m;
        if is_ahead {
            ((of_b.near_m - of_a.far_m).max(0.0), a_mps - b_mps)
        } else {
            ((of_a.near_m - of_b.far_m).max(0.0), b_mps - a_mps)
        }
    }

    /// Returns the distance from an agent's front to its crossing with another.
    ///
    /// The first crossing that its rear has not passed counts, or else the
    /// last.
    pub(super) fn conflict_m(&self, [a, b]: [usize; 2]) -> Option<f64> {
        let own_m = self.as_driven(a, self.on_road[a]).s_m;
        let sign = match self.spec.agents[a].direction {
            Direction::With => 1.0,
            Direction::Against => -1.0,
        };
        let crossings = self.network.crossings(a, b);
        let mut ways = crossings.iter().map(|it| sign * it.s_m - own_m);
        let length_m = self.spec.agents[a].body.length_m;
        // A crossing under the own body still counts, so up to its length
        // behind.
        let next_m = ways.clone().find(|way_m| -length_m <= *way_m);
        // Past all crossings the last one counts, with a negative distance.
        next_m.or_else(|| ways.next_back())
    }
}

fn ground(spec: &DriveSpec) -> Ground {
    Ground {
        friction: spec.road.friction(),
    }
}
