//! Check of a storyboard: names, bounds and the tree of its elements.

mod actions;
mod conditions;
mod numbers;
mod trajectories;

use std::sync::Arc;

use crate::ron_file::{Problems, ValuePath};
use crate::tree::{Actors, BoardElement, CheckedCondition, CheckedEffect, ElementKind};
use crate::values::{
    Act, DynamicLimits, Effect, EventPriority, Expression, ManeuverGroup, Story, StoryEvent,
    StoryManeuver, Storyboard, Trigger,
};
use crate::view::SceneChange;

/// Greatest number of elements, and of conditions, so that a file allocates little.
const MOST_PARTS: usize = 10_000;
/// Greatest number of executions.
const MOST_EXECUTIONS: u32 = 10_000;
/// Greatest time, speed and distance.
const MOST: f64 = 1e6;

/// Names that a storyboard may use.
#[derive(Clone, Debug, Default)]
pub struct StoryNames {
    /// Agents, in the order of their numbers.
    pub agents: Vec<String>,
    /// Agents that may be actors.
    pub actors: Vec<String>,
    /// Agents on foot, which have no lane.
    pub on_foot: Vec<String>,
    /// Number of lanes of the road of each agent.
    pub lanes: Vec<usize>,
    /// Traffic lights.
    pub lights: Vec<String>,
    /// Named roads. The world's own has number 0, and these follow it.
    pub roads: Vec<String>,
    /// Parameters of the start.
    pub parameters: Vec<String>,
}

/// Storyboard without mistakes, ready to run.
#[derive(Clone, Debug)]
pub struct CheckedStoryboard {
    pub(crate) elements: Vec<BoardElement>,
    pub(crate) conditions: Vec<CheckedCondition>,
    pub(crate) variables: Vec<f64>,
    /// Limits of each agent.
    pub(crate) limits: Vec<DynamicLimits<f64>>,
    formulas: Vec<StoryFormula>,
    has_parameters: bool,
    /// Storyboard before its parameters got values. `None` if it has none.
    open: Option<Arc<OpenStoryboard>>,
}

/// Formula of a condition, which the world binds to its signals.
#[derive(Clone, Debug)]
pub struct StoryFormula {
    /// Place in the file.
    pub path: ValuePath,
    /// Formula in STL.
    pub text: String,
}

/// Storyboard whose parameters have no values yet, with the names that it uses.
#[derive(Clone, Debug)]
struct OpenStoryboard {
    board: Storyboard,
    names: StoryNames,
}

/// Checks a storyboard and resolves its names, with values of all parameters.
///
/// Each mistake is added to `problems` with its place below `path`. `None` if there is one.
pub fn check(
    problems: &mut Problems<'_>,
    path: &ValuePath,
    board: &Storyboard,
    names: &StoryNames,
    values: &[f64],
) -> Option<CheckedStoryboard> {
    let mut checked = resolved(problems, path, board, names, values)?;
    // Without parameters the storyboard is the same at all starts, so none is kept.
    checked.open = checked.has_parameters.then(|| {
        Arc::new(OpenStoryboard {
            board: board.clone(),
            names: names.clone(),
        })
    });
    Some(checked)
}

/// Checks a storyboard without keeping it for other values of its parameters.
fn resolved(
    problems: &mut Problems<'_>,
    path: &ValuePath,
    board: &Storyboard,
    names: &StoryNames,
    values: &[f64],
) -> Option<CheckedStoryboard> {
    // Problems of other parts of the world may already be listed.
    let before = problems.len();
    let mut check = Check {
        problems,
        names,
        values,
        has_parameters: false,
        variables: board.variables.iter().map(|it| it.name.clone()).collect(),
        first: Vec::new(),
        limits: vec![DynamicLimits::default(); names.agents.len()],
        elements: Vec::new(),
        conditions: Vec::new(),
        formulas: Vec::new(),
    };
    check.variables(path, board);
    check.performance(path, board);
    check.storyboard(path, board);
    // Conditions may name elements that follow them, so they come last.
    check.triggers(path, board);
    let Check {
        problems,
        has_parameters,
        first,
        limits,
        elements,
        conditions,
        formulas,
        ..
    } = check;
    // Any mistake of this storyboard leaves it unusable, as the callers
    // assume.
    (problems.len() == before).then_some(CheckedStoryboard {
        elements,
        conditions,
        variables: first,
        limits,
        formulas,
        has_parameters,
        open: None,
    })
}

