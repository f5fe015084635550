//! The driving scene, assembled from data: a road, an ego, ados and traffic.
//!
//! There is no scene type per scenario. Whatever a world file describes is a
//! [`DriveSpec`], and [`DriveScene`] moves it on either plant.

mod signals;
mod spec;
mod steering;

use std::sync::Arc;

use rand::RngExt;

pub use signals::{Offer, TTC_CAP_S};
pub use spec::{
    Actions, Agent, ControllerFactory, Drive, DriveSpec, EgoDrive, Place, Range, Road, Script,
};

use super::{Axis, Cast, Clock, Flow, Frame, Role, Scene, Stage, Start, Touch};
use crate::ego::{Actuator, Controller, Fault, Own, Percept, Seen};
use crate::rl::Spaces;
use crate::seed::StartKey;
use crate::sim::{self, BodyId, BodyState, Command, Contact, Ground, Plant, Pose};
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};
use signals::{Between, Field, Source};
use steering::LaneKeeper;

/// A driving scene could not be assembled.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The signals clash.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A derived signal does not bind.
    #[error("the signal `{name}`: {source}")]
    Derived {
        /// Its name.
        name: String,
        /// Why.
        source: Box<StlError>,
    },
    /// An observed signal is not published.
    #[error("`{name}` is observed but not published")]
    Observed {
        /// Its name.
        name: String,
    },
    /// There must be exactly one ego.
    #[error("a driving scene has exactly one ego, not {count}")]
    Egos {
        /// How many there are.
        count: usize,
    },
}

/// A driving scene in motion.
pub struct DriveScene {
    layout: Arc<Layout>,
    plant: Box<dyn Plant>,
    controller: Box<dyn Controller>,
    actuator: Actuator,
    keepers: Vec<LaneKeeper>,
    chosen_mps2: Vec<f64>,
    bodies: Vec<BodyId>,
    states: Vec<BodyState>,
    percept: Percept,
    touch: Option<Contact>,
    sample: usize,
}

/// An assembled driving world: makes scenes that share everything fixed.
#[derive(Clone)]
pub struct DriveWorld(Arc<Layout>);

struct Layout {
    spec: DriveSpec,
    ego: usize,
    ego_drive: EgoDrive,
    schema: Arc<Schema>,
    sources: Vec<Source>,
    derived: Vec<BoundExpr>,
    observed: Vec<(usize, f64, f64)>,
    axes: Vec<Axis>,
    spaces: Spaces,
}

/// The schema of a spec's traces: published signals, then derived ones.
///
/// # Errors
/// Two signals of one name.
pub fn schema_of(spec: &DriveSpec) -> Result<Schema, SchemaError> {
    let published = spec.published().into_iter().map(|offer| offer.signal);
    let derived = spec.derived.iter().map(|derived| derived.signal.clone());
    Schema::new(spec.clock.sample_s, published.chain(derived))
}

