//! Sequences that succeeded when pre-screened, played on the plant asked for.

use crate::campaign::Watch;
use crate::campaign::eval::RecordedFailure;
use crate::ego::Fault;
use crate::scenario::{Repeats, Scenario};
use crate::scene::{Start, Touch};
use crate::testbench::{Aftermath, Replay, Testbench, play};

/// Plays sequences on the plant asked for, each from where it leaves the last.
///
/// The tree hands over sequences that share long prefixes, and rigid bodies
/// cost twenty times what points cost.
pub(in crate::campaign) struct Confirmer<'a> {
    scenario: &'a Scenario,
    start: &'a Start,
    noise: u64,
    index: usize,
    watch: &'a Watch<'a>,
    /// The first fault met.
    pub fault: Option<Fault>,
    /// The latest sequence as far as it was played.
    actions: Vec<usize>,
    /// The benches after 0, 1, 2 … of these actions.
    benches: Vec<Testbench>,
    pub physics_steps: u64,
}

impl Confirmer<'_> {
    /// Nothing played yet from a start, which is the `index`th.
    pub fn new<'a>(
        scenario: &'a Scenario,
        (start, noise): (&'a Start, u64),
        index: usize,
        watch: &'a Watch<'a>,
    ) -> Confirmer<'a> {
        Confirmer {
            scenario,
            start,
            noise,
            index,
            watch,
            fault: None,
            actions: Vec::new(),
            benches: Vec::new(),
            physics_steps: 0,
        }
    }

    /// Plays `actions`, the last one held, to contact or the horizon.
    pub fn confirm(&mut self, actions: &[usize]) -> Confirmed {
        let pairs = self.actions.iter().zip(actions);
        let shared = pairs.take_while(|(a, b)| a == b).count();
        self.actions.truncate(shared);
        self.benches.truncate(shared + 1);
        if self.benches.is_empty() {
            let mut root = self.scenario.bench();
            root.begin(self.start, self.noise, Aftermath::Play);
            self.benches.push(root);
        }
        let Some(&last) = actions.last() else {
            return Confirmed::default();
        };
        let rest = actions[shared..].iter().copied();
        let mut rest = rest.chain(std::iter::repeat(last));
        while let (Some(here), Some(action)) = (self.benches.last(), rest.next()) {
            if here.is_done() {
                let (fault, outcome) = (here.fault().cloned(), Confirmed::on(here));
                self.note(fault);
                return outcome;
            }
            let Some(mut next) = here.fork() else {
                return self.replay(actions);
            };
            next.decide(action);
            self.physics_steps += next.physics_steps() - here.physics_steps();
            self.actions.push(action);
            self.benches.push(next);
        }
        // Invariant: the root is always there and `rest` never ends.
        Confirmed::default()
    }

    /// In which way the ego failed in what was confirmed last; `None`: it did not,
    /// or it was replayed where the ego cannot be copied.
    pub fn failure(&self) -> Option<RecordedFailure> {
        let last = self.benches.last().filter(|bench| bench.is_done())?;
        let episode = last.episode(self.start, self.noise, self.actions.clone());
        RecordedFailure::of(self.scenario, &episode)
    }

    /// The same from the start, where the ego cannot be copied; as often as the
    /// world asks, since such an ego may answer otherwise the next time.
    fn replay(&mut self, actions: &[usize]) -> Confirmed {
        let Repeats { runs, gate } = self.scenario.repeats;
        let (mut failures, mut shown) = (0, Confirmed::default());
        for _ in 0..runs.max(1) {
            let Some(bench) = self.benches.first_mut() else {
                return Confirmed::default();
            };
            let mut replay = Replay::holding(actions);
            let episode = play(bench, self.start, self.noise, &mut replay, Aftermath::Play);
            self.physics_steps += episode.physics_steps;
            let played = Confirmed::on(bench);
            failures += u32::from(played.success);
            // The first failure that ends in contact stands for all.
            if shown.contact.is_none() {
                shown = played;
            }
            bench.begin(self.start, self.noise, Aftermath::Play);
            self.note(episode.fault);
        }
        match gate.max(1) <= failures {
            true => Confirmed {
                success: true,
                ..shown
            },
            false => Confirmed::default(),
        }
    }

    fn note(&mut self, fault: Option<Fault>) {
        self.watch.faults.note(self.index as u64, fault.as_ref());
        if self.fault.is_none() {
            self.fault = fault;
        }
    }
}

/// How a sequence fared on the plant asked for.
#[derive(Default)]
pub(in crate::campaign) struct Confirmed {
    /// Whether the ego failed.
    pub success: bool,
    /// The contact after it, if the agents touched.
    pub contact: Option<Touch>,
    /// Whether a rule was broken between the two.
    pub foul_before_contact: bool,
}

impl Confirmed {
    /// How the episode on a bench ended.
    pub fn on(bench: &Testbench) -> Confirmed {
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        let rules = bench.rules_until_contact();
        Confirmed {
            success,
            contact: bench.contact().filter(|_| success).cloned(),
            foul_before_contact: rules.is_some_and(|rules| !rules.is_kept()),
        }
    }
}
