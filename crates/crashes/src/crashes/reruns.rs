//! Runs of an ego for questions about a counterexample.
//!
//! A stock ego is deterministic and can be copied, so its runs have no limit. A program
//! or a Rust type of a user may be neither, and each run takes time. The counterexample
//! is therefore played twice more at first. If the commands are the same bit for bit,
//! each question takes a single run. Otherwise it takes as many runs as the world's
//! `repeats`, or the questions are refused. Runs are counted, and limited for egos that
//! cannot be copied.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::experiment::Watch;
use crate::rulebook::Verdict;
use crate::run_dir::{EgoRuns, NotAsked, StartRepeated};
use crate::scene::Start;
use crate::scene::drive::EgoDrive;
use crate::testbench::{Actor, Aftermath, Episode, FaultLog, NoisyStart, Replay, Testbench, play};
use crate::world::{Repeats, Scenario};

/// Default of the runs of a program for a counterexample.
pub const KEEP_RUNS: u64 = 300;

/// Runs that are compared with the counterexample before any question.
const COMPARED: usize = 2;

/// Ego that answers questions about a counterexample.
pub(super) struct Reruns<'a> {
    /// World with the repeats that each question takes.
    scenario: Scenario,
    kind: EgoRerunKind,
    /// Limit of runs, for egos of which each run is a whole run.
    limit: u64,
    spent: AtomicU64,
    /// Reason why all questions are refused, if they are.
    refused: Option<NotAsked>,
    /// First reason why some questions were not asked.
    ended: OnceLock<NotAsked>,
    faults: FaultLog,
    watch: &'a Watch<'a>,
}

/// Capability of an ego to answer questions.
#[derive(Clone, Copy, PartialEq, Eq)]
enum EgoRerunKind {
    /// A stock ego, whose runs are not limited.
    Stock,
    /// An ego of the user that can be copied in the middle of a run.
    Copied,
    /// A program, or an ego of the user without copies.
    Whole,
}

