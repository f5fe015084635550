//! Init of a storyboard: initial places, initial speeds and the end of the run.

use std::collections::BTreeSet;

use super::bodies::ImportedBody;
use super::catalog::Catalogs;
use super::dropped::{DropLog, time_s, times};
use super::entity::ImportedEntity;
use super::first_story::is_timed;
use super::laws::unknown_target;
use super::places::{Placed, PositionContext};
use super::still::is_still;
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Problem of an action of the Init, and a fix.
const NO_INIT: &str = "an action of this kind is not read in Init";
const PLACES: &str =
    "place everybody by a `TeleportAction` or a trajectory, and leave the rest to events";

/// Orders the entities of an Init so that each follows those to which it is relative.
pub(super) fn ordered<'a>(privates: &[&'a XmlNode]) -> Vec<&'a XmlNode> {
    fn name(it: &XmlNode) -> &str {
        it.raw("entityRef").unwrap_or_default()
    }
    fn references<'a>(node: &'a XmlNode, all: &mut BTreeSet<&'a str>) {
        if node.name != "Private" {
            all.extend(node.raw("entityRef"));
        }
        node.children
            .iter()
            .for_each(|child| references(child, all));
    }
    // Searched once: a search for every pair of many entities takes minutes.
    let referring = privates.iter().map(|it| {
        let mut all = BTreeSet::new();
        references(it, &mut all);
        (*it, all)
    });
    let mut left: Vec<(&XmlNode, BTreeSet<&str>)> = referring.collect();
    let mut all = Vec::new();
    while !left.is_empty() {
        let is_free = |(it, to): &(&XmlNode, BTreeSet<&str>)| {
            let mut others = left.iter().filter(|(other, _)| name(other) != name(it));
            !others.any(|(other, _)| to.contains(name(other)))
        };
        // Places that refer to each other in a circle are refused later.
        let next = left.iter().position(is_free).unwrap_or(0);
        all.push(left.remove(next).0);
    }
    all
}

/// Returns the `Private` of every entity that exists from the start on.
///
/// An entity that the Init adds is placed there, and one that it deletes is gone. An
/// entity without a place does not exist, and is listed.
pub(super) fn present(
    init: &XmlNode,
    objects: &[&XmlNode],
    absent: &[String],
    catalogs: &Catalogs,
    blockers: &mut Blockers,
) -> Vec<XmlNode> {
    let mut present: Vec<XmlNode> = init.all("Private").cloned().collect();
    let global = init.all("GlobalAction");
    for action in global.filter_map(|it| it.child("EntityAction")) {
        let Some(name) = blockers.keep(action.need("entityRef")) else {
            continue;
        };
        let is_its = |it: &XmlNode| it.raw("entityRef") == Some(name);
        let Some(added) = action.child("AddEntityAction") else {
            present.retain(|it| !is_its(it));
            continue;
        };
        catalogs.note(
            "players that leave entities of the Init at the origin",
            added,
        );
        let mut teleport = added.clone();
        teleport.name = "TeleportAction".to_owned();
        let teleport = action.around("PrivateAction", &[], vec![teleport]);
        if let Some(private) = present.iter_mut().find(|it| is_its(it)) {
            // First, so that the other actions of the `Private` apply at this place.
            private.children.insert(0, teleport);
        } else {
            let mut private = action.clone();
            private.name = "Private".to_owned();
            private.children = vec![teleport];
            present.push(private);
        }
    }
    for object in objects {
        let Some(name) = blockers.keep(object.need("name")) else {
            continue;
        };
        let is_known = present.iter().any(|it| it.raw("entityRef") == Some(name));
        if !is_known && !absent.iter().any(|it| it == name) {
            catalogs.note("entities that are never placed", object);
        }
    }
    present
}

/// Returns the initial place of an entity, and the roads of its route.
///
/// What else moves the ego is left to the user, if the ego is.
pub(super) fn begins(
    private: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<(Placed, Vec<String>), ImportError> {
    let mut first = FirstPlace {
        private,
        name: private.need("entityRef")?,
        at: None,
        routes: Vec::new(),
    };
    // A later place may be relative to an earlier one of the same entity.
    let mut placed = ground.placed.clone();
    let mut blockers = Blockers::default();
    // An action without content does nothing.
    let actions = private.all("PrivateAction");
    for it in actions.filter_map(|it| it.children.first()) {
        placed.extend(first.at.clone().map(|at| (first.name.to_owned(), at)));
        let ground = PositionContext {
            placed: &placed,
            ..ground
        };
        blockers.keep(first.read(it, scope, ground));
    }
    blockers.none()?;
    let FirstPlace { at, routes, .. } = first;
    // An entity that the Init adds has a place and nothing else.
    let at = at.ok_or_else(|| {
        private.refused(
            "nothing says where it begins",
            "place it in Init by a `TeleportAction`",
        )
    })?;
    let mut turns = Vec::new();
    for route in routes {
        turns = ground.turns_to(route, scope, &at)?;
    }
    Ok((at, turns))
}

/// Place of an entity, as far as its Init is read.
struct FirstPlace<'a> {
    private: &'a XmlNode,
    name: &'a str,
    at: Option<Placed>,
    /// Routes, which are checked last, since the place may follow in the file.
    routes: Vec<&'a XmlNode>,
}

