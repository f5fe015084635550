//! Decisions of runs, with the targets of V.

use rayon::prelude::*;

use super::record::RiskRun;
use crate::rl::LearnerRng;

/// Least value, below which no failure is expected.
pub(super) const LEAST: f64 = 1e-8;

/// Decisions without a failure of which a sweep computes targets.
const OTHERS: usize = 40_000;

/// V while it is fitted.
pub(super) trait ActionValues: Sync {
    /// Returns the number of heads.
    fn heads(&self) -> usize;

    /// Returns Σ p · V over all actions but one, of every head.
    fn means_without(&self, input: &[f32], law: &[f32], without: usize) -> Vec<f64>;
}

/// Decisions of runs as a table, with targets.
pub(super) struct Decisions<'a> {
    pub(super) runs: &'a [(&'a RiskRun, Vec<bool>)],
    /// Run and decision of each row.
    pub(super) rows: Vec<(usize, usize)>,
    /// First row of each run.
    first: Vec<usize>,
    /// Rows of runs that fail, by kind of failure.
    failing: Vec<Vec<usize>>,
    /// Runs that do not fail.
    others: Vec<usize>,
}

/// Targets of a sweep.
pub(super) struct Targets {
    /// Targets of every row and head, `[rows, heads]`.
    pub(super) values: Vec<f64>,
    /// Rows that have a target.
    pub(super) rows: Vec<usize>,
}

