//! Acts of a storyboard, as sequential steps of every entity.
//!
//! A script executes one step after another. Events that repeat, or that may begin
//! before the previous event ends, are refused unless a script can express both.

mod act;
mod begin;
mod lanes;
mod script;
mod stops;
mod trajectory;

use script::{EntityScript, EventContext, happens_once};

use super::entity::{ImportedEntity, ImportedStep};
use super::joined::StartTrigger;
use super::laws::{approached, gap_of, speed, speed_profile};
use super::motion::is_still;
use super::places::PositionContext;
use super::story_element::StoryElement;
use super::triggers::starts;
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Latest time in seconds of a meeting that counts as prepared from the start.
///
/// The protocol leaves open in which way an entity reaches its speed before
/// that.
const SOON_S: f64 = 1.0;

/// Reads the acts into the steps of the entities, and removes deleted entities.
///
/// Returns the time in seconds at which an act stops, if one does, and the names of
/// entities with an event that is not read, which are removed, too.
///
/// `friction_scale` is that of the Init, which no act may change.
pub(super) fn acts(
    board: &XmlNode,
    scope: &ParameterScope,
    ground: PositionContext<'_>,
    friction_scale: f64,
    entities: &mut Vec<ImportedEntity>,
    blockers: &mut Blockers,
) -> (Option<f64>, Vec<String>) {
    let mut reader = Reader {
        ground,
        friction_scale,
        scripts: entities.iter().map(EntityScript::of).collect(),
        gone: Vec::new(),
        relative: Vec::new(),
        begun: Vec::new(),
        blockers: Blockers::default(),
        stop_s: f64::INFINITY,
    };
    for story in board.all("Story") {
        let declared = story.child("ParameterDeclarations");
        let own = ParameterScope::declared(declared, scope, &[]);
        let Some(own) = reader.blockers.keep(own) else {
            continue;
        };
        for act in story.all("Act") {
            let read = reader.act(act, &own);
            reader.blockers.keep(read);
        }
    }
    // Checked last, since a later act may contain the lane change.
    reader.lanes_stay();
    let Reader {
        scripts,
        gone,
        stop_s,
        blockers: found,
        ..
    } = reader;
    blockers.keep(found.none());
    let is_broken = |it: &&EntityScript| it.is_broken && it.name != ground.ego.name;
    let broken: Vec<String> = scripts
        .iter()
        .filter(is_broken)
        .map(|it| it.name.clone())
        .collect();
    for (entity, script) in entities.iter_mut().zip(scripts) {
        entity.steps = script.steps;
        entity.approach = script.approach;
        entity.gap_m = script.gap_m;
        entity.placed = script.placed;
    }
    entities.retain(|it| !gone.contains(&it.name) && !broken.contains(&it.name));
    (stop_s.is_finite().then_some(stop_s), broken)
}

struct Reader<'a> {
    ground: PositionContext<'a>,
    /// Factor by which the Init scales the friction of all roads.
    friction_scale: f64,
    scripts: Vec<EntityScript>,
    gone: Vec<String>,
    /// Entities to whose lane a target is relative, with the error if they leave it.
    relative: Vec<(String, ImportError)>,
    /// Elements with the times in seconds at which they begin, as far as known.
    begun: Vec<(StoryElement, f64)>,
    /// Problems so far.
    blockers: Blockers,
    /// Earliest time in seconds at which an act stops.
    stop_s: f64,
}

