//! Ideal percepts of the ego, before its sensors.

use core::f64::consts::{PI, TAU};

use nalgebra::Vector2;

use super::line_of_sight;
use super::spec::DriveSpec;
use super::state::SceneState;
use crate::ego::{Own, Percept, Phase, Seen, SeenLight};
use crate::sim::{BodyState, rotation_by};

/// Returns a percept with all other agents named, to be filled per sample.
pub fn blank(spec: &DriveSpec, ego: usize) -> Percept {
    let others = spec.agents.iter().enumerate().filter(|&(i, _)| i != ego);
    Percept {
        others: others
            .map(|(_, agent)| Seen {
                name: agent.name.clone(),
                length_m: agent.body.length_m,
                width_m: agent.body.width_m,
                ..Seen::default()
            })
            .collect(),
        lights: spec
            .lights_of(spec.agents[ego].road)
            .map(|(_, light)| SeenLight {
                name: light.name.clone(),
                line_m: 0.0,
                phase: Phase::Green,
                phase_s: 0.0,
            })
            .collect(),
        ..Percept::default()
    }
}

/// Fills a percept with everything the ego could see at this sample.
pub fn fill(percept: &mut Percept, scene: &SceneState, ego: usize) {
    let spec = &scene.spec;
    let (state, at) = (&scene.states[ego], &scene.on_road[ego]);
    let body = &spec.agents[ego].body;
    percept.time_s = scene.time_s();
    percept.sample_s = spec.clock.sample_s;
    percept.own = Own {
        speed_mps: state.speed_mps,
        accel_mps2: state.accel_mps2,
        s_m: at.s_m,
        lateral_m: at.lateral_m,
        lane: spec.road.lane_at(at.lateral_m),
        heading_rad: at.heading_rad,
        lateral_mps: state.lateral_mps,
        yaw_rate_rad_per_s: state.yaw_rate_rad_per_s,
        length_m: body.length_m,
        width_m: body.width_m,
    };
    let others = (0..spec.agents.len()).filter(|&i| i != ego);
    let visible = line_of_sight::perceived(scene, ego);
    if visible.is_some() {
        // An agent that was hidden in the last sample may be visible again.
        percept.others = blank(spec, ego).others;
    }
    for (seen, i) in percept.others.iter_mut().zip(others.clone()) {
        let other = scene.on_road_of(ego, i);
        let velocity_mps =
            other.velocity_mps(scene.states[i].speed_mps, scene.states[i].lateral_mps);
        seen.headway_m = other.s_m - at.s_m;
        seen.lateral_m = other.lateral_m - at.lateral_m;
        seen.speed_mps = velocity_mps.x;
        seen.lateral_mps = velocity_mps.y;
        seen.lane = spec.road.lane_at(other.lateral_m);
        seen.road_heading_rad = other.heading_rad;
        seen.yaw_rate_rad_per_s = scene.states[i].yaw_rate_rad_per_s;
        in_ego_frame(seen, state, &scene.states[i]);
    }
    if let Some(visible) = visible {
        // Filtered last: the agents above are matched by position, which gaps
        // would shift.
        let mut sees = others.map(|i| visible[i]);
        percept.others.retain(|_| sees.next().unwrap_or(true));
    }
    // Lights of other roads do not hold for the ego.
    let lights = spec.lights_of(spec.agents[ego].road);
    for (seen, (i, _)) in percept.lights.iter_mut().zip(lights) {
        seen.line_m = scene.line_m(ego, i);
        seen.phase = scene.lights[i].phase;
        seen.phase_s = scene.phase_s(i);
    }
}

/// Fills in the pose and motion of a body, seen from the ego's front.
fn in_ego_frame(seen: &mut Seen, ego: &BodyState, other: &BodyState) {
    [seen.x_m, seen.y_m] = ego.pose.frame().to_local(other.pose.point_m()).into();
    let turned_rad = other.pose.heading_rad - ego.pose.heading_rad;
    // Within half a turn the remainder is the angle itself, so most need no
    // call.
    seen.heading_rad = if turned_rad.abs() <= PI {
        turned_rad
    } else {
        libm::remainder(turned_rad, TAU)
    };
    let turned = rotation_by(turned_rad);
    let velocity_mps = Vector2::new(other.speed_mps, other.lateral_mps);
    [seen.vx_mps, seen.vy_mps] = (turned * velocity_mps).into();
    // The plant knows the acceleration along the heading only.
    seen.ax_mps2 = other.accel_mps2 * turned.re;
    seen.ay_mps2 = other.accel_mps2 * turned.im;
}
