//! Acts of a storyboard, as sequential steps of every entity.
//!
//! A script executes one step after another. Events that may overlap, repeat or
//! begin before the previous event ends are refused. Their priorities would
//! decide, and a script has none.

mod lanes;
mod script;
mod stops;

use script::{EntityScript, EventContext, ended, happens_once};

use super::ends::to_mps;
use super::entity::{ImportedEntity, ImportedStep};
use super::laws::{approached, gap_of, speed, walked};
use super::motion::is_still;
use super::places::PositionContext;
use super::triggers::{StartTrigger, StoryElement, starts};
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Latest time in seconds of a meeting that counts as prepared from the start.
///
/// The protocol leaves open in which way an entity reaches its speed before
/// that.
const SOON_S: f64 = 1.0;
/// Tolerance in metres between the start of a path and the entity's place.
const SAME_M: f64 = 0.01;

/// Reads the acts into the steps of the entities, and removes deleted entities.
///
/// Returns the time in seconds at which an act stops, if one does.
///
/// `friction_scale` is that of the Init, which no act may change.
pub(super) fn acts(
    board: &XmlNode,
    scope: &ParameterScope,
    (ground, friction_scale): (PositionContext<'_>, f64),
    entities: &mut Vec<ImportedEntity>,
) -> Result<Option<f64>, ImportError> {
    let mut reader = Reader {
        ground,
        friction_scale,
        scripts: entities.iter().map(EntityScript::of).collect(),
        gone: Vec::new(),
        relative: Vec::new(),
        begun: Vec::new(),
        stop_s: f64::INFINITY,
    };
    for story in board.all("Story") {
        let declared = story.child("ParameterDeclarations");
        let own = ParameterScope::declared(declared, scope, &[])?;
        for act in story.all("Act") {
            reader.act(act, &own)?;
        }
    }
    // Checked last, since a later act may contain the lane change.
    reader.lanes_stay()?;
    let Reader {
        scripts,
        gone,
        stop_s,
        ..
    } = reader;
    for (entity, script) in entities.iter_mut().zip(scripts) {
        entity.steps = script.steps;
        entity.approach = script.approach;
        entity.gap_m = script.gap_m;
        entity.placed = script.placed;
    }
    entities.retain(|it| !gone.contains(&it.name));
    Ok(stop_s.is_finite().then_some(stop_s))
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
    /// Earliest time in seconds at which an act stops.
    stop_s: f64,
}

impl Reader<'_> {
    fn act(&mut self, act: &XmlNode, scope: &ParameterScope) -> Result<(), ImportError> {
        let mut context = Vec::new();
        for group in act.all("ManeuverGroup") {
            let actors = group.child("Actors");
            let refs = actors.into_iter().flat_map(|it| it.all("EntityRef"));
            let names = refs.map(|it| scope.text(it, "entityRef"));
            let names = names.collect::<Result<Vec<_>, _>>()?;
            for it in &group.children {
                let (maneuver, own) = match it.name.as_str() {
                    "Maneuver" => {
                        let declared = it.child("ParameterDeclarations");
                        (it.clone(), ParameterScope::declared(declared, scope, &[])?)
                    }
                    "CatalogReference" => {
                        self.ground.catalogs.entry(it, scope, self.ground.files)?
                    }
                    _ => continue,
                };
                context.push((group, names.clone(), maneuver, own));
            }
        }
        // Weather moves no entity, so it is checked in every act that begins.
        let begins = starts(act, scope, 0.0, (self.ground, &self.begun));
        if !matches!(begins, Ok(StartTrigger::Never)) {
            for (_, _, maneuver, scope) in &context {
                for event in maneuver.all("Event") {
                    self.weather(event, scope)?;
                }
            }
        }
        // Only moving events matter: an act of lights or sounds is no part of
        // the script.
        let mut moves = false;
        for (_, actors, maneuver, _) in &context {
            for event in maneuver.all("Event") {
                moves |= !moving(event, actors, &self.ground.ego.name)?.is_empty();
            }
        }
        let mut waits = None;
        // The trigger of an act without moving events has no effect and is not
        // checked.
        if !moves {
            return Ok(());
        }
        let begins_s = match begins? {
            StartTrigger::Never => return Ok(()),
            StartTrigger::At(at_s) => {
                let element = StoryElement::of("act", act);
                self.begun.extend(element.map(|element| (element, at_s)));
                at_s
            }
            StartTrigger::When { watch, delay_s } => {
                waits = Some((watch, delay_s));
                0.0
            }
            StartTrigger::After { .. } => {
                let help = "begin the act by a time, and its events by what they wait for";
                return Err(act.refused("an act that waits for an element is not read", help));
            }
        };
        if let Some(stop) = act
            .child("StopTrigger")
            .filter(|it| !it.children.is_empty())
        {
            let stops_s = self.stops_s(stop, scope)?;
            // The run ends where the file takes the act's events away.
            self.stop_s = self.stop_s.min(stops_s);
            self.ground
                .catalogs
                .note("what follows the stop of an act", stop);
        }
        for (group, actors, maneuver, scope) in &context {
            for event in maneuver.all("Event") {
                let context = EventContext {
                    act,
                    begins_s,
                    waits: waits.as_ref(),
                    group,
                    maneuver,
                    event,
                    scope,
                    actors,
                };
                self.event(&context)?;
            }
        }
        Ok(())
    }

    fn event(&mut self, context: &EventContext<'_>) -> Result<(), ImportError> {
        let actions = moving(context.event, context.actors, &self.ground.ego.name)?;
        if actions.is_empty() {
            return Ok(());
        }
        happens_once(context)?;
        let mut moved = Vec::new();
        for (kind, inner) in &actions {
            match kind.name.as_str() {
                "PrivateAction" => moved.push(*inner),
                "GlobalAction" => self.global(context, inner)?,
                _ => {
                    return Err(kind.refused(
                        "an action of this kind is not read",
                        "leave it out: what moves anybody is a `PrivateAction`",
                    ));
                }
            }
        }
        if moved.is_empty() {
            return Ok(());
        }
        for actor in context.actors {
            if *actor == self.ground.ego.name {
                if !self.ground.ego.is_left {
                    let help = "--leave-ego leaves its events to your controller and lists them";
                    let what = "the ego has a motion of its own";
                    return Err(moved[0].refused(what, help));
                }
                self.ground.ego.leave(context.event);
                continue;
            }
            let known = self.scripts.iter().position(|it| it.name == *actor);
            let known = known
                .ok_or_else(|| context.event.error(format!("no agent is called `{actor}`")))?;
            self.step(known, context, &moved)?;
        }
        Ok(())
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

    fn step(
        &mut self,
        who: usize,
        context: &EventContext<'_>,
        actions: &[&XmlNode],
    ) -> Result<(), ImportError> {
        let event = context.event;
        let script = &self.scripts[who];
        let is_first = !script.has_begun;
        if script.approach.is_some() {
            let help = "let the SynchronizeAction be the only event of the entity";
            return Err(event.refused("an event beside a meeting is not read", help));
        }
        let mut step = ImportedStep {
            when: None,
            after_s: 0.0,
            laws: Vec::new(),
            overlaps: false,
        };
        let mut rest = None;
        let priority = event.raw("priority").unwrap_or_default();
        let replaces = matches!(priority, "override" | "overwrite");
        // A later act may begin after an element of another act has ended. Its
        // trigger would then miss that end.
        let in_time = context.begins_s == 0.0 || script.act == context.act.place;
        let in_time = in_time && (context.waits.is_none() || script.act == context.act.place);
        // The first event of an act waits for what the act waits for.
        let waits = context.waits.filter(|_| script.act != context.act.place);
        if waits.is_some() && !is_first {
            let what =
                "an act that waits for something, after other events of an agent, is not read";
            return Err(event.refused(what, "let the act begin by a time"));
        }
        match starts(
            event,
            context.scope,
            context.begins_s,
            (self.ground, &self.begun),
        )? {
            StartTrigger::Never => return Ok(()),
            StartTrigger::At(at_s) if is_first => {
                step.after_s = at_s;
                if let Some((watch, delay_s)) = waits {
                    // A time of its own would count from another instant.
                    if at_s != 0.0 {
                        let what = "a time beside an act that waits for something is not read";
                        return Err(event.refused(what, "let the act begin by a time"));
                    }
                    step.when = Some(watch.clone());
                    step.after_s = *delay_s;
                }
            }
            // A time after the end of the event before it.
            StartTrigger::At(at_s)
                if script.aside_s <= at_s && script.ends_s.is_some_and(|ends_s| ends_s <= at_s) =>
            {
                step.after_s = at_s - script.ends_s.unwrap_or(0.0);
            }
            StartTrigger::At(at_s)
                if priority != "skip"
                    && let Some((after_s, left)) =
                        self.scripts[who].overlap(at_s, directions(actions), replaces) =>
            {
                step.after_s = after_s;
                rest = left;
            }
            StartTrigger::After { element, delay_s }
                if self.scripts[who].ended.contains(&element) && in_time =>
            {
                step.after_s = delay_s;
            }
            // An edge that rises before the act begins would be missed by a
            // player.
            StartTrigger::When { watch, .. }
                if is_first && watch.rises && (0.0 < context.begins_s || waits.is_some()) =>
            {
                let help = "begin the act at 0 s, or write conditionEdge=\"none\"";
                let what = "a rising edge in an act that begins later is not read";
                return Err(event.refused(what, help));
            }
            StartTrigger::When { watch, delay_s } if is_first => {
                // A condition is only observed once its act has begun, so an
                // empty step waits for it.
                if let Some((act_watch, act_delay_s)) = waits {
                    self.scripts[who].steps.push(ImportedStep {
                        when: Some(act_watch.clone()),
                        after_s: *act_delay_s,
                        laws: Vec::new(),
                        overlaps: false,
                    });
                } else if 0.0 < context.begins_s {
                    self.scripts[who].steps.push(ImportedStep {
                        after_s: context.begins_s,
                        ..step.clone()
                    });
                }
                step.when = Some(watch);
                step.after_s = delay_s;
            }
            _ => {
                let what = "an event that may begin before the one before it has ended is not read";
                let help = "begin it by a StoryboardElementStateCondition: the endTransition of \
                            the event before it, which only this entity carries out";
                return Err(event.refused(what, help));
            }
        }
        self.scripts[who].has_begun = true;
        self.scripts[who].act = context.act.place;
        // Some actions are only read at the start of the run.
        let at_start = is_first && step.when.is_none() && step.after_s <= SOON_S;
        let script = &self.scripts[who];
        let (from_mps, from_m) = (script.speeds.now_mps, (script.t_m, script.changed_m));
        for action in actions {
            self.action(who, context, action, at_start, &mut step)?;
        }
        let script = &mut self.scripts[who];
        if let Some(rest) = rest {
            // The change of speed goes on beside what the step does.
            script.speeds.now_mps = to_mps(&rest, 0.0);
            step.laws.push(rest);
        }
        script.ended = ended(context, actions.len());
        if script.approach.is_some() && !step.laws.is_empty() {
            let help = "let the SynchronizeAction be the only action of the entity";
            return Err(event.refused("an action beside a meeting is not read", help));
        }
        let lasts_s = step.laws.iter().map(|law| law.lasts_s(from_mps, from_m));
        let lasts_s = lasts_s.reduce(|a, b| a.zip(b).map(|(a, b)| a.max(b)));
        let lasts_s = lasts_s.unwrap_or(Some(0.0));
        let begins_s = script.ends_s.filter(|_| step.when.is_none());
        // What follows a step of an act that waits has no known time.
        let begins_s = begins_s.filter(|_| context.waits.is_none());
        if let Some(begins_s) = begins_s {
            let elements = [
                StoryElement::of("event", event),
                StoryElement::of("maneuver", context.maneuver),
            ];
            let begun = elements.into_iter().flatten();
            let begun = begun.map(|element| (element, begins_s + step.after_s));
            // The first event of a maneuver begins it.
            for (element, at_s) in begun.collect::<Vec<_>>() {
                if self.begun.iter().all(|(known, _)| *known != element) {
                    self.begun.push((element, at_s));
                }
            }
        }
        script.last = begins_s.map(|at_s| (at_s + step.after_s, from_mps));
        script.ends_s = begins_s
            .zip(lasts_s)
            .map(|(at_s, lasts_s)| at_s + step.after_s + lasts_s);
        // Actions at the start that change the initial state need no step.
        if !step.laws.is_empty() {
            script.steps.push(step);
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
                script.gap_m = Some(gap_of(it, scope, (now_mps, &ground.ego.name))?);
            }
            "SynchronizeAction" if at_start => {
                // A meeting accelerates the entity itself, and its approach
                // starts from rest.
                if script.speeds.now_mps != Some(0.0) {
                    let help = "let it stand in Init: the meeting brings it up to its speed";
                    return Err(it.refused("a meeting with an agent that moves already is not read", help));
                }
                let ego_mps = self.constant_speeds().get(&ground.ego.name).copied();
                let approach = approached(it, scope, (ground, ego_mps))?;
                self.scripts[who].approach = Some(approach);
            }
            "FollowTrajectoryAction" if script.steps.is_empty() => {
                let (way, law) = walked(it, scope, ground)?;
                // The path replaces the placement, so both must agree at the
                // start.
                let off = way.way.begins.sees(&script.placed.spot);
                if SAME_M < libm::hypot(off.x_m, off.y_m) {
                    let what = format!(
                        "a way that begins {:.3} m from the place of an agent",
                        libm::hypot(off.x_m, off.y_m)
                    );
                    let help = "begin the trajectory where the entity is placed";
                    return Err(it.refused(what, help));
                }
                script.placed.way = Some(way);
                step.laws.push(law);
            }
            _ => return Err(it.refused("an action of this kind is not read here", "a speed, a change of lane or offset; at the start also a distance, a meeting or a trajectory")),
        }
        Ok(())
    }
}

/// Actions of an event that move an entity, each with its containing element.
fn moving<'a>(
    event: &'a XmlNode,
    actors: &[String],
    ego: &str,
) -> Result<Vec<(&'a XmlNode, &'a XmlNode)>, ImportError> {
    let is_for_ego = actors.iter().all(|it| it == ego);
    let mut moving = Vec::new();
    for action in event.all("Action") {
        // An action without content does nothing.
        let Some(kind) = action.children.first() else {
            continue;
        };
        let inner = kind.only()?;
        if !is_still(inner, is_for_ego)? {
            moving.push((kind, inner));
        }
    }
    Ok(moving)
}

/// Whether actions of an event act along the path and across it.
fn directions(actions: &[&XmlNode]) -> (bool, bool) {
    let has = |name: &str| actions.iter().any(|action| action.name == name);
    (has("LongitudinalAction"), has("LateralAction"))
}
