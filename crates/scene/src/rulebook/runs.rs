//! Judge of many runs without their traces, several samples at a time.

use super::{JudgeKind, Rulebook, Stop, Verdict};
use crate::stl::{Monitor, OnlineMonitor, RunningMonitor, SampleColumns};

/// Judge of runs from their newest rows alone.
///
/// The verdicts are those of [`super::Judge`], bit for bit.
pub struct RunsJudge {
    spec: RunsMonitor,
    rules: Vec<RunsMonitor>,
    spec_lost: Vec<bool>,
    /// Margins and a row, kept to save the allocations.
    work: Vec<f64>,
    row: Vec<f64>,
}

/// One formula in every run.
enum RunsMonitor {
    /// The numbers of each run, run by run, and a copy of those of one run.
    Running {
        monitor: Box<RunningMonitor>,
        numbers: Vec<f64>,
        before: Vec<f64>,
    },
    /// A monitor per run, for formulas that running numbers do not decide.
    General(Vec<OnlineMonitor>),
}

impl RunsMonitor {
    fn new(formula: &Monitor, samples: usize, runs: usize) -> RunsMonitor {
        match formula.running(samples) {
            Some(monitor) => RunsMonitor::Running {
                numbers: vec![0.0; runs * monitor.numbers()],
                before: vec![0.0; monitor.numbers()],
                monitor: Box::new(monitor),
            },
            None => RunsMonitor::General(vec![formula.online_for(samples); runs]),
        }
    }

    fn begin(&mut self, run: usize) {
        match self {
            RunsMonitor::General(monitors) => monitors[run].reset(),
            RunsMonitor::Running {
                monitor, numbers, ..
            } => monitor.begin(part_of(numbers, monitor.numbers(), run)),
        }
    }

    /// Reads one sample of a run and returns the greatest possible value.
    fn push(&mut self, run: usize, sample: usize, row: &[f64]) -> f64 {
        match self {
            RunsMonitor::General(monitors) => monitors[run].push_checked(row).hi,
            RunsMonitor::Running {
                monitor, numbers, ..
            } => {
                let own = part_of(numbers, monitor.numbers(), run);
                monitor.push(own, sample, row).hi
            }
        }
    }

    /// Reads samples of a run at once and returns the least of their greatest values.
    ///
    /// `None` if the formula is read sample by sample. It then has read none.
    #[inline]
    fn push_all(
        &mut self,
        run: usize,
        columns: SampleColumns<'_>,
        count: usize,
        work: &mut [f64],
    ) -> Option<f64> {
        let RunsMonitor::Running {
            monitor,
            numbers,
            before,
        } = self
        else {
            return None;
        };
        let numbers = part_of(numbers, monitor.numbers(), run);
        // Kept, because a decisive sample takes the whole batch back.
        before.copy_from_slice(numbers);
        monitor.push_all(numbers, columns, count, work)
    }

    /// Takes the samples of the last [`RunsMonitor::push_all`] back.
    fn take_back(&mut self, run: usize) {
        if let RunsMonitor::Running {
            monitor,
            numbers,
            before,
        } = self
        {
            part_of(numbers, monitor.numbers(), run).copy_from_slice(before);
        }
    }

    /// Returns the robustness of a run that ends with sample `sample`.
    fn ended(&self, run: usize, sample: usize) -> f64 {
        match self {
            RunsMonitor::Running {
                monitor, numbers, ..
            } => {
                let count = monitor.numbers();
                monitor.ended(&numbers[run * count..][..count], sample + 1)
            }
            // `finish` consumes a monitor, and further samples may follow.
            RunsMonitor::General(monitors) => monitors[run].clone().finish(),
        }
    }

    /// Returns the memory of all runs, `None` if it is not known.
    fn bytes(&self) -> Option<usize> {
        match self {
            RunsMonitor::General(_) => None,
            RunsMonitor::Running {
                monitor,
                numbers,
                before,
            } => {
                let shared = size_of::<RunsMonitor>() + size_of_val(&**monitor);
                Some(shared + size_of_val(&**numbers) + size_of_val(&**before))
            }
        }
    }
}

/// Returns the numbers of a run among those of all runs.
#[inline]
fn part_of(numbers: &mut [f64], count: usize, run: usize) -> &mut [f64] {
    &mut numbers[run * count..][..count]
}

/// Newest samples of a run, to be judged.
pub struct NewSamples<'a> {
    /// The run.
    pub run: usize,
    /// Number of the first of the samples in the run, from 0.
    pub first: usize,
    /// How many they are, at least 1.
    pub count: usize,
    /// Their rows, which are samples.
    pub columns: SampleColumns<'a>,
    /// Why no further sample follows, if that is so.
    pub stop: Option<Stop>,
}

