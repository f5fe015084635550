//! Cell of a failure, found by replays without the single actions of its ados.

use crate::experiment::FailureKind;
use crate::rulebook::Verdict;
use crate::run_dir::{CellFailure, FailureCell, NecessaryAction};
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::Scenario;

/// Action set of one ado as a digit of the joint action.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdoDigit {
    name: String,
    /// Joint actions that are skipped when this ado's action increases by one.
    unit: usize,
    actions: usize,
    neutral: usize,
}

impl AdoDigit {
    /// Returns the digits of a world, one per ado.
    pub fn all(scenario: &Scenario) -> Vec<AdoDigit> {
        let Some(driving) = scenario.drive() else {
            // A grid has one ado and no action sets.
            let spaces = scenario.spaces();
            return vec![AdoDigit {
                name: "ado".to_owned(),
                unit: 1,
                actions: spaces.actions,
                neutral: spaces.neutral,
            }];
        };
        let (mut digits, mut unit) = (Vec::new(), 1);
        for (name, actions, neutral) in driving.spec().action_sets() {
            // Joint actions are numbers in a mixed radix, in which the first ado is the
            // least digit.
            digits.push(AdoDigit {
                name: name.to_owned(),
                unit,
                actions: actions.len(),
                neutral,
            });
            unit *= actions.len();
        }
        digits
    }

    /// Returns the joint actions in which this ado alone acts otherwise.
    pub fn others(&self, joint: usize) -> impl Iterator<Item = usize> + use<> {
        let (unit, mine) = (self.unit, self.of(joint));
        let other = (0..self.actions).filter(move |action| *action != mine);
        other.map(move |action| joint - mine * unit + action * unit)
    }

    fn of(&self, joint: usize) -> usize {
        joint / self.unit % self.actions
    }

    /// Returns joint actions in which one action of this ado becomes neutral.
    fn without(&self, action: usize, joint: &[usize]) -> Vec<usize> {
        let neutral = |&one: &usize| {
            let mine = self.of(one);
            let replaced = if mine == action { self.neutral } else { mine };
            one - mine * self.unit + replaced * self.unit
        };
        joint.iter().map(neutral).collect()
    }
}

/// Finder of the cells of failures in one world, with the cost of its replays.
pub struct CellFinder {
    bench: Testbench,
    digits: Vec<AdoDigit>,
    ego: String,
    /// Replays so far.
    pub simulations: u64,
    /// Physics steps of these replays.
    pub physics_steps: u64,
}

impl CellFinder {
    /// Creates the finder for episodes of a world.
    pub fn new(scenario: &Scenario) -> CellFinder {
        CellFinder {
            bench: scenario.bench(),
            digits: AdoDigit::all(scenario),
            ego: ego_name(scenario),
            simulations: 0,
            physics_steps: 0,
        }
    }

    /// Returns the cell of a success of the ados in `scenario`.
    ///
    /// An action is necessary if the ego holds when its ado takes the neutral action
    /// wherever it took this action. Of several, the one that is taken first counts.
    pub fn cell(&mut self, scenario: &Scenario, episode: &Episode) -> FailureCell {
        let per_decision = self.bench.clock().samples_per_decision().max(1);
        // Actions after the verdict cannot have caused the failure.
        let judged = episode.judged.saturating_sub(1).div_ceil(per_decision);
        let actions = &episode.actions[..judged.min(episode.actions.len())];
        let (bench, spent) = (
            &mut self.bench,
            (&mut self.simulations, &mut self.physics_steps),
        );
        let holds = |changed: &[usize]| {
            let mut replay = Replay::holding(changed);
            let (start, noise) = (&episode.start, episode.noise);
            let played = play(bench, start, noise, &mut replay, Aftermath::Skip);
            *spent.0 += 1;
            *spent.1 += played.physics_steps;
            // A broken rule leaves the question open, so only a satisfied specification
            // counts.
            matches!(played.verdict, Verdict::Held { .. })
        };
        FailureCell {
            failure: kind(scenario, episode, &self.ego),
            necessary: necessary(&self.digits, actions, holds),
        }
    }
}

/// Returns the ego's name in contacts.
fn ego_name(scenario: &Scenario) -> String {
    let spec = scenario.drive().map(|driving| driving.spec());
    let name = spec.and_then(|spec| Some(spec.agents[spec.egos().next()?].name.clone()));
    name.unwrap_or_else(|| "ego".to_owned())
}

/// Returns the kind of a failure. A contact counts only if all rules hold until it.
fn kind(scenario: &Scenario, episode: &Episode, ego: &str) -> CellFailure {
    let lawful = episode
        .contact
        .as_ref()
        .filter(|_| !episode.is_foul_before_contact());
    let closing_mps = lawful.map(|touch| touch.closing_speed_mps);
    FailureKind::of(scenario, episode).in_cell(ego, closing_mps)
}

