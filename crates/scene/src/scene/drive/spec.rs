//! Data of a driving scene: checked, without spans.

use std::sync::Arc;

use super::actions::Actions;
use super::environment::EnvironmentRange;
use super::light::{Light, LightDrive};
use super::names::AgentNames;
use super::plan::MotionPlan;
use super::range::Range;
use super::road_ado::RoadAdo;
use super::script::Script;
use super::sensors::Sensors;
use super::steering::LaneKeeping;
use super::trained::{TrainedAdo, TrainingWorld};
use super::turns_ado::TurnsAdo;
use super::weather::Weather;
use indexmap::IndexMap;

use crate::ego::{
    Actuated, Command, Controller, ControllerSpec, Maker, Process, RecordedCommands, Recorder,
    StockController, Transcripts,
};
use crate::road::{
    Bank, CourseError, Direction, Grade, PlacedRoads, Priority, Road, RoadNetwork, RoadProfile,
    Traveller,
};
use crate::scene::{Axis, Clock, Derived, Observed, Start};
use crate::sim::{Body, PlantKind, Wind};
use crate::stl::{Constants, Formula, Names};
use crate::story::check::CheckedStoryboard;

/// Initial place and speed of an agent.
#[derive(Clone, Debug, PartialEq)]
pub enum StartPlace {
    /// At a position along the road.
    At {
        /// Front bumper along the road.
        x_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
    /// Relative to an agent that precedes it in the file.
    Ahead {
        /// Position of that agent in the file.
        of: usize,
        /// Front bumper to front bumper, negative for behind.
        headway_m: Range,
        /// Initial speed.
        speed_mps: Range,
    },
}

impl StartPlace {
    /// Returns the initial speed.
    pub fn speed_mps(&self) -> Range {
        match *self {
            StartPlace::At { speed_mps, .. } | StartPlace::Ahead { speed_mps, .. } => speed_mps,
        }
    }
}

/// Creates a fresh controller, once per worker.
pub type ControllerFactory = Maker;

/// Drive of the ego: its controller and the lag of its actuator.
#[derive(Clone, Debug)]
pub struct EgoDrive {
    /// Controller whose command the actuator follows.
    pub controller: EgoController,
    /// Time constant of the first-order lag behind the command, 0 for none.
    pub lag_s: f64,
}

impl From<Actuated<ControllerSpec>> for EgoDrive {
    fn from(stock: Actuated<ControllerSpec>) -> EgoDrive {
        EgoDrive {
            controller: EgoController::Stock(stock.controller),
            lag_s: stock.lag_s,
        }
    }
}

/// Controller of the ego.
///
/// A stock controller of the world file, the user's own type, or the recorded
/// commands of an absent controller.
#[derive(Clone)]
pub enum EgoController {
    /// A stock controller of the world file.
    Stock(ControllerSpec),
    /// A Rust type implementing [`Controller`].
    Own {
        /// Name in result rows.
        name: String,
        /// Creates a controller that shares no state with earlier ones.
        factory: ControllerFactory,
        /// Make a controller anew for every episode.
        fresh: bool,
        /// Sample of its episodes. `None`: it is this crate's, and known to be repeatable.
        transcripts: Option<Transcripts>,
    },
    /// Recorded commands of a program or a user's own type, per sample.
    Recorded(Arc<[Command]>),
}

impl EgoDrive {
    /// Returns the stock controller with its actuator, if it is one.
    pub fn stock(&self) -> Option<Actuated<ControllerSpec>> {
        match &self.controller {
            EgoController::Stock(spec) => Some(Actuated {
                controller: spec.clone(),
                lag_s: self.lag_s,
            }),
            EgoController::Own { .. } | EgoController::Recorded(_) => None,
        }
    }

    /// Returns whether it is external: equal percepts may get unequal commands.
    pub fn is_foreign(&self) -> bool {
        matches!(
            self.controller,
            EgoController::Own { .. }
                | EgoController::Recorded(_)
                | EgoController::Stock(ControllerSpec(StockController::Process(_)))
        )
    }

