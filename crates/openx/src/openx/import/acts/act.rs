//! Acts: when they begin and stop, and the events that they hold.

use super::Reader;
use super::script::EventContext;
use crate::opendrive::error::ImportError;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::joined::StartTrigger;
use crate::openx::import::story_element::StoryElement;
use crate::openx::import::triggers::starts;

impl Reader<'_> {
    pub(super) fn act(&mut self, act: &XmlNode, scope: &ParameterScope) -> Result<(), ImportError> {
        let mut context = Vec::new();
        for group in act.all("ManeuverGroup") {
            let actors = group.child("Actors");
            let refs = actors.into_iter().flat_map(|it| it.all("EntityRef"));
            let names: Vec<String> = refs
                .map(|it| scope.text(it, "entityRef"))
                .map(|name| self.blockers.keep(name))
                .collect::<Vec<_>>()
                .into_iter()
                .flatten()
                .collect();
            for it in &group.children {
                let read = match it.name.as_str() {
                    "Maneuver" => {
                        let declared = it.child("ParameterDeclarations");
                        let own = ParameterScope::declared(declared, scope, &[]);
                        own.map(|own| (it.clone(), own))
                    }
                    "CatalogReference" => self.ground.catalogs.entry(it, scope, self.ground.files),
                    _ => continue,
                };
                if let Some((maneuver, own)) = self.blockers.keep(read) {
                    context.push((group, names.clone(), maneuver, own));
                }
            }
        }
        // Weather moves no entity, so it is checked in every act that begins.
        let begins = starts(act, scope, 0.0, (self.ground, &self.begun));
        if !matches!(begins, Ok(StartTrigger::Never)) {
            for (_, _, maneuver, scope) in &context {
                for event in maneuver.all("Event") {
                    let read = self.weather(event, scope);
                    self.blockers.keep(read);
                }
            }
        }
        // Only moving events matter: an act of lights or sounds is no part of
        // the script, and one of the ego alone is left to the user.
        let mut moves = false;
        for (_, actors, maneuver, scope) in &context {
            for event in maneuver.all("Event") {
                let (actions, is_read) = self.moving(event, actors, scope);
                if !self.is_left(actors, &actions) {
                    moves |= !actions.is_empty() || !is_read;
                } else if !matches!(begins, Ok(StartTrigger::Never)) {
                    self.ground.ego.leave(event);
                }
            }
        }
        let mut waits = None;
        // The trigger of an act without moving events has no effect and is not
        // checked.
        if !moves {
            return Ok(());
        }
        // What the events of an act are is read whatever the act waits for.
        let begins = self.blockers.keep(begins);
        let mut is_read = begins.is_some();
        let begins_s = match begins.unwrap_or(StartTrigger::At(0.0)) {
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
                let what = "an act that waits for an element is not read";
                self.blockers.add(act.refused(what, help));
                is_read = false;
                0.0
            }
        };
        if !is_read {
            self.scripts.iter_mut().for_each(|it| it.is_broken = true);
        }
        for (group, actors, maneuver, scope) in &context {
            for event in maneuver.all("Event") {
                let (actions, _) = self.moving(event, actors, scope);
                if self.is_left(actors, &actions) {
                    continue;
                }
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
                let read = self.event(&context);
                self.blockers.keep(read);
            }
        }
        if let Some(stop) = act
            .child("StopTrigger")
            .filter(|it| !it.children.is_empty())
        {
            let stops_s = self.stops_s(stop, scope)?;
            // The run ends where the file takes the act's events away.
            self.stop_s = self.stop_s.min(stops_s);
            if stops_s.is_finite() {
                let what = "what follows the stop of an act";
                self.ground.catalogs.note(what, stop);
            }
        }
        Ok(())
    }

    /// Returns true for actions that are left to the user: those that move the ego alone.
    fn is_left(&self, actors: &[String], actions: &[(&XmlNode, &XmlNode)]) -> bool {
        let ego = self.ground.ego;
        let are_private = actions.iter().all(|(kind, _)| kind.name == "PrivateAction");
        let is_alone = !actors.is_empty() && actors.iter().all(|it| *it == ego.name);
        ego.is_left && is_alone && are_private && !actions.is_empty()
    }
}
