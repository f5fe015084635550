//! Stock controllers that an ego resembles, with parameters fitted to its runs.
//!
//! Many egos are a published model with other numbers, or contain a published model.
//! Every stock controller is therefore fitted to the recorded commands before a network.
//! Cross-entropy search and Gauss-Newton steps minimize the deviation from the recorded
//! changes of acceleration.
//! The best controllers become inputs of the surrogate. If a controller explains nearly
//! all changes, the networks learn only the residual.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::ego::{Actuated, Actuator, Briefing, Controller, ControllerSpec, KINDS, Percept};
use crate::experiment::{EpisodeLoop, Watch};
use crate::seed;
use crate::stats::{CrossEntropySearch, descend};

/// Number of samples for the search and for the final fit.
const SAMPLES: [usize; 2] = [600, 3000];
/// Number of kinds that are fitted again after later rounds.
const REFITTED: usize = 6;
/// Searches per kind.
const RESTARTS: u64 = 2;
/// Acceleration from which a sample counts as critical, m/s².
const CRITICAL_MPS2: f64 = 1.0;

/// Stock controllers that an ego resembles most.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ModelFits {
    /// Fitted controllers, the nearest first.
    pub nearest: Vec<FittedModel>,
    /// Kinds that are worth fitting again.
    pub kinds: Vec<&'static str>,
}

/// Fits stock controllers of the given kinds to the runs of an ego.
///
/// Equal requests give equal results on any number of threads.
pub(super) fn fit_models(
    runs: &[LabelledRun],
    kinds: &[&'static str],
    seed: u64,
    watch: &Watch<'_>,
) -> ModelFits {
    let (Some(few), Some(many)) = (Fitting::of(runs, SAMPLES[0]), Fitting::of(runs, SAMPLES[1]))
    else {
        return ModelFits::default();
    };
    let listed = KINDS.iter().filter(|(kind, _)| kinds.contains(kind));
    let kinds: Vec<ModelKind> = listed.filter_map(ModelKind::of).collect();
    // The parallel fits report no progress of their own.
    let quiet = watch.quiet();
    let all = EpisodeLoop::uncounted(&quiet);
    let one = |_: &mut (), kind: &ModelKind, _: &_| {
        let search_start = (0..RESTARTS).map(|restart| few.search_start(kind, (seed, restart)));
        let refined = search_start.map(|point| many.refined(kind, point));
        nearest(refined)
    };
    let alone: Vec<Option<FitMinimum>> = all.run(&kinds, || (), one);
    // Composite controllers start from the best simple controller and share its parameters.
    let pairs = alone.iter().zip(&kinds);
    let pairs = pairs.filter_map(|(found, kind)| Some((found.as_ref()?, kind)));
    let Some(first) = pairs.min_by(|a, b| a.0.cost.total_cmp(&b.0.cost)) else {
        return ModelFits::default();
    };
    let sharing_first = |_: &mut (), kind: &ModelKind, _: &_| {
        let point = few.search_start_sharing(kind, first, seed)?;
        Some(many.refined(kind, point))
    };
    let sharing_first = all.run(&kinds, || (), sharing_first);
    let both = alone.iter().cloned().zip(sharing_first).zip(&kinds);
    let both = both.filter_map(|((a, b), kind)| Some((nearest(a.into_iter().chain(b))?, kind)));
    let mut tried: Vec<(FitMinimum, &ModelKind)> = both.collect();
    // The sort is stable, so equal candidates keep the order of the list.
    tried.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost));
    let kinds = tried
        .iter()
        .take(REFITTED)
        .map(|(_, kind)| kind.kind)
        .collect();
    // Only the inputs of the surrogate are worth the slow local search.
    tried.truncate(MODELS);
    let again = |_: &mut (), (found, kind): &(FitMinimum, &ModelKind), _: &_| {
        let near = many.near(kind, found.point.clone(), seed);
        let refined = many.refined(kind, near);
        let best = nearest([found.clone(), refined].into_iter())?;
        many.fitted_model(kind, &best)
    };
    let found = all.run(&tried, || (), again);
    let mut nearest: Vec<FittedModel> = found.into_iter().flatten().collect();
    nearest.sort_by(|a, b| a.left().total_cmp(&b.left()));
    ModelFits { nearest, kinds }
}

/// End point of a search.
#[derive(Clone, Debug)]
struct FitMinimum {
    point: Vec<f64>,
    /// Mean square of the deviations.
    cost: f64,
}