impl CheckedStoryboard {
    /// Returns the storyboard with other values of its parameters.
    ///
    /// # Errors
    /// A value is wrong where the storyboard uses it.
    pub fn at_values(self: &Arc<Self>, values: &[f64]) -> Result<Arc<CheckedStoryboard>, String> {
        let Some(open) = &self.open else {
            return Ok(Arc::clone(self));
        };
        // The source text is gone, so only the statement of a problem is used.
        let mut problems = Problems::new("");
        let top = ValuePath::top();
        // Names are resolved already, so only values can be wrong.
        let found = resolved(&mut problems, &top, &open.board, &open.names, values);
        let first = problems.into_list().into_iter().next();
        let mut checked = found.ok_or_else(|| first.map_or_else(String::new, |it| it.what))?;
        checked.open = Some(Arc::clone(open));
        Ok(Arc::new(checked))
    }

    /// Returns whether it depends on parameters of the start.
    pub fn has_parameters(&self) -> bool {
        self.has_parameters
    }

    /// Returns the limits of an agent, which bound all its actions.
    pub fn limits(&self, agent: usize) -> DynamicLimits<f64> {
        self.limits[agent]
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.elements.len()
    }

    /// Returns whether it has no story.
    pub fn is_empty(&self) -> bool {
        self.elements.len() <= 1
    }

    /// Returns kind and names of an element, from its story on.
    pub fn element(&self, number: usize) -> (ElementKind, String) {
        let element = &self.elements[number];
        (element.kind, element.path.join("::"))
    }

    /// Returns the formulas of its conditions, in the order of their numbers.
    pub fn formulas(&self) -> &[StoryFormula] {
        &self.formulas
    }

    /// Returns whether an action may move an agent.
    pub fn moves(&self, agent: usize) -> bool {
        let mut effects = self.elements.iter().filter_map(|it| it.effect.as_ref());
        effects.any(|effect| match effect {
            CheckedEffect::Of { actors, .. } => actors.all().any(|it| it == agent),
            CheckedEffect::Scene(SceneChange::Add(of, _) | SceneChange::Delete(of)) => *of == agent,
            CheckedEffect::Scene(_) | CheckedEffect::Variable { .. } => false,
        })
    }

    /// Returns whether triggers choose actors.
    pub(crate) fn asks_triggering(&self) -> bool {
        self.elements.iter().any(|it| {
            matches!(&it.effect, Some(CheckedEffect::Of { actors, .. })
                if actors.triggering_of.is_some())
        })
    }
}

struct Check<'a, 'b> {
    problems: &'a mut Problems<'b>,
    names: &'a StoryNames,
    /// Values of the parameters.
    values: &'a [f64],
    /// Whether a number is a parameter.
    has_parameters: bool,
    variables: Vec<String>,
    /// Their first values.
    first: Vec<f64>,
    limits: Vec<DynamicLimits<f64>>,
    elements: Vec<BoardElement>,
    conditions: Vec<CheckedCondition>,
    formulas: Vec<StoryFormula>,
}

impl Check<'_, '_> {
    fn wrong(&mut self, path: &ValuePath, what: String, help: &str) {
        self.problems.add(path, what, "here", Some(help.to_owned()));
    }

    fn index(&mut self, path: &ValuePath, what: &str, name: &str, known: &[String]) -> usize {
        let found = known.iter().position(|it| it == name);
        if found.is_none() {
            let known: Vec<&str> = known.iter().map(String::as_str).collect();
            self.problems.unknown(path, what, name, &known);
        }
        // A wrong name is reported, and the storyboard then never runs.
        found.unwrap_or(0)
    }

    fn agent(&mut self, path: &ValuePath, name: &str) -> usize {
        self.index(path, "agent", name, &self.names.agents)
    }

    fn variables(&mut self, path: &ValuePath, board: &Storyboard) {
        for (i, variable) in board.variables.iter().enumerate() {
            let at = path.to("variables").at(i);
            let value = self.number(&at.to("value"), &variable.value, -MOST);
            // Pushed even after a mistake, so that later numbers keep their
            // places.
            self.first.push(value);
            // Only earlier names are compared, so that a pair is reported
            // once, at its second.
            if self.variables[..i].contains(&variable.name) {
                let what = format!("a second variable `{}`", variable.name);
                self.wrong(&at.to("name"), what, "give it another name");
            }
        }
    }

    fn performance(&mut self, path: &ValuePath, board: &Storyboard) {
        for (i, of) in board.performance.iter().enumerate() {
            let at = path.to("performance").at(i);
            let agent = self.agent(&at.to("entity"), &of.entity);
            let limits = self.limits(&at.to("limits"), &of.limits);
            if board.performance[..i]
                .iter()
                .any(|it| it.entity == of.entity)
            {
                let what = format!("a second performance of `{}`", of.entity);
                self.wrong(&at.to("entity"), what, "write one");
            }
            // An unknown agent counts as number 0, which may not exist.
            if let Some(known) = self.limits.get_mut(agent) {
                *known = limits;
            }
        }
    }

