//! Sight of the ego: agents hidden behind vehicles or by the weather.
//!
//! The ego looks from the middle of its front bumper. An agent is seen if at
//! least one of five points of its box is visible: a corner or the middle. A
//! point is hidden if the straight line to it crosses the box of a third body
//! on wheels, parked or moving, whatever its height. Pedestrians hide nothing. A
//! crest of the ego's road hides an agent whose roof is below the line over it.
//! Weather hides every agent whose box is farther away than the visibility, and
//! so do sensors by their range.

use nalgebra::Point2;

use super::spec::DriveSpec;
use super::state::SceneState;
use super::surface::{AboveRoad, crest_hides};
use crate::sim::{Body, BodyState, GroundFrame, Pose};

/// Height of the ego's eyes above the road.
const EYE_M: f64 = 1.1;

/// Outline of a body from above.
struct Footprint {
    /// Frame of its middle.
    frame: GroundFrame,
    half_length_m: f64,
    half_width_m: f64,
}

impl Footprint {
    fn of(body: &Body, front: &Pose) -> Footprint {
        let half_length_m = 0.5 * body.length_m;
        let mut frame = front.frame();
        frame.origin_m -= frame.ahead() * half_length_m;
        Footprint {
            frame,
            half_length_m,
            half_width_m: 0.5 * body.width_m,
        }
    }

    /// Returns its middle and its corners.
    fn points(&self) -> [Point2<f64>; 5] {
        let at = |ahead: f64, left: f64| {
            let (ahead_m, left_m) = (ahead * self.half_length_m, left * self.half_width_m);
            self.frame.to_world(ahead_m, left_m)
        };
        [
            at(0.0, 0.0),
            at(1.0, 1.0),
            at(1.0, -1.0),
            at(-1.0, 1.0),
            at(-1.0, -1.0),
        ]
    }

    /// Returns the distance from a point to the box, 0 inside.
    fn distance_m(&self, from: Point2<f64>) -> f64 {
        let at = self.frame.to_local(from);
        let ahead_m = (at[0].abs() - self.half_length_m).max(0.0);
        let left_m = (at[1].abs() - self.half_width_m).max(0.0);
        (ahead_m * ahead_m + left_m * left_m).sqrt()
    }

    /// Returns whether the line between two points crosses this box.
    ///
    /// In its own frame the box is |ahead| ≤ a and |left| ≤ b. The shares of
    /// the line within the two strips must overlap (Kay, Kajiya 1986).
    fn hides(&self, from: Point2<f64>, to: Point2<f64>) -> bool {
        let (from, to) = (self.frame.to_local(from), self.frame.to_local(to));
        // The line crosses the box only where it is between both pairs of
        // edges at once.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (axis, half_m) in [self.half_length_m, self.half_width_m]
            .into_iter()
            .enumerate()
        {
            let step_m = to[axis] - from[axis];
            if step_m == 0.0 {
                // A line along an edge only touches the box and is not hidden.
                if half_m <= from[axis].abs() {
                    return false;
                }
                continue;
            }
            let (one, other) = (
                (-half_m - from[axis]) / step_m,
                (half_m - from[axis]) / step_m,
            );
            enters = enters.max(one.min(other));
            leaves = leaves.min(one.max(other));
        }
        enters < leaves
    }
}

/// Returns whether the ego sees each agent, or `None` if nothing could hide one.
pub(super) fn perceived(scene: &SceneState, ego: usize) -> Option<Vec<bool>> {
    let (spec, states) = (&scene.spec, &scene.states);
    let mut seen = if spec.sensors.line_of_sight {
        Some(visible(spec, states, ego))
    } else {
        None
    };
    // Without slopes no road rises above a line of sight.
    if let Some(seen) = seen.as_mut().filter(|_| spec.has_slopes()) {
        hide_behind_crests(scene, ego, seen);
    }
    let visibility_m = scene.weather.map(|weather| weather.visibility_m);
    // The nearer of both limits hides.
    let reach_m = [visibility_m, spec.sensors.range_m]
        .into_iter()
        .flatten()
        .fold(f64::INFINITY, f64::min);
    if reach_m < f64::INFINITY {
        let seen = seen.get_or_insert_with(|| vec![true; states.len()]);
        hide_beyond(reach_m, spec, states, ego, seen);
    }
    seen
}

