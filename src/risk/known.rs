//! Counterexamples from elsewhere, and counterexamples to keep.

use std::path::Path;

use super::estimation::RiskRequest;
use super::record::KnownFailure;
use super::report::RiskReport;
use crate::crashes::description;
use crate::run_dir::{Counterexample, KeptError, RunDir, RunError, file_name, make_dir};
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Replay, play};
use crate::world::Scenario;

/// Most counterexamples of a training that are used.
const MOST: usize = 1000;

impl KnownFailure {
    /// Returns counterexamples of a training, evenly over its course.
    ///
    /// # Errors
    /// The run stored none or is damaged.
    pub fn of_run(world: &Scenario, run: &RunDir) -> Result<Vec<KnownFailure>, RunError> {
        let stored = run.counterexamples()?;
        let all = stored.all();
        // Runs store no noise, because it follows from the seed and the index.
        let (bench, seed) = (world.bench(), run.manifest().seed);
        let step = all.len().div_ceil(MOST).max(1);
        let known = all.iter().step_by(step).map(|success| KnownFailure {
            start: success.start.clone(),
            noise: bench.noise_of(StartKey {
                purpose: Purpose::Train,
                seed,
                index: success.index,
            }),
            actions: success.actions.clone(),
        });
        Ok(known.collect())
    }

    /// Returns the counterexample of a kept file, or those of all in a directory.
    ///
    /// Files of other worlds are left out of a directory.
    ///
    /// # Errors
    /// A file cannot be read.
    pub fn of_files(world: &Scenario, path: &Path) -> Result<Vec<KnownFailure>, KeptError> {
        let files = if path.is_dir() {
            let read = |source| RunError::Io {
                verb: "reading",
                path: path.into(),
                source,
            };
            let entries = std::fs::read_dir(path).map_err(read)?;
            let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
            files.retain(|file| file.extension().is_some_and(|it| it == "ron"));
            // Directories have no order, on which the fitted proposals would depend.
            files.sort();
            files
        } else {
            vec![path.to_owned()]
        };
        let mut all = Vec::new();
        for file in files {
            let kept = Counterexample::load(&file)?;
            let axes = world.axes();
            let values = axes.iter().map(|axis| kept.start.get(&axis.name).copied());
            let values: Option<Vec<f64>> = values.collect();
            let actions = world.spaces().actions;
            // A world of this name may have had other actions when the file was kept.
            let fits = kept.world == world.name() && kept.actions.iter().all(|it| *it < actions);
            if let Some(values) = values.filter(|_| fits) {
                all.push(KnownFailure {
                    start: Start(values),
                    noise: kept.noise,
                    actions: kept.actions,
                });
            }
        }
        Ok(all)
    }
}

impl RiskRequest<'_> {
    /// Keeps the likeliest failure of every kind in a directory.
    ///
    /// Failures that break a rule are no counterexamples of the world and are left out.
    /// Returns a line per kind.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(&self, report: &RiskReport, dir: &Path) -> Result<Vec<String>, KeptError> {
        make_dir(dir)?;
        let mut lines = Vec::new();
        for (ego, risk) in self.egos.iter().zip(&report.egos) {
            // The ego's own world, in which the rules count again.
            let scenario = ego.scenario();
            for run in &risk.likeliest {
                let Some(failure) = run.failure() else {
                    continue;
                };
                if !failure.lawful {
                    lines.push(format!(
                        "not kept, since it is not lawful: {}",
                        failure.mode
                    ));
                    continue;
                }
                let Some(start) = self.traffic.starts.start(&run.shares) else {
                    continue;
                };
                let actions: Vec<usize> = run.actions.iter().map(|it| *it as usize).collect();
                let mut ado = Replay::holding(&actions);
                let bench = &mut scenario.bench();
                let episode = play(bench, &start, run.noise, &mut ado, Aftermath::Play);
                let (name, change) = (ego.name(), ego.change());
                let mut kept = Counterexample::record(scenario, name, change, "risk", &episode);
                kept.about = Some(description(scenario, &episode));
                let stem = file_name(&format!("{name} {}", failure.mode));
                let file = kept.save_as(dir, &stem, &episode.trace)?;
                lines.push(format!("{}: likeliest {}", file.display(), failure.mode));
            }
        }
        Ok(lines)
    }

    /// Returns the cost of the estimation in words, before it begins.
    pub fn announced(&self) -> String {
        let settings = &self.settings;
        let programs = self
            .egos
            .iter()
            .filter(|ego| ego.scenario().program().is_some());
        let programs = match programs.count() {
            0 => String::new(),
            n => format!("; {n} of the egos is a program"),
        };
        format!(
            "at most {} runs of {} s with each of {} egos{programs}",
            settings.budget,
            self.egos[0].scenario().world().clock().horizon_s,
            self.egos.len()
        )
    }
}
