//! Static content of a driving scene, for viewers.

use super::layout::DriveLayout;
use super::range::Range;
use super::spec::{Drive, DriveSpec, StartPlace};
use super::surface::{polyline_m, reach_m};
use crate::road::Road;
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
                polyline_m(course, &profile, lateral_m, used_m(layout, 0))
            })
            .collect(),
        side_roads_m: side_roads.collect(),
        lights: lights.collect(),
    }
}

/// Returns the used part of a road: its starts, crossings and stop lines.
///
/// On the world's own road it goes on as far as a body may drive.
fn used_m(layout: &DriveLayout, road: usize) -> (f64, f64) {
    let spec = &layout.spec;
    let starts_m = starts_m(spec);
    let on_it = (0..spec.agents.len()).filter(|i| spec.agents[*i].road == road);
    let places = on_it.flat_map(|i| {
        let others = 0..spec.agents.len();
        let crossings = others.flat_map(move |other| layout.network.crossings(i, other));
        let Range { lo, hi } = starts_m[i];
        [lo, hi].into_iter().chain(crossings.map(|it| it.s_m))
    });
    let lines = spec.lights_of(road).map(|(_, light)| light.line_m);
    let (from_m, to_m) = places.chain(lines).fold((0.0, 0.0), |(from_m, to_m), it| {
        (f64::min(from_m, it), f64::max(to_m, it))
    });
    // A road of a map ends where the map does, and an ado lays its road piece by piece.
    let goes_on = road == 0
        && spec.road_ado.is_none()
        && matches!(spec.road, Road::Straight { .. } | Road::Curved { .. });
    let beyond_m = if goes_on { reach_m(spec) } else { 0.0 };
    (from_m, to_m + beyond_m)
}

/// Returns where along its road each agent may start, in file order.
fn starts_m(spec: &DriveSpec) -> Vec<Range> {
    let mut starts_m: Vec<Range> = Vec::with_capacity(spec.agents.len());
    for agent in &spec.agents {
        let start_m = match agent.place {
            StartPlace::At { x_m, .. } => x_m,
            // The agent ahead precedes in file order, which loading ensures.
            StartPlace::Ahead { of, headway_m, .. } => Range {
                lo: starts_m[of].lo + headway_m.lo,
                hi: starts_m[of].hi + headway_m.hi,
            },
        };
        starts_m.push(start_m);
    }
    starts_m
}