impl Reader<'_> {
    fn event(&mut self, context: &EventContext<'_>) -> Result<(), ImportError> {
        let (actions, is_read) = self.moving(context.event, context.actors, context.scope);
        if actions.is_empty() && is_read {
            return Ok(());
        }
        self.blockers.keep(happens_once(context));
        let mut moved = Vec::new();
        for (kind, inner) in &actions {
            match kind.name.as_str() {
                "PrivateAction" => moved.push(*inner),
                "GlobalAction" => {
                    let read = self.global(context, inner);
                    self.blockers.keep(read);
                }
                _ => {
                    let help = "leave it out: what moves anybody is a `PrivateAction`";
                    let what = "an action of this kind is not read";
                    self.blockers.add(kind.refused(what, help));
                }
            }
        }
        if !is_read {
            self.leave_unread(context, &moved);
            return Ok(());
        }
        if moved.is_empty() {
            return Ok(());
        }
        for actor in context.actors {
            if self.ground.absent.contains(actor) {
                continue;
            }
            if *actor == self.ground.ego.name {
                if !self.ground.ego.is_left {
                    let help = "--leave-ego leaves its events to your controller and lists them";
                    let what = "the ego has a motion of its own";
                    self.blockers.add(moved[0].refused(what, help));
                    continue;
                }
                self.ground.ego.leave(context.event);
                continue;
            }
            let known = self.scripts.iter().position(|it| it.name == *actor);
            let Some(known) = known else {
                let help = "name an entity that the Init places";
                let what = format!("no agent is called `{actor}`");
                let error = context.event.refused(what, help);
                let follows = self.ground.unplaced.contains(actor);
                self.blockers.add(error.following(follows));
                self.probe(None, context, &moved);
                continue;
            };
            if self.scripts[known].is_broken {
                self.probe(Some(known), context, &moved);
                continue;
            }
            let read = self.step(known, context, &moved);
            if self.blockers.keep(read).is_none() {
                self.scripts[known].is_broken = true;
                // What waits for the event is no problem of its own.
                let elements = StoryElement::of("event", context.event);
                self.begun.extend(elements.map(|it| (it, context.begins_s)));
            }
        }
        Ok(())
    }

    /// Goes on without an event that has an action that is not read.
    fn leave_unread(&mut self, context: &EventContext<'_>, actions: &[&XmlNode]) {
        for actor in context.actors {
            let known = self.scripts.iter().position(|it| it.name == *actor);
            self.probe(known, context, actions);
            if let Some(known) = known {
                self.scripts[known].is_broken = true;
            }
        }
        // What waits for the event is no problem of its own.
        let elements = StoryElement::of("event", context.event);
        self.begun.extend(elements.map(|it| (it, context.begins_s)));
    }

    /// Reads an event of an entity for its problems only.
    ///
    /// The steps before it are not known, so its place among them is not checked.
    fn probe(&mut self, who: Option<usize>, context: &EventContext<'_>, actions: &[&XmlNode]) {
        let known = (self.ground, &self.begun[..]);
        let start = starts(context.event, context.scope, context.begins_s, known);
        self.blockers.keep(start);
        let Some(who) = who else {
            return;
        };
        let mut step = ImportedStep::default();
        // These need the place and the speed that the entity has by then.
        let depends = |action: &XmlNode| {
            let inner = action.children.first();
            let name = inner.map_or("", |it| it.name.as_str());
            action.name == "SynchronizeAction" || name == "FollowTrajectoryAction"
        };
        for action in actions.iter().filter(|it| !depends(it)) {
            let read = self.action(who, context, action, true, &mut step);
            self.blockers.keep(read);
        }
    }

    /// Actions of an event that move an entity, each with its containing element, and
    /// whether all are read.
    fn moving<'a>(
        &mut self,
        event: &'a XmlNode,
        actors: &[String],
        scope: &ParameterScope,
    ) -> (Vec<(&'a XmlNode, &'a XmlNode)>, bool) {
        let is_free = !actors.iter().any(|it| self.ground.is_steered(it));
        let mut all = Vec::new();
        let mut is_read = true;
        for action in event.all("Action") {
            match self.blockers.keep(moving(action, scope, is_free)) {
                Some(action) => all.extend(action),
                None => is_read = false,
            }
        }
        (all, is_read)
    }

    fn global(&mut self, context: &EventContext<'_>, it: &XmlNode) -> Result<(), ImportError> {
        let deletes = it.name == "EntityAction" && it.child("DeleteEntityAction").is_some();
        if !deletes {
            return Err(it.refused(
                "an action of this kind is not read",
                "leave it out, or delete an entity instead",
            ));
        }
        match starts(
            context.event,
            context.scope,
            context.begins_s,
            (self.ground, &self.begun),
        )? {
            // A deletion at the start equals a file without the entity.
            StartTrigger::At(at_s) if at_s <= 0.0 => {
                self.gone.push(context.scope.text(it, "entityRef")?)
            }
            StartTrigger::Never => {}
            _ => {
                let help = "delete it at the start, or leave it out of the file";
                return Err(it.refused("an agent that vanishes on the way is not read", help));
            }
        }
        Ok(())
    }

    fn action(
        &mut self,
        who: usize,
        context: &EventContext<'_>,
        action: &XmlNode,
        at_start: bool,
        step: &mut ImportedStep,
    ) -> Result<(), ImportError> {
        let (scope, ground) = (context.scope, self.ground);
        let it = match action.name.as_str() {
            "LongitudinalAction" | "LateralAction" | "RoutingAction" => action.only()?,
            _ => action,
        };
        let script = &mut self.scripts[who];
        match it.name.as_str() {
            "SpeedAction" => {
                let constant = self.constant_speeds();
                let speeds = &mut self.scripts[who].speeds;
                let of = |name: &str| constant.get(name).copied();
                step.laws.push(speed(it, scope, speeds, of)?);
            }
            "SpeedProfileAction" => {
                let mut most = script.speeds.most;
                let profile = speed_profile(it, scope, &mut most)?;
                let laws = script.profile(it, &profile, most)?;
                script.add_steps(&laws, step);
            }
            "LaneChangeAction" => {
                let law = self.lane_change(who, it, scope)?;
                step.laws.push(law);
            }
            "LaneOffsetAction" => {
                let law = self.lane_offset(who, it, scope)?;
                step.laws.push(law);
            }
            // The gap becomes part of the initial state.
            "LongitudinalDistanceAction" if at_start && step.after_s == 0.0 => {
                let now_mps = script.speeds.now_mps.unwrap_or(0.0);
                script.gap_m = Some(gap_of(it, scope, &ground.ego.name, now_mps)?);
            }
            "SynchronizeAction" if at_start => {
                // A meeting accelerates the entity itself, and its approach
                // starts from rest.
                if script.speeds.now_mps != Some(0.0) {
                    let help = "let it stand in Init: the meeting brings it up to its speed";
                    return Err(it.refused("a meeting with an agent that moves already is not read", help));
                }
                let ego_mps = self.constant_speeds().get(&ground.ego.name).copied();
                let approach = approached(it, scope, ground, ego_mps)?;
                self.scripts[who].approach = Some(approach);
            }
            "FollowTrajectoryAction" if script.steps.is_empty() => {
                self.trajectory(who, context, it, step)?;
            }
            _ => return Err(it.refused("an action of this kind is not read here", "a speed, a change of lane or offset; at the start also a distance, a meeting or a trajectory")),
        }
        Ok(())
    }
}

/// An action that moves an entity, with its containing element, or `None` for others.
fn moving<'a>(
    action: &'a XmlNode,
    scope: &ParameterScope,
    is_free: bool,
) -> Result<Option<(&'a XmlNode, &'a XmlNode)>, ImportError> {
    // A second one would be lost without a word.
    if let Some(further) = action.children.get(1) {
        let help = "give each its own `Action` in this event";
        return Err(further.refused("an `Action` with more than one part is not read", help));
    }
    // An action without content does nothing.
    let kind = action.children.first();
    let Some(kind) = kind.filter(|it| !it.children.is_empty()) else {
        return Ok(None);
    };
    let inner = kind.only()?;
    let is_still = is_still(inner, scope, is_free)?;
    Ok((!is_still).then_some((kind, inner)))
}
