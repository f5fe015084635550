//! What the ego and scripted followers see of a moving scene.

use super::motion::DriveScene;
use crate::ego::{Own, Percept, Phase, Seen, SeenLight};

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
                    headway_m: 0.0,
                    lateral_m: 0.0,
                    speed_mps: 0.0,
                    lateral_mps: 0.0,
                    lane: 0,
                    length_m: agent.body.length_m,
                    width_m: agent.body.width_m,
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
