//! Minimization of counterexamples.
//!
//! A smaller counterexample has fewer switches of action. With equal switches it has a
//! smaller sum of distances from the neutral action, then a later first deviation
//! ([`Effort`]). Neither the switches nor the sum may grow. A short sequence of actions
//! can be read, and a hundred decisions cannot.
//!
//! Only actions up to the failure are changed and counted. After the failure the ado
//! repeats its recorded actions after the recorded failure, and then its neutral action.
//! The crash stays the same: two agents, sides, closing speed and preventability.
//!
//! Each of the three steps plays sequences of actions from the recorded start with its
//! noise. In a rigid world the kinematic plant plays them first:
//!
//! 1. All sequences without a switch, then with a single switch. The best that
//!    holds is the result, because nothing smaller exists with so few switches.
//! 2. Otherwise all sequences with two switches, within the budget.
//! 3. From the best so far, or from the record: replace stretches by a
//!    neighbouring action or by the neutral action, exchange stretches, move borders
//!    and weaken actions, until nothing helps (delta debugging: Zeller and Hildebrandt,
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
use crate::preventability::{Label, NotApplicable};
use crate::run_dir::{Effort, Shrunk};
use crate::scene::ContactEvent;
use crate::search::{Tree, WalkControl};
use crate::testbench::{Aftermath, Episode, FaultLog, NoisyStart, Testbench};
use crate::world::Scenario;

/// Share by which the closing speed of a minimized crash may differ, either way.
pub const CLOSING: f64 = 0.1;
/// The same on the pre-screening plant of a rigid world.
const SCREENED_CLOSING: f64 = 0.5;
/// Physics steps of the pre-screening plant that one tree may cost.
// A fixed budget of steps, not of time, keeps the result deterministic.
const TREE_STEPS: u64 = 1_000_000;
/// Most episodes for replacing, moving and weakening.
const MOVES: usize = 1500;
/// Most sequences of a tree that are tried on the pre-screening plant.
const SCREENED: usize = 1000;
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

/// Returns the actions of an episode up to its failure.
pub fn up_to_failure<'e>(scenario: &Scenario, episode: &'e Episode) -> &'e [usize] {
    let per_decision = scenario.world().clock().samples_per_decision().max(1);
    // The first sample is that of the start, before any decision.
    let decisions = episode.judged.saturating_sub(1).div_ceil(per_decision);
    &episode.actions[..decisions.min(episode.actions.len())]
}

/// Returns the smallest counterexample found from the same start, and its savings.
///
/// Without a smaller one it returns the episode itself. A contact stays a contact of the
/// same sides of the same two agents, within [`CLOSING`] of the closing speed, with the
/// same preventability, and without a new rule violation before it. An ego that is not
/// deterministic runs as often as the world's `repeats`. Without `repeats` its episodes
/// are unchanged. A program runs at most 300 times.
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
    let recorded = up_to_failure(scenario, episode);
    let before = effort(scenario, recorded);
    let unchanged = Shrunk {
        before,
        after: before,
    };
    // Only a counted failure has an aim that a smaller sequence could keep.
    if reruns.is_refused() || !episode.verdict.is_success() {
        return (episode.clone(), unchanged);
    }
    // A fault in a trial sequence is no fault of the evaluated ego.
    let watch = Watch {
        faults: FaultLog::default(),
        ..watch.quiet()
    };
    let (cheap, closing) = match scenario.screening() {
        Some(screening) => (screening, SCREENED_CLOSING),
        None => (scenario.clone(), CLOSING),
    };
    let mut shrinking = Shrinking {
        scenario,
        reruns,
        for_later,
        refuted: BTreeSet::new(),
        bench: cheap.bench(),
        closing,
        aim: Aim::of(scenario, episode),
        from: episode.noisy_start(),
        aftermath: &episode.actions[recorded.len()..],
        watch: &watch,
        moves: MOVES,
        most: before,
        best: None,
    };
    shrinking.search(recorded);
    match shrinking.best {
        Some(best) => {
            let after = best.effort;
            (best.episode, Shrunk { before, after })
        }
        None => (episode.clone(), unchanged),
    }
}

/// Conditions that a smaller counterexample must satisfy.
struct Aim {
    /// Contact of the original, if any.
    contact: Option<ContactEvent>,
    /// True if the original has a rule violation before its contact.
    violation_before_contact: bool,
    /// Preventability of the contact.
    preventability: Option<ShortLabel>,
}

