//! Qualities of driving that a change must not cost, measured in natural traffic.

use std::ops::Range;

use serde::Serialize;

use super::error::HardenError;
use crate::ego::{Actuated, Coast, ControllerSpec};
use crate::experiment::{EgoUnderTest, Watch};
use crate::risk::{NaturalRun, RiskTraffic};
use crate::stats::normal_quantile;
use crate::stl::{BoundExpr, Expr, Formula, Monitor, Scratch};
use crate::trace::{Schema, Trace};
use crate::world::{Change, Scenario};

/// Braking from which it is hard, m/s².
const HARD_MPS2: f64 = 3.0;

/// Measure of a loss in a run.
#[derive(Clone, Debug, PartialEq)]
enum Measure {
    /// Mean deceleration over all time, m/s²: how often and how hard the ego brakes.
    Braking,
    /// Time per distance, s/km.
    TravelTime,
    /// Runs with hard braking in which an ego that keeps its speed does not fail.
    FalseBraking,
    /// Mean of an expression over all samples.
    Mean(Expr),
    /// Runs that violate a formula.
    Violations(Formula),
}

/// Limit of a loss.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LossLimit {
    /// A value.
    Below(f64),
    /// A multiple of the value of the ego as it is.
    TimesOwn(f64),
    /// The value of the ego as it is, and this much more.
    AboveOwn(f64),
}

impl LossLimit {
    /// Returns the greatest allowed value, where the ego as it is has `own`.
    pub fn of(self, own: f64) -> f64 {
        match self {
            LossLimit::Below(value) => value,
            LossLimit::TimesOwn(times) => times * own,
            LossLimit::AboveOwn(more) => own + more,
        }
    }

    fn parse(text: &str) -> Option<LossLimit> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|it| it.is_finite());
        let text = text.trim();
        if let Some(percent) = text.strip_suffix('%') {
            let share = number(percent).filter(|it| *it > 0.0)?;
            return Some(LossLimit::TimesOwn(share / 100.0));
        }
        match text.strip_prefix('+') {
            Some(more) => number(more).map(LossLimit::AboveOwn),
            None => number(text).map(LossLimit::Below),
        }
    }
}

/// Quality of driving that a change must not cost: a measure and its limit.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivingLoss {
    /// Name of the measure, or its text.
    pub name: String,
    /// Greatest value.
    pub limit: LossLimit,
    measure: Measure,
}

impl DrivingLoss {
    /// Returns the losses that are limited unless others are given.
    pub fn usual() -> Vec<DrivingLoss> {
        let loss = |name: &str, measure, limit| DrivingLoss {
            name: name.to_owned(),
            measure,
            limit,
        };
        vec![
            loss("braking", Measure::Braking, LossLimit::TimesOwn(1.1)),
            loss(
                "travel-time",
                Measure::TravelTime,
                LossLimit::TimesOwn(1.05),
            ),
            loss(
                "false-braking",
                Measure::FalseBraking,
                LossLimit::AboveOwn(0.05),
            ),
        ]
    }

    /// Parses `MEASURE=LIMIT`.
    ///
    /// The measure is `braking`, `travel-time` or `false-braking`, an expression, whose mean
    /// is limited, or a formula, of which the share of runs that violate it is.
    /// The limit is a value, `110%` of the ego as it is, or `+0.05` more than it.
    ///
    /// # Errors
    /// The text has another form.
    pub fn parse(text: &str) -> Result<DrivingLoss, HardenError> {
        // The last sign separates the limit, because formulas such as `x >= 3` contain
        // others.
        let parts = text.rsplit_once('=');
        let limit = parts.and_then(|(measure, limit)| Some((measure, LossLimit::parse(limit)?)));
        let Some((name, limit)) = limit else {
            return Err(HardenError::NoLimit {
                text: text.to_owned(),
            });
        };
        let name = name.trim();
        let known = DrivingLoss::usual()
            .into_iter()
            .find(|known| known.name == name);
        let measure = match (known, name.parse::<Expr>()) {
            (Some(known), _) => known.measure,
            (None, Ok(expression)) => Measure::Mean(expression),
            (None, Err(_)) => {
                let formula = name.parse::<Formula>();
                Measure::Violations(formula.map_err(|error| in_measure(name, error))?)
            }
        };
        // Only the mean of an expression can be below 0, so the trainings would be in vain.
        let is_below_0 = matches!(limit, LossLimit::Below(value) if value < 0.0);
        if is_below_0 && !matches!(measure, Measure::Mean(_)) {
            return Err(HardenError::NoLimit {
                text: text.to_owned(),
            });
        }
        let name = name.to_owned();
        Ok(DrivingLoss {
            name,
            limit,
            measure,
        })
    }

