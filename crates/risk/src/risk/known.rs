//! Counterexamples from elsewhere, and counterexamples to keep.

use std::path::Path;
use std::time::Instant;

use super::mixture::Mixture;
use super::record::KnownFailure;
use super::report::RiskReport;
use super::request::RiskRequest;
use super::run::{EpisodeSource, Order, RiskWorld};
use crate::crashes::{RegressionError, Regressions, description, picture};
use crate::experiment::EgoUnderTest;
use crate::run_dir::{
    Counterexample, KeptError, RunDir, RunError, file_name, make_dir, write_file,
};
use crate::scene::Start;
use crate::testbench::{Aftermath, Replay, play};
use crate::world::Scenario;

/// Most counterexamples of a training that are used.
const MOST: usize = 1000;
/// Runs of a program that are timed before the estimation.
const TIMED: u64 = 4;

impl KnownFailure {
    /// Returns counterexamples of a training, evenly over its course.
    ///
    /// # Errors
    /// The run stored none, is damaged, or has other starts or actions than `world`.
    pub fn of_run(world: &Scenario, run: &RunDir) -> Result<Vec<KnownFailure>, RunError> {
        let stored = run.counterexamples()?;
        let shape = |it: &Scenario| {
            let axes = it.axes().into_iter().map(|axis| axis.name);
            (axes.collect::<Vec<_>>(), it.spaces().actions)
        };
        if shape(&run.scenario()?) != shape(world) {
            return Err(RunError::OtherWorld {
                path: run.path().into(),
                world: world.name().to_owned(),
            });
        }
        let noise = run.noise_of(&stored)?;
        let step = noise.len().div_ceil(MOST).max(1);
        let pairs = stored.all().iter().zip(noise).step_by(step);
        let known = pairs.map(|(success, noise)| KnownFailure {
            start: success.start.clone(),
            noise,
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

/// Writes the picture of a kept file beside it.
fn draw(file: &Path, ego: &str) -> Result<(), RegressionError> {
    for replayed in Regressions::load(file)?.replay_recorded()? {
        // Only a reference driver beside the ego can be inapplicable.
        if let Ok(svg) = picture(&replayed, ego, None) {
            let path = file.with_extension("svg");
            write_file(&path, svg.as_bytes()).map_err(KeptError::from)?;
        }
    }
    Ok(())
}

impl RiskRequest<'_> {
    /// Keeps the likeliest failure of every kind in a directory.
    ///
    /// Each has a picture beside it. Failures that break a rule are no counterexamples of
    /// the world and are left out. Returns a line per kind.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(&self, report: &RiskReport, dir: &Path) -> Result<Vec<String>, RegressionError> {
        make_dir(dir).map_err(KeptError::from)?;
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
                draw(&file, name)?;
                lines.push(format!("{}: likeliest {}", file.display(), failure.mode));
            }
        }
        Ok(lines)
    }

    /// Returns the cost of the estimation in words, before it begins.
    ///
    /// Some natural runs of a program are timed, since its runs may take seconds.
    pub fn announced(&self) -> String {
        let settings = &self.settings;
        let scenarios = self.egos.iter().map(EgoUnderTest::scenario);
        let programs: Vec<&Scenario> = scenarios.filter(|it| it.program().is_some()).collect();
        let mut text = format!(
            "at most {} runs of {} s with {}",
            settings.budget,
            self.egos[0].scenario().world().clock().horizon_s,
            match self.egos.len() {
                1 => "the ego".to_owned(),
                egos => format!("each of {egos} egos"),
            }
        );
        if !programs.is_empty() {
            let seconds: f64 = programs.iter().map(|it| self.seconds_per_run(it)).sum();
            let threads = rayon::current_num_threads();
            let hours = settings.budget as f64 * seconds / threads as f64 / 3600.0;
            let time = if hours < 1.0 {
                format!("{:.0} min", (60.0 * hours).ceil())
            } else {
                format!("{hours:.1} h")
            };
            text.push_str(&format!(
                ", {seconds:.3} s per run of a program: at most {time} on {threads} processes"
            ));
        }
        text
    }

    fn seconds_per_run(&self, ego: &Scenario) -> f64 {
        let (starts, actions) = (self.traffic.starts.clone(), self.traffic.actions.clone());
        let mixture = Mixture::natural(starts.dimensions());
        let world = RiskWorld::new(ego, starts, actions);
        let mut bench = world.scenario.bench();
        let begun = Instant::now();
        for index in 0..TIMED {
            let order = Order {
                seed: self.settings.seed,
                // A stage of its own, although no result depends on these runs.
                stage: u64::MAX,
                index,
                source: EpisodeSource::Component(0),
                judge_held: false,
                prevent: false,
            };
            world.play(&mut bench, &mixture, &order);
        }
        begun.elapsed().as_secs_f64() / TIMED as f64
    }
}
