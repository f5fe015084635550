//! How much is thought over a run before and while it is played.

/// Where a sequence of actions may be switched.
#[derive(Clone, Copy, Debug)]
struct Grid {
    /// With one switch: at every so many-th decision.
    one: usize,
    /// With two: at every so many-th at least.
    two: usize,
    /// With many actions or decisions two switches are further apart: so many
    /// sequences are looked through at most.
    most: usize,
}

/// Two switches, as many as three actions and 30 decisions come to.
const FINE: Grid = Grid {
    one: 1,
    two: 2,
    most: 6_000,
};
/// So many sequences are looked through where nothing else was found: some five times
/// as long.
const FINEST: usize = 30_000;
/// What is looked through again and again.
const QUICK: Grid = Grid {
    one: 1,
    two: 4,
    most: 2_000,
};

/// How much is thought over a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Care {
    /// Leading variations that a plan is looked for on where there is none for the
    /// surrogate itself.
    pub leads: usize,
    /// Where nothing was played yet, for the surrogate itself.
    first: Grid,
    /// For its variations, and on the way.
    later: Grid,
    /// Whether switches are closer together in the end where nothing else was found.
    is_finest: bool,
    /// After a search in vain so many decisions pass until the next one, and after
    /// every further one twice as many.
    rest: usize,
}

impl Care {
    /// For a run that counts.
    pub const FULL: Care = Care {
        leads: 4,
        first: FINE,
        later: QUICK,
        is_finest: true,
        rest: 0,
    };
    /// For a run that is recorded to learn from: it need not succeed, and there are
    /// many of them.
    pub const BRIEF: Care = Care {
        leads: 2,
        first: QUICK,
        later: Grid { one: 2, ..QUICK },
        is_finest: false,
        rest: 4,
    };

    /// How far apart switches are in sequences with so many of them, of so many
    /// actions and decisions.
    pub fn stride(&self, size: (usize, usize), switches: usize, is_first: bool) -> usize {
        let grid = if is_first { self.first } else { self.later };
        match switches {
            0 | 1 => grid.one,
            _ => stride(size, grid.two, grid.most),
        }
    }

    /// The same where nothing was found and more is looked at, if that is any finer.
    pub fn finest(&self, size: (usize, usize)) -> Option<usize> {
        let finest = stride(size, 1, FINEST);
        (self.is_finest && finest < self.stride(size, 2, true)).then_some(finest)
    }

    /// For how many decisions nothing is thought over after so many searches in vain.
    pub fn rest(&self, in_vain: u32) -> usize {
        match in_vain {
            0 => 0,
            _ => self.rest << (in_vain - 1).min(8),
        }
    }
}

/// How far apart two switches are, at least so many decisions, for so many sequences
/// of actions at most.
fn stride((actions, decisions): (usize, usize), least: usize, most: usize) -> usize {
    let others = actions.saturating_sub(1);
    let sequences = |stride: usize| {
        let places = decisions / stride;
        actions * others * others * places * places.saturating_sub(1) / 2
    };
    (least..decisions)
        .find(|&stride| sequences(stride) <= most)
        .unwrap_or(decisions.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn with_many_actions_switches_are_further_apart() {
        // `acc`: all of them; `cut_in`: every fifth decision, every seventh, and every
        // other one in the end.
        assert_eq!(Care::FULL.finest((3, 30)), Some(1));
        assert_eq!(Care::FULL.stride((3, 30), 2, true), 2);
        assert_eq!(Care::FULL.stride((3, 30), 2, false), 4);
        assert_eq!(Care::FULL.finest((6, 40)), Some(2));
        assert_eq!(Care::FULL.finest((10, 100)), Some(11));
        assert_eq!(Care::FULL.stride((6, 40), 2, true), 5);
        assert_eq!(Care::FULL.stride((6, 40), 2, false), 7);
        // Nothing to switch to, and so much that nothing is left to switch at.
        assert_eq!(stride((1, 40), 1, 6_000), 1);
        assert_eq!(stride((1000, 40), 1, 6_000), 21);
        assert_eq!(stride((3, 1), 1, 6_000), 1);
    }

    #[test]
    fn a_recorded_run_is_thought_over_less_and_less_often() {
        assert_eq!([0, 1, 2, 3].map(|n| Care::FULL.rest(n)), [0; 4]);
        assert_eq!([0, 1, 2, 3].map(|n| Care::BRIEF.rest(n)), [0, 4, 8, 16]);
        assert_eq!(Care::BRIEF.finest((3, 30)), None);
    }
}
