//! Extent of the written road, and the origin of its s.

use crate::scene::Passage;
use crate::scene::drive::DriveWorld;
use crate::sim::Pose;
use crate::testbench::FilmAfterContact;

/// Least road in metres behind the rearmost and ahead of the foremost body.
const BEHIND_M: f64 = 50.0;
const AHEAD_M: f64 = 200.0;
/// Multiple in metres to which both ends are rounded.
const ROUND_M: f64 = 10.0;

/// Stretch of road that is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Start and end on the course, in metres.
    pub from_s_m: f64,
    pub to_s_m: f64,
}

impl Stretch {
    /// Returns the stretch of a road that holds its agents in the given passages,
    /// and after the contact.
    ///
    /// It includes every piece of the course. On the world's own road it also
    /// includes the stop lines and the agents of all other roads.
    pub(super) fn around(
        world: &DriveWorld,
        road: usize,
        passages: &[&Passage],
        after: Option<&FilmAfterContact>,
    ) -> Stretch {
        let (spec, course) = (world.spec(), &world.courses()[road]);
        let pieces = course.pieces();
        // The course begins at s = 0, which is always part of the road.
        let mut least_m = 0.0_f64;
        let mut most_m = pieces
            .last()
            .map_or(0.0, |last| last.from_s_m + last.length_m);
        let mut hold = |s_m: f64, reach_m: f64| {
            least_m = least_m.min(s_m - reach_m);
            most_m = most_m.max(s_m + reach_m);
        };
        for (_, light) in spec.lights_of(road) {
            // A stop line beyond the end of the road would be no valid place for a
            // signal.
            hold(light.line_m, 0.0);
        }
        for passage in passages {
            for sample in 0..passage.motion.len() {
                let bodies = spec.agents.iter().zip(passage.motion.at(sample));
                for (agent, body) in bodies.filter(|(agent, _)| road == 0 || agent.road == road) {
                    // A full length covers the box in both orientations.
                    hold(course.locate(&body.state.pose).s_m, agent.body.length_m);
                }
            }
        }
        for frame in after.iter().flat_map(|after| &after.frames) {
            let placed = spec.agents.iter().zip(&frame.placements);
            for (agent, placement) in placed.filter(|(agent, _)| road == 0 || agent.road == road) {
                let [x_m, y_m, _] = placement.centre_m;
                let middle = Pose {
                    x_m,
                    y_m,
                    heading_rad: placement.heading_rad(),
                };
                hold(course.locate(&middle).s_m, agent.body.length_m);
            }
        }
        Stretch {
            // Rounded outward, so that the margins never shrink.
            from_s_m: ((least_m - BEHIND_M) / ROUND_M).floor() * ROUND_M,
            to_s_m: ((most_m + AHEAD_M) / ROUND_M).ceil() * ROUND_M,
        }
    }

    /// Returns OpenDRIVE's s of a place on the course.
    pub(super) fn s_m(&self, course_s_m: f64) -> f64 {
        course_s_m - self.from_s_m
    }
}
