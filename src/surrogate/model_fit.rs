//! Stock controllers that an ego resembles, with parameters fitted to its runs.
//!
//! Many egos are a published model with other numbers, or contain a published model.
//! Every stock controller is therefore fitted to the recorded commands before a network.
//! Cross-entropy search and Gauss-Newton steps minimize the deviation from the recorded
//! changes of acceleration.
//! The best controllers become inputs of the surrogate. If a controller explains nearly
//! all changes, the networks learn only the residual.

use super::fitted_model::{FittedModel, LabelledRun, MODELS, late};
use super::model_library::ModelKind;
use crate::ego::{KINDS, Percept};
use crate::experiment::{EpisodeLoop, Watch};
use crate::seed;
use crate::stats::{CrossEntropySearch, descend};

/// Number of samples for the search and for the final fit.
const SAMPLES: [usize; 2] = [600, 3000];
/// Number of kinds that are fitted again after later rounds.
const WORTH: usize = 6;
/// Searches per kind.
const RESTARTS: u64 = 2;
/// Acceleration from which a sample counts as critical, m/s².
const CRITICAL_MPS2: f64 = 1.0;

/// Stock controllers that an ego resembles most.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Likenesses {
    /// Fitted controllers, the nearest first.
    pub nearest: Vec<FittedModel>,
    /// Kinds that are worth fitting again.
    pub kinds: Vec<&'static str>,
}

