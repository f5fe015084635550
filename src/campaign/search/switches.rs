//! All sequences with at most so many switches of action, fewest first.

use super::confirm::Confirmer;
use super::request::{Found, SearchRequest};
use super::tree::{Next, Tree};
use crate::campaign::Watch;
use crate::scenario::Scenario;
use crate::scene::Start;
use crate::testbench::{Aftermath, Testbench};

/// Pre-screened sequences that are tried on the plant asked for, per start.
pub(super) const MAX_CONFIRMATIONS: u64 = 300;

/// Searches one start; `None` when stopped from outside before a result.
///
/// `cheap` is the world on the plant that sorts out sequences first; without
/// one, what succeeds on the plant asked for is played once more, to contact.
pub(super) fn solve(
    request: &SearchRequest<'_>,
    cheap: Option<&Scenario>,
    ((start, noise), index): ((&Start, u64), usize),
    most: usize,
    watch: &Watch<'_>,
) -> Option<Found> {
    let scenario = cheap.unwrap_or(request.scenario);
    let mut confirmer = Confirmer::new(request.scenario, (start, noise), index, watch);
    let mut found = Found::default();
    let mut accept = |actions: &[usize], _: &Testbench| {
        let played = confirmer.confirm(actions);
        if cheap.is_some() {
            found.simulations += 1;
            found.unconfirmed += u64::from(!played.success);
        }
        if played.success {
            let contact = played.contact.as_ref();
            found.closing_speed_mps = contact.map(|touch| touch.closing_speed_mps);
            found.impact = contact.and_then(|touch| touch.impact);
            found.foul_before_contact = played.foul_before_contact;
            found.actions = Some(actions.to_vec());
        }
        match played.success || MAX_CONFIRMATIONS <= found.simulations {
            true => Next::Stop,
            false => Next::Continue,
        }
    };
    let mut root = scenario.bench();
    let from = ((start, noise), index);
    let mut tree = Tree::new(&mut root, from, Aftermath::Skip, &mut accept, watch);
    let mut next = Next::Continue;
    for switches in 0..=most {
        for action in 0..scenario.world().spaces().actions {
            if next == Next::Continue {
                next = tree.begin(&mut root, action, switches);
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