    /// Returns whether it repeats recorded commands, regardless of percepts.
    pub fn is_recorded(&self) -> bool {
        matches!(self.controller, EgoController::Recorded(_))
    }
}

impl EgoController {
    /// Returns a controller, whose episodes are sampled if it is foreign.
    pub fn build(&self) -> Box<dyn Controller> {
        // Stock egos are deterministic, so nothing of them is recorded.
        let Some(log) = self.transcripts() else {
            return self.build_apart();
        };
        match self {
            EgoController::Own {
                factory,
                fresh: true,
                ..
            } => Box::new(Recorder::new(factory(), log).anew(Arc::clone(factory))),
            EgoController::Stock(spec) => Box::new(Recorder::new(spec.build(), log)),
            _ => Box::new(Recorder::new(self.build_apart(), log)),
        }
    }

    /// Returns a controller that shares nothing with those built before.
    pub fn build_apart(&self) -> Box<dyn Controller> {
        match self {
            EgoController::Stock(spec) => match spec.program() {
                // A process of its own, so that nothing it kept in another reaches this
                // one.
                Some(program) => Box::new(program.apart().controller()),
                None => spec.build(),
            },
            EgoController::Own { factory, .. } => factory(),
            EgoController::Recorded(commands) => {
                Box::new(RecordedCommands::new(Arc::clone(commands)))
            }
        }
    }

    /// Returns the program, if it is one.
    pub fn program(&self) -> Option<&Process> {
        match self {
            EgoController::Stock(spec) => spec.program(),
            EgoController::Own { .. } | EgoController::Recorded(_) => None,
        }
    }

    /// Returns the transcripts of a foreign ego, in which its repeatability is checked.
    pub fn transcripts(&self) -> Option<&Transcripts> {
        match self {
            EgoController::Stock(spec) => Some(spec.program()?.transcripts()),
            EgoController::Own { transcripts, .. } => transcripts.as_ref(),
            EgoController::Recorded(_) => None,
        }
    }

