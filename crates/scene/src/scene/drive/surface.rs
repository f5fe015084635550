//! Surface of the roads of a world, with its heights for viewers and sensors.

use super::spec::DriveSpec;
use crate::road::{Course, RoadNetwork, RoadProfile, SurfaceExtent, SurfaceMesh, stations_m};
use crate::sim::{GroundSurface, PlantKind};

/// Greatest speed for which a surface is long enough, in m/s.
const FASTEST_MPS: f64 = 70.0;
/// Length of surface behind the first and before the last place that a body may reach.
const BEYOND_M: f64 = 300.0;
/// Points on a line of sight at which the road may rise above it.
const SIGHT_POINTS: u32 = 24;

/// Returns the distance that no body exceeds in an episode.
pub(super) fn reach_m(spec: &DriveSpec) -> f64 {
    FASTEST_MPS * spec.clock.horizon_s + BEYOND_M
}

/// Returns the surface of all roads, `None` on the kinematic plant and if all are flat.
pub(super) fn surface_of(spec: &DriveSpec, network: &RoadNetwork) -> Option<GroundSurface> {
    if spec.plant == PlantKind::Kinematic || !spec.has_slopes() {
        return None;
    }
    // No body drives off the surface within the horizon.
    let reach_m = reach_m(spec);
    let mut mesh = SurfaceMesh::default();
    for (road, course) in network.courses().iter().enumerate() {
        let lanes = spec.road_at(road);
        let half_m = 0.5 * lanes.lane_width_m();
        let extent = SurfaceExtent {
            stations_m: -reach_m..course.end_s_m() + reach_m,
            borders_m: -half_m..lanes.lane_middle_m(lanes.lanes() - 1) + half_m,
        };
        mesh.add(course, &spec.profile_of(road), &extent);
    }
    GroundSurface::of(&mesh)
}

/// Returns a line beside a course, as a polyline on its surface.
pub(super) fn polyline_m(
    course: &Course,
    profile: &RoadProfile,
    lateral_m: f64,
    reach_m: (f64, f64),
) -> Vec<[f64; 3]> {
    if profile.is_flat() {
        return course.polyline_m(lateral_m, reach_m.0..reach_m.1);
    }
    // A flat road is drawn as far.
    let (from_m, to_m) = (
        reach_m.0.min(0.0) - 100.0,
        reach_m.1.max(course.end_s_m()) + 100.0,
    );
    let mut last_m = f64::NEG_INFINITY;
    let mut stations_m = stations_m(course, profile, &(from_m..to_m));
    // A facet of a metre suffices for a picture.
    stations_m.retain(|s_m| {
        let is_drawn = *s_m == to_m || *s_m - last_m >= 1.0;
        if is_drawn {
            last_m = *s_m;
        }
        is_drawn
    });
    let point = |s_m: f64| {
        let at = course.pose(s_m, lateral_m);
        [at.x_m, at.y_m, profile.height_m(s_m, lateral_m)]
    };
    stations_m.into_iter().map(point).collect()
}

/// Point above the middle of a road.
#[derive(Clone, Copy, Debug)]
pub(super) struct AboveRoad {
    pub s_m: f64,
    /// Height above the road.
    pub height_m: f64,
}

/// Returns whether a road hides one point above it from another.
///
/// Banks hide nothing.
pub(super) fn crest_hides(profile: &RoadProfile, from: AboveRoad, to: AboveRoad) -> bool {
    let height_m = |at: AboveRoad| profile.height_m(at.s_m, 0.0) + at.height_m;
    let (from_m, to_m) = (height_m(from), height_m(to));
    // Without the first point, which is the eye itself.
    (1..SIGHT_POINTS).any(|i| {
        let share = f64::from(i) / f64::from(SIGHT_POINTS);
        let sight_m = from_m + share * (to_m - from_m);
        sight_m < profile.height_m(from.s_m + share * (to.s_m - from.s_m), 0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Grade;

    #[test]
    fn a_crest_hides_beyond_the_distance_of_the_road_designers_formula() {
        // Radius 1000 m: √(2·R·h₁) + √(2·R·h₂) = 46.9 + 54.8 m.
        let grades = [
            Grade {
                from_s_m: -500.0,
                rise: 0.2,
            },
            Grade {
                from_s_m: 0.0,
                rise: -0.2,
            },
        ];
        let profile = RoadProfile {
            grades: &grades,
            vertical_curve_m: 400.0,
            ..RoadProfile::default()
        };
        for (away_m, hidden) in [(95.0, false), (101.0, false), (103.0, true), (150.0, true)] {
            let eye = AboveRoad {
                s_m: -46.9,
                height_m: 1.1,
            };
            let roof = AboveRoad {
                s_m: -46.9 + away_m,
                height_m: 1.5,
            };
            let hides = crest_hides(&profile, eye, roof);
            assert_eq!(hides, hidden, "{away_m}");
        }
    }
}
