//! Conformance check of a controller.

use super::recorded::{StepNumbers, Subject, examine};
use super::{Nonconformities, Promise};
use crate::ego::{Briefing, Controller, Own, Percept, Phase, RoadGeometry, Seen, SeenLight};

/// Samples of an episode, 6 s in total.
const SAMPLES: usize = 120;
const SAMPLE_S: f64 = 0.05;

/// Checks the promises of a controller.
///
/// Its commands must be finite and within the limits of cars. It must forget at
/// `reset`, depend on its seed only, and copy itself in `fork`. `make` must
/// return an unused controller. The percepts contain a braking leader, a car
/// beside the ego, a changing light and a crossing pedestrian.
///
/// # Errors
/// The broken promises, each with the first step that shows it.
pub fn check_controller(
    make: &(dyn Fn() -> Box<dyn Controller> + Sync),
) -> Result<(), Nonconformities> {
    examine(|| {
        let mut controller = make();
        // The trait promises a briefing before the first episode.
        controller.brief(&Briefing {
            sample_s: SAMPLE_S,
            lag_s: 0.1,
            speed_limit_mps: Some(25.0),
            road: RoadGeometry {
                lanes: 2,
                lane_width_m: 3.5,
                pieces: Vec::new(),
            },
            ..Briefing::default()
        });
        Driven {
            controller,
            fault: None,
        }
    })
}

struct Driven {
    controller: Box<dyn Controller>,
    fault: Option<(Promise, String)>,
}

impl Driven {
    fn answer(&mut self, episode: u64, step: usize) -> StepNumbers {
        let answer = self.controller.control(&percept(episode, step));
        let flaw = answer.as_ref().ok().and_then(|command| command.flaw());
        self.fault = match (&answer, flaw) {
            (Err(fault), _) => Some((Promise::Finite, format!("answers with a fault: {fault}"))),
            // An infinite acceleration is reported as `Finite` by the check of
            // numbers.
            (Ok(command), Some(flaw)) if command.accel_mps2.is_finite() => {
                Some((Promise::Spaces, flaw.to_string()))
            }
            _ => None,
        };
        // `fault` reports the failure, and zeros let the comparison of runs go on.
        let command = answer.unwrap_or_default();
        vec![command.accel_mps2, command.lateral_mps]
    }
}

impl Subject for Driven {
    fn names(&self) -> Vec<String> {
        ["accel_mps2", "lateral_mps"].map(str::to_owned).into()
    }

    fn begin(&mut self, episode: u64) -> StepNumbers {
        // An arbitrary offset, so that no episode has the seed 0.
        self.controller.reset(17 + episode);
        self.answer(episode, 0)
    }

    fn step(&mut self, episode: u64, step: usize) -> Option<StepNumbers> {
        if step >= SAMPLES {
            // Programs wait for the next sample until the episode is finished.
            self.controller.finish();
            return None;
        }
        Some(self.answer(episode, step))
    }

    fn fault(&self) -> Option<(Promise, String)> {
        self.fault.clone()
    }

    fn fork(&self) -> Option<Self> {
        Some(Driven {
            controller: self.controller.fork()?,
            fault: None,
        })
    }
}

/// Returns the percept of a step, independent of the commands.
///
/// Distances shrink with time, so that every reaction is triggered.
fn percept(episode: u64, step: usize) -> Percept {
    let time_s = step as f64 * SAMPLE_S;
    let speed_mps = 18.0 - time_s;
    let seen = |name: &str, headway_m: f64, lateral_m: f64, speed_mps: f64| Seen {
        name: name.to_owned(),
        headway_m,
        lateral_m,
        speed_mps,
        // The marking between lanes of 3.5 m is at 1.75 m, so 2 m is in the left lane.
        lane: usize::from(lateral_m > 2.0),
        x_m: headway_m,
        y_m: lateral_m,
        vx_mps: speed_mps,
        length_m: 4.6,
        width_m: 1.8,
        ..Seen::default()
    };
    let crossing = Seen {
        lateral_mps: 1.4,
        vy_mps: 1.4,
        length_m: 0.5,
        width_m: 0.5,
        ..seen("walker", 70.0 - 9.0 * time_s, -6.0 + 1.4 * time_s, 0.0)
    };
    let beside = seen("beside", 2.0 - time_s, 3.5 - 0.4 * time_s, 17.0);
    let ahead = seen("ahead", 40.0 - 4.0 * time_s, 0.0, 14.0 - time_s);
    Percept {
        time_s,
        sample_s: SAMPLE_S,
        own: Own {
            speed_mps,
            accel_mps2: -1.0,
            s_m: 18.0 * time_s,
            length_m: 4.6,
            width_m: 1.8,
            ..Own::default()
        },
        // The second episode has other agents, because a memory of equal ones would
        // change no command.
        others: match episode {
            0 => vec![ahead, beside],
            _ => vec![beside, crossing],
        },
        lights: vec![SeenLight {
            name: "light".to_owned(),
            line_m: 90.0 - 15.0 * time_s,
            // Each phase has a third of the 120 samples, so all of them occur.
            phase: [Phase::Green, Phase::Yellow, Phase::Red][step / 40 % 3],
            phase_s: (step % 40) as f64 * SAMPLE_S,
        }],
    }
}
