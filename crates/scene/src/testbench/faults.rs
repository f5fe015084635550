//! Counts of faults, so that a faulty ego does not pass as a safe ego.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::ego::{Fault, FaultKind};

/// Number of consecutive faults of a kind after which an ego is given up.
const PATIENCE: u32 = 3;

/// Faults of a kind among the episodes of a row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultCount {
    /// Kind of the faults.
    pub kind: FaultKind,
    /// Message of the fault on the first of these starts.
    pub message: String,
    /// Last part of the program's stderr on that start, or empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub stderr: String,
    /// First start with such a fault, counted from 0.
    pub first_start: u64,
    /// Number of starts with such a fault.
    pub count: u64,
}

impl std::fmt::Display for FaultCount {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.kind.is_unrepeatable() {
            return write!(f, "no result: {}", self.message);
        }
        let (kind, count) = (self.kind.word(), self.count);
        let episodes = if count == 1 { "episode" } else { "episodes" };
        write!(
            f,
            "{kind} in {count} {episodes}, first on start {}: {}",
            self.first_start, self.message
        )?;
        // Tracebacks name the error in their last line.
        match self.stderr.lines().next_back() {
            Some(last) => write!(f, " (stderr ends: {})", last.trim()),
            None => Ok(()),
        }
    }
}

/// Counts faults by kind, in the order of their first starts.
pub fn count_faults<'a>(faults: impl IntoIterator<Item = (u64, &'a Fault)>) -> Vec<FaultCount> {
    let mut counts: Vec<FaultCount> = Vec::new();
    for (start, fault) in faults {
        // Messages may contain numbers of their episode, so kinds are counted.
        let Some(known) = counts.iter_mut().find(|known| known.kind == fault.kind) else {
            counts.push(FaultCount {
                kind: fault.kind,
                message: fault.message.clone(),
                stderr: fault.stderr.clone(),
                first_start: start,
                count: 1,
            });
            continue;
        };
        known.count += 1;
        // Parallel episodes can report in any order, so the first start is kept
        // and not the first report.
        if start < known.first_start {
            known.first_start = start;
            known.message.clone_from(&fault.message);
            known.stderr.clone_from(&fault.stderr);
        }
    }
    counts.sort_by_key(|count| count.first_start);
    counts
}

/// Adds the fault on a start to counts by kind.
pub fn add_fault(counts: &mut Vec<FaultCount>, start: u64, fault: &Fault) {
    let before = std::mem::take(counts);
    *counts = merged(before, count_faults([(start, fault)]));
}

/// Log of the faults of a campaign, filled by every phase that runs episodes.
///
/// It gives up on an ego that does not run: if a program cannot be started, or
/// if three consecutive episodes end with a fault of the same kind. If some
/// faults are allowed, only an ego that never ran is given up. Clones share
/// their counts.
#[derive(Clone, Debug, Default)]
pub struct FaultLog(Arc<FaultBudget>);

#[derive(Debug, Default)]
struct FaultBudget {
    /// Largest allowed share of invalid episodes in a row.
    allowed: f64,
    /// True if rows are parts of rows, so that a whole one may be invalid.
    has_parts: bool,
    given_up: AtomicBool,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    episodes: u64,
    faults: Vec<FaultCount>,
    /// Kind and number of the latest faults without a valid episode between them.
    streak: Option<(FaultKind, u32)>,
    /// Largest share of invalid episodes in a row of results, with the row's name.
    worst: Option<(f64, String)>,
    /// Egos whose commands depend on more than their episode.
    unrepeatable: Vec<FaultCount>,
}

impl State {
    fn add(&mut self, start: u64, fault: &Fault) {
        add_fault(&mut self.faults, start, fault);
    }
}

impl FaultLog {
    /// Creates a log that allows a share of invalid episodes per row, from 0 to 1.
    pub fn allowing(share: f64) -> FaultLog {
        FaultLog(Arc::new(FaultBudget {
            allowed: share,
            ..FaultBudget::default()
        }))
    }

