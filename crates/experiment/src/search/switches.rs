//! All sequences with at most a given number of action switches, fewest first.

use super::confirm::Confirmer;
use super::found::SearchResult;
use super::method::{
    MethodInfo, MethodOption, MethodSettings, SWITCHES, SearchError, SearchMethod, StartSearch,
};
use super::tree::{Tree, WalkControl};
use crate::run_dir::Unconfirmed;
use crate::testbench::{NoisyStart, Testbench};

/// Pre-screened sequences per start that are tried on the requested plant.
const MAX_CONFIRMATIONS: u64 = 300;

/// Method that tries all sequences with at most this many action switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches(pub usize);

impl SearchMethod<'_> for Switches {
    const INFO: MethodInfo = MethodInfo {
        name: "switches",
        help: "All sequences with at most M switches of action, fewest first",
        takes: &[MethodOption::Switches],
        budget: 0,
        prescreens: true,
    };

    fn with(settings: &MethodSettings<'_>) -> Result<Switches, SearchError> {
        Ok(Switches(settings.switches.unwrap_or(SWITCHES)))
    }

    fn text(&self, _budget: u64, unconfirmed: Option<Unconfirmed>) -> String {
        let mut text = format!("switches ≤ {}", self.0);
        if let Some(Unconfirmed { sequences, starts }) = unconfirmed {
            text.push_str(&format!(
                ", pre-screened on the kinematic plant, {sequences} unconfirmed"
            ));
            if starts > 0 {
                text.push_str(&format!(" (nothing else on {starts} starts)"));
            }
        }
        text
    }

    fn solve(&self, one: StartSearch<'_>) -> Option<SearchResult> {
        solve(&one, self.0)
    }
}

/// Walks the tree and confirms every success.
///
/// Without pre-screening, a success on the requested plant is played once more, to
/// contact.
fn solve(one: &StartSearch<'_>, most: usize) -> Option<SearchResult> {
    let &StartSearch {
        scenario: original,
        cheap,
        start,
        noise,
        index,
        watch,
        ..
    } = one;
    let scenario = cheap.unwrap_or(original);
    let from = NoisyStart { start, noise };
    let mut confirmer = Confirmer::new(original, from, index, watch);
    let mut found = SearchResult::default();
    let mut accept = |actions: &[usize], _: &Testbench| {
        // The walk ends at the verdict, and the row describes the contact after it.
        let played = confirmer.confirm(actions);
        // Without pre-screening the first run repeats an episode that is already counted.
        let runs = match cheap {
            Some(_) => played.runs,
            None => played.runs.saturating_sub(1),
        };
        found.simulations += runs;
        found.violations += played.violations.min(runs);
        if cheap.is_some() {
            found.unconfirmed += u64::from(!played.success);
        }
        if played.success {
            let contact = played.contact.as_ref();
            found.closing_speed_mps = contact.map(|touch| touch.closing_speed_mps);
            found.impact = contact.and_then(|touch| touch.impact);
            found.violation_before_contact = played.violation_before_contact;
            found.failure = confirmer.failure();
            found.actions = Some(actions.to_vec());
        }
        if played.success || found.unconfirmed >= MAX_CONFIRMATIONS {
            WalkControl::Stop
        } else {
            WalkControl::Continue
        }
    };
    let mut root = scenario.bench();
    // No sequence has more switches than decisions, whatever was asked for.
    let most = most.min(root.clock().decisions());
    let mut tree = Tree::new(&mut root, from, index, &mut accept, watch);
    let mut next = WalkControl::Continue;
    for switches in 0..=most {
        // Fewest switches first, so the simplest success is found.
        for action in 0..scenario.world().spaces().actions {
            // Two nested loops are left by skipping what remains of them.
            if next == WalkControl::Continue {
                next = tree.begin(&mut root, action, switches);
            }
        }
    }
    let (simulations, physics_steps) = (tree.simulations, tree.physics_steps);
    let (violations, fault) = (tree.violations, tree.fault);
    found.violations += violations;
    found.fault = fault.or(confirmer.fault);
    // A stopped search without a result says nothing about the start.
    if found.actions.is_none() && found.fault.is_none() && watch.stopped() {
        return None;
    }
    found.simulations += simulations;
    found.physics_steps = physics_steps + confirmer.physics_steps;
    Some(found)
}
