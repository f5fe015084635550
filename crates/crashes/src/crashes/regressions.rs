//! Saved counterexamples as regression tests.

use std::path::{Path, PathBuf};

use super::replay::{ReplayCounts, Replayed, SavedCounterexample, replay};
use crate::ego::{Fault, Transcripts};
use crate::experiment::{Watch, unrepeatable};
use crate::run_dir::{Counterexample, KeptError, RunError, counted};
use crate::scene::drive::ControllerFactory;
use crate::testbench::FaultLog;
use crate::visible::command_line;
use crate::world::{Change, ChangeError, Scenario};

/// Kept counterexamples, to be replayed by `cargo test`.
///
/// ```no_run
/// # use brakecheck_crashes as brakecheck;
/// use brakecheck::crashes::Regressions;
/// Regressions::load("tests/regressions")?.reproduce()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Regressions {
    kept: Vec<SavedCounterexample>,
    ego: ReplayedEgo,
    programs_allowed: bool,
    fresh_egos: bool,
    allow_invalid: f64,
}

#[derive(Clone)]
enum ReplayedEgo {
    Recorded,
    Change(Box<Change>),
    Named(String),
    Own(String, ControllerFactory),
}

/// Failed regression test, or a test that could not run.
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
        /// Path of the kept counterexample.
        path: PathBuf,
        /// The name asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// Replays differ from their records.
    #[error("{} of {} differ from what was recorded:\n{}", .differ.len(), counted(*.total, "replay"), .differ.join("\n"))]
    Differ {
        /// One line per replay that differs.
        differ: Vec<String>,
        /// Replays in all.
        total: usize,
    },
    /// The ego failed to run, so its result is unknown.
    #[error("the ego failed to run in {} of {}, of {total} asked for:\n{}", .invalid.len(), counted(*.replayed, "replay"), .invalid.join("\n"))]
    Invalid {
        /// One line per invalid replay.
        invalid: Vec<String>,
        /// Replays that were begun.
        replayed: usize,
        /// Replays asked for.
        total: usize,
    },
    /// An ado breaks its rule in every replay, so none shows whether the ego still fails.
    #[error("no replay gives an answer, because an ado breaks its rule in {} of {total}:\n{}", .broken.len(), .broken.join("\n"))]
    NoAnswer {
        /// One line per such replay, with the rule and the time.
        broken: Vec<String>,
        /// Replays in all.
        total: usize,
    },
    /// A file names a program without your consent to start it.
    #[error("`{path}` names a program as the ego, and nothing was started:\n{}", command_line(.command))]
    NotAllowed {
        /// Path of the kept counterexample.
        path: PathBuf,
        /// The program and its arguments.
        command: Vec<String>,
    },
    /// The ego still fails.
    #[error("the ego still fails {} of {}:\n{}", .failing.len(), counted(*.total, "kept counterexample"), .failing.join("\n"))]
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
            let unreadable = |source| RunError::Io {
                verb: "reading",
                path: path.into(),
                source,
            };
            let entries = std::fs::read_dir(path).map_err(unreadable)?;
            // A crash that is skipped would look like one that is fixed.
            let paths = entries.map(|entry| entry.map(|it| it.path()));
            files = paths
                .collect::<Result<Vec<PathBuf>, _>>()
                .map_err(unreadable)?;
            // Reports and pictures may lie beside them.
            files.retain(|file| file.extension().is_some_and(|e| e == "ron"));
            // Directories list their files in no order, and numbers of episodes refer to
            // this one.
            files.sort();
        }
        if files.is_empty() {
            return Err(KeptError::Format {
                path: path.into(),
                why: "there is no `.ron` file in it".to_owned(),
            });
        }
        let kept = files.into_iter().map(|path| {
            Counterexample::load(&path).map(|counterexample| SavedCounterexample {
                path,
                counterexample,
            })
        });
        Ok(Regressions::of(kept.collect::<Result<_, _>>()?))
    }

    /// Returns the counterexample of a file's text, which errors name `path`.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is no kept counterexample.
    pub fn of_text(path: &Path, text: &str) -> Result<Regressions, KeptError> {
        Ok(Regressions::of(vec![SavedCounterexample {
            path: path.into(),
            counterexample: Counterexample::parse(path, text)?,
        }]))
    }

    fn of(kept: Vec<SavedCounterexample>) -> Regressions {
        Regressions {
            kept,
            ego: ReplayedEgo::Recorded,
            programs_allowed: false,
            fresh_egos: false,
            allow_invalid: 0.0,
        }
    }

    /// Consents to start the programs that the kept files and changes name.
    ///
    /// Without consent no program starts. A kept file whose ego is a program is then an
    /// error before the first replay.
    #[must_use]
    pub fn allow_programs(self, allowed: bool) -> Regressions {
        Regressions {
            programs_allowed: allowed,
            ..self
        }
    }

    /// Makes foreign egos begin every replay anew.
    #[must_use]
    pub fn begin_egos_anew(self, fresh: bool) -> Regressions {
        Regressions {
            fresh_egos: fresh,
            ..self
        }
    }

    /// Allows a share of the replays to be invalid because of the ego.
    ///
    /// The default is 0.
    #[must_use]
    pub fn allow_invalid(self, share: f64) -> Regressions {
        Regressions {
            allow_invalid: share,
            ..self
        }
    }

    /// Replays them against the user's own controller.
    #[must_use]
    pub fn with_ego(self, name: &str, factory: ControllerFactory) -> Regressions {
        Regressions {
            ego: ReplayedEgo::Own(name.to_owned(), factory),
            ..self
        }
    }

    /// Replays them against a change of the world's own ego.
    #[must_use]
    pub fn with_change(self, change: Change) -> Regressions {
        Regressions {
            ego: ReplayedEgo::Change(Box::new(change)),
            ..self
        }
    }

    /// Replays them against an ego that the kept worlds name under `reuse`.
    #[must_use]
    pub fn with_named_ego(self, name: &str) -> Regressions {
        Regressions {
            ego: ReplayedEgo::Named(name.to_owned()),
            ..self
        }
    }

    /// The kept counterexamples.
    pub fn kept(&self) -> &[SavedCounterexample] {
        &self.kept
    }

    /// Returns whether the ego is the recorded ego.
    pub fn is_recorded_ego(&self) -> bool {
        matches!(self.ego, ReplayedEgo::Recorded)
    }

    /// Returns the files whose ego is in no file, each with its name.
    ///
    /// Examples are the egos of another simulator and of your own code. Unless you name
    /// an ego, [`Regressions::replay`] plays the world's own in their place.
    pub fn absent_egos(&self) -> Vec<(&Path, &str)> {
        let is_absent = |kept: &&SavedCounterexample| {
            let recorded = &kept.counterexample;
            // A file that has no usable world is an error of the replay.
            let world = recorded.nominal(&kept.path);
            world.is_ok_and(|world| recorded.is_ego_absent(&world))
        };
        let absent = self.kept.iter().filter(is_absent);
        let named = absent.map(|kept| (kept.path.as_path(), kept.counterexample.ego.as_str()));
        named.collect()
    }

    /// Replays all counterexamples.
    ///
    /// An ego that does not run is given up, as in [`FaultLog`]. The remaining replays
    /// are then missing.
    ///
    /// # Errors
    /// A world or a changed ego is not usable, or it is a program without your
    /// [consent](Regressions::allow_programs).
    pub fn replay(&self) -> Result<Vec<Replayed>, RegressionError> {
        let scenarios = self
            .kept
            .iter()
            .map(|kept| {
                let world = self.scenario(kept)?;
                Ok::<_, RegressionError>(if self.fresh_egos {
                    world.with_fresh_egos()
                } else {
                    world
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        self.consent(&scenarios)?;
        // Kept files of one program share one that is running.
        let log = FaultLog::allowing(self.allow_invalid);
        let mut all = Vec::with_capacity(scenarios.len());
        for (index, (kept, scenario)) in self.kept.iter().zip(scenarios).enumerate() {
            let replayed = replay(kept, scenario)?;
            log.note(index as u64, replayed.fault());
            all.push(replayed);
            // A program that never starts would wait for its deadline at every file.
            if log.has_given_up() {
                break;
            }
        }
        // An ego whose replays depend on their order neither fails nor is fixed.
        if !log.has_given_up() {
            self.mark_unrepeatable(&mut all);
        }
        Ok(all)
    }

    /// Marks all replays of an ego whose commands depend on more than the episode.
    fn mark_unrepeatable(&self, all: &mut [Replayed]) {
        let transcripts = |one: &Replayed| one.scenario.ego()?.controller.transcripts().cloned();
        let (mut checked, logs): (Vec<Transcripts>, Vec<_>) =
            (Vec::new(), all.iter().map(transcripts).collect());
        for (at, log) in logs.iter().enumerate() {
            // Files of one program share its transcripts, which are checked once.
            let Some(log) = log
                .as_ref()
                .filter(|log| !checked.iter().any(|it| it.is(log)))
            else {
                continue;
            };
            checked.push(log.clone());
            let scenario = &all[at].scenario;
            let program = scenario.program().map(|it| command_line(&it.command));
            let foreign = program.or_else(|| scenario.own_ego().map(str::to_owned));
            let name = foreign.as_deref().unwrap_or("nominal");
            let Some(found) = unrepeatable(scenario, name, |_| None, &Watch::unwatched()) else {
                continue;
            };
            let fault = Fault::new(found.kind, found.message);
            for (one, of_one) in all.iter_mut().zip(&logs) {
                if of_one.as_ref().is_some_and(|it| it.is(log)) {
                    one.unrepeatable = Some(fault.clone());
                }
            }
        }
    }

    /// Checks that no more replays are invalid than allowed.
    ///
    /// # Errors
    /// More replays are invalid. The message names the files and the reasons.
    pub fn check_faults(&self, replayed: &[Replayed]) -> Result<(), RegressionError> {
        let faults = replayed.iter().filter_map(|one| Some((one, one.fault()?)));
        let invalid: Vec<String> = faults
            .map(|(one, fault)| format!("  {}: {}", one.path.display(), in_words(fault)))
            .collect();
        // A replay that was cut short proves nothing, whatever share is allowed.
        let cut = replayed.len() < self.kept.len();
        // Nor does an ego that never ran.
        let ran = invalid.len() < replayed.len() || replayed.is_empty();
        let allowed = self.allow_invalid * replayed.len() as f64;
        // No share of faults excuses an ego whose replays depend on their order.
        let is_repeatable = replayed.iter().all(|one| one.unrepeatable.is_none());
        if !cut && ran && is_repeatable && invalid.len() as f64 <= allowed {
            Ok(())
        } else {
            Err(RegressionError::Invalid {
                invalid,
                replayed: replayed.len(),
                total: self.kept.len(),
            })
        }
    }

    /// Checks that at least one replay answers whether the ego still fails.
    ///
    /// # Errors
    /// No replay does, and an ado breaks its rule in one of them.
    pub fn check_answers(replayed: &[Replayed]) -> Result<(), RegressionError> {
        let counts = ReplayCounts::of(replayed);
        // One answer suffices: a changed ego may well end some episodes by a rule
        // violation.
        if counts.no_answer == 0 || counts.still_fail + counts.fixed > 0 {
            return Ok(());
        }
        let reasons = replayed
            .iter()
            .filter_map(|one| Some((one, one.no_answer()?)));
        Err(RegressionError::NoAnswer {
            broken: reasons
                .map(|(one, why)| format!("  {}: {why}", one.path.display()))
                .collect(),
            total: counts.replayed,
        })
    }

    /// Checks that every program may be started.
    ///
    /// # Errors
    /// The first program without consent.
    fn consent(&self, scenarios: &[Scenario]) -> Result<(), RegressionError> {
        // All worlds are checked before the first replay, so no program starts too early.
        let mut pairs = self.kept.iter().zip(scenarios);
        let named = pairs.find_map(|(kept, scenario)| {
            let command = scenario.program()?.command.clone();
            Some((kept.path.clone(), command))
        });
        match named {
            Some((path, command)) if !self.programs_allowed => {
                Err(RegressionError::NotAllowed { path, command })
            }
            _ => Ok(()),
        }
    }

    /// Replays all counterexamples with the egos of their records.
    ///
    /// If a file has the ego's commands, they are repeated, and no program starts.
    ///
    /// # Errors
    /// A world is not usable, or its ego is a program without recorded commands and
    /// without your consent.
    pub fn replay_recorded(&self) -> Result<Vec<Replayed>, RegressionError> {
        let loaded = self.kept.iter().map(|kept| {
            let recorded = &kept.counterexample;
            let world = recorded.scenario(&kept.path)?;
            Ok(match recorded.commands() {
                Some(commands) => world.with_commands(&commands),
                None => world.allow_programs(self.programs_allowed),
            })
        });
        // All are loaded before the first program may start.
        let worlds = loaded.collect::<Result<Vec<_>, RegressionError>>()?;
        self.consent(&worlds)?;
        let pairs = self.kept.iter().zip(worlds);
        pairs
            .map(|(kept, world)| Ok(replay(kept, world)?))
            .collect()
    }

    /// Returns the world of a kept file with its own ego.
    ///
    /// A program without consent, or a Rust ego, is replaced by its recorded commands.
    ///
    /// # Errors
    /// The world is not usable.
    pub fn world_of(&self, kept: &SavedCounterexample) -> Result<Scenario, KeptError> {
        let recorded = &kept.counterexample;
        let world = recorded
            .scenario(&kept.path)?
            .allow_programs(self.programs_allowed);
        // A running program answers new questions, which recorded commands cannot.
        let may_start = world.program().is_some_and(|it| it.is_allowed());
        Ok(match recorded.commands().filter(|_| !may_start) {
            Some(commands) => world.with_commands(&commands),
            None => world,
        })
    }

    /// Replays all counterexamples and compares all bits.
    ///
    /// # Errors
    /// A replay differs. The message names the first sample and signal.
    pub fn reproduce(&self) -> Result<(), RegressionError> {
        Self::check_records(&self.replay_recorded()?)
    }

    /// Checks that all replays of the recorded egos have the recorded bits.
    ///
    /// # Errors
    /// A replay differs. The message names the first sample and signal.
    pub fn check_records(replayed: &[Replayed]) -> Result<(), RegressionError> {
        let differing = replayed.iter().filter(|replayed| !replayed.is_reproduced());
        let differ: Vec<String> = differing
            .map(|replayed| {
                let place = match &replayed.first_difference {
                    Some(difference) => difference.to_string(),
                    None => "verdict, contact or rules until contact".to_owned(),
                };
                format!("  {}: {place}", replayed.path.display())
            })
            .collect();
        if differ.is_empty() {
            Ok(())
        } else {
            Err(RegressionError::Differ {
                differ,
                total: replayed.len(),
            })
        }
    }

    /// Replays all counterexamples, and requires that the ego no longer fails.
    ///
    /// A replay in which an ado breaks its rule is no answer. The counts say how many are.
    ///
    /// # Errors
    /// The ego did not run in a replay, or still fails, or no replay gives an answer. The
    /// message names the files.
    pub fn pass(&self) -> Result<ReplayCounts, RegressionError> {
        let replayed = self.replay()?;
        // The order matters: a fault or an open question must not be reported as a fixed
        // ego.
        self.check_faults(&replayed)?;
        Self::check_answers(&replayed)?;
        let still = replayed.iter().filter(|replayed| replayed.still_fails());
        let failing: Vec<String> = still
            .map(|replayed| {
                let robustness = replayed.episode.robustness;
                format!("  {}: ρ = {robustness:.4}", replayed.path.display())
            })
            .collect();
        if failing.is_empty() {
            Ok(ReplayCounts::of(&replayed))
        } else {
            Err(RegressionError::StillFails {
                failing,
                total: replayed.len(),
            })
        }
    }

    fn scenario(&self, kept: &SavedCounterexample) -> Result<Scenario, RegressionError> {
        let recorded = &kept.counterexample;
        let allowed = self.programs_allowed;
        let nominal = || -> Result<Scenario, KeptError> {
            Ok(recorded.nominal(&kept.path)?.allow_programs(allowed))
        };
        Ok(match &self.ego {
            ReplayedEgo::Recorded => recorded.scenario(&kept.path)?.allow_programs(allowed),
            ReplayedEgo::Own(name, factory) => {
                let world = recorded.scenario(&kept.path)?;
                world.with_ego(name, factory.clone())
            }
            // A named or given ego replaces the recorded change, it is not added.
            ReplayedEgo::Change(change) => nominal()?.with(change)?,
            // No world lists its own ego among those that reuse the ado.
            ReplayedEgo::Named(name) if name == "nominal" => nominal()?,
            ReplayedEgo::Named(name) => {
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

/// A fault in one line, with the end of its stderr.
fn in_words(fault: &Fault) -> String {
    let kind = fault.kind.word();
    // Tracebacks end with the reason, so the last line says most.
    match fault.stderr.lines().next_back() {
        Some(last) => format!("{kind}: {} (stderr ends: {last})", fault.message),
        None => format!("{kind}: {}", fault.message),
    }
}
