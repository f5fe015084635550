//! World of a scenario as a value, and its text.

use super::drops::Drops;
use super::lane_way::EgoRoad;
use super::laws::{EgoOnWay, NamedFormula, SAMPLE_S, goal_m, no_contact};
use super::map::RoadMap;
use super::obstacles::Obstacles;
use super::problem::PlanningProblem;
use super::request::CommonRoadImport;
use super::route::EgoRoute;
use super::traffic_agents::{ScenarioTime, TrafficAgent, agents};
use crate::ego::{Actuated, ControllerSpec, Idm};
use crate::opendrive::ImportError;
use crate::opendrive::error::At;
use crate::opendrive::tree::XmlNode;
use crate::pose::Pose;
use crate::recorded_world::planned_motion::{own_road, rule};
use crate::ron_file::Ordered;
use crate::rulebook::JudgeKind;
use crate::scene::Clock;
use crate::scene::drive::{Actions, Deviation, LaneKeeping, MotionPlan};
use crate::sim::{Body, PlantKind};
use crate::traffic::{TrafficRecording, rounded};
use crate::world_file::{AdoFile, AgentFile, DriveFile, ScenarioFile, StartFile, WorldFile, text};

/// Body of the ego: vehicle 2 of CommonRoad's vehicle models, as files have none.
const EGO_BODY: &str = "bmw_320i";
/// Time between decisions in seconds, of which a horizon is a multiple.
const HORIZON_STEP_S: f64 = 0.5;
/// Way beyond the goal, and least time to drive ahead without one.
const BEYOND_M: f64 = 100.0;
/// Heading beside that of the road which is listed, 10°.
const TURNED_RAD: f64 = 0.17;
/// Least desired speed in m/s.
const LEAST_MPS: f64 = 1.0;

/// Parts of a scenario, all of them read.
#[derive(Clone, Copy)]
pub(super) struct ScenarioParts<'a> {
    pub(super) root: &'a XmlNode,
    pub(super) step_s: f64,
    pub(super) map: &'a RoadMap,
    pub(super) obstacles: &'a Obstacles,
    pub(super) problem: &'a PlanningProblem,
}

/// Text of a world with the offsets at which the parts of elements begin.
pub(super) struct WorldText {
    pub(super) text: String,
    pub(super) places: Vec<(usize, At)>,
}

