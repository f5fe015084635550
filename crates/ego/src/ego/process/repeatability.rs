//! Check that the commands of a foreign ego depend on nothing but its episode.
//!
//! Episodes that were counted are played again, each against a fresh ego: a newly started
//! program, or a new controller of yours. The percepts are the recorded ones. As long as
//! the commands are equal, they are those of a closed loop, so nothing is simulated.
//!
//! Where a command differs, further fresh egos tell the reason. If they differ among each
//! other, the ego is random. If they differ as soon as they are asked at another pace, it
//! reads a clock. Otherwise only the used ego differs: it keeps state over `reset`.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::transcript::{Transcript, Transcripts};
use super::unrepeatable::{Cause, Unrepeatable};
use crate::ego::{Command, Controller, Fault};

/// Fewest episodes that are played again in the first check of an ego.
const LEAST: usize = 6;
/// Most episodes that are played again in a check.
const MOST: usize = 32;
/// Share of an ego's time since its first episode that all its checks may take.
const SHARE: f64 = 0.08;
/// Fresh egos asked without and with pauses, where a command differed.
const RUNS: usize = 4;
/// Pauses of a slow replay.
///
/// Egos that integrate over a clock drift apart within a few seconds, and egos that notice
/// a silence do so within half a second.
pub(super) const PAUSES: Pauses = Pauses {
    sum: Duration::from_millis(1900),
    long: Duration::from_millis(600),
};
/// Least sum of the pauses of a slow replay in a check.
const LEAST_PAUSES: Duration = Duration::from_millis(200);
/// Ratio of distances beyond which pace explains a difference, and chance does not.
const BY_PACE: f64 = 3.0;

/// Maker of fresh egos.
pub type Fresh<'a> = &'a (dyn Fn() -> Box<dyn Controller> + Sync);

/// Pace of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pace {
    /// Without pauses.
    Quick,
    /// With a pause before each step.
    Slow(Pauses),
}

/// Pauses of a slow replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pauses {
    /// Sum of the pauses before the steps.
    pub(super) sum: Duration,
    /// The long one among them.
    pub(super) long: Duration,
}

impl Transcript {
    /// Returns the commands of an ego on these percepts.
    pub(super) fn replay(
        &self,
        ego: &mut dyn Controller,
        pace: Pace,
    ) -> Result<Vec<Command>, Fault> {
        if let Some(briefing) = &self.briefing {
            ego.brief(briefing);
        }
        // After the briefing, as in an episode.
        ego.reset(self.seed);
        let count = u32::try_from(self.steps.len().max(1)).unwrap_or(u32::MAX);
        let mut commands = Vec::with_capacity(self.steps.len());
        let mut briefings = self.briefings.iter().peekable();
        for (step, (percept, _)) in self.steps.iter().enumerate() {
            // Roads can be laid during an episode, and each briefing belongs before its
            // step.
            while let Some((_, briefing)) = briefings.next_if(|(at, _)| *at <= step) {
                ego.brief(briefing);
            }
            if let Pace::Slow(Pauses { sum, long }) = pace {
                // A single long silence, for egos that notice one. The others are short.
                let is_long = step == self.steps.len() / 3;
                thread::sleep(if is_long { long } else { sum / count });
            }
            commands.push(ego.control(percept)?);
        }
        ego.finish();
        Ok(commands)
    }

    pub(super) fn commands(&self) -> Vec<Command> {
        self.steps.iter().map(|(_, command)| *command).collect()
    }

    fn unrepeatable(&self, cause: Cause, pair: [&[Command]; 2]) -> Option<Unrepeatable> {
        let [one, other] = pair;
        let at = first_difference(one, other)?;
        Some(Unrepeatable {
            cause,
            seed: self.seed,
            time_s: self.steps.get(at)?.0.time_s,
            command: *one.get(at)?,
            other: *other.get(at)?,
            differing: 1,
        })
    }
}

/// Returns the first step at which commands differ.
pub(super) fn first_difference(one: &[Command], other: &[Command]) -> Option<usize> {
    let mut pairs = one.iter().zip(other);
    // Exactly: equal programs give equal bits, and a tolerance would hide
    // drifts.
    pairs.position(|(a, b)| a != b)
}

/// Root mean square difference of commands.
fn distance(one: &[Command], other: &[Command]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| {
        let (along, across) = (a.accel_mps2 - b.accel_mps2, a.lateral_mps - b.lateral_mps);
        along * along + across * across
    });
    // Runs without a command are equal, and not 0/0 apart.
    libm::sqrt(squares.sum::<f64>() / one.len().max(1) as f64)
}