/// Parts of the preventability that minimization keeps.
#[derive(PartialEq)]
struct ShortLabel {
    label: Label,
    not_applicable: Option<NotApplicable>,
    /// Whether a human model of UN R157 avoids it, which gates ask.
    by_human_model: Option<bool>,
    is_exonerated: bool,
}

impl ShortLabel {
    /// Returns the preventability of an episode, `None` without a contact.
    fn of(scenario: &Scenario, episode: &Episode) -> Option<ShortLabel> {
        episode.contact.as_ref()?;
        let known = scenario.preventability(episode);
        Some(ShortLabel {
            label: known.label,
            not_applicable: known.not_applicable,
            by_human_model: known.human_model_avoids(),
            is_exonerated: known.exonerated.is_some(),
        })
    }
}

impl Aim {
    fn of(scenario: &Scenario, episode: &Episode) -> Aim {
        Aim {
            contact: episode.contact.clone(),
            violation_before_contact: episode.is_foul_before_contact(),
            preventability: ShortLabel::of(scenario, episode),
        }
    }

    /// Returns whether an episode is the same crash, up to its preventability.
    fn is_reached(&self, episode: &Episode, closing: f64) -> bool {
        let violates = episode.is_foul_before_contact() && !self.violation_before_contact;
        // A violation without contact must not become a crash, which would be another
        // finding.
        let is_same = match (&self.contact, &episode.contact) {
            (None, None) => true,
            (Some(found), Some(touch)) => is_same_contact(found, touch, closing),
            _ => false,
        };
        episode.verdict.is_success() && !violates && is_same
    }
}

/// Returns whether a contact has the same parties, kind, sides and closing speed.
///
/// The speed may differ by a share `closing`.
fn is_same_contact(found: &ContactEvent, touch: &ContactEvent, closing: f64) -> bool {
    let sides = |contact: &ContactEvent| {
        let impact = contact.impact;
        impact.map(|impact| (impact.kind, impact.ego_side, impact.other_side))
    };
    let differs_mps = (touch.closing_speed_mps - found.closing_speed_mps).abs();
    touch.between == found.between
        && sides(touch) == sides(found)
        && differs_mps <= closing * found.closing_speed_mps.abs()
}

/// Smallest counterexample so far.
struct Smallest {
    /// Actions up to the failure.
    actions: Vec<usize>,
    effort: Effort,
    episode: Episode,
}

struct Shrinking<'a> {
    scenario: &'a Scenario,
    /// Ego under test. Without copies it plays each sequence as a whole episode.
    reruns: &'a Reruns<'a>,
    /// Questions for which runs are reserved.
    for_later: usize,
    /// Sequences that failed, for an ego without copies.
    refuted: BTreeSet<Vec<usize>>,
    /// Bench on the plant that pre-screens, with its tolerance of the closing speed.
    bench: Testbench,
    closing: f64,
    aim: Aim,
    from: NoisyStart<'a>,
    /// Recorded actions after the recorded failure.
    aftermath: &'a [usize],
    watch: &'a Watch<'a>,
    /// Episodes left to the third step.
    moves: usize,
    /// Effort of the original.
    most: Effort,
    best: Option<Smallest>,
}

