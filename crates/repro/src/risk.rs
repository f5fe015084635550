//! Estimates of risks against counted natural runs.

use serde::{Deserialize, Serialize};

use brakecheck::experiment::{EgoUnderTest, Watch};
use brakecheck::risk::{RiskRequest, RiskSettings, RiskTraffic, RiskTrafficError, ValueKind};
use brakecheck::run_dir::RunError;
use brakecheck::world::{PlantKind, Scenario};
use brakecheck_report::report::table::TextTable;
use brakecheck_risk::risk::{ProposalFault, unchecked_estimate};

/// Natural runs of a piece.
pub const COUNTED_PIECE: usize = 500_000;
/// Quantile of the normal distribution for 95 %.
const NORMAL_95: f64 = 1.96;

/// Case of a study: a world in declared traffic, and the way to learn.
#[derive(Clone, Copy, Debug)]
pub struct RiskCase {
    /// Name of the case.
    pub name: &'static str,
    /// Name of the world.
    pub world: &'static str,
    /// Text of the world, if it is not shipped.
    pub text: Option<&'static str>,
    /// Text of the traffic.
    pub traffic: &'static str,
    /// Plant of the ego.
    pub plant: PlantKind,
    /// Plant of the proposals, if it is another one.
    pub learn_on: Option<PlantKind>,
    /// Form of V.
    pub value: ValueKind,
    /// Proposals that are wrong on purpose.
    pub fault: Option<ProposalFault>,
    /// Most runs of an estimate and natural runs within them, if not the default numbers.
    pub budget: Option<[usize; 2]>,
}

/// Estimate of a seed.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RiskSeed {
    /// Seed of all draws.
    pub seed: u64,
    /// Estimate and 95 % interval, also if it was refused. `None` without a failure.
    pub estimate: Option<[f64; 3]>,
    /// Effective number of failures.
    pub ess: f64,
    /// Number of failures.
    pub hits: usize,
    /// k̂ of the weights.
    pub pareto_k: Option<f64>,
    /// Expected share of weights above all seen.
    pub unseen_share: Option<f64>,
    /// Covered probes, and all.
    pub probes: [usize; 2],
    /// Reasons of the refusals.
    pub refusals: Vec<String>,
    /// Runs of the ego, natural ones and those without use for the estimate included.
    pub runs: usize,
    /// Runs on another plant.
    pub learning: usize,
}

/// Natural runs and failures.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct CountedRuns {
    /// Runs from starts inside the world's ranges.
    pub runs: f64,
    /// Failures.
    pub failures: usize,
}

/// Estimates of a case, beside counted runs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RiskStudy {
    /// Name of the case.
    pub case: String,
    /// Determine whether its proposals are wrong on purpose.
    pub is_faulty: bool,
    /// Counted runs.
    pub counted: CountedRuns,
    /// Estimates.
    pub seeds: Vec<RiskSeed>,
}

impl RiskCase {
    /// Returns the world of the case and its traffic.
    ///
    /// # Errors
    /// The traffic does not fit the world.
    pub fn traffic(&self, world: &Scenario) -> Result<RiskTraffic, RiskTrafficError> {
        RiskTraffic::parse(world, self.name, self.traffic)
    }
}

