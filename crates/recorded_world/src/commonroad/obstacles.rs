//! Obstacles of a scenario: their boxes, their states and what cannot be right about them.

use super::elements::{exact, identity, needed, number, point, points, position, positive_in};
use crate::opendrive::ImportError;
use crate::opendrive::error::{At, Blockers};
use crate::opendrive::tree::XmlNode;
use crate::traffic::Class;

/// Greatest number of a time step.
const MOST_STEPS: f64 = 1e9;

/// Obstacle of a scenario.
#[derive(Debug)]
pub(super) struct FileObstacle {
    pub(super) id: String,
    pub(super) at: At,
    pub(super) line: usize,
    pub(super) class: Class,
    pub(super) bounds: ObstacleBox,
    /// Position and orientation of the first state.
    pub(super) start: ObstacleStart,
    pub(super) motion: ObstacleMotion,
}

/// Box around the shape of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ObstacleBox {
    pub(super) length_m: f64,
    pub(super) width_m: f64,
    /// Middle of the box ahead and to the left of the obstacle's position.
    pub(super) centre_m: [f64; 2],
    /// Whether the shape is another one than the box.
    pub(super) is_rough: bool,
}

/// First state of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ObstacleStart {
    pub(super) position_m: [f64; 2],
    pub(super) heading_rad: f64,
    pub(super) step: f64,
}

/// Kind of an obstacle's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ObstacleMotion {
    Stands,
    /// Until a time step.
    Recorded {
        last_step: f64,
    },
    /// Sets of places instead of states.
    Predicted,
}

/// Obstacles, and those that are only listed.
#[derive(Debug, Default)]
pub(super) struct Obstacles {
    pub(super) all: Vec<FileObstacle>,
    /// Kind and line of obstacles that no world has.
    pub(super) dropped: Vec<(&'static str, usize)>,
}

impl Obstacles {
    /// Reads the obstacles of a scenario.
    pub(super) fn read(root: &XmlNode, blockers: &mut Blockers) -> Obstacles {
        let mut found = Obstacles::default();
        for node in &root.children {
            let is_dynamic = match node.name.as_str() {
                "dynamicObstacle" => true,
                "staticObstacle" => false,
                "obstacle" => {
                    let role = blockers.keep(node.inner("role"));
                    role.is_some_and(|it| it.words == "dynamic")
                }
                "phantomObstacle" => {
                    found.dropped.push(("phantom obstacles", node.line));
                    continue;
                }
                // Listed and not built, since buildings neither move nor lie
                // on lanes.
                "environmentObstacle" => {
                    found
                        .dropped
                        .push(("buildings and other surroundings", node.line));
                    continue;
                }
                _ => continue,
            };
            let Some(obstacle) = blockers.keep(obstacle(node, is_dynamic)) else {
                continue;
            };
            if found.all.iter().any(|it| it.id == obstacle.id) {
                let what = format!("a second obstacle with the id {}", obstacle.id);
                blockers.add(obstacle.at.error(what).helped("give each an id of its own"));
                continue;
            }
            found.all.push(obstacle);
        }
        found
    }

