//! Training of an ado: testbench ⇄ learner → policy, kept in a run directory.

use std::sync::Arc;

use cpu_time::ThreadTime;

use super::demonstrations::{Seeded, seed_training};
use super::goals::GoalTracker;
use super::stopping_rule::StoppingRule;
use super::training_egos::TrainingGym;
use crate::experiment::Watch;
use crate::rl::{BundleError, Control, Learner, LearnerReport, TensorFile};
use crate::run_dir::{Done, Progress, RunDir, RunError, Window};
use crate::seed::Purpose;
use crate::testbench::{Complaint, Spent};
use crate::world::Scenario;

/// Decisions between two checkpoints. Unit tests need several of them soon.
const CHECKPOINT_DECISIONS: u64 = if cfg!(test) { 400 } else { 50_000 };
/// Episodes per line of `progress.jsonl`.
const REPORT_EPISODES: u64 = if cfg!(test) { 7 } else { 250 };

/// Outcome of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingOutcome {
    /// Finished part of the training.
    pub done: Done,
    /// True if it was stopped, which keeps a checkpoint.
    pub interrupted: bool,
    /// Episodes left out for faults of ego or physics.
    pub aborted: u64,
}

/// Returns the number of steps of a training with its closing evaluation.
///
/// One is a search, if the learner uses demonstrations.
pub(super) fn steps(scenario: &Scenario) -> usize {
    3 + usize::from(scenario.learner.seeding().is_some())
}

