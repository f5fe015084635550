//! Starts that were played several times: egos that do not answer twice alike.

use serde::{Deserialize, Serialize};

use crate::stats::{Outcomes, StartOutcome, runs_interval};
use crate::testbench::Episode;
use crate::world::Repeats;

/// What several runs of each start showed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeated {
    /// Runs per start.
    pub runs: u32,
    /// A start is solved when the ego fails in so many of them.
    pub gate: u32,
    /// Share of all runs, over all starts, in which the ego fails.
    pub failing_share: f64,
    /// Its 95 % interval over other starts and other runs of them.
    pub ci95: [f64; 2],
    /// Starts on which the ego did not answer alike in every run.
    pub differing: usize,
}

impl Repeated {
    /// Sums up the starts that were played; `None`: each only once.
    pub fn of<'a>(
        asked: Repeats,
        starts: impl Iterator<Item = Option<&'a StartRepeated>>,
    ) -> Option<Repeated> {
        let Repeats { runs, gate } = asked;
        let starts: Vec<&StartRepeated> = starts.flatten().collect();
        if runs < 2 || starts.is_empty() {
            return None;
        }
        let of_run = |run: usize| -> Outcomes {
            let outcomes = starts.iter().map(|start| start.outcomes.get(run).copied());
            outcomes
                .map(|outcome| outcome.unwrap_or(StartOutcome::NotReached))
                .collect()
        };
        let all: Vec<Outcomes> = (0..runs as usize).map(of_run).collect();
        let count = |outcome| all.iter().map(|run| run.count(outcome)).sum::<usize>();
        let failing = count(StartOutcome::Solved);
        let held = count(StartOutcome::Unsolved);
        Some(Repeated {
            runs,
            gate,
            failing_share: failing as f64 / (failing + held).max(1) as f64,
            ci95: runs_interval(&all.iter().collect::<Vec<_>>()),
            differing: starts.iter().filter(|start| start.differs).count(),
        })
    }
}

/// The runs of one start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartRepeated {
    /// Per run.
    outcomes: Outcomes,
    /// Whether the ego commanded otherwise in one of them.
    differs: bool,
}

impl StartRepeated {
    /// Sums up runs of one start, at least one, and says which of them stands
    /// for all: a failure if there are `gate` of them, else a run that was no
    /// failure, an invalid one first, since nobody knows what it would have been.
    pub fn of(episodes: &[Episode], gate: u32) -> (StartRepeated, usize) {
        use StartOutcome::{Invalid, Solved, Unsolved};
        let verdicts = episodes.iter().map(|episode| &episode.verdict);
        let outcomes: Outcomes = verdicts.map(StartOutcome::of).collect();
        let first = |wanted| outcomes.iter().position(|outcome| *outcome == wanted);
        let standing = match gate.max(1) as usize <= outcomes.count(Solved) {
            true => first(Solved),
            false => first(Invalid).or(first(Unsolved)),
        };
        let differs = episodes.windows(2).any(|pair| {
            let same = pair[0].commands == pair[1].commands && pair[0].trace == pair[1].trace;
            !same && pair.iter().all(|episode| episode.fault.is_none())
        });
        // Invariant: fewer failures than the gate leave a run that is none.
        (StartRepeated { outcomes, differs }, standing.unwrap_or(0))
    }

    /// Runs in which the ego failed, and all that ran.
    pub fn failing(&self) -> (usize, usize) {
        let failing = self.outcomes.count(StartOutcome::Solved);
        (
            failing,
            failing + self.outcomes.count(StartOutcome::Unsolved),
        )
    }

    /// Whether the ego commanded otherwise in one of the runs.
    pub fn differs(&self) -> bool {
        self.differs
    }
}
