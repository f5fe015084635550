//! Plans of entities: meetings with the ego, or what the storyboard says.

use super::concrete::Concrete;
use super::draft::tidy;
use super::entity::Steady;
use super::seen::{EntityInFrame, EntityPath, ego_lever_m};
use crate::opendrive::error::ImportError;
use crate::scene::drive::{MeetEgo, MotionPlan, SteadyPart};
use crate::world_file::{NumberOrRange, PlanFile};

/// Returns the plan of an entity, as its `drive` or as the base of an ado.
///
/// # Errors
///
/// Returns an error for a place outside of the frame.
pub(super) fn plan(
    concrete: &Concrete,
    all: &[EntityInFrame],
    it: &EntityInFrame,
) -> Result<PlanFile, ImportError> {
    let Some(approach) = &it.entity.approach else {
        return Ok(MotionPlan::Script(Vec::new()));
    };
    let at = &it.entity.at;
    let ego = concrete.station(&approach.ego, at)?;
    let here = match it.path {
        EntityPath::Own(..) => concrete.in_frame(&approach.here, at)?,
        _ => concrete.station(&approach.here, at)?,
    };
    // Places are those of reference points, and worlds state fronts.
    let here_m = match it.path {
        EntityPath::Left | EntityPath::Right => here.y_m + it.front_left_m(),
        EntityPath::Own(begins, on) => {
            // On a bent path, the station is the distance along the pieces.
            let along_m = match &approach.here.way {
                Some(here) if here.way == on.way && on.way.piece_count() > 0 => here.along_m,
                _ if on.is_lane => on.station_m(&approach.here.spot),
                _ => begins.sees(&here).x_m,
            };
            along_m + it.front_along_m()
        }
        _ => here.x_m + it.front_along_m(),
    };
    Ok(MotionPlan::Meet(MeetEgo {
        ego_at_m: number(ego.x_m + ego_lever_m(all)),
        here_at_m: number(here_m),
        speed_mps: number(approach.speed_mps),
        steady: match approach.steady {
            Steady::Metres(value) => SteadyPart::Metres(number(value)),
            Steady::Seconds(value) => SteadyPart::Seconds(number(value)),
        },
    }))
}

/// Returns a number of a world, without the digits that sums add.
pub(super) fn number(value: f64) -> NumberOrRange {
    NumberOrRange::from(tidy(value))
}
