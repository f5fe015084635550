//! A driven episode: sample by sample, back to any moment and on from there.
//!
//! It has no clock. Equal setups and equal inputs give equal bits, so that the way back is
//! the same episode played again up to a sample.

use super::error::DriveError;
use super::frame::{DriveFrame, DriveOutcome};
use super::hand::Hand;
use super::input::DriveInput;
use super::sandbox::{DriveSeat, Sandbox, Setup};
use crate::crashes::root_cause::why;
use crate::ego::Command;
use crate::experiment::{EgoUnderTest, verdict_instant};
use crate::report::outcome_in_words;
use crate::rl::Spaces;
use crate::rulebook::Verdict;
use crate::run_dir::{AdversaryId, Why};
use crate::scene::{SceneGeometry, Start};
use crate::search::{AdoPlayer, JointActions};
use crate::testbench::{Aftermath, Episode, Testbench};

/// Episode in progress.
pub struct DrivenEpisode {
    setup: Setup,
    ego: EgoUnderTest,
    seat: DriveSeat,
    bench: Testbench,
    hand: Hand,
    player: JointActions,
    /// Whether the search found a sequence. `None`: no search plays the ados.
    search_found: Option<bool>,
    /// Joint actions so far, one per decision.
    actions: Vec<usize>,
    /// Inputs so far, one per sample after the first.
    inputs: Vec<DriveInput>,
    frames: Vec<DriveFrame>,
}

/// Returns a joint action with the action of one ado replaced.
fn with_own(spaces: &Spaces, joint: usize, ado: usize, own: Option<usize>) -> usize {
    // In a joint action, the first ado's action varies fastest.
    let unit: usize = spaces.parts[..ado]
        .iter()
        .map(|part| part.actions)
        .product();
    let part = &spaces.parts[ado];
    let before = joint / unit % part.actions;
    // An action that the ado does not have is none.
    let own = own.filter(|it| *it < part.actions).unwrap_or(part.neutral);
    joint - unit * before + unit * own
}

impl DrivenEpisode {
    /// Begins an episode, with the sample at 0 s.
    ///
    /// The ados are neutral where the search finds no sequence from the start.
    ///
    /// # Errors
    /// The setup does not fit the world, or an ego is a program that is not allowed.
    pub fn begin(sandbox: &Sandbox, setup: &Setup) -> Result<DrivenEpisode, DriveError> {
        // A hand of its own, so that an old episode does not obey the new
        // keys.
        let hand = Hand::default();
        let ego = sandbox.ego(&setup.ego, &setup.ego_values, &hand)?;
        // Before the search, which takes the start as valid.
        check_start(sandbox, setup)?;
        let bench = ego.scenario().bench();
        let spaces = bench.spaces();
        let mut search_found = None;
        let player = match setup.ado {
            AdoPlayer::Neutral => JointActions::neutral(spaces),
            AdoPlayer::Random => JointActions::random(spaces),
            AdoPlayer::Trained => {
                let policy = sandbox.trained().ok_or(DriveError::NotTrained)?;
                JointActions::trained(policy)
            }
            AdoPlayer::Search => {
                let found = sandbox.searched(&ego, setup)?;
                search_found = Some(found.is_some());
                // The start can be driven nevertheless.
                found.unwrap_or_else(|| JointActions::neutral(spaces))
            }
        };
        let mut episode = DrivenEpisode {
            setup: setup.clone(),
            ego,
            seat: sandbox.seat().clone(),
            bench,
            hand,
            player,
            search_found,
            actions: Vec::new(),
            inputs: Vec::new(),
            frames: Vec::new(),
        };
        episode.play_again(&[], &[]);
        Ok(episode)
    }

    /// Returns the setup.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Returns whether the search found a sequence. `None`: no search plays the ados.
    pub fn search_found(&self) -> Option<bool> {
        self.search_found
    }

    /// Returns the static content.
    pub fn stage(&self) -> SceneGeometry {
        self.bench.stage()
    }

    /// Returns whether the road has grown with the newest sample.
    pub(super) fn has_new_road(&self) -> bool {
        let world = self.ego.scenario().drive();
        let lays = world.is_some_and(|it| it.spec().road_ado.is_some());
        // A piece is laid with a decision, and shows in the sample after it.
        let per_decision = self.bench.clock().samples_per_decision();
        lays && self.inputs.len() % per_decision == 1 % per_decision
    }

    /// Returns a frame per sample so far.
    pub fn frames(&self) -> &[DriveFrame] {
        &self.frames
    }

    /// Returns the time between two samples.
    pub fn sample_s(&self) -> f64 {
        self.bench.clock().sample_s
    }

    /// Returns whether the episode is decided and has come to its end.
    pub fn is_done(&self) -> bool {
        self.bench.is_done()
    }

    /// Returns whether the verdict is final.
    pub fn is_decided(&self) -> bool {
        self.bench.is_decided()
    }

    /// Plays the next sample. `None`: the episode is over.
    pub fn advance(&mut self, input: DriveInput) -> Option<&DriveFrame> {
        self.step(input.bounded(), None)
    }

    /// Goes back to a sample. From there it goes on with new inputs.
    ///
    /// # Errors
    /// The sample was not played.
    pub fn back_to(&mut self, sample: usize) -> Result<(), DriveError> {
        if sample >= self.frames.len() {
            return Err(DriveError::NotPlayed { sample });
        }
        // Copies, since playing again clears both lists.
        let inputs = self.inputs[..sample].to_vec();
        // The decision at the sample itself is taken anew.
        let taken = sample.div_ceil(self.bench.clock().samples_per_decision());
        let actions = self.actions[..taken.min(self.actions.len())].to_vec();
        self.play_again(&inputs, &actions);
        Ok(())
    }

