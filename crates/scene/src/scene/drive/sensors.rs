//! Sensors of the ego, which delay and disturb its percepts.

use std::collections::VecDeque;

use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ego::Percept;
use crate::seed;

/// Errors of the ego's sensors. The default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "FixedSensors")]
pub struct Sensors {
    /// Delay of percepts of other agents, a multiple of the sample.
    pub delay_s: f64,
    /// Standard deviation of headways and lateral offsets.
    pub position_sd_m: f64,
    /// Standard deviation of other agents' speeds, along and across the road.
    pub speed_sd_mps: f64,
    /// Distance from the ego's front beyond which it perceives no road user.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_m: Option<f64>,
    /// True if vehicles hide the agents behind them.
    #[serde(skip_serializing_if = "is_off")]
    pub line_of_sight: bool,
}

fn is_off(it: &bool) -> bool {
    !it
}

impl Sensors {
    /// Returns whether equal starts and actions can give different episodes.
    pub fn is_noisy(&self) -> bool {
        self.position_sd_m > 0.0 || self.speed_sd_mps > 0.0
    }
}

/// Sensors in motion.
#[derive(Clone, Debug)]
pub struct Sensing {
    spec: Sensors,
    delay: usize,
    seen: VecDeque<Percept>,
    dice: ChaCha8Rng,
}

impl Sensing {
    /// Creates sensors that have perceived nothing yet.
    pub fn new(spec: Sensors, sample_s: f64) -> Sensing {
        Sensing {
            spec,
            delay: (spec.delay_s / sample_s).round() as usize,
            seen: VecDeque::new(),
            dice: seed::generator("sensors", &[]),
        }
    }

    /// Begins an episode with the seed `noise`.
    pub fn reset(&mut self, noise: u64) {
        self.seen.clear();
        self.dice = seed::generator("sensors", &[noise]);
    }

    /// Converts an ideal percept to the ego's percept.
    ///
    /// Its own state stays exact. Until the delay has passed, it sees the first
    /// sample. `noise_scale` is a factor on all standard deviations.
    pub fn look(&mut self, percept: &mut Percept, noise_scale: f64) {
        if self.delay > 0 {
            self.seen.push_back(percept.clone());
            // Until the delay has passed, the first percept stands for the
            // older ones.
            let old = if self.delay < self.seen.len() {
                self.seen.pop_front()
            } else {
                self.seen.front().cloned()
            };
            if let Some(old) = old {
                percept.others = old.others;
                percept.lights = old.lights;
            }
        }
        if !self.spec.is_noisy() {
            return;
        }
        let position_sd_m = noise_scale * self.spec.position_sd_m;
        let speed_sd_mps = noise_scale * self.spec.speed_sd_mps;
        for seen in &mut percept.others {
            // The same error in both frames: road and ego coordinates describe
            // a single measurement.
            let (along, across) = seed::normal_pair(&mut self.dice);
            seen.headway_m += position_sd_m * along;
            seen.lateral_m += position_sd_m * across;
            seen.x_m += position_sd_m * along;
            seen.y_m += position_sd_m * across;
            let (along, across) = seed::normal_pair(&mut self.dice);
            seen.speed_mps += speed_sd_mps * along;
            seen.lateral_mps += speed_sd_mps * across;
            seen.vx_mps += speed_sd_mps * along;
            seen.vy_mps += speed_sd_mps * across;
        }
    }
}