impl ScenarioParts<'_> {
    /// Returns the duration in seconds until the last goal, in whole decisions.
    fn horizon_s(&self) -> f64 {
        let lasts = self.problem.goals.iter().map(|it| it.steps.most);
        let last = lasts.fold(0.0, f64::max) - self.problem.step;
        // The tolerance keeps a product just above a whole number of decisions.
        (last * self.step_s / HORIZON_STEP_S - 1e-6).ceil().max(1.0) * HORIZON_STEP_S
    }

    /// Fits the road of the ego.
    pub(super) fn road(&self) -> Result<EgoRoad, ImportError> {
        let problem = self.problem;
        let least_m = goal_m(self.map, problem).unwrap_or_default()
            // Bounded, so that a hostile speed or time asks for no endless
            // road.
            + problem.speed_mps.min(50.0) * self.horizon_s().min(60.0)
            + BEYOND_M;
        let route = EgoRoute::find(self.map, problem, least_m)?;
        if route.misses_goal {
            let what = "no way over lanelets leads to the goal";
            let help = "connect its lanelet by `successor` or `adjacentLeft`, or move the goal";
            return Err(problem.goals[0].at.error(what).helped(help));
        }
        EgoRoad::along(self.map, &route, problem)
    }

    /// Returns the world.
    pub(super) fn world(
        &self,
        request: &CommonRoadImport<'_>,
        road: &EgoRoad,
        recording: Option<&TrafficRecording>,
        drops: &mut Drops,
    ) -> Result<WorldText, ImportError> {
        let problem = self.problem;
        let time = ScenarioTime {
            step_s: self.step_s,
            first: problem.step,
            horizon_s: self.horizon_s(),
        };
        let Some(body) = Body::shipped(EGO_BODY).and_then(Result::ok) else {
            // Invariant: shipped bodies parse.
            return Err(self.root.error("the ego's body is missing"));
        };
        let middle = Pose {
            x_m: 0.0,
            y_m: 0.0,
            heading_rad: problem.heading_rad,
        };
        // Positions of the file are middles, and a start is that of the front.
        let front = road.road.course.locate(&middle.ahead(body.half_length_m()));
        let ego = EgoOnWay {
            map: self.map,
            road,
            problem,
            time,
            front_m: front.s_m,
            length_m: body.length_m,
        };
        self.list_start(&ego, drops);
        let mut traffic = agents(self.obstacles, recording, road, time, drops);
        if let Some(ado) = request.ado {
            self.choose_ado(ado, &mut traffic)?;
        }
        let lights = ego.lights(drops);
        self.list_signs(road, drops);
        let formulas = self.formulas(&ego, &traffic, &lights, drops);
        // An ado may block the way, which is no failure of the ego.
        let is_rule = |it: &&NamedFormula| it.name != "goal" || request.ado.is_none();
        let rules: Vec<&str> = formulas.iter().filter(is_rule).map(|it| it.name).collect();
        // A world that nothing can violate would pass every ego.
        if rules.is_empty() {
            let what = "it has nothing that the ego could violate";
            let help = "add an obstacle, a speed limit, or a place or a velocity of the goal";
            return Err(problem.at.error(what).helped(help));
        }
        let clock = Clock {
            horizon_s: time.horizon_s,
            decision_s: HORIZON_STEP_S,
            sample_s: SAMPLE_S,
            substeps: 4,
        };
        let mut all = vec![self.ego_agent(&ego, front.lateral_m)];
        let others = traffic.iter().map(|it| (it.name.clone(), it.at.clone()));
        let places: Vec<(String, At)> = others
            .chain(lights.iter().map(|it| (it.name.clone(), it.at.clone())))
            .chain([("ego".to_owned(), problem.at.clone())])
            .collect();
        all.extend(traffic.iter().map(|it| it.agent.clone()));
        all.extend(lights.into_iter().map(|it| it.agent));
        let benchmark = self.benchmark();
        let question = format!(
            "Does the ego solve planning problem {} of {benchmark}?",
            plain(&problem.id)
        );
        let limit_mps = ego.least_limit_mps().map(rounded);
        let own_road = own_road(&road.road, road.lanes, road.lane_width_m, limit_mps);
        let spec = rules.join(" and ");
        let mut world = ScenarioFile::new(request.name, question, clock, own_road, all, spec);
        let file = request.scenario.file_name().unwrap_or_default();
        world.source = format!("{}: {benchmark}", plain(&file.to_string_lossy()));
        // Recorded motion is played exactly only without forces.
        world.plant = PlantKind::Kinematic;
        world.judge = JudgeKind::UntilContact;
        let roads = traffic
            .iter()
            .filter_map(|it| Some((it.name.clone(), it.road.clone()?)));
        world.roads = Ordered(roads.collect());
        let bodies = traffic
            .iter()
            .map(|it| (it.body.name.clone(), it.body.clone()));
        world.bodies = Ordered(bodies.collect());
        let named = formulas.into_iter().map(|it| (it.name.to_owned(), it.stl));
        world.formulas = Ordered(named.collect());
        let text = text(&WorldFile::Scenario(Box::new(world)))
            .map_err(|error| self.root.error(error.to_string()))?;
        Ok(WorldText {
            places: offsets(&text, &places),
            text,
        })
    }

    fn benchmark(&self) -> String {
        plain(self.root.raw("benchmarkID").unwrap_or("a scenario"))
    }

    fn list_start(&self, ego: &EgoOnWay<'_>, drops: &mut Drops) {
        let problem = self.problem;
        let at = ego.road.place(problem.position_m);
        let turned_rad = crate::road::wrapped(problem.heading_rad + at.heading_rad);
        if turned_rad.abs() > TURNED_RAD {
            drops.add(
                "orientation of the ego's start beside that of its lane",
                problem.line,
            );
        }
        if problem.is_turning {
            drops.add("turn and slip of the ego's start", problem.line);
        }
        let reach_m = ego.front_m + problem.speed_mps * ego.time.horizon_s;
        if goal_m(self.map, problem).is_none() && ego.road.length_m < reach_m {
            drops.add(
                "ends of the lanelets, from which the road is straight",
                problem.line,
            );
        }
        for (kind, line) in &self.obstacles.dropped {
            drops.add(kind, *line);
        }
    }

    /// Lists signs of which no rule is made.
    fn list_signs(&self, road: &EgoRoad, drops: &mut Drops) {
        let lanelets = road
            .parts
            .iter()
            .filter_map(|it| self.map.lanelets.get(&it.id));
        let used: Vec<&String> = lanelets.flat_map(|it| &it.signs).collect();
        for (id, sign) in &self.map.signs {
            if sign.is_other {
                drops.add("traffic signs that no rule states", sign.line);
            } else if !used.contains(&id) {
                drops.add("traffic signs beside the ego's way", sign.line);
            }
        }
    }

    fn formulas(
        &self,
        ego: &EgoOnWay<'_>,
        traffic: &[TrafficAgent],
        lights: &[super::laws::LightAgent],
        drops: &mut Drops,
    ) -> Vec<NamedFormula> {
        let passes = lights.iter().map(|it| {
            let name = &it.name;
            format!("not ({name}.red and rise(ego.{name}.line < 0))")
        });
        let reds: Vec<String> = passes.collect();
        let red = (!reds.is_empty()).then(|| NamedFormula {
            name: "no_red_light",
            stl: format!("always ({})", reds.join(" and ")),
        });
        let all = [
            no_contact(traffic.iter().map(|it| &*it.name)),
            ego.speed_limits(drops),
            ego.stops(),
            red,
            ego.goal(drops),
        ];
        all.into_iter().flatten().collect()
    }

    fn ego_agent(&self, ego: &EgoOnWay<'_>, lateral_m: f64) -> AgentFile {
        let road = ego.road;
        let speed_mps = self.problem.speed_mps;
        let middle_m = road.ego_lane as f64 * road.lane_width_m;
        let middles = self
            .problem
            .goals
            .iter()
            .map(|it| 0.5 * (it.steps.least + it.steps.most));
        let mean_s = middles.fold(0.0, f64::max) * self.step_s;
        // Fast enough to arrive in the middle of the goal's interval.
        let wish_mps = match goal_m(self.map, self.problem) {
            Some(way_m) if mean_s > 0.0 => (way_m / mean_s).max(speed_mps),
            _ => speed_mps,
        };
        let limit_mps = ego.least_limit_mps().unwrap_or(f64::INFINITY);
        let idm = Idm {
            desired_speed_mps: rounded(wish_mps.min(limit_mps).max(LEAST_MPS)),
            time_gap_s: 1.2,
            min_gap_m: 2.0,
            max_accel_mps2: 1.5,
            comfort_brake_mps2: 2.5,
            max_brake_mps2: 7.0,
        };
        AgentFile::Vehicle {
            name: "ego".to_owned(),
            body: EGO_BODY.to_owned(),
            road: None,
            lane: road.ego_lane,
            direction: Default::default(),
            lane_keeping: LaneKeeping::RearAxle,
            offset_m: rounded(lateral_m - middle_m).into(),
            start: StartFile::At {
                x_m: rounded(ego.front_m).into(),
                speed_mps: rounded(speed_mps).into(),
            },
            drive: DriveFile::Ego(Actuated {
                controller: ControllerSpec::from(idm),
                lag_s: 0.3,
            }),
        }
    }

    /// Turns an obstacle into an ado that may stray from its recording.
    fn choose_ado(&self, ado: &str, traffic: &mut [TrafficAgent]) -> Result<(), ImportError> {
        let names: Vec<&str> = traffic
            .iter()
            .filter(|it| it.plan.is_some())
            .map(|it| &*it.id)
            // A message of hundreds of names helps no reader.
            .take(20)
            .collect();
        let help = format!("name one of {}", names.join(", "));
        let found = traffic.iter_mut().find(|it| it.id == ado || it.name == ado);
        let Some(agent) = found else {
            let what = format!("no obstacle `{ado}` is an agent of the world");
            return Err(self.root.refused(what, &help));
        };
        let Some(plan) = agent.plan.clone() else {
            let what = format!("obstacle `{ado}` stands, so it cannot stray from a plan");
            return Err(agent.at.error(what).helped(&help));
        };
        let name = agent.name.clone();
        let file = AdoFile {
            base: Some(MotionPlan::Script(plan)),
            actions: Actions::Deviate(Deviation {
                accelerations: vec![-1.0, 0.0, 1.0],
                lateral_mps: vec![0.0],
            }),
            neutral: 1,
            observe: None,
            rulebook: vec![
                rule(
                    "stays near its recording",
                    format!("always ({name}.s - {name}.planned.s in [-10, 10])"),
                ),
                rule("never reverses", format!("always ({name}.speed >= -0.1)")),
            ],
            learner: None,
            lag_s: 0.0,
        };
        if let AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } =
            &mut agent.agent
        {
            *drive = DriveFile::Ado(file);
        }
        Ok(())
    }
}

/// Returns where the parts of agents begin in a text: at each mention of their names.
fn offsets(text: &str, names: &[(String, At)]) -> Vec<(usize, At)> {
    let mut found = Vec::new();
    for (name, at) in names {
        let quoted = format!("\"{name}\"");
        let mentions = text.match_indices(&quoted).map(|it| it.0);
        found.extend(mentions.map(|offset| (offset, at.clone())));
    }
    // In the order of the text, in which a later error is looked up.
    found.sort_by_key(|it| it.0);
    found
}

/// Returns letters, digits and signs of a foreign text, cut to a line.
fn plain(text: &str) -> String {
    let is_plain = |it: &char| it.is_alphanumeric() || "-_.: ".contains(*it);
    // Foreign text may hold quotes, line ends and control characters.
    text.chars().filter(is_plain).take(80).collect()
}
