//! All sequences with at most so many switches of action, fewest first.

use super::found::Found;
use super::method::{
    MethodInfo, MethodOption, MethodSettings, SWITCHES, SearchMethod, StartSearch,
};
use crate::campaign::Watch;
use crate::campaign::error::CampaignError;
use crate::ego::Fault;
use crate::run::Unconfirmed;
use crate::scenario::{Repeats, Scenario};
use crate::scene::Start;
use crate::testbench::{Aftermath, Replay, Testbench, play};

/// Pre-screened sequences that are tried on the plant asked for, per start.
const MAX_CONFIRMATIONS: u64 = 300;

/// All sequences with at most so many switches of action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches(pub usize);

impl SearchMethod<'_> for Switches {
    const INFO: MethodInfo = MethodInfo {
        name: "switches",
        help: "All sequences with at most M switches of action, fewest first",
        takes: &[MethodOption::Switches],
        prescreens: true,
    };

    fn with(settings: &MethodSettings<'_>) -> Result<Switches, CampaignError> {
        Ok(Switches(settings.switches.unwrap_or(SWITCHES)))
    }

    fn text(&self, _budget: u64, unconfirmed: Option<Unconfirmed>) -> String {
        let mut text = format!("switches ≤ {}", self.0);
        if let Some(Unconfirmed { sequences, starts }) = unconfirmed {
            text.push_str(&format!(
                ", pre-screened on the kinematic plant, {sequences} unconfirmed"
            ));
            if 0 < starts {
                text.push_str(&format!(" (nothing else on {starts} starts)"));
            }
        }
        text
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<Found> {
        solve(&one, self.0)
    }
}

/// Without a plant that sorts out sequences first, what succeeds on the plant
/// asked for is played once more, to contact.
fn solve(one: &StartSearch<'_>, most: usize) -> Option<Found> {
    let &StartSearch {
        scenario: asked_for,
        cheap,
        start,
        noise,
        index,
        watch,
        ..
    } = one;
    let scenario = cheap.unwrap_or(asked_for);
    let mut confirmer = Confirmer::new(asked_for, (start, noise), index, watch);
    let mut found = Found::default();
    let mut accept = |actions: &[usize]| {
        let played = confirmer.confirm(actions);
        if cheap.is_some() {
            found.simulations += 1;
            found.unconfirmed += u64::from(!played.success);
        }
        if played.success {
            found.closing_speed_mps = played.closing_speed_mps;
            found.foul_before_contact = played.foul_before_contact;
            found.actions = Some(actions.to_vec());
        }
        match played.success || MAX_CONFIRMATIONS <= found.simulations {
            true => Next::Stop,
            false => Next::Continue,
        }
    };
    let mut root = scenario.bench();
    root.begin(start, noise, Aftermath::Skip);
    let mut tree = Tree {
        start,
        noise,
        index,
        forks: root.fork().is_some(),
        fault: None,
        actions: scenario.world().spaces().actions,
        prefix: Vec::new(),
        accept: &mut accept,
        watch,
        simulations: 0,
        physics_steps: 0,
    };
    let mut next = Next::Continue;
    for switches in 0..=most {
        for action in 0..tree.actions {
            if next == Next::Continue {
                root.begin(start, noise, Aftermath::Skip);
                next = tree.explore(&mut root, action, switches);
            }
        }
    }
    let (simulations, physics_steps) = (tree.simulations, tree.physics_steps);
    found.fault = tree.fault.or(confirmer.fault);
    if found.actions.is_none() && found.fault.is_none() && watch.stopped() {
        return None;
    }
    found.simulations += simulations;
    found.physics_steps = physics_steps + confirmer.physics_steps;
    Some(found)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Next {
    Continue,
    Stop,
}

/// All sequences with a given number of switches, prefixes shared by forking.
///
/// An ego that cannot be copied, a program say, plays every sequence from the
/// start, one after the other: one program is enough for that.
struct Tree<'a> {
    start: &'a Start,
    noise: u64,
    index: usize,
    forks: bool,
    /// The first fault met.
    fault: Option<Fault>,
    actions: usize,
    prefix: Vec<usize>,
    accept: &'a mut dyn FnMut(&[usize]) -> Next,
    watch: &'a Watch<'a>,
    simulations: u64,
    physics_steps: u64,
}