impl<'a> FirstPlace<'a> {
    /// Reads an action of the Init.
    fn read(
        &mut self,
        it: &'a XmlNode,
        scope: &ParameterScope,
        ground: PositionContext<'_>,
    ) -> Result<(), ImportError> {
        let is_ego = ground.ego.name == self.name;
        let is_left = ground.ego.is_left && is_ego;
        match it.name.as_str() {
            "TeleportAction" => {
                let position = it.inner("Position")?;
                let placed = ground.place(position, scope)?;
                ground.note_turned(position, &placed);
                self.at = Some(placed);
            }
            "RoutingAction" => {
                let (routing, it) = (it, it.only()?);
                match it.name.as_str() {
                    "AssignRouteAction" => self.routes.push(it),
                    "FollowTrajectoryAction" if is_timed(routing) && !is_ego => {
                        // It only moves the entity, which may stand elsewhere before.
                        let first = self
                            .at
                            .take()
                            .map_or_else(|| on_first(it, scope, ground), Ok);
                        self.at = Some(first?);
                    }
                    "FollowTrajectoryAction" => match on_trajectory(it, scope, ground) {
                        Ok(on) if !(is_left && on.turns()) => self.at = Some(on),
                        Err(error) if !is_left => return Err(error),
                        read => {
                            ground.ego.leave(self.private);
                            let first = on_first(it, scope, ground).ok();
                            self.at = first.or(self.at.take());
                            // On no lane it faces along the trajectory.
                            let at = self.at.as_mut().filter(|at| at.lane.is_none());
                            match (at, read) {
                                (Some(at), Ok(on)) => at.spot = on.spot,
                                (Some(at), Err(_)) => {
                                    let faces = first_heading_rad(it, scope, ground);
                                    at.spot.heading_rad = faces.unwrap_or(at.spot.heading_rad);
                                }
                                (None, _) => {}
                            }
                        }
                    },
                    _ if is_left => ground.ego.leave(self.private),
                    _ => return Err(it.refused(NO_INIT, PLACES)),
                }
            }
            "LongitudinalAction" => {}
            _ if is_still(it, scope, !ground.is_steered(self.name))? => {}
            _ if is_left => ground.ego.leave(self.private),
            _ => return Err(it.refused(NO_INIT, PLACES)),
        }
        Ok(())
    }
}

