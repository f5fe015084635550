//! Counterexamples from elsewhere, and counterexamples to keep.

use std::path::Path;
use std::time::{Duration, Instant};

use super::mixture::Mixture;
use super::record::KnownFailure;
use super::report::RiskReport;
use super::request::RiskRequest;
use super::run::{EpisodeSource, Order, RiskWorld};
use crate::crashes::{RegressionError, Regressions, description, picture};
use crate::experiment::EgoUnderTest;
use crate::run_dir::{
    Counterexample, KeptError, RunDir, RunError, counted, file_name, make_dir, write_file,
};
use crate::scene::Start;
use crate::testbench::{Aftermath, Replay, play};
use crate::world::Scenario;

/// Most counterexamples of a training that are used.
const MOST: usize = 1000;
/// Runs of an ego that are timed before the estimation: at least, at most, and how long.
const TIMED: u64 = 4;
const MOST_TIMED: u64 = 100;
const LONGEST_TIMED: Duration = Duration::from_millis(300);

impl KnownFailure {
    /// Returns counterexamples of a training, evenly over its course.
    ///
    /// # Errors
    /// The run stored none, is damaged, or has other starts or actions than `world`.
    pub fn of_run(world: &Scenario, run: &RunDir) -> Result<Vec<KnownFailure>, RunError> {
        let stored = run.counterexamples()?;
        // Starts are read by their axes, and joint actions by their number.
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
        // Evenly over the training, whose failures change while it learns.
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
            // Pictures lie beside the kept files.
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
            let values: Option<Vec<f64>> = axes
                .iter()
                .map(|axis| kept.start.get(&axis.name).copied())
                .collect();
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
                // Played anew with the rules, which the estimate left out.
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
    /// Some natural runs of each ego are timed.
    pub fn announced(&self) -> String {
        let settings = &self.settings;
        let scenarios = self.egos.iter().map(EgoUnderTest::scenario);
        let seconds: f64 = scenarios.map(|it| self.seconds_per_run(it)).sum();
        let threads = rayon::current_num_threads();
        // Egos play one after the other, each on all threads.
        let all_s = settings.budget as f64 * seconds / threads as f64;
        format!(
            "at most {} of {} s with {}, {:.1} ms each: at most {} on {}",
            counted(settings.budget, "run"),
            self.egos[0].scenario().world().clock().horizon_s,
            match self.egos.len() {
                1 => "the ego".to_owned(),
                egos => format!("each of {egos} egos"),
            },
            1e3 * seconds / self.egos.len() as f64,
            duration_in_words(all_s),
            counted(threads, "thread"),
        )
    }

    fn seconds_per_run(&self, ego: &Scenario) -> f64 {
        let (starts, actions) = (self.traffic.starts.clone(), self.traffic.actions.clone());
        let mixture = Mixture::natural(starts.dimensions());
        let world = RiskWorld::new(ego, starts, actions);
        let mut bench = world.scenario.bench();
        let begun = Instant::now();
        let mut played = 0;
        // Runs of a stock ego are too short for a few of them to be timed.
        while played < TIMED || (played < MOST_TIMED && begun.elapsed() < LONGEST_TIMED) {
            let order = Order {
                seed: self.settings.seed,
                // A stage of its own, although no result depends on these runs.
                stage: u64::MAX,
                index: played,
                source: EpisodeSource::Component(0),
                judge_held: false,
                prevent: false,
            };
            world.play(&mut bench, &mixture, &order);
            played += 1;
        }
        begun.elapsed().as_secs_f64() / played as f64
    }
}

/// Returns a duration in the unit that a reader would choose, rounded up.
fn duration_in_words(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{:.0} s", s.ceil()),
        s if s < 5400.0 => format!("{:.0} min", (s / 60.0).ceil()),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, world};
    use super::super::{RiskSettings, RiskTraffic};
    use super::*;
    use crate::experiment::Watch;

    /// Files of an extension in a directory.
    fn files(dir: &Path, extension: &str) -> Vec<std::path::PathBuf> {
        let entries = std::fs::read_dir(dir).expect("a directory").flatten();
        let mut files: Vec<_> = entries.map(|it| it.path()).collect();
        files.retain(|it| it.extension().is_some_and(|it| it == extension));
        files.sort();
        files
    }

