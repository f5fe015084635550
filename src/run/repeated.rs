//! Starts that were played several times: egos that do not answer twice alike.

use serde::{Deserialize, Serialize};

use super::interval::runs_interval;
use crate::rulebook::Verdict;
use crate::scenario::Repeats;
use crate::testbench::Episode;

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
        // One string of marks per run.
        let marks_of = |run: usize| -> String {
            let marks = starts.iter().map(|start| start.marks.get(run));
            marks.map(|mark| mark.copied().unwrap_or('-')).collect()
        };
        let marks: Vec<String> = (0..runs as usize).map(marks_of).collect();
        let all: Vec<&str> = marks.iter().map(String::as_str).collect();
        let count = |wanted: char| {
            marks
                .iter()
                .flat_map(|m| m.chars().filter(move |m| *m == wanted))
                .count()
        };
        let (failing, held) = (count('1'), count('0'));
        Some(Repeated {
            runs,
            gate,
            failing_share: failing as f64 / (failing + held).max(1) as f64,
            ci95: runs_interval(&all),
            differing: starts.iter().filter(|start| start.differs).count(),
        })
    }
}

/// The runs of one start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartRepeated {
    /// Per run: 1 the ego failed, 0 it did not, x it did not run.
    marks: Vec<char>,
    /// Whether the ego commanded otherwise in one of them.
    differs: bool,
}

impl StartRepeated {
    /// Sums up runs of one start, at least one, and says which of them stands
    /// for all: a failure if there are `gate` of them, else a run that was no
    /// failure, an invalid one first, since nobody knows what it would have been.
    pub fn of(episodes: &[Episode], gate: u32) -> (StartRepeated, usize) {
        let mark = |episode: &Episode| match episode.verdict {
            Verdict::Counterexample { .. } => '1',
            Verdict::Held { .. } | Verdict::Foul { .. } => '0',
            Verdict::Invalid => 'x',
        };
        let marks: Vec<char> = episodes.iter().map(mark).collect();
        let first = |wanted: char| marks.iter().position(|mark| *mark == wanted);
        let failures = marks.iter().filter(|mark| **mark == '1').count();
        let standing = match gate.max(1) as usize <= failures {
            true => first('1'),
            false => first('x').or(first('0')),
        };
        let differs = episodes.windows(2).any(|pair| {
            let same = pair[0].commands == pair[1].commands && pair[0].trace == pair[1].trace;
            !same && pair.iter().all(|episode| episode.fault.is_none())
        });
        // Invariant: fewer failures than the gate leave a run that is none.
        (StartRepeated { marks, differs }, standing.unwrap_or(0))
    }

    /// Runs in which the ego failed, and all that ran.
    pub fn failing(&self) -> (usize, usize) {
        let count = |wanted: char| self.marks.iter().filter(|mark| **mark == wanted).count();
        (count('1'), count('1') + count('0'))
    }

    /// Whether the ego commanded otherwise in one of the runs.
    pub fn differs(&self) -> bool {
        self.differs
    }
}