    /// Adds an element below `parent`, with a name that its siblings do not have.
    fn add(&mut self, path: &ValuePath, kind: ElementKind, parent: usize, name: &str) -> usize {
        let number = self.elements.len();
        let mut names = match self.elements.get(parent) {
            Some(parent) => parent.path.clone(),
            // The root has itself as its parent, which is not in the list yet.
            None => Vec::new(),
        };
        if kind != ElementKind::Storyboard {
            names.push(name.to_owned());
            let siblings = self.elements[parent].children.iter();
            // Beyond the limit, names are not compared: that would take hours in a hostile file.
            let is_second =
                number < MOST_PARTS && siblings.clone().any(|it| self.elements[*it].path == names);
            // Paths are joined by `::`, so a name with it could mean two elements.
            if name.is_empty() || name.contains("::") {
                let what = format!("`{name}` cannot be a name");
                self.wrong(&path.to("name"), what, "write letters without `::`");
            } else if is_second {
                let what = format!("a second `{name}` in the same element");
                self.wrong(&path.to("name"), what, "give it another name");
            }
            self.elements[parent].children.push(number);
        }
        // Exactly at the limit, so that the problem is reported once.
        if number == MOST_PARTS {
            let what = format!("more than {MOST_PARTS} elements");
            self.wrong(path, what, "split the world");
        }
        self.elements.push(BoardElement {
            kind,
            path: names,
            parent,
            children: Vec::new(),
            start: Vec::new(),
            stop: Vec::new(),
            priority: EventPriority::Parallel,
            most_executions: 1,
            effect: None,
        });
        number
    }

    fn executions(&mut self, path: &ValuePath, element: usize, count: u32) {
        if !(1..=MOST_EXECUTIONS).contains(&count) {
            let help = format!("write a number from 1 to {MOST_EXECUTIONS}");
            let what = format!("{count} executions");
            self.wrong(&path.to("maximum_execution_count"), what, &help);
        }
        self.elements[element].most_executions = count;
    }

    fn storyboard(&mut self, path: &ValuePath, board: &Storyboard) {
        let root = self.add(path, ElementKind::Storyboard, 0, "");
        for (i, story) in board.stories.iter().enumerate() {
            self.story(&path.to("stories").at(i), root, story);
        }
    }

    fn story(&mut self, path: &ValuePath, parent: usize, story: &Story) {
        let number = self.add(path, ElementKind::Story, parent, &story.name);
        self.not_empty(&path.to("acts"), story.acts.len(), "act");
        for (i, act) in story.acts.iter().enumerate() {
            let at = path.to("acts").at(i);
            let act_number = self.add(&at, ElementKind::Act, number, &act.name);
            let groups = at.to("maneuver_groups");
            self.not_empty(&groups, act.maneuver_groups.len(), "maneuver group");
            for (j, group) in act.maneuver_groups.iter().enumerate() {
                // A group has no trigger of its own, so the act's one
                // chooses triggering agents.
                self.group(&groups.at(j), act_number, group, &act.start_trigger);
            }
        }
    }

    /// An empty element would be complete when it starts, which nobody means.
    fn not_empty(&mut self, path: &ValuePath, count: usize, what: &str) {
        if count == 0 {
            let help = format!("write at least one {what}");
            self.wrong(path, format!("no {what}"), &help);
        }
    }

    fn group(&mut self, path: &ValuePath, parent: usize, group: &ManeuverGroup, trigger: &Trigger) {
        let number = self.add(path, ElementKind::ManeuverGroup, parent, &group.name);
        self.executions(path, number, group.maximum_execution_count);
        let named = group.actors.iter().enumerate();
        let mut actors = Actors {
            named: named
                .map(|(i, name)| self.actor(&path.to("actors").at(i), name, group))
                .collect(),
            ..Actors::default()
        };
        if group.actors_are_triggering {
            let at = path.to("actors_are_triggering");
            let conditions = trigger.iter().flatten();
            let entities = conditions.flat_map(|it| match &it.is {
                Expression::ByEntity { entities, .. } => entities.as_slice(),
                _ => &[],
            });
            actors.triggering_of = Some(parent);
            // All agents that may trigger are checked, because only
            // the run shows which do.
            actors.may_trigger = entities.map(|it| self.actor(&at, it, group)).collect();
            if actors.may_trigger.is_empty() {
                let what = "no agent triggers the act".to_owned();
                let help = "write a condition `ByEntity` into the act's `start_trigger`";
                self.wrong(&at, what, help);
            }
        }
        let maneuvers = path.to("maneuvers");
        self.not_empty(&maneuvers, group.maneuvers.len(), "maneuver");
        for (i, maneuver) in group.maneuvers.iter().enumerate() {
            self.maneuver(&maneuvers.at(i), number, maneuver, &actors);
        }
    }