/// Fits stock controllers of the given kinds to the runs of an ego.
///
/// Equal requests give equal results on any number of threads.
pub(super) fn likenesses(
    runs: &[LabelledRun],
    kinds: &[&'static str],
    seed: u64,
    watch: &Watch<'_>,
) -> Likenesses {
    let (Some(few), Some(many)) = (Fitting::of(runs, SAMPLES[0]), Fitting::of(runs, SAMPLES[1]))
    else {
        return Likenesses::default();
    };
    let asked = KINDS.iter().filter(|(kind, _)| kinds.contains(kind));
    let kinds: Vec<ModelKind> = asked.filter_map(ModelKind::of).collect();
    // The parallel fits report no progress of their own.
    let quiet = watch.quiet();
    let all = EpisodeLoop::uncounted(&quiet);
    let one = |_: &mut (), kind: &ModelKind, _: &_| {
        let begun = (0..RESTARTS).map(|restart| few.begun(kind, (seed, restart)));
        let settled = begun.map(|point| many.settled(kind, point));
        nearest(settled)
    };
    let alone: Vec<Option<FitMinimum>> = all.run(&kinds, || (), one);
    // Composite controllers start from the best simple controller and share its parameters.
    let pairs = alone.iter().zip(&kinds);
    let pairs = pairs.filter_map(|(found, kind)| Some((found.as_ref()?, kind)));
    let Some(first) = pairs.min_by(|a, b| a.0.cost.total_cmp(&b.0.cost)) else {
        return Likenesses::default();
    };
    let with_first = |_: &mut (), kind: &ModelKind, _: &_| {
        let point = few.begun_with(kind, first, seed)?;
        Some(many.settled(kind, point))
    };
    let with_first = all.run(&kinds, || (), with_first);
    let both = alone.iter().cloned().zip(with_first).zip(&kinds);
    let both = both.filter_map(|((a, b), kind)| Some((nearest(a.into_iter().chain(b))?, kind)));
    let mut tried: Vec<(FitMinimum, &ModelKind)> = both.collect();
    // The sort is stable, so equal candidates keep the order of the list.
    tried.sort_by(|a, b| a.0.cost.total_cmp(&b.0.cost));
    let kinds = tried
        .iter()
        .take(WORTH)
        .map(|(_, kind)| kind.kind)
        .collect();
    // Only the inputs of the surrogate are worth the slow local search.
    tried.truncate(MODELS);
    let again = |_: &mut (), (found, kind): &(FitMinimum, &ModelKind), _: &_| {
        let near = many.near(kind, found.point.clone(), seed);
        let settled = many.settled(kind, near);
        let best = nearest([found.clone(), settled].into_iter())?;
        many.likeness(kind, &best)
    };
    let found = all.run(&tried, || (), again);
    let mut nearest: Vec<FittedModel> = found.into_iter().flatten().collect();
    nearest.sort_by(|a, b| a.left().total_cmp(&b.left()));
    Likenesses { nearest, kinds }
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
            for (percept, [change, _]) in run.heard.percepts.iter().zip(&run.answers) {
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
            let samples = run.heard.percepts.iter().zip(&run.answers);
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
    fn deviations_of(&self, like: &FittedModel) -> Vec<f64> {
        self.deviations(|run| {
            let mut model = like.model(&run.heard.briefing);
            let delay = std::mem::take(&mut model.delay);
            move |percept: &Percept, sample: usize| match delay {
                0 => model.change_mps2(percept),
                // All percepts are at hand, so the model need not store delayed ones.
                _ => {
                    let then = &run.heard.percepts[sample.saturating_sub(delay)];
                    model.change_mps2(&late(percept, then))
                }
            }
        })
    }

    fn measured(&self, kind: &ModelKind, points: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let measured = points.iter().filter_map(|point| kind.at(point));
        measured.map(|like| self.deviations_of(&like)).collect()
    }

    /// Returns a starting point, found by cross-entropy search.
    ///
    /// Every second restart fixes the delay at 0.
    fn begun(&self, kind: &ModelKind, (seed, restart): (u64, u64)) -> Vec<f64> {
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
    fn begun_with(
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
        let measured = self.measured(kind, points);
        measured.iter().map(|off| mean_square(off)).collect()
    }

    /// Refines a point by Gauss-Newton steps.
    fn settled(&self, kind: &ModelKind, point: Vec<f64>) -> FitMinimum {
        // The delay is a whole number of samples and so has no slope.
        let free: Vec<usize> = (0..kind.ranges.len()).collect();
        let measure = |points: &[Vec<f64>]| self.measured(kind, points);
        let point = descend(point, &free, &measure).point;
        let cost = self.costs(kind, std::slice::from_ref(&point));
        FitMinimum {
            cost: cost.into_iter().sum(),
            point,
        }
    }

    fn likeness(&self, kind: &ModelKind, found: &FitMinimum) -> Option<FittedModel> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::{Actuated, Briefing};
    use crate::sim::PlantKind;
    use crate::surrogate::model_library::kinds_but;
    use crate::surrogate::recorded_ego::runs_of;
    use crate::world::Scenario;

    fn parameter(like: &FittedModel, name: &str) -> f64 {
        let all = like.controller.parameters();
        let found = all.iter().find(|parameter| parameter.name == name);
        found.expect("a parameter").value
    }

    #[test]
    fn a_published_model_is_found_with_its_parameters() {
        let watch = Watch::unwatched();
        let idm = runs_of("idm", PlantKind::Rigid, 33);
        let kinds = ["Acc", "Idm", "Gipps", "Aeb"];
        let found = likenesses(&idm, &kinds, 1, &watch);
        assert_eq!((found.kinds.len(), found.kinds[0]), (4, "Idm"));
        let like = &found.nearest[0];
        assert_eq!(like.controller.controller.kind(), "Idm");
        assert!(like.is_close() && like.unexplained < 0.1, "{like:?}");
        let close = |name: &str, truth: f64| {
            let value = parameter(like, name);
            assert!((value - truth).abs() < 0.1 * truth, "{name}: {value}");
        };
        close("time_gap_s", 0.35);
        close("comfort_brake_mps2", 5.0);
        close("lag_s", 0.4);
        // The result does not depend on the number of threads.
        assert_eq!(likenesses(&idm, &kinds, 1, &watch), found);

        let unknown = kinds_but(&["Idm", "FsmDriver", "RssDriver", "IsoAcc", "PoliteAcc"]);
        let others = likenesses(&idm, &unknown[..6], 1, &watch).nearest;
        assert_eq!(others.len(), MODELS);
        for other in others {
            assert_ne!(other.controller.controller.kind(), "Idm");
            assert!(like.unexplained < 0.2 * other.unexplained, "{other:?}");
        }
    }

    #[test]
    fn what_is_most_like_another_controller_is_begun_with_that_one() {
        let runs = runs_of("filter", PlantKind::Kinematic, 33);
        let kinds = ["Acc", "FilteredAcc", "Gipps"];
        let found = likenesses(&runs, &kinds, 1, &Watch::unwatched()).nearest;
        // It follows like the ACC, and its filter brakes now and then.
        assert_eq!(found[0].controller.controller.kind(), "FilteredAcc");
        let margin_m = parameter(&found[0], "filter_margin_m");
        assert!((margin_m - 0.2).abs() < 0.15, "{margin_m}");
    }

    #[test]
    fn a_delay_hands_on_what_others_did_then_and_oneself_now() {
        let like = FittedModel {
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
            ..like.clone()
        };
        let runs = runs_of("idm", PlantKind::Kinematic, 33);
        let percepts = &runs[0].heard.percepts;
        let (mut delayed, mut prompt) = (like.model(&briefing), at_once.model(&briefing));
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
        let nobody = Likenesses::default();
        assert_eq!(likenesses(&runs, &["Idm"], 1, &watch), nobody);
        assert_eq!(likenesses(&[], &["Idm"], 1, &watch), nobody);
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