fn nearest(found: impl Iterator<Item = FitMinimum>) -> Option<FitMinimum> {
    found.min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// Runs that stock controllers are fitted to.
struct Fitting<'a> {
    runs: Vec<&'a LabelledRun>,
    /// Acceleration error that counts as 1.
    unit_mps2: f64,
    /// Weights of critical and other samples, so that both kinds count alike.
    weights: [f64; 2],
    /// Cost of constant acceleration.
    nothing: f64,
}

impl<'a> Fitting<'a> {
    /// Selects runs with about `samples` samples together.
    ///
    /// `None`: the acceleration never changes in them.
    fn of(runs: &'a [LabelledRun], samples: usize) -> Option<Fitting<'a>> {
        let all: usize = runs.iter().map(|run| run.answers.len()).sum();
        // Whole runs are skipped, because delays and lags need consecutive samples.
        let every = (all / samples).max(1);
        let runs: Vec<&LabelledRun> = runs.iter().step_by(every).collect();
        let changes = || {
            runs.iter()
                .flat_map(|run| &run.answers)
                .map(|answer| answer[0])
        };
        let count = changes().count() as f64;
        let squares: f64 = changes().map(|change| change * change).sum();
        let unit_mps2 = (squares / count.max(1.0)).sqrt();
        if unit_mps2 < 1e-6 {
            return None;
        }
        let mut fitting = Fitting {
            runs,
            unit_mps2,
            weights: [1.0, 1.0],
            nothing: 1.0,
        };
        let critical = fitting.critical_share();
        if 0.0 < critical && critical < 1.0 {
            fitting.weights = [0.5 / critical, 0.5 / (1.0 - critical)];
        }
        fitting.nothing = mean_square(&fitting.deviations(|_| |_: &Percept, _: usize| 0.0));
        Some(fitting)
    }

    fn critical_share(&self) -> f64 {
        let mut counts = [0.0_f64; 2];
        for run in &self.runs {
            for (percept, [change, _]) in run.inputs.percepts.iter().zip(&run.answers) {
                counts[usize::from(!self.is_critical(percept, *change))] += 1.0;
            }
        }
        counts[0] / (counts[0] + counts[1]).max(1.0)
    }

    fn is_critical(&self, percept: &Percept, change_mps2: f64) -> bool {
        CRITICAL_MPS2 < percept.own.accel_mps2.abs() || self.unit_mps2 < change_mps2.abs()
    }

    /// Returns the deviations of a model from the recorded changes.
    ///
    /// `model` makes a model per run. The squares of the numbers are twice the weighted
    /// Huber loss.
    fn deviations<M: FnMut(&Percept, usize) -> f64>(
        &self,
        mut model: impl FnMut(&'a LabelledRun) -> M,
    ) -> Vec<f64> {
        let mut deviations = Vec::new();
        for run in &self.runs {
            let mut model = model(run);
            let samples = run.inputs.percepts.iter().zip(&run.answers);
            for (sample, (percept, &[change_mps2, _])) in samples.enumerate() {
                let off = (model(percept, sample) - change_mps2) / self.unit_mps2;
                let weight = self.weights[usize::from(!self.is_critical(percept, change_mps2))];
                // Gauss-Newton minimizes squares, so the Huber loss is written as a square.
                let twice_huber = if off.abs() < 1.0 {
                    off * off
                } else {
                    2.0 * off.abs() - 1.0
                };
                deviations.push(off.signum() * (weight * twice_huber).sqrt());
            }
        }
        deviations
    }

    /// Returns the deviations of a stock controller.
    fn deviations_of(&self, fitted: &FittedModel) -> Vec<f64> {
        self.deviations(|run| {
            let mut model = fitted.model(&run.inputs.briefing);
            let delay = std::mem::take(&mut model.delay);
            move |percept: &Percept, sample: usize| match delay {
                0 => model.change_mps2(percept),
                // All percepts are at hand, so the model need not store delayed ones.
                _ => {
                    let then = &run.inputs.percepts[sample.saturating_sub(delay)];
                    model.change_mps2(&late(percept, then))
                }
            }
        })
    }

    fn deviations_at(&self, kind: &ModelKind, points: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let deviations_at = points.iter().filter_map(|point| kind.at(point));
        deviations_at
            .map(|fitted| self.deviations_of(&fitted))
            .collect()
    }

    /// Returns a starting point, found by cross-entropy search.
    ///
    /// Every second restart fixes the delay at 0.
    fn search_start(&self, kind: &ModelKind, (seed, restart): (u64, u64)) -> Vec<f64> {
        let mut dice = seed::generator(kind.kind, &[seed, restart]);
        let at_once = restart.is_multiple_of(2);
        let with_delay = |point: &Vec<f64>| {
            let mut point = point.clone();
            if at_once {
                // The coordinate −1 is a delay of 0.
                point.push(-1.0);
            }
            point
        };
        let costs = |points: &[Vec<f64>]| -> Vec<f64> {
            let points: Vec<Vec<f64>> = points.iter().map(with_delay).collect();
            self.costs(kind, &points)
        };
        let middle = vec![0.0; kind.ranges.len() + usize::from(!at_once)];
        with_delay(
            &CrossEntropySearch::WIDE
                .run(middle, &mut dice, &costs)
                .point,
        )
    }

    /// Returns a starting point that shares the parameters of another kind.
    ///
    /// The remaining parameters are searched. `None`: no parameters are shared, or none
    /// remain.
    fn search_start_sharing(
        &self,
        kind: &ModelKind,
        (found, of): (&FitMinimum, &ModelKind),
        seed: u64,
    ) -> Option<Vec<f64>> {
        let shared =
            |range: &(&str, f64, f64)| of.ranges.iter().position(|other| other.0 == range.0);
        let shared: Vec<Option<usize>> = kind.ranges.iter().map(shared).collect();
        // The lag is shared by all kinds, so it alone does not relate two of them.
        let own = shared.iter().filter(|shared| shared.is_none()).count();
        if own == 0 || own + 1 == shared.len() {
            return None;
        }
        let whole = |own: &Vec<f64>| {
            let mut own = own.iter();
            let values = shared.iter().map(|shared| match shared {
                Some(there) => found.point[*there],
                None => own.next().copied().unwrap_or(0.0),
            });
            let mut point: Vec<f64> = values.collect();
            point.extend(found.point.last());
            point
        };
        let costs = |points: &[Vec<f64>]| {
            let points: Vec<Vec<f64>> = points.iter().map(whole).collect();
            self.costs(kind, &points)
        };
        let mut dice = seed::generator(kind.kind, &[seed, RESTARTS + 1]);
        Some(whole(
            &CrossEntropySearch::WIDE
                .run(vec![0.0; own], &mut dice, &costs)
                .point,
        ))
    }

    /// Continues the search around a point.
    ///
    /// Gauss-Newton steps find no slope if an ego reacts beyond a threshold.
    fn near(&self, kind: &ModelKind, point: Vec<f64>, seed: u64) -> Vec<f64> {
        let mut dice = seed::generator(kind.kind, &[seed, RESTARTS]);
        let costs = |points: &[Vec<f64>]| self.costs(kind, points);
        CrossEntropySearch::NEAR.run(point, &mut dice, &costs).point
    }

    fn costs(&self, kind: &ModelKind, points: &[Vec<f64>]) -> Vec<f64> {
        let deviations_at = self.deviations_at(kind, points);
        deviations_at.iter().map(|off| mean_square(off)).collect()
    }

    /// Refines a point by Gauss-Newton steps.
    fn refined(&self, kind: &ModelKind, point: Vec<f64>) -> FitMinimum {
        // The delay is a whole number of samples and so has no slope.
        let free: Vec<usize> = (0..kind.ranges.len()).collect();
        let measure = |points: &[Vec<f64>]| self.deviations_at(kind, points);
        let point = descend(point, &free, &measure).point;
        let cost = self.costs(kind, std::slice::from_ref(&point));
        FitMinimum {
            cost: cost.into_iter().sum(),
            point,
        }
    }

    fn fitted_model(&self, kind: &ModelKind, found: &FitMinimum) -> Option<FittedModel> {
        Some(FittedModel {
            unexplained: found.cost / self.nothing,
            ..kind.at(&found.point)?
        })
    }
}

fn mean_square(deviations: &[f64]) -> f64 {
    let sum: f64 = deviations.iter().map(|off| off * off).sum();
    sum / deviations.len().max(1) as f64
}

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
    pub unexplained: f64,
}

impl std::fmt::Display for FittedModel {
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
        let next_mps2 = self.actuator.from(now_mps2).step(wish.accel_mps2);
        // Full braking must not drive the ego backwards within the sample.
        let next_mps2 = next_mps2.max(-percept.own.speed_mps / percept.sample_s);
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

/// Inputs of an ego in a run.
#[derive(Clone, Debug, Default)]
pub(super) struct EgoInputs {
    pub briefing: Briefing,
    pub percepts: Vec<Percept>,
}

/// Inputs of an ego in a run, and its answers.
#[derive(Clone, Debug)]
pub(super) struct LabelledRun {
    pub inputs: EgoInputs,
    /// Change of acceleration until the next sample, m/s², and lateral speed, m/s.
    pub answers: Vec<[f64; 2]>,
}

/// Longest delay of an ego's reaction, s.
const LONGEST_DELAY_S: f64 = 0.75;

/// Ranges of the parameters of stock controllers, by name.
///
/// A kind with any other parameter is not tried.
const RANGES: &[(&str, f64, f64)] = &[
    ("lag_s", 0.0, 1.0),
    ("kp_per_s2", 0.02, 1.5),
    ("kd_per_s", 0.1, 3.0),
    ("standstill_headway_m", 3.0, 20.0),
    ("time_gap_s", 0.1, 3.0),
    ("max_brake_mps2", 2.0, 10.0),
    ("max_accel_mps2", 0.5, 4.0),
    ("filter_brake_mps2", 3.0, 10.0),
    ("filter_margin_m", 0.0, 3.0),
    ("filter_delay_s", 0.0, 1.0),
    ("soft_brake_mps2", 0.5, 5.0),
    ("rear_gap_s", 0.1, 2.0),
    ("desired_speed_mps", 5.0, 50.0),
    ("min_gap_m", 0.1, 6.0),
    ("comfort_brake_mps2", 0.5, 7.0),
    ("reaction_s", 0.05, 1.5),
    ("plan_brake_mps2", 2.0, 9.0),
    ("leader_brake_mps2", 2.0, 9.0),
    ("transition_m", 3.0, 40.0),
    ("form", 0.2, 4.0),
    ("sensitivity_per_s", 0.05, 2.0),
    ("closing_gain_per_s", 0.0, 2.0),
    ("aeb_trigger_mps2", 2.0, 9.0),
    ("aeb_brake_mps2", 0.0, 10.0),
    ("cruise_gain_per_s", 0.1, 2.0),
    ("cruise_limit_mps2", 0.5, 4.0),
    ("trigger_mps2", 1.0, 9.0),
    ("margin_m", 0.0, 5.0),
    ("side_m", 0.0, 1.5),
    ("look_ahead_s", 1.0, 8.0),
    ("threshold_m", 0.0, 10.0),
    ("t_lka_s", 0.0, 4.0),
    ("ttc_s", 0.5, 5.0),
    ("foot_off_mps2", 0.0, 1.0),
    ("jerk_mps3", 2.0, 30.0),
    ("wander_m", 0.1, 1.0),
    ("perceived_m", 0.0, 1.5),
    ("inside_m", 0.0, 1.0),
    ("early_s", 0.0, 2.0),
    ("ego_accel_mps2", 0.0, 3.0),
    ("ego_brake_mps2", 2.0, 9.0),
    ("other_brake_mps2", 2.0, 10.0),
    ("lateral_accel_mps2", 0.1, 2.0),
    ("lateral_margin_m", 0.0, 1.0),
    ("hard_brake_mps2", 3.0, 9.0),
    ("standstill_gap_m", 0.0, 5.0),
    ("safe_margin_m", 0.0, 2.0),
    ("passing_margin_s", 0.0, 1.0),
];

/// Returns all kinds except those in `unknown`.
pub(super) fn kinds_except(unknown: &[&str]) -> Vec<&'static str> {
    let kinds = KINDS.iter().map(|(kind, _)| *kind);
    kinds.filter(|kind| !unknown.contains(kind)).collect()
}

/// Kind of stock controller and the ranges of its parameters.
pub(super) struct ModelKind {
    pub kind: &'static str,
    pub ranges: Vec<(&'static str, f64, f64)>,
}

impl ModelKind {
    /// Returns the kind, or `None` if a range of its parameters is missing.
    pub(super) fn of(&(kind, names): &(&'static str, &[&'static str])) -> Option<ModelKind> {
        let range = |name: &str| RANGES.iter().find(|range| range.0 == name).copied();
        // Every kind is tried with an actuator lag.
        let ranges = names.iter().map(|name| range(name)).chain([range("lag_s")]);
        let ranges: Vec<_> = ranges.collect::<Option<_>>()?;
        // A kind with the lag as its only parameter cannot be fitted.
        (1 < ranges.len()).then_some(ModelKind { kind, ranges })
    }

