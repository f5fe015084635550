//! Motion of an ego along its road, read from traces.

use crate::sim::Pose;
use crate::testbench::Testbench;
use crate::world::DriveScenario;

/// Position and speed of an ego at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MotionSample {
    /// Position along the road.
    pub s_m: f64,
    /// Position to the left of the middle of lane 0.
    pub lateral_m: f64,
    /// Speed along the heading.
    pub speed_mps: f64,
}

impl MotionSample {
    /// Returns the distance between two positions on the road.
    pub(super) fn distance_m(&self, other: &MotionSample) -> f64 {
        libm::hypot(self.s_m - other.s_m, self.lateral_m - other.lateral_m)
    }

    /// Returns whether two motions differ too much to share a plan.
    pub(super) fn strays_from(&self, other: &MotionSample) -> bool {
        const APART_M: f64 = 0.1;
        const APART_MPS: f64 = 0.1;
        self.distance_m(other) > APART_M || (self.speed_mps - other.speed_mps).abs() > APART_MPS
    }
}

/// Reader of the ego's motion from the traces of a world.
#[derive(Clone, Debug)]
pub(super) struct MotionReader {
    columns: [usize; 3],
}

impl MotionReader {
    /// Returns a reader for the traces of `world`.
    pub(super) fn of(world: DriveScenario<'_>) -> MotionReader {
        MotionReader {
            columns: world.ego_columns(),
        }
    }

    /// Appends the samples of a bench that `motion` does not hold yet.
    pub(super) fn follow(&self, bench: &Testbench, motion: &mut Vec<MotionSample>) {
        let [x, y, speed] = self.columns.map(|column| bench.trace().column(column));
        // After a held contact the trace continues to the horizon, but the motion ends.
        let moved = bench.physics_steps() / u64::from(bench.clock().substeps);
        // The road is that of the start that the bench plays.
        let Some(world) = bench.driven() else {
            return;
        };
        // Sample 0 is the start itself, so there is a sample more than there are moves.
        for sample in motion.len()..=moved as usize {
            let at = world.course().locate(&Pose {
                x_m: x[sample],
                y_m: y[sample],
                // The heading has no influence on the position along the road.
                heading_rad: 0.0,
            });
            motion.push(MotionSample {
                s_m: at.s_m,
                lateral_m: at.lateral_m,
                speed_mps: speed[sample],
            });
        }
    }
}
