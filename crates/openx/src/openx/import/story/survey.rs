//! Motion that a storyboard may give to entities, which their roads depend on.
//!
//! Actions that only shape the start of a run become a part of it: a clear gap, a meeting,
//! a trajectory, a route, a place. The storyboard of the world leaves them out.

use std::collections::{BTreeMap, BTreeSet};

use super::begins::{EarliestBegin, earliest_begins};
use super::parts::{PartKind, StoryParts};
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::OnWay;
use crate::openx::import::entity::ImportedEntity;
use crate::openx::import::later::{SpeedBound, TimedPath};
use crate::openx::import::laws::{OWN_APPROACH, approached, gap_of};
use crate::openx::import::places::PositionContext;
use crate::openx::import::still::is_still;

/// Latest time in seconds of a meeting that counts as prepared from the start.
///
/// The protocol leaves open in which way an entity reaches its speed before that.
const SOON_S: f64 = 1.0;
/// Latest begin in seconds of a trajectory that counts as that of the run.
const SAME_S: f64 = 0.02;
/// Tolerance in metres between the start of a path and the entity's place.
const SAME_M: f64 = 0.01;
/// Share of the greatest stated speed that bounds a speed that only the run decides.
const FASTER: f64 = 1.5;

/// What became of an action before the run.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TakenAction {
    /// It is a part of the start.
    Start,
    /// It is a path of the start, along which it states durations and speeds.
    Timed {
        legs: Vec<(f64, f64)>,
        /// True for a walk, which stops at the end.
        stops: bool,
    },
    /// It is a meeting, whose end the run decides.
    Approach,
}

/// Results of a survey.
#[derive(Default)]
pub(in super::super) struct StorySurvey {
    /// Earliest begin of each element.
    pub(super) begins: Vec<EarliestBegin>,
    /// Actions that are parts of the start, by their numbers.
    pub(super) taken: BTreeMap<usize, TakenAction>,
    /// Names of the entities that are deleted at the start.
    pub gone: Vec<String>,
    /// Names of the entities to which the storyboard refers.
    pub names: BTreeSet<String>,
}

/// Kind of a trajectory of a pedestrian who then stands still.
const STAYS: &str = "walks behind the end of a trajectory";

/// Action of a storyboard that moves somebody.
struct MovingAction<'a> {
    number: usize,
    /// Element with its content, such as a `SpeedAction`.
    node: &'a XmlNode,
    begin: EarliestBegin,
}

/// Returns the content of an action, such as a `SpeedAction`, without that around it.
pub(super) fn content(action: &XmlNode) -> Result<Option<(&XmlNode, &XmlNode)>, ImportError> {
    // A second one would be lost without a word.
    if let Some(further) = action.children.get(1) {
        let help = "give each its own `Action` in this event";
        return Err(further.refused("an `Action` with more than one part is not read", help));
    }
    // An action without content does nothing.
    let Some(kind) = action.children.first() else {
        return Ok(None);
    };
    if kind.children.is_empty() && kind.name != "UserDefinedAction" {
        return Ok(None);
    }
    if kind.name == "UserDefinedAction" {
        return Ok(Some((kind, kind)));
    }
    let inner = kind.only()?;
    Ok(Some((
        kind,
        match inner.name.as_str() {
            "LongitudinalAction" | "LateralAction" | "RoutingAction" => inner.only()?,
            _ => inner,
        },
    )))
}

