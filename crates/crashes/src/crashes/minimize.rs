//! Minimization of counterexamples.
//!
//! A smaller counterexample has fewer switches of action. With equal switches it has a
//! smaller sum of distances from the neutral action, then a later first deviation
//! ([`Effort`]). A short sequence of actions can be read, and a hundred decisions cannot.
//!
//! Each of the three steps plays sequences of actions from the recorded start with its
//! noise. In a rigid world the kinematic plant plays them first:
//!
//! 1. All sequences without a switch, then with a single switch. The best that
//!    holds is the result, because nothing smaller exists with so few switches.
//! 2. Otherwise all sequences with two switches, within the budget.
//! 3. From the best so far, or from the record: replace stretches by a
//!    neighbouring action or by the neutral action, move borders and weaken
//!    actions, until nothing helps (delta debugging: Zeller and Hildebrandt,
//!    "Simplifying and Isolating Failure-Inducing Input", 2002).
//!
//! Steps 1 and 2 walk the tree of [`crate::search::search`]. Sequences that pass on the
//! kinematic plant are confirmed on the world's own plant. The result is a pure function
//! of world and episode.
//!
//! An ego that cannot be copied, such as a program, needs a whole run per sequence. It
//! gets step 3 only, on the world's own plant, within its budget of runs.

use std::collections::BTreeSet;

use super::reruns::{KEEP_RUNS, Reruns};
use crate::experiment::Watch;
use crate::run_dir::{Effort, Shrunk};
use crate::scene::{ContactEvent, Dynamics, Start};
use crate::search::{Confirmed, Confirmer, Tree, WalkControl};
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Episode, FaultLog, Replay, Testbench, play};
use crate::world::Scenario;

/// Share of the closing speed that a minimized crash keeps.
///
/// The worst crashes then stay the worst.
pub const CLOSING: f64 = 0.8;
/// Physics steps of the pre-screening plant that one tree may cost.
// A fixed budget of steps, not of time, keeps the result deterministic.
const TREE_STEPS: u64 = 1_000_000;
/// Most episodes for replacing, moving and weakening.
const MOVES: usize = 1500;
/// Most sequences of a step that are tried on the world's own plant.
const CONFIRMATIONS: usize = 40;
/// Distances by which a border is moved, in decisions.
const SHIFTS: [usize; 5] = [16, 8, 4, 2, 1];

/// Returns the effort of an ado that plays these actions.
pub fn effort(scenario: &Scenario, actions: &[usize]) -> Effort {
    let world = scenario.world();
    let neutral = world.spaces().neutral;
    let distance = |action: &usize| world.action_distance(*action, neutral);
    Effort {
        switches: actions.windows(2).filter(|pair| pair[0] != pair[1]).count(),
        deviation: actions.iter().map(distance).sum(),
        first: actions.iter().position(|action| *action != neutral),
    }
}

/// Returns the smallest counterexample found from the same start, and its savings.
///
/// Without a smaller one it returns the episode itself. A contact stays a contact of the
/// same two agents, at no less than [`CLOSING`] of the closing speed, and without a new
/// rule violation before it. An ego that is not deterministic runs as often as the
/// world's `repeats`. Without `repeats` its episodes are unchanged. A program runs at
/// most 300 times.
pub fn shrink(scenario: &Scenario, episode: &Episode, watch: &Watch<'_>) -> (Episode, Shrunk) {
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, watch);
    shrink_within(&reruns, episode, 0)
}

/// Minimizes within the runs of `reruns`, and reserves `for_later` questions.
pub(super) fn shrink_within(
    reruns: &Reruns<'_>,
    episode: &Episode,
    for_later: usize,
) -> (Episode, Shrunk) {
    let (scenario, watch) = (reruns.scenario(), reruns.watch());
    let before = effort(scenario, &episode.actions);
    let unchanged = Shrunk {
        before,
        after: before,
    };
    if reruns.is_refused() || !episode.verdict.is_success() {
        return (episode.clone(), unchanged);
    }
    // A fault in a trial sequence is no fault of the evaluated ego.
    let watch = Watch {
        faults: FaultLog::default(),
        ..watch.quiet()
    };
    let cheap = match scenario.plant() {
        Dynamics::Rigid => scenario.on(PlantKind::Kinematic),
        Dynamics::Kinematic | Dynamics::Cells => scenario.clone(),
    };
    let mut shrinking = Shrinking {
        scenario,
        reruns,
        for_later,
        found: None,
        refuted: BTreeSet::new(),
        bench: cheap.bench(),
        confirmer: Confirmer::new(scenario, (&episode.start, episode.noise), 0, &watch),
        aim: Aim::of(episode),
        start: &episode.start,
        noise: episode.noise,
        watch: &watch,
        moves: MOVES,
    };
    let actions = shrinking.smallest(&episode.actions);
    match shrinking.played(&actions) {
        Some((smaller, after)) if after.is_less_than(&before) => {
            (smaller, Shrunk { before, after })
        }
        _ => (episode.clone(), unchanged),
    }
}