/// Returns the largest distance of two of some runs.
fn diameter(runs: &[Vec<Command>]) -> f64 {
    let pairs = runs
        .iter()
        .enumerate()
        .flat_map(|(i, one)| runs[..i].iter().map(move |other| (one, other)));
    pairs.fold(0.0, |most, (one, other)| {
        f64::max(most, distance(one, other))
    })
}

/// Returns why the used ego of a transcript commanded otherwise than the fresh `first`.
///
/// If further egos fail, the difference itself is all that is known. `None`: there is
/// none.
pub(super) fn diagnosis(
    transcript: &Transcript,
    first: Vec<Command>,
    make: Fresh<'_>,
    pauses: Pauses,
) -> Option<Unrepeatable> {
    let kept = transcript.unrepeatable(Cause::KeptState, [&transcript.commands(), &first]);
    explained(transcript, first, make, pauses).or(kept)
}

fn explained(
    transcript: &Transcript,
    first: Vec<Command>,
    make: Fresh<'_>,
    pauses: Pauses,
) -> Option<Unrepeatable> {
    let used = transcript.commands();
    let again = &|pace| transcript.replay(&mut *make(), pace).ok();
    // All begin at once: the slow ones mostly sleep.
    let (quick, slow) = thread::scope(|scope| {
        let slow: Vec<_> = (0..RUNS)
            .map(|_| scope.spawn(move || again(Pace::Slow(pauses))))
            .collect();
        let quick: Option<Vec<_>> = (1..RUNS).map(|_| again(Pace::Quick)).collect();
        let slow = slow.into_iter().map(|run| run.join().ok().flatten());
        (quick, slow.collect::<Option<Vec<_>>>())
    });
    let (mut quick, slow) = (quick?, slow?);
    // The comparison that found the difference was a quick run as well.
    quick.push(first);
    let (of_quick, of_slow) = (diameter(&quick), diameter(&slow));
    let across = quick
        .iter()
        .flat_map(|one| slow.iter().map(|other| distance(one, other)))
        // The nearest pair: paces differ only if no quick run is like a slow one.
        .fold(f64::INFINITY, f64::min);
    // Differences between paces exceed those within, or pace changes the spread.
    let is_clock = across > BY_PACE * of_quick.max(of_slow)
        || of_quick > BY_PACE * of_slow
        || of_slow > BY_PACE * of_quick;
    let first = quick.last()?;
    if is_clock {
        let mut pairs = slow.iter();
        return pairs.find_map(|other| transcript.unrepeatable(Cause::Clock, [first, other]));
    }
    // A clock would also differ here, so it is excluded first.
    if of_quick > 0.0 {
        let mut pairs = quick.iter();
        return pairs.find_map(|other| transcript.unrepeatable(Cause::Random, [first, other]));
    }
    // The first episode had no earlier one, so no ego in memory kept its state.
    let cause = if transcript.number == 0 {
        Cause::KeptOutside
    } else {
        Cause::KeptState
    };
    transcript.unrepeatable(cause, [&used, first])
}

/// Returns why commands differ once an ego is asked slowly. `None`: they do not.
pub(super) fn by_pace(
    transcript: &Transcript,
    slow: &[Command],
    make: Fresh<'_>,
    pauses: Pauses,
) -> Option<Unrepeatable> {
    let commands = transcript.commands();
    first_difference(&commands, slow)?;
    let chance = || transcript.unrepeatable(Cause::Random, [&commands, slow]);
    diagnosis(transcript, commands.clone(), make, pauses).or_else(chance)
}

/// Result of a check.
#[derive(Clone, Debug, Default)]
pub struct RepeatabilityCheck {
    /// Finding, if the ego is not repeatable. It stays from check to check.
    pub found: Option<Unrepeatable>,
    /// Fault for which fresh egos could not be compared.
    pub failed: Option<Fault>,
}

/// Episodes that were played again in fresh egos.
#[derive(Default)]
pub(super) struct TranscriptComparison {
    pub(super) compared: usize,
    /// Episodes with other commands, and those of the fresh ego.
    differing: Vec<(Arc<Transcript>, Vec<Command>)>,
    failed: Option<Fault>,
}

impl TranscriptComparison {
    /// Returns whether no command differed and every fresh ego ran.
    pub(super) fn is_equal(&self) -> bool {
        self.differing.is_empty() && self.failed.is_none()
    }