    /// Returns the usual losses, of which those of `given` replace their namesakes.
    ///
    /// # Errors
    /// A text is no limit on a measure.
    pub fn with_given(given: &[String]) -> Result<Vec<DrivingLoss>, HardenError> {
        let mut all = DrivingLoss::usual();
        for text in given {
            let loss = DrivingLoss::parse(text)?;
            match all.iter_mut().find(|known| known.name == loss.name) {
                Some(known) => *known = loss,
                None => all.push(loss),
            }
        }
        Ok(all)
    }

    /// Returns the value over runs, from their values.
    ///
    /// `None` if it is not defined: without runs, or for the travel time of an ego that
    /// never moves.
    pub(super) fn value(&self, runs: &[f64]) -> Option<f64> {
        let mean = total(runs) / runs.len() as f64;
        let value = match self.measure {
            // Of the mean speed, because a single standing run takes forever.
            Measure::TravelTime => 1000.0 / mean,
            _ => mean,
        };
        Some(value).filter(|it| it.is_finite())
    }

    /// Returns the 95 % interval of the ratio of two egos' values, over paired runs.
    ///
    /// `None` if it is not defined, as for values of 0.
    pub(super) fn ratio_between(&self, runs: &[f64], own: &[f64]) -> Option<[f64; 2]> {
        let n = runs.len();
        let (mean, own_mean) = (total(runs) / n as f64, total(own) / n as f64);
        let ratio = mean / own_mean;
        // One run has no variance, and a ratio of 0 has no inverse for the travel time.
        if n < 2 || !ratio.is_finite() || ratio <= 0.0 {
            return None;
        }
        // Delta method: the residuals of a ratio of two means.
        let squares = runs
            .iter()
            .zip(own)
            .map(|(one, own)| (one - ratio * own).powi(2));
        let variance = squares.sum::<f64>() / ((n - 1) as f64 * n as f64);
        let half = normal_quantile(0.975) * variance.sqrt() / own_mean.abs();
        let ends = [(ratio - half).max(0.0), ratio + half];
        Some(match self.measure {
            // Time is the inverse of speed, so the ends change places.
            Measure::TravelTime => [1.0 / ends[1], 1.0 / ends[0]],
            _ => ends,
        })
    }
}

fn total(values: &[f64]) -> f64 {
    values.iter().sum()
}

fn in_measure(text: &str, error: crate::stl::StlError) -> HardenError {
    HardenError::Measure {
        text: text.to_owned(),
        error,
    }
}

/// Measure that is bound to the signals of a world.
enum BoundMeasure {
    Braking,
    Speed,
    HardBraking,
    Mean(BoundExpr),
    Violations(Box<Monitor>),
}

/// Natural driving of egos, on the same draws for each.
pub(super) struct NaturalDriving<'a> {
    traffic: &'a RiskTraffic,
    seed: u64,
    measures: Vec<BoundMeasure>,
    /// Column of the ego's speed.
    speed: usize,
    /// True for runs in which an ego that keeps its speed does not fail.
    is_easy: Vec<bool>,
}

impl<'a> NaturalDriving<'a> {
    /// Binds the losses, and plays the runs with an ego that keeps its speed.
    ///
    /// `None`: stopped.
    ///
    /// # Errors
    /// A measure does not fit the world, or no run begins inside its ranges.
    pub(super) fn new(
        world: &Scenario,
        traffic: &'a RiskTraffic,
        losses: &[DrivingLoss],
        runs: usize,
        seed: u64,
        watch: &Watch<'_>,
    ) -> Result<Option<NaturalDriving<'a>>, HardenError> {
        let bench = world.bench();
        let bound = losses.iter().map(|loss| bind(world, bench.schema(), loss));
        let measures: Vec<BoundMeasure> = bound.collect::<Result<_, _>>()?;
        let coast = coasting(world)?;
        let kept = |run: NaturalRun<'_>| !run.fails;
        let easy = traffic.natural_runs(coast.scenario(), seed, 0..runs, watch, kept);
        if watch.stopped() {
            return Ok(None);
        }
        // The stop is handled above, because it leaves every run empty as well.
        if easy.iter().all(Option::is_none) {
            return Err(HardenError::NoRuns {
                world: world.name().to_owned(),
            });
        }
        // Invariant: hardening is of driving worlds.
        let speed = world.drive().map_or(0, |driving| driving.ego_columns()[2]);
        Ok(Some(NaturalDriving {
            traffic,
            seed,
            measures,
            speed,
            is_easy: easy.into_iter().map(|kept| kept == Some(true)).collect(),
        }))
    }

    /// Returns the values of some runs of an ego, per loss. `None`: stopped.
    ///
    /// A run is `None` if it begins outside the ranges of the world, is invalid, or ends
    /// before a measure has a sample.
    pub(super) fn measure(
        &self,
        ego: &Scenario,
        which: Range<usize>,
        watch: &Watch<'_>,
    ) -> Option<Vec<Option<Vec<f64>>>> {
        let value = |run: NaturalRun<'_>| -> Option<Vec<f64>> {
            let values = self.measures.iter().map(|it| it.of(run.trace, self.speed));
            values.collect()
        };
        let first = which.start;
        let runs = self
            .traffic
            .natural_runs(ego, self.seed, which, watch, value);
        if watch.stopped() {
            return None;
        }
        let with_easy = runs.into_iter().enumerate().map(|(nth, run)| {
            // The coasting ego has no answer for later runs, so hard braking in them is
            // excused.
            let is_easy = self.is_easy.get(first + nth).copied().unwrap_or(false);
            // The outer `None` is a run that cannot begin or is invalid, the inner one a
            // run without samples.
            run.flatten().map(|values| self.excused(values, is_easy))
        });
        Some(with_easy.collect())
    }

    /// Leaves out hard braking that was necessary.
    fn excused(&self, mut values: Vec<f64>, is_easy: bool) -> Vec<f64> {
        for (value, measure) in values.iter_mut().zip(&self.measures) {
            if matches!(measure, BoundMeasure::HardBraking) && !is_easy {
                *value = 0.0;
            }
        }
        values
    }
}

