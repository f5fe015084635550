//! What the ego and scripted followers see of a moving scene.

use core::f64::consts::{PI, TAU};

use super::motion::DriveScene;
use crate::ego::{Own, Percept, Phase, Seen, SeenLight};
use crate::sim::BodyState;

impl DriveScene {
    /// A percept with everybody named, to be filled sample by sample.
    pub(super) fn blank_percept(&self) -> Percept {
        let spec = &self.layout.spec;
        let others = spec.agents.iter().enumerate();
        let others = others.filter(|&(i, _)| i != self.layout.ego);
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
                .lights
                .iter()
                .map(|light| SeenLight {
                    name: light.name.clone(),
                    line_m: 0.0,
                    phase: Phase::Green,
                    phase_s: 0.0,
                })
                .collect(),
            ..Percept::default()
        }
    }

    /// What the ego sees now, through its sensors.
    pub(super) fn perceive(&mut self) {
        let mut percept = std::mem::take(&mut self.percept);
        self.fill(&mut percept);
        self.sensing.look(&mut percept);
        self.percept = percept;
    }

    fn fill(&self, percept: &mut Percept) {
        let spec = &self.layout.spec;
        let ego = self.layout.ego;
        let (state, at) = (&self.states[ego], &self.on_road[ego]);
        let body = &spec.agents[ego].body;
        percept.time_s = self.time_s();
        percept.sample_s = spec.clock.sample_s;
        percept.own = Own {
            speed_mps: state.speed_mps,
            accel_mps2: state.accel_mps2,
            s_m: at.s_m,
            lateral_m: at.lateral_m,
            lane: spec.road.lane_at(at.lateral_m),
            heading_rad: at.heading_rad,
            length_m: body.length_m,
            width_m: body.width_m,
        };
        let others = (0..spec.agents.len()).filter(|&i| i != ego);
        for (seen, i) in percept.others.iter_mut().zip(others) {
            let other = &self.on_road[i];
            let (along, across) = self.velocity_mps(i);
            seen.headway_m = other.s_m - at.s_m;
            seen.lateral_m = other.lateral_m - at.lateral_m;
            seen.speed_mps = along;
            seen.lateral_mps = across;
            seen.lane = spec.road.lane_at(other.lateral_m);
            in_ego_frame(seen, state, &self.states[i]);
        }
        for (i, seen) in percept.lights.iter_mut().enumerate() {
            seen.line_m = self.line_m(ego, i);
            seen.phase = self.lights[i].phase;
            seen.phase_s = self.phase_s(i);
        }
    }

    /// Clearance to and speed of the next one ahead in an agent's path.
    pub(super) fn leader_of(&self, agent: usize) -> Option<(f64, f64)> {
        let agents = &self.layout.spec.agents;
        let own = &self.on_road[agent];
        let ahead = (0..agents.len()).filter_map(|i| {
            let other = &self.on_road[i];
            let headway_m = other.s_m - own.s_m;
            let half_m = 0.5 * (agents[i].body.width_m + agents[agent].body.width_m);
            let beside = half_m <= (other.lateral_m - own.lateral_m).abs();
            (0.0 < headway_m && !beside).then_some((i, headway_m))
        });
        let nearest = ahead.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(i, headway_m)| {
            let clearance_m = headway_m - agents[i].body.length_m;
            (clearance_m, self.velocity_mps(i).0)
        })
    }
}

/// Fills in where another body is and how it moves, seen from the ego's front.
fn in_ego_frame(seen: &mut Seen, ego: &BodyState, other: &BodyState) {
    let (sin, cos) = libm::sincos(ego.pose.heading_rad);
    let (dx_m, dy_m) = (other.pose.x_m - ego.pose.x_m, other.pose.y_m - ego.pose.y_m);
    seen.x_m = dx_m * cos + dy_m * sin;
    seen.y_m = dy_m * cos - dx_m * sin;
    let turned_rad = other.pose.heading_rad - ego.pose.heading_rad;
    seen.heading_rad = match turned_rad.abs() <= PI {
        true => turned_rad,
        false => libm::remainder(turned_rad, TAU),
    };
    let (sin, cos) = libm::sincos(turned_rad);
    seen.vx_mps = other.speed_mps * cos - other.lateral_mps * sin;
    seen.vy_mps = other.speed_mps * sin + other.lateral_mps * cos;
    seen.ax_mps2 = other.accel_mps2 * cos;
    seen.ay_mps2 = other.accel_mps2 * sin;
}
