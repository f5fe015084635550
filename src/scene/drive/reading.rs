//! What a moving scene publishes: values for the signals of the catalogue.

use super::course::OnRoad;
use super::motion::DriveScene;
use super::signals::{Between, Field, Lamp, Source, TTC_CAP_S};
use crate::ego::Phase;
use crate::sim::BodyState;

impl DriveScene {
    /// The value of a published signal now.
    pub(super) fn value(&self, source: Source) -> f64 {
        let time_s = self.time_s();
        match source {
            Source::Time => time_s,
            Source::TimeLeft => (self.layout.spec.clock.horizon_s - time_s).max(0.0),
            Source::Contact => truth(self.touch.is_some()),
            Source::Agent(agent, field) => self.agent_value(agent, field),
            Source::Pair(a, b, between) => self.pair_value(a, b, between),
            Source::Light(light, lamp) => self.lamp_value(light, lamp),
            Source::Line(agent, light) => self.line_m(agent, light),
        }
    }

    fn agent_value(&self, agent: usize, field: Field) -> f64 {
        let (state, at) = (&self.states[agent], &self.on_road[agent]);
        match field {
            Field::X => state.pose.x_m,
            Field::Y => state.pose.y_m,
            Field::S => at.s_m,
            Field::Lateral => at.lateral_m,
            Field::Heading => state.pose.heading_rad,
            Field::Speed => state.speed_mps,
            Field::Accel => state.accel_mps2,
            Field::LateralSpeed => road_velocity(state, at).1,
            Field::Lane => self.layout.spec.road.lane_at(at.lateral_m) as f64,
            Field::YawRate => state.yaw_rate_rad_per_s,
        }
    }

    fn pair_value(&self, a: usize, b: usize, between: Between) -> f64 {
        let (from, to) = (&self.on_road[a], &self.on_road[b]);
        match between {
            Between::Headway => to.s_m - from.s_m,
            Between::Lateral => to.lateral_m - from.lateral_m,
            Between::Distance => {
                let (from, to) = (&self.states[a].pose, &self.states[b].pose);
                let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
                (dx * dx + dy * dy).sqrt()
            }
            Between::Gap => self.plant.gap_m(self.bodies[a], self.bodies[b]),
            Between::Ttc => self.time_to_collision_s(a, b),
            Between::Contact => {
                let pair = (self.bodies[a.min(b)], self.bodies[a.max(b)]);
                truth(self.touch.is_some_and(|contact| contact.pair == pair))
            }
        }
    }

    /// Clearance along the road over closing speed; the cap when not closing.
    fn time_to_collision_s(&self, a: usize, b: usize) -> f64 {
        let (from, to) = (&self.on_road[a], &self.on_road[b]);
        let ahead = to.s_m - from.s_m;
        let front = if 0.0 < ahead { b } else { a };
        let clearance_m = ahead.abs() - self.layout.spec.agents[front].body.length_m;
        let closing_mps = (self.velocity_mps(a).0 - self.velocity_mps(b).0) * ahead.signum();
        if closing_mps <= 0.0 {
            return TTC_CAP_S;
        }
        (clearance_m.max(0.0) / closing_mps).min(TTC_CAP_S)
    }

    fn lamp_value(&self, light: usize, lamp: Lamp) -> f64 {
        let shown = &self.lights[light];
        match lamp {
            Lamp::Green => truth(shown.phase == Phase::Green),
            Lamp::Yellow => truth(shown.phase == Phase::Yellow),
            Lamp::Red => truth(shown.phase == Phase::Red),
            Lamp::Phase => match shown.phase {
                Phase::Green => 0.0,
                Phase::Yellow => 1.0,
                Phase::Red => 2.0,
            },
            Lamp::PhaseTime => self.phase_s(light),
        }
    }

    /// For how long a light has been in its phase.
    pub(super) fn phase_s(&self, light: usize) -> f64 {
        (self.sample - self.lights[light].since) as f64 * self.layout.spec.clock.sample_s
    }

    /// From an agent's front to a stop line along the road; positive before it.
    pub(super) fn line_m(&self, agent: usize, light: usize) -> f64 {
        self.layout.spec.lights[light].line_m - self.on_road[agent].s_m
    }

    /// Velocity of an agent along and across the road.
    pub(super) fn velocity_mps(&self, agent: usize) -> (f64, f64) {
        road_velocity(&self.states[agent], &self.on_road[agent])
    }
}

/// A row as an observation: positions, middles and scales.
pub(super) fn scaled(row: &[f64], observed: &[(usize, f64, f64)], obs: &mut [f32]) {
    for (value, &(position, mid, per_half)) in obs.iter_mut().zip(observed) {
        // The one cast from signals to observations.
        *value = ((row[position] - mid) * per_half) as f32;
    }
}

fn truth(value: bool) -> f64 {
    f64::from(u8::from(value))
}

fn road_velocity(state: &BodyState, at: &OnRoad) -> (f64, f64) {
    let (sin, cos) = libm::sincos(at.heading_rad);
    (
        state.speed_mps * cos - state.lateral_mps * sin,
        state.speed_mps * sin + state.lateral_mps * cos,
    )
}