impl Shrinking<'_> {
    /// Searches for the smallest sequence, beginning with the recorded one.
    fn search(&mut self, recorded: &[usize]) {
        let most = self.most.switches;
        if self.reruns.copies() {
            // With at most one switch the walk is complete, so its best is the smallest.
            for switches in 0..=most.min(1) {
                if self.finds_with(switches) {
                    return;
                }
            }
            if most >= 2 {
                self.finds_with(2);
            }
        }
        let from = self.best.as_ref().map(|best| best.actions.clone());
        self.moved(from.unwrap_or_else(|| recorded.to_vec()));
    }

    /// Finds the smallest sequence with exactly this many switches, within the budget.
    fn finds_with(&mut self, switches: usize) -> bool {
        let mut found: Vec<(Effort, Vec<usize>)> = Vec::new();
        let (scenario, most) = (self.scenario, self.most);
        let mut note = |actions: &[usize], _: &Testbench| {
            let effort = effort(scenario, actions);
            // A tree contains sequences of more effort than the record, which no plant
            // need confirm.
            if is_smaller(&effort, &most, &most) {
                found.push((effort, actions.to_vec()));
            }
            WalkControl::Continue
        };
        let root = &mut self.bench;
        let mut tree = Tree::new(root, self.from, 0, &mut note, self.watch);
        tree.budget = TREE_STEPS;
        // The neutral action comes first, because sequences that begin with it are
        // smaller, in case the budget ends early.
        let spaces = scenario.world().spaces();
        let others = (0..spaces.actions).filter(|action| *action != spaces.neutral);
        for action in std::iter::once(spaces.neutral).chain(others) {
            if tree.begin(root, action, switches) == WalkControl::Stop {
                break;
            }
        }
        self.reruns.count(tree.simulations);
        found.sort_by(|a, b| a.0.order(&b.0));
        let mut left = CONFIRMATIONS;
        // The sort comes first, so the limit drops the largest sequences.
        found.truncate(SCREENED);
        found.into_iter().any(|(_, actions)| {
            if left == 0 || !self.passes(&actions) {
                return false;
            }
            left -= 1;
            self.holds(&actions)
        })
    }

    /// Returns whether a sequence is smaller and satisfies the aim on the world's own plant.
    ///
    /// It is then the best so far.
    fn holds(&mut self, actions: &[usize]) -> bool {
        if self.refuted.contains(actions) {
            return false;
        }
        if self.reruns.copies() {
            self.reruns.count(1);
        } else if self.reruns.ask(1, self.for_later).is_err() {
            // The runs are used up, so the third step ends, too.
            self.moves = 0;
            return false;
        }
        let (from, aftermath) = (self.from, self.aftermath);
        let mut run = |bench: &mut Testbench| story(bench, from, actions, aftermath);
        let episode = self.reruns.repeated(self.scenario, &mut run);
        let played = up_to_failure(self.scenario, &episode).to_vec();
        let effort = effort(self.scenario, &played);
        // The plant may end the episode elsewhere than the screening did, so the effort
        // is that of the played part.
        let now = self.best.as_ref().map_or(self.most, |best| best.effort);
        let holds = is_smaller(&effort, &now, &self.most)
            && self.aim.is_reached(&episode, CLOSING)
            // The label needs replays of its own and is therefore the last of the
            // conditions.
            && self.aim.preventability == ShortLabel::of(self.scenario, &episode);
        if holds {
            self.best = Some(Smallest {
                // The failure may come earlier than in the tried sequence, and later
                // actions do not count.
                actions: played,
                effort,
                episode,
            });
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
        let episode = story(&mut self.bench, self.from, actions, self.aftermath);
        self.aim.is_reached(&episode, self.closing)
    }

    /// Makes a sequence smaller step by step, until no step helps.
    fn moved(&mut self, mut actions: Vec<usize>) {
        // A screening that keeps passing false candidates ends here, and not after all
        // moves.
        let mut refused = CONFIRMATIONS;
        while self.moves > 0 && refused > 0 && !self.watch.stopped() {
            let smaller = self.smaller_than(&actions);
            let found = smaller.iter().any(|candidate| {
                let stops = self.moves == 0 || refused == 0;
                if stops || !self.passes(candidate) {
                    return false;
                }
                let holds = self.holds(candidate);
                // Runs of an ego without copies have a limit of their own.
                refused -= usize::from(!holds && self.reruns.copies());
                holds
            });
            match &self.best {
                Some(best) if found => actions.clone_from(&best.actions),
                _ => break,
            }
        }
    }

    /// Returns the smaller sequences at a distance of a single move, smallest first.
    fn smaller_than(&self, actions: &[usize]) -> Vec<Vec<usize>> {
        let now = effort(self.scenario, actions);
        let spaces = self.scenario.world().spaces();
        let candidates = neighbours(actions, spaces.neutral, spaces.actions)
            .into_iter()
            .map(|it| (effort(self.scenario, &it), it));
        let mut smaller: Vec<_> = candidates
            .filter(|(effort, _)| is_smaller(effort, &now, &self.most))
            .collect();
        // Equal efforts are ordered by their actions, so that equal sequences are
        // neighbours below.
        smaller.sort_by(|a, b| a.0.order(&b.0).then_with(|| a.1.cmp(&b.1)));
        // Different moves may lead to the same sequence.
        smaller.dedup_by(|a, b| a.1 == b.1);
        smaller.into_iter().map(|(_, actions)| actions).collect()
    }
}

/// Plays a sequence up to the failure, then an aftermath, then the neutral action.
///
/// Up to the failure, the last action of the sequence is held.
fn story(
    bench: &mut Testbench,
    from: NoisyStart<'_>,
    actions: &[usize],
    aftermath: &[usize],
) -> Episode {
    let neutral = bench.spaces().neutral;
    let last = actions.last().copied().unwrap_or(neutral);
    let (mut before, mut after) = (actions.iter(), aftermath.iter());
    let mut played = Vec::new();
    // The contact may follow the violation, and the aim compares contacts.
    bench.begin(from.start, from.noise, Aftermath::Play);
    while !bench.is_done() {
        let action = if bench.is_decided() {
            after.next().copied().unwrap_or(neutral)
        } else {
            before.next().copied().unwrap_or(last)
        };
        played.push(action);
        bench.decide(action);
    }
    bench.episode(from.start, from.noise, played)
}

