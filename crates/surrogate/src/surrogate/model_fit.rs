//! Stock controllers that an ego resembles, with parameters fitted to its runs.
//!
//! Many egos are a published model with other numbers, or contain a published model.
//! Every stock controller is therefore fitted to the recorded commands before a network.
//! Cross-entropy search and Gauss-Newton steps minimize the deviation from the recorded
//! changes of acceleration.
//! The best controllers become inputs of the surrogate. If a controller explains nearly
//! all changes, the networks learn only the residual.

use super::fitted_model::{FittedModel, MODELS, late};
use super::model_kind::ModelKind;
use crate::ego::{Briefing, KINDS, Percept};
use crate::experiment::{EpisodeLoop, Watch};
use crate::seed;
use crate::stats::{CrossEntropySearch, descend};

/// Number of samples for the search and for the final fit.
const SAMPLES: [usize; 2] = [600, 3000];
/// Number of kinds that are fitted again after later rounds.
// Fits begin anew: 13 egos had a mean recall of 0.89, and 0.80 if fits began at earlier ones.
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
        let search_start = (0..RESTARTS).map(|restart| few.search_start(kind, seed, restart));
        let refined = search_start.map(|point| many.refined(kind, point));
        nearest(refined)
    };
    let alone: Vec<Option<FitMinimum>> = all.run(&kinds, || (), one);
    // Composite controllers start from the best simple controller and share its parameters.
    let pairs = alone
        .iter()
        .zip(&kinds)
        .filter_map(|(found, kind)| Some((found.as_ref()?, kind)));
    let Some(first) = pairs.min_by(|a, b| a.0.cost.total_cmp(&b.0.cost)) else {
        return ModelFits::default();
    };
    let share_with_first = |_: &mut (), kind: &ModelKind, _: &_| {
        let point = few.search_start_sharing(kind, first.0, first.1, seed)?;
        Some(many.refined(kind, point))
    };
    let sharing_first = all.run(&kinds, || (), share_with_first);
    let both = alone
        .iter()
        .cloned()
        .zip(sharing_first)
        .zip(&kinds)
        .filter_map(|((a, b), kind)| Some((nearest(a.into_iter().chain(b))?, kind)));
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
        // An ego that keeps its acceleration leaves a fit nothing to explain.
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
        // Rare critical samples count as much as all others together.
        if critical > 0.0 && critical < 1.0 {
            fitting.weights = [0.5 / critical, 0.5 / (1.0 - critical)];
        }
        // What a model leaves unexplained is relative to no model at all.
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
        percept.own.accel_mps2.abs() > CRITICAL_MPS2 || self.unit_mps2 < change_mps2.abs()
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
    fn search_start(&self, kind: &ModelKind, seed: u64, restart: u64) -> Vec<f64> {
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
        found: &FitMinimum,
        of: &ModelKind,
        seed: u64,
    ) -> Option<Vec<f64>> {
        let place_in =
            |range: &(&str, f64, f64)| of.ranges.iter().position(|other| other.0 == range.0);
        let shared: Vec<Option<usize>> = kind.ranges.iter().map(place_in).collect();
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
            // The delay is the last number of a point, and is shared as well.
            point.extend(found.point.last());
            point
        };
        let costs = |points: &[Vec<f64>]| {
            let points: Vec<Vec<f64>> = points.iter().map(whole).collect();
            self.costs(kind, &points)
        };
        // Another stream than those of the restarts and of the search nearby.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::PlantKind;
    use crate::surrogate::model_kind::kinds_except;
    use crate::surrogate::recorded_runs::runs_of;

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
}
