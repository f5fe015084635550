//! Theorem 3 on the road: carry-over of counterexamples to changed egos.

use serde::{Serialize, Serializer};

use super::compare::Witness;
use super::forecast::{Forecast, ForecastCase, forecast};
use super::{TheoremsError, TheoremsRequest};
use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::run_dir::number_or_word;
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{
    Actor, Aftermath, Constant, Episode, NoisyStart, PolicyActor, Replay, Testbench,
};
use crate::world::Scenario;

/// Ways in which the ado acts against the changed ego, in the order of results.
///
/// An ado acts in closed loop. Definition 5 requires equal actions, which the replay has.
const ADOS: [&str; 2] = ["closed loop", "actions replayed"];

/// Result of Theorem 3 and Lemma 1 on every changed ego.
#[derive(Clone, Debug, Serialize)]
pub struct CarryOver {
    /// Counterexamples of the nominal ego on the test starts.
    pub counterexamples: usize,
    /// τ at the verdict.
    pub tau_at_verdict: Spread,
    /// τ in use: the largest of any prefix up to the end of the motion.
    pub tau: Spread,
    /// Share of starts on which the predicted bound may be exceeded.
    pub alpha: f64,
    /// Row per changed ego and way of acting.
    pub rows: Vec<CarriedOver>,
    /// Changed egos that the theorem does not cover.
    pub refused: Vec<Refused>,
}

/// Carry-over of the nominal counterexamples to a changed ego.
#[derive(Clone, Debug, Serialize)]
pub struct CarriedOver {
    /// Name of the changed ego.
    pub ego: String,
    /// `closed loop`, or `actions replayed`.
    pub ado: &'static str,
    /// Pairs of runs, as many as nominal counterexamples.
    pub pairs: usize,
    /// Pairs with a counterexample of the changed ego.
    pub carried: usize,
    /// ε between the runs of a pair.
    pub epsilon: Spread,
    /// Pairs with ε < τ, for which the theorem promises a counterexample.
    pub covered: usize,
    /// Broken promises, each of which is a bug of this program.
    pub misses: usize,
    /// Prediction of carry-over by ε, before running.
    pub forecast: Forecast,
    /// Result of the sharper test. `None` unless ψ_ego is an invariant.
    pub sharper: Option<Sharper>,
}

/// Result of the sharper test for an invariant ψ_ego at its deepest sample.
#[derive(Clone, Debug, Serialize)]
pub struct Sharper {
    /// Pairs for which the test promises a counterexample.
    pub covered: usize,
    /// Broken promises, each of which is a bug of this program.
    pub misses: usize,
    /// Prediction of carry-over by this test, before running.
    pub forecast: Forecast,
}

/// Changed ego that was left out.
#[derive(Clone, Debug, Serialize)]
pub struct Refused {
    /// Name of the changed ego.
    pub ego: String,
    /// Reason in a sentence.
    pub why: String,
}

/// Median, 90th percentile and maximum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    #[serde(serialize_with = "serialize_number")]
    pub median: f64,
    /// 90th percentile.
    #[serde(serialize_with = "serialize_number")]
    pub p90: f64,
    /// Maximum.
    #[serde(serialize_with = "serialize_number")]
    pub max: f64,
}

fn serialize_number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    number_or_word(*value).serialize(serializer)
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Spread {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            // The nearest rank, so every number is an observed value.
            let rank = (share * values.len().saturating_sub(1) as f64).round() as usize;
            values.get(rank).copied().unwrap_or(0.0)
        };
        Spread {
            median: at(0.5),
            p90: at(0.9),
            max: at(1.0),
        }
    }
}

