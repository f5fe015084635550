//! Interpreter of a storyboard: states of its elements, instant by instant.
//!
//! Within a sample it searches the instants at which conditions change. It looks every
//! 10 ms of the episode's time, whatever the sample time, and then bisects. Elements
//! that are due at the same instant change together, until none is due.

mod actors;
mod agent_conditions;
mod instants;

use crate::check::CheckedStoryboard;
use crate::condition::{Instant, apart_m, compared};
use crate::tree::{
    AgentExpression, AgentQuantity, CheckedCondition, CheckedEffect, CheckedExpression,
    ElementKind, VariableChange,
};
use crate::trigger::{ConditionRun, Expressed, SAME_S};
use crate::values::{ElementState, EventPriority};
use crate::view::{StoryStage, StoryView};

/// Distance of the instants at which conditions are looked at.
///
/// A condition that is true for a shorter time in between may be missed.
const LOOK_S: f64 = 0.01;

/// State of an element in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Life {
    /// Its parent has not started.
    Idle,
    Standby,
    Running,
    Complete,
}

#[derive(Clone, Copy, Debug)]
struct ElementRun {
    life: Life,
    executions: u32,
    /// Last start or skip.
    triggered_s: Option<f64>,
    /// Last start, end, stop and skip.
    transitions_s: [Option<f64>; 4],
}

/// Change of an element's state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementChange {
    /// Number of the element in its storyboard.
    pub element: usize,
    /// Transition.
    pub transition: ElementState,
    /// Instant.
    pub at_s: f64,
}

/// State of a storyboard. A clone continues to the bit.
#[derive(Clone, Debug)]
pub struct StoryRun {
    elements: Vec<ElementRun>,
    conditions: Vec<ConditionRun>,
    /// Each condition for each of its agents, if these may become actors.
    of_agents: Vec<Vec<ConditionRun>>,
    variables: Vec<f64>,
    /// Action that controls each agent along and across its path.
    owners: Vec<[Option<usize>; 2]>,
    /// Agents that caused the trigger of each act. Empty if no group asks for them.
    triggering: Vec<Vec<usize>>,
    /// Way of each agent so far. Empty if no condition asks for it.
    ways_m: Vec<f64>,
    /// Instant up to which it has run, `None` before the start.
    time_s: Option<f64>,
}

/// Instant at which an expression is evaluated.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// Last instant at which elements have changed.
    since_s: f64,
    at_s: f64,
}

/// Change of an element that is due, in the order of precedence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    Stop,
    End,
    Start,
}

/// Storyboard, scene and record of one step.
struct StoryStep<'a, S: ?Sized> {
    board: &'a CheckedStoryboard,
    stage: &'a mut S,
    changes: &'a mut Vec<ElementChange>,
    run: &'a mut StoryRun,
    now_s: f64,
}

impl StoryRun {
    /// Returns the state before the start.
    pub fn new(board: &CheckedStoryboard) -> StoryRun {
        let idle = ElementRun {
            life: Life::Idle,
            executions: 0,
            triggered_s: None,
            transitions_s: [None; 4],
        };
        StoryRun {
            elements: vec![idle; board.elements.len()],
            conditions: vec![ConditionRun::default(); board.conditions.len()],
            of_agents: agent_conditions::conditions_of_agents(board),
            variables: board.variables.clone(),
            owners: vec![[None; 2]; board.limits.len()],
            // Lists that nothing asks for stay empty, because each copy of
            // a scene copies them.
            triggering: if board.asks_triggering() {
                vec![Vec::new(); board.elements.len()]
            } else {
                Vec::new()
            },
            ways_m: if board.conditions.iter().any(asks_way) {
                vec![0.0; board.limits.len()]
            } else {
                Vec::new()
            },
            time_s: None,
        }
    }

