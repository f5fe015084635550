//! Static content of a driving scene, for viewers.

use super::layout::DriveLayout;
use super::spec::{Drive, StartPlace};
use super::surface::polyline_m;
use crate::scene::{AgentDescription, LightPost, Role, SceneGeometry};

/// Returns the cast, the lanes and the lights.
pub(super) fn stage(layout: &DriveLayout) -> SceneGeometry {
    let spec = &layout.spec;
    let agents = spec.agents.iter().map(|agent| {
        let role = match agent.drive {
            Drive::Ego => Role::Ego,
            Drive::Ado { .. } => Role::Ado,
            // A frozen ado no longer learns and is shown as traffic.
            Drive::Trained(_) | Drive::Scripted(_) | Drive::Planned(_) => Role::Scripted,
        };
        AgentDescription::of(&agent.name, role, &agent.body)
    });
    let borders = spec.road.borders_m();
    let lights = spec.lights.iter().map(|light| {
        let road = spec.road_at(light.road);
        let (right_m, left_m) = (
            -0.5 * road.lane_width_m(),
            (road.lanes() as f64 - 0.5) * road.lane_width_m(),
        );
        let point = |lateral_m: f64| {
            let pose = layout.network.courses()[light.road].pose(light.line_m, lateral_m);
            let profile = spec.profile_of(light.road);
            [
                pose.x_m,
                pose.y_m,
                profile.height_m(light.line_m, lateral_m),
            ]
        };
        LightPost {
            name: light.name.clone(),
            stop_line_m: [point(right_m), point(left_m)],
        }
    });
    // The first course is the world's own road.
    let named = spec.roads.values().zip(&layout.network.courses()[1..]);
    let side_roads = named.zip(1..).map(|((placed, course), road)| {
        let reach_m = used_m(layout, road);
        let borders = placed.road.borders_m();
        borders
            .map(|lateral_m| polyline_m(course, &placed.profile(), lateral_m, reach_m))
            .collect()
    });
    SceneGeometry {
        agents: agents.collect(),
        lane_borders_m: borders
            .map(|lateral_m| {
                let (course, profile) = (layout.network.main(), spec.profile_of(0));
                polyline_m(course, &profile, lateral_m, (0.0, 0.0))
            })
            .collect(),
        side_roads_m: side_roads.collect(),
        lights: lights.collect(),
    }
}

/// Returns the used part of a named road: its starts, crossings and stop lines.
fn used_m(layout: &DriveLayout, road: usize) -> (f64, f64) {
    let agents = layout.spec.agents.iter().enumerate();
    let on_it = agents.filter(|(_, agent)| agent.road == road);
    let places = on_it.flat_map(|(i, agent)| {
        let starts = match agent.place {
            StartPlace::At { x_m, .. } => vec![x_m.lo, x_m.hi],
            // A relative start has no fixed place on the road.
            StartPlace::Ahead { .. } => Vec::new(),
        };
        let others = 0..layout.spec.agents.len();
        let crossings = others.flat_map(move |other| layout.network.crossings(i, other));
        starts.into_iter().chain(crossings.map(|it| it.s_m))
    });
    let lines = layout.spec.lights_of(road).map(|(_, light)| light.line_m);
    places.chain(lines).fold((0.0, 0.0), |(from_m, to_m), it| {
        (f64::min(from_m, it), f64::max(to_m, it))
    })
}
