//! Training of an ado: testbench ⇄ learner → policy, kept in a run directory.

use cpu_time::ThreadTime;

use super::demonstrations::{Seeded, seed_training};
use super::goals::GoalTracker;
use super::progress_log::ProgressLog;
use super::stopping_rule::StoppingRule;
use super::training_egos::TrainingGym;
use crate::experiment::Watch;
use crate::rl::{BundleError, Control, Demonstration, Learner};
use crate::run_dir::{CalibrationWarning, Done, RunDir, RunError};
use crate::seed::Purpose;
use crate::testbench::{Complaint, Spent};
use crate::world::Scenario;

/// Outcome of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingOutcome {
    /// Finished part of the training.
    pub done: Done,
    /// True if it was stopped, which keeps a checkpoint.
    pub interrupted: bool,
    /// Episodes left out for faults of ego or physics.
    pub aborted: u64,
    /// Processor time of a simulation of the calibration search, in s.
    ///
    /// `None`: it was not searched in this process.
    pub search_simulation_s: Option<f64>,
}

impl TrainingOutcome {
    /// Returns the warning of an ado that is not reliable, with the cost of its advice.
    pub fn warning(&self) -> Option<CalibrationWarning> {
        self.done.calibration?.warning_at(self.search_simulation_s)
    }
}

/// Returns the number of steps of a training with its closing evaluation.
///
/// One is a search, if the learner uses demonstrations.
pub(super) fn steps(scenario: &Scenario) -> usize {
    3 + usize::from(scenario.learner.seeding().is_some())
}

/// Error of a training that cannot continue.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// Error of the run directory.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Checkpoint or initial policy that does not fit.
    #[error("the stored learner does not fit this world: {0}")]
    Bundle(#[from] BundleError),
    /// Ego that does not run.
    #[error("training was ended after {decisions} decisions: {complaint}")]
    Faults {
        /// Decisions taken so far, which a checkpoint contains.
        decisions: u64,
        /// Reason of the faults.
        complaint: Complaint,
    },
}

/// Trains in `run` until the decisions are taken or `watch` stops it.
///
/// If the learner may continue, it trains until it has learned its world.
///
/// It resumes from the run's checkpoint if there is one, with the same bytes as without
/// the interruption. A finished run stays as it is.
///
/// # Errors
/// The disk refuses, the checkpoint does not fit, or the ego keeps failing.
pub fn train(
    scenario: &Scenario,
    run: &mut RunDir,
    watch: &Watch<'_>,
) -> Result<TrainingOutcome, TrainError> {
    if run.manifest().is_finished() {
        return Ok(finished(run));
    }
    // A second process in the same directory would write over the first.
    run.hold()?;
    run.refuse(run.differences_in_learning(scenario)?)?;
    // Behind the search, if there is one, and the learning.
    let searches = usize::from(scenario.learner.seeding().is_some());
    let judging = watch.later(searches + 1);
    let mut training = TrainLoop::begin(scenario, run, watch, &judging)?;
    training.learn()?;
    training.end()
}

/// Training in progress.
struct TrainLoop<'a> {
    run: &'a mut RunDir,
    watch: &'a Watch<'a>,
    /// Watch of the learning alone.
    learning: Watch<'a>,
    gym: TrainingGym<'a>,
    learner: Box<dyn Learner>,
    stopping: StoppingRule<'a>,
    log: ProgressLog,
    /// Processor time before this process, and of the first search.
    spent_s: f64,
    own: OwnTime,
    /// True if the run directory stores the successes.
    stores: bool,
}