impl Tree<'_> {
    /// Goes on with `action` and exactly `switches` later changes of it.
    fn explore(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let depth = self.prefix.len();
        let next = match self.forks {
            true => self.walk(bench, action, switches),
            false => self.walk_anew(bench, action, switches),
        };
        self.prefix.truncate(depth);
        next
    }

    fn walk(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        if switches == 0 {
            self.simulations += 1;
        }
        while !bench.is_done() {
            if self.watch.stopped() {
                return Next::Stop;
            }
            let before = bench.physics_steps();
            bench.decide(action);
            self.physics_steps += bench.physics_steps() - before;
            self.prefix.push(action);
            if switches == 0 || bench.is_done() {
                continue;
            }
            for other in (0..self.actions).filter(|&other| other != action) {
                if self.branch(bench, other, switches - 1) == Next::Stop {
                    return Next::Stop;
                }
            }
        }
        if switches == 0 {
            self.note(bench);
        }
        self.leaf(bench, switches)
    }

    /// Whether a sequence without further switches makes the ego fail.
    fn leaf(&mut self, bench: &Testbench, switches: usize) -> Next {
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        match switches == 0 && success {
            true => (self.accept)(&self.prefix),
            false => Next::Continue,
        }
    }

    /// An episode is over.
    fn note(&mut self, bench: &Testbench) {
        self.watch.faults.note(self.index as u64, bench.fault());
        if self.fault.is_none() {
            self.fault = bench.fault().cloned();
        }
    }

    /// The same where the ego cannot be copied: first to the end with `action`,
    /// which tells where it can be changed, then each change from the start.
    fn walk_anew(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let depth = self.prefix.len();
        while !bench.is_done() {
            if self.watch.stopped() {
                return Next::Stop;
            }
            bench.decide(action);
            self.prefix.push(action);
        }
        self.simulations += 1;
        self.physics_steps += bench.physics_steps();
        self.note(bench);
        if switches == 0 {
            return self.leaf(bench, switches);
        }
        let whole = self.prefix.clone();
        for at in depth + 1..whole.len() {
            for other in (0..self.actions).filter(|&other| other != action) {
                bench.begin(self.start, self.noise, Aftermath::Skip);
                for &again in &whole[..at] {
                    bench.decide(again);
                }
                self.prefix.truncate(at);
                if self.explore(bench, other, switches - 1) == Next::Stop {
                    return Next::Stop;
                }
                self.prefix.extend_from_slice(&whole[at..]);
            }
        }
        Next::Continue
    }

    /// Goes on from here with another action and leaves `bench` as it is.
    fn branch(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let Some(mut branch) = bench.branch() else {
            // Invariant: an ego that was copied once can be copied again.
            return Next::Stop;
        };
        let next = self.explore(&mut branch, action, switches);
        bench.rejoin(branch);
        next
    }
}

/// Plays sequences on the plant asked for, each from where it leaves the last.
///
/// The tree hands over sequences that share long prefixes, and rigid bodies
/// cost twenty times what points cost.
struct Confirmer<'a> {
    scenario: &'a Scenario,
    start: &'a Start,
    noise: u64,
    index: usize,
    watch: &'a Watch<'a>,
    /// The first fault met.
    fault: Option<Fault>,
    /// The latest sequence as far as it was played.
    actions: Vec<usize>,
    /// The benches after 0, 1, 2 … of these actions.
    benches: Vec<Testbench>,
    physics_steps: u64,
}

impl Confirmer<'_> {
    fn new<'a>(
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
    fn confirm(&mut self, actions: &[usize]) -> Confirmed {
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
            if shown.closing_speed_mps.is_none() {
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
struct Confirmed {
    success: bool,
    closing_speed_mps: Option<f64>,
    foul_before_contact: bool,
}

impl Confirmed {
    fn on(bench: &Testbench) -> Confirmed {
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        let touch = bench.contact().filter(|_| success);
        let rules = bench.rules_until_contact();
        Confirmed {
            success,
            closing_speed_mps: touch.map(|touch| touch.closing_speed_mps),
            foul_before_contact: rules.is_some_and(|rules| !rules.is_kept()),
        }
    }
}
