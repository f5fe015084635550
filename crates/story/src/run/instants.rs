//! Search for the next instant at which an element may change.

use super::{Life, Look, StoryStep};
use crate::tree::{CheckedCondition, CheckedExpression};
use crate::trigger::ConditionRun;
use crate::view::{MotionDomain, StoryStage};

/// Halvings of a look, which find an instant to less than 0.1 ns.
const HALVINGS: u32 = 30;
/// Domains in the order of an agent's owners.
const DOMAINS: [MotionDomain; 2] = [MotionDomain::Longitudinal, MotionDomain::Lateral];

impl<S: StoryStage + ?Sized> StoryStep<'_, S> {
    /// Returns the next instant up to `look_s` at which anything may change.
    pub(super) fn next_s(&self, look_s: f64) -> f64 {
        let mut next_s = look_s;
        for (agent, owners) in self.run.owners.iter().enumerate() {
            // No element waits for the end of a motion without an owner.
            for (domain, _) in DOMAINS.iter().zip(owners).filter(|it| it.1.is_some()) {
                next_s = self.earlier(next_s, self.stage.ends_s(agent, *domain));
            }
        }
        for number in self.watched() {
            let (condition, run) = (&self.board.conditions[number], &self.run.conditions[number]);
            // Each search ends at the earliest instant so far, so none looks beyond it.
            next_s = self.earlier(next_s, run.next_s(condition));
            next_s = self.change_s(condition, run, next_s);
        }
        next_s
    }

    fn earlier(&self, next_s: f64, other_s: f64) -> f64 {
        // An end in the past is handled already, and would stop time.
        if self.now_s < other_s {
            next_s.min(other_s)
        } else {
            next_s
        }
    }

    /// Returns the first change of an expression up to an instant, or that instant.
    fn change_s(&self, condition: &CheckedCondition, run: &ConditionRun, next_s: f64) -> f64 {
        let is_same = |at_s: f64| {
            let look = Look {
                since_s: self.now_s,
                at_s,
            };
            let now = self.run.expressed(&*self.stage, condition, look);
            // Without an earlier key there is nothing to differ from.
            run.key().is_none_or(|key| key == now.key)
        };
        // A change and its reversal between two looks stay unseen, as documented for
        // their distance.
        if is_same(next_s) {
            return next_s;
        }
        // The line between two samples has its zero in closed form.
        if let CheckedExpression::Formula(formula) = condition.is
            && let Some(exact_s) = self.stage.robustness(formula).change_s()
            && self.now_s < exact_s
        {
            return exact_s;
        }
        let (mut from_s, mut to_s) = (self.now_s, next_s);
        for _ in 0..HALVINGS {
            let middle_s = 0.5 * (from_s + to_s);
            if is_same(middle_s) {
                from_s = middle_s;
            } else {
                to_s = middle_s;
            }
        }
        // The later end, where the expression has certainly changed.
        to_s
    }

    /// Returns the conditions that are checked now.
    pub(super) fn watched(&self) -> impl Iterator<Item = usize> {
        let elements = self.board.elements.iter().zip(&self.run.elements);
        elements.flat_map(|(element, run)| {
            let starts = run.life == Life::Standby;
            let lives = starts || run.life == Life::Running;
            let start = element.start.iter().filter(move |_| starts);
            // A stop trigger also counts while its element waits.
            let stop = element.stop.iter().filter(move |_| lives);
            start.chain(stop).flatten().copied()
        })
    }
}
