//! Replaying kept counterexamples: bit for bit, or against a changed ego.

use std::path::{Path, PathBuf};

use crate::run::{Counterexample, KeptError, RunError, digests_of, trace_of_csv};
use crate::scenario::{Change, ChangeError, Scenario};
use crate::scene::drive::ControllerFactory;
use crate::testbench::{Aftermath, Episode, Replay, play};

/// Where a replay first differs from what was recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The sample.
    pub sample: usize,
    /// The signal and both values, if the samples are stored beside the file.
    pub signal: Option<(String, f64, f64)>,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sample {}", self.sample)?;
        match &self.signal {
            Some((name, recorded, replayed)) => {
                write!(f, ", `{name}`: recorded {recorded}, replayed {replayed}")
            }
            None => Ok(()),
        }
    }
}

/// A counterexample and the file it was kept in.
#[derive(Clone, Debug)]
pub struct Kept {
    /// The file.
    pub path: PathBuf,
    /// What is in it.
    pub counterexample: Counterexample,
}

/// What came of replaying one.
#[derive(Clone)]
pub struct Replayed {
    /// The file.
    pub path: PathBuf,
    /// The world, as it was replayed.
    pub scenario: Scenario,
    /// The episode.
    pub episode: Episode,
    /// Whether verdict, robustness, contact and every sample are as recorded.
    pub identical: bool,
    /// Where they first differ.
    pub first_difference: Option<Difference>,
}

impl Replayed {
    /// Whether the ego still fails.
    pub fn still_fails(&self) -> bool {
        self.episode.verdict.is_success()
    }
}

/// Replays one kept counterexample in `scenario`.
///
/// # Errors
/// The start does not fit the world.
pub fn replay(kept: &Kept, scenario: Scenario) -> Result<Replayed, KeptError> {
    let recorded = &kept.counterexample;
    let start = recorded.start(&scenario, &kept.path)?;
    let mut bench = scenario.bench();
    // Against a changed ego the episode may outlast the recording: coast then.
    let mut actor = Replay::then(&recorded.actions, bench.spaces().neutral);
    let episode = play(
        &mut bench,
        &start,
        recorded.noise,
        &mut actor,
        Aftermath::Play,
    );
    let first_difference = first_difference(kept, &episode);
    let identical = first_difference.is_none()
        && episode.verdict == recorded.verdict
        && episode.robustness.to_bits() == recorded.robustness.to_bits()
        && episode.contact == recorded.contact
        && episode.judged == recorded.judged;
    Ok(Replayed {
        path: kept.path.clone(),
        scenario,
        episode,
        identical,
        first_difference,
    })
}

fn first_difference(kept: &Kept, episode: &Episode) -> Option<Difference> {
    let now = digests_of(&episode.trace);
    let recorded = &kept.counterexample.digests;
    if now == *recorded {
        return None;
    }
    let pairs = now.as_bytes().chunks(8).zip(recorded.as_bytes().chunks(8));
    let same = pairs.take_while(|(a, b)| a == b).count();
    let csv = std::fs::read_to_string(kept.path.with_extension("csv")).ok();
    let stored = csv.and_then(|text| trace_of_csv(&text, None).ok());
    let signal = stored.and_then(|stored| {
        let signals = episode.trace.schema().signals().iter().enumerate();
        signals.into_iter().find_map(|(i, signal)| {
            let was = *stored.signal(&signal.name)?.get(same)?;
            let is = *episode.trace.column(i).get(same)?;
            (was.to_bits() != is.to_bits()).then(|| (signal.name.clone(), was, is))
        })
    });
    Some(Difference {
        sample: same,
        signal,
    })
}

/// Kept counterexamples, to be replayed by `cargo test`.
///
/// ```no_run
/// use brakecheck::campaign::Regressions;
/// Regressions::load("tests/regressions")?.reproduce()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Regressions {
    kept: Vec<Kept>,
    ego: EgoUnderTest,
}

#[derive(Clone)]
enum EgoUnderTest {
    Recorded,
    Change(Box<Change>),
    Named(String),
    Own(String, ControllerFactory),
}