    #[test]
    fn the_likeliest_lawful_failures_are_kept_and_read_as_known_ones() {
        let (world, dir) = (world(), tempfile::tempdir().expect("a directory"));
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world)];
        let mut request = RiskRequest::new(&traffic, &egos);
        request.settings = RiskSettings {
            budget: 3_000,
            natural: 200,
            ..RiskSettings::default()
        };
        let report = request
            .estimate(&Watch::unwatched())
            .expect("no disk")
            .expect("not stopped");
        let kinds = &report.egos[0].likeliest;
        let mut lawful: Vec<(Start, u64, Vec<usize>)> = kinds
            .iter()
            .filter(|run| run.failure().is_some_and(|it| it.lawful))
            .map(|run| {
                let actions = run.actions.iter().map(|it| *it as usize);
                let start = traffic.starts.start(&run.shares).expect("inside");
                (start, run.noise, actions.collect())
            })
            .collect();
        assert!(!lawful.is_empty());
        let kept = dir.path().join("kept");
        let lines = request.keep(&report, &kept).expect("a disk");
        assert_eq!(lines.len(), kinds.len());
        let refused = lines
            .iter()
            .filter(|it| it.starts_with("not kept, since it is not lawful"));
        assert_eq!(refused.count(), kinds.len() - lawful.len());
        let found = files(&kept, "ron");
        assert_eq!(
            (found.len(), files(&kept, "svg").len()),
            (lawful.len(), lawful.len())
        );
        let known = KnownFailure::of_files(&world, &kept).expect("read");
        let mut again: Vec<_> = known
            .iter()
            .map(|it| (it.start.clone(), it.noise, it.actions.clone()))
            .collect();
        again.iter().for_each(|(start, noise, actions)| {
            let mut ado = Replay::holding(actions);
            let run = play(&mut world.bench(), start, *noise, &mut ado, Aftermath::Skip);
            assert!(run.verdict.is_success(), "{:?}", run.verdict);
        });
        let order = |a: &(Start, u64, Vec<usize>), b: &(Start, u64, Vec<usize>)| {
            (a.1, &a.2).cmp(&(b.1, &b.2))
        };
        again.sort_by(order);
        lawful.sort_by(order);
        // The last action is held, so a kept file may have it once more.
        let held = |all: &[(Start, u64, Vec<usize>)]| {
            let mut held = all.to_vec();
            for (_, _, actions) in &mut held {
                actions.resize(5, actions.last().copied().expect("a decision"));
            }
            held
        };
        assert_eq!(held(&again), held(&lawful));
        // One file alone, and all of them for a world of another name or with fewer actions.
        let one = KnownFailure::of_files(&world, &found[0]).expect("read");
        assert_eq!(one, known[..1]);
        let fitting = |from: &str, to: &str| {
            assert!(world.text().contains(from), "{from}");
            let other = Scenario::parse("other.ron", &world.text().replace(from, to));
            KnownFailure::of_files(&other.expect("sound"), &kept).expect("read")
        };
        assert_eq!(fitting("name: \"acc\"", "name: \"other\""), []);
        let set = "Accelerations([-3.0, 0.0, 3.0]), neutral: 1";
        let brakes: Vec<KnownFailure> = known
            .iter()
            .filter(|it| it.actions.iter().all(|action| *action == 0))
            .cloned()
            .collect();
        assert_eq!(fitting(set, "Accelerations([-3.0]), neutral: 0"), brakes);
    }

    #[test]
    fn the_cost_is_announced_for_every_ego() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world), EgoUnderTest::nominal(&world)];
        let announced = |egos: &[EgoUnderTest]| {
            let mut request = RiskRequest::new(&traffic, egos);
            request.settings.budget = 700;
            request.announced()
        };
        for (egos, of) in [(&egos[..1], "the ego, "), (&egos[..], "each of 2 egos, ")] {
            let (said, begins) = (
                announced(egos),
                format!("at most 700 runs of 2.5 s with {of}"),
            );
            assert!(said.starts_with(&begins), "{said}");
            assert!(
                said.contains(" ms each: at most ") && said.ends_with(" threads"),
                "{said}"
            );
        }
    }
}