    /// Runs to an instant and appends the changes of state in the order of time.
    ///
    /// The first call starts the storyboard at that instant. The stage must know all
    /// motion from the instant of the last call on.
    pub fn step<S: StoryStage + ?Sized>(
        &mut self,
        board: &CheckedStoryboard,
        stage: &mut S,
        to_s: f64,
        changes: &mut Vec<ElementChange>,
    ) {
        let begun_s = self.time_s;
        let mut step = StoryStep {
            board,
            stage,
            changes,
            // The first call has no beginning, so the storyboard starts at its
            // instant.
            now_s: begun_s.unwrap_or(to_s),
            run: self,
        };
        if begun_s.is_none() {
            step.start(0);
            step.settle();
        }
        while step.now_s < to_s {
            // The grid counts from the episode's start, so that it is the same for all
            // sample times.
            // Without the summand, rounding could yield the present instant for ever.
            let look_s = ((step.now_s / LOOK_S + 1e-6).floor() + 1.0) * LOOK_S;
            let next_s = step.next_s(look_s.min(to_s));
            step.go_to(next_s);
            step.settle();
        }
        self.time_s = Some(to_s);
    }

    /// Returns whether an element is in a state, or in a transition at `at_s`.
    pub fn is_in(&self, element: usize, state: ElementState, at_s: f64) -> bool {
        let run = &self.elements[element];
        match state {
            ElementState::StandbyState => run.life == Life::Standby,
            ElementState::RunningState => run.life == Life::Running,
            ElementState::CompleteState => run.life == Life::Complete,
            // Exact equality: a transition counts at the very instant of its record.
            transition => run.transitions_s[place_of(transition)] == Some(at_s),
        }
    }

    /// Returns a variable by its position in the storyboard.
    pub fn variable(&self, number: usize) -> f64 {
        self.variables[number]
    }

    fn expressed<V: StoryView + ?Sized>(
        &self,
        view: &V,
        condition: &CheckedCondition,
        look: Look,
    ) -> Expressed {
        let Look { since_s, at_s } = look;
        let truth = |holds: bool| Expressed {
            holds,
            key: u64::from(holds),
        };
        match &condition.is {
            CheckedExpression::SimulationTime(with) => compared(Some(at_s), with),
            CheckedExpression::Element { element, state } => {
                // States change at settled instants only, never on the way to them.
                truth(self.is_in(*element, *state, since_s))
            }
            // Variables change at settled instants only, so they have no instant here.
            CheckedExpression::Variable {
                number,
                compared: with,
            } => compared(Some(self.variables[*number]), with),
            CheckedExpression::Parameter {
                number,
                compared: with,
            } => compared(Some(view.parameter(*number)), with),
            CheckedExpression::Formula(number) => truth(view.robustness(*number).holds(at_s)),
            CheckedExpression::Signal { light, state } => {
                truth(view.signal(*light, at_s) == *state)
            }
            CheckedExpression::Agents { agents, rule, is } => {
                let instant = Instant {
                    view,
                    at_s,
                    ways_m: &self.ways_m,
                    since_s,
                };
                instant.agents(agents, *rule, is)
            }
        }
    }
}

/// Returns the place of a transition in the record of an element.
fn place_of(transition: ElementState) -> usize {
    match transition {
        ElementState::EndTransition => 1,
        ElementState::StopTransition => 2,
        ElementState::SkipTransition => 3,
        _ => 0,
    }
}

fn asks_way(condition: &CheckedCondition) -> bool {
    let CheckedExpression::Agents { is, .. } = &condition.is else {
        return false;
    };
    matches!(is, AgentExpression::Number(AgentQuantity::Way, _))
}