/// Returns whether an effort is less than `now`, with no larger sum than the original.
fn is_smaller(effort: &Effort, now: &Effort, original: &Effort) -> bool {
    // Sums of equal distances in another order may differ in the last bits.
    effort.is_less_than(now) && effort.deviation <= original.deviation + 1e-9
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
    // Two stretches change places, so that each may join its like: a flicker becomes a pulse.
    for first in 0..stretches.saturating_sub(1) {
        let (from, middle, to) = (borders[first], borders[first + 1], borders[first + 2]);
        let mut other = actions.to_vec();
        other[from..to].rotate_left(middle - from);
        all.push(other);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crashes::Regressions;
    use crate::rulebook::RulesUntilContact;
    use crate::scene::{CrashKind, Side};

    /// A kept crash with a contact.
    fn crash() -> Episode {
        let root = env!("CARGO_MANIFEST_DIR");
        let file = format!("{root}/../../tests/regressions/acc_iso-nominal-0005.ron");
        let kept = Regressions::load(file).expect("a kept counterexample");
        let replayed = kept.replay_recorded().expect("replayed").remove(0);
        assert!(replayed.episode.verdict.is_success());
        replayed.episode
    }

    fn aim(episode: &Episode) -> Aim {
        Aim {
            contact: episode.contact.clone(),
            violation_before_contact: episode.is_foul_before_contact(),
            preventability: None,
        }
    }

    fn with_contact(change: impl FnOnce(&mut ContactEvent)) -> Episode {
        let mut episode = crash();
        change(episode.contact.as_mut().expect("a contact"));
        episode
    }

    #[test]
    fn another_contact_is_another_crash() {
        let found = crash();
        let reaches = |episode: &Episode| aim(&found).is_reached(episode, CLOSING);
        assert!(reaches(&found));
        for (factor, same) in [(0.89, false), (0.91, true), (1.09, true), (1.11, false)] {
            let other = with_contact(|touch| touch.closing_speed_mps *= factor);
            assert_eq!(reaches(&other), same, "{factor}");
        }
        let changes: [fn(&mut ContactEvent); 5] = [
            |touch| touch.between.1 = "third".to_owned(),
            |touch| touch.impact = None,
            |touch| touch.impact.as_mut().expect("one").kind = CrashKind::SideSwipe,
            |touch| touch.impact.as_mut().expect("one").ego_side = Side::Left,
            |touch| touch.impact.as_mut().expect("one").other_side = Side::Right,
        ];
        for (nth, change) in changes.into_iter().enumerate() {
            assert!(!reaches(&with_contact(change)), "change {nth}");
        }
        let mut without = found.clone();
        without.contact = None;
        assert!(!reaches(&without));
        // A contact is no smaller violation either.
        assert!(!aim(&without).is_reached(&found, CLOSING));
        assert!(aim(&without).is_reached(&without, CLOSING));
    }

    #[test]
    fn a_rule_that_is_broken_before_the_contact_is_new_only_once() {
        let found = crash();
        let mut foul = found.clone();
        foul.rules_until_contact = Some(RulesUntilContact::Broken {
            rule: "stays".to_owned(),
            ado: "ado".to_owned(),
            time_s: 1.0,
        });
        assert!(!aim(&found).is_reached(&foul, CLOSING));
        assert!(aim(&foul).is_reached(&foul, CLOSING));
        assert!(aim(&foul).is_reached(&found, CLOSING));
        let mut held = found.clone();
        held.verdict = crate::rulebook::Verdict::Held { margin: 1.0 };
        assert!(!aim(&found).is_reached(&held, CLOSING));
    }

    #[test]
    fn neither_switches_nor_the_sum_may_grow() {
        let of = |switches, deviation| Effort {
            switches,
            deviation,
            first: Some(0),
        };
        let original = of(3, 2.0);
        for (effort, smaller) in [
            (of(1, 34.0), false),
            (of(1, 2.0), true),
            (of(3, 1.9), true),
            (of(3, 2.0), false),
            (of(4, 0.1), false),
        ] {
            assert_eq!(
                is_smaller(&effort, &original, &original),
                smaller,
                "{effort}"
            );
        }
        assert!(!is_smaller(&of(2, 1.0), &of(1, 1.0), &original));
    }
}
