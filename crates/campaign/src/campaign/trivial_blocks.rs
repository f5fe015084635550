//! Trivial starts of a world: played once for all units of a campaign, in blocks.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::plan::{Plan, Unit};
use crate::experiment::{EgoUnderTest, TrivialStarts, Watch};
use crate::testbench::FaultLog;
use crate::world::Scenario;

/// Blocks of the starts of a world, each with its trivial starts once they are known.
///
/// A block has the starts of a piece of the world's first unit. The pieces of that unit can
/// therefore run on many machines at once without playing a block twice.
pub(super) struct TrivialBlocks {
    dir: PathBuf,
    starts: usize,
    each: usize,
    /// A thread that needs a block waits while another thread plays it.
    blocks: Vec<Mutex<Option<TrivialStarts>>>,
}

impl TrivialBlocks {
    /// Creates the blocks of a world, which are stored in `dir`.
    pub(super) fn new(dir: &Path, plan: &Plan, world: usize) -> TrivialBlocks {
        let first = plan.units.iter().find(|unit| unit.world == world);
        let blocks = first.map_or(0, Unit::pieces);
        TrivialBlocks {
            dir: dir.into(),
            starts: first.map_or(0, |unit| unit.starts),
            each: first.map_or(1, |unit| unit.each.max(1)),
            blocks: (0..blocks).map(|_| Mutex::default()).collect(),
        }
    }

    /// Returns the known starts of a range, and plays the blocks of which none is known.
    ///
    /// Faults of the ego are not in the watch's log. Such a start stays unknown, so that the
    /// piece that plays it reports its fault.
    pub(super) fn of(
        &self,
        which: &Range<usize>,
        plan: &Plan,
        world: &Scenario,
        watch: &Watch<'_>,
    ) -> TrivialStarts {
        let mut found = TrivialStarts::default();
        // In the first no start is left out. Outcomes of a program are not stored, so
        // each process would play whole blocks again.
        if world.judges_each_ego() || world.program().is_some() {
            return found;
        }
        let mut next = which.start;
        while next < which.end {
            let nth = next / self.each;
            let block = nth * self.each..((nth + 1) * self.each).min(self.starts);
            let Some(known) = self.blocks.get(nth) else {
                break;
            };
            let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
            if known.is_none() {
                let apart = Watch {
                    faults: FaultLog::allowing(1.0),
                    ..watch.quiet()
                };
                let starts = plan.starts.of(world, block.clone());
                let (ego, seed) = (EgoUnderTest::nominal(world), plan.starts.seed());
                let stored = TrivialStarts::stored(Some(&self.dir), &ego, seed, &starts, &apart);
                if let Some(stored) = &stored {
                    found.played += stored.played;
                    found.cpu_s += stored.cpu_s;
                }
                *known = stored;
            }
            let end = block.end.min(which.end);
            let answers = known.as_ref().map(|starts| &starts.known);
            for start in next..end {
                let answer = answers.and_then(|answers| answers.get(start - block.start));
                found.known.push(answer.copied().flatten());
            }
            // A block without starts would never end the loop.
            next = end.max(next + 1);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::campaign::PlanDir;
    use crate::experiment::TestStarts;

    #[test]
    fn units_pieces_and_processes_share_the_blocks_of_a_world() {
        let dir = tempfile::tempdir().expect("scratch");
        let file = dir.path().join("small.ron");
        let text = r#"Campaign(
            name: "small",
            worlds: [(file: "acc", plant: Kinematic)],
            ados: [Neutral, Held],
            starts: Drawn(count: 7, seed: 9),
        )"#;
        fs::write(&file, text).expect("written");
        let watch = Watch::unwatched();
        let cut = Plan::make(&file, Some(0.02), false, &watch).expect("a plan");
        let path = dir.path().join("plan");
        cut.expect("not stopped").write(&path).expect("written");
        let opened = PlanDir::open(&path, false, 0.0).expect("a plan");
        let (plan, world) = (opened.plan(), opened.world(&opened.plan().units[0]));
        // The trivial starts make the first unit's pieces shorter.
        assert!(plan.units[0].each > 1 && plan.units[0].each < plan.units[1].each);
        let points = plan.starts.of(world, 0..7);
        let want = TestStarts::tried(world, 9, points, &watch).expect("not stopped");
        let blocks = || TrivialBlocks::new(&path, plan, 0);
        let of = |blocks: &TrivialBlocks, which: Range<usize>| {
            let found = blocks.of(&which, plan, world, &watch);
            let known: Vec<Option<bool>> = which.map(|nth| Some(want.trivial[nth])).collect();
            assert_eq!(found.known, known);
            found.played
        };
        let each = plan.units[0].each;
        let first = blocks();
        assert_eq!(of(&first, 1..each), each);
        assert_eq!(of(&first, 0..7), 7 - each);
        assert_eq!((of(&first, 0..7), of(&blocks(), 2..7)), (0, 0));
        // Files that are lost are needed by other processes only.
        fs::remove_dir_all(path.join("trivial")).expect("removed");
        assert_eq!((of(&first, 0..7), of(&blocks(), 0..7)), (0, 7));
    }
}