/// Error of a training that cannot continue.
///
/// `Debug` prints it as the command line does, so a test that returns it shows the
/// mistake, its place and its fix.
#[derive(thiserror::Error)]
#[non_exhaustive]
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
/// The disk refuses; the checkpoint does not fit; the ego keeps failing.
pub fn train(
    scenario: &Scenario,
    run: &mut RunDir,
    watch: &Watch<'_>,
) -> Result<TrainingOutcome, TrainError> {
    if run.manifest().is_finished() {
        return Ok(finished(run));
    }
    run.hold()?;
    run.refuse(run.differences_in_learning(scenario)?)?;
    let seed = run.manifest().seed;
    let mut gym = TrainingGym::new(scenario, Purpose::Train, seed);
    let bank = run.bank()?;
    gym.inner().know(Arc::clone(&bank));
    let spaces = scenario.spaces();
    let checkpoint = run.checkpoint()?;
    let known = run.known_failures()?;
    if let Some(goals) = GoalTracker::beyond(scenario, known.as_ref(), checkpoint.as_ref())? {
        gym.reward_by(goals);
    }
    let mut learner = match (checkpoint, run.from()?) {
        (Some(checkpoint), _) => scenario.learner.restore(spaces, &checkpoint)?,
        (None, Some(policy)) => scenario.learner.build_from(spaces, seed, &policy)?,
        (None, None) => scenario.learner.build(spaces, seed),
    };
    gym.inner().tell_faults(watch.faults.clone());
    let mut physics_steps = run.manifest().physics_steps;
    let mut spent_s = run.manifest().cpu_s;
    let mut own = OwnTime::begin();
    let searching = usize::from(scenario.learner.seeding().is_some());
    let (learning, judging) = (watch.later(searching), watch.later(searching + 1));
    if run.manifest().checkpoint.is_none()
        && let Some(seeding) = scenario.learner.seeding()
    {
        watch.phase("searching training starts");
        let shown = known.map(|known| known.demonstrations).unwrap_or_default();
        // Known failures make the search for first successes unnecessary.
        let seeded = if shown.is_empty() {
            own.aside(|| seed_training(scenario, seed, (seeding, &bank), watch))
        } else {
            Some(Seeded::known(shown))
        };
        if let Some(seeded) = seeded {
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
    let mut ledger = Ledger {
        episodes: run.manifest().episodes,
        window: run.manifest().window,
        ..Ledger::default()
    };
    let mut patience = StoppingRule::new(scenario, run.manifest(), seed, &judging);
    loop {
        learning.phase("training (decisions)");
        (watch.progress)(learner.decisions(), learner.tally().requested);
        while !learner.finished() && !watch.stopped() {
            let until = (learner.decisions() / CHECKPOINT_DECISIONS + 1) * CHECKPOINT_DECISIONS;
            let until = patience.next_look(learner.decisions()).min(until);
            let total = learner.tally().requested;
            learner.train(&mut gym, &mut |progress| {
                if let Some(line) = ledger.note(progress) {
                    // Training episodes explore, so the closing evaluation may succeed more often.
                    learning.detail(&format!(
                        "solves {:.0} % exploring",
                        100.0 * line.solved_share
                    ));
                    if let Some(audience) = watch.audience {
                        audience.progress(&line);
                    }
                }
                (watch.progress)(progress.decisions.min(total), total);
                let pause = until <= progress.decisions || watch.stopped();
                if pause {
                    Control::Stop
                } else {
                    Control::Continue
                }
            });
            run.append_progress(&std::mem::take(&mut ledger.lines))?;
            if stores {
                run.append_counterexamples(&gym.inner().take_successes())?;
            }
            let Some(looked) = own.aside(|| patience.look(&mut *learner)) else {
                // A checkpoint here would record a check that was not made.
                break;
            };
            if looked {
                note_searches(&mut patience, run, &mut gym);
                learning.phase("training (decisions)");
                (watch.progress)(learner.decisions(), learner.tally().requested);
            }
            if !learner.finished() {
                let cpu_s = spent_s + own.elapsed_s() + patience.cpu_s();
                let spent = gym.inner().spent();
                let done = ledger.done(&*learner, &patience, spent, cpu_s);
                run.save_checkpoint(&checkpoint_of(&*learner, &gym), done)?;
            }
        }
        if watch.stopped() || own.aside(|| patience.ends(&mut *learner)) {
            break;
        }
        note_searches(&mut patience, run, &mut gym);
    }
    // While it was searched, trained or judged.
    if let Some(error) = given_up(&*learner, watch) {
        return Err(error);
    }
    // Stopped while it was being judged: it may yet have to go on.
    let over = patience.ended.is_some();
    let mut spent = gym.inner().spent();
    if over {
        spent.physics_steps += patience.physics_steps();
    }
    let cpu_s = spent_s + own.elapsed_s() + patience.cpu_s();
    let done = ledger.done(&*learner, &patience, spent, cpu_s);
    match (over, learner.finished()) {
        (true, _) => run.save_policy(&learner.policy_bundle(), done)?,
        (false, true) => run.save_checkpoint(&checkpoint_of(&*learner, &gym), done)?,
        (false, false) => {}
    }
    Ok(TrainingOutcome {
        done,
        interrupted: !over,
        aborted: ledger.aborted,
    })
}

/// Counts the searches of the stopping rule as part of the training.
fn note_searches(patience: &mut StoppingRule<'_>, run: &mut RunDir, gym: &mut TrainingGym<'_>) {
    if let Some(sought) = patience.sought {
        run.note_sought(sought);
    }
    let mut spent = gym.inner().spent();
    spent.physics_steps += patience.take_steps();
    gym.inner().count_from(spent);
}

/// Returns a learner's checkpoint with the counts of its training goals.
fn checkpoint_of(learner: &dyn Learner, gym: &TrainingGym<'_>) -> TensorFile {
    let mut checkpoint = learner.checkpoint();
    if let Some(goals) = gym.goals() {
        goals.save(&mut checkpoint);
    }
    checkpoint
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
    let complaint = watch.faults.complaint();
    let complaint = complaint.filter(|_| watch.faults.has_given_up())?;
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
        aborted: 0,
    }
}

/// Counter of episodes, which writes progress lines.
#[derive(Default)]
struct Ledger {
    lines: String,
    episodes: u64,
    aborted: u64,
    /// Episodes since the last line.
    window: Window,
}

impl Ledger {
    /// Notes an episode, and returns at times the line of the recent ones.
    fn note(&mut self, progress: &LearnerReport) -> Option<Progress> {
        self.aborted = progress.aborted;
        self.episodes = progress.episodes;
        let window = &mut self.window;
        window.episodes += 1;
        window.returns += f64::from(progress.episode_return);
        window.solved += u64::from(0.0 < progress.episode_return);
        window.losses += progress.losses.sum;
        window.updates += progress.losses.updates;
        if window.episodes < REPORT_EPISODES {
            return None;
        }
        let line = Progress {
            decisions: progress.decisions,
            episodes: progress.episodes,
            window: window.episodes,
            aborted: progress.aborted,
            solved_share: window.solved as f64 / window.episodes as f64,
            mean_return: window.returns / window.episodes as f64,
            exploration: progress.exploration,
            mean_loss: (0 < window.updates).then(|| window.losses / window.updates as f64),
        };
        if let Ok(text) = serde_json::to_string(&line) {
            self.lines.push_str(&text);
            self.lines.push('\n');
        }
        self.window = Window::default();
        Some(line)
    }

    fn done(
        &self,
        learner: &dyn Learner,
        patience: &StoppingRule<'_>,
        spent: Spent,
        cpu_s: f64,
    ) -> Done {
        Done {
            decisions_asked: patience.requested,
            decisions: learner.decisions(),
            episodes: self.episodes,
            physics_steps: spent.physics_steps,
            cpu_s,
            window: self.window,
            calibration: patience.calibration,
            ended: patience.ended,
        }
    }
}
