//! What a driving scene is made of: checked data, no spans.

use std::sync::Arc;

use super::actions::Actions;
use super::light::{Light, LightDrive};
use super::names::AgentNames;
use super::placed::{Direction, PlacedRoads};
use super::plan::MotionPlan;
use super::range::Range;
use super::road::Road;
use super::script::Script;
use super::sensors::Sensors;
use super::steering::LaneKeeping;
use super::trained::{TrainedAdo, TrainingWorld};
use indexmap::IndexMap;

use crate::ego::{Actuated, Command, Controller, ControllerSpec, RecordedCommands};
use crate::scene::{Axis, Clock, Derived, Observed, Start};
use crate::sim::{Body, PlantKind};
use crate::stl::{Constants, Formula, Names};

/// Where and how fast an agent starts.
#[derive(Clone, Debug, PartialEq)]
pub enum StartPlace {
    /// At a position along the road.
    At {
        /// Front bumper along the road.
        x_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
    /// Relative to an agent declared before.
    Ahead {
        /// Position of that agent in the file.
        of: usize,
        /// Front bumper to front bumper; negative is behind.
        headway_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
}

impl StartPlace {
    /// The initial speed.
    pub fn speed_mps(&self) -> Range {
        match *self {
            StartPlace::At { speed_mps, .. } | StartPlace::Ahead { speed_mps, .. } => speed_mps,
        }
    }
}

/// Makes a fresh controller, once per worker.
pub type ControllerFactory = Arc<dyn Fn() -> Box<dyn Controller> + Send + Sync>;

/// What drives the ego: its controller, and the lag of its actuator.
pub type EgoDrive = Actuated<EgoController>;

/// The ego's controller: a stock one from the world file, the user's own, or the
/// commands of one that is not there.
#[derive(Clone)]
pub enum EgoController {
    /// From the world file.
    Stock(ControllerSpec),
    /// A Rust type implementing [`Controller`].
    Own {
        /// How rows call it.
        name: String,
        /// Makes a controller that remembers nothing of others.
        factory: ControllerFactory,
    },
    /// What a program or a user's own type commanded once, sample by sample.
    Recorded(Arc<[Command]>),
}

impl EgoDrive {
    /// The stock controller with its actuator, if it is one.
    pub fn stock(&self) -> Option<Actuated<ControllerSpec>> {
        match &self.controller {
            EgoController::Stock(spec) => Some(Actuated {
                controller: spec.clone(),
                lag_s: self.lag_s,
            }),
            EgoController::Own { .. } | EgoController::Recorded(_) => None,
        }
    }

    /// Whether nobody here wrote it: equal percepts may get unequal answers.
    pub fn is_foreign(&self) -> bool {
        matches!(
            self.controller,
            EgoController::Own { .. }
                | EgoController::Recorded(_)
                | EgoController::Stock(ControllerSpec::Process(_))
        )
    }

    /// Whether it only repeats recorded commands, whatever it sees.
    pub fn is_recorded(&self) -> bool {
        matches!(self.controller, EgoController::Recorded(_))
    }
}

impl EgoController {
    /// A fresh controller.
    pub fn build(&self) -> Box<dyn Controller> {
        match self {
            EgoController::Stock(spec) => spec.build(),
            EgoController::Own { factory, .. } => factory(),
            EgoController::Recorded(commands) => {
                Box::new(RecordedCommands::new(Arc::clone(commands)))
            }
        }
    }
}

impl std::fmt::Debug for EgoController {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            EgoController::Stock(spec) => spec.fmt(f),
            EgoController::Own { name, .. } => write!(f, "Own({name})"),
            EgoController::Recorded(commands) => write!(f, "Recorded({})", commands.len()),
        }
    }
}

/// A plan as a world has it: numbers may be ranges, steps wait for formulas.
pub type PlanSpec = MotionPlan<Range, Formula>;

