//! Confirmation of pre-screened sequences on the requested plant.

use crate::adversary::RecordedFailure;
use crate::ego::Fault;
use crate::experiment::Watch;
use crate::scene::ContactEvent;
use crate::testbench::{Aftermath, NoisyStart, Replay, Testbench, play};
use crate::world::{Repeats, Scenario};

/// Player of sequences on the requested plant, which reuses shared prefixes.
///
/// The tree returns sequences with long shared prefixes, and rigid bodies cost twenty
/// times as much as points.
pub struct Confirmer<'a> {
    scenario: &'a Scenario,
    from: NoisyStart<'a>,
    index: usize,
    watch: &'a Watch<'a>,
    /// First fault of the ego or the physics.
    pub fault: Option<Fault>,
    /// Latest sequence, as far as it was played.
    actions: Vec<usize>,
    /// Benches after 0, 1, 2 … of these actions.
    benches: Vec<Testbench>,
    pub(crate) physics_steps: u64,
}

impl Confirmer<'_> {
    /// Creates a confirmer for the `index`th start, without any played sequence.
    pub fn new<'a>(
        scenario: &'a Scenario,
        from: NoisyStart<'a>,
        index: usize,
        watch: &'a Watch<'a>,
    ) -> Confirmer<'a> {
        Confirmer {
            scenario,
            from,
            index,
            watch,
            fault: None,
            actions: Vec::new(),
            benches: Vec::new(),
            physics_steps: 0,
        }
    }

    /// Plays `actions`, the last action held, to contact or the horizon.
    pub fn confirm(&mut self, actions: &[usize]) -> Confirmed {
        let pairs = self.actions.iter().zip(actions);
        let shared = pairs.take_while(|(a, b)| a == b).count();
        self.actions.truncate(shared);
        // One bench more than actions, for the state before the first of them.
        self.benches.truncate(shared + 1);
        if self.benches.is_empty() {
            let mut root = self.scenario.bench();
            // The episode continues after the verdict, because the contact is reported too.
            root.begin(self.from.start, self.from.noise, Aftermath::Play);
            self.benches.push(root);
        }
        // A sequence without actions cannot succeed.
        let Some(&last) = actions.last() else {
            return Confirmed::default();
        };
        let unplayed = actions[shared..].iter().copied();
        // The last action is held beyond the end of the sequence.
        let mut rest = unplayed.chain(std::iter::repeat(last));
        while let (Some(here), Some(action)) = (self.benches.last(), rest.next()) {
            if here.is_done() {
                let (fault, outcome) = (here.fault().cloned(), Confirmed::on(here));
                self.note(fault);
                return outcome;
            }
            // An ego without copies, such as a program, is played from the start each time.
            let Some(mut next) = here.fork() else {
                return self.replay(actions);
            };
            next.decide(action);
            // The copy counts the steps of its prefix as well, which an earlier turn has
            // added.
            self.physics_steps += next.physics_steps() - here.physics_steps();
            self.actions.push(action);
            self.benches.push(next);
        }
        // Invariant: the root is always present and `rest` never ends.
        Confirmed::default()
    }

    /// Failure of the ego in the sequence that was confirmed last.
    ///
    /// `None` if the ego did not fail, or if it cannot be copied and was replayed.
    pub fn failure(&self) -> Option<RecordedFailure> {
        // A replay leaves the root at its first sample, so its episode is not at hand.
        let last = self.benches.last().filter(|bench| bench.is_done())?;
        let episode = last.episode(self.from.start, self.from.noise, self.actions.clone());
        RecordedFailure::of(self.scenario, &episode)
    }

    /// Plays the sequence from the start, if the ego cannot be copied.
    ///
    /// Such an ego may not be deterministic, so the runs are repeated as the world requires.
    fn replay(&mut self, actions: &[usize]) -> Confirmed {
        let Repeats { runs, gate } = self.scenario.repeats;
        let (mut failures, mut all) = (0, Confirmed::default());
        // The world of a caller may ask for 0 runs, which would confirm nothing.
        for _ in 0..runs.max(1) {
            // Invariant: `confirm` has made the root before it replays.
            let Some(bench) = self.benches.first_mut() else {
                return Confirmed::default();
            };
            let mut replay = Replay::holding(actions);
            let episode = play(
                bench,
                self.from.start,
                self.from.noise,
                &mut replay,
                Aftermath::Play,
            );
            self.physics_steps += episode.physics_steps;
            let played = Confirmed::on(bench);
            failures += u32::from(played.success);
            all.runs += played.runs;
            all.violations += played.violations;
            // The first failure that ends in contact represents all repetitions.
            if all.contact.is_none() {
                all.contact = played.contact;
                all.violation_before_contact = played.violation_before_contact;
            }
            // The root is reset, because later sequences may start from it again.
            bench.begin(self.from.start, self.from.noise, Aftermath::Play);
            self.note(episode.fault);
        }
        // A gate of 0 would confirm a sequence without a failure.
        all.success = gate.max(1) <= failures;
        all
    }

    fn note(&mut self, fault: Option<Fault>) {
        self.watch.faults.note(self.index as u64, fault.as_ref());
        // Only the first fault is reported for a start.
        if self.fault.is_none() {
            self.fault = fault;
        }
    }
}

/// Outcome of a sequence on the requested plant.
#[derive(Default)]
pub struct Confirmed {
    /// True if the ego failed.
    pub success: bool,
    /// Contact after the failure, if the agents touched.
    pub contact: Option<ContactEvent>,
    /// True if a rule was broken between failure and contact.
    pub violation_before_contact: bool,
    /// Number of runs of the sequence.
    pub runs: u64,
    /// Runs in which a rule was broken before any failure.
    pub violations: u64,
}

impl Confirmed {
    /// Reads the outcome from the bench of a finished episode.
    pub fn on(bench: &Testbench) -> Confirmed {
        let verdict = bench.verdict();
        let success = verdict.is_some_and(|verdict| verdict.is_success());
        let rules = bench.rules_until_contact();
        Confirmed {
            success,
            // A contact without a failure does not count.
            contact: bench.contact().filter(|_| success).cloned(),
            violation_before_contact: rules.is_some_and(|rules| !rules.is_kept()),
            runs: 1,
            violations: u64::from(verdict.is_some_and(|verdict| verdict.is_foul())),
        }
    }
}
