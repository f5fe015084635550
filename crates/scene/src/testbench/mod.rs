//! The test bench: a scene and a rulebook, played decision by decision.
//!
//! Only this module combines the two. A [`Testbench`] plays an episode at a
//! time. [`Gym`] presents it to learners as an `rl::Env`. [`play`] lets any
//! [`Actor`] act in it and records the [`Episode`].

pub mod actors;
mod counted_violation;
mod episode;
mod faults;
pub mod film;
mod fork;
mod gym;
mod live;
mod recording;
mod repeats;

use std::sync::Arc;

use rand::Rng;

pub use actors::HOLD_DECISIONS;
pub use actors::{
    Actor, Constant, HeldRandom, PolicyActor, Random, Replay, SampledPolicy, Sampling, draws,
    trained_actor,
};
pub use episode::{Aftermath, Episode, NoisyStart, play};
pub use faults::{Complaint, FaultCount, FaultLog};
pub use faults::{add_fault, count_faults};
pub use film::{Film, FilmAfterContact, film, film_beyond, joined};
pub use gym::{FIRST_KNOWN, Gym, KnownEpisode, Success};
pub use gym::{Spent, start_of};
pub use live::Margins;
pub use recording::motion_of;
pub use recording::passage_of;
pub use repeats::MAX_REPEATS;
pub use repeats::Repeats;

use crate::ego::{Fault, FaultKind};
use crate::natural::{AdoLimit, LimitedScene};
use crate::preventability::Replayer;
use crate::rl::Spaces;
use crate::rulebook::{Counts, Judge, JudgeKind, Rulebook, RulesUntilContact, Stop, Verdict};
use crate::scene::drive::DriveWorld;
use crate::scene::{Axis, Clock, ContactEvent, Frame, Scene, SceneGeometry, Start, StepOutcome};
use crate::seed::StartKey;
use crate::trace::{Schema, Trace};
use recording::MotionRecorder;

/// A scene under a rulebook.
pub struct Testbench {
    scene: Box<dyn Scene>,
    rulebook: Arc<Rulebook>,
    judge: Judge,
    trace: Trace,
    /// Samples of a full episode, and of a decision.
    samples: (usize, usize),
    row: Vec<f64>,
    verdict: Option<Verdict>,
    judged: usize,
    contact: Option<ContactEvent>,
    /// First rule violated after a success, with its time.
    lost: Option<(usize, f64)>,
    /// Rules that the episode broke, if its verdict is a rule violation.
    broken: Vec<usize>,
    fault: Option<Fault>,
    decisions: usize,
    advances: u64,
    aftermath: Aftermath,
    recording: MotionRecorder,
    /// Replays with reference drivers in the ego's place, created on first use.
    replayer: Option<Replayer>,
    /// Limit on how rare the ados' driving may become, if any.
    limit: Option<AdoLimit>,
    /// Joint actions of this episode, as the limit let them be played.
    played: Vec<usize>,
}

impl Testbench {
    /// Creates a bench on which `rulebook` judges `scene`.
    pub fn new(scene: Box<dyn Scene>, rulebook: Arc<Rulebook>) -> Testbench {
        let schema = Arc::clone(scene.schema());
        Testbench {
            judge: Judge::new(&rulebook, scene.clock().samples()),
            samples: (
                scene.clock().samples(),
                scene.clock().samples_per_decision(),
            ),
            row: vec![0.0; schema.len()],
            trace: Trace::new(schema),
            verdict: None,
            judged: 0,
            contact: None,
            lost: None,
            broken: Vec::new(),
            fault: None,
            decisions: 0,
            advances: 0,
            aftermath: Aftermath::Skip,
            // Reference drivers replay the motion, so their worlds record it.
            recording: MotionRecorder::enabled(matches!(
                rulebook.counts,
                Counts::Preventable { .. }
            )),
            replayer: None,
            limit: None,
            played: Vec::new(),
            scene,
            rulebook,
        }
    }

    /// Limits how rare the ados' driving may become.
    pub fn limited(mut self, limit: AdoLimit) -> Testbench {
        self.scene = LimitedScene::around(self.scene, &limit);
        self.limit = Some(limit);
        self
    }

    /// Plays on a different scene from the next episode on.
    ///
    /// It must publish the same signals on the same clocks.
    pub fn replace_scene(&mut self, scene: Box<dyn Scene>) {
        // Invariant: the rulebook is bound to this schema.
        assert!(
            Arc::ptr_eq(self.scene.schema(), scene.schema()),
            "another scene publishes the same signals"
        );
        self.scene = match &self.limit {
            Some(limit) => LimitedScene::around(scene, limit),
            None => scene,
        };
        // The replayer belongs to the old scene's world.
        self.replayer = None;
    }