/// Who drives an agent.
#[derive(Clone, Debug)]
pub enum Drive {
    /// The system under test: [`DriveSpec::ego`].
    Ego,
    /// A learning adversary.
    Ado {
        /// What it may choose from.
        actions: Actions,
        /// The action that leaves things alone.
        neutral: usize,
        /// Time constant with which its acceleration follows; 0 is none.
        lag_s: f64,
        /// The plan from which its actions stray, if it has one.
        base: Option<PlanSpec>,
    },
    /// An ado trained elsewhere, frozen.
    Trained(TrainedAdo),
    /// Background traffic.
    Scripted(Script),
    /// Carried along a plan, as targets of test protocols are.
    Planned(PlanSpec),
}

/// One agent.
#[derive(Clone, Debug)]
pub struct Agent {
    /// Name in signals.
    pub name: String,
    /// Its body.
    pub body: Body,
    /// Its road: 0 is the world's own, the named ones follow.
    pub road: usize,
    /// Which way it drives there.
    pub direction: Direction,
    /// Which of its points keeps its line where it is driven.
    pub lane_keeping: LaneKeeping,
    /// Where it starts, to the left of lane 0's middle.
    pub lateral_m: Range,
    /// Its heading at the start, counter-clockwise from the road's.
    pub facing_rad: f64,
    /// Where it starts.
    pub place: StartPlace,
    /// Who drives it.
    pub drive: Drive,
}

/// A driving scene, assembled from data.
#[derive(Clone, Debug)]
pub struct DriveSpec {
    /// Name of the world; part of every start's key.
    pub world: String,
    /// The clocks.
    pub clock: Clock,
    /// Which physics.
    pub plant: PlantKind,
    /// The world's own road, on which the ego drives.
    pub road: Road,
    /// Other roads, by name.
    pub roads: PlacedRoads,
    /// The world's own bodies by name; a change may put the ego into one.
    pub bodies: IndexMap<String, Body>,
    /// The agents, in file order; exactly one is the ego.
    pub agents: Vec<Agent>,
    /// The system under test, which drives that one.
    pub ego: EgoDrive,
    /// The traffic lights, in file order.
    pub lights: Vec<Light>,
    /// What stands between the world and the ego's percepts.
    pub sensors: Sensors,
    /// Signals published besides the basic ones, by name.
    pub extra: Vec<String>,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ados' observation.
    pub observe: Vec<Observed>,
    /// Numbers that a start draws besides where everybody is: signals that stay
    /// the same throughout a run.
    pub parameters: IndexMap<String, Range>,
    /// Formulas that those of plans may use by name.
    pub formulas: Names,
    /// The starts, if they are a table: values in the order of the axes.
    pub points: Vec<Start>,
}

impl Agent {
    /// The plan that it keeps to or strays from.
    pub fn plan(&self) -> Option<&PlanSpec> {
        match &self.drive {
            Drive::Planned(plan)
            | Drive::Ado {
                base: Some(plan), ..
            } => Some(plan),
            _ => None,
        }
    }

    /// Whether it drives with the world's own road, or goes about on foot there:
    /// then its place and heading are read as those of traffic in lanes.
    pub fn is_with_road(&self) -> bool {
        let stands = matches!(self.drive, Drive::Scripted(Script::Stand));
        self.road == 0 && self.direction == Direction::With && !stands
    }
}

impl DriveSpec {
    /// The road on which an agent is.
    pub fn road_of(&self, agent: usize) -> &Road {
        match self.agents[agent].road {
            0 => &self.road,
            road => &self.roads[road - 1].road,
        }
    }

    /// Positions of the agents that the system under test drives.
    pub fn egos(&self) -> impl Iterator<Item = usize> {
        let agents = self.agents.iter().enumerate();
        agents.filter_map(|(i, agent)| matches!(agent.drive, Drive::Ego).then_some(i))
    }

    /// The ados' names, action sets and neutral actions: first those of road
    /// users, then those of lights, in file order.
    pub fn action_sets(&self) -> impl Iterator<Item = (&str, &Actions, usize)> {
        let agents = self.agents.iter().filter_map(|agent| match &agent.drive {
            Drive::Ado {
                actions, neutral, ..
            } => Some((agent.name.as_str(), actions, *neutral)),
            _ => None,
        });
        let lights = self.lights.iter().filter_map(|light| match &light.drive {
            LightDrive::Ado { actions, neutral } => Some((light.name.as_str(), actions, *neutral)),
            LightDrive::Trained(_) | LightDrive::Schedule(_) => None,
        });
        agents.chain(lights)
    }

