//! The test bench: a scene and a rulebook, played decision by decision.
//!
//! This is the only place where the two meet. A [`Testbench`] plays one episode
//! at a time; [`Gym`] shows it to learners as an `rl::Env`, and [`play`] lets
//! any [`Actor`] act in it and records the [`Episode`].

mod actors;
mod counting;
mod faults;
mod gym;
mod recording;

use std::sync::Arc;

use rand::Rng;

pub use actors::{Actor, Constant, HOLD_DECISIONS, HeldRandom, PolicyActor, Random, Replay};
pub use faults::{Complaint, FaultCount, FaultLog, count_faults};
pub use gym::{Gym, Spent, Success};
pub use recording::{motion_of, passage_of};

use crate::ego::{Command, Fault, FaultKind};
use crate::preventability::Replayer;
use crate::rl::Spaces;
use crate::rulebook::{Counts, Judge, JudgeKind, Rulebook, RulesUntilContact, Stop, Verdict};
use crate::scene::{Axis, Clock, Flow, Frame, Scene, Stage, Start, Touch};
use crate::seed::StartKey;
use crate::trace::{Schema, Trace};
use recording::Recording;

/// Everything about one played episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Where it began.
    pub start: Start,
    /// Seed of all noise in it.
    pub noise: u64,
    /// The ados' joint actions, one per decision, the aftermath included.
    pub actions: Vec<usize>,
    /// All samples, the aftermath included.
    pub trace: Trace,
    /// Samples on which the verdict rests; what follows is aftermath.
    pub judged: usize,
    /// How it was judged.
    pub verdict: Verdict,
    /// ρ(ψ_ego) of the judged samples.
    pub robustness: f64,
    /// The first contact, if the agents touched.
    pub contact: Option<Touch>,
    /// After a success that ended in contact: whether the rules held up to it.
    pub rules_until_contact: Option<RulesUntilContact>,
    /// What failed, if the verdict is invalid.
    pub fault: Option<Fault>,
    /// What an ego that nobody here wrote commanded, sample by sample; empty
    /// for the others, which answer alike each time.
    pub commands: Vec<Command>,
    /// Physics steps spent.
    pub physics_steps: u64,
}

impl Episode {
    /// Whether an ado broke a rule between a success and the contact.
    pub fn is_foul_before_contact(&self) -> bool {
        let rules = self.rules_until_contact.as_ref();
        rules.is_some_and(|rules| !rules.is_kept())
    }
}

/// Whether a decided episode is played on to report contact and closing speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aftermath {
    /// Stop at the verdict.
    Skip,
    /// After a success, go on with the same ado to contact or the horizon.
    Play,
}

/// A scene under a rulebook.
pub struct Testbench {
    scene: Box<dyn Scene>,
    rulebook: Arc<Rulebook>,
    judge: Judge,
    trace: Trace,
    row: Vec<f64>,
    verdict: Option<Verdict>,
    judged: usize,
    contact: Option<Touch>,
    /// The first rule lost after a success, and when.
    lost: Option<(usize, f64)>,
    fault: Option<Fault>,
    decisions: usize,
    advances: u64,
    aftermath: Aftermath,
    recording: Recording,
    /// Puts reference drivers into the ego's place; made when it is first needed.
    replayer: Option<Replayer>,
}

impl Testbench {
    /// A bench on which `scene` is judged by `rulebook`.
    pub fn new(scene: Box<dyn Scene>, rulebook: Arc<Rulebook>) -> Testbench {
        let schema = Arc::clone(scene.schema());
        Testbench {
            judge: Judge::new(&rulebook, scene.clock().samples()),
            row: vec![0.0; schema.len()],
            trace: Trace::new(schema),
            verdict: None,
            judged: 0,
            contact: None,
            lost: None,
            fault: None,
            decisions: 0,
            advances: 0,
            aftermath: Aftermath::Skip,
            recording: Recording::asked(matches!(rulebook.counts, Counts::Preventable { .. })),
            replayer: None,
            scene,
            rulebook,
        }
    }

    /// Plays on another scene from the next episode on.
    ///
    /// It must publish the same signals on the same clocks.
    pub fn restage(&mut self, scene: Box<dyn Scene>) {
        // Invariant: the rulebook is bound to this schema.
        assert!(
            Arc::ptr_eq(self.scene.schema(), scene.schema()),
            "another scene publishes the same signals"
        );
        self.scene = scene;
        self.replayer = None;
    }

