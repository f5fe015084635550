//! Agents of a driving world: names, bodies, places and drives.

use core::f64::consts::{FRAC_PI_2, PI};

use indexmap::IndexMap;

use super::RuleSpec;
use super::ado_actions::{self, ActsAs};
use super::bodies;
use super::check;
use super::language::rule_of;
use super::obstacles;
use super::plans;
use super::road_ado;
use super::roads;
use super::runs::WorldOrigin;
use super::storyboards;
use super::trained;
use super::trained::rules::JudgedAdo;
use super::weather;
use crate::rl::LearnerSettings;
use crate::road::{Direction, PlacedRoads, Road};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{
    Agent, Drive, EgoDrive, Light, MotionPlan, Range, RoadAdo, StartPlace, TrainedAdo, TurnsAdo,
    Weather,
};
use crate::world_file::{
    AdoFile, AgentFile, DriveFile, Facing, NumberOrRange, ScenarioFile, StartFile, TrainedFile,
};

/// Greatest start offset of a vehicle from the middle of its lane, in metres.
const MAX_OFFSET_M: f64 = 20.0;

/// Agents of a world file, with the observations and rules of their ados.
pub(super) struct Agents<'a> {
    pub(super) agents: Vec<Agent>,
    /// Controller of the ego.
    pub(super) ego: Option<EgoDrive>,
    /// Position of each agent in the file's list.
    pub(super) entries: Vec<usize>,
    pub(super) lights: Vec<Light>,
    /// Position of each light in the file's list.
    pub(super) light_entries: Vec<usize>,
    pub(super) weather: Option<Weather>,
    /// Ado that gives turns, with its place in the file.
    pub(super) turns: Option<(TurnsAdo, ValuePath)>,
    /// Road that an ado lays, with its place in the file.
    pub(super) road_ado: Option<(RoadAdo, ValuePath)>,
    pub(super) observed: Vec<(String, ValuePath)>,
    /// Place of the first ado's observations in the file.
    pub(super) observe: Option<ValuePath>,
    /// True if an ado has no `observe` and gets the default observation.
    pub(super) sees_usual: bool,
    /// Signals that an ado lists for itself, by its name.
    pub(super) own_observe: IndexMap<String, Vec<String>>,
    /// Learners of single ados by name, with their places in the file.
    pub(super) learners: Vec<(String, ValuePath, LearnerSettings)>,
    /// Rules of all ados, in the order of the file.
    pub(super) rules: Vec<RuleSpec>,
    /// Trained ados whose rules are judged.
    pub(super) judged: Vec<JudgedAdo>,
    /// Values to replace in the text.
    pub(super) written_out: Vec<(ValuePath, String)>,
    /// Names of the road users so far, including invalid agents.
    declared: Vec<String>,
    /// True if the world has a storyboard.
    has_story: bool,
    /// The world's own road, and the named roads.
    roads: (&'a Road, &'a PlacedRoads),
    origin: WorldOrigin<'a>,
}