/// Notes what each entity may do in a storyboard, and lets it start as the storyboard says.
pub(in super::super) fn survey(
    parts: &StoryParts<'_>,
    ground: PositionContext<'_>,
    entities: &mut [ImportedEntity],
    blockers: &mut Blockers,
) -> StorySurvey {
    let begins = earliest_begins(parts, ground.changed);
    let awaited = awaited_ends(parts);
    let mut found = StorySurvey::default();
    let ego = entities.iter().find(|it| it.is_ego);
    let is_moved = |name: &str| !actions_of(parts, ground, &begins, name).is_empty();
    let coasting = ego.filter(|ego| !is_moved(&ego.name));
    let ego_mps = coasting.map(|it| it.speed_mps);
    let fastest_mps = fastest_mps(parts, entities);
    // The user's controller moves the ego, so its actions bound no speed.
    for entity in entities.iter_mut().filter(|it| !it.is_ego) {
        let actions = actions_of(parts, ground, &begins, &entity.name);
        let mut reader = EntitySurvey {
            parts,
            ground,
            entity,
            actions: &actions,
            ego_mps,
            fastest_mps,
            awaited: &awaited,
            taken: &mut found.taken,
        };
        for action in &actions {
            blockers.keep(reader.look(action));
        }
    }
    for number in parts.all(PartKind::Action) {
        let part = &parts.0[number];
        let global = part.node.child("GlobalAction");
        let entity = global.and_then(|it| it.child("EntityAction"));
        let begin = begins[number];
        let is_now = begin.is_known && begin.at_s <= 0.0;
        let deletes = |it: &&XmlNode| it.child("DeleteEntityAction").is_some();
        if let Some(action) = entity.filter(deletes).filter(|_| is_now) {
            let name = blockers.keep(part.scope.text(action, "entityRef"));
            found.gone.extend(name);
            // A deletion at the start equals a file without the entity.
            found.taken.insert(number, TakenAction::Start);
        }
    }
    found.begins = begins;
    found.names = names(parts);
    found
}

/// Elements for whose end a condition waits.
fn awaited_ends(parts: &StoryParts<'_>) -> BTreeSet<usize> {
    fn add(
        node: &XmlNode,
        scope: &ParameterScope,
        parts: &StoryParts<'_>,
        all: &mut BTreeSet<usize>,
    ) {
        let state = node.raw("state").unwrap_or_default();
        let is_end = ["endTransition", "completeState"].contains(&state);
        if node.name == "StoryboardElementStateCondition" && is_end {
            let kind = node.raw("storyboardElementType").and_then(PartKind::called);
            let name = scope.text(node, "storyboardElementRef").ok();
            let found = kind.zip(name).map(|(kind, name)| parts.named(kind, &name));
            all.extend(found.into_iter().flatten());
        }
        node.children
            .iter()
            .for_each(|child| add(child, scope, parts, all));
    }
    let mut all = BTreeSet::new();
    for part in &parts.0 {
        let triggers = ["StartTrigger", "StopTrigger"];
        for trigger in triggers.iter().filter_map(|name| part.node.child(name)) {
            add(trigger, &part.scope, parts, &mut all);
        }
    }
    all
}

/// Names of the entities to which actors, conditions and actions refer.
fn names(parts: &StoryParts<'_>) -> BTreeSet<String> {
    fn add(node: &XmlNode, scope: &ParameterScope, all: &mut BTreeSet<String>) {
        for name in ["entityRef", "masterEntityRef"] {
            let stated = node.raw(name).map(|_| scope.text(node, name));
            all.extend(stated.and_then(Result::ok));
        }
        node.children
            .iter()
            .for_each(|child| add(child, scope, all));
    }
    let mut all = BTreeSet::new();
    for part in &parts.0 {
        for child in &part.node.children {
            let is_inner = matches!(child.name.as_str(), "StartTrigger" | "StopTrigger");
            if is_inner || part.kind == PartKind::Action {
                add(child, &part.scope, &mut all);
            }
        }
        all.extend(part.actors.iter().cloned());
    }
    all
}

/// Actions that may move an entity, in the order of the file.
fn actions_of<'a>(
    parts: &StoryParts<'a>,
    ground: PositionContext<'_>,
    begins: &[EarliestBegin],
    name: &str,
) -> Vec<MovingAction<'a>> {
    let is_free = !ground.is_steered(name);
    let all = parts.all(PartKind::Action).filter_map(|number| {
        let part = &parts.0[number];
        // Problems of an action are named where the storyboard is written.
        let (kind, node) = content(part.node).ok()??;
        let is_its = part.actors.iter().any(|it| it == name);
        let moves =
            kind.name == "PrivateAction" && !is_still(node, &part.scope, is_free).unwrap_or(true);
        let begin = begins[number];
        (is_its && moves && begin.at_s < f64::INFINITY).then_some(MovingAction {
            number,
            node,
            begin,
        })
    });
    all.collect()
}

