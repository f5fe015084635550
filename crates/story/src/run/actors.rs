//! Agents of actions: those of the file, and those that caused a trigger.

use super::{SAME_S, StoryStep};
use crate::condition::Instant;
use crate::tree::{Actors, CheckedEffect, CheckedExpression, ElementKind};
use crate::values::ConditionEdge;
use crate::view::{ActorAction, MotionDomain, StoryStage};

/// Agent with one of the degrees of freedom that its action controls.
struct Controlled {
    agent: usize,
    domain: MotionDomain,
}

impl<S: StoryStage + ?Sized> StoryStep<'_, S> {
    /// Checks a condition for each of its agents, if these may become actors.
    pub(super) fn check_agents(&mut self, number: usize) {
        let condition = &self.board.conditions[number];
        let CheckedExpression::Agents { agents, is, .. } = &condition.is else {
            return;
        };
        // All who fulfil it have made it true, also those who did so earlier. Those who
        // fulfil it no longer have made it false.
        let edge = match condition.edge {
            ConditionEdge::None | ConditionEdge::Rising => ConditionEdge::None,
            edge => edge,
        };
        let instant = Instant {
            view: &*self.stage,
            at_s: self.now_s,
            ways_m: &self.run.ways_m,
            since_s: self.now_s,
        };
        for (agent, run) in agents.iter().zip(&mut self.run.of_agents[number]) {
            run.check(condition, edge, instant.agent(*agent, is), self.now_s);
        }
    }

    /// Notes the agents that cause the trigger of an act that starts.
    pub(super) fn note_triggering(&mut self, number: usize) {
        let element = &self.board.elements[number];
        if element.kind != ElementKind::Act || self.run.triggering.is_empty() {
            return;
        }
        let conditions = &self.run.conditions;
        let is_true = |it: &usize| conditions[*it].is_true(self.now_s);
        let groups = element
            .start
            .iter()
            .filter(|group| group.iter().all(is_true));
        // Only groups that hold have started the act. Agents of others do not
        // count.
        let mut found = Vec::new();
        for number in groups.flatten() {
            // Other conditions of the group name no agents.
            let CheckedExpression::Agents { agents, .. } = &self.board.conditions[*number].is
            else {
                continue;
            };
            let runs = agents.iter().zip(&self.run.of_agents[*number]);
            let triggering = runs.filter(|(_, run)| run.is_true(self.now_s));
            found.extend(triggering.map(|(agent, _)| *agent));
        }
        // Sorted, so that agents act in the order of their numbers.
        found.sort_unstable();
        found.dedup();
        self.run.triggering[number] = found;
    }

    /// Returns the agents of an action, each once.
    fn acting(&self, actors: &Actors) -> Vec<usize> {
        let mut all = actors.named.clone();
        if let Some(act) = actors.triggering_of {
            let more = self.run.triggering[act].iter();
            // Named actors act once, even if they trigger as well.
            all.extend(more.filter(|it| !actors.named.contains(it)));
        }
        all
    }

    fn controlled(&self, element: usize) -> Vec<Controlled> {
        let Some(CheckedEffect::Of { actors, action }) = &self.board.elements[element].effect
        else {
            return Vec::new();
        };
        let agents = self.acting(actors).into_iter();
        agents
            .flat_map(|agent| {
                let domains = action.domains().iter();
                domains.map(move |domain| Controlled {
                    agent,
                    domain: *domain,
                })
            })
            .collect()
    }

    fn owner(&self, of: &Controlled) -> Option<usize> {
        self.run.owners[of.agent][of.domain as usize]
    }

    pub(super) fn is_performed(&self, element: usize, effect: &CheckedEffect) -> bool {
        let CheckedEffect::Of { action, .. } = effect else {
            return true;
        };
        self.controlled(element).iter().all(|of| {
            // Another action may have taken the agent over.
            self.owner(of) != Some(element)
                || (!action.is_endless()
                    && self.stage.ends_s(of.agent, of.domain) <= self.now_s + SAME_S)
        })
    }

    pub(super) fn begin_agents(&mut self, element: usize, actors: &Actors, action: &ActorAction) {
        for agent in self.acting(actors) {
            for domain in action.domains() {
                // From here on the action that owned the agent is over for this agent.
                self.run.owners[agent][*domain as usize] = Some(element);
            }
            self.stage.begin(agent, action, self.now_s);
        }
    }

    /// Stops the motion of the agents that an action still controls.
    pub(super) fn stop_agents(&mut self, element: usize) {
        for of in self.controlled(element) {
            if self.owner(&of) == Some(element) {
                self.stage.stop(of.agent, of.domain, self.now_s);
            }
        }
    }

    /// Gives up the agents of an action, and returns whether another action took one.
    pub(super) fn release(&mut self, element: usize) -> bool {
        let mut was_taken = false;
        for of in self.controlled(element) {
            let owner = &mut self.run.owners[of.agent][of.domain as usize];
            if *owner == Some(element) {
                // Only its own agents, as another action may still
                // move those that it took.
                *owner = None;
            } else {
                was_taken = true;
            }
        }
        was_taken
    }
}
