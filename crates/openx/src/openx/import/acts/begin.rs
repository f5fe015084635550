//! Begins of the steps of an entity.

use super::script::{Directions, EventContext, ended, stop_aside};
use super::{Reader, SOON_S};
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::tree::XmlNode;
use crate::openx::import::entity::AT_ONCE_MPS;
use crate::openx::import::entity::{ImportedLaw, ImportedStep, Measure, WatchedCondition};
use crate::openx::import::joined::StartTrigger;
use crate::openx::import::journey::to_mps;
use crate::openx::import::story_element::StoryElement;
use crate::openx::import::triggers::starts;

/// Problem of a lane change by distance while the speed changes, and its fix.
const BY_DISTANCE: &str = "a lane change by distance beside a change of speed is not read";
const BY_TIME: &str = "state the lane change by a time or a rate, or change the speed after it";

/// Step without laws, and what goes on of a law that it cuts.
type Begun = (ImportedStep, Option<ImportedLaw>);

impl Reader<'_> {
    pub(super) fn step(
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
        let begun = self.begun_step(who, context, actions);
        if begun.is_err() {
            // Its actions may have problems of their own.
            self.probe(Some(who), context, actions);
        }
        let Some((mut step, rest)) = begun? else {
            self.never(context);
            return Ok(());
        };
        let script = &mut self.scripts[who];
        if script.follows && context.replaces(script) {
            let help = "write priority=\"parallel\", or end the trajectory there";
            return Err(event.refused("a trajectory that an event may cut is not read", help));
        }
        script.has_begun = true;
        self.scripts[who].act = context.act.place;
        self.scripts[who].maneuver = context.maneuver.place;
        // Some actions are only read at the start of the run.
        let at_start = is_first && step.when.is_none() && step.after_s <= SOON_S;
        let script = &self.scripts[who];
        let (from_mps, from) = (script.speeds.now_mps, script.lateral);
        // What follows a trajectory stands until then, whatever speed comes with it.
        let (routes, others): (Vec<&XmlNode>, Vec<&XmlNode>) =
            actions.iter().partition(|it| it.name == "RoutingAction");
        let mut blockers = Blockers::default();
        for action in routes.into_iter().chain(others) {
            blockers.keep(self.action(who, context, action, at_start, &mut step));
        }
        blockers.none()?;
        let script = &mut self.scripts[who];
        if let Some(rest) = rest {
            // A change of speed goes on beside what the step does.
            script.speeds.now_mps = to_mps(&rest, 0.0).or(script.speeds.now_mps);
            step.laws.push(rest);
        }
        let across = step.laws.iter().map(|law| law.across_mps(from));
        let across_mps = across.fold(0.0, f64::max);
        if across_mps > 0.0 {
            script.across_mps = across_mps;
            script.is_by_distance = actions.iter().any(|it| is_by_distance(it));
            let has_speed = step
                .laws
                .iter()
                .any(|law| matches!(law, ImportedLaw::Speed { .. }));
            if script.is_by_distance && has_speed {
                return Err(event.refused(BY_DISTANCE, BY_TIME));
            }
        }
        script.ended = ended(context, actions.len());
        if script.approach.is_some() && !step.laws.is_empty() {
            let help = "let the SynchronizeAction be the only action of the entity";
            return Err(event.refused("an action beside a meeting is not read", help));
        }
        let lasts_s = step
            .laws
            .iter()
            .map(|law| law.lasts_s(from_mps, from))
            .reduce(|a, b| a.zip(b).map(|(a, b)| a.max(b)))
            .unwrap_or(Some(0.0));
        let begins_s = script.ends_s.filter(|_| step.when.is_none());
        // What follows a step of an act that waits has no known time.
        let begins_s = begins_s.filter(|_| context.waits.is_none());
        if let Some(begins_s) = begins_s {
            let elements = [
                StoryElement::of("event", event),
                StoryElement::of("maneuver", context.maneuver),
            ];
            let begun = elements
                .into_iter()
                .flatten()
                .map(|element| (element, begins_s + step.after_s));
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
        // A body moves sideways no faster than it drives, so a slow one takes longer
        // than the file says, and a standing one until it drives. What follows begins
        // beside it.
        let goes_on =
            across_mps > 0.0 || begins_s.is_some_and(|at_s| at_s + step.after_s < script.aside_s);
        let slowest_mps = from_mps.zip(script.speeds.now_mps).map(|(a, b)| a.min(b));
        let lags = slowest_mps.is_some_and(|slowest_mps| slowest_mps < script.across_mps);
        if goes_on && lags && script.across_mps < AT_ONCE_MPS {
            step.overlaps |= across_mps > 0.0;
            script.aside_s = f64::INFINITY;
            let along = step.laws.iter().filter(|law| law.across_mps(from) == 0.0);
            let mut along_s = along.map(|law| law.lasts_s(from_mps, from));
            let along_s = along_s.try_fold(0.0, |a, b| Some(f64::max(a, b?)));
            let begins_s = begins_s.zip(along_s);
            script.ends_s = begins_s.map(|(at_s, lasts_s)| at_s + step.after_s + lasts_s);
            script.ended.clear();
        }
        // Actions at the start that change the initial state need no step.
        if !step.laws.is_empty() {
            script.steps.push(step);
        }
        // When a trajectory or several steps end is not known, and a speed that is kept
        // never ends.
        if script.follows || !script.later.is_empty() || actions.iter().any(|it| keeps_on(it)) {
            script.ended.clear();
        }
        if !script.later.is_empty() {
            script.steps.append(&mut script.later);
            script.ends_s = None;
        }
        Ok(())
    }

    /// Notes the elements of an event that never begins.
    fn never(&mut self, context: &EventContext<'_>) {
        let actions = context
            .event
            .all("Action")
            .filter_map(|it| StoryElement::of("action", it));
        let event = StoryElement::of("event", context.event);
        let elements = event.into_iter().chain(actions);
        self.begun.extend(elements.map(|it| (it, f64::INFINITY)));
    }

    /// Step of an event without its laws, or `None` if the event never begins.
    fn begun_step(
        &mut self,
        who: usize,
        context: &EventContext<'_>,
        actions: &[&XmlNode],
    ) -> Result<Option<Begun>, ImportError> {
        let event = context.event;
        let script = &self.scripts[who];
        let is_first = !script.has_begun;
        let mut step = ImportedStep {
            at: Some(event.at()),
            ..ImportedStep::default()
        };
        let mut rest = None;
        let priority = event.raw("priority").unwrap_or_default();
        let replaces = context.replaces(script);
        // A later act may begin after an element of another act has ended. Its
        // trigger would then miss that end.
        let is_of_act = script.act == context.act.place;
        let in_time = is_of_act || (context.begins_s == 0.0 && context.waits.is_none());
        // The first event of an act waits for what the act waits for.
        let waits = context.waits.filter(|_| script.act != context.act.place);
        if waits.is_some() && !is_first {
            let what =
                "an act that waits for something, after other events of an agent, is not read";
            return Err(event.refused(what, "let the act begin by a time"));
        }
        // A change by distance follows a speed that stays.
        let acts = Directions::of(actions);
        let changes_speed = acts.along;
        let (by_distance, goes_on_until_s) = (script.is_by_distance, script.aside_until_s());
        // Whether all that came before has ended when the act begins.
        let (ends_s, aside_s, same_act) = (
            script.ends_s,
            script.aside_s,
            script.act == context.act.place,
        );
        let is_idle = ends_s.is_some_and(|ends_s| ends_s <= context.begins_s);
        match starts(
            event,
            context.scope,
            context.begins_s,
            (self.ground, &self.begun),
        )? {
            StartTrigger::Never => return Ok(None),
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
                if aside_s <= at_s && ends_s.is_some_and(|ends_s| ends_s <= at_s) =>
            {
                step.after_s = at_s - ends_s.unwrap_or(0.0);
            }
            StartTrigger::At(at_s) if by_distance && changes_speed && at_s < goes_on_until_s => {
                return Err(event.refused(BY_DISTANCE, BY_TIME));
            }
            StartTrigger::At(at_s)
                if priority != "skip"
                    && let Some((after_s, left)) =
                        self.scripts[who].overlap(at_s, acts, replaces) =>
            {
                step.after_s = after_s;
                rest = left;
            }
            StartTrigger::After { element, delay_s }
                if self.scripts[who].ended.contains(&element) && in_time =>
            {
                step.after_s = delay_s;
            }
            StartTrigger::When { mut watch, delay_s } if is_first || is_idle => {
                // A condition is only observed once its act has begun, so an
                // empty step waits for it.
                let idle_s = context.begins_s - ends_s.unwrap_or(0.0);
                if let Some((act_watch, act_delay_s)) = waits {
                    self.scripts[who].steps.push(ImportedStep {
                        when: Some(act_watch.clone()),
                        after_s: *act_delay_s,
                        ..step.clone()
                    });
                } else if idle_s > 0.0 {
                    self.scripts[who].steps.push(ImportedStep {
                        after_s: idle_s,
                        ..step.clone()
                    });
                }
                watch.is_late = waits.is_some() || context.begins_s > 0.0;
                step.when = Some(watch);
                step.after_s = delay_s;
            }
            StartTrigger::When { .. } if by_distance && changes_speed => {
                return Err(event.refused(BY_DISTANCE, BY_TIME));
            }
            StartTrigger::When { watch, delay_s }
                if same_act
                    && priority != "skip"
                    && self.scripts[who].overlaps_with(&watch, acts) =>
            {
                if replaces {
                    // It cuts the change across the path, wherever that is by then.
                    self.scripts[who].is_cut = true;
                    step.laws.push(stop_aside());
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
        Ok(Some((step, rest)))
    }
}

/// Returns whether an action changes the lane by a distance.
fn is_by_distance(action: &XmlNode) -> bool {
    let change = action.child("LaneChangeAction");
    let dynamics = change.and_then(|it| it.child("LaneChangeActionDynamics"));
    dynamics.is_some_and(|it| it.raw("dynamicsDimension") == Some("distance"))
}

/// Returns whether an action or an element of it goes on for ever.
fn keeps_on(node: &XmlNode) -> bool {
    let is_kept = node.name == "RelativeTargetSpeed" && node.raw("continuous") == Some("true");
    is_kept || node.children.iter().any(keeps_on)
}

impl WatchedCondition {
    /// Returns true if it never comes before another condition.
    pub(super) fn follows(&self, other: &WatchedCondition) -> bool {
        let is_stricter = if self.is_below {
            self.value <= other.value
        } else {
            self.value >= other.value
        };
        // The clear way to what is ahead is no longer than that between reference points.
        let is_same = match (&self.measure, &other.measure) {
            (
                Measure::Clearance {
                    target,
                    is_time: true,
                },
                Measure::Along {
                    target: before,
                    is_time: true,
                },
            ) => target == before && !self.is_below,
            (measure, before) => measure == before,
        };
        self.who == other.who
            && self.needs_all == other.needs_all
            && is_same
            && self.is_below == other.is_below
            && is_stricter
            && (self.rises || !other.rises)
    }
}
