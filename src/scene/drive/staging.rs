//! What of a driving scene does not move, for viewers.

use super::layout::Layout;
use super::spec::Drive;
use crate::scene::{Cast, LightPost, Role, Stage};

/// The cast, the lanes and the lights.
pub(super) fn stage(layout: &Layout) -> Stage {
    let spec = &layout.spec;
    let cast = spec.agents.iter().map(|agent| Cast {
        name: agent.name.clone(),
        role: match agent.drive {
            Drive::Ego => Role::Ego,
            Drive::Ado { .. } => Role::Ado,
            Drive::Trained(_) | Drive::Scripted(_) | Drive::Planned(_) => Role::Scripted,
        },
        body: agent.body.name.clone(),
        size_m: [agent.body.length_m, agent.body.width_m, agent.body.height_m],
        colour: agent.body.color_rgb,
        on_foot: agent.body.is_on_foot(),
    });
    let borders = spec.road.borders_m();
    let lights = spec.lights.iter().map(|light| {
        let (right_m, left_m) = (
            -0.5 * spec.road.lane_width_m(),
            (spec.road.lanes() as f64 - 0.5) * spec.road.lane_width_m(),
        );
        let point = |lateral_m: f64| {
            let pose = layout.network.main().pose(light.line_m, lateral_m);
            [pose.x_m, pose.y_m, 0.0]
        };
        LightPost {
            name: light.name.clone(),
            stop_line_m: [point(right_m), point(left_m)],
        }
    });
    let named = spec.roads.values().zip(&layout.network.courses()[1..]);
    let side_roads = named.map(|(placed, course)| {
        let borders = placed.road.borders_m();
        borders
            .map(|lateral_m| course.polyline_m(lateral_m))
            .collect()
    });
    Stage {
        cast: cast.collect(),
        lane_borders_m: borders
            .map(|lateral_m| layout.network.main().polyline_m(lateral_m))
            .collect(),
        side_roads_m: side_roads.collect(),
        lights: lights.collect(),
    }
}