/// Conditions that a smaller counterexample must satisfy.
struct Aim {
    /// Contact of the original, if any.
    contact: Option<ContactEvent>,
    /// True if the original has a rule violation before its contact.
    violation_before_contact: bool,
}

impl Aim {
    fn of(episode: &Episode) -> Aim {
        Aim {
            contact: episode.contact.clone(),
            violation_before_contact: episode.is_foul_before_contact(),
        }
    }

    fn is_reached(
        &self,
        success: bool,
        contact: Option<&ContactEvent>,
        violation_before_contact: bool,
    ) -> bool {
        let as_bad = |found: &ContactEvent| {
            contact.is_some_and(|touch| {
                let least_mps = CLOSING * found.closing_speed_mps;
                touch.between == found.between && least_mps <= touch.closing_speed_mps
            })
        };
        let violates = violation_before_contact && !self.violation_before_contact;
        success && !violates && self.contact.as_ref().is_none_or(as_bad)
    }

    fn is_reached_by_episode(&self, episode: &Episode) -> bool {
        let (success, violation) = (
            episode.verdict.is_success(),
            episode.is_foul_before_contact(),
        );
        self.is_reached(success, episode.contact.as_ref(), violation)
    }

    fn is_reached_by(&self, played: &Confirmed) -> bool {
        let contact = played.contact.as_ref();
        self.is_reached(played.success, contact, played.violation_before_contact)
    }
}

struct Shrinking<'a> {
    scenario: &'a Scenario,
    /// Ego under test. Without copies it plays each sequence as a whole episode.
    reruns: &'a Reruns<'a>,
    /// Questions for which runs are reserved.
    for_later: usize,
    /// Smallest episode so far, for an ego without copies.
    found: Option<Episode>,
    /// Sequences that failed, for an ego without copies.
    refuted: BTreeSet<Vec<usize>>,
    /// Bench on the plant that pre-screens.
    bench: Testbench,
    confirmer: Confirmer<'a>,
    aim: Aim,
    start: &'a Start,
    noise: u64,
    watch: &'a Watch<'a>,
    /// Episodes left to the third step.
    moves: usize,
}

