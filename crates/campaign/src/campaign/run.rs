//! Execution of many pieces on all threads.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::dir::{PieceDone, PlanDir};
use super::error::CampaignError;
use super::partition::Partition;
use super::plan::{CampaignPiece, Work};
use super::training;
use crate::experiment::Watch;
use crate::run_dir::RunError;

/// Result of running the pieces of a campaign or of a partition.
#[derive(Debug, Default)]
pub struct Ran {
    /// Number of existing pieces.
    pub done: usize,
    /// Number of pieces in the plan or in the partition.
    pub all: usize,
    /// Pieces that could not be made, with their errors.
    pub failed: Vec<(usize, CampaignError)>,
}

impl PlanDir {
    /// Makes every missing piece on all threads, trainings first.
    ///
    /// A piece that cannot be made does not stop the remaining pieces.
    ///
    /// # Errors
    /// Returns an error if the existing pieces cannot be read.
    pub fn run(&self, watch: &Watch<'_>) -> Result<Ran, CampaignError> {
        self.run_partition(Partition::WHOLE, watch)
    }

    /// Makes every missing piece of a partition on all threads, trainings first.
    ///
    /// It has every training that its pieces need, also one of another partition. Both make
    /// the same file.
    ///
    /// # Errors
    /// Returns an error if the existing pieces cannot be read.
    pub fn run_partition(
        &self,
        partition: Partition,
        watch: &Watch<'_>,
    ) -> Result<Ran, CampaignError> {
        self.bind_programs(watch)?;
        let pieces = partition.pieces(self.plan());
        let all = pieces.len();
        let left = self.missing(pieces)?;
        let done = AtomicU64::new((all - left.len()) as u64);
        let failed = Mutex::new(Vec::new());
        let (trainings, starts): (Vec<&CampaignPiece>, Vec<&CampaignPiece>) = left
            .iter()
            .partition(|piece| matches!(piece.work, Work::Training(_)));
        (watch.progress)(done.load(Ordering::Relaxed), all as u64);
        // Pieces of a trained ado need its training, so all trainings come first.
        for (phase, pieces) in [("training", trainings), ("playing", starts)] {
            if !pieces.is_empty() {
                watch.phase(phase);
                (watch.progress)(done.load(Ordering::Relaxed), all as u64);
            }
            in_turn(&pieces, |piece| {
                if watch.interrupted() {
                    return;
                }
                // The progress counts pieces, so the episodes within a piece stay silent.
                match self.make(piece, &watch.quiet()) {
                    // An interrupted piece leaves no file, and the next run makes it.
                    Ok(PieceDone::Stopped) => {}
                    Ok(_) => {
                        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                        (watch.progress)(done, all as u64);
                    }
                    Err(error) => {
                        let mut failed = failed.lock().unwrap_or_else(PoisonError::into_inner);
                        failed.push((piece.number, error));
                    }
                }
            })?;
        }
        self.note_warnings(watch);
        let mut failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
        // Threads finish in any order, so failures are sorted by piece.
        failed.sort_by_key(|(number, _)| *number);
        Ok(Ran {
            done: done.into_inner() as usize,
            all,
            failed,
        })
    }

    /// Returns those of the pieces that are missing or unusable.
    fn missing(&self, pieces: Vec<CampaignPiece>) -> Result<Vec<CampaignPiece>, RunError> {
        let is_missing = |piece| Ok(self.read(piece)?.is_err());
        // Reading includes the hash of each file, so it is done in parallel.
        let missing: Result<Vec<bool>, RunError> = pieces.par_iter().map(is_missing).collect();
        let pairs = pieces.into_iter().zip(missing?);
        Ok(pairs
            .filter_map(|(piece, missing)| missing.then_some(piece))
            .collect())
    }

    /// Notes every trained ado of the campaign that has not learned its world.
    fn note_warnings(&self, watch: &Watch<'_>) {
        let given = self.plan.ados.iter().map(|run| self.dir.join(&run.dir));
        let own = self
            .plan
            .trainings
            .iter()
            .map(|planned| training::dir_of(&self.dir, &self.plan, planned));
        // A run that cannot be opened has already failed in its pieces.
        for run in given
            .chain(own)
            .filter_map(|path| training::finished(&path).ok())
        {
            if let Some(warning) = run.warning() {
                watch.note(&format!(
                    "warning: {}: {}",
                    run.path().display(),
                    warning.what
                ));
            }
        }
    }
}

/// Processes every item in order, on all threads.
///
/// Each worker has its own pool. A thread that waits inside an item therefore cannot begin
/// another item. When a campaign is killed, at most one piece per thread is unfinished.
fn in_turn<T: Sync>(items: &[T], work: impl Fn(&T) + Sync) -> Result<(), CampaignError> {
    let threads = rayon::current_num_threads();
    let workers = threads.min(items.len()).max(1);
    let pool = || {
        // With fewer items than threads the spare threads work within the items.
        let pool = rayon::ThreadPoolBuilder::new().num_threads((threads / workers).max(1));
        pool.build()
            .map_err(|error| CampaignError::Fault(error.to_string()))
    };
    let pools: Result<Vec<rayon::ThreadPool>, CampaignError> =
        (0..workers).map(|_| pool()).collect();
    let next = AtomicUsize::new(0);
    let (next, work) = (&next, &work);
    std::thread::scope(|scope| {
        for pool in pools? {
            scope.spawn(move || {
                pool.install(|| {
                    while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                        work(item);
                    }
                });
            });
        }
        Ok(())
    })
}
