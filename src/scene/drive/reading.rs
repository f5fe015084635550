//! What signals and percepts read off a moving scene, and rows as observations.

use super::motion::DriveScene;

impl DriveScene {
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
        let (state, at) = (&self.states[agent], &self.on_road[agent]);
        let (sin, cos) = libm::sincos(at.heading_rad);
        (
            state.speed_mps * cos - state.lateral_mps * sin,
            state.speed_mps * sin + state.lateral_mps * cos,
        )
    }
}

/// A row as an observation: positions, middles and scales.
pub(super) fn scaled(row: &[f64], observed: &[(usize, f64, f64)], obs: &mut [f32]) {
    for (value, &(position, mid, per_half)) in obs.iter_mut().zip(observed) {
        // The one cast from signals to observations.
        *value = ((row[position] - mid) * per_half) as f32;
    }
}
