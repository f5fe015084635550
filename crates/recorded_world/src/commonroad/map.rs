//! Lanelets, signs and lights of a scenario.

use std::collections::BTreeMap;

use super::elements::{identity, number, number_in, points, references, shown};
use crate::ego::Phase;
use crate::opendrive::ImportError;
use crate::opendrive::error::{At, Blockers};
use crate::opendrive::tree::XmlNode;
use crate::traffic::{Path, centre_line};

/// Least distance of the points of a lanelet's middle in metres.
const STEP_M: f64 = 0.05;
/// Kinds of lanelets on which no car drives.
const NO_LANES: [&str; 8] = [
    "sidewalk",
    "crosswalk",
    "bicycleLane",
    "border",
    "parking",
    "restricted",
    "restricted_area",
    "shoulder",
];
/// Signs that limit the speed, with the value in m/s beside them.
const LIMITS: [&str; 10] = [
    "274", "274.1", "R2-1", "r301", "3.24", "R15", "C43", "B14", "Ρ-32", "B31",
];
/// Signs at which vehicles stop.
const STOPS: [&str; 4] = ["206", "R1-1", "R1-3", "r2"];

/// Lanelets, signs and lights by their identities.
#[derive(Debug, Default)]
pub(super) struct RoadMap {
    pub(super) lanelets: BTreeMap<String, MapLanelet>,
    pub(super) signs: BTreeMap<String, RoadSign>,
    pub(super) lights: BTreeMap<String, CycleLight>,
}

/// Part of a lane between two bounds.
#[derive(Debug)]
pub(super) struct MapLanelet {
    pub(super) at: At,
    pub(super) left_m: Vec<[f64; 2]>,
    pub(super) right_m: Vec<[f64; 2]>,
    pub(super) successors: Vec<String>,
    /// Lanelet beside it in the same direction.
    pub(super) left: Option<String>,
    pub(super) right: Option<String>,
    /// Speed limit in m/s that the lanelet itself has (2018b).
    pub(super) limit_mps: Option<f64>,
    pub(super) signs: Vec<String>,
    pub(super) lights: Vec<String>,
    /// Middle of its stop line, `Some(None)` at its end.
    pub(super) stop_m: Option<Option<[f64; 2]>>,
    /// Whether cars drive on it.
    pub(super) is_driven: bool,
}

/// Sign beside lanelets.
#[derive(Debug)]
pub(super) struct RoadSign {
    /// Speed limits in m/s.
    pub(super) limits_mps: Vec<f64>,
    pub(super) is_stop: bool,
    /// Whether it has a meaning that no rule states.
    pub(super) is_other: bool,
    pub(super) line: usize,
}

/// Light with the cycle of its phases.
#[derive(Debug)]
pub(super) struct CycleLight {
    pub(super) at: At,
    pub(super) line: usize,
    /// Number of time steps of each phase. Empty for a light that is not active.
    pub(super) cycle: Vec<(f64, Phase)>,
    pub(super) offset: f64,
    /// Directions for which it shows, such as `leftStraight`.
    pub(super) direction: String,
}

impl RoadMap {
    /// Reads the lanelets, signs and lights of a scenario.
    pub(super) fn read(root: &XmlNode, blockers: &mut Blockers) -> RoadMap {
        let mut map = RoadMap::default();
        for node in &root.children {
            match node.name.as_str() {
                "lanelet" => keep(&mut map.lanelets, node, lanelet(node), blockers),
                "trafficSign" => keep(&mut map.signs, node, sign(node), blockers),
                "trafficLight" => keep(&mut map.lights, node, light(node), blockers),
                _ => {}
            }
        }
        // Refused lanelets are reported already, and this would hide the
        // reason.
        if map.lanelets.is_empty() && blockers.is_empty() {
            let help = "export it with its lanelet network";
            blockers.add(root.refused("it has no lanelet", help));
        }
        map
    }

    /// Returns the speed limit in m/s on a lanelet, the least of all that apply.
    pub(super) fn limit_mps(&self, lanelet: &MapLanelet) -> Option<f64> {
        let signs = lanelet.signs.iter().filter_map(|id| self.signs.get(id));
        let limits = signs.flat_map(|it| it.limits_mps.iter().copied());
        limits.chain(lanelet.limit_mps).reduce(f64::min)
    }
}

/// Adds an element with an identity of its own.
fn keep<T>(
    all: &mut BTreeMap<String, T>,
    node: &XmlNode,
    read: Result<T, ImportError>,
    blockers: &mut Blockers,
) {
    // Both are read before anything is kept, so that one error is reported per
    // element.
    let pair = identity(node).and_then(|id| read.map(|it| (id, it)));
    let Some((id, it)) = blockers.keep(pair) else {
        return;
    };
    if all.contains_key(&id) {
        let what = format!("a second {} with the id {id}", node.name);
        blockers.add(node.refused(what, "give each an id of its own"));
        return;
    }
    all.insert(id, it);
}

