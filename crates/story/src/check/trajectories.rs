//! Check of trajectories, which become curves.

use std::sync::Arc;

use super::Check;
use crate::pose::Pose;
use crate::road::CourseError;
use crate::ron_file::ValuePath;
use crate::trajectory::{NurbsPoint, PathPoint, PolylineTurn, Spiral, TimedSpiral, TrajectoryPath};
use crate::values::{FollowingMode, StoryTrajectory};

impl Check<'_, '_> {
    /// Returns the curve of a trajectory, or `None` for one with a mistake.
    ///
    /// A trajectory with a timing needs times.
    pub(super) fn curve(
        &mut self,
        path: &ValuePath,
        trajectory: &StoryTrajectory,
        following: FollowingMode,
        is_timed: bool,
    ) -> Option<Arc<TrajectoryPath>> {
        let before = self.problems.len();
        let checked = self.trajectory(path, trajectory);
        // A curve of wrong numbers would only report the same mistakes again.
        if self.problems.len() > before {
            return None;
        }
        let curve = curve_of(&checked, following, is_timed);
        let found = curve.map_err(|error| {
            let list = match checked {
                StoryTrajectory::Polyline(_) => path.at(0),
                StoryTrajectory::Clothoid { .. } => path.to("pieces"),
                StoryTrajectory::Nurbs { .. } => path.to("control_points"),
            };
            let place = error.index.map_or(path.clone(), |i| list.at(i));
            self.wrong(&place, error.what, &error.help);
        });
        let curve = found.ok()?;
        // A curve without any time is no error of the curve, only of its timing.
        if is_timed && curve.times_s.is_empty() {
            let what = "a timing of a trajectory without times".to_owned();
            self.wrong(path, what, "write `time_s` at its points, or no `timing`");
            return None;
        }
        Some(Arc::new(curve))
    }
}

fn curve_of(
    trajectory: &StoryTrajectory<f64>,
    following: FollowingMode,
    is_timed: bool,
) -> Result<TrajectoryPath, CourseError> {
    // Files state times of no meaning where no timing uses them.
    let used = |time_s: Option<f64>| time_s.filter(|_| is_timed);
    match trajectory {
        StoryTrajectory::Polyline(vertices) => {
            let points: Vec<PathPoint> = vertices
                .iter()
                .map(|it| PathPoint {
                    at_m: [it.x_m, it.y_m],
                    heading_rad: it.heading_rad,
                    time_s: used(it.time_s),
                })
                .collect();
            // As in esmini, a body with exact places turns within 2 m of a corner.
            let turn = match following {
                FollowingMode::Position => PolylineTurn::AtCorners,
                FollowingMode::Follow => PolylineTurn::AlongLines,
            };
            TrajectoryPath::polyline(&points, turn)
        }
        StoryTrajectory::Clothoid {
            x_m,
            y_m,
            heading_rad,
            time_s,
            pieces,
        } => {
            let begins = Pose {
                x_m: *x_m,
                y_m: *y_m,
                heading_rad: *heading_rad,
            };
            let pieces: Vec<TimedSpiral> = pieces
                .iter()
                .map(|it| TimedSpiral {
                    spiral: Spiral {
                        length_m: it.length_m,
                        from_per_m: it.from_per_m,
                        to_per_m: it.to_per_m,
                    },
                    ends_s: used(it.time_s),
                })
                .collect();
            TrajectoryPath::clothoids(begins, used(*time_s), &pieces)
        }
        StoryTrajectory::Nurbs {
            order,
            knots,
            control_points,
        } => {
            let points: Vec<NurbsPoint> = control_points
                .iter()
                .map(|it| NurbsPoint {
                    at_m: [it.x_m, it.y_m],
                    // Equal weights make it a plain B-spline.
                    weight: it.weight.unwrap_or(1.0),
                    time_s: used(it.time_s),
                })
                .collect();
            TrajectoryPath::nurbs(*order, knots, &points)
        }
    }
}
