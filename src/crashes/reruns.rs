//! Runs of an ego for questions about one of its counterexamples.
//!
//! A stock ego is deterministic and can be copied, so it is asked for free. A
//! program or a type of the user's may be neither, and each of its runs takes
//! time. So before anything else is asked, the counterexample is played twice
//! more: an ego whose commands are the same bit for bit is asked every question
//! once. Another one is asked as often as the world's `repeats` say, or not at
//! all. Runs are counted, and limited for egos that cannot be copied.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::experiment::Watch;
use crate::rulebook::Verdict;
use crate::run_dir::{EgoRuns, NotAsked, StartRepeated};
use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, FaultLog, Replay, play};
use crate::world::{Repeats, Scenario};

/// Runs of a program that one counterexample may take, unless others are asked for.
pub const KEEP_RUNS: u64 = 300;

/// Runs with which a counterexample is compared before anything else is asked.
const COMPARED: usize = 2;

/// An ego that is asked about one counterexample.
pub(super) struct Reruns<'a> {
    /// The world, with as many repeats as each question takes.
    scenario: Scenario,
    kind: EgoRerunKind,
    /// Runs that may be spent where each is a whole one.
    limit: u64,
    spent: AtomicU64,
    /// Why nothing is asked at all.
    refused: Option<NotAsked>,
    /// Why some questions were not asked, the first reason.
    ended: OnceLock<NotAsked>,
    faults: FaultLog,
    watch: &'a Watch<'a>,
}

/// How an ego can be asked.
#[derive(Clone, Copy, PartialEq, Eq)]
enum EgoRerunKind {
    /// One of ours: nobody counts.
    Stock,
    /// The user's, which can be copied in the middle of a run.
    Copied,
    /// A program, or the user's without copies.
    Whole,
}

impl<'a> Reruns<'a> {
    /// Plays `episode` again if its ego is not one of ours.
    pub fn of(
        scenario: &Scenario,
        episode: &Episode,
        limit: u64,
        watch: &'a Watch<'a>,
    ) -> Reruns<'a> {
        let ego = scenario.drive().map(|spec| &spec.ego);
        let foreign = ego.is_some_and(|ego| ego.is_foreign());
        let kind = match (
            foreign,
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
        reruns.refused = match ego.is_some_and(|ego| ego.is_recorded()) {
            true => Some(NotAsked::CommandsOnly),
            false if foreign => reruns.compare(scenario.repeats(), episode).err(),
            false => None,
        };
        reruns
    }

    /// Plays the episode again: an ego that is not deterministic is asked by
    /// the world's repeats, or not at all.
    fn compare(&mut self, repeats: Repeats, episode: &Episode) -> Result<(), NotAsked> {
        let from = (&episode.start, episode.noise);
        // Twice, for egos that take turns between two answers.
        for _ in 0..COMPARED {
            self.take(1, 0)?;
            let mut same = Replay::holding(&episode.actions);
            let again = self.played(&self.scenario, from, &mut same, Aftermath::Play);
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
            // What lies before a copy would be the same in all repeats.
            self.kind = EgoRerunKind::Whole;
            break;
        }
        Ok(())
    }

    /// When two runs first differ; `None`: they are the same.
    fn diverges_s(&self, one: &Episode, other: &Episode) -> Option<f64> {
        if one.commands == other.commands && one.trace == other.trace {
            return None;
        }
        let mut pairs = one.commands.iter().zip(&other.commands);
        let shorter = one.commands.len().min(other.commands.len());
        let sample = pairs.position(|(a, b)| a != b).unwrap_or(shorter);
        Some(sample as f64 * self.scenario.world().clock().sample_s)
    }

    /// The world in which it is asked.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// How it is stopped.
    pub fn watch(&self) -> &'a Watch<'a> {
        self.watch
    }

    /// Whether its runs can go on from the middle of others.
    pub fn copies(&self) -> bool {
        self.kind != EgoRerunKind::Whole
    }

