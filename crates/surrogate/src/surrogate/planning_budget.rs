//! Effort of planning a run.

/// Spacing of the decisions at which a sequence may switch actions.
#[derive(Clone, Copy, Debug)]
struct SwitchSpacing {
    /// Spacing with one switch, decisions.
    one: usize,
    /// Smallest spacing with two switches, decisions.
    two: usize,
    /// Largest number of sequences with two switches.
    ///
    /// Many actions or decisions widen the spacing until this limit holds.
    most: usize,
}

/// Spacing that suits three actions and 30 decisions.
const FINE: SwitchSpacing = SwitchSpacing {
    one: 1,
    two: 2,
    most: 6_000,
};
/// Largest number of sequences if nothing else was found, about five times as slow.
const FINEST: usize = 30_000;
/// Spacing for searches that are repeated often.
const QUICK: SwitchSpacing = SwitchSpacing {
    one: 1,
    two: 4,
    most: 2_000,
};

/// Planning effort of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlanningBudget {
    /// Number of leading variations to plan for.
    ///
    /// They are tried if the surrogate itself has no plan.
    pub leads: usize,
    /// Spacing before the first action, for the surrogate itself.
    first: SwitchSpacing,
    /// Spacing for its variations and during the run.
    later: SwitchSpacing,
    /// Whether a last, finer search follows if nothing else was found.
    is_finest: bool,
    /// Decisions without a search after the first search in vain.
    ///
    /// Every further search in vain doubles them.
    rest: usize,
}

impl PlanningBudget {
    /// Effort for a run that counts.
    pub(super) const FULL: PlanningBudget = PlanningBudget {
        leads: 4,
        first: FINE,
        later: QUICK,
        is_finest: true,
        rest: 0,
    };
    /// Effort for a run that is recorded for learning.
    ///
    /// Such a run need not succeed, and there are many of them.
    pub(super) const BRIEF: PlanningBudget = PlanningBudget {
        leads: 2,
        first: QUICK,
        later: SwitchSpacing { one: 2, ..QUICK },
        is_finest: false,
        rest: 4,
    };

    /// Returns the spacing of the switches of a sequence.
    pub(super) fn stride(
        &self,
        actions: usize,
        decisions: usize,
        switches: usize,
        is_first: bool,
    ) -> usize {
        let grid = if is_first { self.first } else { self.later };
        match switches {
            0 | 1 => grid.one,
            _ => stride(actions, decisions, grid.two, grid.most),
        }
    }

    /// Returns the spacing of the last search, if it is finer than the first search.
    pub(super) fn finest(&self, actions: usize, decisions: usize) -> Option<usize> {
        let finest = stride(actions, decisions, 1, FINEST);
        // Otherwise the first pass was as fine already.
        (self.is_finest && finest < self.stride(actions, decisions, 2, true)).then_some(finest)
    }

    /// Returns the number of decisions without a search after `in_vain` failures.
    pub(super) fn rest(&self, in_vain: u32) -> usize {
        match in_vain {
            0 => 0,
            // The shift is bounded, so the pause cannot overflow.
            _ => self.rest << (in_vain - 1).min(8),
        }
    }
}

/// Returns the smallest spacing, at least `least`, with at most `most` sequences.
fn stride(actions: usize, decisions: usize, least: usize, most: usize) -> usize {
    let others = actions.saturating_sub(1);
    let sequences = |stride: usize| {
        let places = decisions / stride;
        // Three actions in a row, neighbours different, and two ordered places.
        actions * others * others * places * places.saturating_sub(1) / 2
    };
    (least..decisions)
        // A run too short for any switch gets a spacing of its whole length.
        .find(|&stride| sequences(stride) <= most)
        .unwrap_or(decisions.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn with_many_actions_switches_are_further_apart() {
        // `acc` is searched completely. `cut_in` is searched at every fifth or seventh
        // decision, and at every second decision in the last search.
        assert_eq!(PlanningBudget::FULL.finest(3, 30), Some(1));
        assert_eq!(PlanningBudget::FULL.stride(3, 30, 2, true), 2);
        assert_eq!(PlanningBudget::FULL.stride(3, 30, 2, false), 4);
        assert_eq!(PlanningBudget::FULL.finest(6, 40), Some(2));
        assert_eq!(PlanningBudget::FULL.finest(10, 100), Some(11));
        assert_eq!(PlanningBudget::FULL.stride(6, 40, 2, true), 5);
        assert_eq!(PlanningBudget::FULL.stride(6, 40, 2, false), 7);
        // A single action has no switches, and too many actions leave no place for them.
        assert_eq!(stride(1, 40, 1, 6_000), 1);
        assert_eq!(stride(1000, 40, 1, 6_000), 21);
        assert_eq!(stride(3, 1, 1, 6_000), 1);
    }

    #[test]
    fn a_recorded_run_is_thought_over_less_and_less_often() {
        assert_eq!([0, 1, 2, 3].map(|n| PlanningBudget::FULL.rest(n)), [0; 4]);
        assert_eq!(
            [0, 1, 2, 3].map(|n| PlanningBudget::BRIEF.rest(n)),
            [0, 4, 8, 16]
        );
        assert_eq!(PlanningBudget::BRIEF.finest(3, 30), None);
    }
}
