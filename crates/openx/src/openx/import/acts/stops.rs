//! Ends of acts, and what holds throughout them.

use std::collections::BTreeMap;

use super::Reader;
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::dropped::{time_s, times};
use crate::openx::import::motion::friction_of;

impl Reader<'_> {
    /// Speeds of the entities whose speed has not changed so far.
    ///
    /// A later change would be that of an event, which is read in the same order.
    pub(super) fn constant_speeds(&self) -> BTreeMap<String, f64> {
        // The events of an ego that are left to the user may change its speed.
        let ego = self.ground.ego;
        let is_left = |name: &str| name == ego.name && !ego.events().is_empty();
        let constant = self
            .scripts
            .iter()
            .filter(|it| it.steps.is_empty() && !is_left(&it.name));
        let speeds = constant.filter_map(|it| Some((it.name.clone(), it.speeds.now_mps?)));
        speeds.collect()
    }

    /// Time in seconds at which an act stops beside an ego that coasts.
    pub(super) fn stops_s(
        &self,
        stop: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<f64, ImportError> {
        let ego = &self.ground.ego.name;
        let ego_mps = self
            .scripts
            .iter()
            .find(|it| it.name == *ego)
            .and_then(|it| it.speeds.now_mps)
            .unwrap_or(0.0);
        let mut first_s = f64::INFINITY;
        let mut blockers = Blockers::default();
        for group in stop.all("ConditionGroup") {
            let at_s = blockers.keep(self.stop_of(group, scope, ego_mps));
            first_s = first_s.min(at_s.unwrap_or(f64::INFINITY));
        }
        blockers.none()?;
        Ok(first_s)
    }

    /// Time in seconds at which a group of conditions stops an act.
    fn stop_of(
        &self,
        group: &XmlNode,
        scope: &ParameterScope,
        ego_mps: f64,
    ) -> Result<f64, ImportError> {
        let ego = &self.ground.ego.name;
        let refused = || {
            let help = "stop it by a time or a distance that the ego travels, or end \
                            what it does by its own dynamics";
            group.refused("an act that is stopped in this way is not read", help)
        };
        // It waits for what never begins.
        if self.waits_in_vain(group, scope) {
            return Ok(f64::INFINITY);
        }
        match times(group) {
            // Times that never hold together never stop it.
            Some(times) => Ok(time_s(&times, scope)?.unwrap_or(f64::INFINITY)),
            None => {
                let condition = group.only()?;
                let by = condition.child("ByEntityCondition").ok_or_else(refused)?;
                let who = by.inner("TriggeringEntities")?.only()?;
                let way = by.inner("EntityCondition")?.only()?;
                let is_ego =
                    who.raw("entityRef").is_some() && scope.text(who, "entityRef")? == *ego;
                let is_lone = group.children.len() == 1;
                if !is_ego || !is_lone || way.name != "TraveledDistanceCondition" {
                    return Err(refused());
                }
                Ok(scope.number(way, "value")? / ego_mps)
            }
        }
    }

    /// Returns true for a group with an element that never begins.
    fn waits_in_vain(&self, group: &XmlNode, scope: &ParameterScope) -> bool {
        let by = group
            .all("Condition")
            .filter_map(|it| it.child("ByValueCondition"));
        let mut states = by.filter_map(|it| it.child("StoryboardElementStateCondition"));
        states.any(|state| {
            let kind = state.raw("storyboardElementType").unwrap_or_default();
            let name = scope
                .text(state, "storyboardElementRef")
                .unwrap_or_default();
            let mut known = self.begun.iter().filter(|(_, at_s)| at_s.is_infinite());
            known.any(|(element, _)| element.kind == kind && element.name == name)
        })
    }

    /// Refuses weather that changes the friction after the Init.
    pub(super) fn weather(
        &self,
        event: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<(), ImportError> {
        let global = event
            .all("Action")
            .filter_map(|it| it.child("GlobalAction"));
        for changed in global.filter_map(|it| it.child("EnvironmentAction")) {
            let scale = friction_of(changed, scope, self.ground)?;
            // The same factor as in the Init changes nothing.
            if scale.is_some_and(|scale| scale != self.friction_scale) {
                let help = "set the friction in Init";
                return Err(changed.refused("friction that changes on the way is not read", help));
            }
        }
        Ok(())
    }
}