    fn actor(&mut self, path: &ValuePath, name: &str, group: &ManeuverGroup) -> usize {
        // Controllers are switched on for agents that no action moves, such as the ego.
        let mut events = group.maneuvers.iter().flat_map(|it| &it.events);
        let moves = events.any(|event| {
            let mut actions = event.actions.iter();
            actions.any(|it| !matches!(it.does, Effect::ActivateController { .. }))
        });
        if moves {
            self.moved(path, name)
        } else {
            self.agent(path, name)
        }
    }

    /// Returns an agent that actions may move.
    fn moved(&mut self, path: &ValuePath, name: &str) -> usize {
        let named = |list: &[String]| list.iter().any(|it| it == name);
        // An unknown name is left to `agent` below, so that it is reported once.
        if named(&self.names.agents) && !named(&self.names.actors) {
            let what = format!("`{name}` cannot act in a story");
            let help = "write `drive: Story`, or let its `Ado(…)` have `actions: Deviate(…)`";
            self.wrong(path, what, help);
        }
        self.agent(path, name)
    }

    fn maneuver(
        &mut self,
        path: &ValuePath,
        parent: usize,
        maneuver: &StoryManeuver,
        actors: &Actors,
    ) {
        let number = self.add(path, ElementKind::Maneuver, parent, &maneuver.name);
        let events = path.to("events");
        self.not_empty(&events, maneuver.events.len(), "event");
        for (i, event) in maneuver.events.iter().enumerate() {
            let at = events.at(i);
            let event_number = self.add(&at, ElementKind::Event, number, &event.name);
            self.executions(&at, event_number, event.maximum_execution_count);
            self.elements[event_number].priority = event.priority;
            let actions = at.to("actions");
            self.not_empty(&actions, event.actions.len(), "action");
            for (j, action) in event.actions.iter().enumerate() {
                self.action(&actions.at(j), event_number, action, actors);
            }
            // Last, since conflicts compare the effects of all actions of the event.
            self.conflicts(&actions, event_number);
        }
    }

    fn variable(&mut self, path: &ValuePath, name: &str) -> usize {
        // The search borrows the whole check, and with it the list.
        let variables = self.variables.clone();
        self.index(path, "variable", name, &variables)
    }

    fn triggers(&mut self, path: &ValuePath, board: &Storyboard) {
        self.elements[0].stop = self.trigger(&path.to("stop_trigger"), &board.stop_trigger);
        // The elements were added in this order.
        let mut number = 1;
        for (i, story) in board.stories.iter().enumerate() {
            let stories = path.to("stories").at(i);
            // A story has no triggers.
            number += 1;
            for (j, act) in story.acts.iter().enumerate() {
                number = self.triggers_of_act(&stories.to("acts").at(j), act, number);
            }
        }
    }

    fn triggers_of_act(&mut self, path: &ValuePath, act: &Act, first: usize) -> usize {
        self.elements[first].start = self.trigger(&path.to("start_trigger"), &act.start_trigger);
        self.elements[first].stop = self.trigger(&path.to("stop_trigger"), &act.stop_trigger);
        let mut number = first + 1;
        for (i, group) in act.maneuver_groups.iter().enumerate() {
            let groups = path.to("maneuver_groups").at(i);
            // Groups and maneuvers start with their parents and have no triggers.
            number += 1;
            for (j, maneuver) in group.maneuvers.iter().enumerate() {
                let maneuvers = groups.to("maneuvers").at(j);
                number += 1;
                for (k, event) in maneuver.events.iter().enumerate() {
                    self.trigger_of_event(&maneuvers.to("events").at(k), event, number);
                    // An event is followed by its actions, which have no
                    // triggers.
                    number += 1 + event.actions.len();
                }
            }
        }
        number
    }

    fn trigger_of_event(&mut self, path: &ValuePath, event: &StoryEvent, number: usize) {
        let start = self.trigger(&path.to("start_trigger"), &event.start_trigger);
        // Without a trigger an event would wait for ever after its first
        // execution.
        if event.start_trigger.is_empty() && event.maximum_execution_count > 1 {
            let what = "an event without a trigger executes more than once".to_owned();
            let help = "write its `start_trigger`";
            self.wrong(&path.to("maximum_execution_count"), what, help);
        }
        self.elements[number].start = start;
    }
}