    /// Returns the first time step at which an obstacle that moves has a state.
    pub(super) fn first_step(&self) -> Option<f64> {
        let is_moving = |it: &&FileObstacle| it.motion != ObstacleMotion::Stands;
        let steps = self.all.iter().filter(is_moving).map(|it| it.start.step);
        steps.reduce(f64::min)
    }
}

fn obstacle(node: &XmlNode, is_dynamic: bool) -> Result<FileObstacle, ImportError> {
    let id = identity(node)?;
    let words = node.child("type").map_or("", |it| it.words.as_str());
    let state = node.inner("initialState")?;
    let position_m = position(state)?;
    let (start, motion) = if is_dynamic {
        let step = whole_step(state)?;
        let motion = motion(node, step)?;
        // A moving obstacle without an orientation heads along its motion.
        let heading_rad = exact(state, "orientation")?.unwrap_or_default();
        (
            ObstacleStart {
                position_m,
                heading_rad,
                step,
            },
            motion,
        )
    } else {
        let start = ObstacleStart {
            position_m,
            // An obstacle that stands has no motion from which it would
            // follow.
            heading_rad: needed(state, "orientation")?,
            step: 0.0,
        };
        (start, ObstacleMotion::Stands)
    };
    Ok(FileObstacle {
        class: class_of(words),
        bounds: bounds(node)?,
        at: node.at(),
        line: node.line,
        id,
        start,
        motion,
    })
}

/// Returns the class of an obstacle's type. A vehicle of an unknown kind is a car.
fn class_of(words: &str) -> Class {
    match words {
        "truck" | "bus" => Class::Truck,
        "motorcycle" => Class::Motorcycle,
        "bicycle" => Class::Bicycle,
        "pedestrian" => Class::Pedestrian,
        _ => Class::Car,
    }
}

/// Reads a trajectory, whose time steps follow each other.
fn motion(node: &XmlNode, first_step: f64) -> Result<ObstacleMotion, ImportError> {
    let Some(trajectory) = node.child("trajectory") else {
        return Ok(match node.child("occupancySet") {
            Some(_) => ObstacleMotion::Predicted,
            None => ObstacleMotion::Stands,
        });
    };
    let mut last_step = first_step;
    for state in trajectory.all("state") {
        let step = whole_step(state)?;
        // Steps are whole and below 2^53, so the comparison is exact.
        if step != last_step + 1.0 {
            let what = format!("time step {step} follows {last_step}");
            let help = "write a state for every time step, in order";
            return Err(state.refused(what, help));
        }
        // Read again by the recording, but only here with the line of an
        // error.
        position(state)?;
        exact(state, "orientation")?;
        last_step = step;
    }
    // Equal only without a state, because steps ascend by one.
    if last_step == first_step {
        return Err(trajectory.refused("it has no state", "add a `state`"));
    }
    Ok(ObstacleMotion::Recorded { last_step })
}

/// Returns the time step of a state.
pub(super) fn whole_step(state: &XmlNode) -> Result<f64, ImportError> {
    let step = needed(state, "time")?;
    if (0.0..=MOST_STEPS).contains(&step) && step.fract() == 0.0 {
        return Ok(step);
    }
    let what = format!("{step} is no time step");
    Err(state.refused(what, "write a whole number of time steps from 0 on"))
}

/// Returns the box around all shapes of an obstacle.
fn bounds(node: &XmlNode) -> Result<ObstacleBox, ImportError> {
    let shape = node.inner("shape")?;
    let parts = &shape.children;
    let corners: Vec<[f64; 2]> = parts
        .iter()
        .map(outline)
        .collect::<Result<Vec<_>, ImportError>>()?
        .concat();
    let range = |axis: usize| {
        let values = || corners.iter().map(|it| it[axis]);
        (values().reduce(f64::min), values().reduce(f64::max))
    };
    let ((Some(rear_m), Some(front_m)), (Some(right_m), Some(left_m))) = (range(0), range(1))
    else {
        let help = "add a `rectangle`, a `circle` or a `polygon`";
        return Err(shape.refused("there is no shape in it", help));
    };
    let (length_m, width_m) = (front_m - rear_m, left_m - right_m);
    if length_m <= 0.0 || width_m <= 0.0 {
        let what = format!("a shape of {length_m} m by {width_m} m");
        return Err(shape.refused(what, "write a shape with an extent"));
    }
    let is_box = match &parts[..] {
        [part] if part.name == "rectangle" => turn_rad(part)? == 0.0,
        _ => false,
    };
    Ok(ObstacleBox {
        length_m,
        width_m,
        centre_m: [0.5 * (front_m + rear_m), 0.5 * (left_m + right_m)],
        is_rough: !is_box,
    })
}

/// Returns the orientation of a rectangle, 0 without one.
fn turn_rad(rectangle: &XmlNode) -> Result<f64, ImportError> {
    match rectangle.child("orientation") {
        Some(turn) => number(turn),
        None => Ok(0.0),
    }
}

/// Returns the corners of a shape.
pub(super) fn outline(shape: &XmlNode) -> Result<Vec<[f64; 2]>, ImportError> {
    let centre_m = shape
        .child("center")
        .map(point)
        .transpose()?
        .unwrap_or_default();
    match shape.name.as_str() {
        "rectangle" => {
            let half_m = [
                0.5 * positive_in(shape, "length")?,
                0.5 * positive_in(shape, "width")?,
            ];
            let (sin, cos) = libm::sincos(turn_rad(shape)?);
            let corner = |[ahead, left]: [f64; 2]| {
                let (x, y) = (ahead * half_m[0], left * half_m[1]);
                [
                    centre_m[0] + cos * x - sin * y,
                    centre_m[1] + sin * x + cos * y,
                ]
            };
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            Ok(corners.map(corner).to_vec())
        }
        "circle" => {
            let radius_m = positive_in(shape, "radius")?;
            // Only the box around a shape is used, which these four points
            // span.
            let sides = [[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
            let at = |[x, y]: [f64; 2]| [centre_m[0] + radius_m * x, centre_m[1] + radius_m * y];
            Ok(sides.map(at).to_vec())
        }
        "polygon" => {
            let corners = points(shape)?;
            if corners.len() < 3 {
                return Err(shape.refused("it has fewer than three points", "add a `point`"));
            }
            Ok(corners)
        }
        other => {
            let help = "write a rectangle, a circle or a polygon";
            Err(shape.refused(format!("a `{other}` is no shape"), help))
        }
    }
}
