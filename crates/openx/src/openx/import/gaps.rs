//! Entities that a file places by a clear gap ahead of the ego.

use super::bodies::ImportedBody;
use super::concrete::Concrete;
use super::seen::EntityInFrame;
use crate::opendrive::error::ImportError;
use crate::opendrive::ways::{FOLDS, ImportedPath};
use crate::road::Course;
use crate::sim::Pose;

/// Corrections of a place beside a bend. Each leaves a tenth of the error.
const CORRECTIONS: usize = 30;

/// Moves entities with a stated gap ahead of the ego, to that gap.
///
/// The gap is the clear length between both boxes along the entity's own axis.
/// In a bend the boxes are turned against each other, so this is less than the
/// length along the road.
///
/// # Errors
///
/// Returns an error for a bend that a world refuses.
pub(super) fn place_by_gaps(
    concrete: &Concrete,
    all: &mut [EntityInFrame],
    ego: usize,
) -> Result<(), ImportError> {
    let (at, ego_body) = (all[ego].spot, &all[ego].entity.body);
    let course = concrete.bends().then(|| course(concrete)).transpose()?;
    // Stations count along lane 0, and a gap counts along the ego's own line.
    let scale = 1.0 - concrete.bend_per_m() * at.y_m;
    for it in all {
        let Some(gap_m) = it.entity.gap_m else {
            continue;
        };
        let body = &it.entity.body;
        let way_m = (gap_m + body.length_m) / scale;
        it.spot.x_m = at.x_m + ego_body.front_m + way_m - body.front_m;
        let Some(course) = &course else {
            continue;
        };
        let ego_pose = course.pose(at.x_m, at.y_m);
        for _ in 0..CORRECTIONS {
            let pose = course.pose(it.spot.x_m, it.spot.y_m);
            let clear_m = clear_m((&pose, body), (&ego_pose, ego_body));
            it.spot.x_m += (gap_m - clear_m) / scale;
        }
    }
    Ok(())
}

/// Course of the middle of lane 0, from the origin of the frame.
fn course(concrete: &Concrete) -> Result<Course, ImportError> {
    let way = ImportedPath {
        begins: Pose::default(),
        pieces: concrete.pieces(f64::INFINITY),
    };
    let course = way.course();
    course.map_err(|what| concrete.ego_at.error(what).helped(FOLDS))
}

/// Clear length between the box of an entity and that of the ego behind it.
///
/// It is measured along the axis of the entity.
fn clear_m((pose, body): (&Pose, &ImportedBody), (ego, ego_body): (&Pose, &ImportedBody)) -> f64 {
    let corners_m = [0.5, -0.5].map(|side| {
        let corner = ego.moved(ego_body.front_m, side * ego_body.width_m);
        pose.sees(&corner).x_m
    });
    let rear_m = body.front_m - body.length_m;
    rear_m - corners_m[0].max(corners_m[1])
}