/// Estimates the risk of a world's ego with one seed. `None`: stopped.
///
/// # Errors
/// A run cannot be stored.
pub fn risk_seed(
    world: &Scenario,
    traffic: &RiskTraffic,
    case: &RiskCase,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<Option<RiskSeed>, RunError> {
    let egos = [EgoUnderTest::nominal(world)];
    let mut request = RiskRequest::new(traffic, &egos);
    request.settings.seed = seed;
    request.settings.learn_on = case.learn_on;
    request.settings.value = case.value;
    request.fault = case.fault;
    if let Some([budget, natural]) = case.budget {
        request.settings.budget = budget;
        request.settings.natural = natural;
    }
    let Some(report) = request.estimate(watch)? else {
        return Ok(None);
    };
    let ego = &report.egos[0];
    let estimate = unchecked_estimate(ego);
    let checks = ego.checks.as_ref();
    Ok(Some(RiskSeed {
        seed,
        estimate: estimate.map(|it| [it.probability, it.interval[0], it.interval[1]]),
        ess: estimate.map_or(0.0, |it| it.ess),
        hits: estimate.map_or(0, |it| it.hits),
        pareto_k: checks.and_then(|it| it.pareto_k),
        unseen_share: checks.and_then(|it| it.unseen_share),
        probes: checks.map_or([0; 2], |it| it.probes),
        refusals: ego.refusals().iter().map(|it| it.reason.clone()).collect(),
        runs: report.cost.of_ego(),
        learning: report.cost.learning,
    }))
}

/// Counts the failures of a piece of natural runs. `None`: stopped.
///
/// # Errors
/// A run cannot be stored.
pub fn counted_piece(
    world: &Scenario,
    traffic: &RiskTraffic,
    runs: usize,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<Option<CountedRuns>, RunError> {
    let egos = [EgoUnderTest::nominal(world)];
    let mut request = RiskRequest::new(traffic, &egos);
    request.settings = RiskSettings::default();
    request.settings.seed = seed;
    request.settings.natural = runs;
    // Nothing is left for proposals, whose runs would not be counted.
    request.settings.budget = runs;
    let Some(report) = request.estimate(watch)? else {
        return Ok(None);
    };
    let ego = &report.egos[0];
    let failures = match &ego.checks {
        Some(checks) => checks.natural_failures,
        None => ego.readings.fails.map_or(0, |it| it.hits),
    };
    Ok(Some(CountedRuns {
        runs: report.cost.natural as f64 * report.inside,
        failures,
    }))
}

impl CountedRuns {
    /// Returns the sum of both.
    pub fn plus(self, other: CountedRuns) -> CountedRuns {
        CountedRuns {
            runs: self.runs + other.runs,
            failures: self.failures + other.failures,
        }
    }

    /// Returns the rate and its standard error. `None` without a failure.
    fn rate(self) -> Option<[f64; 2]> {
        let rate = self.failures as f64 / self.runs;
        (self.failures > 0).then(|| [rate, rate / (self.failures as f64).sqrt()])
    }
}

impl RiskStudy {
    fn estimates(&self) -> Vec<[f64; 3]> {
        self.seeds.iter().filter_map(|it| it.estimate).collect()
    }

    /// Returns the mean of all estimates and its standard error.
    fn mean(&self) -> Option<[f64; 2]> {
        let all = self.estimates();
        let n = all.len() as f64;
        if all.len() < 2 {
            return None;
        }
        let mean = all.iter().map(|it| it[0]).sum::<f64>() / n;
        let squares = all.iter().map(|it| (it[0] - mean) * (it[0] - mean));
        Some([mean, (squares.sum::<f64>() / (n - 1.0) / n).sqrt()])
    }

    /// Returns the best known risk: both means, weighted by their precision.
    ///
    /// Estimates of faulty proposals say nothing about it.
    fn truth(&self) -> Option<f64> {
        let precise = |[mean, error]: [f64; 2]| (mean / (error * error), 1.0 / (error * error));
        let mean = self.mean().filter(|_| !self.is_faulty);
        let parts = [mean, self.counted.rate()]
            .into_iter()
            .flatten()
            .map(precise);
        let sums = parts.fold((0.0, 0.0), |sum, it| (sum.0 + it.0, sum.1 + it.1));
        (sums.1 > 0.0).then(|| sums.0 / sums.1)
    }

    fn row(&self) -> [String; 10] {
        let n = self.seeds.len();
        let share = |count: usize, of: usize| format!("{count} of {of}");
        let number = |value: f64| format!("{value:.2e}");
        let truth = self.truth().unwrap_or(f64::NAN);
        let all = self.estimates();
        let covered = all.iter().filter(|it| it[1] <= truth && truth <= it[2]);
        let low = self
            .seeds
            .iter()
            .filter(|it| it.estimate.is_some_and(|it| it[2] < truth));
        let flagged = low.clone().filter(|it| !it.refusals.is_empty()).count();
        let sound = self.seeds.iter().filter(|it| {
            it.estimate
                .is_some_and(|it| it[1] <= truth && truth <= it[2])
        });
        let refused = sound.clone().filter(|it| !it.refusals.is_empty()).count();
        let counted = self.counted.rate();
        let apart = match (self.mean(), counted) {
            (Some([a, da]), Some([b, db])) => {
                format!("{:+.1}", (a - b) / (da * da + db * db).sqrt())
            }
            _ => "–".to_owned(),
        };
        let gain = self.seeds.iter().filter_map(|it| {
            let [p, _, hi] = it.estimate?;
            let spread = libm::log(hi / p) / NORMAL_95;
            Some((1.0 - p) / (p * spread * spread) / it.runs as f64)
        });
        let runs = self.seeds.iter().map(|it| it.runs as f64);
        let half = all.iter().map(|it| 100.0 * (it[2] / it[0] - 1.0));
        [
            self.case.clone(),
            counted.map_or("none".to_owned(), |[p, error]| {
                format!(
                    "{} ± {:.1} % ({:.1e} runs)",
                    number(p),
                    100.0 * NORMAL_95 * error / p,
                    self.counted.runs
                )
            }),
            self.mean().map_or("–".to_owned(), |[p, error]| {
                format!("{} ± {:.1} %", number(p), 100.0 * NORMAL_95 * error / p)
            }),
            apart,
            share(covered.count(), n),
            share(flagged, low.count()),
            share(refused, sound.count()),
            format!("{:.0}", median(runs.collect())),
            format!("{:.0} %", median(half.collect())),
            format!("{:.0}", median(gain.collect())),
        ]
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns a table with a row per case.
pub fn risk_markdown(studies: &[RiskStudy]) -> String {
    let columns = [
        "case",
        "counted",
        "mean of estimates",
        "joint standard errors apart",
        "intervals that cover",
        "too low and refused",
        "covering and refused",
        "ego runs, median",
        "half-width, median",
        "times fewer runs than counting",
    ];
    TextTable::new(columns, studies.iter().map(RiskStudy::row)).to_markdown()
}