    fn play_again(&mut self, inputs: &[DriveInput], actions: &[usize]) {
        let start = Start(self.setup.start.clone());
        let noise = self.setup.noise;
        // The hand still has the command of the last sample that was played.
        self.hand.set(Command::default());
        // To the contact, which a kept file needs for its severity.
        self.bench.begin(&start, noise, Aftermath::Play);
        // With the noise of the setup, so that a random player repeats its
        // choices.
        self.player.begin(noise, &start);
        self.actions.clear();
        self.inputs.clear();
        self.frames.clear();
        self.push_frame(None);
        for input in inputs {
            self.step(*input, Some(actions));
        }
    }

    /// Plays a sample. `recorded` has the joint actions of a part that is played again.
    fn step(&mut self, input: DriveInput, recorded: Option<&[usize]>) -> Option<&DriveFrame> {
        if self.bench.is_done() {
            return None;
        }
        if self.bench.is_decision_due() {
            self.decide(input, recorded);
        }
        // Before the sample, in which the ego asks the hand.
        self.hand.set(Command {
            accel_mps2: input.accel_mps2,
            lateral_mps: input.lateral_mps,
        });
        self.bench.play_sample();
        self.inputs.push(input);
        self.push_frame(Some(input));
        self.frames.last()
    }

    fn decide(&mut self, input: DriveInput, recorded: Option<&[usize]>) {
        let mut obs = vec![0.0; self.bench.spaces().observation];
        self.bench.observe(&mut obs);
        let allowed = self.bench.allowed();
        let decision = self.actions.len();
        // Asked also where the action is recorded, so that a random player goes on from there.
        let played = self.player.act(&obs, allowed.as_deref(), decision);
        let chosen = match self.seat {
            DriveSeat::Ado(ado) => with_own(self.bench.spaces(), played, ado, input.action),
            DriveSeat::Ego => played,
        };
        let known = recorded.and_then(|it| it.get(decision)).copied();
        let action = known.unwrap_or(chosen);
        self.actions.push(action);
        self.bench.decide_only(action);
    }

    fn push_frame(&mut self, input: Option<DriveInput>) {
        let mut obs = vec![0.0; self.bench.spaces().observation];
        self.bench.observe(&mut obs);
        let action = self.actions.last().copied();
        let mut frame = DriveFrame::of(&self.bench, self.ego.scenario(), input, action);
        frame.value = self.player.value(&obs);
        frame.values = self.player.values(&obs);
        frame.outcome = self.outcome();
        self.frames.push(frame);
    }

    /// Returns the verdict, once it is final.
    fn outcome(&self) -> Option<DriveOutcome> {
        let verdict = self.bench.verdict()?;
        let episode = self.episode();
        // The aftermath changes no verdict, and its instant is computed once.
        let known = self.frames.last().and_then(|it| it.outcome.as_ref());
        let time_s = known.map_or_else(
            || verdict_instant(self.ego.scenario(), &episode).time_s,
            |it| it.time_s,
        );
        let mut words = outcome_in_words(self.ego.scenario(), &episode);
        if let Some(fault) = self.bench.fault() {
            words = format!("{words}: {fault}");
        }
        Some(DriveOutcome {
            verdict: verdict.word(),
            words,
            time_s,
            broken: self.bench.broken_rules().to_vec(),
            // Failures that do not count are no successes of the ado and are
            // not kept.
            keeps: matches!(verdict, Verdict::Counterexample { .. }),
        })
    }

    /// Returns the record of the episode so far.
    pub fn episode(&self) -> Episode {
        let start = Start(self.setup.start.clone());
        let actions = self.actions.clone();
        self.bench.episode(&start, self.setup.noise, actions)
    }

    /// Returns the cause of a failure that is played to its end. `None`: nothing failed.
    ///
    /// Your commands are repeated in its replays, so an answer takes no program.
    pub fn why(&self) -> Option<Why> {
        if !self.is_done() {
            return None;
        }
        let episode = self.episode();
        let is_failure = matches!(
            episode.verdict,
            Verdict::Counterexample { .. } | Verdict::Uncounted { .. }
        );
        let world = self.ego.scenario().repeating(&episode);
        is_failure.then(|| why(&world, &episode, None))
    }

    /// Returns the ego.
    pub fn ego(&self) -> &EgoUnderTest {
        &self.ego
    }

    /// Returns the inputs so far, one per sample after the first.
    pub fn inputs(&self) -> &[DriveInput] {
        &self.inputs
    }

    /// Returns the name of the ados' player in kept files.
    pub(super) fn adversary(&self) -> AdversaryId {
        match self.seat {
            DriveSeat::Ado(_) => AdversaryId::from(super::sandbox::YOU),
            DriveSeat::Ego => self.player.adversary(),
        }
    }
}

fn check_start(sandbox: &Sandbox, setup: &Setup) -> Result<(), DriveError> {
    let axes = sandbox.world().axes();
    if axes.len() != setup.start.len() {
        let why = format!("{} values for {} axes", setup.start.len(), axes.len());
        return Err(DriveError::BadStart { why });
    }
    // NaN is in no range, so it is refused as well.
    let mut values = axes.iter().zip(&setup.start);
    let Some((axis, value)) = values.find(|(axis, value)| !(axis.lo..=axis.hi).contains(value))
    else {
        return Ok(());
    };
    let (name, lo, hi) = (&axis.name, axis.lo, axis.hi);
    let why = format!("`{name}` = {value} is outside of {lo} ..= {hi}");
    Err(DriveError::BadStart { why })
}