/// Speed in m/s with which an entity begins on a trajectory with times, if it has one.
pub(super) fn timed_mps(
    private: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Option<f64> {
    let actions = private.all("PrivateAction");
    let mut routing = actions.filter_map(|it| it.child("RoutingAction"));
    let follows = routing.find_map(|it| it.child("FollowTrajectoryAction"))?;
    // A trajectory that is not read has no known speed.
    let (_, times) = ground.followed(follows, scope, Some(0.0)).ok()?;
    match times?[..] {
        [(from_s, from_m), (to_s, to_m), ..] => Some((to_m - from_m) / (to_s - from_s)),
        _ => None,
    }
}

/// Heading in radians from the first place of a trajectory to its second.
///
/// `None` for a first place that states a heading.
fn first_heading_rad(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Option<f64> {
    fn places<'a>(node: &'a XmlNode, all: &mut Vec<&'a XmlNode>) {
        match node.name.as_str() {
            "Position" => all.push(node),
            _ => node.children.iter().for_each(|it| places(it, all)),
        }
    }
    let reference = it.child("TrajectoryRef").unwrap_or(it);
    let (trajectory, own) = ground.trajectory(reference, scope).ok()?;
    let mut all = Vec::new();
    places(&trajectory, &mut all);
    let [first, second, ..] = all[..] else {
        return None;
    };
    let place = first.children.first()?;
    if place.raw("h").is_some() || place.child("Orientation").is_some() {
        return None;
    }
    let from = ground.place(first, &own).ok()?.spot;
    let to = ground.place(second, &own).ok()?.spot;
    let (x_m, y_m) = (to.x_m - from.x_m, to.y_m - from.y_m);
    (libm::hypot(x_m, y_m) > 0.0).then(|| libm::atan2(y_m, x_m))
}

/// Place at which a trajectory begins, whatever its shape.
fn on_first(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<Placed, ImportError> {
    fn first(node: &XmlNode) -> Option<&XmlNode> {
        match node.name.as_str() {
            "Position" | "PositionStart" => Some(node),
            _ => node.children.iter().find_map(first),
        }
    }
    let (trajectory, own) = ground.trajectory(it.child("TrajectoryRef").unwrap_or(it), scope)?;
    let place = first(&trajectory).ok_or_else(|| {
        let help = "give its `Trajectory` a `Shape` with positions";
        it.refused("there is no place in it", help)
    })?;
    ground.place(place, &own)
}

fn on_trajectory(
    it: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<Placed, ImportError> {
    let (trajectory, own) = ground.trajectory(it.child("TrajectoryRef").unwrap_or(it), scope)?;
    let mut on = ground.way(&trajectory, &own)?;
    on.move_on(it, scope.number_or_zero(it, "initialDistanceOffset")?)?;
    if it
        .child("TimeReference")
        .is_some_and(|it| it.child("Timing").is_some())
    {
        let help = "follow it at the entity's speed: write <TimeReference><None/></TimeReference>";
        return Err(it.refused("a trajectory with times is not read in Init", help));
    }
    Ok(Placed {
        spot: on.spot(),
        lane: None,
        way: Some(on),
    })
}

/// Initial speed of an entity in m/s.
pub(super) fn first_speed_mps(
    private: &XmlNode,
    scope: &ParameterScope,
    before: &[ImportedEntity],
    body: Option<&ImportedBody>,
    unplaced: &[String],
) -> Result<f64, ImportError> {
    let most_mps = body.map_or(f64::INFINITY, |it| it.most_mps);
    // A later action of the Init replaces the speed of an earlier one.
    let mut speed_mps = 0.0;
    let actions = private.all("PrivateAction");
    let along = actions.filter_map(|it| it.child("LongitudinalAction"));
    for action in along.filter_map(|it| it.child("SpeedAction")) {
        let target = action.inner("SpeedActionTarget")?.only()?;
        let value = scope.number(target, "value")?;
        let target_mps = match target.name.as_str() {
            "AbsoluteTargetSpeed" => value,
            "RelativeTargetSpeed" => {
                let name = scope.text(target, "entityRef")?;
                let other = before.iter().find(|it| it.name == name);
                let other = other.ok_or_else(|| {
                    let what = format!("`{name}` is not placed before");
                    let help = "write an `AbsoluteTargetSpeed`, or place it before";
                    let follows = unplaced.contains(&name);
                    target.refused(what, help).following(follows)
                })?;
                match target.raw("speedTargetValueType") {
                    Some("factor") => value * other.speed_mps,
                    _ => value + other.speed_mps,
                }
            }
            _ => return Err(unknown_target(target)),
        };
        // A body is never faster than its greatest speed.
        speed_mps = target_mps.min(most_mps);
    }
    if speed_mps >= 0.0 {
        Ok(speed_mps)
    } else {
        let what = format!("it starts at {speed_mps} m/s");
        let help = "reversing is not read: a speed is at least 0";
        Err(private.refused(what, help))
    }
}

/// Time in seconds at which the file ends the run, if it states a time alone.
///
/// A group of times that never hold together is noted as dropped.
pub(super) fn stop_s(
    board: &XmlNode,
    scope: &ParameterScope,
    dropped: &DropLog,
) -> Result<Option<f64>, ImportError> {
    let groups = board
        .child("StopTrigger")
        .into_iter()
        .flat_map(|it| it.all("ConditionGroup"));
    let mut stop_s: Option<f64> = None;
    for group in groups {
        let Some(times) = times(group) else { continue };
        match time_s(&times, scope)? {
            // Groups are alternatives, so the earliest time ends the run.
            Some(at_s) => stop_s = Some(stop_s.map_or(at_s, |known| known.min(at_s))),
            None => dropped.note("stop conditions", group),
        }
    }
    Ok(stop_s)
}

/// Factor by which the Init scales the friction of all roads.
pub(super) fn friction_scale(
    init: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<f64, ImportError> {
    let mut scale = 1.0;
    let mut blockers = Blockers::default();
    for global in init.all("GlobalAction") {
        let Some(action) = blockers.keep(global.only()) else {
            continue;
        };
        match action.name.as_str() {
            "EnvironmentAction" => {
                let own = blockers.keep(friction_of(action, scope, ground));
                // An environment without friction keeps the factor of an earlier one.
                scale = own.flatten().unwrap_or(scale);
            }
            // Signals have no effect, and entities are added and deleted before.
            "VariableAction" | "EntityAction" | "InfrastructureAction" => {}
            _ => blockers.add(action.refused(NO_INIT, "leave it out, or make it an event")),
        }
    }
    for user in init.all("UserDefinedAction") {
        let help = "leave it out: its meaning is not in the file";
        blockers.add(user.refused(NO_INIT, help));
    }
    blockers.none()?;
    Ok(scale)
}

/// Factor by which an environment scales friction, if it states one.
pub(super) fn friction_of(
    action: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
) -> Result<Option<f64>, ImportError> {
    let it = action.only()?;
    let (environment, own) = match it.name.as_str() {
        "CatalogReference" => ground.catalogs.entry(it, scope, ground.files)?,
        _ => (it.clone(), scope.clone()),
    };
    let condition = environment
        .child("RoadCondition")
        .filter(|it| it.raw("frictionScaleFactor").is_some());
    let scale = condition.map(|it| own.number(it, "frictionScaleFactor"));
    scale.transpose()
}
