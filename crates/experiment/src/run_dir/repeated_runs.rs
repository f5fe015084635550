//! Outcome of a start that is played several times, and of all such starts.

use serde::{Deserialize, Serialize};

use crate::stats::{Outcomes, StartOutcome, runs_interval};
use crate::testbench::Episode;
use crate::world::Repeats;

/// Summary of several runs of each start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Repeated {
    /// Runs per start.
    pub runs: u32,
    /// Number of failures of the ego from which a start is solved.
    pub gate: u32,
    /// Share of all runs, over all starts, in which the ego fails.
    pub failing_share: f64,
    /// Its 95 % interval over other starts and other runs of them.
    pub ci95: [f64; 2],
    /// Starts on which the runs of the ego differ.
    pub differing: usize,
}

impl Repeated {
    /// Summarizes the starts that were played. `None` if each was played once.
    pub fn of<'a>(
        repeats: Repeats,
        starts: impl Iterator<Item = Option<&'a StartRepeated>>,
    ) -> Option<Repeated> {
        let Repeats { runs, gate } = repeats;
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
        // Invalid runs are in neither number, as in every rate.
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

/// Runs of one start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartRepeated {
    /// Outcomes, one per run.
    outcomes: Outcomes,
    /// True if the runs of the ego differ.
    differs: bool,
}

impl StartRepeated {
    /// Summarizes runs of one start, at least one, and returns the representative run.
    ///
    /// With `gate` failures it is a failure, otherwise a run without failure.
    /// An invalid run comes first, because its outcome is unknown.
    pub fn of(episodes: &[Episode], gate: u32) -> (StartRepeated, usize) {
        use StartOutcome::{Invalid, Solved, Unsolved};
        let verdicts = episodes.iter().map(|episode| &episode.verdict);
        // Marks join held runs and broken rules, and both are `Unsolved` from here on.
        let outcomes: Outcomes = verdicts.map(StartOutcome::from).collect();
        let first = |wanted| outcomes.iter().position(|outcome| *outcome == wanted);
        let standing = if gate.max(1) as usize <= outcomes.count(Solved) {
            first(Solved)
        } else {
            first(Invalid).or(first(Unsolved))
        };
        // Runs that fault end early, so their difference says nothing about determinism.
        let sound = episodes.iter().filter(|episode| episode.fault.is_none());
        let differs = sound
            .clone()
            .zip(sound.skip(1))
            .any(|(one, next)| one.commands != next.commands || one.trace != next.trace);
        // Invariant: fewer failures than the gate leave a run without failure.
        (StartRepeated { outcomes, differs }, standing.unwrap_or(0))
    }

    /// Returns the number of runs in which the ego failed, and of all valid runs.
    pub fn failing(&self) -> (usize, usize) {
        let failing = self.outcomes.count(StartOutcome::Solved);
        (
            failing,
            failing + self.outcomes.count(StartOutcome::Unsolved),
        )
    }

    /// Returns true if the runs of the ego differ.
    pub fn differs(&self) -> bool {
        self.differs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Fault;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::{Aftermath, Replay, play};
    use crate::world::Scenario;

    #[test]
    fn runs_differ_across_a_faulty_one_between_them() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let mut bench = world.bench();
        let key = StartKey {
            purpose: Purpose::Train,
            seed: 1,
            index: 0,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        let mut run = |action: usize| {
            let actions = [action];
            let mut held = Replay::holding(&actions);
            play(&mut bench, &start, noise, &mut held, Aftermath::Skip)
        };
        let (one, other) = (run(0), run(1));
        assert!(one.trace != other.trace);
        let mut faulty = one.clone();
        faulty.fault = Some(Fault::error("no answer"));
        let differs = |runs: &[&Episode]| {
            let runs: Vec<Episode> = runs.iter().map(|run| (*run).clone()).collect();
            StartRepeated::of(&runs, 1).0.differs()
        };
        assert!(differs(&[&one, &faulty, &other]));
        assert!(!differs(&[&one, &faulty, &one]));
        assert!(!differs(&[&faulty, &other]));
    }
}
