//! Recorded situations as world files: on lanes, and on paths that cross.
//!
//! An ado follows the plan of a recorded road user, from which it may stray as far as its
//! rules allow. No recorded position is in a world, only speeds and roads that were fitted.

mod crossing;
mod lanes;
mod other_road_users;
pub(crate) mod planned_motion;
mod point_columns;

use brakecheck_traffic::{RecordedWorld, SituationPlan, SituationRoad};

use crate::scene::Clock;
use crate::world_file::CommentedWorld;

/// Friction of dry asphalt, because recordings state none.
const FRICTION: f64 = 0.9;

/// Returns the world file of recorded situations, with comments about their origin.
pub fn world_of(recorded: &RecordedWorld) -> CommentedWorld {
    // Invariant: a recorded world has a situation.
    let first = &recorded.situations[0];
    match &first.road {
        SituationRoad::Crossing(roads) => crossing::world(&recorded.name, first, roads),
        _ => lanes::world(recorded),
    }
}

/// Returns the clock of a plan, which decides whenever a piece of it ends.
fn clock_of(plan: &SituationPlan) -> Clock {
    Clock {
        horizon_s: plan.speed.to_mps.len() as f64 * brakecheck_traffic::PIECE_S,
        decision_s: brakecheck_traffic::PIECE_S,
        sample_s: 0.05,
        substeps: 4,
    }
}

/// Returns the name of a recording's file without its directory.
fn file_name(source: &str) -> String {
    // Sources may have been named on another system.
    plain(source.rsplit(['/', '\\']).next().unwrap_or(source))
}

/// Returns a text that may be in a comment and in a string.
fn plain(text: &str) -> String {
    text.replace(['"', '\\', '\n', '\r'], "_")
}
