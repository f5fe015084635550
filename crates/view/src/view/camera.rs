//! Cameras of the spatial views: their positions and their visible entities.

use nalgebra::Point2;
use re_sdk_types::blueprint::archetypes::{EyeControls3D, LineGrid3D};
use re_sdk_types::blueprint::components::Eye3DKind;

use super::error::ViewError;
use super::layout::{BlueprintBuilder, BlueprintNode};
use super::viewed_episode::ViewedEpisode;
use crate::scene::Frame;

/// Entity whose frame moves the cameras.
pub(super) const FOLLOW: &str = "/follow";

/// Entities that the spatial views show.
pub(super) const SPACE: [&str; 4] = [
    "+ /world/**",
    "+ /trails/**",
    "+ /contact/**",
    "+ /verdict/mark",
];

/// Places the camera of a view in the frame that follows the ego.
pub(super) fn look(
    layout: &mut BlueprintBuilder<'_>,
    view: &BlueprintNode,
    eye_m: [f32; 3],
    at_m: [f32; 3],
    up: [f32; 3],
) -> Result<(), ViewError> {
    let eye = EyeControls3D::new()
        .with_kind(Eye3DKind::Orbital)
        .with_position(eye_m)
        .with_look_target(at_m)
        .with_eye_up(up);
    layout.property(view, "EyeControls3D", &eye)?;
    let grid = LineGrid3D::new().with_visible(false);
    layout.property(view, "LineGrid3D", &grid)
}

/// Extent of the agents near the ego at the verdict, relative to the ego.
pub(super) struct ViewExtent {
    /// Least and greatest position along its heading.
    pub ahead_m: (f32, f32),
    /// Least and greatest position to its left.
    pub left_m: (f32, f32),
    /// Excess of the ego's length over a car's.
    pub behind_m: f32,
}

impl ViewExtent {
    /// Greatest distance in metres at which an agent widens the view.
    const FAR_M: f64 = 60.0;
    /// Position in metres from which an agent is invisible to a camera behind the ego.
    const BEHIND_M: f32 = -5.5;
    /// Width of the scene's view per camera distance.
    ///
    /// It assumes 690 × 420 pixels and 55° of vertical field of view.
    const WIDE: f32 = 1.6;
    /// Distance in pixels of a label's middle from a body: half of its height and a gap.
    const LABEL_PX: f32 = 17.0;
    /// Pixels of a metre at a distance of 1 m in the oblique view, 420 pixels high.
    const ASLANT_PX: f32 = 403.0;
    /// Pixels of a metre at a height of 1 m in the view from above, 150 pixels high.
    const ABOVE_PX: f32 = 144.0;

    /// Returns the extent at the sample of the verdict, or at the last sample.
    pub(super) fn of(story: &ViewedEpisode<'_>) -> ViewExtent {
        let mut around = ViewExtent {
            ahead_m: (0.0, 0.0),
            left_m: (0.0, 0.0),
            behind_m: (story.shown.stage.agents[story.ego()].size_m[0] - 4.5) as f32,
        };
        let Some(frame) = decided_frame(story) else {
            return around;
        };
        // The cameras neither pitch nor roll.
        let own = frame.placements[story.ego()].ground_frame();
        for other in &frame.placements {
            let [ahead_m, left_m] = own
                .to_local(Point2::new(other.centre_m[0], other.centre_m[1]))
                .into();
            // A far agent would shrink the encounter to a few pixels.
            if ahead_m.abs() <= ViewExtent::FAR_M && left_m.abs() <= ViewExtent::FAR_M {
                around.ahead_m = grown(around.ahead_m, ahead_m);
                around.left_m = grown(around.left_m, left_m);
            }
        }
        around
    }

    /// Returns the place of a body's label, in the frame of the body.
    ///
    /// The label lies above the roof for the camera behind the ego, and beside the body for
    /// the camera above it, so that it hides the body in neither view. The ego's label is to
    /// its right, and the others' on their side of the ego, or to the left.
    pub(super) fn label_place(&self, story: &ViewedEpisode<'_>, who: usize) -> [f32; 3] {
        let [length_m, width_m, height_m] = story.shown.stage.agents[who].size_m;
        let Some(frame) = decided_frame(story) else {
            return [0.0, 0.0, height_m as f32];
        };
        let own = frame.placements[story.ego()].ground_frame();
        let body = &frame.placements[who];
        let [ahead_m, left_m] = own
            .to_local(Point2::new(body.centre_m[0], body.centre_m[1]))
            .into();
        let (eye_m, _) = self.seen_aslant();
        let place_m = [ahead_m, left_m, height_m].map(|it| it as f32);
        let square = |axis: usize| (place_m[axis] - eye_m[axis]).powi(2);
        let far_m = (square(0) + square(1) + square(2)).sqrt();
        let up_m = ViewExtent::LABEL_PX / ViewExtent::ASLANT_PX * far_m;
        let (above_m, _) = self.seen_from_above();
        let beside_m = ViewExtent::LABEL_PX / ViewExtent::ABOVE_PX * above_m[2];
        // The extent of a turned body across the ego's heading.
        let turned_rad = body.heading_rad() - frame.placements[story.ego()].heading_rad();
        let half_m = 0.5 * (length_m * turned_rad.sin().abs() + width_m * turned_rad.cos().abs());
        // Agents within a metre of the ego's line go to the left, since its
        // own label is on the right.
        let is_right = who == story.ego() || left_m < -1.0;
        let side = if is_right { -1.0 } else { 1.0 };
        let aside_m = side * (half_m + f64::from(beside_m));
        let [x, y] = own.to_world(0.0, aside_m).into();
        let from_ego = [x - own.origin_m.x, y - own.origin_m.y, 0.0];
        let offset_m = body.rotation.inverse() * nalgebra::Vector3::from(from_ego);
        // The only cast from offsets to labels.
        let up_m = 0.5 * height_m as f32 + up_m;
        [offset_m.x as f32, offset_m.y as f32, up_m]
    }

