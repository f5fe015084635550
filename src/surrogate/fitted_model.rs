//! A stock controller that an ego is like, and what it would do in the ego's place.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::ego::{Actuated, Actuator, Briefing, Controller, ControllerSpec, Percept};

/// How many stock controllers are among the inputs of a surrogate.
pub(super) const MODELS: usize = 3;
/// One that leaves less than this unexplained is what networks add to.
const CLOSE: f64 = 0.25;
/// No car's acceleration changes by more from one sample to the next.
const MOST_CHANGE_MPS2: f64 = 15.0;
/// What a parameter must explain to be worth it.
const PER_PARAMETER: f64 = 0.002;

/// A stock controller, with the parameters under which it does most of what an ego
/// did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Likeness {
    /// It, and the lag behind it.
    pub controller: Actuated<ControllerSpec>,
    /// How long ago it saw what it answers, s.
    pub delay_s: f64,
    /// How much of the ego's changes of acceleration it leaves unexplained: 0
    /// nothing, 1 as much as an ego that keeps its acceleration.
    pub unexplained: f64,
}

impl std::fmt::Display for Likeness {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}, which leaves {:.0} % of it unexplained",
            self.controller.controller.kind(),
            100.0 * self.unexplained
        )?;
        if !self.is_close() {
            return Ok(());
        }
        let parameters = self.controller.parameters();
        let all = parameters
            .iter()
            .map(|it| format!("{}: {:.3}", it.name, it.value));
        let all: Vec<String> = all.collect();
        write!(f, " ({})", all.join(", "))
    }
}

impl Likeness {
    /// Whether networks learn only what it leaves unexplained.
    pub(super) fn is_close(&self) -> bool {
        self.unexplained < CLOSE
    }

    /// What it leaves unexplained and how much it has to be told: of two that say
    /// as much the simpler one is nearer.
    pub(super) fn left(&self) -> f64 {
        self.unexplained + PER_PARAMETER * self.controller.parameters().len() as f64
    }

    /// It, ready for an episode.
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

/// A stock controller that is told what an ego sees.
pub(super) struct StockModel {
    /// Always there: stock controllers can be copied.
    controller: Option<Box<dyn Controller>>,
    actuator: Actuator,
    /// Samples between what it sees and what it answers.
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

impl std::fmt::Debug for StockModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("StockModel").finish_non_exhaustive()
    }
}

impl StockModel {
    /// Ready for another episode.
    pub fn reset(&mut self) {
        if let Some(controller) = &mut self.controller {
            controller.reset(0);
        }
        self.seen.clear();
    }

    /// By how much its acceleration would change until the next sample.
    pub fn change_mps2(&mut self, percept: &Percept) -> f64 {
        if self.delay == 0 {
            return self.answer(percept);
        }
        if self.seen.len() > self.delay {
            self.seen.pop_front();
        }
        self.seen.push_back(percept.clone());
        // Invariant: one was pushed just now.
        let late = self.seen.front().map(|then| late(percept, then));
        late.map_or(0.0, |late| self.answer(&late))
    }

    fn answer(&mut self, percept: &Percept) -> f64 {
        let now_mps2 = percept.own.accel_mps2;
        let Some(Ok(wish)) = self.controller.as_mut().map(|it| it.control(percept)) else {
            return 0.0;
        };
        let next_mps2 = self.actuator.from(now_mps2).step(wish.accel_mps2);
        // Whoever brakes to a stop stands.
        let next_mps2 = next_mps2.max(-percept.own.speed_mps / percept.sample_s);
        (next_mps2 - now_mps2).clamp(-MOST_CHANGE_MPS2, MOST_CHANGE_MPS2)
    }
}

/// Its own state of now, and everybody else's of then.
pub(super) fn late(now: &Percept, then: &Percept) -> Percept {
    Percept {
        own: now.own,
        ..then.clone()
    }
}

/// What an ego was told in a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Heard {
    pub briefing: Briefing,
    pub percepts: Vec<Percept>,
}

/// A run of an ego: what it was told, and what it did.
#[derive(Clone, Debug)]
pub(super) struct Answered {
    pub heard: Heard,
    /// The change of its acceleration until the next sample, m/s², and its speed
    /// across the road, m/s.
    pub answers: Vec<[f64; 2]>,
}