impl Shrinking<'_> {
    /// Returns the smallest sequence found, or `recorded`.
    fn smallest(&mut self, recorded: &[usize]) -> Vec<usize> {
        let most = effort(self.scenario, recorded).switches;
        if self.reruns.copies() {
            // With at most one switch the walk is complete, so its best is the smallest.
            for switches in 0..=most.min(1) {
                if let Some(found) = self.best_with(switches) {
                    return found;
                }
            }
            if let Some(found) = (2 <= most).then(|| self.best_with(2)).flatten() {
                return self.moved(found);
            }
        }
        self.moved(recorded.to_vec())
    }

    /// Returns the smallest sequence with exactly this many switches, within the budget.
    fn best_with(&mut self, switches: usize) -> Option<Vec<usize>> {
        let mut found: Vec<(Effort, Vec<usize>)> = Vec::new();
        let (aim, scenario) = (&self.aim, self.scenario);
        let mut note = |actions: &[usize], bench: &Testbench| {
            if aim.is_reached_by(&Confirmed::on(bench)) {
                found.push((effort(scenario, actions), actions.to_vec()));
            }
            WalkControl::Continue
        };
        let from = ((self.start, self.noise), 0);
        let root = &mut self.bench;
        let mut tree = Tree::new(root, from, Aftermath::Play, &mut note, self.watch);
        tree.budget = TREE_STEPS;
        // The neutral action comes first, because sequences that begin with it are
        // smaller, in
        // case the budget ends early.
        let spaces = scenario.world().spaces();
        let others = (0..spaces.actions).filter(|action| *action != spaces.neutral);
        for action in std::iter::once(spaces.neutral).chain(others) {
            if tree.begin(root, action, switches) == WalkControl::Stop {
                break;
            }
        }
        self.reruns.count(tree.simulations);
        found.sort_by(|a, b| a.0.order(&b.0));
        let mut tried = found.into_iter().take(CONFIRMATIONS);
        let held = tried.find(|(_, actions)| self.holds(actions));
        held.map(|(_, actions)| actions)
    }

    /// Returns whether a sequence satisfies the aim on the world's own plant.
    fn holds(&mut self, actions: &[usize]) -> bool {
        if self.reruns.copies() {
            self.reruns.count(1);
            return self.aim.is_reached_by(&self.confirmer.confirm(actions));
        }
        if self.refuted.contains(actions) {
            return false;
        }
        if self.reruns.ask(1, self.for_later).is_err() {
            // The runs are used up, so the third step ends, too.
            self.moves = 0;
            return false;
        }
        let from = (self.start, self.noise);
        let mut actor = Replay::holding(actions);
        let played = self
            .reruns
            .played(self.scenario, from, &mut actor, Aftermath::Play);
        let holds = self.aim.is_reached_by_episode(&played);
        if holds {
            self.found = Some(played)
        } else {
            self.refuted.insert(actions.to_vec());
        }
        holds
    }

    /// Returns whether a sequence satisfies the aim on the pre-screening plant.
    ///
    /// An ego without copies passes at once, because every run costs the same.
    fn passes(&mut self, actions: &[usize]) -> bool {
        if !self.reruns.copies() {
            return true;
        }
        self.reruns.count(1);
        self.moves = self.moves.saturating_sub(1);
        self.bench.begin(self.start, self.noise, Aftermath::Play);
        // The last action is held if the episode lasts longer than the sequence.
        let last = actions.last().copied().unwrap_or(0);
        let mut rest = actions.iter().copied().chain(std::iter::repeat(last));
        while let Some(action) = rest.next().filter(|_| !self.bench.is_done()) {
            self.bench.decide(action);
        }
        self.aim.is_reached_by(&Confirmed::on(&self.bench))
    }

    /// Makes a sequence smaller step by step, until no step helps.
    fn moved(&mut self, mut actions: Vec<usize>) -> Vec<usize> {
        let mut refused = CONFIRMATIONS;
        while 0 < self.moves && 0 < refused && !self.watch.stopped() {
            let smaller = self.smaller_than(&actions);
            let next = smaller.into_iter().find(|candidate| {
                let stops = self.moves == 0 || refused == 0;
                if stops || !self.passes(candidate) {
                    return false;
                }
                let holds = self.holds(candidate);
                // Runs of an ego without copies have a limit of their own.
                refused -= usize::from(!holds && self.reruns.copies());
                holds
            });
            match next {
                Some(next) => actions = next,
                None => break,
            }
        }
        actions
    }

    /// Returns the smaller sequences at a distance of a single move, smallest first.
    fn smaller_than(&self, actions: &[usize]) -> Vec<Vec<usize>> {
        let now = effort(self.scenario, actions);
        let spaces = self.scenario.world().spaces();
        let candidates = neighbours(actions, spaces.neutral, spaces.actions);
        let candidates = candidates
            .into_iter()
            .map(|it| (effort(self.scenario, &it), it));
        let mut smaller: Vec<_> = candidates
            .filter(|(effort, _)| effort.is_less_than(&now))
            .collect();
        smaller.sort_by(|a, b| a.0.order(&b.0).then_with(|| a.1.cmp(&b.1)));
        // Different moves may lead to the same sequence.
        smaller.dedup_by(|a, b| a.1 == b.1);
        smaller.into_iter().map(|(_, actions)| actions).collect()
    }

    /// Returns the episode of a sequence if it satisfies the aim.
    fn played(&self, actions: &[usize]) -> Option<(Episode, Effort)> {
        let episode = match (self.reruns.copies(), &self.found) {
            (true, _) => {
                let mut bench = self.scenario.bench();
                let mut actor = Replay::holding(actions);
                let aftermath = Aftermath::Play;
                play(&mut bench, self.start, self.noise, &mut actor, aftermath)
            }
            // The episode is kept, because another run would cost and may differ.
            (false, Some(found)) => found.clone(),
            (false, None) => return None,
        };
        let reached = self.aim.is_reached_by_episode(&episode);
        let after = effort(self.scenario, &episode.actions);
        reached.then_some((episode, after))
    }
}

/// Returns the first index of each stretch of equal actions, and the end.
fn borders(actions: &[usize]) -> Vec<usize> {
    let inner = (1..actions.len()).filter(|&at| actions[at - 1] != actions[at]);
    let mut borders: Vec<usize> = std::iter::once(0).chain(inner).collect();
    borders.push(actions.len());
    borders
}

/// Returns every sequence at a distance of a single move.
fn neighbours(actions: &[usize], neutral: usize, count: usize) -> Vec<Vec<usize>> {
    let borders = borders(actions);
    let stretches = borders.len() - 1;
    let filled = |from: usize, to: usize, action: usize| {
        let mut other = actions.to_vec();
        other[from..to].fill(action);
        other
    };
    let mut all = Vec::new();
    // This many stretches at once take a neighbouring action or the neutral action.
    let lengths = std::iter::successors(Some(1), |length| Some(2 * length));
    for length in lengths.take_while(|length| *length <= stretches) {
        for first in 0..=stretches - length {
            let (from, to) = (borders[first], borders[first + length]);
            let before = from.checked_sub(1).map(|at| actions[at]);
            let after = actions.get(to).copied();
            let others = [before, after, Some(neutral)].into_iter().flatten();
            all.extend(others.map(|action| filled(from, to, action)));
        }
    }
    for stretch in 0..stretches {
        let (from, to) = (borders[stretch], borders[stretch + 1]);
        all.extend((0..count).map(|action| filled(from, to, action)));
        // The end of the stretch moves earlier or later, within the neighbouring
        // stretches.
        let Some(&next) = actions.get(to) else {
            continue;
        };
        for by in SHIFTS {
            all.push(filled(to.saturating_sub(by).max(from), to, next));
            let beyond = (to + by).min(borders[stretch + 2]);
            all.push(filled(to, beyond, actions[from]));
        }
    }
    all
}