    /// Makes every episode begin with a new program or a new controller of yours.
    pub fn set_fresh(&mut self) {
        match self {
            EgoController::Stock(spec) => spec.set_fresh(),
            EgoController::Own { fresh, .. } => *fresh = true,
            // Recorded commands are the same from any beginning.
            EgoController::Recorded(_) => {}
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

/// A plan in a world file: numbers may be ranges, and steps have formulas.
pub type PlanSpec = MotionPlan<Range, Formula>;

/// Driver of an agent.
#[derive(Clone, Debug)]
pub enum Drive {
    /// The system under test: [`DriveSpec::ego`].
    Ego,
    /// A learning adversary.
    Ado {
        /// Action set.
        actions: Actions,
        /// Action that changes nothing.
        neutral: usize,
        /// Time constant of its acceleration, 0 for none.
        lag_s: f64,
        /// Plan from which its actions deviate, if it has one.
        base: Option<PlanSpec>,
    },
    /// An ado that was trained in a different world, frozen.
    Trained(TrainedAdo),
    /// Background traffic.
    Scripted(Script),
    /// Motion along a plan, as prescribed for targets of test protocols.
    Planned(PlanSpec),
}

/// An agent of a driving scene.
#[derive(Clone, Debug)]
pub struct Agent {
    /// Name in signals.
    pub name: String,
    /// Its body.
    pub body: Body,
    /// Its road: 0 is the world's own, the named ones follow.
    pub road: usize,
    /// Driving direction on that road.
    pub direction: Direction,
    /// Point of the vehicle that keeps the lane.
    pub lane_keeping: LaneKeeping,
    /// Lane in which it starts, 0 if its place does not depend on a lane.
    pub lane: usize,
    /// Initial offset to the left of lane 0's middle, at the nominal lane width.
    pub lateral_m: Range,
    /// Initial heading, counter-clockwise from the road's.
    pub facing_rad: f64,
    /// Initial place and speed.
    pub place: StartPlace,
    /// Driver of the agent.
    pub drive: Drive,
}

/// A driving scene, assembled from data.
#[derive(Clone, Debug)]
pub struct DriveSpec {
    /// Name of the world, which is part of the key of every start.
    pub world: String,
    /// The clocks.
    pub clock: Clock,
    /// Physics engine.
    pub plant: PlantKind,
    /// Time to play after the first contact in every episode. 0 ends the motion there.
    ///
    /// `None`: [`KEPT_AFTER_CONTACT_S`](crate::scene::KEPT_AFTER_CONTACT_S) in the
    /// episodes that are kept or shown, and nothing in the others.
    pub after_contact_s: Option<f64>,
    /// The world's own road, on which the ego drives.
    pub road: Road,
    /// Further roads, by name.
    pub roads: PlacedRoads,
    /// The world's own bodies by name. An ego variant may use one of them.
    pub bodies: IndexMap<String, Body>,
    /// The agents, in file order. Exactly one is the ego.
    pub agents: Vec<Agent>,
    /// Drive of the ego.
    pub ego: EgoDrive,
    /// Storyboard, whose agents are numbered as here.
    pub story: Option<Arc<CheckedStoryboard>>,
    /// The traffic lights, in file order.
    pub lights: Vec<Light>,
    /// Weather that an ado changes, if any.
    pub weather: Option<Weather>,
    /// Ado that lays the world's own road, if any.
    pub road_ado: Option<RoadAdo>,
    /// Ado that gives turns to the placed ados, if any.
    pub turns: Option<TurnsAdo>,
    /// Grades of the world's own road, by station.
    pub grades: Vec<Grade>,
    /// Length of the vertical curves between them.
    pub vertical_curve_m: f64,
    /// Banks of the world's own road, by station.
    pub banks: Vec<Bank>,
    /// Wind, if any.
    pub wind: Option<Wind>,
    /// Sensors of the ego.
    pub sensors: Sensors,
    /// Signals published besides the basic ones, by name.
    pub extra: Vec<String>,
    /// Signals derived from the others, in order.
    pub derived: Vec<Derived>,
    /// Constants that derived signals may use.
    pub constants: Constants,
    /// The ados' observation.
    pub observe: Vec<Observed>,
    /// Signals that an ado lists for itself, by its name.
    ///
    /// An ado that is missing here observes all of them.
    pub own_observe: IndexMap<String, Vec<String>>,
    /// Drawn parameters of a start, published as constant signals.
    pub parameters: IndexMap<String, Range>,
    /// Named formulas that triggers of plans may use.
    pub formulas: Names,
    /// Quantities of the environment that starts draw, after the parameters.
    pub environment: Vec<EnvironmentRange>,
    /// The starts, if they form a table: values in the order of the axes.
    pub points: Vec<Start>,
}

impl Agent {
    /// Returns the plan that it follows or deviates from.
    pub fn plan(&self) -> Option<&PlanSpec> {
        match &self.drive {
            Drive::Planned(plan)
            | Drive::Ado {
                base: Some(plan), ..
            } => Some(plan),
            _ => None,
        }
    }

    /// Returns its actions, if it is an ado, trained or not.
    pub fn actions(&self) -> Option<&Actions> {
        match &self.drive {
            Drive::Ado { actions, .. } | Drive::Trained(TrainedAdo { actions, .. }) => {
                Some(actions)
            }
            Drive::Ego | Drive::Scripted(_) | Drive::Planned(_) => None,
        }
    }

    /// Returns its action without effect, 0 if it has no actions.
    pub fn neutral(&self) -> usize {
        match &self.drive {
            Drive::Ado { neutral, .. } | Drive::Trained(TrainedAdo { neutral, .. }) => *neutral,
            Drive::Ego | Drive::Scripted(_) | Drive::Planned(_) => 0,
        }
    }

    /// Returns whether it moves with the world's own road, by wheel or on foot.
    ///
    /// Its place and heading are then those of traffic in lanes.
    pub fn is_with_road(&self) -> bool {
        // A parked body may face any direction, so it is not read as lane
        // traffic.
        let stands = matches!(self.drive, Drive::Scripted(Script::Stand));
        self.road == 0 && self.direction == Direction::With && !stands
    }
}

impl DriveSpec {
    /// Returns the heights of a road by its index. 0 is the world's own.
    pub fn profile_of(&self, road: usize) -> RoadProfile<'_> {
        match road {
            0 => RoadProfile {
                grades: &self.grades,
                vertical_curve_m: self.vertical_curve_m,
                banks: &self.banks,
                z_m: 0.0,
            },
            road => self.roads[road - 1].profile(),
        }
    }

    /// Returns whether any of its roads has grades or banks.
    pub fn has_slopes(&self) -> bool {
        let mut profiles = (0..=self.roads.len()).map(|road| self.profile_of(road));
        profiles.any(|it| !it.grades.is_empty() || !it.banks.is_empty())
    }

    /// Returns a road by its index. 0 is the world's own.
    pub fn road_at(&self, road: usize) -> &Road {
        match road {
            0 => &self.road,
            road => &self.roads[road - 1].road,
        }
    }

    /// Returns the road of an agent.
    pub fn road_of(&self, agent: usize) -> &Road {
        self.road_at(self.agents[agent].road)
    }

    /// Returns the lights of a road with their positions in the list.
    pub fn lights_of(&self, road: usize) -> impl Iterator<Item = (usize, &Light)> {
        let lights = self.lights.iter().enumerate();
        lights.filter(move |(_, light)| light.road == road)
    }

    /// Returns the roads of the world with the crossings between its agents' paths.
    pub(super) fn network(&self) -> Result<RoadNetwork, CourseError> {
        // The world's own road has number 0, and placed roads follow.
        let own = std::iter::once(self.road.course());
        let placed = self.roads.values().map(|placed| placed.course());
        let courses = own.chain(placed).collect::<Result<Vec<_>, _>>()?;
        let travellers = self.agents.iter().enumerate().map(|(i, agent)| Traveller {
            road: agent.road,
            // Agents are taken to drive in the middle of their range of starts:
            // crossings are fixed once per road and do not depend on the places
            // of a start.
            lateral_m: 0.5 * (agent.lateral_m.lo + agent.lateral_m.hi) + self.lane_shift_m(i),
            direction: agent.direction,
        });
        Ok(RoadNetwork::new(courses, &travellers.collect::<Vec<_>>()))
    }

    /// Returns the priorities of the roads of two agents.
    pub(super) fn priorities(&self, pair: [usize; 2]) -> [Priority; 2] {
        pair.map(|agent| match self.agents[agent].road {
            // Placed roads state theirs in relation to the world's own, which has none.
            0 => Priority::Equal,
            road => self.roads[road - 1].priority,
        })
    }

    /// Returns the positions of the agents that the ego's controller drives.
    pub fn egos(&self) -> impl Iterator<Item = usize> {
        let agents = self.agents.iter().enumerate();
        agents.filter_map(|(i, agent)| matches!(agent.drive, Drive::Ego).then_some(i))
    }

    /// Returns the ados' names, action sets and neutral actions.
    ///
    /// Road users come first, then lights, each in file order, then the weather, then the road,
    /// then the ado that gives turns.
    pub fn action_sets(&self) -> impl Iterator<Item = (&str, &Actions, usize)> {
        // This order is that of the digits of a joint action, which kept files contain.
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
        let weather = self
            .weather
            .iter()
            .map(|it| (it.name.as_str(), &it.actions, it.neutral));
        let road = self
            .road_ado
            .iter()
            .map(|it| (it.name.as_str(), &it.actions, it.neutral));
        let turns = self
            .turns
            .iter()
            .map(|it| (it.name.as_str(), &it.actions, it.neutral));
        let bodiless = weather.chain(road).chain(turns);
        agents.chain(lights).chain(bodiless)
    }

    /// Returns the trained ados by their names here, road users first.
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

    /// Returns the trained ados by their names here, to change them.
    pub fn trained_mut(&mut self) -> impl Iterator<Item = (&str, &mut TrainedAdo)> {
        let agents = self
            .agents
            .iter_mut()
            .filter_map(|agent| match &mut agent.drive {
                Drive::Trained(trained) => Some((agent.name.as_str(), trained)),
                _ => None,
            });
        let lights = self
            .lights
            .iter_mut()
            .filter_map(|light| match &mut light.drive {
                LightDrive::Trained(trained) => Some((light.name.as_str(), trained)),
                _ => None,
            });
        agents.chain(lights)
    }

    /// Returns the names of its agents, lights, weather, road and parameters.
    pub fn names(&self) -> AgentNames {
        let agents = self.agents.iter().map(|agent| agent.name.clone());
        let lights = self.lights.iter().map(|light| light.name.clone());
        AgentNames {
            agents: agents.collect(),
            lights: lights.collect(),
            weather: self.weather.as_ref().map(|weather| weather.name.clone()),
            road: self.road_ado.as_ref().map(|road| road.name.clone()),
            parameters: self.parameters.keys().cloned().collect(),
        }
    }

    /// Returns the data that an ado trained in this world needs elsewhere.
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

    /// Returns a joint action in words: a label per ado.
    pub fn action_label(&self, mut action: usize) -> String {
        let mut labels = Vec::new();
        // The first ado is the lowest digit, as in `Layout::new`.
        for (_, actions, _) in self.action_sets() {
            labels.push(actions.label(action % actions.len()));
            action /= actions.len();
        }
        labels.join(" | ")
    }

    /// Returns the joint actions in which all ados brake and accelerate hardest.
    ///
    /// `None` if the two are equal.
    pub fn brake_and_accelerate(&self) -> Option<[usize; 2]> {
        let (mut joint, mut unit) = ([0, 0], 1);
        for (_, actions, _) in self.action_sets() {
            let [brake, accelerate] = actions.hardest();
            joint = [joint[0] + unit * brake, joint[1] + unit * accelerate];
            unit *= actions.len();
        }
        // Lights and turns have one action for both, which says nothing about hardness.
        (joint[0] != joint[1]).then_some(joint)
    }

    /// Returns the distance of two joint actions, 0 to 1: the mean over the ados.
    pub fn action_distance(&self, mut a: usize, mut b: usize) -> f64 {
        let (mut sum, mut ados) = (0.0, 0.0);
        for (_, actions, _) in self.action_sets() {
            sum += actions.distance(a % actions.len(), b % actions.len());
            (a, b) = (a / actions.len(), b / actions.len());
            ados += 1.0;
        }
        // A world without ados has the empty action only.
        if ados == 0.0 { 0.0 } else { sum / ados }
    }

    /// Returns X_init: an axis per range of places, parameters and environment.
    pub fn axes(&self) -> Vec<Axis> {
        // `drawn` reads starts in the same order.
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
        // A fixed parameter is no dimension of a search.
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
        let weather = self.weather.as_ref();
        axes.extend(self.environment.iter().map(|it| it.axis(weather)));
        axes
    }
}

/// Returns the axis of an agent's range, or `None` for a fixed number.
fn axis(agent: &str, what: &str, unit: &'static str, range: Range) -> Option<Axis> {
    (!range.is_fixed()).then(|| Axis {
        name: format!("{agent}.{what}"),
        unit,
        lo: range.lo,
        hi: range.hi,
    })
}
