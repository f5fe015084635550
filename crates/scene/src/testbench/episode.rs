//! Record of a played episode.

use super::{Actor, Testbench};
use crate::ego::{Command, Fault};
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::scene::{AfterContact, ContactEvent, Start};
use crate::stl::Scratch;
use crate::trace::Trace;

/// Record of a played episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Start of the episode.
    pub start: Start,
    /// Seed of all noise in the episode.
    pub noise: u64,
    /// The ados' joint actions per decision, including the aftermath.
    pub actions: Vec<usize>,
    /// All samples, including the aftermath.
    pub trace: Trace,
    /// Number of samples on which the verdict rests. The rest is aftermath.
    pub judged: usize,
    /// Verdict.
    pub verdict: Verdict,
    /// ρ(ψ_ego) of the judged samples.
    pub robustness: f64,
    /// The first contact, if the agents touched.
    pub contact: Option<ContactEvent>,
    /// Motion after the contact, in worlds that state `after_contact_s`.
    pub after_contact: Option<AfterContact>,
    /// After a success that ended in contact: rules kept or broken up to the contact.
    pub rules_until_contact: Option<RulesUntilContact>,
    /// All rules that were broken, if the verdict is a rule violation.
    ///
    /// They are positions in the rulebook, in rising order.
    pub broken_rules: Vec<usize>,
    /// Fault that made the verdict invalid.
    pub fault: Option<Fault>,
    /// Commands of an external ego, per sample.
    ///
    /// Empty for other egos, which are deterministic.
    pub commands: Vec<Command>,
    /// Physics steps spent.
    pub physics_steps: u64,
}

impl Episode {
    /// Returns its start with the seed of its noise.
    pub fn noisy_start(&self) -> NoisyStart<'_> {
        NoisyStart {
            start: &self.start,
            noise: self.noise,
        }
    }

    /// Returns whether an ado violated a rule between a success and the contact.
    pub fn is_foul_before_contact(&self) -> bool {
        let rules = self.rules_until_contact.as_ref();
        rules.is_some_and(|rules| !rules.is_kept())
    }
}

/// Start of an episode, with the seed of all its noise.
#[derive(Clone, Copy, Debug)]
pub struct NoisyStart<'a> {
    /// The start.
    pub start: &'a Start,
    /// Seed of all noise in the episode.
    pub noise: u64,
}

impl<'a> From<&'a (Start, u64)> for NoisyStart<'a> {
    fn from((start, noise): &'a (Start, u64)) -> NoisyStart<'a> {
        NoisyStart {
            start,
            noise: *noise,
        }
    }
}

/// Option to continue a decided episode, to record contact and closing speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aftermath {
    /// Stop at the verdict.
    Skip,
    /// After a success, continue with the same ado to contact or the horizon.
    Play,
}

/// Plays an episode with `actor` on `bench` and returns its record.
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
        let action = match bench.allowed() {
            Some(allowed) => actor.act_among(&obs, &allowed),
            None => actor.act(&obs),
        };
        actions.push(action);
        bench.decide(action);
    }
    bench.episode(start, noise, actions)
}

impl Episode {
    /// Returns the samples on which the verdict rests, without the aftermath.
    pub fn judged_trace(&self) -> Trace {
        let mut judged = self.trace.clone();
        judged.truncate(self.judged);
        judged
    }
}

impl Testbench {
    fn after_contact(&self) -> Option<AfterContact> {
        self.contact.as_ref()?;
        // Without a wish of the world only kept episodes are worth the time.
        self.scene.after_contact(0.0).map(|(after, _)| after)
    }

    /// Returns the record of the episode played from `start` under `actions`.
    pub fn episode(&self, start: &Start, noise: u64, actions: Vec<usize>) -> Episode {
        // The record of an undecided episode is no result.
        let verdict = self.verdict.unwrap_or(Verdict::Invalid);
        let mut scratch = Scratch::default();
        // Robustness is that of the judged samples, as in the verdict: the
        // aftermath does not belong to it.
        let mut judged = self.trace.clone();
        judged.truncate(self.judged);
        Episode {
            start: start.clone(),
            noise,
            actions: self.as_played(actions),
            robustness: self.rulebook.spec.robustness(&judged, &mut scratch),
            trace: self.trace.clone(),
            judged: self.judged,
            verdict,
            contact: self.contact.clone(),
            after_contact: self.after_contact(),
            rules_until_contact: self.rules_until_contact(),
            broken_rules: self.broken.clone(),
            fault: self.fault.clone(),
            commands: self.scene.commands().to_vec(),
            physics_steps: self.physics_steps(),
        }
    }
}
