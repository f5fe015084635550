//! How an ego moved, as seen from outside.

use std::sync::Arc;

use crate::scene::drive::Course;
use crate::sim::Pose;
use crate::testbench::Testbench;
use crate::world::Scenario;

/// Where an ego was at one sample, and how fast.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moment {
    /// Along the road.
    pub s_m: f64,
    /// To the left of lane 0's middle.
    pub lateral_m: f64,
    /// Along its heading.
    pub speed_mps: f64,
}

impl Moment {
    /// Between two places on the road.
    pub fn distance_m(&self, other: &Moment) -> f64 {
        libm::hypot(self.s_m - other.s_m, self.lateral_m - other.lateral_m)
    }

    /// Whether two motions are so far apart that a plan for one may not do for
    /// the other.
    pub fn strays_from(&self, other: &Moment) -> bool {
        const APART_M: f64 = 0.1;
        const APART_MPS: f64 = 0.1;
        APART_M < self.distance_m(other) || APART_MPS < (self.speed_mps - other.speed_mps).abs()
    }
}

/// Reads the ego's motion off the traces of a world.
#[derive(Clone, Debug)]
pub(super) struct MotionReader {
    columns: [usize; 3],
    course: Arc<Course>,
}

impl MotionReader {
    /// For the traces of `world`; `None`: nobody drives in it.
    pub fn of(world: &Scenario) -> Option<MotionReader> {
        let spec = world.drive()?;
        let ego = &spec.agents[spec.egos().next()?].name;
        let schema = world.world().schema();
        let position = |field: &str| schema.position(&format!("{ego}.{field}"));
        Some(MotionReader {
            columns: [position("x")?, position("y")?, position("speed")?],
            course: Arc::new(spec.road.course().ok()?),
        })
    }

    /// Adds the samples of a bench that `motion` does not hold yet.
    pub fn follow(&self, bench: &Testbench, motion: &mut Vec<Moment>) {
        let [x, y, speed] = self.columns.map(|column| bench.trace().column(column));
        // Where a contact is held to the horizon the trace goes on, the motion not.
        let moved = bench.physics_steps() / u64::from(bench.clock().substeps);
        for sample in motion.len()..=moved as usize {
            let at = self.course.locate(&Pose {
                x_m: x[sample],
                y_m: y[sample],
                heading_rad: 0.0,
            });
            motion.push(Moment {
                s_m: at.s_m,
                lateral_m: at.lateral_m,
                speed_mps: speed[sample],
            });
        }
    }
}
