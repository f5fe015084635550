//! Collisions after the first contact, as rapier resolves them.

use super::world::{ChassisId, RapierWorld};
use crate::sim::{BodyId, Collision};

/// Time without a force after which two bodies have separated.
///
/// Two bodies that lean on each other lose touch for a step now and then.
const QUIET_S: f64 = 0.1;

/// Record of the collisions of all bodies.
#[derive(Clone)]
pub(super) struct Collisions {
    ids: Vec<ChassisId>,
    elapsed_s: f64,
    running: Vec<RunningCollision>,
    ended: Vec<Collision>,
}

#[derive(Clone)]
struct RunningCollision {
    collision: Collision,
    quiet_s: f64,
}

impl Collisions {
    /// Creates an empty record for bodies in the order of their numbers.
    pub(super) fn new(ids: Vec<ChassisId>) -> Collisions {
        Collisions {
            ids,
            elapsed_s: 0.0,
            running: Vec::new(),
            ended: Vec::new(),
        }
    }

    /// Returns the velocities of all bodies.
    pub(super) fn velocities(&self, world: &RapierWorld) -> Vec<[f64; 2]> {
        let ids = self.ids.iter();
        ids.map(|id| world.velocity_mps(*id)).collect()
    }

    /// Records one step and returns the bodies that a force acted on.
    ///
    /// `before` are the velocities before rapier's step, after the wheels acted. The
    /// change over the step is therefore that of the collision alone.
    pub(super) fn record(
        &mut self,
        world: &RapierWorld,
        before: &[[f64; 2]],
        dt_s: f64,
    ) -> Vec<usize> {
        let after = self.velocities(world);
        let number = |wanted| self.ids.iter().position(|id| *id == wanted);
        let mut pairs: Vec<(usize, usize)> = world
            .colliding()
            .into_iter()
            .filter_map(|(a, b)| Some((number(a)?, number(b)?)))
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        // A pair of bodies may touch with several parts.
        pairs.sort_unstable();
        pairs.dedup();
        for running in &mut self.running {
            // Added first and reset below for every pair that still exerts a
            // force.
            running.quiet_s += dt_s;
        }
        for &(a, b) in &pairs {
            let pair = (BodyId(a), BodyId(b));
            let known = self
                .running
                .iter_mut()
                .find(|running| running.collision.pair == pair);
            let running = match known {
                Some(running) => running,
                None => {
                    self.running
                        .push(RunningCollision::new(pair, self.elapsed_s));
                    let last = self.running.len() - 1;
                    &mut self.running[last]
                }
            };
            running.quiet_s = 0.0;
            let collision = &mut running.collision;
            collision.duration_s = self.elapsed_s + dt_s - collision.after_s;
            for (side, body) in [a, b].into_iter().enumerate() {
                for axis in 0..2 {
                    collision.delta_v_mps[side][axis] += after[body][axis] - before[body][axis];
                }
            }
        }
        self.elapsed_s += dt_s;
        self.end(|running| running.quiet_s >= QUIET_S);
        pairs.into_iter().flat_map(|(a, b)| [a, b]).collect()
    }

    /// Returns all collisions so far, in the order of their beginning.
    pub(super) fn take(&mut self) -> Vec<Collision> {
        self.end(|_| true);
        let mut ended = std::mem::take(&mut self.ended);
        // Ties are broken by the numbers, so that the order never depends on
        // rapier's.
        ended.sort_by(|a, b| a.after_s.total_cmp(&b.after_s).then(a.pair.cmp(&b.pair)));
        ended
    }

    fn end(&mut self, has_ended: impl Fn(&RunningCollision) -> bool) {
        let running = std::mem::take(&mut self.running);
        for one in running {
            if has_ended(&one) {
                self.ended.push(one.collision);
            } else {
                self.running.push(one);
            }
        }
    }
}

impl RunningCollision {
    fn new(pair: (BodyId, BodyId), after_s: f64) -> RunningCollision {
        RunningCollision {
            collision: Collision {
                pair,
                after_s,
                duration_s: 0.0,
                delta_v_mps: [[0.0; 2]; 2],
            },
            quiet_s: 0.0,
        }
    }
}