impl<S: StoryStage + ?Sized> StoryStep<'_, S> {
    fn go_to(&mut self, at_s: f64) {
        for (agent, way_m) in self.run.ways_m.iter_mut().enumerate() {
            let before = self.stage.motion(agent, self.now_s).pose;
            // The distance between looks is a chord, short enough for a bend
            // of a road.
            *way_m += apart_m(&before, &self.stage.motion(agent, at_s).pose);
        }
        self.now_s = at_s;
    }

    /// Lets all elements change that are due now, until none is.
    fn settle(&mut self) {
        // Each round completes, starts or stops an element. Elements that repeat wait for
        // the next look, so the rounds of an instant are bounded.
        for _ in 0..16 * self.board.elements.len() {
            self.check();
            // All of a round are found before the first of them changes, so their
            // order in the file has no effect on which are due.
            let all: Vec<(usize, Due)> = (0..self.board.elements.len())
                .filter_map(|element| Some((element, self.due(element)?)))
                .collect();
            // Events that are over must not block those that start at the same instant.
            let Some(first) = all.iter().map(|it| it.1).min() else {
                return;
            };
            for (element, due) in all.into_iter().filter(|it| it.1 == first) {
                self.change(element, due);
            }
        }
    }

    fn check(&mut self) {
        let watched: Vec<usize> = self.watched().collect();
        for number in watched {
            let condition = &self.board.conditions[number];
            let look = Look {
                since_s: self.now_s,
                at_s: self.now_s,
            };
            let now = self.run.expressed(&*self.stage, condition, look);
            self.run.conditions[number].check(condition, condition.edge, now, self.now_s);
            self.check_agents(number);
        }
    }

    fn triggers(&self, groups: &[Vec<usize>]) -> bool {
        let is_true = |number: &usize| self.run.conditions[*number].is_true(self.now_s);
        groups.iter().any(|group| group.iter().all(is_true))
    }

    fn due(&self, number: usize) -> Option<Due> {
        let (element, run) = (&self.board.elements[number], &self.run.elements[number]);
        match run.life {
            Life::Idle | Life::Complete => None,
            // Before the start, so that an element with both triggers true never begins.
            Life::Standby | Life::Running if self.triggers(&element.stop) => Some(Due::Stop),
            Life::Standby => {
                let starts = self.triggers(&element.start) && self.may_repeat(run);
                starts.then_some(Due::Start)
            }
            // Only its stop trigger ends a storyboard.
            Life::Running if element.kind == ElementKind::Storyboard => None,
            Life::Running => {
                let is_over = match &element.effect {
                    Some(effect) => self.is_performed(number, effect),
                    None => {
                        let mut children = element.children.iter();
                        children.all(|it| self.run.elements[*it].life == Life::Complete)
                    }
                };
                // Events wait for a repetition in standby, but groups
                // repeat at their end.
                let repeats = element.kind == ElementKind::ManeuverGroup
                    && run.executions < element.most_executions;
                (is_over && (!repeats || self.may_repeat(run))).then_some(Due::End)
            }
        }
    }

    /// An element that takes no time must not repeat endlessly at one instant.
    fn may_repeat(&self, run: &ElementRun) -> bool {
        let look = |at_s: f64| (at_s / LOOK_S + 1e-6).floor();
        run.triggered_s
            .is_none_or(|before_s| look(before_s) < look(self.now_s))
    }

    fn change(&mut self, number: usize, due: Due) {
        let life = self.run.elements[number].life;
        match (due, life) {
            (Due::Stop, Life::Standby | Life::Running) => self.stop(number),
            (Due::Start, Life::Standby) => self.start(number),
            (Due::End, Life::Running) => self.end(number),
            // An earlier change of this round has overtaken it.
            _ => {}
        }
    }

    fn record(&mut self, element: usize, transition: ElementState) {
        let at_s = self.now_s;
        self.run.elements[element].transitions_s[place_of(transition)] = Some(at_s);
        self.changes.push(ElementChange {
            element,
            transition,
            at_s,
        });
    }

    /// Starts an element whose trigger is true, unless its priority forbids it.
    fn start(&mut self, number: usize) {
        let element = &self.board.elements[number];
        let run = &mut self.run.elements[number];
        // Counted before the priority decides, because a skipped start
        // is an execution, too.
        run.executions += 1;
        run.triggered_s = Some(self.now_s);
        let executions = run.executions;
        if element.kind == ElementKind::Event {
            let siblings = self.board.elements[element.parent].children.iter();
            let running: Vec<usize> = siblings
                .copied()
                .filter(|it| self.run.elements[*it].life == Life::Running)
                .collect();
            match element.priority {
                EventPriority::Parallel => {}
                EventPriority::Override => running.into_iter().for_each(|it| self.stop(it)),
                EventPriority::Skip if running.is_empty() => {}
                EventPriority::Skip => {
                    self.record(number, ElementState::SkipTransition);
                    self.wait_or_complete(number, executions < element.most_executions);
                    return;
                }
            }
        }
        self.run.elements[number].life = Life::Running;
        // Before the parts begin, whose actions ask for these agents.
        self.note_triggering(number);
        self.record(number, ElementState::StartTransition);
        self.begin_parts(number);
    }

    fn begin_parts(&mut self, number: usize) {
        let board = self.board;
        for child in &board.elements[number].children {
            // A parent that starts again counts the executions of its parts
            // anew.
            self.run.elements[*child].executions = 0;
            self.run.elements[*child].triggered_s = None;
            // Old checks of a stop trigger could stop the element at once.
            self.watch_anew(&board.elements[*child].stop);
            // Without a trigger, an element starts with its parent and has no standby.
            if board.elements[*child].start.is_empty() {
                self.start(*child);
            } else {
                self.wait_or_complete(*child, true);
            }
        }
        match &board.elements[number].effect {
            Some(CheckedEffect::Of { actors, action }) => self.begin_agents(number, actors, action),
            Some(CheckedEffect::Variable { number, change }) => {
                let value = &mut self.run.variables[*number];
                *value = match change {
                    VariableChange::Set(to) => *to,
                    VariableChange::Add(by) => *value + by,
                    VariableChange::Multiply(by) => *value * by,
                };
            }
            Some(CheckedEffect::Scene(change)) => self.stage.change(*change, self.now_s),
            None => {}
        }
    }

    /// Conditions forget all checks before the element waits for them.
    fn watch_anew(&mut self, groups: &[Vec<usize>]) {
        for number in groups.iter().flatten() {
            self.run.conditions[*number] = ConditionRun::default();
            self.run.of_agents[*number].fill(ConditionRun::default());
            if let CheckedExpression::Formula(formula) = self.board.conditions[*number].is {
                self.stage.watch(formula, self.now_s);
            }
        }
    }

    fn wait_or_complete(&mut self, number: usize, waits: bool) {
        if waits {
            self.watch_anew(&self.board.elements[number].start);
        }
        let life = if waits { Life::Standby } else { Life::Complete };
        self.run.elements[number].life = life;
    }

    fn end(&mut self, number: usize) {
        let element = &self.board.elements[number];
        // Released before the record, because it decides between end and stop.
        let was_taken = self.release(number);
        // An action that another one took over has not ended by itself.
        self.record(
            number,
            if was_taken {
                ElementState::StopTransition
            } else {
                ElementState::EndTransition
            },
        );
        let repeats = self.run.elements[number].executions < element.most_executions;
        match element.kind {
            ElementKind::Event => self.wait_or_complete(number, repeats),
            // No trigger makes a group wait, so it starts again at its end.
            ElementKind::ManeuverGroup if repeats => self.start(number),
            _ => self.wait_or_complete(number, false),
        }
    }

    fn stop(&mut self, number: usize) {
        let element = &self.board.elements[number];
        // Agents stop while the element still owns them.
        self.stop_agents(number);
        self.release(number);
        for child in &element.children {
            // Idle and complete parts have no transition that a record could show.
            if matches!(
                self.run.elements[*child].life,
                Life::Standby | Life::Running
            ) {
                self.stop(*child);
            }
        }
        self.run.elements[number].life = Life::Complete;
        self.record(number, ElementState::StopTransition);
    }
}