impl Agents<'_> {
    /// Reads all agents and reports their mistakes.
    pub(super) fn read<'a>(
        problems: &mut Problems,
        origin: WorldOrigin<'a>,
        file: &ScenarioFile,
        roads: (&'a Road, &'a PlacedRoads),
    ) -> Agents<'a> {
        let list = ValuePath::top().to("agents");
        let mut read = Agents {
            agents: Vec::new(),
            ego: None,
            entries: Vec::new(),
            lights: Vec::new(),
            light_entries: Vec::new(),
            weather: None,
            road_ado: None,
            turns: None,
            observed: Vec::new(),
            observe: None,
            sees_usual: false,
            own_observe: IndexMap::new(),
            learners: Vec::new(),
            rules: Vec::new(),
            judged: Vec::new(),
            written_out: Vec::new(),
            declared: Vec::new(),
            has_story: file.storyboard.is_some(),
            roads,
            origin,
        };
        bodies::check(problems, &file.bodies);
        for (i, entry) in file.agents.iter().enumerate() {
            let path = list.at(i);
            check::agent_name(problems, &path.to("name"), entry.name());
            // All agents share one name space, that of signals.
            let mut before = file.agents[..i].iter();
            if before.any(|other| other.name() == entry.name()) {
                // The later one is marked, because references in between mean the
                // earlier one.
                let what = format!("two agents are called `{}`", entry.name());
                let help = "give each a name of its own".to_owned();
                problems.add(&path.to("name"), what, "second one", Some(help));
            }
            match entry {
                AgentFile::Light { .. } => {
                    if let Some(light) = read.light(problems, &path, file, entry) {
                        read.light_entries.push(i);
                        read.lights.push(light);
                    }
                }
                AgentFile::Weather(entry) => {
                    let drive = path.to("drive");
                    ado_actions::check(problems, &drive, entry.drive.ado(), ActsAs::Weather);
                    // In the order of the file, which ranks the rules without a
                    // priority.
                    read.rules_of(problems, &drive, &entry.name, entry.drive.ado());
                    let weather = weather::read(problems, &path, file, entry);
                    if read.weather.replace(weather).is_some() {
                        weather::second(problems, &path);
                    }
                }
                AgentFile::Road(entry) => {
                    let drive = path.to("drive");
                    ado_actions::check(problems, &drive, entry.drive.ado(), ActsAs::Road);
                    read.rules_of(problems, &drive, &entry.name, entry.drive.ado());
                    let road = road_ado::read(problems, &path, file, entry);
                    if read.road_ado.replace((road, path.clone())).is_some() {
                        road_ado::second(problems, &path);
                    }
                }
                AgentFile::Turns { name, drive } => {
                    let place = path.to("drive");
                    ado_actions::check(problems, &place, drive.ado(), ActsAs::Turns);
                    read.rules_of(problems, &place, name, drive.ado());
                    let turns = TurnsAdo {
                        name: name.clone(),
                        actions: drive.ado().actions.clone(),
                        neutral: drive.ado().neutral,
                    };
                    if read.turns.replace((turns, path.clone())).is_some() {
                        let what = "a world has at most one agent that gives turns".to_owned();
                        problems.add(&path, what, "second one", None);
                    }
                }
                _ => {
                    if let Some(agent) = read.road_user(problems, &path, file, entry) {
                        read.agents.push(agent);
                        read.entries.push(i);
                    }
                    // Invalid agents are declared as well, so that a reference
                    // to them is no second error.
                    read.declared.push(entry.name().to_owned());
                }
            }
        }
        read.count(problems, &list);
        read
    }

    fn count(&self, problems: &mut Problems, list: &ValuePath) {
        let drives = self.agents.iter().map(|agent| &agent.drive);
        let egos = drives.filter(|d| matches!(d, Drive::Ego)).count();
        // Agents with an invalid body or place are missing here, and were
        // reported.
        if egos != 1 && problems.is_empty() {
            let what = format!("a world has exactly one ego, not {egos}");
            let help = "one agent has `drive: Ego(…)`".to_owned();
            problems.add(list, what, "these agents", Some(help));
        }
    }

    fn road_user(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        file: &ScenarioFile,
        entry: &AgentFile,
    ) -> Option<Agent> {
        let number = roads::number(problems, path, file, entry)?;
        if let AgentFile::Obstacle { .. } = entry {
            return obstacles::read(problems, path, file, entry, number);
        }
        // Number 0 is the world's own road, and named roads follow from 1.
        let (own, named) = self.roads;
        let road = match number.checked_sub(1).and_then(|i| named.get_index(i)) {
            Some((_, placed)) => &placed.road,
            None => own,
        };
        let (name, body, lateral_m, (direction, facing_rad), start, drive) = match entry {
            AgentFile::Vehicle {
                name,
                body,
                road: _,
                lane,
                direction,
                lane_keeping: _,
                offset_m,
                start,
                drive,
            } => {
                if road.lanes() <= *lane {
                    let what = match road.lanes() {
                        1 => format!("lane {lane} on a road of 1 lane"),
                        lanes => format!("lane {lane} on a road of {lanes} lanes"),
                    };
                    let help = "lanes count from the right, from 0".to_owned();
                    problems.add(&path.to("lane"), what, "no such lane", Some(help));
                }
                let lateral_m = beside(problems, path, road.lane_middle_m(*lane), *offset_m);
                let facing_rad = match direction {
                    Direction::With => 0.0,
                    Direction::Against => PI,
                };
                (
                    name,
                    body,
                    lateral_m,
                    (*direction, facing_rad),
                    start,
                    drive,
                )
            }
            AgentFile::Pedestrian {
                name,
                body,
                road: _,
                lateral_m,
                facing,
                start,
                drive,
            } => {
                check::range(problems, &path.to("lateral_m"), lateral_m.0);
                let facing_rad = match facing {
                    Facing::Left => FRAC_PI_2,
                    Facing::Right => -FRAC_PI_2,
                    Facing::Ahead => 0.0,
                    Facing::Back => PI,
                };
                let facing = (Direction::With, facing_rad);
                (name, body, lateral_m.0, facing, start, drive)
            }
            // Invariant: obstacles returned above, and the caller handles
            // lights, weather and the road.
            AgentFile::Obstacle { .. }
            | AgentFile::Light { .. }
            | AgentFile::Weather(_)
            | AgentFile::Road(_)
            | AgentFile::Turns { .. } => return None,
        };
        if let DriveFile::Ego(_) = drive {
            roads::ego_on_its_own(problems, path, entry);
        }
        // Read before the body, so that mistakes in both are reported.
        let place = self.place(problems, &path.to("start"), start, number);
        let on_foot = matches!(entry, AgentFile::Pedestrian { .. });
        let place_of_body = path.to("body");
        let body = bodies::find_or_similar(problems, &place_of_body, &file.bodies, body, on_foot)?;
        let acts_as = ActsAs::from(body.control());
        if on_foot != (acts_as == ActsAs::Walker) {
            let what = if on_foot {
                format!("`{}` is no body on foot", body.name)
            } else {
                format!("`{}` is no vehicle", body.name)
            };
            let help = "vehicles are `Vehicle(…)`, those on foot `Pedestrian(…)`".to_owned();
            problems.add(&path.to("body"), what, "here", Some(help));
        }
        bodies::check_cyclist(problems, path, &body, drive, place.as_ref());
        // Before a missing place ends the reading, so that mistakes of the drive are
        // found too.
        let drive = self.drive(problems, &path.to("drive"), name, drive, acts_as)?;
        Some(Agent {
            name: name.clone(),
            body,
            road: number,
            direction,
            lane_keeping: entry.lane_keeping(),
            lane: entry.lane(),
            lateral_m,
            facing_rad,
            place: place?,
            drive,
        })
    }

    fn drive(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        name: &str,
        drive: &DriveFile,
        acts_as: ActsAs,
    ) -> Option<Drive> {
        Some(match drive {
            DriveFile::Ego(controller) => {
                check::controller(problems, &path.at(0), controller);
                if acts_as != ActsAs::Vehicle {
                    let what = "controllers drive vehicles".to_owned();
                    let help = "write `Ado(actions: Walks([…]), …)` or `Scripted(Walk([…]))`";
                    problems.add(path, what, "here", Some(help.to_owned()));
                }
                // Of several egos the last stays, and `count` refuses the world.
                self.ego = Some(controller.clone().into());
                Drive::Ego
            }
            DriveFile::Scripted(script) => {
                let walks = acts_as == ActsAs::Walker;
                if script.is_on_foot() != walks {
                    let help = if walks {
                        "write `Scripted(Walk([(0.0, 0.0, 1.4)]))`: from 0 s on, to the left"
                    } else {
                        "write `ConstantSpeed`, `Profile([(0.0, -1.0)])` or `Idm(…)`"
                    };
                    let what = "this script is for another kind of body".to_owned();
                    problems.add(&path.at(0), what, "here", Some(help.to_owned()));
                }
                check::script(problems, &path.at(0), script);
                Drive::Scripted(script.clone())
            }
            DriveFile::Trained(file) => {
                Drive::Trained(self.trained(problems, path, name, file, acts_as)?)
            }
            DriveFile::Story => {
                if !self.has_story {
                    let what = "the world has no storyboard".to_owned();
                    let help = "write a `storyboard` with this agent among its `actors`";
                    problems.add(path, what, "moved by it", Some(help.to_owned()));
                }
                // Without steps of its own, so that the story alone moves it.
                Drive::Planned(MotionPlan::Script(Vec::new()))
            }
            DriveFile::Script(steps) => {
                let plan = MotionPlan::Script(steps.clone());
                Drive::Planned(plans::read(problems, &path.at(0), &plan, acts_as)?)
            }
            DriveFile::Meet(meet) => {
                let plan = MotionPlan::Meet(meet.clone());
                Drive::Planned(plans::read(problems, path, &plan, acts_as)?)
            }
            DriveFile::Ado(written) => {
                let ado = &self.with_base(written);
                ado_actions::check(problems, path, ado, acts_as);
                let base = match &ado.base {
                    Some(plan) => {
                        let place = match plan {
                            MotionPlan::Script(_) => path.to("base").at(0),
                            MotionPlan::Meet(_) => path.to("base"),
                        };
                        Some(plans::read(problems, &place, plan, acts_as)?)
                    }
                    None => None,
                };
                self.rules_of(problems, path, name, ado);
                Drive::Ado {
                    actions: ado.actions.clone(),
                    neutral: ado.neutral,
                    lag_s: ado.lag_s,
                    base,
                }
            }
        })
    }

    /// Returns an ado whose deviations are from its story if it has no other plan.
    fn with_base(&self, ado: &AdoFile) -> AdoFile {
        let mut whole = ado.clone();
        if self.has_story && storyboards::deviates_from_story(ado) {
            whole.base = Some(MotionPlan::Script(Vec::new()));
        }
        whole
    }

    pub(super) fn trained(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        name: &str,
        file: &TrainedFile,
        acts_as: ActsAs,
    ) -> Option<TrainedAdo> {
        let opened = trained::open(problems, path, self.origin, file, acts_as)?;
        self.written_out.extend(opened.written_out);
        self.judged.extend(opened.home.map(|home| JudgedAdo {
            name: name.to_owned(),
            path: path.clone(),
            trained: opened.trained.clone(),
            home,
        }));
        Some(opened.trained)
    }

    pub(super) fn rules_of(
        &mut self,
        problems: &mut Problems,
        path: &ValuePath,
        name: &str,
        ado: &AdoFile,
    ) {
        self.observe.get_or_insert_with(|| path.to("observe"));
        self.sees_usual |= ado.observe.is_none();
        if let Some(learner) = &ado.learner {
            let place = path.to("learner");
            self.learners
                .push((name.to_owned(), place, (**learner).clone()));
        }
        if let Some(signals) = &ado.observe {
            self.own_observe.insert(name.to_owned(), signals.clone());
        }
        for (j, signal) in ado.observe.iter().flatten().enumerate() {
            self.observed
                .push((signal.clone(), path.to("observe").at(j)));
        }
        for (j, rule) in ado.rulebook.iter().enumerate() {
            let place = path.to("rulebook").at(j).to("stl");
            // Counted over all ados, so that no two rules tie by their places.
            let rank = self.rules.len();
            self.rules
                .extend(rule_of(problems, place, rule, name, rank));
        }
    }

    fn place(
        &self,
        problems: &mut Problems,
        path: &ValuePath,
        start: &StartFile,
        road: usize,
    ) -> Option<StartPlace> {
        let range = |problems: &mut Problems, field: &str, value: &NumberOrRange| -> Range {
            check::range(problems, &path.to(field), value.0);
            value.0
        };
        match start {
            StartFile::At { x_m, speed_mps } => Some(StartPlace::At {
                x_m: range(problems, "x_m", x_m),
                speed_mps: range(problems, "speed_mps", speed_mps),
            }),
            StartFile::Ahead {
                of,
                headway_m,
                speed_mps,
            } => {
                let headway_m = range(problems, "headway_m", headway_m);
                let speed_mps = range(problems, "speed_mps", speed_mps);
                // Only earlier agents are known here, so that chains of
                // positions end.
                let mut agents = self.agents.iter();
                let Some(position) = agents.position(|agent| agent.name == *of) else {
                    // An invalid agent was reported already.
                    let before: Vec<&str> = self.declared.iter().map(String::as_str).collect();
                    if !before.contains(&of.as_str()) {
                        problems.unknown(&path.to("of"), "agent declared before", of, &before);
                    }
                    return None;
                };
                if self.agents[position].road != road {
                    let what = format!("`{of}` is on another road");
                    let help = "write `At(x_m: …, speed_mps: …)`, along its own road".to_owned();
                    problems.add(&path.to("of"), what, "not on this road", Some(help));
                }
                Some(StartPlace::Ahead {
                    of: position,
                    headway_m,
                    speed_mps,
                })
            }
        }
    }
}

/// Range of lateral positions for a start beside the middle of a lane.
fn beside(
    problems: &mut Problems,
    path: &ValuePath,
    middle_m: f64,
    NumberOrRange(offset): NumberOrRange,
) -> Range {
    let place = path.to("offset_m");
    check::range(problems, &place, offset);
    for value in [offset.lo, offset.hi] {
        check::within(problems, &place, value, -MAX_OFFSET_M, MAX_OFFSET_M);
    }
    if offset.is_fixed() && offset.lo == 0.0 {
        Range::fixed(middle_m)
    } else {
        Range {
            lo: middle_m + offset.lo,
            hi: middle_m + offset.hi,
        }
    }
}
