//! Rules over the positions of a grid world, and its best ado, as policies.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::game_graph::{Depth, GameGraph, NotSolvable};
use super::values::ValueTable;
use crate::rl::Policy;
use crate::rulebook::Rulebook;
use crate::scene::Scene;
use crate::scene::grid::{GridWorld, Position};

/// Error: two positions have equal observations and need different actions.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the ado's observation is the same at {0:?} and {1:?}, where different actions are due")]
pub struct Indistinct(pub Position, pub Position);

/// Reason that the best ado is no policy over the ado's observation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoOptimalPolicy {
    /// The world cannot be solved.
    #[error(transparent)]
    NotSolvable(#[from] NotSolvable),
    /// The observation does not determine the best action.
    #[error(transparent)]
    Indistinct(#[from] Indistinct),
}

/// A rule over positions, wrapped as a policy over the ado's observation.
///
/// An observation that was not tabulated gets the neutral action.
pub struct PositionPolicy {
    /// Marks the observed numbers that the rule depends on.
    read: Vec<bool>,
    neutral: usize,
    rows: HashMap<Vec<u32>, (usize, f32)>,
}

impl PositionPolicy {
    /// Tabulates `rule`: action and value V for every position of the world.
    ///
    /// The policy reads only observed numbers that follow from the positions.
    ///
    /// # Errors
    /// Two positions look the same and their actions differ.
    pub fn new(
        world: &GridWorld,
        mut rule: impl FnMut(Position) -> (usize, f64),
    ) -> Result<PositionPolicy, Indistinct> {
        let mut policy = PositionPolicy::reading(world.positional(), world);
        let mut seen: HashMap<Vec<u32>, Position> = HashMap::new();
        let mut scene = world.scene();
        let mut obs = vec![0.0; world.spaces().observation];
        for both in world.spec().arena.starts() {
            // Any step would do, because the key leaves out all numbers that depend on
            // time.
            scene.observe_at(both, 0, &mut obs);
            let key = policy.key(&obs);
            let (action, value) = rule(both);
            match policy.rows.entry(key) {
                Entry::Occupied(row) if row.get().0 != action => {
                    return Err(Indistinct(seen[row.key()], both));
                }
                Entry::Occupied(_) => {}
                Entry::Vacant(row) => {
                    seen.insert(row.key().clone(), both);
                    row.insert((action, value as f32));
                }
            }
        }
        Ok(policy)
    }

    /// Tabulates the best ado of a world along its episodes from every start.
    ///
    /// It obeys the rules and falsifies ψ_ego as soon as possible, where a lawful ado can.
    /// Its values are those of [`ValueTable::soonest`].
    ///
    /// # Errors
    /// The world cannot be solved, or two states that need different actions have the
    /// same observation.
    pub fn optimal(
        world: &GridWorld,
        rulebook: &Rulebook,
    ) -> Result<PositionPolicy, NoOptimalPolicy> {
        // The values read the kind of a verdict and the broken rule only, which `Sign`
        // keeps exact with far fewer states.
        let table = ValueTable::soonest(GameGraph::explore(world, rulebook, Depth::Sign)?);
        // The best action may depend on the time as well, so every number is read.
        let mut policy = PositionPolicy::reading(vec![true; world.spaces().observation], world);
        let mut seen: HashMap<Vec<u32>, Position> = HashMap::new();
        let mut scene = world.scene();
        let mut obs = vec![0.0; world.spaces().observation];
        let mut row = vec![0.0; world.schema().len()];
        // Only states on the ado's own ways are needed, since it never leaves them.
        for start in table.graph().starts() {
            // An ado's speed follows from its move, which takes both positions.
            let mut before = start;
            let mut conflict = None;
            table.walk(start, |step, now, best| {
                scene.sample_at([before, now], step, &mut row);
                scene.observe(&row, &mut obs);
                before = now;
                let key = policy.key(&obs);
                match policy.rows.entry(key) {
                    // Two states with one observation may share an action that is best in both.
                    Entry::Occupied(row) if best.is_best(row.get().0) => row.get().0,
                    Entry::Occupied(row) => {
                        // The walk cannot end early, so the first conflict is kept until
                        // it has.
                        conflict.get_or_insert(Indistinct(seen[row.key()], now));
                        row.get().0
                    }
                    Entry::Vacant(row) => {
                        seen.insert(row.key().clone(), now);
                        row.insert((best.action(), best.value() as f32)).0
                    }
                }
            });
            if let Some(conflict) = conflict {
                return Err(conflict.into());
            }
        }
        Ok(policy)
    }

    fn reading(read: Vec<bool>, world: &GridWorld) -> PositionPolicy {
        PositionPolicy {
            read,
            neutral: world.spaces().neutral,
            rows: HashMap::new(),
        }
    }

    fn key(&self, obs: &[f32]) -> Vec<u32> {
        let pairs = obs.iter().zip(&self.read);
        pairs
            .filter(|(_, read)| **read)
            // Bits and not values: floats are no hash keys, and equal positions
            // give equal bits.
            .map(|(value, _)| value.to_bits())
            .collect()
    }
}

impl Policy for PositionPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        let row = self.rows.get(&self.key(obs));
        row.map_or(self.neutral, |(action, _)| *action)
    }

    fn value(&self, obs: &[f32]) -> f32 {
        let row = self.rows.get(&self.key(obs));
        row.map_or(0.0, |(_, value)| *value)
    }
}