struct EntitySurvey<'a, 'b> {
    parts: &'a StoryParts<'a>,
    ground: PositionContext<'a>,
    entity: &'b mut ImportedEntity,
    actions: &'b [MovingAction<'a>],
    /// Speed of an ego that coasts.
    ego_mps: Option<f64>,
    /// Greatest speed that the file states.
    fastest_mps: f64,
    /// Elements for whose end something waits.
    awaited: &'b BTreeSet<usize>,
    taken: &'b mut BTreeMap<usize, TakenAction>,
}

impl<'a> EntitySurvey<'a, '_> {
    fn look(&mut self, action: &MovingAction<'a>) -> Result<(), ImportError> {
        let part = &self.parts.0[action.number];
        let scope = &part.scope;
        let is_alone = part.actors.len() == 1;
        let node = action.node;
        let begin = action.begin;
        let is_now = begin.is_known && begin.at_s <= 0.0 && is_alone;
        match node.name.as_str() {
            "SpeedAction" => {
                let target = node
                    .child("SpeedActionTarget")
                    .and_then(|it| it.children.first());
                self.bound(begin, target.map_or(0.0, |it| self.target_mps(it, scope)));
            }
            "SpeedProfileAction" => {
                let entries = node.all("SpeedProfileEntry");
                let speeds = entries.map(|it| scope.number(it, "speed").unwrap_or(0.0));
                let most_mps = speeds.fold(0.0, f64::max);
                let base_mps = node.raw("entityRef").map_or(0.0, |_| self.fastest_mps);
                self.bound(begin, base_mps + most_mps);
            }
            "LaneChangeAction" => {
                self.entity.later.lane_changes += 1;
                self.entity.later.acts = true;
            }
            "LaneOffsetAction" | "LateralDistanceAction" => {
                self.entity.later.keeps_aside |= node.name == "LateralDistanceAction";
                self.entity.later.offsets += 1;
                self.entity.later.acts = true;
            }
            "LongitudinalDistanceAction" => {
                let ego = &self.ground.ego.name;
                let gap_m = gap_of(node, scope, ego, self.entity.speed_mps);
                // A gap at the start is a place, which needs no action.
                match gap_m.ok().filter(|_| is_now) {
                    Some(gap_m) => {
                        self.entity.gap_m = Some(gap_m);
                        self.taken.insert(action.number, TakenAction::Start);
                    }
                    None => self.bound(begin, self.limit_mps(node, scope)),
                }
            }
            "SynchronizeAction" => {
                let is_soon = begin.is_known && begin.at_s <= SOON_S && is_alone;
                // A plan for the whole run leaves no room for another action.
                let is_approach = is_soon && self.is_only(action) && self.stands();
                let read =
                    is_approach.then(|| approached(node, scope, self.ground, self.ego_mps).ok());
                match read.flatten() {
                    Some(approach) => {
                        self.ground.catalogs.note(OWN_APPROACH, node);
                        self.entity.approach = Some(approach);
                        self.taken.insert(action.number, TakenAction::Approach);
                    }
                    None => self.bound(begin, FASTER * self.fastest_mps),
                }
            }
            "FollowTrajectoryAction" => self.trajectory(action, is_alone)?,
            "AssignRouteAction" | "AcquirePositionAction" => {
                let is_first = self.of_kind(&["AssignRouteAction", "AcquirePositionAction"]) == 1;
                let is_free = !self.is_awaited(action);
                if is_first && is_alone && is_free && self.entity.route.is_empty() {
                    let route = self.ground.turns_to(node, scope, &self.entity.placed)?;
                    // Which way a road leads matters at junctions only, which lie ahead.
                    self.entity.route = route;
                    // A route without an effect is listed as such, and its time says no more.
                    let has_turns = !self.entity.route.is_empty();
                    if has_turns && (!begin.is_known || begin.at_s > 0.0) {
                        let kind = "the time of routes, which hold from the start on";
                        self.ground.catalogs.note(kind, node);
                    }
                    self.taken.insert(action.number, TakenAction::Start);
                } else {
                    self.entity.later.acts = true;
                }
            }
            "TeleportAction" if is_now && self.of_kind(&["TeleportAction"]) == 1 => {
                let place = self.ground.place(node.inner("Position")?, scope)?;
                self.entity.placed = place;
                self.taken.insert(action.number, TakenAction::Start);
            }
            "TeleportAction" => {
                self.entity.later.acts = true;
                // It may be on another lane from then on.
                self.entity.later.offsets += 1;
            }
            _ => self.entity.later.acts = true,
        }
        Ok(())
    }

    fn bound(&mut self, begin: EarliestBegin, most_mps: f64) {
        self.entity.later.acts = true;
        self.entity.later.speeds.push(SpeedBound {
            from_s: begin.at_s,
            most_mps,
        });
    }

    /// Greatest speed in m/s to which a target may lead.
    fn target_mps(&self, target: &XmlNode, scope: &ParameterScope) -> f64 {
        let value = scope.number(target, "value").unwrap_or(0.0);
        let is_factor = target.raw("speedTargetValueType") == Some("factor");
        match target.name.as_str() {
            "AbsoluteTargetSpeed" => value,
            // Only the run knows the other's speed, and the file states no greater one.
            _ if is_factor => self.fastest_mps * value.max(0.0),
            _ => self.fastest_mps + value,
        }
    }

    /// Greatest speed in m/s of an action that keeps a distance.
    fn limit_mps(&self, action: &XmlNode, scope: &ParameterScope) -> f64 {
        let limits = action.child("DynamicConstraints");
        let limit = limits.filter(|it| it.raw("maxSpeed").is_some());
        let most_mps = limit.and_then(|it| scope.number_in(it, "maxSpeed", 0.0..=f64::MAX).ok());
        // An entity that closes a gap drives faster than the one that it follows.
        let usual_mps = FASTER * self.fastest_mps;
        most_mps.map_or(usual_mps, |most_mps| most_mps.min(usual_mps))
    }

    fn of_kind(&self, names: &[&str]) -> usize {
        let all = self.actions.iter();
        all.filter(|it| names.contains(&it.node.name.as_str()))
            .count()
    }

    fn is_only(&self, action: &MovingAction<'_>) -> bool {
        self.actions.iter().all(|it| it.number == action.number)
    }

    fn stands(&self) -> bool {
        self.entity.speed_mps == 0.0
    }

    /// Puts an entity that stands at the start of a path onto it, from the start on.
    fn trajectory(&mut self, action: &MovingAction<'a>, is_alone: bool) -> Result<(), ImportError> {
        let scope = &self.parts.0[action.number].scope;
        let begin = action.begin;
        self.entity.later.acts = true;
        let is_now = begin.is_known && begin.at_s <= SAME_S && !self.may_be_cut(action);
        let event = |number: usize| self.parts.0[number].parent;
        let mut before = self.actions.iter().filter(|it| it.number < action.number);
        // What begins together with it moves the entity on the path, too.
        let is_first = before.all(|it| event(it.number) == event(action.number));
        let is_one = self.of_kind(&["FollowTrajectoryAction"]) == 1 && is_alone;
        let begins_s = begin
            .is_known
            .then_some(if is_now { 0.0 } else { begin.at_s });
        // A vehicle goes on behind the end of a path, at a time that only the run knows.
        let is_timely = begin.is_known || self.entity.body.on_foot;
        let waits = is_first && self.stands() && is_timely && !self.may_be_cut(action);
        if is_one && (is_now || waits) {
            let followed = self.ground.followed(action.node, scope, begins_s);
            let found = followed.ok().filter(|(way, _)| self.is_at(way));
            // Without times only the run knows when it ends.
            let found = found.filter(|(_, times)| times.is_some() || !self.is_awaited(action));
            if let Some((way, times)) = found {
                self.follow(action, way, times.as_deref());
                return Ok(());
            }
        }
        self.bound(begin, FASTER * self.fastest_mps);
        self.entity.later.offsets += 1;
        Ok(())
    }

    /// Returns whether anything waits for the end of an action, or of what holds it.
    fn is_awaited(&self, action: &MovingAction<'_>) -> bool {
        let mut around = self.parts.around(action.number);
        around.any(|it| self.awaited.contains(&it))
    }

    /// Returns whether an event of the same maneuver may stop an action.
    fn may_be_cut(&self, action: &MovingAction<'_>) -> bool {
        let event = |number: usize| self.parts.0[number].parent;
        let maneuver = |number: usize| event(number).and_then(event);
        let mut others = self.actions.iter().filter(|it| {
            event(it.number) != event(action.number)
                && maneuver(it.number) == maneuver(action.number)
        });
        others.any(|it| {
            let node = event(it.number).map(|event| self.parts.0[event].node);
            let priority = node.and_then(|node| node.raw("priority"));
            matches!(priority, Some("override" | "overwrite"))
        })
    }

    fn is_at(&self, way: &OnWay) -> bool {
        let off = way.spot().sees(&self.entity.placed.spot);
        libm::hypot(off.x_m, off.y_m) <= SAME_M
    }

    fn follow(&mut self, action: &MovingAction<'a>, way: OnWay, times: Option<&[(f64, f64)]>) {
        let on_foot = self.entity.body.on_foot;
        let is_straight = way.way.piece_count() == 0;
        // The path replaces the lane, whose changes mean nothing on it.
        self.entity.placed.spot = way.spot();
        self.entity.placed.way = Some(way);
        self.entity.placed.lane = None;
        let Some(times) = times else {
            self.taken.insert(action.number, TakenAction::Start);
            return;
        };
        let legs: Vec<(f64, f64)> = times
            .windows(2)
            .map(|pair| {
                let lasts_s = pair[1].0 - pair[0].0;
                (lasts_s, (pair[1].1 - pair[0].1) / lasts_s)
            })
            .collect();
        let lasts_s: f64 = legs.iter().map(|(lasts_s, _)| lasts_s).sum();
        let stops = on_foot && is_straight;
        if stops {
            self.ground.catalogs.note(STAYS, action.node);
        }
        let begin = action.begin;
        // The order of the legs does not matter for the greatest speed.
        for (_, speed_mps) in &legs {
            self.bound(begin, *speed_mps);
        }
        let last_mps = legs.last().map_or(0.0, |(_, speed_mps)| *speed_mps);
        self.entity.later.path = Some(TimedPath {
            ends_s: begin.at_s + lasts_s,
            way_m: legs
                .iter()
                .map(|(lasts_s, speed_mps)| lasts_s * speed_mps)
                .sum(),
            last_mps: if stops { 0.0 } else { last_mps },
        });
        let taken = TakenAction::Timed { legs, stops };
        self.taken.insert(action.number, taken);
    }
}

/// Greatest of the speeds in m/s that a file states.
fn fastest_mps(parts: &StoryParts<'_>, entities: &[ImportedEntity]) -> f64 {
    fn stated_mps(node: &XmlNode, scope: &ParameterScope) -> f64 {
        let own = match node.name.as_str() {
            "AbsoluteTargetSpeed" | "AbsoluteSpeed" => scope.number(node, "value").ok(),
            "SpeedProfileEntry" => scope.number(node, "speed").ok(),
            _ => None,
        };
        let inner = node.children.iter().map(|it| stated_mps(it, scope));
        inner.fold(own.unwrap_or(0.0), f64::max)
    }
    let first = entities.iter().map(|it| it.speed_mps);
    let actions = parts.all(PartKind::Action).map(|number| &parts.0[number]);
    let later = actions.map(|part| stated_mps(part.node, &part.scope));
    first.chain(later).fold(0.0, f64::max)
}
