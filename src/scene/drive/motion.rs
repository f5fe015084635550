//! A driving scene in motion: commands in, states out, sample by sample.

use std::sync::Arc;

use rand::RngExt;

use super::actions::Choice;
use super::course::OnRoad;
use super::light::{LightDrive, Shown};
use super::reading::scaled;
use super::sensors::Sensing;
use super::spec::{Agent, Drive, Range, StartPlace};
use super::steering::LaneKeeper;
use super::trained::{TrainedAdo, Who};
use super::{Layout, staging};
use crate::ego::{self, Actuator, Controller, Fault, FaultKind, Percept};
use crate::rl::Spaces;
use crate::scene::{Axis, Clock, Flow, Frame, Scene, Stage, Start, Touch};
use crate::seed::StartKey;
use crate::sim::{self, BodyCommand, BodyId, BodyState, Contact, Ground, Plant, Pose};
use crate::trace::Schema;

/// A driving scene in motion.
pub struct DriveScene {
    pub(super) layout: Arc<Layout>,
    pub(super) plant: Box<dyn Plant>,
    controller: Box<dyn Controller>,
    /// Of an ego that nobody here wrote: what it commanded so far.
    commands: Vec<ego::Command>,
    pub(super) sensing: Sensing,
    /// The lag behind each agent's acceleration.
    actuators: Vec<Actuator>,
    keepers: Vec<LaneKeeper>,
    chosen: Vec<Choice>,
    pub(super) bodies: Vec<BodyId>,
    pub(super) states: Vec<BodyState>,
    pub(super) on_road: Vec<OnRoad>,
    pub(super) lights: Vec<Shown>,
    pub(super) percept: Percept,
    pub(super) touch: Option<Contact>,
    pub(super) sample: usize,
}

impl DriveScene {
    pub(super) fn new(layout: Arc<Layout>) -> DriveScene {
        let spec = &layout.spec;
        let agents = spec.agents.len();
        let mut controller = spec.ego.controller.build();
        controller.brief(&layout.briefing());
        DriveScene {
            plant: sim::plant(spec.plant, ground(&layout)),
            controller,
            commands: Vec::new(),
            sensing: Sensing::new(spec.sensors, spec.clock.sample_s),
            actuators: Vec::with_capacity(agents),
            keepers: Vec::with_capacity(agents),
            chosen: vec![Choice::NONE; agents],
            bodies: Vec::with_capacity(agents),
            states: Vec::with_capacity(agents),
            on_road: Vec::with_capacity(agents),
            lights: Vec::with_capacity(spec.lights.len()),
            percept: Percept::default(),
            touch: None,
            sample: 0,
            layout,
        }
    }

    pub(super) fn time_s(&self) -> f64 {
        self.sample as f64 * self.layout.spec.clock.sample_s
    }

    fn read_states(&mut self) {
        self.states.clear();
        self.on_road.clear();
        for &body in &self.bodies {
            let state = self.plant.state(body);
            self.on_road.push(self.layout.course.locate(&state.pose));
            self.states.push(state);
        }
    }

    fn spawn(&mut self, agent: &Agent, s_m: f64, lateral_m: f64, speed_mps: f64) {
        let pose = self.layout.course.pose(s_m, lateral_m);
        let pose = Pose {
            heading_rad: pose.heading_rad + agent.facing_rad,
            ..pose
        };
        let body = self.plant.spawn(&agent.body, pose, speed_mps);
        self.bodies.push(body);
        let (lag_s, lateral_lag_s) = match &agent.drive {
            Drive::Ego => {
                let lag_s = self.layout.spec.ego.lag_s;
                (lag_s, lag_s)
            }
            Drive::Ado { actions, lag_s, .. } => (*lag_s, actions.lateral_lag_s()),
            Drive::Trained(TrainedAdo { actions, lag_s, .. }) => (*lag_s, actions.lateral_lag_s()),
            Drive::Scripted(_) => (0.0, 0.0),
        };
        let sample_s = self.layout.spec.clock.sample_s;
        self.actuators.push(Actuator::new(lag_s, sample_s));
        self.keepers.push(LaneKeeper::new(
            &agent.body,
            lateral_m,
            lateral_lag_s,
            sample_s,
        ));
    }

    /// What the trained ados decide now.
    fn decide_trained(&mut self) {
        let layout = Arc::clone(&self.layout);
        for frozen in &layout.frozen {
            let Some(action) = frozen.act(self) else {
                continue;
            };
            match (frozen.who, frozen.actions.choice(action)) {
                (Who::Light(i), Choice::Turn(turn)) => self.lights[i].turn(turn, self.sample),
                (Who::Agent(i), choice) => self.chosen[i] = choice,
                // Invariant: a light's ado has a light's actions.
                (Who::Light(_), _) => {}
            }
        }
    }

    fn command_all(&mut self) -> Result<(), Fault> {
        self.perceive();
        let command = self.controller.control(&self.percept)?;
        if let Some(fault) = command.flaw() {
            let message = format!("{} at {:.3} s", fault.message, self.time_s());
            return Err(Fault { message, ..fault });
        }
        if self.layout.spec.ego.is_foreign() {
            self.commands.push(command);
        }
        let asked = Choice::Drive {
            accel_mps2: command.accel_mps2,
            lateral_mps: command.lateral_mps,
        };
        let layout = Arc::clone(&self.layout);
        for (i, agent) in layout.spec.agents.iter().enumerate() {
            let wish = match &agent.drive {
                Drive::Ego => asked,
                Drive::Ado { .. } | Drive::Trained(_) => self.chosen[i],
                Drive::Scripted(script) => match agent.body.is_on_foot() {
                    true => {
                        let (along_mps, left_mps) = script.walk_mps(self.time_s());
                        Choice::Walk {
                            along_mps,
                            left_mps,
                        }
                    }
                    false => {
                        let speed_mps = self.states[i].speed_mps;
                        let leader = || self.leader_of(i);
                        Choice::Drive {
                            accel_mps2: script.accel_mps2(self.time_s(), speed_mps, leader),
                            lateral_mps: 0.0,
                        }
                    }
                },
            };
            self.command(i, wish);
        }
        Ok(())
    }

