//! How much of the road is written, and where its s begins.

use crate::scene::Passage;
use crate::scene::drive::DriveWorld;

/// Road behind the rearmost and ahead of the foremost body, at least.
const BEHIND_M: f64 = 50.0;
const AHEAD_M: f64 = 200.0;
/// Ends lie at whole multiples.
const ROUND_M: f64 = 10.0;

/// The stretch of road that is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Where it begins and ends on the course of the world.
    pub from_s_m: f64,
    pub to_s_m: f64,
}

impl Stretch {
    /// What of a road holds who is on it in some passages, every piece and, of
    /// the world's own, every stop line and everybody.
    pub fn around(world: &DriveWorld, road: usize, passages: &[&Passage]) -> Stretch {
        let (spec, course) = (world.spec(), &world.courses()[road]);
        let pieces = course.pieces();
        let mut least_m = 0.0_f64;
        let mut most_m = pieces
            .last()
            .map_or(0.0, |last| last.from_s_m + last.length_m);
        let mut hold = |s_m: f64, reach_m: f64| {
            least_m = least_m.min(s_m - reach_m);
            most_m = most_m.max(s_m + reach_m);
        };
        for light in spec.lights.iter().filter(|_| road == 0) {
            hold(light.line_m, 0.0);
        }
        for passage in passages {
            for sample in 0..passage.motion.len() {
                let bodies = spec.agents.iter().zip(passage.motion.at(sample));
                for (agent, body) in bodies.filter(|(agent, _)| road == 0 || agent.road == road) {
                    // Whichever way it faces, its box is this near its front.
                    hold(course.locate(&body.state.pose).s_m, agent.body.length_m);
                }
            }
        }
        Stretch {
            from_s_m: ((least_m - BEHIND_M) / ROUND_M).floor() * ROUND_M,
            to_s_m: ((most_m + AHEAD_M) / ROUND_M).ceil() * ROUND_M,
        }
    }

    /// OpenDRIVE's s of a place on the course.
    pub fn s_m(&self, course_s_m: f64) -> f64 {
        course_s_m - self.from_s_m
    }
}