fn lanelet(node: &XmlNode) -> Result<MapLanelet, ImportError> {
    let bound = |name: &str| {
        let line = node.inner(name)?;
        let points_m = points(line)?;
        if points_m.len() < 2 {
            return Err(line.refused("it has fewer than two points", "write at least two points"));
        }
        Ok(points_m)
    };
    let beside = |name: &str| {
        let found = node.child(name);
        // A neighbour in the opposite direction is no lane to change to.
        let is_same = |it: &&XmlNode| it.raw("drivingDir") == Some("same");
        let same = found.filter(is_same);
        same.map(|it| it.need("ref").map(str::to_owned)).transpose()
    };
    let mut signs = references(node, "trafficSignRef")?;
    let mut lights = references(node, "trafficLightRef")?;
    let stop = node.child("stopLine");
    if let Some(line) = stop {
        signs.extend(references(line, "trafficSignRef")?);
        lights.extend(references(line, "trafficLightRef")?);
    }
    // Sorted first, since the stop line often names the lights of its lanelet
    // again.
    lights.sort();
    lights.dedup();
    let stop_m = stop.map(points).transpose()?.map(|ends| match ends[..] {
        [a, b] => Some([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]),
        _ => None,
    });
    let limit_mps = node.child("speedLimit").map(number).transpose()?;
    let is_lane = |it: &XmlNode| !NO_LANES.contains(&it.words.as_str());
    Ok(MapLanelet {
        at: node.at(),
        left_m: bound("leftBound")?,
        right_m: bound("rightBound")?,
        successors: references(node, "successor")?,
        left: beside("adjacentLeft")?,
        right: beside("adjacentRight")?,
        // A limit of 0 stands for none in some files.
        limit_mps: limit_mps.filter(|it| *it > 0.0),
        signs,
        lights,
        stop_m,
        // A lanelet without a type is driven, since version 2018b has none.
        is_driven: node.all("laneletType").all(is_lane),
    })
}

fn sign(node: &XmlNode) -> Result<RoadSign, ImportError> {
    let mut sign = RoadSign {
        limits_mps: Vec::new(),
        is_stop: false,
        is_other: false,
        line: node.line,
    };
    for element in node.all("trafficSignElement") {
        let kind = element.inner("trafficSignID")?.words.as_str();
        if LIMITS.contains(&kind) {
            let Some(value) = element.child("additionalValue") else {
                // A limit without a value limits nothing that a formula could
                // state.
                sign.is_other = true;
                continue;
            };
            let limit_mps = number(value)?;
            if limit_mps <= 0.0 {
                let what = format!("a speed limit of {limit_mps} m/s");
                return Err(value.refused(what, "write a positive speed in m/s"));
            }
            sign.limits_mps.push(limit_mps);
        } else if STOPS.contains(&kind) {
            sign.is_stop = true;
        } else {
            sign.is_other = true;
        }
    }
    Ok(sign)
}

fn light(node: &XmlNode) -> Result<CycleLight, ImportError> {
    let cycle = node.inner("cycle")?;
    let mut phases = Vec::new();
    let mut is_active = node.child("active").is_none_or(|it| it.words != "false");
    for element in cycle.all("cycleElement") {
        let duration = element.inner("duration")?;
        let steps = number(duration)?;
        if steps < 1.0 || steps.fract() != 0.0 {
            let what = format!("a phase of {steps} time steps");
            return Err(duration.refused(what, "write a whole number from 1 on"));
        }
        let color = element.inner("color")?;
        match color.words.as_str() {
            "green" => phases.push((steps, Phase::Green)),
            "yellow" => phases.push((steps, Phase::Yellow)),
            // The ego must not pass at red-yellow either.
            "red" | "redYellow" => phases.push((steps, Phase::Red)),
            "inactive" => is_active = false,
            _ => {
                let what = format!("unknown colour `{}`", shown(color));
                let help = "write red, redYellow, green, yellow or inactive";
                return Err(color.refused(what, help));
            }
        }
    }
    if phases.is_empty() && is_active {
        return Err(cycle.refused("it has no phases", "add a `cycleElement`"));
    }
    if !is_active {
        // A light that is off shows none of the phases that it lists.
        phases.clear();
    }
    let offset = match cycle.child("timeOffset") {
        Some(_) => number_in(cycle, "timeOffset")?,
        None => 0.0,
    };
    Ok(CycleLight {
        at: node.at(),
        line: node.line,
        cycle: phases,
        offset,
        direction: node
            .child("direction")
            .map_or("all".to_owned(), |it| it.words.clone()),
    })
}

impl MapLanelet {
    /// Returns the middle of the lane.
    pub(super) fn middle(&self) -> Result<Path, ImportError> {
        let line = centre_line(&self.left_m, &self.right_m);
        Path::through(line, STEP_M).ok_or_else(|| {
            let help = "write bounds that lead along the lane";
            self.at.error("its bounds have no length").helped(help)
        })
    }

    /// Returns the mean distance of its bounds in metres.
    pub(super) fn width_m(&self) -> f64 {
        // Three places are enough for a mean, and every bound has at least two
        // points.
        let ends = |line: &[[f64; 2]]| [line[0], line[line.len() / 2], line[line.len() - 1]];
        let pairs = ends(&self.left_m).into_iter().zip(ends(&self.right_m));
        pairs.map(|(a, b)| far_m(a, b)).sum::<f64>() / 3.0
    }

    /// Returns the length of its left bound in metres.
    pub(super) fn length_m(&self) -> f64 {
        let steps = self.left_m.windows(2);
        steps.map(|it| far_m(it[0], it[1])).sum()
    }

    /// Returns whether a point is between its bounds.
    pub(super) fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let outline: Vec<[f64; 2]> = self
            .left_m
            .iter()
            .chain(self.right_m.iter().rev())
            .copied()
            .collect();
        let next = outline.iter().cycle().skip(1);
        let crosses = |(a, b): &(&[f64; 2], &[f64; 2])| {
            // One strict comparison, so that a corner on the ray counts once.
            // A level edge never divides by 0.
            (a[1] > y) != (b[1] > y) && x < a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1])
        };
        // A ray to the right leaves a polygon through an odd number of its
        // edges.
        outline.iter().zip(next).filter(crosses).count() % 2 == 1
    }
}

/// Returns the distance of two points.
pub(super) fn far_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}