/// A regression test failed, or could not be run.
#[derive(Debug, thiserror::Error)]
pub enum RegressionError {
    /// A file is not usable.
    #[error(transparent)]
    Kept(#[from] KeptError),
    /// The changed ego does not fit the world.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The kept world has no such changed ego.
    #[error("`{path}`: its world has no ego `{name}`")]
    NoSuchEgo {
        /// The file.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// Replays differ from what was recorded.
    #[error("{} of {total} replays differ from what was recorded:\n{}", .differ.len(), .differ.join("\n"))]
    Differ {
        /// One line per replay that differs.
        differ: Vec<String>,
        /// Replays in all.
        total: usize,
    },
    /// The ego still fails.
    #[error("the ego still fails {} of {total} kept counterexamples:\n{}", .failing.len(), .failing.join("\n"))]
    StillFails {
        /// One line per counterexample that it fails.
        failing: Vec<String>,
        /// Replays in all.
        total: usize,
    },
}

impl Regressions {
    /// All `*.ron` files of a directory, by name, or one file.
    ///
    /// # Errors
    /// A file is no kept counterexample, or there is none at all.
    pub fn load(path: impl AsRef<Path>) -> Result<Regressions, KeptError> {
        let path = path.as_ref();
        let mut files = vec![path.to_path_buf()];
        if path.is_dir() {
            let entries = std::fs::read_dir(path).map_err(|source| RunError::Io {
                verb: "reading",
                path: path.into(),
                source,
            })?;
            files = entries.filter_map(|e| e.ok().map(|e| e.path())).collect();
            files.retain(|file| file.extension().is_some_and(|e| e == "ron"));
            files.sort();
        }
        if files.is_empty() {
            return Err(KeptError::Format {
                path: path.into(),
                why: "there is no `.ron` file in it".to_owned(),
            });
        }
        let kept = files.into_iter().map(|path| {
            Counterexample::load(&path).map(|counterexample| Kept {
                path,
                counterexample,
            })
        });
        Ok(Regressions {
            kept: kept.collect::<Result<_, _>>()?,
            ego: EgoUnderTest::Recorded,
        })
    }

    /// Replays them against the user's own controller.
    #[must_use]
    pub fn with_ego(self, name: &str, factory: ControllerFactory) -> Regressions {
        Regressions {
            ego: EgoUnderTest::Own(name.to_owned(), factory),
            ..self
        }
    }

    /// Replays them against a change of the world's own ego.
    #[must_use]
    pub fn with_change(self, change: Change) -> Regressions {
        Regressions {
            ego: EgoUnderTest::Change(Box::new(change)),
            ..self
        }
    }

    /// Replays them against an ego that the kept worlds name under `reuse`.
    #[must_use]
    pub fn with_named_ego(self, name: &str) -> Regressions {
        Regressions {
            ego: EgoUnderTest::Named(name.to_owned()),
            ..self
        }
    }

    /// The kept counterexamples.
    pub fn kept(&self) -> &[Kept] {
        &self.kept
    }

    /// Whether they are replayed against the ego they were recorded with.
    pub fn is_recorded_ego(&self) -> bool {
        matches!(self.ego, EgoUnderTest::Recorded)
    }

    /// Replays all of them.
    ///
    /// # Errors
    /// A world or a changed ego is not usable.
    pub fn replay(&self) -> Result<Vec<Replayed>, RegressionError> {
        let all = self.kept.iter();
        all.map(|kept| Ok(replay(kept, self.scenario(kept)?)?))
            .collect()
    }

    /// Replays all of them and asks for the recorded bits.
    ///
    /// # Errors
    /// A replay differs; the message names the first sample and signal.
    pub fn reproduce(&self) -> Result<(), RegressionError> {
        let replayed = self.replay()?;
        let differing = replayed.iter().filter(|replayed| !replayed.identical);
        let differ: Vec<String> = differing
            .map(|replayed| {
                let place = match &replayed.first_difference {
                    Some(difference) => difference.to_string(),
                    None => "verdict or contact".to_owned(),
                };
                format!("  {}: {place}", replayed.path.display())
            })
            .collect();
        match differ.is_empty() {
            true => Ok(()),
            false => Err(RegressionError::Differ {
                differ,
                total: replayed.len(),
            }),
        }
    }

    /// Replays all of them and asks that the ego no longer fails any.
    ///
    /// # Errors
    /// The ego still fails; the message names the files.
    pub fn pass(&self) -> Result<(), RegressionError> {
        let replayed = self.replay()?;
        let still = replayed.iter().filter(|replayed| replayed.still_fails());
        let failing: Vec<String> = still
            .map(|replayed| {
                let robustness = replayed.episode.robustness;
                format!("  {}: ρ = {robustness:.4}", replayed.path.display())
            })
            .collect();
        match failing.is_empty() {
            true => Ok(()),
            false => Err(RegressionError::StillFails {
                failing,
                total: replayed.len(),
            }),
        }
    }

    fn scenario(&self, kept: &Kept) -> Result<Scenario, RegressionError> {
        let recorded = &kept.counterexample;
        let nominal = || recorded.nominal(&kept.path);
        Ok(match &self.ego {
            EgoUnderTest::Recorded => recorded.scenario(&kept.path)?,
            EgoUnderTest::Own(name, factory) => {
                let world = recorded.scenario(&kept.path)?;
                world.with_ego(name, factory.clone())
            }
            // A named or given ego replaces the recorded change, it is not added.
            EgoUnderTest::Change(change) => nominal()?.with(change)?,
            EgoUnderTest::Named(name) if name == "nominal" => nominal()?,
            EgoUnderTest::Named(name) => {
                let world = nominal()?;
                let Some(change) = world.reuse.get(name) else {
                    return Err(RegressionError::NoSuchEgo {
                        path: kept.path.clone(),
                        name: name.clone(),
                        known: world.reuse.keys().cloned().collect(),
                    });
                };
                world.with(change)?
            }
        })
    }
}