    /// The rulebook in force.
    pub fn rulebook(&self) -> &Rulebook {
        &self.rulebook
    }

    /// Shapes of observations and joint actions.
    pub fn spaces(&self) -> &Spaces {
        self.scene.spaces()
    }

    /// The clocks.
    pub fn clock(&self) -> &Clock {
        self.scene.clock()
    }

    /// X_init.
    pub fn axes(&self) -> &[Axis] {
        self.scene.axes()
    }

    /// The published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        self.scene.schema()
    }

    /// The start of a key.
    pub fn draw(&self, key: StartKey) -> Start {
        self.scene.draw(key)
    }

    /// Seed of the noise in the episode of a key.
    pub fn noise_of(&self, key: StartKey) -> u64 {
        key.generator("", "noise").next_u64()
    }

    /// What does not move, for viewers.
    pub fn stage(&self) -> Stage {
        self.scene.stage()
    }

    /// Where everybody is now, for viewers.
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
        self.fault = None;
        self.decisions = 0;
        self.advances = 0;
        self.begin_motion(start);
        self.record(None);
    }

    /// Takes one joint action; plays until the next decision or the verdict.
    pub fn decide(&mut self, action: usize) {
        self.decide_watched(action, &mut |_| {});
    }

    fn decide_watched(&mut self, action: usize, watch: &mut dyn FnMut(&dyn Scene)) {
        self.scene.decide(action);
        self.decisions += 1;
        for _ in 0..self.clock().samples_per_decision() {
            if self.is_done() {
                break;
            }
            self.sample();
            watch(&*self.scene);
        }
        if self.is_done() {
            self.scene.finish();
        }
    }

    /// The verdict, once nothing can change it.
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Whether the verdict has fallen.
    pub fn is_decided(&self) -> bool {
        self.verdict.is_some()
    }

    /// Whether the motion has ended: contact, fault or the horizon.
    pub fn is_over(&self) -> bool {
        self.contact.is_some() || self.fault.is_some() || self.samples_left() == 0
    }

    /// Whether there is nothing left to decide or to play.
    pub fn is_done(&self) -> bool {
        let played_on = self.aftermath == Aftermath::Play
            && self.verdict.is_some_and(|verdict| verdict.is_success());
        self.is_over() || (self.is_decided() && !played_on)
    }

    /// The samples so far.
    pub fn trace(&self) -> &Trace {
        &self.trace
    }

    /// Decisions taken in this episode.
    pub fn decisions(&self) -> usize {
        self.decisions
    }

    /// Physics steps spent in this episode.
    pub fn physics_steps(&self) -> u64 {
        self.advances * u64::from(self.clock().substeps)
    }

    /// Writes the ados' joint observation.
    pub fn observe(&self, obs: &mut [f32]) {
        self.scene.observe(&self.row, obs);
    }

    /// What failed, if the episode is invalid.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// The first contact, if the agents touched.
    pub fn contact(&self) -> Option<&Touch> {
        self.contact.as_ref()
    }

    /// After a success that ended in contact: whether the rules held up to it.
    ///
    /// `None` as long as there is no contact, and without a success.
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

    /// A copy that continues bit for bit; `None` if the ego cannot be copied.
    pub fn fork(&self) -> Option<Testbench> {
        Some(self.fork_around(self.trace.clone(), self.scene.fork()?))
    }

    /// A copy like [`Testbench::fork`] that takes the samples along.
    ///
    /// This bench must not go on before [`Testbench::rejoin`] gives them back.
    pub fn branch(&mut self) -> Option<Testbench> {
        let scene = self.scene.fork()?;
        let empty = Trace::new(Arc::clone(self.scene.schema()));
        let trace = std::mem::replace(&mut self.trace, empty);
        Some(self.fork_around(trace, scene))
    }

    /// Takes back the samples that [`Testbench::branch`] gave away.
    pub fn rejoin(&mut self, branch: Testbench) {
        self.trace = branch.trace;
        // One sample at t = 0 and one per advance.
        self.trace.truncate(self.advances as usize + 1);
    }

    fn fork_around(&self, trace: Trace, scene: Box<dyn Scene>) -> Testbench {
        Testbench {
            scene,
            rulebook: Arc::clone(&self.rulebook),
            judge: self.judge.clone(),
            trace,
            row: self.row.clone(),
            verdict: self.verdict,
            judged: self.judged,
            contact: self.contact.clone(),
            lost: self.lost,
            fault: self.fault.clone(),
            decisions: self.decisions,
            advances: self.advances,
            aftermath: self.aftermath,
            recording: self.recording.clone(),
            replayer: None,
        }
    }

    fn samples_left(&self) -> usize {
        self.clock().samples() - self.trace.len()
    }

    fn sample(&mut self) {
        self.advances += 1;
        let stop = match self.scene.advance() {
            Flow::Going if self.samples_left() == 1 => Some(Stop::Horizon),
            Flow::Going => None,
            Flow::Contact(touch) => {
                self.contact = Some(touch);
                Some(Stop::Contact)
            }
            Flow::Fault(fault) => return self.fail(fault),
        };
        self.push_motion();
        self.record(stop);
    }

    /// Publishes, records and judges the present sample.
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
            // Rigid bodies stop each other: the contact sample holds to T.
            while 0 < self.samples_left() && self.trace.push(&self.row).is_ok() {}
        }
        let verdict = self
            .judge
            .push(&self.rulebook, &self.trace, &self.row, stop);
        self.verdict = verdict.map(|verdict| self.counted(verdict));
        if self.is_decided() {
            self.judged = self.trace.len();
        }
    }

    /// Notes the first rule that the newest sample of the aftermath costs.
    fn follow_rules(&mut self) {
        if self.lost.is_some() {
            return;
        }
        let broken = self.judge.push_after(&self.rulebook, &self.row);
        self.lost = broken.map(|rule| {
            let sample = self.trace.len() - 1;
            // Time is i · dt; rounding hides the dust of binary fractions.
            let time_s = (sample as f64 * self.trace.dt_s() * 1e9).round() / 1e9;
            // The last sample shows the instant of the contact, before its time.
            let touch = self.contact.as_ref();
            (rule, touch.map_or(time_s, |touch| touch.time_s))
        });
    }

    fn fail(&mut self, fault: Fault) {
        self.fault = Some(fault);
        if !self.is_decided() {
            self.verdict = Some(Verdict::Invalid);
            self.judged = self.trace.len();
        }
    }
}