/// Checks that measures fit a world, without playing anything.
///
/// # Errors
/// A measure names a signal that the world does not publish.
pub(super) fn check(world: &Scenario, losses: &[DrivingLoss]) -> Result<(), HardenError> {
    let bench = world.bench();
    let bound = losses.iter().map(|loss| bind(world, bench.schema(), loss));
    bound.collect::<Result<Vec<_>, _>>().map(|_| ())
}

fn bind(
    world: &Scenario,
    schema: &Schema,
    loss: &DrivingLoss,
) -> Result<BoundMeasure, HardenError> {
    let names = world.names();
    let placed = |error| in_measure(&loss.name, error);
    Ok(match &loss.measure {
        Measure::Braking => BoundMeasure::Braking,
        Measure::TravelTime => BoundMeasure::Speed,
        Measure::FalseBraking => BoundMeasure::HardBraking,
        Measure::Mean(expression) => {
            let bound = expression.bind(schema, &names.constants);
            BoundMeasure::Mean(bound.map_err(placed)?)
        }
        Measure::Violations(formula) => {
            let settings = crate::stl::Settings::default();
            let bound = formula.bind_with(schema, names, &settings);
            BoundMeasure::Violations(Box::new(bound.map_err(placed)?))
        }
    })
}

/// Returns the ego that keeps its speed.
fn coasting(world: &Scenario) -> Result<EgoUnderTest, HardenError> {
    let change = Change {
        controller: Some(Actuated {
            controller: ControllerSpec::from(Coast { accel_mps2: 0.0 }),
            lag_s: 0.0,
        }),
        ..Change::default()
    };
    Ok(EgoUnderTest::changed(world, "coast", &change, "report it")?)
}

impl BoundMeasure {
    /// Returns the value of a run, whose ego has its speed in a column.
    ///
    /// `None` if the run has too few samples.
    fn of(&self, trace: &Trace, speed: usize) -> Option<f64> {
        match self {
            BoundMeasure::Braking => mean(decelerations(trace, speed)),
            BoundMeasure::Speed => mean(trace.column(speed).iter().copied()),
            BoundMeasure::HardBraking => {
                let hardest = decelerations(trace, speed).reduce(f64::max)?;
                Some(f64::from(u8::from(hardest > HARD_MPS2)))
            }
            BoundMeasure::Mean(expression) => {
                let mut row = vec![0.0; trace.schema().len()];
                mean((0..trace.len()).map(|sample| {
                    trace.read_row(sample, &mut row);
                    expression.eval(&row)
                }))
            }
            BoundMeasure::Violations(monitor) => (!trace.is_empty()).then(|| {
                let is_kept = monitor.satisfied(trace, &mut Scratch::default());
                f64::from(u8::from(!is_kept))
            }),
        }
    }
}

/// Returns the decelerations between samples, 0 where the ego does not brake.
fn decelerations(trace: &Trace, speed: usize) -> impl Iterator<Item = f64> {
    let dt_s = trace.dt_s();
    let pairs = trace.column(speed).windows(2);
    // From speeds, because every trace has them.
    pairs.map(move |pair| ((pair[0] - pair[1]) / dt_s).max(0.0))
}

/// Returns the mean, `None` of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for value in values {
        sum += value;
        count += 1;
    }
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests;