impl<'a> Decisions<'a> {
    pub(super) fn of(runs: &'a [(&'a RiskRun, Vec<bool>)]) -> Decisions<'a> {
        let (mut rows, mut first, mut others) = (Vec::new(), Vec::new(), Vec::new());
        let heads = runs.iter().map(|(_, fails)| fails.len()).max();
        let mut failing = vec![Vec::new(); heads.unwrap_or(0)];
        for (run, (played, fails)) in runs.iter().enumerate() {
            first.push(rows.len());
            // The last head is that of the kind, and the first one that of all failures.
            let kind = fails.iter().rposition(|it| *it);
            if kind.is_none() {
                others.push(run);
            }
            for decision in 0..played.actions.len() {
                if let Some(kind) = kind {
                    failing[kind].push(rows.len());
                }
                rows.push((run, decision));
            }
        }
        failing.retain(|rows: &Vec<usize>| !rows.is_empty());
        Decisions {
            runs,
            rows,
            first,
            failing,
            others,
        }
    }

    /// Returns the runs of a sweep: all that fail, and some of the others.
    pub(super) fn sweep_runs(&self, dice: &mut LearnerRng) -> Vec<usize> {
        // The others ascend, because runs are read in order.
        let is_other = |run: usize| self.others.binary_search(&run).is_ok();
        let mut all: Vec<usize> = (0..self.runs.len()).filter(|it| !is_other(*it)).collect();
        let other_rows = self.rows.len() - self.failing.iter().map(Vec::len).sum::<usize>();
        if other_rows <= OTHERS {
            return (0..self.runs.len()).collect();
        }
        // A sweep draws few of their decisions, and targets of the rest would be wasted.
        let most = self.others.len() * OTHERS / other_rows;
        all.extend((0..most).map(|_| self.others[dice.below(self.others.len())]));
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the targets of some runs under V.
    pub(super) fn targets(&self, value: &impl ActionValues, runs: &[usize]) -> Targets {
        let heads = value.heads();
        let found: Vec<Vec<f64>> = runs
            .par_iter()
            .map(|run| self.run_targets(value, *run))
            .collect();
        let mut targets = Targets {
            // Rows outside of the sweep keep this value, and no batch draws them.
            values: vec![LEAST; self.rows.len() * heads],
            rows: Vec::new(),
        };
        for (run, found) in runs.iter().zip(found) {
            let row = self.first[*run];
            targets.values[row * heads..][..found.len()].copy_from_slice(&found);
            targets.rows.extend(row..row + found.len() / heads);
        }
        targets
    }

    /// Returns the targets of a run, `[decisions, heads]`.
    fn run_targets(&self, value: &impl ActionValues, run: usize) -> Vec<f64> {
        let (run, fails) = &self.runs[run];
        let heads = value.heads();
        let mut targets = vec![LEAST; run.actions.len() * heads];
        // Not 0, because values are compared on a logarithmic scale.
        let end = fails.iter().map(|it| if *it { 1.0 } else { LEAST });
        let mut next: Vec<f64> = end.collect();
        for decision in (0..run.actions.len()).rev() {
            targets[decision * heads..][..heads].copy_from_slice(&next);
            // No earlier decision reads the value of the first.
            if decision == 0 {
                break;
            }
            let (law, taken) = (run.law(decision), run.actions[decision] as usize);
            let means = value.means_without(run.input(decision), law, taken);
            for (next, others) in next.iter_mut().zip(means) {
                *next = (others + f64::from(law[taken]) * *next).clamp(LEAST, 1.0);
            }
        }
        targets
    }

    /// Draws the rows of a batch, half of them from runs that fail, every kind as often.
    pub(super) fn draw(&self, size: usize, targets: &Targets, dice: &mut LearnerRng) -> Vec<usize> {
        // Failures are rare, and a batch without them would teach only that.
        let draw = |at: usize| {
            if at.is_multiple_of(2) && !self.failing.is_empty() {
                // A rare kind may be most of the risk, and few rows would teach nothing of it.
                let kind = &self.failing[at / 2 % self.failing.len()];
                kind[dice.below(kind.len())]
            } else {
                targets.rows[dice.below(targets.rows.len())]
            }
        };
        (0..size).map(draw).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::RunEnd;
    use super::*;

    /// V of 0.1 for action 0 and 0.2 for action 1, in every state.
    struct Constant;

    impl ActionValues for Constant {
        fn heads(&self) -> usize {
            2
        }

        fn means_without(&self, _: &[f32], law: &[f32], without: usize) -> Vec<f64> {
            let mean = [0.1, 0.2][1 - without] * f64::from(law[1 - without]);
            vec![mean; 2]
        }
    }

    fn run(actions: &[u32]) -> RiskRun {
        RiskRun {
            actions: actions.to_vec(),
            inputs: vec![0.0; actions.len()],
            laws: [0.5, 0.5].repeat(actions.len()),
            ..RiskRun::ending(RunEnd::Outside)
        }
    }

    #[test]
    fn targets_go_back_from_the_end_of_a_run_under_the_law() {
        let [held, failed] = [run(&[0, 0]), run(&[1, 0, 0])];
        // The second head is for a kind of failure that the run is not of.
        let runs = [(&held, vec![false; 2]), (&failed, vec![true, false])];
        let data = Decisions::of(&runs);
        assert_eq!(data.rows, [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)]);
        let near = |found: &[f64], expected: &[f64]| {
            let pairs = found.iter().zip(expected);
            let far = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-7).count();
            assert!(far == 0 && found.len() == expected.len(), "{found:?}");
        };
        let all = data.targets(&Constant, &[0, 1]);
        assert_eq!(all.rows, [0, 1, 2, 3, 4]);
        // Action 1 has 0.5 · 0.2 of the mean, and action 0 has half of what follows it.
        let held = [0.1, 0.1, LEAST, LEAST];
        let failed = [0.4, 0.15, 0.6, 0.1, 1.0, LEAST];
        near(&all.values, &[&held[..], &failed].concat());
        // A run that is not read has no target.
        let some = data.targets(&Constant, &[1]);
        assert_eq!(some.rows, [2, 3, 4]);
        near(&some.values, &[&[LEAST; 4][..], &failed].concat());
    }

    #[test]
    fn half_of_a_batch_is_of_failures() {
        let [held, failed] = [run(&[0; 50]), run(&[1, 0])];
        let runs = [(&held, vec![false]), (&failed, vec![true])];
        let data = Decisions::of(&runs);
        let mut dice = LearnerRng::new(1);
        let targets = data.targets(&Single, &[0, 1]);
        let drawn = data.draw(1000, &targets, &mut dice);
        let failing = drawn.iter().filter(|row| **row >= 50).count();
        // Others are drawn from all rows, of which a twenty-sixth fails.
        assert!((500..560).contains(&failing), "{failing}");
        // Without a failure, all are of others.
        let runs = [(&held, vec![false])];
        let data = Decisions::of(&runs);
        let targets = data.targets(&Single, &[0]);
        assert!(
            data.draw(100, &targets, &mut dice)
                .iter()
                .all(|row| *row < 50)
        );
    }

    #[test]
    fn a_batch_has_every_kind_of_failure_as_often() {
        let many: Vec<RiskRun> = (0..9).map(|_| run(&[1])).collect();
        let (rare, held) = (run(&[0]), run(&[0; 90]));
        let mut runs: Vec<_> = many
            .iter()
            .map(|it| (it, vec![true, true, false]))
            .collect();
        runs.push((&rare, vec![true, false, true]));
        runs.push((&held, vec![false; 3]));
        let data = Decisions::of(&runs);
        // A row per run but the last, of which few are drawn.
        let targets = Targets {
            values: Vec::new(),
            rows: (10..100).collect(),
        };
        let drawn = data.draw(400, &targets, &mut LearnerRng::new(1));
        let of = |rows: std::ops::Range<usize>| drawn.iter().filter(|it| rows.contains(it)).count();
        assert_eq!([of(0..9), of(9..10), of(10..100)], [100, 100, 200]);
    }

    /// As [`Constant`], with one head.
    struct Single;

    impl ActionValues for Single {
        fn heads(&self) -> usize {
            1
        }

        fn means_without(&self, input: &[f32], law: &[f32], without: usize) -> Vec<f64> {
            Constant.means_without(input, law, without)[..1].to_vec()
        }
    }

    #[test]
    fn a_sweep_reads_all_failures_and_some_of_many_others() {
        let [held, failed] = [run(&[0; 50]), run(&[1; 50])];
        let with = |others: usize| {
            let mut runs = vec![(&held, vec![false]); others];
            runs.insert(0, (&failed, vec![true]));
            runs.push((&failed, vec![true]));
            let data = Decisions::of(&runs);
            data.sweep_runs(&mut LearnerRng::new(1))
        };
        // 800 others have as many decisions as a sweep reads.
        assert_eq!(with(800), (0..802).collect::<Vec<usize>>());
        let some = with(1600);
        assert!(some.is_sorted() && some[0] == 0 && some.ends_with(&[1601]));
        // 800 draws of 1600 find about 630 different ones.
        assert!((580..680).contains(&(some.len() - 2)), "{}", some.len());
    }
}