    /// Creates a log like [`FaultLog::allowing`] for a part of each row.
    ///
    /// A part without a valid episode is then judged with the rest of its row.
    pub fn allowing_in_part(share: f64) -> FaultLog {
        FaultLog(Arc::new(FaultBudget {
            allowed: share,
            has_parts: true,
            ..FaultBudget::default()
        }))
    }

    /// Records an episode that has ended, with or without a fault.
    pub fn note(&self, start: u64, fault: Option<&Fault>) {
        let mut state = self.lock();
        state.episodes += 1;
        let Some(fault) = fault else {
            state.streak = None;
            return;
        };
        let streak = match state.streak {
            Some((kind, streak)) if kind == fault.kind => streak + 1,
            _ => 1,
        };
        state.streak = Some((fault.kind, streak));
        state.add(start, fault);
        let invalid: u64 = state.faults.iter().map(|fault| fault.count).sum();
        let never_ran = invalid == state.episodes;
        // With an allowed share single faults are expected, unless no episode
        // ever ran.
        let patient = self.0.allowed > 0.0 && !never_ran;
        // A program that cannot be started will not start later either.
        if fault.kind == FaultKind::CannotStart || (streak >= PATIENCE && !patient) {
            self.0.given_up.store(true, Ordering::Relaxed);
        }
    }

    /// Records an episode of an earlier process, which did not give up on the ego.
    pub fn note_stored(&self, start: u64, fault: Option<&Fault>) {
        let mut state = self.lock();
        state.episodes += 1;
        if let Some(fault) = fault {
            state.add(start, fault);
        }
    }

    /// Records the share of invalid episodes of a finished row.
    pub fn note_row(&self, row: impl FnOnce() -> String, share: f64) {
        if share == 0.0 {
            return;
        }
        let mut state = self.lock();
        if state.worst.as_ref().is_none_or(|(worst, _)| *worst < share) {
            state.worst = Some((share, row()));
        }
    }

    /// Records an ego whose commands depend on more than their episode.
    ///
    /// No row of it is a result, whatever share of faults is allowed.
    pub fn note_unrepeatable(&self, found: &FaultCount) {
        let mut state = self.lock();
        if !state.unrepeatable.contains(found) {
            state.unrepeatable.push(found.clone());
        }
    }

    /// Returns whether the ego was given up.
    pub fn has_given_up(&self) -> bool {
        self.0.given_up.load(Ordering::Relaxed)
    }