impl<'a> TrainLoop<'a> {
    /// Restores a training from its checkpoint, or begins it with its demonstrations.
    fn begin(
        scenario: &'a Scenario,
        run: &'a mut RunDir,
        watch: &'a Watch<'a>,
        judging: &'a Watch<'a>,
    ) -> Result<TrainLoop<'a>, TrainError> {
        let seed = run.manifest().seed;
        let mut gym = TrainingGym::new(scenario, Purpose::Train, seed);
        gym.inner().know(run.bank()?);
        let spaces = scenario.spaces();
        let checkpoint = run.checkpoint()?;
        let is_new = checkpoint.is_none();
        let known = run.known_failures()?;
        if let Some(goals) = GoalTracker::beyond(scenario, known.as_ref(), checkpoint.as_ref())? {
            gym.reward_by(goals);
        }
        let mut learner = match (checkpoint, run.from()?) {
            // A checkpoint has left the initial policy behind.
            (Some(checkpoint), _) => scenario.learner.restore(spaces, &checkpoint)?,
            (None, Some(policy)) => scenario.learner.build_from(spaces, seed, &policy)?,
            (None, None) => scenario.learner.build(spaces, seed),
        };
        gym.inner().tell_faults(watch.faults.clone());
        let mut physics_steps = run.manifest().physics_steps;
        let mut spent_s = run.manifest().cpu_s;
        let mut own = OwnTime::begin();
        // A checkpoint has the demonstrations in its memory.
        if is_new {
            let shown = known.map(|known| known.demonstrations).unwrap_or_default();
            let seeded = own.aside(|| demonstrations(scenario, run, shown, watch))?;
            if let Some(seeded) = seeded {
                // Random exploration rarely finds the failures that a search does.
                learner.demonstrate(&mut gym, &seeded.demonstrations);
                run.note_sought(seeded.sought);
                spent_s += seeded.cpu_s;
                physics_steps += seeded.sought.physics_steps + gym.inner().spent().physics_steps;
            }
        }
        gym.inner().count_from(Spent {
            decisions: learner.decisions(),
            physics_steps,
        });
        // Only now, because demonstrations are no episodes of the training.
        gym.show_to(watch.audience);
        // Counterexamples of a family are not stored, because their egos have no names.
        let stores = scenario.against.is_nominal();
        if stores {
            gym.inner().keep_successes();
        }
        let manifest = run.manifest();
        let searches = usize::from(scenario.learner.seeding().is_some());
        Ok(TrainLoop {
            watch,
            learning: watch.later(searches),
            gym,
            learner,
            stopping: StoppingRule::new(scenario, manifest, seed, judging),
            log: ProgressLog::of(manifest, watch.intervals.report_episodes),
            spent_s,
            own,
            stores,
            run,
        })
    }

    /// Trains until the stopping rule ends it, or `watch` stops it.
    fn learn(&mut self) -> Result<(), TrainError> {
        loop {
            self.note_phase();
            while !self.learner.finished() && !self.watch.stopped() {
                if !self.learn_to_checkpoint()? {
                    break;
                }
            }
            let stopping = &mut self.stopping;
            if self.watch.stopped() || self.own.aside(|| stopping.ends(&mut *self.learner)) {
                return Ok(());
            }
            self.note_searches();
        }
    }

    fn note_phase(&self) {
        self.learning.phase("training (decisions)");
        (self.watch.progress)(self.learner.decisions(), self.learner.tally().requested);
    }

    /// Trains to the next checkpoint and saves it. False: stopped before it was due.
    fn learn_to_checkpoint(&mut self) -> Result<bool, TrainError> {
        self.learn_until(self.next_pause());
        let lines = std::mem::take(&mut self.log.lines);
        self.run.append_progress(&lines)?;
        if self.stores {
            let successes = self.gym.inner().take_successes();
            self.run.append_counterexamples(&successes)?;
        }
        let stopping = &mut self.stopping;
        let Some(looked) = self.own.aside(|| stopping.look(&mut *self.learner)) else {
            // A checkpoint here would record a check that was not made.
            return Ok(false);
        };
        if looked {
            self.note_searches();
            self.note_phase();
        }
        // A finished learner is judged next, and then stored as a policy.
        if !self.learner.finished() {
            self.save_checkpoint(0)?;
        }
        Ok(true)
    }

    /// Returns the decision at which learning pauses next.
    fn next_pause(&self) -> u64 {
        let now = self.learner.decisions();
        let every = self.watch.intervals.checkpoint_decisions.max(1);
        // At multiples, so that a resumed training pauses where it would have paused
        // anyway.
        let checkpoint = (now / every + 1) * every;
        self.stopping.next_look(now).min(checkpoint)
    }

    fn learn_until(&mut self, until: u64) {
        let total = self.learner.tally().requested;
        let (watch, learning, log) = (self.watch, &self.learning, &mut self.log);
        self.learner.train(&mut self.gym, &mut |progress| {
            if let Some(line) = log.note(progress) {
                // Training episodes explore, so the closing evaluation may succeed more often.
                learning.detail(&format!(
                    "solves {:.0} % exploring",
                    100.0 * line.solved_share
                ));
                if let Some(audience) = watch.audience {
                    audience.progress(&line);
                }
            }
            // The last episode may end beyond the decisions that were asked for.
            (watch.progress)(progress.decisions.min(total), total);
            let pause = until <= progress.decisions || watch.stopped();
            if pause {
                Control::Stop
            } else {
                Control::Continue
            }
        });
    }

    /// Counts the searches of the stopping rule as part of the training.
    fn note_searches(&mut self) {
        if let Some(sought) = self.stopping.sought {
            self.run.note_sought(sought);
        }
        let mut spent = self.gym.inner().spent();
        spent.physics_steps += self.stopping.take_steps();
        self.gym.inner().count_from(spent);
    }

    /// Saves the learner with the counts of its training goals.
    ///
    /// `more_steps` are physics steps that the gym has not counted.
    fn save_checkpoint(&mut self, more_steps: u64) -> Result<Done, TrainError> {
        let done = self.done(more_steps);
        let mut checkpoint = self.learner.checkpoint();
        if let Some(goals) = self.gym.goals() {
            goals.save(&mut checkpoint);
        }
        self.run.save_checkpoint(&checkpoint, done)?;
        Ok(done)
    }

    fn done(&mut self, more_steps: u64) -> Done {
        let mut spent = self.gym.inner().spent();
        spent.physics_steps += more_steps;
        let cpu_s = self.spent_s + self.own.elapsed_s() + self.stopping.cpu_s();
        self.log.done(&*self.learner, &self.stopping, spent, cpu_s)
    }

    /// Saves the policy of a training that is over, or the checkpoint of one that is not.
    fn end(mut self) -> Result<TrainingOutcome, TrainError> {
        // Faults while it was searched, trained or judged.
        let given_up = given_up(&*self.learner, self.watch);
        if given_up.is_some() {
            // A verdict of the stopping rule may rest on episodes that did not run.
            self.stopping.ended = None;
        }
        let over = self.stopping.ended.is_some();
        let done = if over {
            // Counted here only, because a training that resumes is calibrated anew.
            let done = self.done(self.stopping.physics_steps());
            self.run.save_policy(&self.learner.policy_bundle(), done)?;
            done
        } else if self.learner.finished() {
            // Stopped while it was being judged: it may yet have to go on.
            self.save_checkpoint(0)?
        } else {
            self.done(0)
        };
        // Only after the checkpoint, or the last decisions would be lost.
        match given_up {
            Some(error) => Err(error),
            None => Ok(TrainingOutcome {
                done,
                interrupted: !over,
                aborted: self.log.aborted,
                search_simulation_s: self.stopping.seconds_per_simulation(),
            }),
        }
    }
}

