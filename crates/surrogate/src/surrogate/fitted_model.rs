//! Stock controller with fitted parameters, and its motion in an episode.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::ego::{Actuated, Actuator, Briefing, Controller, ControllerSpec, Percept};

/// Number of stock controllers among the inputs of a surrogate.
pub(super) const MODELS: usize = 3;
/// Unexplained share below which networks learn only the residual.
const CLOSE: f64 = 0.25;
/// Largest change of acceleration of a car between samples, m/s².
const MOST_CHANGE_MPS2: f64 = 15.0;
/// Unexplained share that each parameter must remove.
const PER_PARAMETER: f64 = 0.002;

/// Stock controller with the parameters that reproduce most of an ego's behaviour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedModel {
    /// Controller and the actuator lag behind it.
    pub controller: Actuated<ControllerSpec>,
    /// Delay between percept and answer, s.
    pub delay_s: f64,
    /// Share of the ego's changes of acceleration that it leaves unexplained.
    ///
    /// 0: none. 1: as much as constant acceleration.
    pub(crate) unexplained: f64,
}

impl std::fmt::Display for FittedModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, which leaves {:.0} % of it unexplained",
            self.controller.controller.kind(),
            100.0 * self.unexplained
        )?;
        // The parameters of a controller that explains little mean little.
        if !self.is_close() {
            return Ok(());
        }
        let parameters = self.controller.parameters();
        let all: Vec<String> = parameters
            .iter()
            .map(|it| format!("{}: {:.3}", it.name, it.value))
            .collect();
        write!(f, " ({})", all.join(", "))
    }
}

impl FittedModel {
    /// Returns whether networks learn only its residual.
    pub(super) fn is_close(&self) -> bool {
        self.unexplained < CLOSE
    }

    /// Returns the unexplained share plus a cost per parameter.
    ///
    /// Among equally good controllers the simpler controller is preferred.
    pub(super) fn left(&self) -> f64 {
        self.unexplained + PER_PARAMETER * self.controller.parameters().len() as f64
    }

    /// Builds a model that is ready for an episode.
    pub(super) fn model(&self, briefing: &Briefing) -> StockModel {
        let mut controller = self.controller.controller.build();
        controller.brief(&Briefing {
            lag_s: self.controller.lag_s,
            ..briefing.clone()
        });
        controller.reset(0);
        let delay = (self.delay_s / briefing.sample_s).round();
        StockModel {
            controller: Some(controller),
            actuator: Actuator::new(self.controller.lag_s, briefing.sample_s),
            delay: delay as usize,
            seen: VecDeque::new(),
        }
    }
}

/// Stock controller that receives the ego's percepts.
pub(super) struct StockModel {
    /// Always present, because stock controllers can be copied.
    controller: Option<Box<dyn Controller>>,
    actuator: Actuator,
    /// Samples between a percept and its answer.
    pub delay: usize,
    seen: VecDeque<Percept>,
}

impl Clone for StockModel {
    fn clone(&self) -> StockModel {
        StockModel {
            controller: self.controller.as_ref().and_then(|it| it.fork()),
            actuator: self.actuator,
            delay: self.delay,
            seen: self.seen.clone(),
        }
    }
}

impl StockModel {
    /// Resets the model for another episode.
    pub(super) fn reset(&mut self) {
        if let Some(controller) = &mut self.controller {
            controller.reset(0);
        }
        self.seen.clear();
    }

    /// Returns the change of its acceleration until the next sample.
    pub(super) fn change_mps2(&mut self, percept: &Percept) -> f64 {
        if self.delay == 0 {
            return self.answer(percept);
        }
        // The first percept is repeated until the delay has passed.
        if self.seen.len() > self.delay {
            self.seen.pop_front();
        }
        self.seen.push_back(percept.clone());
        // Invariant: an element was pushed just now.
        let late = self.seen.front().map(|then| late(percept, then));
        late.map_or(0.0, |late| self.answer(&late))
    }

    fn answer(&mut self, percept: &Percept) -> f64 {
        let now_mps2 = percept.own.accel_mps2;
        let Some(Ok(wish)) = self.controller.as_mut().map(|it| it.control(percept)) else {
            return 0.0;
        };
        let reached_mps2 = self.actuator.from(now_mps2).step(wish.accel_mps2);
        // Full braking must not drive the ego backwards within the sample.
        let next_mps2 = reached_mps2.max(-percept.own.speed_mps / percept.sample_s);
        (next_mps2 - now_mps2).clamp(-MOST_CHANGE_MPS2, MOST_CHANGE_MPS2)
    }
}

/// Combines the own state of `now` with the other vehicles of `then`.
pub(super) fn late(now: &Percept, then: &Percept) -> Percept {
    Percept {
        own: now.own,
        ..then.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::PlantKind;
    use crate::surrogate::recorded_runs::runs_of;

    #[test]
    fn a_delay_hands_on_what_others_did_then_and_oneself_now() {
        let fitted = FittedModel {
            controller: Actuated::of_kind(
                "Idm",
                &[
                    ("desired_speed_mps", 30.0),
                    ("time_gap_s", 1.0),
                    ("min_gap_m", 2.0),
                    ("max_accel_mps2", 2.0),
                    ("comfort_brake_mps2", 3.0),
                    ("max_brake_mps2", 8.0),
                    ("lag_s", 0.0),
                ],
            )
            .expect("a kind"),
            delay_s: 0.1,
            unexplained: 0.0,
        };
        let briefing = Briefing {
            sample_s: 0.05,
            ..Briefing::default()
        };
        let at_once = FittedModel {
            delay_s: 0.0,
            ..fitted.clone()
        };
        let runs = runs_of("idm", PlantKind::Kinematic, 33);
        let percepts = &runs[0].inputs.percepts;
        let (mut delayed, mut prompt) = (fitted.model(&briefing), at_once.model(&briefing));
        for (sample, percept) in percepts.iter().enumerate() {
            let then = late(percept, &percepts[sample.saturating_sub(2)]);
            let (delayed, prompt) = (delayed.change_mps2(percept), prompt.change_mps2(&then));
            assert_eq!(delayed, prompt, "sample {sample}");
        }
    }
}