/// Plays every nominal counterexample on every changed ego and compares the runs.
///
/// As many calibration starts as test starts are drawn from the calibration stream, so no
/// start is in both sets. `Ok(None)`: stopped.
///
/// # Errors
/// Returns an error if the nominal ego is stochastic, if some violations do not count, if
/// there are no changed egos, or if there is no counterexample.
pub fn carry_over(
    request: &TheoremsRequest<'_>,
    watch: &Watch<'_>,
) -> Result<Option<CarryOver>, TheoremsError> {
    let world = request.nominal.name.clone();
    // Two runs of one noisy ego are apart already, and Definition 5 compares two egos.
    if is_stochastic(request.nominal) {
        return Err(TheoremsError::Stochastic { world });
    }
    // Theorem 3 is about violations, of which a restricted world leaves some out.
    if !request.nominal.rulebook().counts.is_violation() {
        return Err(TheoremsError::NotEveryViolation { world });
    }
    let (changed, refused): (Vec<_>, Vec<_>) = request
        .changed
        .iter()
        .partition(|(_, scenario)| !is_stochastic(scenario));
    if changed.is_empty() && refused.is_empty() {
        return Err(TheoremsError::NothingChanged { world });
    }
    let played = TransferReplay {
        request,
        changed: &changed,
        // Test and calibration starts share a progress bar.
        all: EpisodeLoop::counted(watch, 2 * request.starts.starts.len()),
        watch,
    };
    let tests = played.all(Purpose::Test);
    // A stopped run may lack counterexamples for that reason alone.
    if tests.is_empty() && !watch.stopped() {
        return Err(TheoremsError::NoCounterexample { world });
    }
    let calibration = played.all(Purpose::Calibration);
    if watch.stopped() {
        return Ok(None);
    }
    let sets = CounterexampleSets { tests, calibration };
    let mut rows = Vec::new();
    for (ego, (name, _)) in changed.iter().enumerate() {
        for (ado, word) in ADOS.into_iter().enumerate() {
            // Invariant: the order matches `Played::compared`, ego by ego and way by way.
            let column = ego * ADOS.len() + ado;
            rows.push(row(name, word, column, &sets, request));
        }
    }
    let refused = refused.into_iter().map(|(ego, _)| Refused {
        ego: ego.clone(),
        why: TheoremsError::Stochastic { world: ego.clone() }.to_string(),
    });
    Ok(Some(CarryOver {
        counterexamples: sets.tests.len(),
        tau_at_verdict: Spread::of(sets.tests.iter().map(|test| test.tau_at_verdict)),
        tau: Spread::of(sets.tests.iter().map(|test| test.tau)),
        alpha: request.alpha,
        rows,
        refused: refused.collect(),
    }))
}

fn is_stochastic(scenario: &Scenario) -> bool {
    scenario
        .drive()
        .is_some_and(|driving| driving.spec().sensors.is_noisy())
}

/// Nominal counterexample with its runs on the changed egos.
struct ComparedCounterexample {
    tau_at_verdict: f64,
    tau: f64,
    /// Margins of the sharper test. `None` unless it applies.
    sharp_margins: Option<Vec<f64>>,
    /// Run per changed ego and way of acting.
    runs: Vec<TransferRun>,
}

/// Counterexamples of the two disjoint sets of starts.
struct CounterexampleSets {
    /// Those that a row counts.
    tests: Vec<ComparedCounterexample>,
    /// Those from which it forecasts.
    calibration: Vec<ComparedCounterexample>,
}

struct TransferRun {
    carried: bool,
    epsilon: f64,
    covered: bool,
    /// Increase and rule distances, with the result of the sharper test.
    sharp: Option<(Vec<f64>, bool)>,
}

/// Bench of the nominal ego and a bench per changed ego.
struct Benches {
    nominal: Testbench,
    changed: Vec<Testbench>,
}

struct TransferReplay<'a> {
    request: &'a TheoremsRequest<'a>,
    changed: &'a [&'a (String, Scenario)],
    all: EpisodeLoop<'a>,
    watch: &'a Watch<'a>,
}

impl TransferReplay<'_> {
    /// Returns the counterexamples of a purpose, in the order of their starts.
    fn all(&self, purpose: Purpose) -> Vec<ComparedCounterexample> {
        let starts = self.request.starts;
        let compare_one = |benches: &mut Benches, test: &(Start, u64), turn: &WorkItem| {
            let from = match purpose {
                // The ego fails there by itself, so the ado has no part in the failure.
                Purpose::Test if starts.trivial[turn.index] => return None,
                Purpose::Test => test.clone(),
                _ => self.calibration_start(&mut benches.nominal, turn.index)?,
            };
            // Both sets take the same path, because the bound holds for exchangeable
            // starts alone.
            self.compared(benches, NoisyStart::from(&from), turn.index)
        };
        let compared = self.all.run(&starts.starts, || self.benches(), compare_one);
        compared.into_iter().flatten().collect()
    }

    fn benches(&self) -> Benches {
        let changed = self.changed.iter().map(|(_, scenario)| scenario.bench());
        Benches {
            nominal: self.request.nominal.bench(),
            changed: changed.collect(),
        }
    }

    /// Returns a calibration start, or `None` if the ego fails there by itself.
    fn calibration_start(&self, nominal: &mut Testbench, index: usize) -> Option<(Start, u64)> {
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed: self.request.starts.seed,
            index: index as u64,
        };
        let start = (nominal.draw(key), nominal.noise_of(key));
        let mut coasting = Constant(nominal.spaces().neutral);
        let from = NoisyStart::from(&start);
        let episode = self
            .watch
            .play(nominal, from, index, &mut coasting, Aftermath::Skip);
        (!episode.verdict.is_success()).then_some(start)
    }

    fn compared(
        &self,
        Benches { nominal, changed }: &mut Benches,
        from: NoisyStart<'_>,
        index: usize,
    ) -> Option<ComparedCounterexample> {
        let horizon = nominal.clock().samples();
        let mut ado = PolicyActor(self.request.policy);
        let watch = self.watch;
        // The run continues after the verdict, because later samples may have a larger τ.
        let first = watch.play(nominal, from, index, &mut ado, Aftermath::Play);
        let witness = Witness::of(nominal.rulebook(), &first, horizon)?;
        // One way after the other on one bench, since a bench has a single state.
        let runs = changed.iter_mut().flat_map(|bench| {
            let mut run = |ado: &mut dyn Actor| -> TransferRun {
                let other = watch.play(bench, from, index, ado, Aftermath::Play);
                compare(&witness, bench, &other, horizon)
            };
            let closed = run(&mut PolicyActor(self.request.policy));
            // The replay uses the nominal actions, as Definition 5 requires.
            [closed, run(&mut Replay::holding(&first.actions))]
        });
        Some(ComparedCounterexample {
            runs: runs.collect(),
            tau_at_verdict: witness.tau_at_verdict,
            tau: witness.tau,
            sharp_margins: witness.sharp_margins(),
        })
    }
}

