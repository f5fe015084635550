//! Entities that a file places by a clear gap ahead of the ego.

use super::bodies::ImportedBody;
use super::concrete::Concrete;
use super::seen::EntityInFrame;
use crate::opendrive::error::ImportError;
use crate::opendrive::ways::FOLDS;
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
        // From front to front, since reference points lie at different
        // places in both bodies.
        it.spot.x_m = at.x_m + ego_body.front_m + way_m - body.front_m;
        let Some(course) = &course else {
            continue;
        };
        let rear_box = PlacedBox {
            pose: course.pose(at.x_m, at.y_m),
            body: ego_body,
        };
        for _ in 0..CORRECTIONS {
            let own_box = PlacedBox {
                pose: course.pose(it.spot.x_m, it.spot.y_m),
                body,
            };
            let clear_m = own_box.clear_m(&rear_box);
            it.spot.x_m += (gap_m - clear_m) / scale;
        }
    }
    Ok(())
}

/// Course of the middle of lane 0, from the origin of the frame.
fn course(concrete: &Concrete) -> Result<Course, ImportError> {
    let pieces = concrete.pieces(f64::INFINITY);
    let course = Course::of_bends(Pose::default(), &pieces);
    course.map_err(|error| concrete.ego_at.error(error.what).helped(FOLDS))
}

/// Box of an entity at its reference point.
struct PlacedBox<'a> {
    pose: Pose,
    body: &'a ImportedBody,
}

impl PlacedBox<'_> {
    /// Clear length between the box and another one behind it.
    ///
    /// It is measured along the axis of the box.
    fn clear_m(&self, behind: &PlacedBox<'_>) -> f64 {
        let corners_m = [0.5, -0.5].map(|side| {
            let front_m = behind.body.front_m;
            let corner = behind.pose.moved(front_m, side * behind.body.width_m);
            self.pose.sees(&corner).x_m
        });
        let rear_m = self.body.front_m - self.body.length_m;
        // The foremost corner of the other box ends the clear length.
        rear_m - corners_m[0].max(corners_m[1])
    }
}