/// Returns whether the ego sees each agent in recorded states.
///
/// A record holds neither weather nor places along roads, so only sensors hide here.
pub(super) fn recorded(spec: &DriveSpec, states: &[BodyState], ego: usize) -> Vec<bool> {
    let mut seen = if spec.sensors.line_of_sight {
        visible(spec, states, ego)
    } else {
        vec![true; states.len()]
    };
    if let Some(range_m) = spec.sensors.range_m {
        hide_beyond(range_m, spec, states, ego, &mut seen);
    }
    seen
}

/// Hides agents whose boxes are farther from the ego's eyes than its reach.
fn hide_beyond(
    reach_m: f64,
    spec: &DriveSpec,
    states: &[BodyState],
    ego: usize,
    seen: &mut [bool],
) {
    let eye = states[ego].pose.point_m();
    for (i, (sees, state)) in seen.iter_mut().zip(states).enumerate() {
        let footprint = Footprint::of(&spec.agents[i].body, &state.pose);
        // The ego always perceives itself, also without any visibility.
        *sees &= i == ego || footprint.distance_m(eye) <= reach_m;
    }
}

/// Hides agents on the ego's road whose roofs are behind a crest.
fn hide_behind_crests(scene: &SceneState, ego: usize, seen: &mut [bool]) {
    let spec = &scene.spec;
    let profile = spec.profile_of(spec.agents[ego].road);
    let eye = AboveRoad {
        s_m: scene.on_road[ego].s_m,
        height_m: EYE_M,
    };
    for (other, sees) in seen.iter_mut().enumerate() {
        let roof = AboveRoad {
            s_m: scene.on_road_of(ego, other).s_m,
            height_m: spec.agents[other].body.height_m,
        };
        *sees &= other == ego || !crest_hides(&profile, eye, roof);
    }
}

/// Returns whether the ego has a line of sight to each agent in the given states.
fn visible(spec: &DriveSpec, states: &[BodyState], ego: usize) -> Vec<bool> {
    let bodies = spec.agents.iter().map(|agent| &agent.body);
    let boxes = bodies.zip(states);
    let (boxes, fronts): (Vec<Footprint>, Vec<Pose>) = boxes
        .map(|(body, state)| (Footprint::of(body, &state.pose), state.pose))
        .unzip();
    let eye = fronts[ego].point_m();
    let on_wheels = |i: &usize| !spec.agents[*i].body.is_on_foot();
    let sees = |seen: usize| {
        let points = boxes[seen].points();
        // A single visible point suffices.
        points.into_iter().any(|point| {
            // A body does not hide itself, and the eye lies on the ego's box.
            let mut third = (0..boxes.len()).filter(|&i| i != ego && i != seen);
            !third.any(|i| on_wheels(&i) && boxes[i].hides(eye, point))
        })
    };
    (0..boxes.len()).map(sees).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_hidden_where_it_passes_through_the_box() {
        let sedan = Body::shipped("sedan").expect("shipped").expect("sound");
        let front = Pose {
            x_m: 10.0,
            y_m: 0.0,
            heading_rad: core::f64::consts::FRAC_PI_2,
        };
        // Across: 0.9 m to either side of x = 10, from y = 0 back to −4.54.
        let parked = Footprint::of(&sedan, &front);
        for (from, to, hidden) in [
            ([0.0, 0.0], [20.0, -2.0], true),
            ([0.0, 0.0], [20.0, 0.2], false),
            ([0.0, 0.0], [9.0, -2.0], false),
            ([10.0, 5.0], [10.0, -10.0], true),
            ([11.0, 5.0], [11.0, -10.0], false),
            ([0.0, -4.4], [20.0, -4.4], true),
            ([0.0, -4.6], [20.0, -4.6], false),
        ] {
            let [from, to] = [from, to].map(Point2::from);
            assert_eq!(parked.hides(from, to), hidden, "{from:?} {to:?}");
            assert_eq!(parked.hides(to, from), hidden, "{to:?} {from:?}");
        }
    }
}