/// Returns the demonstrations of a new training. `None`: it uses none, or was stopped.
fn demonstrations(
    scenario: &Scenario,
    run: &RunDir,
    known: Vec<Demonstration>,
    watch: &Watch<'_>,
) -> Result<Option<Seeded>, RunError> {
    let Some(seeding) = scenario.learner.seeding() else {
        return Ok(None);
    };
    watch.phase("searching training starts");
    // Known failures make the search for first successes unnecessary.
    if !known.is_empty() {
        return Ok(Some(Seeded::known(known)));
    }
    let (seed, bank) = (run.manifest().seed, run.bank()?);
    Ok(seed_training(scenario, seed, seeding, &bank, watch))
}

/// Processor time of the learning thread, without its share of searches and calibrations.
///
/// These are counted by their callers.
struct OwnTime {
    clock: ThreadTime,
    aside_s: f64,
}

impl OwnTime {
    fn begin() -> OwnTime {
        OwnTime {
            clock: ThreadTime::now(),
            aside_s: 0.0,
        }
    }

    /// Runs work that is counted elsewhere.
    fn aside<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let clock = ThreadTime::now();
        let done = work();
        self.aside_s += clock.elapsed().as_secs_f64();
        done
    }

    fn elapsed_s(&self) -> f64 {
        self.clock.elapsed().as_secs_f64() - self.aside_s
    }
}

