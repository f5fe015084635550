//! Obstacles of a scenario as agents with their recorded motion.

use super::bodies::{body, lever_m};
use super::drops::Drops;
use super::lane_way::EgoRoad;
use super::obstacles::{FileObstacle, ObstacleMotion, Obstacles};
use super::touching::BoxPlaces;
use crate::opendrive::error::At;
use crate::pose::Pose;
use crate::recorded_world::planned_motion::{NamedBody, PlanStep, on_path, path_of, steps_of};
use crate::road::wrapped;
use crate::scene::drive::Script;
use crate::sim::Body;
use crate::traffic::{
    FittedRoad, PIECE_S, RecordedMotion, RoadUserTrack, TrafficRecording, rounded,
};
use crate::world_file::{AgentFile, DriveFile, RoadFile, StartFile};

/// Longest recorded motion in seconds that becomes a plan.
const LONGEST_S: f64 = 60.0;
/// Greatest number of obstacles, with the ego and lights below that of a world's agents.
const MOST_AGENTS: usize = 90;
/// Error of a place along the ego's road from which an obstacle gets a road of its own.
const PLACED_M: f64 = 0.01;

/// Agent of an obstacle, with the road and the body that it needs.
pub(super) struct TrafficAgent {
    pub(super) name: String,
    pub(super) id: String,
    pub(super) at: At,
    pub(super) body: Body,
    pub(super) road: Option<RoadFile>,
    pub(super) agent: AgentFile,
    /// Plan of its motion, `None` if it stands.
    pub(super) plan: Option<Vec<PlanStep>>,
    places: BoxPlaces,
}

/// Time of a scenario.
#[derive(Clone, Copy)]
pub(super) struct ScenarioTime {
    pub(super) step_s: f64,
    /// Time step of the ego's start.
    pub(super) first: f64,
    pub(super) horizon_s: f64,
}

/// Returns the agents of the obstacles, the nearest ones first.
pub(super) fn agents(
    obstacles: &Obstacles,
    recording: Option<&TrafficRecording>,
    road: &EgoRoad,
    time: ScenarioTime,
    drops: &mut Drops,
) -> Vec<TrafficAgent> {
    let first_step = obstacles.first_step().unwrap_or_default();
    let mut found: Vec<(f64, TrafficAgent)> = Vec::new();
    for obstacle in &obstacles.all {
        // Listed and not refused, since the rest of the scenario is still a
        // test.
        let Some(body) = body(obstacle.class, &obstacle.bounds) else {
            drops.add("obstacles larger or smaller than any body", obstacle.line);
            continue;
        };
        if obstacle.bounds.is_rough {
            drops.add("shapes, in place of which are their boxes", obstacle.line);
        }
        let placed = PlacedObstacle {
            obstacle,
            body: &body,
            road,
            until_s: time.horizon_s.min(LONGEST_S),
        };
        let agent = match obstacle.motion {
            ObstacleMotion::Stands if first_step.max(time.first) < obstacle.start.step => {
                drops.add("obstacles that appear after the start", obstacle.line);
                None
            }
            ObstacleMotion::Stands => placed.standing(),
            ObstacleMotion::Predicted => {
                drops.add(
                    "obstacles with sets of places instead of states",
                    obstacle.line,
                );
                None
            }
            ObstacleMotion::Recorded { last_step } => {
                let window = RecordedWindow {
                    first_step,
                    last_step,
                    time,
                };
                recording.and_then(|it| placed.moving(it, window, drops))
            }
        };
        if let Some(agent) = agent {
            let [x, y] = road.local(obstacle.start.position_m);
            found.push((libm::hypot(x, y), agent));
        }
    }
    // The sort is stable, so equal distances are in the order of the file.
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<TrafficAgent> = Vec::new();
    for (_, agent) in found {
        let obstacle = obstacles.all.iter().find(|it| it.id == agent.id);
        let line = obstacle.map_or(0, |it| it.line);
        // A contact of any two agents ends an episode, which is no fault of the ego.
        if kept.iter().any(|it| it.places.touches(&agent.places)) {
            drops.add("obstacles that touch a nearer one", line);
        // After the contacts, so that a body that is dropped takes no place.
        } else if kept.len() < MOST_AGENTS {
            kept.push(agent);
        } else {
            drops.add("obstacles beyond the nearest 90", line);
        }
    }
    kept
}

/// Time of an obstacle's states.
#[derive(Clone, Copy)]
struct RecordedWindow {
    /// First time step of all obstacles, which is sample 0 of the recording.
    first_step: f64,
    last_step: f64,
    time: ScenarioTime,
}

/// Obstacle with its body beside the ego's road.
struct PlacedObstacle<'a> {
    obstacle: &'a FileObstacle,
    body: &'a Body,
    road: &'a EgoRoad,
    /// Time until which obstacles must not touch.
    until_s: f64,
}