    /// Whether nothing is asked of it at all.
    pub fn is_refused(&self) -> bool {
        self.refused.is_some()
    }

    /// What kept files say of it; `None`: it is one of ours.
    pub fn told(&self) -> Option<EgoRuns> {
        (self.kind != EgoRerunKind::Stock).then(|| EgoRuns {
            runs: self.spent.load(Ordering::Relaxed),
            copied: self.kind == EgoRerunKind::Copied && !self.is_refused(),
            ended: self.refused.as_ref().or(self.ended.get()).cloned(),
        })
    }

    /// Takes what so many questions cost, with so many left for later ones.
    ///
    /// # Errors
    /// They are not to be asked.
    pub fn ask(&self, questions: usize, for_later: usize) -> Result<(), NotAsked> {
        let runs = u64::from(self.scenario.repeats().runs.max(1));
        self.take(runs * questions as u64, runs * for_later as u64)
    }

    fn take(&self, runs: u64, for_later: u64) -> Result<(), NotAsked> {
        if let Some(refused) = &self.refused {
            return Err(refused.clone());
        }
        let spent = self.spent.load(Ordering::Relaxed);
        let needed = spent.saturating_add(runs).saturating_add(for_later);
        let reason = match self.kind {
            // It answers at once, whoever interrupts.
            EgoRerunKind::Stock => None,
            _ if self.watch.interrupted() => Some(NotAsked::Interrupted),
            _ if self.faults.has_given_up() => Some(NotAsked::EgoFailed),
            EgoRerunKind::Whole if self.limit < needed => {
                Some(NotAsked::RunLimit { runs: self.limit })
            }
            _ => None,
        };
        match reason {
            Some(reason) => {
                // The first reason stands.
                let _ = self.ended.set(reason.clone());
                Err(reason)
            }
            None => {
                self.count(runs);
                Ok(())
            }
        }
    }

    /// Counts runs that were not asked for one by one.
    pub fn count(&self, runs: u64) {
        self.spent.fetch_add(runs, Ordering::Relaxed);
    }

    /// So many questions at most, of which half of the runs are kept.
    pub fn at_most_half(&self, questions: usize) -> usize {
        let runs = u64::from(self.scenario.repeats().runs.max(1));
        let half = self.limit / 2 / runs;
        questions.min(usize::try_from(half).unwrap_or(usize::MAX))
    }

    /// Plays one question as often as it takes; the run that stands for all.
    pub fn played(
        &self,
        world: &Scenario,
        (start, noise): (&Start, u64),
        actor: &mut dyn Actor,
        aftermath: Aftermath,
    ) -> Episode {
        let Repeats { runs, gate } = self.scenario.repeats();
        let mut bench = world.bench();
        let mut once = |_| {
            let episode = play(&mut bench, start, noise, actor, aftermath);
            self.faults.note(0, episode.fault.as_ref());
            episode
        };
        let mut episodes: Vec<Episode> = (0..runs.max(1)).map(&mut once).collect();
        let (_, standing) = StartRepeated::of(&episodes, gate);
        episodes.swap_remove(standing)
    }

    /// Whether the ego holds where the ados act so, and the neutral action later.
    pub fn holds(&self, episode: &Episode, actions: &[usize]) -> bool {
        let neutral = self.scenario.world().spaces().neutral;
        let from = (&episode.start, episode.noise);
        let mut changed = Replay::then(actions, neutral);
        let played = self.played(&self.scenario, from, &mut changed, Aftermath::Skip);
        matches!(played.verdict, Verdict::Held { .. })
    }
}

/// Whether the ego of a world can be copied in the middle of an episode.
pub(crate) fn copies(scenario: &Scenario, start: &Start, noise: u64) -> bool {
    let mut bench = scenario.bench();
    bench.begin(start, noise, Aftermath::Skip);
    bench.fork().is_some()
}