/// Returns the first action without which the ego holds.
fn necessary(
    digits: &[AdoDigit],
    actions: &[usize],
    mut holds: impl FnMut(&[usize]) -> bool,
) -> Option<NecessaryAction> {
    let mut tried: Vec<(usize, usize)> = Vec::new();
    for &joint in actions {
        for (number, digit) in digits.iter().enumerate() {
            let action = digit.of(joint);
            // An action is replaced wherever it occurs, so a single trial is enough.
            if action == digit.neutral || tried.contains(&(number, action)) {
                continue;
            }
            tried.push((number, action));
            if holds(&digit.without(action, actions)) {
                return Some(NecessaryAction {
                    ado: digit.name.clone(),
                    action,
                });
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::severity::CrashKind;

    fn digits() -> Vec<AdoDigit> {
        let digit = |name: &str, unit, actions, neutral| AdoDigit {
            name: name.to_owned(),
            unit,
            actions,
            neutral,
        };
        vec![digit("a", 1, 3, 1), digit("b", 3, 4, 0)]
    }

    fn joint(a: usize, b: usize) -> usize {
        a + 3 * b
    }

    #[test]
    fn the_necessary_action_is_one_ados_and_the_others_keep_theirs() {
        let actions = [joint(0, 2), joint(1, 3), joint(2, 2), joint(1, 0)];
        // Ego holds if ado b never takes action 3 while a still takes 0 and 2.
        let mut seen = Vec::new();
        let found = necessary(&digits(), &actions, |changed| {
            seen.push(changed.to_vec());
            changed == [joint(0, 2), joint(1, 0), joint(2, 2), joint(1, 0)]
        });
        let expected = NecessaryAction {
            ado: "b".to_owned(),
            action: 3,
        };
        assert_eq!(found, Some(expected));
        assert_eq!(seen.len(), 3, "a 0, b 2, b 3: {seen:?}");
        // Each ado acts otherwise alone, in every other way.
        let others: Vec<Vec<usize>> = digits()
            .iter()
            .map(|it| it.others(joint(0, 2)).collect())
            .collect();
        assert_eq!(others[0], [joint(1, 2), joint(2, 2)]);
        assert_eq!(others[1], [joint(0, 0), joint(0, 1), joint(0, 3)]);
        // Neutral actions are never tried: a 0, b 2, b 3 and a 2 are all.
        let mut count = 0;
        let none = necessary(&digits(), &actions, |_| {
            count += 1;
            false
        });
        assert_eq!((none, count), (None, 4));
    }

    #[test]
    fn a_cell_names_its_necessary_action_by_what_it_does() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let cell = |action| FailureCell {
            failure: CellFailure::contact("ado", CrashKind::RearEnd, 4.5),
            necessary: Some(NecessaryAction {
                ado: "ado".to_owned(),
                action,
            }),
        };
        let label = world.action_label(0);
        assert_eq!(
            cell(0).in_words(&world),
            format!("rear-end with ado at 4–6 m/s, ado: {label}")
        );
        // A cell of another world has no label here.
        assert!(cell(99).in_words(&world).ends_with("ado: action 99"));
    }

    #[test]
    fn every_part_of_a_cell_distinguishes_it_and_survives_json() {
        let cell = |partner: &str, kind, closing_mps, action| FailureCell {
            failure: CellFailure::contact(partner, kind, closing_mps),
            necessary: Some(NecessaryAction {
                ado: "a".to_owned(),
                action,
            }),
        };
        let one = cell("truck", CrashKind::RearEnd, 3.9, 1);
        assert_eq!(one, cell("truck", CrashKind::RearEnd, 2.0, 1));
        let others = [
            cell("car", CrashKind::RearEnd, 3.9, 1),
            cell("truck", CrashKind::SideSwipe, 3.9, 1),
            cell("truck", CrashKind::RearEnd, 4.0, 1),
            cell("truck", CrashKind::RearEnd, 3.9, 2),
            FailureCell {
                failure: CellFailure::Violation {
                    leaf: "gap > 0".to_owned(),
                },
                necessary: None,
            },
        ];
        for other in &others {
            assert_ne!(&one, other);
            let text = serde_json::to_string(other).expect("json");
            assert_eq!(
                &serde_json::from_str::<FailureCell>(&text).expect("a cell"),
                other
            );
        }
        assert_eq!(
            serde_json::to_string(&one).expect("json"),
            r#"{"failure":{"contact":{"partner":"truck","kind":"RearEnd","closing_bin":1}},"decisive":{"ado":"a","action":1}}"#
        );
        let odd = [f64::NAN, -3.0, f64::INFINITY].map(|mps| cell("x", CrashKind::RearEnd, mps, 1));
        assert_eq!(odd[0], odd[1]);
        assert_ne!(odd[0], odd[2]);
    }
}