impl PlacedObstacle<'_> {
    /// Returns the middle of the box at a place of the obstacle.
    fn middle_m(&self, [x, y]: [f64; 2], heading_rad: f64) -> [f64; 2] {
        let [ahead, left] = self.obstacle.bounds.centre_m;
        let (sin, cos) = libm::sincos(heading_rad);
        [x + cos * ahead - sin * left, y + sin * ahead + cos * left]
    }

    fn agent_name(&self) -> String {
        // Names of agents have letters, digits and `_`.
        // Other signs become `_`, so that `1_2` and `12` stay apart.
        let letter = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let id: String = self.obstacle.id.chars().map(letter).collect();
        format!("{}_{id}", self.obstacle.class.name())
    }

    /// Returns an agent on a road of its own.
    fn on_own_road(
        &self,
        road: &FittedRoad,
        s_m: f64,
        speed_mps: f64,
        plan: Option<Vec<PlanStep>>,
        places: BoxPlaces,
    ) -> TrafficAgent {
        let name = self.agent_name();
        let body = NamedBody {
            name: &self.body.name,
            is_on_foot: self.body.is_on_foot(),
        };
        let drive = match &plan {
            Some(steps) => DriveFile::Script(steps.clone()),
            None if body.is_on_foot => DriveFile::Scripted(Script::Walk(Vec::new())),
            None => DriveFile::Scripted(Script::Stand),
        };
        let start = StartFile::At {
            x_m: rounded(s_m).into(),
            speed_mps: rounded(speed_mps).into(),
        };
        let origin = self.road.road.course.start();
        TrafficAgent {
            id: self.obstacle.id.clone(),
            at: self.obstacle.at.clone(),
            body: self.body.clone(),
            road: Some(path_of(self.body.width_m, road, origin)),
            agent: on_path(&name, body, &name, start, drive),
            name,
            plan,
            places,
        }
    }

    fn places(&self, motion: &RecordedMotion, ahead_m: f64) -> BoxPlaces {
        let size_m = [self.body.length_m, self.body.width_m];
        BoxPlaces::of(motion, ahead_m, size_m, self.until_s)
    }

    /// Returns the agent of an obstacle that stands.
    fn standing(&self) -> Option<TrafficAgent> {
        let start = self.obstacle.start;
        let [x_m, y_m] = self
            .road
            .local(self.middle_m(start.position_m, start.heading_rad));
        let middle = Pose {
            x_m,
            y_m,
            heading_rad: start.heading_rad,
        };
        let front = middle.ahead(self.body.half_length_m());
        let course = &self.road.road.course;
        let on_road = course.locate(&front);
        // There and back: the coordinates along the road must lead to the same
        // place.
        let again = course.pose(on_road.s_m, on_road.lateral_m);
        let off_m = libm::hypot(again.x_m - front.x_m, again.y_m - front.y_m);
        let rear = middle.ahead(-self.body.half_length_m());
        // A point that stands has a straight path with its heading.
        let motion = RecordedMotion::fit(&[[rear.x_m, rear.y_m]], rear.heading_rad, 1.0)?;
        let places = self.places(&motion, self.body.half_length_m());
        // Far beside a bend the road leads to no place, or to another one.
        if self.body.is_on_foot() || off_m > PLACED_M {
            return Some(self.on_own_road(&motion.road, self.body.length_m, 0.0, None, places));
        }
        let name = self.agent_name();
        Some(TrafficAgent {
            id: self.obstacle.id.clone(),
            at: self.obstacle.at.clone(),
            body: self.body.clone(),
            road: None,
            agent: AgentFile::Obstacle {
                name: name.clone(),
                body: self.body.name.clone(),
                road: None,
                s_m: rounded(on_road.s_m).into(),
                lateral_m: rounded(on_road.lateral_m).into(),
                heading_rad: rounded(wrapped(on_road.heading_rad)),
            },
            name,
            plan: None,
            places,
        })
    }

    /// Returns the agent of a recorded obstacle from the ego's start on.
    fn moving(
        &self,
        recording: &TrafficRecording,
        window: RecordedWindow,
        drops: &mut Drops,
    ) -> Option<TrafficAgent> {
        let RecordedWindow {
            first_step,
            last_step,
            time,
        } = window;
        let line = self.obstacle.line;
        if self.obstacle.start.step > time.first {
            drops.add("obstacles that appear after the start", line);
            return None;
        }
        // A single state is no motion to follow.
        if last_step <= time.first {
            drops.add("obstacles that vanish before the start", line);
            return None;
        }
        let dt_s = recording.dt_s;
        // The grid of the recording begins with the first state of any
        // obstacle.
        let sample = ((time.first - first_step) * time.step_s / dt_s).round() as usize;
        let is_there = |it: &&RoadUserTrack| {
            it.id == self.obstacle.id && (it.first_sample..it.end_sample()).contains(&sample)
        };
        let Some(track) = recording.tracks.iter().find(is_there) else {
            drops.add("obstacles that move as no road user does", line);
            return None;
        };
        let from = sample - track.first_sample;
        // One more sample, so that the last piece is whole.
        let most = (time.horizon_s.min(LONGEST_S) / dt_s).round() as usize + 1;
        let end = (from + most).min(track.len());
        // Plans move the rear axle, and files state another point.
        let back_m = lever_m(self.body) - self.body.half_length_m();
        let point = |i: usize| {
            let heading_rad = track.heading_rad[i];
            let at_m = [
                track.x_m[i] + recording.origin_m[0],
                track.y_m[i] + recording.origin_m[1],
            ];
            let [x, y] = self.road.local(self.middle_m(at_m, heading_rad));
            let (sin, cos) = libm::sincos(heading_rad);
            [x - back_m * cos, y - back_m * sin]
        };
        let points: Vec<[f64; 2]> = (from..end).map(point).collect();
        let Some(motion) = RecordedMotion::fit(&points, track.heading_rad[from], dt_s) else {
            drops.add("obstacles whose motion no plan repeats within 0.1 m", line);
            return None;
        };
        // A plan has whole pieces.
        if (end - from - 1) as f64 * dt_s + PIECE_S < time.horizon_s {
            drops.add("ends of records, after which obstacles drive on", line);
        }
        let s_m = motion.s_m + lever_m(self.body);
        let speed_mps = motion.speed.as_ref().map_or(0.0, |it| it.start_mps);
        let plan = motion.speed.as_ref().map(steps_of);
        let places = self.places(&motion, back_m);
        Some(self.on_own_road(&motion.road, s_m, speed_mps, plan, places))
    }
}