    /// Plays episodes again, each in a fresh ego.
    pub(super) fn compare(&mut self, batch: &[Arc<Transcript>], make: Fresh<'_>) {
        let replayed: Vec<Result<Vec<Command>, Fault>> = batch
            .par_iter()
            .map(|transcript| transcript.replay(&mut *make(), Pace::Quick))
            .collect();
        self.compared += batch.len();
        for (transcript, commands) in batch.iter().zip(replayed) {
            match commands {
                Ok(commands) => {
                    if first_difference(&transcript.commands(), &commands).is_some() {
                        self.differing.push((Arc::clone(transcript), commands));
                    }
                }
                // A program that fails only when it is started anew is no answer either
                // way.
                Err(fault) => self.failed = Some(fault),
            }
        }
    }

    /// Returns the reason of a difference.
    pub(super) fn explained(mut self, make: Fresh<'_>, pauses: Pauses) -> RepeatabilityCheck {
        // The earliest episode decides whether the state is within the ego.
        self.differing
            .sort_by_key(|(transcript, _)| transcript.number);
        let differing = self.differing.len() as u64;
        let mut found = self
            .differing
            .into_iter()
            .find_map(|(transcript, commands)| diagnosis(&transcript, commands, make, pauses));
        if let Some(found) = &mut found {
            found.differing = differing;
        }
        RepeatabilityCheck {
            found,
            failed: self.failed,
        }
    }
}

impl Transcripts {
    /// Plays a sample of the episodes since the last check again, each in a fresh ego.
    ///
    /// The first check plays a few episodes whatever they cost. Apart from these, all
    /// checks together take a small share of the time since the first episode.
    pub fn check(&self, make: Fresh<'_>) -> RepeatabilityCheck {
        self.check_by(make, PAUSES)
    }

    fn check_by(&self, make: Fresh<'_>, pauses: Pauses) -> RepeatabilityCheck {
        let began = Instant::now();
        let (sample, allowed, is_first, is_paced) = {
            let mut log = self.lock();
            // What was found once stays true of the ego.
            if let Some(found) = &log.found {
                return RepeatabilityCheck {
                    found: Some(found.clone()),
                    failed: None,
                };
            }
            // Checks may use a share of the time since the ego's first episode.
            let life = log.began.map_or(Duration::ZERO, |began| began.elapsed());
            let allowed = life.mul_f64(SHARE).saturating_sub(log.spent);
            let is_first = log.compared == 0;
            let mean = log.spent / u32::try_from(log.compared.max(1)).unwrap_or(u32::MAX);
            // One more would exceed the share.
            if !is_first && allowed < mean {
                return RepeatabilityCheck::default();
            }
            // The lock ends here. Episodes go on while the sample is played
            // again.
            (log.take_sample(), allowed, is_first, log.is_paced)
        };
        // Pauses cost no processor time, and no more time than the comparison beside them.
        let sum = pauses.sum.min(allowed.max(LEAST_PAUSES));
        let pace = Pace::Slow(Pauses {
            sum,
            long: Duration::ZERO,
        });
        let longest = sample.iter().max_by_key(|it| it.steps.len());
        let paced_transcript = longest.filter(|_| !is_paced);
        let mut all = TranscriptComparison::default();
        let mut compare = || {
            while all.compared < sample.len().min(MOST) && all.is_equal() {
                let mean = began.elapsed() / u32::try_from(all.compared.max(1)).unwrap_or(u32::MAX);
                let batch = if all.compared == 0 && is_first {
                    LEAST
                } else if all.compared > 0 && began.elapsed() + mean > allowed {
                    break;
                } else {
                    // One per thread, so that a batch lasts as long as one
                    // episode.
                    rayon::current_num_threads()
                };
                let last = sample.len().min(all.compared + batch);
                all.compare(&sample[all.compared..last], make);
            }
        };
        let slow = thread::scope(|scope| {
            let slow = paced_transcript
                .map(|transcript| scope.spawn(move || transcript.replay(&mut *make(), pace)));
            compare();
            slow.and_then(|slow| slow.join().ok()?.ok())
        });
        let compared = all.compared;
        let RepeatabilityCheck { mut found, failed } = all.explained(make, pauses);
        if let (None, None, Some(transcript), Some(slow)) = (&found, &failed, longest, &slow) {
            found = by_pace(transcript, slow, make, pauses);
        }
        let mut log = self.lock();
        log.spent += began.elapsed();
        log.compared += compared as u64;
        // Shortened pauses may hide a clock, so the slow run is made again later.
        log.is_paced |= slow.is_some() && sum == pauses.sum;
        log.put_back(&sample[compared..]);
        log.found.clone_from(&found);
        RepeatabilityCheck { found, failed }
    }

    /// Returns the number of episodes that were played again and had equal commands.
    pub fn compared(&self) -> u64 {
        self.lock().compared
    }
}

#[cfg(test)]
mod tests;