/// Lets `actor` play one episode on `bench` and returns the record of it.
pub fn play(
    bench: &mut Testbench,
    start: &Start,
    noise: u64,
    actor: &mut dyn Actor,
    aftermath: Aftermath,
) -> Episode {
    let mut obs = vec![0.0; bench.spaces().observation];
    let mut actions = Vec::with_capacity(bench.clock().decisions());
    bench.begin(start, noise, aftermath);
    actor.begin(noise, start);
    while !bench.is_done() {
        bench.observe(&mut obs);
        let action = actor.act(&obs);
        actions.push(action);
        bench.decide(action);
    }
    bench.episode(start, noise, actions)
}

/// Plays a recorded episode again and returns where everybody was, per sample.
pub fn film(bench: &mut Testbench, episode: &Episode) -> Vec<Frame> {
    bench.begin(&episode.start, episode.noise, Aftermath::Play);
    let mut frames = vec![bench.frame()];
    for &action in &episode.actions {
        bench.decide_watched(action, &mut |scene| frames.push(scene.frame()));
    }
    frames
}

impl Testbench {
    /// The record of what was played from `start` under `actions`.
    pub(crate) fn episode(&self, start: &Start, noise: u64, actions: Vec<usize>) -> Episode {
        let verdict = self.verdict.unwrap_or(Verdict::Invalid);
        let mut scratch = crate::stl::Scratch::default();
        let mut judged = self.trace.clone();
        judged.truncate(self.judged);
        Episode {
            start: start.clone(),
            noise,
            actions,
            robustness: self.rulebook.spec.robustness(&judged, &mut scratch),
            trace: self.trace.clone(),
            judged: self.judged,
            verdict,
            contact: self.contact.clone(),
            rules_until_contact: self.rules_until_contact(),
            fault: self.fault.clone(),
            commands: self.scene.commands().to_vec(),
            physics_steps: self.physics_steps(),
        }
    }
}