    /// Returns the controller at a point of the box.
    ///
    /// Coordinates run from −1 to 1, one per parameter and one for the delay.
    pub(super) fn at(&self, point: &[f64]) -> Option<FittedModel> {
        let within = |at: f64, low: f64, high: f64| low + 0.5 * (at + 1.0) * (high - low);
        let pairs = self.ranges.iter().zip(point);
        let values: Vec<_> = pairs
            .map(|(&(name, low, high), &at)| (name, within(at, low, high)))
            .collect();
        Some(FittedModel {
            controller: Actuated::of_kind(self.kind, &values)?,
            delay_s: within(*point.last()?, 0.0, LONGEST_DELAY_S),
            unexplained: f64::INFINITY,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::{Actuated, Briefing};
    use crate::sim::PlantKind;
    use crate::surrogate::recorded_runs::runs_of;
    use crate::world::Scenario;

    fn parameter(fitted: &FittedModel, name: &str) -> f64 {
        let all = fitted.controller.parameters();
        let found = all.iter().find(|parameter| parameter.name == name);
        found.expect("a parameter").value
    }

    #[test]
    fn a_published_model_is_found_with_its_parameters() {
        let watch = Watch::unwatched();
        let idm = runs_of("idm", PlantKind::Rigid, 33);
        let kinds = ["Acc", "Idm", "Gipps", "Aeb"];
        let found = fit_models(&idm, &kinds, 1, &watch);
        assert_eq!((found.kinds.len(), found.kinds[0]), (4, "Idm"));
        let fitted = &found.nearest[0];
        assert_eq!(fitted.controller.controller.kind(), "Idm");
        assert!(fitted.is_close() && fitted.unexplained < 0.1, "{fitted:?}");
        let close = |name: &str, truth: f64| {
            let value = parameter(fitted, name);
            assert!((value - truth).abs() < 0.1 * truth, "{name}: {value}");
        };
        close("time_gap_s", 0.35);
        close("comfort_brake_mps2", 5.0);
        close("lag_s", 0.4);
        // The result does not depend on the number of threads.
        assert_eq!(fit_models(&idm, &kinds, 1, &watch), found);

        let unknown = kinds_except(&["Idm", "FsmDriver", "RssDriver", "IsoAcc", "PoliteAcc"]);
        let others = fit_models(&idm, &unknown[..6], 1, &watch).nearest;
        assert_eq!(others.len(), MODELS);
        for other in others {
            assert_ne!(other.controller.controller.kind(), "Idm");
            assert!(fitted.unexplained < 0.2 * other.unexplained, "{other:?}");
        }
    }

    #[test]
    fn what_is_most_like_another_controller_is_begun_with_that_one() {
        let runs = runs_of("filter", PlantKind::Kinematic, 33);
        let kinds = ["Acc", "FilteredAcc", "Gipps"];
        let found = fit_models(&runs, &kinds, 1, &Watch::unwatched()).nearest;
        // It follows like the ACC, and its filter brakes now and then.
        assert_eq!(found[0].controller.controller.kind(), "FilteredAcc");
        let margin_m = parameter(&found[0], "filter_margin_m");
        assert!((margin_m - 0.2).abs() < 0.15, "{margin_m}");
    }

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

    #[test]
    fn an_ego_that_never_changes_its_acceleration_is_like_nobody() {
        let mut runs = runs_of("idm", PlantKind::Kinematic, 33);
        for run in &mut runs {
            run.answers.fill([0.0, 0.0]);
        }
        let watch = Watch::unwatched();
        let nobody = ModelFits::default();
        assert_eq!(fit_models(&runs, &["Idm"], 1, &watch), nobody);
        assert_eq!(fit_models(&[], &["Idm"], 1, &watch), nobody);
    }

    #[test]
    fn every_range_holds_the_parameters_of_the_shipped_egos() {
        let world = Scenario::shipped("acc_structures").expect("shipped");
        for (name, change) in world.expect("sound").reuse() {
            let Some(controller) = &change.controller else {
                continue;
            };
            let kind = controller.controller.kind();
            let kind = KINDS
                .iter()
                .find(|other| other.0 == kind)
                .and_then(ModelKind::of);
            let kind = kind.expect("tried");
            for parameter in controller.parameters() {
                let mut ranges = kind.ranges.iter();
                let range = ranges.find(|range| range.0 == parameter.name);
                let (_, low, high) = range.expect("a range");
                let holds = (*low..=*high).contains(&parameter.value);
                assert!(holds, "{name}: {} {}", parameter.name, parameter.value);
            }
        }
    }
}