fn compare(witness: &Witness, bench: &Testbench, other: &Episode, horizon: usize) -> TransferRun {
    let distance = witness.distance(bench.rulebook(), other, horizon);
    // Both are `None` for another ψ_ego than an invariant.
    let sharp = witness.covers_sharply(&distance).and_then(|covered| {
        let rules = distance.rules.iter().copied();
        let parts = std::iter::once(distance.rise?).chain(rules);
        Some((parts.collect(), covered))
    });
    TransferRun {
        carried: other.verdict.is_success(),
        epsilon: distance.epsilon,
        covered: witness.covers(&distance),
        sharp,
    }
}

fn row(
    ego: &str,
    ado: &'static str,
    column: usize,
    CounterexampleSets { tests, calibration }: &CounterexampleSets,
    request: &TheoremsRequest<'_>,
) -> CarriedOver {
    let alpha = request.alpha;
    let runs = || tests.iter().map(|test| (test, &test.runs[column]));
    let plain: Vec<ForecastCase> = runs()
        .map(|(test, run)| ForecastCase {
            distances: vec![run.epsilon],
            margins: vec![test.tau],
            carried: run.carried,
        })
        .collect();
    // Calibration starts alone, since a bound that has seen the tests promises nothing.
    let seen: Vec<Vec<f64>> = calibration
        .iter()
        .map(|start| vec![start.runs[column].epsilon])
        .collect();
    // `None` as soon as a case lacks the sharper test, which applies to all or none.
    let sharp: Option<Vec<ForecastCase>> = runs()
        .map(|(test, run)| {
            Some(ForecastCase {
                distances: run.sharp.as_ref()?.0.clone(),
                margins: test.sharp_margins.clone()?,
                carried: run.carried,
            })
        })
        .collect();
    let promised = |test: fn(&TransferRun) -> bool| runs().filter(|(_, run)| test(run)).count();
    let sharper = sharp.map(|cases| {
        let seen = calibration
            .iter()
            .filter_map(|start| Some(start.runs[column].sharp.as_ref()?.0.clone()));
        Sharper {
            covered: promised(|run| run.is_sharply_covered()),
            misses: promised(|run| run.is_sharply_covered() && !run.carried),
            forecast: forecast(&seen.collect::<Vec<_>>(), &cases, alpha),
        }
    });
    CarriedOver {
        ego: ego.to_owned(),
        ado,
        pairs: tests.len(),
        carried: promised(|run| run.carried),
        epsilon: Spread::of(runs().map(|(_, run)| run.epsilon)),
        // The promise is counted on test runs, and the forecast below on calibration runs.
        covered: promised(|run| run.covered),
        misses: promised(|run| run.covered && !run.carried),
        forecast: forecast(&seen, &plain, alpha),
        sharper,
    }
}

impl TransferRun {
    fn is_sharply_covered(&self) -> bool {
        self.sharp.as_ref().is_some_and(|(_, covered)| *covered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_ranks_of_observed_values() {
        let of = |values: &[f64]| {
            let Spread { median, p90, max } = Spread::of(values.iter().copied());
            [median, p90, max]
        };
        let eleven: Vec<f64> = (0..11).rev().map(f64::from).collect();
        assert_eq!(of(&eleven), [5.0, 9.0, 10.0]);
        assert_eq!(of(&[3.0]), [3.0; 3]);
        assert_eq!(of(&[]), [0.0; 3]);
        assert_eq!(
            of(&[f64::INFINITY, 1.0, 2.0]),
            [2.0, f64::INFINITY, f64::INFINITY]
        );
        let json = serde_json::to_value(Spread::of([1.0, f64::INFINITY].into_iter()));
        assert_eq!(json.expect("words")["max"], "inf");
    }
}