    /// The trained ados, road users first, by their names here.
    pub fn trained(&self) -> impl Iterator<Item = (&str, &TrainedAdo)> {
        let agents = self.agents.iter().filter_map(|agent| match &agent.drive {
            Drive::Trained(trained) => Some((agent.name.as_str(), trained)),
            _ => None,
        });
        let lights = self.lights.iter().filter_map(|light| match &light.drive {
            LightDrive::Trained(trained) => Some((light.name.as_str(), trained)),
            _ => None,
        });
        agents.chain(lights)
    }

    /// Who is in it.
    pub fn names(&self) -> AgentNames {
        let agents = self.agents.iter().map(|agent| agent.name.clone());
        let lights = self.lights.iter().map(|light| light.name.clone());
        AgentNames {
            agents: agents.collect(),
            lights: lights.collect(),
            parameters: self.parameters.keys().cloned().collect(),
        }
    }

    /// What an ado that was trained in it knows of it.
    pub fn training_world(&self) -> TrainingWorld {
        TrainingWorld {
            world: self.world.clone(),
            clock: self.clock,
            names: self.names(),
            derived: self.derived.clone(),
            constants: self.constants.clone(),
            observe: self.observe.clone(),
        }
    }

    /// A joint action in words: one label per ado.
    pub fn action_label(&self, mut action: usize) -> String {
        let mut labels = Vec::new();
        for (_, actions, _) in self.action_sets() {
            labels.push(actions.label(action % actions.len()));
            action /= actions.len();
        }
        labels.join(" | ")
    }

    /// The joint actions in which all ados brake, and accelerate, hardest. `None`:
    /// there is no difference.
    pub fn brake_and_accelerate(&self) -> Option<[usize; 2]> {
        let (mut joint, mut unit) = ([0, 0], 1);
        for (_, actions, _) in self.action_sets() {
            let [brake, accelerate] = actions.hardest();
            joint = [joint[0] + unit * brake, joint[1] + unit * accelerate];
            unit *= actions.len();
        }
        (joint[0] != joint[1]).then_some(joint)
    }

    /// How far two joint actions are apart: the mean over the ados of what their
    /// own sets say, 0 to 1.
    pub fn action_distance(&self, mut a: usize, mut b: usize) -> f64 {
        let (mut sum, mut ados) = (0.0, 0.0);
        for (_, actions, _) in self.action_sets() {
            sum += actions.distance(a % actions.len(), b % actions.len());
            (a, b) = (a / actions.len(), b / actions.len());
            ados += 1.0;
        }
        if ados == 0.0 { 0.0 } else { sum / ados }
    }

    /// X_init: one axis per range in the agents' places.
    pub fn axes(&self) -> Vec<Axis> {
        let mut axes = Vec::new();
        for agent in &self.agents {
            let (what, along) = match agent.place {
                StartPlace::At { x_m, .. } => ("x", x_m),
                StartPlace::Ahead { headway_m, .. } => ("headway", headway_m),
            };
            let ranges = [
                (what, "m", along),
                ("lateral", "m", agent.lateral_m),
                ("speed", "m/s", agent.place.speed_mps()),
            ];
            for (what, unit, range) in ranges {
                axes.extend(axis(&agent.name, what, unit, range));
            }
            if let Some(plan) = agent.plan() {
                plan.map(|what, unit, range| {
                    axes.extend(axis(&agent.name, what, unit, range));
                });
            }
        }
        let drawn = self
            .parameters
            .iter()
            .filter(|(_, range)| !range.is_fixed());
        axes.extend(drawn.map(|(name, range)| Axis {
            name: name.clone(),
            unit: "",
            lo: range.lo,
            hi: range.hi,
        }));
        axes
    }
}

/// A range of somebody's as a dimension of X_init.
fn axis(agent: &str, what: &str, unit: &'static str, range: Range) -> Option<Axis> {
    (!range.is_fixed()).then(|| Axis {
        name: format!("{agent}.{what}"),
        unit,
        lo: range.lo,
        hi: range.hi,
    })
}
