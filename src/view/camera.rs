//! Where the cameras of the spatial views stand, and what they show.

use rerun::blueprint::components::Eye3DKind;
use rerun::external::re_sdk_types::blueprint::archetypes::{EyeControls3D, LineGrid3D};

use super::error::ViewError;
use super::layout::{Layout, Node};
use super::story::Story;

/// The entity whose frame the cameras stand in.
pub(super) const FOLLOW: &str = "/follow";

/// What the spatial views show.
pub(super) const SPACE: [&str; 4] = [
    "+ /world/**",
    "+ /trails/**",
    "+ /contact/**",
    "+ /verdict/mark",
];

/// Places the camera of a view in the frame that follows the ego.
pub(super) fn look(
    layout: &mut Layout<'_>,
    view: &Node,
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

/// Who is near the ego when it matters: least and greatest places, seen from it.
pub(super) struct Around {
    /// Along its heading.
    pub ahead_m: (f32, f32),
    /// To its left.
    pub left_m: (f32, f32),
    /// By how much its rear is farther back than a car's.
    pub behind_m: f32,
}

impl Around {
    /// Beyond this nobody is worth a look from farther away.
    const FAR_M: f64 = 60.0;

    /// At the sample of the verdict, or at the last one.
    pub fn of(story: &Story<'_>) -> Around {
        let mut around = Around {
            ahead_m: (0.0, 0.0),
            left_m: (0.0, 0.0),
            behind_m: (story.stage.cast[story.ego()].size_m[0] - 4.5) as f32,
        };
        let last = story.frames.len().saturating_sub(1);
        let Some(frame) = story.frames.get(story.decided.unwrap_or(last)) else {
            return around;
        };
        let ego = frame.placements[story.ego()];
        let [_, _, turn, real] = ego.rotation;
        let (sin, cos) = (2.0 * turn.atan2(real)).sin_cos();
        for other in &frame.placements {
            let [dx, dy] = [0, 1].map(|axis| other.centre_m[axis] - ego.centre_m[axis]);
            let (ahead_m, left_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
            if ahead_m.abs() <= Around::FAR_M && left_m.abs() <= Around::FAR_M {
                around.ahead_m = grown(around.ahead_m, ahead_m);
                around.left_m = grown(around.left_m, left_m);
            }
        }
        around
    }

    /// A camera that sees all of them from above, and what it looks at.
    pub fn seen_from_above(&self) -> ([f32; 3], [f32; 3]) {
        let ((rear_m, front_m), (right_m, left_m)) = (self.ahead_m, self.left_m);
        // The view shows about 4.8 times the camera's height along, once across.
        let height_m = ((front_m - rear_m + 16.0) / 4.8).max(left_m - right_m + 4.0);
        let ahead_m = match height_m <= 9.0 {
            // Most happens ahead.
            true => 3.0_f32.min(9.0 + rear_m).max(front_m - 12.0),
            false => 0.5 * (rear_m + front_m),
        };
        let aside_m = 0.5 * (right_m + left_m);
        let eye_m = [ahead_m, aside_m - 0.01, height_m.max(9.0)];
        (eye_m, [ahead_m, aside_m, 0.0])
    }
}

fn grown((least, greatest): (f32, f32), by: f64) -> (f32, f32) {
    // The one cast from places to cameras.
    (least.min(by as f32), greatest.max(by as f32))
}