    /// Returns the complaint, or `None` if no more faults occurred than allowed.
    pub fn complaint(&self) -> Option<Complaint> {
        let state = self.lock();
        let invalid: u64 = state.faults.iter().map(|fault| fault.count).sum();
        let overall = invalid as f64 / state.episodes.max(1) as f64;
        // Rows decide if there are any: a bad row must not vanish in the
        // average.
        let worst = state.worst.as_ref().map_or(overall, |(worst, _)| *worst);
        // An ego without a single valid episode in a row never ran there, whatever share
        // is allowed. Other egos of the campaign do not excuse it.
        let never_ran = worst >= 1.0 && !self.0.has_parts;
        let tolerated = worst <= self.0.allowed && !never_ran && !self.has_given_up();
        if (invalid == 0 || tolerated) && state.unrepeatable.is_empty() {
            return None;
        }
        Some(Complaint {
            invalid,
            episodes: state.episodes,
            faults: state.faults.clone(),
            unrepeatable: state.unrepeatable.clone(),
            row: state.worst.as_ref().map(|(_, row)| row.clone()),
            given_up: self.has_given_up(),
        })
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        // Counters stay valid if a thread panics while it holds the lock.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn merged(mut counts: Vec<FaultCount>, more: Vec<FaultCount>) -> Vec<FaultCount> {
    for new in more {
        match counts.iter_mut().find(|known| known.kind == new.kind) {
            Some(known) => {
                let first = if new.first_start < known.first_start {
                    new.clone()
                } else {
                    known.clone()
                };
                let count = known.count + new.count;
                *known = FaultCount { count, ..first };
            }
            None => counts.push(new),
        }
    }
    counts
}

/// Error: more faults than allowed, so no result is a verdict on the ego.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", self.in_words())]
pub struct Complaint {
    /// Number of invalid episodes.
    pub invalid: u64,
    /// Number of all episodes.
    pub episodes: u64,
    /// Faults by kind.
    pub faults: Vec<FaultCount>,
    /// Egos whose commands depend on more than their episode, so that no row is a result.
    pub unrepeatable: Vec<FaultCount>,
    /// Row with the largest share of invalid episodes.
    pub row: Option<String>,
    /// True if the campaign ended early because of them.
    pub given_up: bool,
}

impl Complaint {
    fn in_words(&self) -> String {
        let mut lines: Vec<String> = Vec::new();
        for found in &self.unrepeatable {
            lines.push(format!("no row is a result: {}", found.message));
        }
        if self.invalid == 0 {
            return lines.join("\n");
        }
        let mut text = format!(
            "{} of {} episodes are invalid: the ego or the physics failed",
            self.invalid, self.episodes
        );
        if let Some(row) = &self.row {
            text.push_str(&format!(" (worst: {row})"));
        }
        for fault in &self.faults {
            text.push_str(&format!("\n{fault}"));
        }
        lines.push(text);
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(kind: FaultKind) -> Fault {
        Fault::new(kind, kind.word())
    }

    #[test]
    fn three_in_a_row_of_one_kind_are_enough_unless_some_are_allowed() {
        let log = FaultLog::default();
        for (start, kind) in [FaultKind::Timeout, FaultKind::Ended, FaultKind::Timeout]
            .into_iter()
            .enumerate()
        {
            log.note(start as u64, Some(&fault(kind)));
        }
        assert!(!log.has_given_up());
        log.note(3, Some(&fault(FaultKind::Timeout)));
        log.note(4, None);
        log.note(5, Some(&fault(FaultKind::Timeout)));
        log.note(6, Some(&fault(FaultKind::Timeout)));
        assert!(!log.has_given_up(), "a good episode was between them");
        log.note(7, Some(&fault(FaultKind::Timeout)));
        assert!(log.has_given_up());

        let patient = FaultLog::allowing(0.9);
        patient.note(0, None);
        for start in 1..9 {
            patient.note(start, Some(&fault(FaultKind::Timeout)));
        }
        assert!(!patient.has_given_up() && patient.complaint().is_none());
        patient.note(9, Some(&fault(FaultKind::CannotStart)));
        assert!(patient.has_given_up() && patient.complaint().is_some());
    }

    #[test]
    fn an_ego_that_never_ran_is_given_up_whatever_is_allowed() {
        let log = FaultLog::allowing(1.0);
        (0..3).for_each(|start| log.note(start, Some(&fault(FaultKind::Ended))));
        let complaint = log.complaint().expect("it never ran");
        assert!(complaint.given_up && complaint.invalid == 3);
    }

    #[test]
    fn a_row_without_a_valid_episode_is_a_fault_beside_others_that_ran() {
        let log = FaultLog::allowing(1.0);
        (0..20).for_each(|start| log.note(start, None));
        log.note_row(|| "half".to_owned(), 0.5);
        (0..20).for_each(|start| log.note(start, Some(&fault(FaultKind::Ended))));
        assert!(log.complaint().is_none(), "half of the row ran");
        log.note_row(|| "mine, trained".to_owned(), 1.0);
        let complaint = log.complaint().expect("it never ran");
        assert_eq!(complaint.row.as_deref(), Some("mine, trained"));
    }

    #[test]
    fn the_worst_row_decides() {
        let log = FaultLog::allowing(0.1);
        (0..99).for_each(|start| log.note(start, None));
        log.note(99, Some(&fault(FaultKind::Protocol)));
        assert!(log.complaint().is_none());
        log.note_row(|| "nominal, hold".to_owned(), 0.2);
        let complaint = log.complaint().expect("a fifth of one row");
        assert_eq!(complaint.row.as_deref(), Some("nominal, hold"));
    }

    #[test]
    fn faults_are_counted_by_kind_and_tell_of_the_first_start() {
        let (late, early) = (fault(FaultKind::Ended), Fault::error("x"));
        let counts = count_faults([(7, &late), (3, &early), (2, &late)]);
        assert_eq!(counts[0].first_start, 2);
        assert_eq!((counts[0].count, counts[1].count), (2, 1));
    }
}