    /// Returns the rulebook.
    pub fn rulebook(&self) -> &Rulebook {
        &self.rulebook
    }

    /// Returns the shapes of observations and joint actions.
    pub fn spaces(&self) -> &Spaces {
        self.scene.spaces()
    }

    /// Returns the clocks.
    pub fn clock(&self) -> &Clock {
        self.scene.clock()
    }

    /// Returns the axes of X_init.
    pub fn axes(&self) -> &[Axis] {
        self.scene.axes()
    }

    /// Returns the schema of the published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        self.scene.schema()
    }

    /// Returns the start of a key.
    pub fn draw(&self, key: StartKey) -> Start {
        self.scene.draw(key)
    }

    /// Returns the seed of the noise in the episode of a key.
    pub fn noise_of(&self, key: StartKey) -> u64 {
        key.generator("", "noise").next_u64()
    }

    /// Returns the static content, for viewers.
    pub fn stage(&self) -> SceneGeometry {
        self.scene.stage()
    }

    /// Returns the driving world with the road of the current start, if any.
    pub fn driven(&self) -> Option<DriveWorld> {
        self.scene.driven()
    }

    /// Returns the poses of all agents now, for viewers.
    pub fn frame(&self) -> Frame {
        self.scene.frame()
    }

    /// Begins an episode and judges its first sample.
    pub fn begin(&mut self, start: &Start, noise: u64, aftermath: Aftermath) {
        self.aftermath = aftermath;
        self.scene.reset(start, noise);
        self.judge.reset();
        self.trace.clear();
        self.verdict = None;
        self.judged = 0;
        self.contact = None;
        self.lost = None;
        self.broken.clear();
        self.fault = None;
        self.decisions = 0;
        self.advances = 0;
        self.played.clear();
        self.begin_motion(start);
        // The initial sample can already decide the episode.
        self.record(None);
    }

    /// Returns which joint actions are allowed now, `None` if all are.
    pub fn allowed(&self) -> Option<Vec<bool>> {
        self.scene.allowed()
    }

    /// Applies a joint action until the next decision or the verdict.
    ///
    /// An action that is not allowed now is replaced by the most similar allowed one.
    pub fn decide(&mut self, action: usize) {
        self.decide_watched(action, &mut |_| {});
    }

    fn decide_watched(&mut self, action: usize, watch: &mut dyn FnMut(&dyn Scene)) {
        self.choose(action);
        for _ in 0..self.samples.1 {
            if self.is_done() {
                break;
            }
            self.sample();
            watch(&*self.scene);
        }
        if self.is_done() {
            // An external ego is released here and not at the next `begin`, so
            // that its program is available to other workers meanwhile.
            self.scene.finish();
        }
    }

    /// Sets the joint action until the next decision, without any motion.
    fn choose(&mut self, action: usize) {
        let action = self.allowed_instead(action);
        if self.limit.is_some() {
            self.played.push(action);
        }
        self.scene.decide(action);
        self.decisions += 1;
    }

    /// Returns the allowed action that differs least from one.
    fn allowed_instead(&self, action: usize) -> usize {
        // Without a limit, which is usual, nothing is allocated.
        let Some(allowed) = self.limit.as_ref().and_then(|_| self.allowed()) else {
            return action;
        };
        // Checked first, because the world below is a copy.
        if allowed[action] {
            return action;
        }
        let Some(world) = self.driven() else {
            return action;
        };
        let differs = |other: &usize| world.spec().action_distance(action, *other);
        let others = (0..allowed.len()).filter(|other| allowed[*other]);
        let nearest = others.min_by(|a, b| differs(a).total_cmp(&differs(b)));
        nearest.unwrap_or(action)
    }

    /// Returns the actions of this episode as they were played, within the limit.
    pub(super) fn as_played(&self, mut actions: Vec<usize>) -> Vec<usize> {
        let played = self.played.iter();
        actions
            .iter_mut()
            .zip(played)
            .for_each(|(it, played)| *it = *played);
        actions
    }

    /// Returns the verdict, once it is final.
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Returns whether the verdict is final.
    pub fn is_decided(&self) -> bool {
        self.verdict.is_some()
    }

    /// Returns whether the motion has ended: contact, fault or the horizon.
    pub fn is_over(&self) -> bool {
        self.contact.is_some() || self.fault.is_some() || self.samples_left() == 0
    }

    /// Returns whether the episode is decided and its aftermath is complete.
    pub fn is_done(&self) -> bool {
        let played_on = self.aftermath == Aftermath::Play
            && self.verdict.is_some_and(|verdict| verdict.is_success());
        self.is_over() || (self.is_decided() && !played_on)
    }

    /// Returns the samples so far.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Returns the number of decisions in this episode.
    pub fn decisions(&self) -> usize {
        self.decisions
    }

    /// Returns the number of physics steps in this episode.
    pub fn physics_steps(&self) -> u64 {
        self.advances * u64::from(self.clock().substeps)
    }

    /// Returns the number of steps of rapier's pipeline in this episode.
    ///
    /// On the rigid plant it is [`Testbench::physics_steps`], less those after a contact
    /// within the last sample.
    pub fn rapier_steps(&self) -> u64 {
        self.scene.rapier_steps()
    }

    /// Writes the ados' joint observation.
    pub fn observe(&self, obs: &mut [f32]) {
        self.scene.observe(&self.row, obs);
    }

    /// Returns the fault, if the episode is invalid.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// Returns the first contact, if the agents touched.
    pub fn contact(&self) -> Option<&ContactEvent> {
        self.contact.as_ref()
    }

    /// Returns whether the rules held between a success and the contact.
    ///
    /// `None` without a success or before the contact.
    pub fn rules_until_contact(&self) -> Option<RulesUntilContact> {
        let success = self.verdict.is_some_and(|verdict| verdict.is_success());
        if !success || self.contact.is_none() {
            return None;
        }
        Some(match self.lost {
            None => RulesUntilContact::Kept,
            Some((rule, time_s)) => {
                let rule = &self.rulebook.rules[rule];
                RulesUntilContact::Broken {
                    rule: rule.name.clone(),
                    ado: rule.ado.clone(),
                    time_s,
                }
            }
        })
    }

    /// Returns all rules that the episode broke, if it is a rule violation.
    ///
    /// The verdict names only the most important one.
    pub fn broken_rules(&self) -> &[usize] {
        &self.broken
    }

    fn samples_left(&self) -> usize {
        self.samples.0 - self.trace.len()
    }

    fn sample(&mut self) {
        let outcome = self.scene.advance();
        self.take(outcome);
    }

    /// Records and judges the sample to which the scene has just advanced.
    fn take(&mut self, outcome: StepOutcome) {
        self.advances += 1;
        let stop = match outcome {
            // The sample that is recorded below is the last one.
            StepOutcome::Going if self.samples_left() == 1 => Some(Stop::Horizon),
            StepOutcome::Going => None,
            StepOutcome::Contact(touch) => {
                // Before `push_motion`, which notes the contact with the
                // sample.
                self.contact = Some(touch);
                Some(Stop::Contact)
            }
            StepOutcome::Fault(fault) => return self.fail(fault),
        };
        self.push_motion();
        self.record(stop);
    }

    /// Publishes, records and judges the current sample.
    fn record(&mut self, stop: Option<Stop>) {
        self.scene.publish(&mut self.row);
        if self.trace.push(&self.row).is_err() {
            let time_s = self.trace.len() as f64 * self.trace.dt_s();
            return self.fail(Fault::new(
                FaultKind::Physics,
                format!("a signal is not finite at {time_s:.3} s"),
            ));
        }
        if self.is_decided() {
            return self.follow_rules();
        }
        if stop == Some(Stop::Contact) && self.rulebook.judge == JudgeKind::WholeRun {
            // Bodies stop each other, so the sample of the contact is held until T.
            while self.samples_left() > 0 && self.trace.push(&self.row).is_ok() {}
        }
        let verdict = self
            .judge
            .push_checked(&self.rulebook, &self.trace, &self.row, stop);
        self.verdict = verdict.map(|verdict| self.counted(verdict));
        if self.is_decided() {
            self.judged = self.trace.len();
        }
        if verdict.is_some_and(|verdict| verdict.is_foul()) {
            // A violation ends the episode, so all samples are judged.
            self.broken = self.judge.broken(&self.rulebook, &self.trace);
        }
    }

    /// Records the first rule that the newest sample of the aftermath violates.
    fn follow_rules(&mut self) {
        // Only the first violated rule is reported.
        if self.lost.is_some() {
            return;
        }
        let broken = self.judge.push_after(&self.rulebook, &self.row);
        self.lost = broken.map(|rule| {
            let sample = self.trace.len() - 1;
            // Rounded to hide the representation error of i · dt.
            let time_s = (sample as f64 * self.trace.dt_s() * 1e9).round() / 1e9;
            // The last sample holds the instant of the contact, which precedes its time.
            let touch = self.contact.as_ref();
            (rule, touch.map_or(time_s, |touch| touch.time_s))
        });
    }

    fn fail(&mut self, fault: Fault) {
        self.fault = Some(fault);
        // A fault in the aftermath does not revoke a verdict.
        if !self.is_decided() {
            self.verdict = Some(Verdict::Invalid);
            self.judged = self.trace.len();
        }
    }
}