impl Layout {
    fn new(spec: DriveSpec) -> Result<Layout, SceneError> {
        let egos: Vec<(usize, &EgoDrive)> = spec.egos().collect();
        let [(ego, ego_drive)] = egos[..] else {
            return Err(SceneError::Egos { count: egos.len() });
        };
        let ego_drive = ego_drive.clone();
        let schema = schema_of(&spec)?;
        let derived = spec
            .derived
            .iter()
            .map(|derived| {
                derived
                    .expr
                    .bind(&schema, &spec.constants)
                    .map_err(|source| SceneError::Derived {
                        name: derived.signal.name.clone(),
                        source: Box::new(source),
                    })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let observed = spec
            .observe
            .iter()
            .map(|observed| match schema.position(&observed.name) {
                Some(position) => Ok((position, observed.mid, 1.0 / observed.half)),
                None => Err(SceneError::Observed {
                    name: observed.name.clone(),
                }),
            })
            .collect::<Result<Vec<_>, _>>()?;
        let (mut actions, mut neutral) = (1, 0);
        for (_, set, set_neutral) in spec.action_sets() {
            neutral += set_neutral * actions;
            actions *= set.len();
        }
        Ok(Layout {
            ego,
            ego_drive,
            schema: Arc::new(schema),
            sources: spec
                .published()
                .into_iter()
                .map(|offer| offer.source)
                .collect(),
            derived,
            axes: spec.axes(),
            spaces: Spaces {
                observation: observed.len(),
                actions,
                neutral,
            },
            observed,
            spec,
        })
    }
}

impl DriveWorld {
    /// Assembles a world.
    ///
    /// # Errors
    /// Signals that clash or do not bind; no ego or several.
    pub fn new(spec: DriveSpec) -> Result<DriveWorld, SceneError> {
        Layout::new(spec).map(|layout| DriveWorld(Arc::new(layout)))
    }

    /// What it was assembled from.
    pub fn spec(&self) -> &DriveSpec {
        &self.0.spec
    }

    /// The published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Shapes of the ados' joint observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }

    /// A scene at rest, to be `reset`.
    pub fn scene(&self) -> DriveScene {
        let layout = Arc::clone(&self.0);
        let spec = &layout.spec;
        let ground = Ground {
            friction: spec.road.friction(),
        };
        DriveScene {
            plant: sim::plant(spec.plant, ground),
            controller: layout.ego_drive.build(),
            actuator: Actuator::new(layout.ego_drive.lag_s(), spec.clock.sample_s),
            keepers: Vec::with_capacity(spec.agents.len()),
            chosen_mps2: vec![0.0; spec.agents.len()],
            bodies: Vec::with_capacity(spec.agents.len()),
            states: Vec::with_capacity(spec.agents.len()),
            percept: Percept::default(),
            touch: None,
            sample: 0,
            layout,
        }
    }
}

impl DriveScene {
    fn time_s(&self) -> f64 {
        self.sample as f64 * self.layout.spec.clock.sample_s
    }

    fn time_ms(&self) -> u64 {
        (self.time_s() * 1e3).round() as u64
    }

    fn read_states(&mut self) {
        self.states.clear();
        for &body in &self.bodies {
            self.states.push(self.plant.state(body));
        }
    }

    fn perceive(&mut self) {
        let spec = &self.layout.spec;
        let ego = self.states[self.layout.ego];
        let body = &spec.agents[self.layout.ego].body;
        self.percept.time_s = self.time_s();
        self.percept.sample_s = spec.clock.sample_s;
        self.percept.own = Own {
            speed_mps: ego.speed_mps,
            accel_mps2: ego.accel_mps2,
            s_m: ego.pose.x_m,
            lateral_m: ego.pose.y_m,
            lane: spec.road.lane_at(ego.pose.y_m),
            length_m: body.length_m,
            width_m: body.width_m,
        };
        let others = (0..spec.agents.len()).filter(|&i| i != self.layout.ego);
        for (seen, i) in self.percept.others.iter_mut().zip(others) {
            let state = self.states[i];
            let (along, across) = road_velocity(&state);
            seen.headway_m = state.pose.x_m - ego.pose.x_m;
            seen.lateral_m = state.pose.y_m - ego.pose.y_m;
            seen.speed_mps = along;
            seen.lateral_mps = across;
            seen.lane = spec.road.lane_at(state.pose.y_m);
        }
    }

    fn command_all(&mut self) -> Result<(), Fault> {
        self.perceive();
        let command = self.controller.control(&self.percept)?;
        if !(command.accel_mps2.is_finite() && command.lateral_mps.is_finite()) {
            return Err(Fault::NotFinite {
                time_ms: self.time_ms(),
            });
        }
        let time_s = self.time_s();
        let sample_s = self.layout.spec.clock.sample_s;
        for (i, agent) in self.layout.spec.agents.iter().enumerate() {
            let (accel_mps2, lateral_mps) = match &agent.drive {
                Drive::Ego(_) => (self.actuator.step(command.accel_mps2), command.lateral_mps),
                Drive::Ado { .. } => (self.chosen_mps2[i], 0.0),
                Drive::Scripted(script) => (script.accel_mps2(time_s), 0.0),
            };
            let curvature_per_m = self.keepers[i].curvature(&self.states[i], lateral_mps, sample_s);
            self.plant.command(
                self.bodies[i],
                Command::Drive {
                    accel_mps2,
                    curvature_per_m,
                },
            );
        }
        Ok(())
    }

    fn touch_of(&self, contact: &Contact) -> Touch {
        let name = |body: BodyId| self.layout.spec.agents[body.0].name.clone();
        Touch {
            between: (name(contact.pair.0), name(contact.pair.1)),
            time_s: self.time_s() - self.layout.spec.clock.sample_s + contact.after_s,
            closing_speed_mps: contact.closing_speed_mps,
            point_m: contact.point_m,
        }
    }

    fn agent_value(&self, agent: usize, field: Field) -> f64 {
        let state = &self.states[agent];
        match field {
            Field::X | Field::S => state.pose.x_m,
            Field::Y | Field::Lateral => state.pose.y_m,
            Field::Heading => state.pose.heading_rad,
            Field::Speed => state.speed_mps,
            Field::Accel => state.accel_mps2,
            Field::LateralSpeed => road_velocity(state).1,
            Field::Lane => self.layout.spec.road.lane_at(state.pose.y_m) as f64,
            Field::YawRate => state.yaw_rate_rad_per_s,
        }
    }

    fn pair_value(&self, a: usize, b: usize, between: Between) -> f64 {
        let (from, to) = (&self.states[a], &self.states[b]);
        match between {
            Between::Headway => to.pose.x_m - from.pose.x_m,
            Between::Lateral => to.pose.y_m - from.pose.y_m,
            Between::Gap => self.plant.gap_m(self.bodies[a], self.bodies[b]),
            Between::Ttc => self.time_to_collision_s(a, b),
            Between::Contact => {
                let pair = (self.bodies[a.min(b)], self.bodies[a.max(b)]);
                let touched = self.touch.is_some_and(|contact| contact.pair == pair);
                f64::from(u8::from(touched))
            }
        }
    }

    /// Clearance along the road over closing speed; the cap when not closing.
    fn time_to_collision_s(&self, a: usize, b: usize) -> f64 {
        let (from, to) = (&self.states[a], &self.states[b]);
        let ahead = to.pose.x_m - from.pose.x_m;
        let front = if 0.0 < ahead { b } else { a };
        let clearance_m = ahead.abs() - self.layout.spec.agents[front].body.length_m;
        let closing_mps = (road_velocity(from).0 - road_velocity(to).0) * ahead.signum();
        if closing_mps <= 0.0 {
            return TTC_CAP_S;
        }
        (clearance_m.max(0.0) / closing_mps).min(TTC_CAP_S)
    }
}

/// Velocity along and across a straight road.
fn road_velocity(state: &BodyState) -> (f64, f64) {
    let (sin, cos) = libm::sincos(state.pose.heading_rad);
    (
        state.speed_mps * cos - state.lateral_mps * sin,
        state.speed_mps * sin + state.lateral_mps * cos,
    )
}

impl Scene for DriveScene {
    fn schema(&self) -> &Arc<Schema> {
        &self.layout.schema
    }

    fn spaces(&self) -> &Spaces {
        &self.layout.spaces
    }

    fn clock(&self) -> &Clock {
        &self.layout.spec.clock
    }

    fn axes(&self) -> &[Axis] {
        &self.layout.axes
    }

    fn draw(&self, key: StartKey) -> Start {
        let mut rng = key.generator(&self.layout.spec.world, "start");
        Start(
            self.layout
                .axes
                .iter()
                .map(|axis| axis.lo + (axis.hi - axis.lo) * rng.random::<f64>())
                .collect(),
        )
    }

    fn reset(&mut self, start: &Start, noise: u64) {
        let layout = Arc::clone(&self.layout);
        let spec = &layout.spec;
        self.plant.clear(Ground {
            friction: spec.road.friction(),
        });
        self.bodies.clear();
        self.keepers.clear();
        self.chosen_mps2.fill(0.0);
        self.touch = None;
        self.sample = 0;
        let mut drawn = start.0.iter().copied();
        let mut value = |range: Range| match range.is_fixed() {
            true => range.lo,
            false => drawn.next().unwrap_or(range.lo),
        };
        let mut fronts_m: Vec<f64> = Vec::with_capacity(spec.agents.len());
        for agent in &spec.agents {
            let front_m = match agent.place {
                Place::At { x_m, .. } => value(x_m),
                Place::Ahead { of, headway_m, .. } => fronts_m[of] + value(headway_m),
            };
            let speed_mps = value(agent.place.speed_mps());
            let lateral_m = spec.road.lane_middle_m(agent.lane);
            let pose = Pose {
                x_m: front_m,
                y_m: lateral_m,
                heading_rad: 0.0,
            };
            fronts_m.push(front_m);
            self.bodies
                .push(self.plant.spawn(&agent.body, pose, speed_mps));
            self.keepers.push(LaneKeeper::new(lateral_m));
        }
        self.read_states();
        self.percept.others.clear();
        for (i, agent) in spec.agents.iter().enumerate() {
            if i != layout.ego {
                self.percept.others.push(Seen {
                    name: agent.name.clone(),
                    headway_m: 0.0,
                    lateral_m: 0.0,
                    speed_mps: 0.0,
                    lateral_mps: 0.0,
                    lane: agent.lane,
                    length_m: agent.body.length_m,
                    width_m: agent.body.width_m,
                });
            }
        }
        self.controller.reset(noise);
        self.actuator.reset();
    }

    fn decide(&mut self, mut action: usize) {
        for (i, agent) in self.layout.spec.agents.iter().enumerate() {
            if let Drive::Ado { actions, .. } = &agent.drive {
                self.chosen_mps2[i] = actions.accel_mps2(action % actions.len());
                action /= actions.len();
            }
        }
    }

    fn advance(&mut self) -> Flow {
        if let Err(fault) = self.command_all() {
            return Flow::Fault(fault);
        }
        let clock = self.layout.spec.clock;
        self.touch = self.plant.advance(clock.sample_s, clock.substeps);
        self.sample += 1;
        self.read_states();
        if !self.plant.sound() {
            return Flow::Fault(Fault::Physics {
                time_ms: self.time_ms(),
            });
        }
        match &self.touch {
            Some(contact) => Flow::Contact(self.touch_of(contact)),
            None => Flow::Going,
        }
    }

    fn publish(&self, row: &mut [f64]) {
        let time_s = self.time_s();
        for (value, source) in row.iter_mut().zip(&self.layout.sources) {
            *value = match *source {
                Source::Time => time_s,
                Source::TimeLeft => (self.layout.spec.clock.horizon_s - time_s).max(0.0),
                Source::Contact => f64::from(u8::from(self.touch.is_some())),
                Source::Agent(agent, field) => self.agent_value(agent, field),
                Source::Pair(a, b, between) => self.pair_value(a, b, between),
            };
        }
        let published = self.layout.sources.len();
        for (i, expr) in self.layout.derived.iter().enumerate() {
            row[published + i] = expr.eval(row);
        }
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        for (value, &(position, mid, per_half)) in obs.iter_mut().zip(&self.layout.observed) {
            // The one cast from signals to observations.
            *value = ((row[position] - mid) * per_half) as f32;
        }
    }

    fn stage(&self) -> Stage {
        let spec = &self.layout.spec;
        let cast = spec.agents.iter().map(|agent| Cast {
            name: agent.name.clone(),
            role: match agent.drive {
                Drive::Ego(_) => Role::Ego,
                Drive::Ado { .. } => Role::Ado,
                Drive::Scripted(_) => Role::Scripted,
            },
            size_m: [agent.body.length_m, agent.body.width_m, agent.body.height_m],
        });
        let width_m = spec.road.lane_width_m();
        let borders = (0..=spec.road.lanes()).map(|border| {
            let y_m = (border as f64 - 0.5) * width_m;
            vec![[-100.0, y_m, 0.0], [900.0, y_m, 0.0]]
        });
        Stage {
            cast: cast.collect(),
            lane_borders_m: borders.collect(),
        }
    }

    fn frame(&self) -> Frame {
        Frame {
            placements: self
                .bodies
                .iter()
                .map(|&body| self.plant.placement(body))
                .collect(),
        }
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(DriveScene {
            layout: Arc::clone(&self.layout),
            plant: self.plant.fork(),
            controller: self.controller.fork()?,
            actuator: self.actuator,
            keepers: self.keepers.clone(),
            chosen_mps2: self.chosen_mps2.clone(),
            bodies: self.bodies.clone(),
            states: self.states.clone(),
            percept: self.percept.clone(),
            touch: self.touch,
            sample: self.sample,
        }))
    }
}