impl<'a> Reruns<'a> {
    /// Plays `episode` again, unless its ego is a stock ego.
    pub(super) fn of(
        scenario: &Scenario,
        episode: &Episode,
        limit: u64,
        watch: &'a Watch<'a>,
    ) -> Reruns<'a> {
        let ego = scenario.ego();
        let foreign = ego.is_some_and(EgoDrive::is_foreign);
        let kind = match (
            foreign,
            // The test begins an episode, which starts a program, so stock egos skip it.
            foreign && copies(scenario, &episode.start, episode.noise),
        ) {
            (false, _) => EgoRerunKind::Stock,
            (true, true) => EgoRerunKind::Copied,
            (true, false) => EgoRerunKind::Whole,
        };
        let mut reruns = Reruns {
            scenario: scenario.repeated(Repeats::default()),
            kind,
            limit,
            spent: AtomicU64::new(0),
            refused: None,
            ended: OnceLock::new(),
            faults: FaultLog::default(),
            watch,
        };
        // Recorded commands do not answer a changed situation.
        reruns.refused = if ego.is_some_and(EgoDrive::is_recorded) {
            Some(NotAsked::CommandsOnly)
        } else if foreign {
            reruns.compare(scenario.repeats(), episode).err()
        } else {
            None
        };
        reruns
    }

    /// Plays the episode again to test whether its ego is deterministic.
    ///
    /// An ego that is not takes the world's repeats, or is refused.
    fn compare(&mut self, repeats: Repeats, episode: &Episode) -> Result<(), NotAsked> {
        let from = episode.noisy_start();
        // Twice, for egos that alternate between two behaviours.
        for _ in 0..COMPARED {
            self.take(1, 0)?;
            let mut same = Replay::holding(&episode.actions);
            let again = self.played(&self.scenario, from, &mut same, Aftermath::Play);
            // An ego that fails now cannot answer questions about a run without a fault.
            if again.fault.is_some() && episode.fault.is_none() {
                return Err(NotAsked::EgoFailed);
            }
            let Some(at_s) = self.diverges_s(episode, &again) else {
                continue;
            };
            if repeats.runs < 2 {
                return Err(NotAsked::NotDeterministic { at_s });
            }
            self.scenario = self.scenario.repeated(repeats);
            // A copy would share its past with all repeats, so each repeat is a whole
            // run.
            self.kind = EgoRerunKind::Whole;
            break;
        }
        Ok(())
    }

    /// Returns the time of the first difference of two runs, `None` if they are equal.
    fn diverges_s(&self, one: &Episode, other: &Episode) -> Option<f64> {
        if one.commands == other.commands && one.trace == other.trace {
            return None;
        }
        let mut pairs = one.commands.iter().zip(&other.commands);
        // Equal commands with different traces differ after the last common command.
        let shorter = one.commands.len().min(other.commands.len());
        let sample = pairs.position(|(a, b)| a != b).unwrap_or(shorter);
        Some(sample as f64 * self.scenario.world().clock().sample_s)
    }

    /// Returns the world in which questions are asked.
    pub(super) fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Returns the watch that can stop the questions.
    pub(super) fn watch(&self) -> &'a Watch<'a> {
        self.watch
    }

    /// Returns whether a run can continue from a copy of another run.
    pub(super) fn copies(&self) -> bool {
        self.kind != EgoRerunKind::Whole
    }

    /// Returns whether all questions are refused.
    pub(super) fn is_refused(&self) -> bool {
        self.refused.is_some()
    }

    /// Returns the record of the runs for kept files, `None` for a stock ego.
    pub(super) fn summary(&self) -> Option<EgoRuns> {
        (self.kind != EgoRerunKind::Stock).then(|| EgoRuns {
            runs: self.spent.load(Ordering::Relaxed),
            copied: self.kind == EgoRerunKind::Copied && !self.is_refused(),
            ended: self.refused.as_ref().or(self.ended.get()).cloned(),
        })
    }

    /// Takes the runs of some questions, and reserves runs for later questions.
    ///
    /// # Errors
    /// The questions must not be asked.
    pub(super) fn ask(&self, questions: usize, for_later: usize) -> Result<(), NotAsked> {
        let runs = u64::from(self.scenario.repeats().runs.max(1));
        self.take(runs * questions as u64, runs * for_later as u64)
    }

    fn take(&self, runs: u64, for_later: u64) -> Result<(), NotAsked> {
        if let Some(refused) = &self.refused {
            return Err(refused.clone());
        }
        // Relaxed suffices, because sequential callers alone depend on the limit.
        let spent = self.spent.load(Ordering::Relaxed);
        let needed = spent.saturating_add(runs).saturating_add(for_later);
        let reason = match self.kind {
            // A stock ego answers at once, so an interruption does not matter.
            EgoRerunKind::Stock => None,
            _ if self.watch.interrupted() => Some(NotAsked::Interrupted),
            _ if self.faults.has_given_up() => Some(NotAsked::EgoFailed),
            // Copies cost a part of a run, so only whole runs are limited.
            EgoRerunKind::Whole if self.limit < needed => {
                Some(NotAsked::RunLimit { runs: self.limit })
            }
            _ => None,
        };
        match reason {
            Some(reason) => {
                // Only the first reason is kept.
                let _ = self.ended.set(reason.clone());
                Err(reason)
            }
            None => {
                self.count(runs);
                Ok(())
            }
        }
    }

    /// Counts runs that were not requested individually.
    pub(super) fn count(&self, runs: u64) {
        self.spent.fetch_add(runs, Ordering::Relaxed);
    }

    /// Returns at most `questions`, limited to half of the runs.
    pub(super) fn at_most_half(&self, questions: usize) -> usize {
        let runs = u64::from(self.scenario.repeats().runs.max(1));
        // Minimization always gets the other half, even if the labels could use all of
        // it.
        let half = self.limit / 2 / runs;
        questions.min(usize::try_from(half).unwrap_or(usize::MAX))
    }

    /// Plays a question with all its repeats, and returns the representative run.
    pub(super) fn played(
        &self,
        world: &Scenario,
        from: NoisyStart<'_>,
        actor: &mut dyn Actor,
        aftermath: Aftermath,
    ) -> Episode {
        self.repeated(world, &mut |bench| {
            play(bench, from.start, from.noise, actor, aftermath)
        })
    }

    /// Plays a run with all its repeats, and returns the representative one.
    pub(super) fn repeated(
        &self,
        world: &Scenario,
        run: &mut dyn FnMut(&mut Testbench) -> Episode,
    ) -> Episode {
        let Repeats { runs, gate } = self.scenario.repeats();
        // One bench plays all repeats, so a program stays running between them.
        let mut bench = world.bench();
        let mut once = |_| {
            let episode = run(&mut bench);
            self.faults.note(0, episode.fault.as_ref());
            episode
        };
        let mut episodes: Vec<Episode> = (0..runs.max(1)).map(&mut once).collect();
        let (_, standing) = StartRepeated::of(&episodes, gate);
        episodes.swap_remove(standing)
    }

    /// Returns the verdict under these actions, followed by the neutral action.
    pub(super) fn verdict(&self, episode: &Episode, actions: &[usize]) -> Verdict {
        let neutral = self.scenario.world().spaces().neutral;
        let from = episode.noisy_start();
        let mut changed = Replay::then(actions, neutral);
        self.played(&self.scenario, from, &mut changed, Aftermath::Skip)
            .verdict
    }
}

/// Returns whether the ego of a world can be copied in the middle of an episode.
pub fn copies(scenario: &Scenario, start: &Start, noise: u64) -> bool {
    let mut bench = scenario.bench();
    // An ego exists from the beginning of an episode on, and can be copied only then.
    bench.begin(start, noise, Aftermath::Skip);
    bench.fork().is_some()
}