    fn command(&mut self, agent: usize, wish: Choice) {
        let (state, at) = (&self.states[agent], &self.on_road[agent]);
        let command = match wish {
            Choice::Drive {
                accel_mps2,
                lateral_mps,
            } => BodyCommand::Drive {
                accel_mps2: self.actuators[agent].step(accel_mps2),
                curvature_per_m: self.keepers[agent].curvature(
                    at,
                    state.speed_mps,
                    lateral_mps,
                    self.layout.spec.clock.sample_s,
                ),
            },
            Choice::Walk {
                along_mps,
                left_mps,
            } => {
                let road_rad = state.pose.heading_rad - at.heading_rad;
                let (sin, cos) = libm::sincos(road_rad);
                BodyCommand::Walk {
                    x_mps: along_mps * cos - left_mps * sin,
                    y_mps: along_mps * sin + left_mps * cos,
                }
            }
            // Invariant: only lights turn, and they have no body.
            Choice::Turn(_) => return,
        };
        self.plant.command(self.bodies[agent], command);
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
}

fn ground(layout: &Layout) -> Ground {
    Ground {
        friction: layout.spec.road.friction(),
    }
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
        self.plant.clear(ground(&layout));
        self.bodies.clear();
        self.actuators.clear();
        self.keepers.clear();
        self.chosen.fill(Choice::NONE);
        self.touch = None;
        self.sample = 0;
        let mut drawn = start.0.iter().copied();
        let mut value = |range: Range| match range.is_fixed() {
            true => range.lo,
            false => drawn.next().unwrap_or(range.lo),
        };
        let mut fronts_m: Vec<f64> = Vec::with_capacity(layout.spec.agents.len());
        for agent in &layout.spec.agents {
            let front_m = match agent.place {
                StartPlace::At { x_m, .. } => value(x_m),
                StartPlace::Ahead { of, headway_m, .. } => fronts_m[of] + value(headway_m),
            };
            fronts_m.push(front_m);
            let lateral_m = value(agent.lateral_m);
            let speed_mps = value(agent.place.speed_mps());
            self.spawn(agent, front_m, lateral_m, speed_mps);
        }
        self.read_states();
        self.lights.clear();
        self.lights
            .extend(layout.spec.lights.iter().map(Shown::first));
        self.percept = self.blank_percept();
        self.sensing.reset(noise);
        self.commands.clear();
        self.controller.reset(noise);
    }

    fn decide(&mut self, mut action: usize) {
        let layout = Arc::clone(&self.layout);
        for (i, agent) in layout.spec.agents.iter().enumerate() {
            if let Drive::Ado { actions, .. } = &agent.drive {
                self.chosen[i] = actions.choice(action % actions.len());
                action /= actions.len();
            }
        }
        for (i, light) in layout.spec.lights.iter().enumerate() {
            if let LightDrive::Ado { actions, .. } = &light.drive {
                if let Choice::Turn(turn) = actions.choice(action % actions.len()) {
                    self.lights[i].turn(turn, self.sample);
                }
                action /= actions.len();
            }
        }
    }

    fn advance(&mut self) -> Flow {
        self.decide_trained();
        if let Err(fault) = self.command_all() {
            return Flow::Fault(fault);
        }
        let clock = self.layout.spec.clock;
        self.touch = self.plant.advance(clock.sample_s, clock.substeps);
        self.sample += 1;
        self.read_states();
        let time_s = self.time_s();
        for (shown, light) in self.lights.iter_mut().zip(&self.layout.spec.lights) {
            shown.keep_time(light, time_s, self.sample);
        }
        if !self.plant.sound() {
            return Flow::Fault(Fault::new(
                FaultKind::Physics,
                format!("the physics broke down at {:.3} s", self.time_s()),
            ));
        }
        match &self.touch {
            Some(contact) => Flow::Contact(self.touch_of(contact)),
            None => Flow::Going,
        }
    }

    fn publish(&self, row: &mut [f64]) {
        for (value, source) in row.iter_mut().zip(&self.layout.sources) {
            *value = source.value(self);
        }
        let published = self.layout.sources.len();
        for (i, expr) in self.layout.derived.iter().enumerate() {
            row[published + i] = expr.eval(row);
        }
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        scaled(row, &self.layout.observed, obs);
    }

    fn stage(&self) -> Stage {
        staging::stage(&self.layout)
    }

    fn frame(&self) -> Frame {
        let placements = self.bodies.iter();
        Frame {
            placements: placements.map(|&body| self.plant.placement(body)).collect(),
            phases: self.lights.iter().map(|shown| shown.phase).collect(),
        }
    }

    fn finish(&mut self) {
        self.controller.finish();
    }

    fn commands(&self) -> &[ego::Command] {
        &self.commands
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(DriveScene {
            layout: Arc::clone(&self.layout),
            plant: self.plant.fork(),
            controller: self.controller.fork()?,
            commands: self.commands.clone(),
            sensing: self.sensing.clone(),
            actuators: self.actuators.clone(),
            keepers: self.keepers.clone(),
            chosen: self.chosen.clone(),
            bodies: self.bodies.clone(),
            states: self.states.clone(),
            on_road: self.on_road.clone(),
            lights: self.lights.clone(),
            percept: self.percept.clone(),
            touch: self.touch,
            sample: self.sample,
        }))
    }
}