    /// Returns the eye and the target of an oblique camera.
    ///
    /// It looks from behind the ego, or from its right if an agent is behind
    /// it.
    pub(super) fn seen_aslant(&self) -> ([f32; 3], [f32; 3]) {
        let (rear_m, front_m) = self.ahead_m;
        if rear_m >= ViewExtent::BEHIND_M {
            // A long ego would fill the picture, so the camera moves back and
            // up with its length.
            let back_m = self.behind_m.clamp(0.0, 25.0);
            let eye_m = [-10.0 - back_m, 3.6 + 0.2 * back_m, 4.6 + 0.2 * back_m];
            return (eye_m, [3.0, 0.0, 0.4]);
        }
        // All agents from the nearest behind to the nearest ahead fit. The
        // limits keep the ego large enough.
        let (rear_m, front_m) = (rear_m.max(-26.0), front_m.min(26.0));
        let far_m = ((front_m - rear_m + 9.0) / ViewExtent::WIDE).clamp(14.0, 27.0);
        let middle_m = 0.5 * (rear_m + front_m);
        // The target is never so far ahead or behind that the ego leaves the
        // picture.
        let reach_m = (0.5 * ViewExtent::WIDE * far_m - 5.0).max(0.0);
        let at_m = [middle_m.clamp(-reach_m, reach_m), 0.0, 0.4];
        let eye_m = [at_m[0] - 0.22 * far_m, -0.8 * far_m, 0.55 * far_m];
        (eye_m, at_m)
    }

    /// Returns the eye and the target of a camera above the scene.
    pub(super) fn seen_from_above(&self) -> ([f32; 3], [f32; 3]) {
        let ((rear_m, front_m), (right_m, left_m)) = (self.ahead_m, self.left_m);
        // The view shows about 4.8 times the camera's height along the road,
        // and once across it.
        let height_m = ((front_m - rear_m + 16.0) / 4.8).max(left_m - right_m + 4.0);
        let ahead_m = if height_m <= 9.0 {
            // Most events happen ahead of the ego.
            3.0_f32.min(9.0 + rear_m).max(front_m - 12.0)
        } else {
            0.5 * (rear_m + front_m)
        };
        let aside_m = 0.5 * (right_m + left_m);
        // A small lateral offset: a camera exactly above its target has no
        // defined up.
        let eye_m = [ahead_m, aside_m - 0.01, height_m.max(9.0)];
        (eye_m, [ahead_m, aside_m, 0.0])
    }
}

/// Frame of the sample of the verdict, or of the last sample.
fn decided_frame<'a>(story: &'a ViewedEpisode<'_>) -> Option<&'a Frame> {
    let last = story.samples().saturating_sub(1);
    let at = story.shown.decided.map_or(last, |decided| decided.sample);
    story.shown.at_sample(at)
}

fn grown(extent_m: (f32, f32), by_m: f64) -> (f32, f32) {
    // The only cast from places to cameras.
    (extent_m.0.min(by_m as f32), extent_m.1.max(by_m as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixel position of a place in the scene's view, and pixels per metre there.
    fn seen(([eye, at], place): ([[f32; 3]; 2], [f32; 3])) -> ([f32; 2], f32) {
        let minus = |a: [f32; 3], b: [f32; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: [f32; 3], b: [f32; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let unit = |a: [f32; 3]| a.map(|it| it / dot(a, a).sqrt());
        let ahead = unit(minus(at, eye));
        let right = unit(cross(ahead, [0.0, 0.0, 1.0]));
        let up = cross(right, ahead);
        let from_eye = minus(place, eye);
        let far = dot(from_eye, ahead);
        let px = 210.0 / (27.5_f32.to_radians().tan() * far);
        ([dot(from_eye, right) * px, dot(from_eye, up) * px], px)
    }

    #[test]
    fn everybody_is_in_the_picture_and_the_ego_is_large_enough() {
        let car = (4.5_f32, 1.8_f32);
        let cases = [
            (0.0, 5.0),
            (0.0, 40.0),
            (-4.6, 0.0),
            (-12.0, 5.0),
            (-17.0, 8.0),
            (-20.0, 12.0),
        ];
        for (rear_m, front_m) in cases {
            let around = ViewExtent {
                ahead_m: (rear_m, front_m),
                left_m: (-3.5, 3.5),
                behind_m: 0.0,
            };
            let (eye_m, at_m) = around.seen_aslant();
            let camera = [eye_m, at_m];
            for (x, y) in [
                (rear_m, 3.5),
                (rear_m, -3.5),
                (front_m, 3.5),
                (front_m, -3.5),
                (0.0, 0.0),
            ] {
                let ([across, up], _) = seen((camera, [x, y, 0.7]));
                assert!(
                    across.abs() <= 345.0 && up.abs() <= 210.0,
                    "{x}, {y}: {across}, {up}"
                );
            }
            let corners = [(0.5, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5, -0.5)]
                .map(|(x, y)| seen((camera, [x * car.0, y * car.1, 0.0])).0[0]);
            let most = corners.iter().copied().fold(f32::MIN, f32::max);
            let least = corners.iter().copied().fold(f32::MAX, f32::min);
            assert!(most - least >= 60.0, "{} px", most - least);
        }
    }
}
