//! Parallel loop over starts, action sequences, rules, or pairs of an ado and a start.
//!
//! Every worker makes its benches once. The result of an item is a function of that item
//! alone, and results are in the order of the items, so they have the same bits on any
//! number of threads. The loop handles progress, stops and processor time.

use std::sync::atomic::{AtomicU64, Ordering};

use cpu_time::ThreadTime;
use rayon::prelude::*;

use super::progress::Watch;

/// Parallel loop that reports to a watch, and ends early when it is stopped.
pub struct EpisodeLoop<'a> {
    watch: &'a Watch<'a>,
    done: AtomicU64,
    /// Total of the progress. `None`: the loop is part of other work with a count of its
    /// own.
    total: Option<u64>,
}

/// Turn of an item on a worker.
pub struct WorkItem {
    /// Position among the items.
    pub index: usize,
    clock: ThreadTime,
}

impl WorkItem {
    /// Returns the processor time since the turn began.
    pub fn cpu_s(&self) -> f64 {
        self.clock.elapsed().as_secs_f64()
    }
}

impl<'a> EpisodeLoop<'a> {
    /// Creates a loop without progress.
    pub fn uncounted(watch: &'a Watch<'a>) -> EpisodeLoop<'a> {
        EpisodeLoop {
            watch,
            done: AtomicU64::new(0),
            total: None,
        }
    }

    /// Creates a loop that counts the items of all its runs together, of `total`.
    pub fn counted(watch: &'a Watch<'a>, total: usize) -> EpisodeLoop<'a> {
        EpisodeLoop::counted_from(watch, 0, total)
    }

    /// Creates a counting loop in which some items are done already.
    pub fn counted_from(watch: &'a Watch<'a>, done: usize, total: usize) -> EpisodeLoop<'a> {
        // Reported at once, so that a bar shows its total while the first item runs.
        (watch.progress)(done as u64, total as u64);
        EpisodeLoop {
            watch,
            done: AtomicU64::new(done as u64),
            total: Some(total as u64),
        }
    }

    /// Returns the result of every item, in order.
    ///
    /// A result is `None` if the loop was stopped before the item's turn, or if `work`
    /// returned none.
    ///
    /// `worker` makes what a worker keeps from item to item, such as benches. No result
    /// may depend on its earlier use.
    pub fn run<I: Sync, W, R: Send>(
        &self,
        items: &[I],
        worker: impl Fn() -> W + Sync + Send,
        work: impl Fn(&mut W, &I, &WorkItem) -> Option<R> + Sync + Send,
    ) -> Vec<Option<R>> {
        let items = items.par_iter().enumerate();
        // A thread may make several workers, so no result may depend on their number.
        let results = items.map_init(worker, |kept, (index, item)| {
            // Parallel iterators cannot be cut short, so the remaining items return at
            // once.
            if self.watch.stopped() {
                return None;
            }
            let clock = ThreadTime::now();
            let done = work(kept, item, &WorkItem { index, clock });
            // Counted without a result, too, because nothing of it is left to do.
            self.tick();
            done
        });
        results.collect()
    }

    /// Returns what `work` makes of every item and its position, in their order.
    ///
    /// A result is `None` if the loop was stopped before the item, or if `work`
    /// returned none. `worker` makes what one worker keeps from item to item, such
    /// as benches. No result may depend on its earlier use.
    pub fn each<I: Sync, W, R: Send>(
        &self,
        items: &[I],
        worker: impl Fn() -> W + Sync + Send,
        work: impl Fn(&mut W, &I, usize) -> Option<R> + Sync + Send,
    ) -> Vec<Option<R>> {
        self.run(items, worker, |kept, item, turn| {
            work(kept, item, turn.index)
        })
    }

    fn tick(&self) {
        if let Some(total) = self.total {
            // The counter guards no other memory, so it needs no ordering.
            let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
            (self.watch.progress)(done, total);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicBool;

    use super::*;

    #[test]
    fn results_stand_in_the_order_of_the_items_and_progress_counts_each_once() {
        let (stop, reported) = (AtomicBool::new(false), Mutex::new(BTreeSet::new()));
        let progress = |done, total| {
            assert_eq!(total, 200);
            assert!(
                reported.lock().expect("unpoisoned").insert(done),
                "{done} twice"
            );
        };
        let watch = Watch::new(&progress, &stop);
        let all = EpisodeLoop::counted(&watch, 200);
        let items: Vec<usize> = (0..100).collect();
        let odd = |_: &mut (), item: &usize, turn: &WorkItem| {
            assert_eq!(*item, turn.index);
            (item % 2 == 1).then_some(10 * item)
        };
        for _ in 0..2 {
            let found = all.run(&items, || (), odd);
            let want = items.iter().map(|i| (i % 2 == 1).then_some(10 * i));
            assert!(found.into_iter().eq(want));
        }
        // None at first, then each.
        assert_eq!(reported.lock().expect("unpoisoned").len(), 201);
    }

    #[test]
    fn nothing_is_begun_after_a_stop() {
        let stop = AtomicBool::new(false);
        let watch = Watch::new(&|_, _| {}, &stop);
        let last = |_: &mut (), item: &u64, _: &WorkItem| {
            stop.store(true, Ordering::SeqCst);
            Some(*item)
        };
        let threads = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let alone = threads.expect("a pool");
        let found = alone.install(|| EpisodeLoop::uncounted(&watch).run(&[7, 8, 9], || (), last));
        assert_eq!(found, [Some(7), None, None]);
    }
}