/// Ends a training whose ego does not run.
fn given_up(learner: &dyn Learner, watch: &Watch<'_>) -> Option<TrainError> {
    let complaint = watch
        .faults
        .complaint()
        .filter(|_| watch.faults.has_given_up())?;
    Some(TrainError::Faults {
        decisions: learner.decisions(),
        complaint,
    })
}

/// Returns the outcome of a finished run.
fn finished(run: &RunDir) -> TrainingOutcome {
    let manifest = run.manifest();
    TrainingOutcome {
        done: Done {
            decisions_asked: manifest.decisions,
            decisions: manifest.decisions_done,
            episodes: manifest.episodes,
            physics_steps: manifest.physics_steps,
            cpu_s: manifest.cpu_s,
            window: manifest.window,
            calibration: manifest.calibration,
            ended: manifest.ended,
        },
        interrupted: false,
        // Only the process that trained knows their number, since no manifest has it.
        aborted: 0,
        search_simulation_s: None,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::ego::{Command, Controller, Fault, Percept};
    use crate::experiment::Remark;
    use crate::sim::PlantKind;
    use crate::training::{SessionError, TrainRequest, TrainSession};

    /// Ego that coasts until it breaks.
    struct Breaking(Arc<AtomicBool>);

    impl Controller for Breaking {
        fn reset(&mut self, _seed: u64) {}

        fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
            if self.0.load(Ordering::SeqCst) {
                Err(Fault::error("broken"))
            } else {
                Ok(Command::default())
            }
        }

        fn fork(&self) -> Option<Box<dyn Controller>> {
            None
        }
    }

    #[test]
    fn an_ego_that_breaks_while_the_ado_is_judged_loses_no_decision() {
        let broken = Arc::new(AtomicBool::new(false));
        let ego = Arc::clone(&broken);
        let world = Scenario::shipped("acc")
            .expect("shipped")
            .expect("sound")
            .on(PlantKind::Kinematic)
            .with_ego(
                "mine",
                Arc::new(move || Box::new(Breaking(Arc::clone(&ego)))),
            );
        let request = TrainRequest {
            // Fewer than between two checkpoints.
            decisions: Some(300),
            ..TrainRequest::default()
        };
        let dir = tempfile::tempdir().expect("scratch");
        let path = dir.path().join("run");
        let breaks = |remark: Remark<'_>| {
            if let Remark::Phase { what, .. } = remark
                && what.starts_with("playing calibration")
            {
                broken.store(true, Ordering::SeqCst);
            }
        };
        let watch = Watch {
            remarks: &breaks,
            ..Watch::unwatched()
        };
        let mut session = TrainSession::begin(&world, &path, &request).expect("begun");
        let error = session.train(&watch).expect_err("it broke");
        assert!(
            matches!(error, SessionError::Train(TrainError::Faults { .. })),
            "{error}"
        );
        drop(session);
        let run = RunDir::open(&path).expect("a run");
        assert!(run.manifest().decisions_done >= 300 && !run.manifest().is_finished());
        broken.store(false, Ordering::SeqCst);
        let mut session = TrainSession::resume(&world, &path, &request).expect("begun");
        let trained = session.train(&Watch::unwatched()).expect("trained");
        assert_eq!(trained.done.decisions, run.manifest().decisions_done);
        assert!(!trained.interrupted);
    }
}
