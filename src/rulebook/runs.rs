//! Judge of many runs side by side, without their traces.

use super::{JudgeKind, Rulebook, Stop, Verdict};
use crate::stl::{Monitor, OnlineMonitor, RunColumns, RunningMonitor};

/// Judge of runs from their newest rows alone.
///
/// The verdicts are those of [`super::Judge`], bit for bit.
pub(crate) struct RunsJudge {
    spec: RunsMonitor,
    rules: Vec<RunsMonitor>,
    spec_lost: Vec<bool>,
    /// Newest row of one run, kept to save the allocation.
    row: Vec<f64>,
}

/// One formula in every run.
struct RunsMonitor {
    state: RunsState,
    /// Greatest possible value in each run.
    greatest: Vec<f64>,
}

enum RunsState {
    /// A column per running number, an entry per run.
    Running(Box<RunningMonitor>, Vec<Vec<f64>>),
    /// A monitor per run, for formulas that running numbers do not decide.
    General(Vec<OnlineMonitor>),
}

impl RunsMonitor {
    fn new(formula: &Monitor, samples: usize, runs: usize) -> RunsMonitor {
        let state = match formula.running(samples) {
            Some(monitor) => {
                let numbers = vec![vec![0.0; runs]; monitor.numbers()];
                RunsState::Running(Box::new(monitor), numbers)
            }
            None => RunsState::General(vec![formula.online_for(samples); runs]),
        };
        RunsMonitor {
            state,
            greatest: vec![0.0; runs],
        }
    }

    fn begin(&mut self, run: usize) {
        match &mut self.state {
            RunsState::Running(monitor, numbers) => monitor.begin_run(numbers, run),
            RunsState::General(monitors) => monitors[run].reset(),
        }
    }

    /// Reads the first sample of one run.
    fn push_first(&mut self, run: usize, row: &[f64]) {
        self.greatest[run] = match &mut self.state {
            RunsState::General(monitors) => monitors[run].push_checked(row).hi,
            RunsState::Running(monitor, columns) => {
                let mut numbers: Vec<f64> = columns.iter().map(|column| column[run]).collect();
                let greatest = monitor.push(&mut numbers, 0, row).hi;
                for (column, number) in columns.iter_mut().zip(numbers) {
                    column[run] = number;
                }
                greatest
            }
        };
    }

    /// Returns the robustness of a run that ends with sample `sample`.
    fn ended(&self, run: usize, sample: usize) -> f64 {
        match &self.state {
            RunsState::Running(monitor, numbers) => monitor.ended_run(numbers, run, sample + 1),
            RunsState::General(monitors) => monitors[run].clone().finish(),
        }
    }

    /// Returns the memory of all runs, `None` if it is not known.
    fn bytes(&self) -> Option<usize> {
        let RunsState::Running(monitor, numbers) = &self.state else {
            return None;
        };
        let columns = numbers.iter().chain([&self.greatest]);
        let columns = columns.map(|it| size_of_val(it) + it.capacity() * size_of::<f64>());
        Some(size_of::<RunsMonitor>() + size_of_val(&**monitor) + columns.sum::<usize>())
    }
}

impl RunsJudge {
    /// Creates a judge of `runs` runs of at most `samples` samples.
    ///
    /// `None` if the rulebook judges whole traces, or there are more runs than
    /// [`RunColumns::MOST`].
    pub(crate) fn new(rulebook: &Rulebook, samples: usize, runs: usize) -> Option<RunsJudge> {
        let fits = rulebook.judge == JudgeKind::UntilViolation && rulebook.counts.is_violation();
        if !fits || RunColumns::MOST < runs {
            return None;
        }
        let rules = rulebook.rules.iter();
        let rules = rules.map(|rule| RunsMonitor::new(&rule.monitor, samples, runs));
        Some(RunsJudge {
            spec: RunsMonitor::new(&rulebook.spec, samples, runs),
            rules: rules.collect(),
            spec_lost: vec![false; runs],
            row: Vec::new(),
        })
    }

    fn monitors(&mut self) -> impl Iterator<Item = &mut RunsMonitor> {
        self.rules.iter_mut().chain([&mut self.spec])
    }

    /// Begins a run with its first sample, a row that is a sample.
    pub(crate) fn begin(&mut self, run: usize, row: &[f64]) {
        for monitor in self.monitors() {
            monitor.begin(run);
            monitor.push_first(run, row);
        }
        self.spec_lost[run] = false;
    }

    /// Reads the newest sample of every run that is `live`.
    ///
    /// `samples[i]` is its number in run i, from 0. The other runs may have any values.
    pub(crate) fn push(
        &mut self,
        samples: &[usize],
        live: impl Iterator<Item = usize> + Clone,
        columns: RunColumns<'_>,
    ) {
        let mut row = std::mem::take(&mut self.row);
        for RunsMonitor { state, greatest } in self.monitors() {
            match state {
                RunsState::Running(monitor, numbers) => {
                    monitor.push_runs(numbers, samples, columns, greatest);
                }
                RunsState::General(monitors) => {
                    for run in live.clone() {
                        row.clear();
                        row.extend(columns.0.iter().map(|column| column[run]));
                        greatest[run] = monitors[run].push_checked(&row).hi;
                    }
                }
            }
        }
        self.row = row;
    }

    /// Returns the verdict of a run after its newest sample, number `sample`.
    pub(crate) fn verdict(
        &mut self,
        rulebook: &Rulebook,
        (run, sample): (usize, usize),
        stop: Option<Stop>,
    ) -> Option<Verdict> {
        let mut broken = None;
        for (i, rule) in self.rules.iter().enumerate() {
            // An upper bound of 0 is enough, since "kept" is strict.
            if rule.greatest[run] <= 0.0 {
                broken = rulebook.more_important(broken, i);
            }
        }
        // Strict, unlike the rules.
        self.spec_lost[run] |= self.spec.greatest[run] < 0.0;
        let (spec, rules) = (&self.spec, &self.rules);
        let ended = |which: Option<usize>| which.map_or(spec, |i| &rules[i]).ended(run, sample);
        rulebook.until_violation(broken, self.spec_lost[run], ended, stop)
    }

    /// Returns the robustness of ψ_ego in a run that ended with sample `sample`.
    pub(crate) fn robustness(&self, (run, sample): (usize, usize)) -> f64 {
        self.spec.ended(run, sample)
    }

    /// Returns the memory of all runs, `None` if general monitors hide theirs.
    pub(crate) fn bytes(&self) -> Option<usize> {
        let monitors = self.rules.iter().chain([&self.spec]);
        let monitors = monitors.map(RunsMonitor::bytes).sum::<Option<usize>>()?;
        Some(monitors + size_of_val(&*self.spec_lost))
    }
}