impl RunsJudge {
    /// Creates a judge of `runs` runs of at most `samples` samples.
    ///
    /// `None` if the rulebook judges whole traces.
    pub fn new(rulebook: &Rulebook, samples: usize, runs: usize) -> Option<RunsJudge> {
        // Other judges need the whole trace, and other counts the motion of
        // the bodies.
        let fits = rulebook.judge == JudgeKind::UntilViolation && rulebook.counts.is_violation();
        let rules = rulebook
            .rules
            .iter()
            .map(|rule| RunsMonitor::new(&rule.monitor, samples, runs));
        fits.then(|| RunsJudge {
            spec: RunsMonitor::new(&rulebook.spec, samples, runs),
            rules: rules.collect(),
            spec_lost: vec![false; runs],
            work: vec![0.0; SampleColumns::MOST.min(samples)],
            row: Vec::new(),
        })
    }

    /// Begins a run, which has no sample yet.
    pub fn begin(&mut self, run: usize) {
        for monitor in self.rules.iter_mut().chain([&mut self.spec]) {
            monitor.begin(run);
        }
        self.spec_lost[run] = false;
    }

    /// Reads samples of a run up to the one that decides it.
    ///
    /// Returns the verdict and the position of that sample among the new ones. With
    /// `stop` set the result is always `Some`.
    pub fn push(&mut self, rulebook: &Rulebook, new: &NewSamples<'_>) -> Option<(Verdict, usize)> {
        // Nearly always nothing happens, and all samples are read at once.
        if new.stop.is_none() && self.is_uneventful(new) {
            return None;
        }
        // Taken out and put back, because judging borrows the whole judge.
        let mut row = std::mem::take(&mut self.row);
        let decided = (0..new.count).find_map(|i| {
            new.columns.read_row(i, &mut row);
            let stop = new.stop.filter(|_| i + 1 == new.count);
            let verdict = self.push_row(rulebook, new.run, new.first + i, &row, stop);
            verdict.map(|verdict| (verdict, i))
        });
        self.row = row;
        decided
    }

    /// Reads the new samples if none of them can decide the run, and else none.
    #[inline]
    fn is_uneventful(&mut self, new: &NewSamples<'_>) -> bool {
        // A lost ψ_ego waits for the rules sample by sample, and a long batch has no
        // work memory.
        if self.spec_lost[new.run] || self.work.len() < new.count {
            return false;
        }
        let work = &mut self.work;
        let mut least =
            |monitor: &mut RunsMonitor| monitor.push_all(new.run, new.columns, new.count, work);
        let mut read = 0;
        // An upper bound of 0 loses a rule, but not ψ_ego.
        let mut calm = self.rules.iter_mut().all(|rule| {
            let least = least(rule);
            read += usize::from(least.is_some());
            least.is_some_and(|least| least > 0.0)
        });
        if calm {
            let least = least(&mut self.spec);
            calm = least.is_some_and(|least| least >= 0.0);
            if !calm && least.is_some() {
                self.spec.take_back(new.run);
            }
        }
        if !calm {
            // `all` stops at the first rule that may be lost, so later rules
            // have read nothing.
            let read = self.rules.iter_mut().take(read);
            read.for_each(|rule| rule.take_back(new.run));
        }
        calm
    }

    /// Reads one sample.
    fn push_row(
        &mut self,
        rulebook: &Rulebook,
        run: usize,
        sample: usize,
        row: &[f64],
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        let mut broken = None;
        for (i, rule) in self.rules.iter_mut().enumerate() {
            // An upper bound of 0 is enough, since "kept" is strict.
            if rule.push(run, sample, row) <= 0.0 {
                broken = rulebook.more_important(broken, i);
            }
        }
        // Strict, unlike the rules.
        self.spec_lost[run] |= self.spec.push(run, sample, row) < 0.0;
        let (spec, rules) = (&self.spec, &self.rules);
        let ended = |which: Option<usize>| which.map_or(spec, |i| &rules[i]).ended(run, sample);
        rulebook.until_violation(broken, self.spec_lost[run], ended, stop)
    }

    /// Returns the robustness of ψ_ego in a run whose newest sample is `sample`.
    pub fn robustness(&self, run: usize, sample: usize) -> f64 {
        self.spec.ended(run, sample)
    }

    /// Returns the memory of all runs, `None` if general monitors hide theirs.
    pub fn bytes(&self) -> Option<usize> {
        let monitors = self
            .rules
            .iter()
            .chain([&self.spec])
            .map(RunsMonitor::bytes)
            .sum::<Option<usize>>()?;
        Some(monitors + size_of_val(&*self.spec_lost) + size_of_val(&*self.work))
    }
}
