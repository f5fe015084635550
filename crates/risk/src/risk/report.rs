//! Results of an estimation of risk, in JSON and in words.

use serde::{Deserialize, Serialize};

use super::checks::{Checks, Refusal};
use super::limits::RiskLimits;
use super::natural_counts::{FaultsAs, NaturalCounts};
use super::pool::{RiskEstimate, Round, pooled};
use super::record::{DriverAnswer, RiskRun};
use super::run_faults::RunFaults;
use crate::rulebook::Counts;
use crate::testbench::FaultCount;
use crate::world::EncounterRate;

/// Runs behind a risk, per ego.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RiskCost {
    /// Natural runs.
    pub natural: usize,
    /// Runs to find failures: random actions, counterexamples from elsewhere, a first round.
    pub exploring: usize,
    /// Runs of a search for failures of every kind.
    pub searching: usize,
    /// Runs of the estimate.
    pub rounds: usize,
    /// Runs from which a surrogate of the ego was fitted.
    pub surrogate: usize,
    /// Runs on another plant or in the surrogate, of which only the proposals are learned.
    pub learning: usize,
    /// Number of egos.
    pub egos: usize,
}

impl RiskCost {
    /// Returns the runs of one ego on its own plant.
    pub fn of_ego(&self) -> usize {
        self.natural + self.exploring + self.searching + self.surrogate + self.rounds
    }
}

/// Risk by kind of failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModeRisk {
    /// Kind of failure: contact or violated leaf, manoeuvre, and the state of the rules.
    pub mode: String,
    /// Share of the risk.
    pub share: f64,
    /// Probability per run.
    pub risk: RiskEstimate,
}

/// Probabilities per run, each with its interval.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RiskReadings {
    /// Probability that the ego fails. `None` if the estimate was refused.
    pub fails: Option<RiskEstimate>,
    /// That it fails, with every rule kept.
    pub fails_lawful: Option<RiskEstimate>,
    /// That it fails where a driver model of UN R157 has no contact.
    pub fails_preventable: Option<RiskEstimate>,
    /// That it fails where no driver model of UN R157 applies.
    pub fails_unjudged: Option<RiskEstimate>,
    /// That it fails, given that every rule is kept. A share of lawful runs alone.
    pub fails_given_lawful: Option<RiskEstimate>,
    /// That every rule is kept. A share of the first natural runs.
    pub lawful: Option<RiskEstimate>,
}

/// Readings of runs of which some ended in a fault.
///
/// The truth is in between, since such a run might have ended in a failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RiskBounds {
    /// Readings if no fault would have been a failure.
    pub least: RiskReadings,
    /// Readings if every fault would have been a failure.
    pub most: RiskReadings,
}

/// Risk of an ego, per run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EgoRisk {
    /// Name of the ego.
    pub ego: String,
    /// Bounds that hold whatever the proposals missed. `None` if natural runs were counted.
    pub limits: Option<RiskLimits>,
    /// Risks, if the kinds of failure that were found are all.
    ///
    /// All are `None` if the estimate was refused, or if runs ended in faults.
    #[serde(flatten)]
    pub readings: RiskReadings,
    /// Bounds of the risks. `None` without a fault among the counted runs, or if refused.
    pub between: Option<RiskBounds>,
    /// Number of natural runs of which `lawful` is a share.
    pub judged: usize,
    /// Runs of the ego, and its faults.
    #[serde(flatten)]
    pub faults: RunFaults,
    /// Shares of the kinds of failure, the greatest first. No fault is among them.
    pub modes: Vec<ModeRisk>,
    /// Share of the risk of kinds that a counterexample from elsewhere has shown.
    pub known_share: Option<f64>,
    /// Checks. `None` if natural runs were counted.
    pub checks: Option<Checks>,
    /// Known counterexamples that the traffic model cannot produce.
    pub impossible: usize,
    /// Reason why no run of a foreign ego is a result, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unrepeatable: Option<FaultCount>,
    /// Natural runs of equal width.
    pub crude_runs: Option<f64>,
    /// Likeliest failure of every kind.
    #[serde(skip)]
    pub(super) likeliest: Vec<RiskRun>,
}

/// Result of [`RiskRequest::estimate`](super::RiskRequest::estimate).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RiskReport {
    /// Name of the world.
    pub world: String,
    /// Plant of the runs.
    pub plant: String,
    /// Length of a run in seconds.
    pub horizon_s: f64,
    /// Origin of the traffic.
    pub traffic: String,
    /// Axes of the starts that are uniform, because no law is declared.
    pub uniform_axes: Vec<String>,
    /// Share of the law of starts inside X_init, to which all numbers refer.
    pub inside: f64,
    /// Violations of ψ_ego that count as failures.
    pub counts: Counts,
    /// Encounters by which a risk becomes a rate, if declared.
    pub exposure: Option<EncounterRate>,
    /// Risk per ego.
    pub egos: Vec<EgoRisk>,
    /// Ratio of the first ego's risk to the second's. `None` if runs ended in faults.
    pub ratio: Option<RiskEstimate>,
    /// Least and greatest ratio that faults allow. `None` without a fault.
    pub ratio_between: Option<[RiskEstimate; 2]>,
    /// Root mean square error of the surrogate of each ego, two seconds ahead, m.
    pub surrogate_errors_m: Vec<Option<f64>>,
    /// Runs.
    pub cost: RiskCost,
    /// Greatest ratio that is allowed, if one is (`--at-most`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
}

/// Weighted runs of an ego, which are pooled.
pub(super) struct WeightedRuns<'a> {
    /// Rounds that count.
    pub(super) rounds: &'a [Round],
    pub(super) limits: RiskLimits,
    /// Share of the law of starts inside X_init.
    pub(super) inside: RiskEstimate,
    /// Faults of all runs on the ego's own plant.
    pub(super) faults: RunFaults,
    /// Known counterexamples that are impossible in the traffic.
    pub(super) impossible: usize,
    pub(super) likeliest: Vec<RiskRun>,
}

impl RiskReadings {
    /// Returns the readings of counted natural runs.
    fn counted(natural: &NaturalCounts, faults: FaultsAs) -> RiskReadings {
        let rate = |failures: usize| natural.rate(failures, faults);
        // A fault that counts as a lawful failure is a lawful run, too.
        let lawful = natural.lawful_rate(FaultsAs::Failing);
        let fails_lawful = rate(natural.lawful);
        RiskReadings {
            fails: Some(rate(natural.failures())),
            fails_lawful: Some(fails_lawful),
            fails_preventable: Some(rate(natural.preventable)),
            fails_unjudged: Some(rate(natural.unjudged)),
            // Nothing can be conditioned on lawful runs if there are none.
            fails_given_lawful: (lawful.hits > 0).then(|| fails_lawful.over(&lawful).at_most_one()),
            lawful: (natural.judged() > 0).then(|| natural.lawful_rate(faults)),
        }
    }

    /// Returns the pooled readings of weighted runs. `None` without a failure.
    fn weighted(
        rounds: &[Round],
        inside: &RiskEstimate,
        natural: &NaturalCounts,
        faults: FaultsAs,
    ) -> Option<RiskReadings> {
        // Draws outside X_init are in every mean, but risks refer to starts inside.
        let per_start = |it: RiskEstimate| it.over(inside).at_most_one();
        let fails = pooled(rounds, |_| true).map(per_start)?;
        let fails_lawful = pooled(rounds, |it| it.lawful).map(per_start);
        // As in counted readings, a fault that may be a lawful failure is a lawful run.
        let lawful = natural.lawful_rate(FaultsAs::Failing);
        // Only some failures are assessed, so their share is carried over to all.
        let assessed = pooled(rounds, |it| it.preventable.is_some());
        let answered = |answer: DriverAnswer| {
            let found = pooled(rounds, |it| it.preventable == Some(answer))?;
            let whole = fails.probability / assessed?.probability;
            Some(found.scaled(whole).at_most_one())
        };
        Some(RiskReadings {
            fails: Some(fails),
            fails_lawful,
            fails_preventable: answered(DriverAnswer::Avoids),
            fails_unjudged: answered(DriverAnswer::NoAnswer),
            fails_given_lawful: fails_lawful
                .filter(|_| lawful.hits > 0)
                .map(|it| it.over(&lawful).at_most_one()),
            lawful: (natural.judged() > 0).then(|| natural.lawful_rate(faults)),
        })
    }
}

impl EgoRisk {
    /// Returns a risk without any reading.
    fn without_readings(ego: &str, natural: &NaturalCounts, faults: RunFaults) -> EgoRisk {
        EgoRisk {
            ego: ego.to_owned(),
            limits: None,
            readings: RiskReadings::default(),
            between: None,
            judged: natural.judged(),
            faults,
            modes: Vec::new(),
            known_share: None,
            checks: None,
            impossible: 0,
            unrepeatable: None,
            crude_runs: None,
            likeliest: Vec::new(),
        }
    }

    /// Adds the share of kinds that counterexamples from elsewhere have shown, if any.
    pub(super) fn with_known(self, known: &[&str]) -> EgoRisk {
        let of_known = self
            .modes
            .iter()
            .filter(|it| known.contains(&it.mode.as_str()));
        // Shares of kinds add up, because each failure has one kind.
        let share = of_known.map(|it| it.share).sum();
        EgoRisk {
            known_share: (!known.is_empty() && !self.modes.is_empty()).then_some(share),
            ..self
        }
    }

    /// Returns whether it comes from weighted runs, and not from counted ones.
    pub fn is_weighted(&self) -> bool {
        self.checks.is_some()
    }

    /// Returns the reasons why there is no result.
    pub fn refusals(&self) -> &[Refusal] {
        self.checks.as_ref().map_or(&[], |checks| &checks.refusals)
    }

    /// Returns the risk if no fault would have been a failure, and if every one would.
    ///
    /// Both are the same without a fault. `None` if the estimate was refused.
    pub fn least_and_most(&self) -> Option<[RiskEstimate; 2]> {
        match &self.between {
            Some(between) => Some([between.least.fails?, between.most.fails?]),
            None => self.readings.fails.map(|it| [it; 2]),
        }
    }

    /// Takes the readings of both meanings of a fault.
    fn read(&mut self, least: RiskReadings, most: Option<RiskReadings>) {
        match most {
            Some(most) => self.between = Some(RiskBounds { least, most }),
            None => self.readings = least,
        }
    }

    /// Returns the risk by the counts of natural runs.
    pub(super) fn counted(ego: &str, natural: &NaturalCounts) -> EgoRisk {
        let hits = natural.failures();
        let mut modes = natural.modes.clone();
        // Stable, so that kinds of equal counts keep the order in which they appeared.
        modes.sort_by(|_, a, _, b| b.cmp(a));
        let modes = modes.into_iter().map(|(mode, count)| ModeRisk {
            mode,
            // Without a failure there is no kind either, so the 1 divides nothing.
            share: count as f64 / hits.max(1) as f64,
            risk: natural.rate(count, FaultsAs::Held),
        });
        let mut risk = EgoRisk {
            modes: modes.collect(),
            crude_runs: Some(natural.inside() as f64),
            ..EgoRisk::without_readings(ego, natural, natural.faults.clone())
        };
        let readings = |faults| RiskReadings::counted(natural, faults);
        // Without a fault both readings would be the same table twice.
        let most = (natural.faults.invalid > 0).then(|| readings(FaultsAs::Failing));
        risk.read(readings(FaultsAs::Held), most);
        risk
    }

    /// Pools weighted runs.
    pub(super) fn weighted(
        ego: &str,
        runs: WeightedRuns<'_>,
        natural: &NaturalCounts,
        mut checks: Checks,
    ) -> EgoRisk {
        let WeightedRuns { rounds, inside, .. } = runs;
        // Risks refer to starts inside.
        let earlier = &mut checks.set_aside_probability;
        *earlier = earlier.map(|it| it / inside.probability);
        checks.refusals.extend(Refusal::of_limits(&runs.limits));
        let mut risk = EgoRisk {
            limits: Some(runs.limits),
            impossible: runs.impossible,
            likeliest: runs.likeliest,
            ..EgoRisk::without_readings(ego, natural, runs.faults)
        };
        // A refused estimate has no number that could be quoted.
        if checks.refusals.is_empty() {
            risk.pool(rounds, &inside, natural);
        }
        risk.checks = Some(checks);
        risk
    }

    fn pool(&mut self, rounds: &[Round], inside: &RiskEstimate, natural: &NaturalCounts) {
        let least = RiskReadings::weighted(rounds, inside, natural, FaultsAs::Held);
        let Some(least) = least else { return };
        // Shares below are divided by it.
        let Some(all) = least.fails else { return };
        let has_faults = rounds.iter().any(|round| !round.faults.is_empty());
        let most = if has_faults || natural.faults.invalid > 0 {
            let failing: Vec<Round> = rounds.iter().map(Round::with_failing_faults).collect();
            RiskReadings::weighted(&failing, inside, natural, FaultsAs::Failing)
        } else {
            None
        };
        self.read(least, most);
        let mut modes: Vec<&str> = Vec::new();
        for failure in rounds.iter().flat_map(|round| &round.failures) {
            if !modes.contains(&failure.mode.as_str()) {
                modes.push(&failure.mode);
            }
        }
        let modes = modes.into_iter().filter_map(|mode| {
            let risk = pooled(rounds, |it| it.mode == mode)?.over(inside);
            Some(ModeRisk {
                mode: mode.to_owned(),
                share: risk.probability / all.probability,
                risk,
            })
        });
        self.modes = modes.collect();
        self.modes.sort_by(|a, b| b.share.total_cmp(&a.share));
        // Half-width of counting: 1.96 · √((1 − p) / (p n)).
        let spread = libm::log(1.0 + all.half_width()) / 1.96;
        self.crude_runs = Some((1.0 - all.probability) / (all.probability * spread * spread));
    }
}

impl RiskReport {
    /// Returns a contradiction in a report that was read, `None` without one.
    pub fn contradiction(&self) -> Option<String> {
        let is_wrong = |it: &RiskEstimate| {
            let [lo, hi] = it.interval;
            // The negation refuses NaN as well.
            !(lo >= 0.0 && lo <= it.probability && it.probability <= hi && hi <= 1.0)
        };
        let wrong = self.egos.iter().find(|ego| {
            let ends = ego.least_and_most();
            let of_limits = ego.limits.iter().flat_map(RiskLimits::all);
            let is_no_bound = |end: &f64| !(0.0..=1.0).contains(end);
            ends.is_some_and(|ends| ends.iter().any(is_wrong))
                || of_limits.flatten().any(|end| is_no_bound(&end))
        })?;
        Some(format!(
            "the risk of `{}` is no probability within its interval",
            wrong.ego
        ))
    }

    /// Returns whether every ego has a result.
    pub fn is_result(&self) -> bool {
        // One refused ego makes the ratio of both worthless.
        let is_result = |ego: &EgoRisk| ego.refusals().is_empty() && ego.unrepeatable.is_none();
        self.egos.iter().all(is_result)
    }

    /// Returns the upper end of the ratio, with every fault of the first ego a failure.
    ///
    /// `None` without a ratio.
    pub fn greatest_ratio(&self) -> Option<f64> {
        // With faults the upper end is that of the worse reading.
        let most = self.ratio_between.map(|[_, most]| most);
        most.or(self.ratio).map(|it| it.interval[1])
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::LimitRuns;
    use super::super::mixture::Mixture;
    use super::super::natural_counts::JUDGED;
    use super::super::pool::{WeightedFailure, WeightedFault};
    use super::super::record::{EgoFailure, RunEnd};
    use super::super::report_text::{interval, number};
    use super::*;
    use crate::ego::Fault;

    #[test]
    fn the_rate_of_lawful_runs_is_of_judged_runs_only() {
        let failure = EgoFailure {
            mode: "contact".to_owned(),
            lawful: false,
            preventable: None,
        };
        // Half of the starts are outside, and a tenth of the judged runs break a rule.
        let judged = (0..JUDGED).map(|at| match at % 20 {
            0 => RunEnd::Held {
                lawful: Some(false),
            },
            it if it < 10 => RunEnd::Held { lawful: Some(true) },
            _ => RunEnd::Outside,
        });
        let later = [RunEnd::Failed(failure), RunEnd::Held { lawful: None }]
            .into_iter()
            .cycle()
            .take(1000);
        let mut natural = NaturalCounts::default();
        natural.add(judged.chain(later).map(RiskRun::ending).collect());
        let rate = natural.lawful_rate(FaultsAs::Held);
        assert_eq!((rate.probability, rate.hits), (0.9, 900));
        // 500 failures, of which none is lawful: nothing to divide, but no NaN either.
        let counted = EgoRisk::counted("ego", &natural);
        let readings = counted.readings;
        let given = readings.fails_given_lawful.expect("a rate");
        assert_eq!((given.probability, given.interval[0]), (0.0, 0.0));
        assert!(
            given.interval[1] > 0.0 && given.interval[1] < 0.01,
            "{given:?}"
        );
        let fails = readings.fails.expect("counted");
        assert_eq!((fails.hits, fails.probability), (500, 0.25));
    }

    const INSIDE: RiskEstimate = RiskEstimate {
        probability: 0.5,
        interval: [0.5; 2],
        ess: 1.0,
        hits: 1,
    };

    /// Round of 10,000 draws: 100 failures of weight 0.1, of which 60 are lawful, 50 are
    /// assessed, and 20 of these prevented. Ten runs ended in a fault.
    fn round(faults: usize) -> Round {
        let failure = |index: usize| WeightedFailure {
            index,
            component: 0,
            weight: 0.1,
            mode: if index < 60 { "rear-end" } else { "side-swipe" }.to_owned(),
            lawful: index < 60,
            preventable: match index {
                0..20 => Some(DriverAnswer::Avoids),
                20..40 => Some(DriverAnswer::Fails),
                40..50 => Some(DriverAnswer::NoAnswer),
                _ => None,
            },
        };
        let fault = |index: usize| WeightedFault {
            index: 1000 + index,
            component: 0,
            weight: 0.1,
        };
        Round {
            draws: vec![10_000],
            failures: (0..100).map(failure).collect(),
            faults: (0..faults).map(fault).collect(),
        }
    }

    /// Natural runs of which four fifths keep every rule.
    fn natural() -> NaturalCounts {
        let ends = (0..1000).map(|at| RunEnd::Held {
            lawful: Some(at % 5 > 0),
        });
        let mut natural = NaturalCounts::default();
        natural.add(ends.map(RiskRun::ending).collect());
        natural
    }

    fn weighted(rounds: &[Round], natural: &NaturalCounts) -> EgoRisk {
        let mixture = Mixture::natural(0);
        let checks = Checks::of(rounds, natural, 1.0, &mixture, &[]);
        let limits = RiskLimits::of(&LimitRuns {
            rounds,
            least_rounds: 3,
            natural,
            inside: INSIDE,
            limit: 1.0,
            mixture: &mixture,
        });
        let runs = WeightedRuns {
            rounds,
            limits,
            inside: INSIDE,
            faults: RunFaults::default(),
            impossible: 3,
            likeliest: Vec::new(),
        };
        EgoRisk::weighted("ego", runs, natural, checks)
    }

    #[test]
    fn weighted_readings_are_shares_of_starts_inside() {
        let risk = weighted(&[round(0)], &natural());
        let readings = &risk.readings;
        let of = |it: Option<RiskEstimate>| it.map(|it| (it.probability * 1e6).round());
        // 100 of weight 0.1 in 10,000 draws, of which half are inside.
        assert_eq!(of(readings.fails), Some(2000.0));
        assert_eq!(of(readings.fails_lawful), Some(1200.0));
        // 20 and 10 of the 50 that are assessed.
        assert_eq!(of(readings.fails_preventable), Some(800.0));
        assert_eq!(of(readings.fails_unjudged), Some(400.0));
        assert_eq!(of(readings.fails_given_lawful), Some(1500.0));
        assert_eq!(readings.lawful.map(|it| it.probability), Some(0.8));
        assert_eq!((risk.judged, risk.impossible), (1000, 3));
        assert!(risk.between.is_none() && risk.is_weighted());
        let shares: Vec<(&str, f64)> = risk
            .modes
            .iter()
            .map(|it| (it.mode.as_str(), it.share))
            .collect();
        assert_eq!(shares[0].0, "rear-end");
        assert!((shares[0].1 - 0.6).abs() < 1e-9 && (shares[1].1 - 0.4).abs() < 1e-9);
        assert!((risk.modes[0].risk.probability - 1.2e-3).abs() < 1e-9);
        // Counting would need n with 1.96 · √((1 − p) / (p n)) as the half-width.
        let crude = risk.crude_runs.expect("a result");
        let p = 2e-3;
        let half = libm::exp(1.96 * libm::sqrt((1.0 - p) / (p * crude))) - 1.0;
        let own = readings.fails.expect("a result").half_width();
        assert!((half - own).abs() < 1e-9, "{half} instead of {own}");
        let known = risk.clone().with_known(&["side-swipe"]).known_share;
        assert!((known.expect("named") - 0.4).abs() < 1e-9);
        assert_eq!(risk.with_known(&[]).known_share, None);
    }

    #[test]
    fn weighted_faults_leave_bounds_and_no_number() {
        let risk = weighted(&[round(10)], &natural());
        assert_eq!(risk.readings, RiskReadings::default());
        let between = risk.between.clone().expect("faults");
        let of = |it: Option<RiskEstimate>| it.map(|it| (it.probability * 1e6).round());
        assert_eq!(of(between.least.fails), Some(2000.0));
        assert_eq!(of(between.most.fails), Some(2200.0));
        assert_eq!(of(between.least.fails_lawful), Some(1200.0));
        assert_eq!(of(between.most.fails_lawful), Some(1400.0));
        assert!(of(between.most.fails_preventable) >= Some(1000.0));
        // A fault of a natural run alone forbids a single number, too.
        let mut natural = natural();
        let fault = Fault::error("x");
        natural.add(vec![RiskRun::ending(RunEnd::Invalid { fault })]);
        // 1 of 1001 natural runs is more than the half-width of the estimate.
        assert!(!weighted(&[round(0)], &natural).refusals().is_empty());
        natural.add(vec![RiskRun::ending(RunEnd::Held { lawful: None }); 9000]);
        // As many failures as the rounds let expect.
        let failure = EgoFailure {
            mode: "rear-end".to_owned(),
            lawful: true,
            preventable: None,
        };
        natural.add(vec![RiskRun::ending(RunEnd::Failed(failure)); 10]);
        let risk = weighted(&[round(0)], &natural);
        assert_eq!(risk.refusals(), []);
        assert!(risk.between.is_some());
    }

    fn report(egos: Vec<EgoRisk>) -> RiskReport {
        RiskReport {
            world: "acc".to_owned(),
            plant: "kinematic".to_owned(),
            horizon_s: 15.0,
            traffic: "test".to_owned(),
            uniform_axes: vec!["ado.speed".to_owned()],
            inside: 0.9,
            counts: Counts::Preventable {
                by: vec![crate::ego::reference::ReferenceDriver::Fsm],
                closing_mps: 3.0,
            },
            exposure: None,
            egos,
            ratio: None,
            ratio_between: None,
            surrogate_errors_m: Vec::new(),
            cost: RiskCost::default(),
            at_most: None,
        }
    }

    #[test]
    fn a_claim_is_the_pair_of_bounds_and_then_what_it_is_if_all_kinds_were_found() {
        let sound = weighted(&[round(0)], &natural());
        let text = report(vec![sound.clone()]).to_string();
        let pair = |ego: &EgoRisk| ego.limits.expect("weighted").fails.map(number);
        let [least, most] = pair(&sound);
        let interval = interval(&sound.readings.fails.expect("a result"));
        for said in [
            &format!(
                "in runs of 15 s, `ego` fails in at least {least} of runs (whatever was missed can \
                 only add) and at most {most} (trusts no proposal), 95 %"
            )[..],
            &format!(
                "if the kinds found are all, `ego` fails in 2.00e-3 (95 % interval {interval})"
            ),
            "60 % rear-end; 40 % side-swipe",
            "more that the fuzzy safety model of UN R157 (FSM) avoids (`counts`)",
            "90.0 % of the law of starts is inside",
            "warning: the traffic excludes 3 known counterexamples",
        ] {
            assert!(text.contains(said), "{said}: {text}");
        }
        let first: Vec<&str> = text.lines().take(2).collect();
        assert!(first[0].contains("at least") && first[1].starts_with("if the kinds"));
        let faulty = weighted(&[round(10)], &natural());
        let [_, most] = pair(&faulty);
        let text = report(vec![faulty]).to_string();
        let said = format!("at most {most} (trusts no proposal), 95 %, since 0 of 0 runs ended in");
        assert!(text.contains(&said), "{said}: {text}");
        // A refused estimate has its bounds alone, per start inside.
        let refused = weighted(&[], &natural());
        let [_, most] = pair(&refused);
        let refused = report(vec![refused]);
        assert!(!refused.is_result());
        let said = format!("fails in at most {most} of runs (trusts no proposal), 95 %");
        assert!(refused.to_string().contains(&said), "{refused}");
        assert!(refused.to_string().contains("ego: no result"));
        let few = report(vec![weighted(&[weak()], &natural())]).to_string();
        assert!(
            few.contains("fails in at least ") && few.contains("ego: no result"),
            "{few}"
        );
        assert!(!few.contains("if the kinds found are all"), "{few}");
    }

    /// Round whose failures are too few for a result.
    fn weak() -> Round {
        let mut few = round(0);
        few.failures.truncate(20);
        few
    }

    #[test]
    fn bounds_that_exclude_each_other_are_no_result() {
        let mut sound = NaturalCounts::default();
        sound.add(vec![
            RiskRun::ending(RunEnd::Held { lawful: None });
            100_000
        ]);
        let mut many = round(0);
        many.failures.iter_mut().for_each(|it| it.weight = 5.0);
        let risk = weighted(&[many], &sound);
        let reasons = risk.refusals().iter().map(|it| it.reason.as_str());
        assert!(
            reasons.clone().any(|it| it.starts_with("at least ")),
            "{:?}",
            risk.refusals()
        );
        assert!(risk.readings.fails.is_none());
        let mut read = report(vec![weighted(&[round(0)], &natural())]);
        assert_eq!(read.contradiction(), None);
        if let Some(limits) = &mut read.egos[0].limits {
            limits.fails_lawful[1] = 1.5;
        }
        assert!(read.contradiction().is_some());
    }

    #[test]
    fn the_greatest_ratio_is_the_one_with_every_fault() {
        let [narrow, wide] = [0.5, 0.9].map(|upper| RiskEstimate {
            interval: [0.1, upper],
            ..INSIDE
        });
        let of = |ratio, ratio_between| {
            let report = RiskReport {
                ratio,
                ratio_between,
                ..report(Vec::new())
            };
            report.greatest_ratio()
        };
        assert_eq!(of(None, None), None);
        assert_eq!(of(Some(narrow), None), Some(0.5));
        assert_eq!(of(None, Some([narrow, wide])), Some(0.9));
    }

    #[test]
    fn rates_and_ratios_are_printed_with_both_ends_of_what_faults_allow() {
        let [sound, faulty] = [0, 10].map(|faults| weighted(&[round(faults)], &natural()));
        let hourly = |egos: Vec<EgoRisk>, ratio, ratio_between| {
            let report = RiskReport {
                exposure: Some(EncounterRate::PerHour(20.0)),
                ratio,
                ratio_between,
                ..report(egos)
            };
            report.to_string()
        };
        let text = hourly(vec![sound.clone()], None, None);
        assert!(
            text.contains("20 encounters per hour: 0.0400 failures, 0.03"),
            "{text}"
        );
        let text = hourly(vec![faulty.clone()], None, None);
        assert!(
            text.contains("per hour: 0.0400 to 0.0440 failures, 0.03"),
            "{text}"
        );
        let ratio = RiskEstimate {
            interval: [0.25, 0.75],
            ..INSIDE
        };
        let text = hourly(vec![sound.clone(), sound.clone()], Some(ratio), None);
        assert!(
            text.contains("ratio of `ego` to `ego`: 0.50, 0.25 … 0.75"),
            "{text}"
        );
        let text = hourly(vec![faulty, sound], None, Some([ratio, INSIDE.scaled(2.0)]));
        assert!(text.contains("`ego`: 0.50 to 1.00, 0.25 … 1.00"), "{text}");
    }

    #[test]
    fn runs_are_counted_where_they_were_played() {
        let cost = RiskCost {
            natural: 1,
            exploring: 2,
            searching: 6,
            rounds: 3,
            surrogate: 4,
            learning: 5,
            egos: 1,
        };
        assert_eq!(cost.of_ego(), 16);
        let line = |cost: RiskCost| {
            let report = RiskReport {
                cost,
                ..report(Vec::new())
            };
            let text = report.to_string();
            let line = text.lines().find(|it| it.starts_with("runs per ego"));
            line.expect("a line").to_owned()
        };
        let plain = "runs per ego: 1 natural, 2 exploring, 6 searching for kinds, 3 in rounds";
        assert_eq!(line(cost), format!("{plain}, 4 for its surrogate, 5 in it"));
        let on_other = RiskCost {
            surrogate: 0,
            ..cost
        };
        assert_eq!(line(on_other), format!("{plain}, 5 on another plant"));
        let on_own = RiskCost {
            learning: 0,
            ..on_other
        };
        assert_eq!(line(on_own), plain);
    }

    #[test]
    fn a_report_names_its_starts_its_checks_and_what_counting_would_cost() {
        let sound = weighted(&[round(0)], &natural());
        let said = |inside: f64, axes: &[&str]| {
            let report = RiskReport {
                inside,
                uniform_axes: axes.iter().map(|it| (*it).to_owned()).collect(),
                ..report(vec![sound.clone()])
            };
            report.to_string()
        };
        let text = said(0.9, &["ado.speed", "ego.speed"]);
        for line in [
            "in traffic “test”, on the kinematic plant, in runs of 15 s, `ego` fails in",
            "starts uniform over the world's ranges, without a law: ado.speed, ego.speed",
            "90.0 % of the law of starts is inside the world's ranges",
            "of the failures:",
            " 60.0 %  1.2e-3  rear-end",
            "counting alone would need ",
        ] {
            assert!(
                text.lines().any(|it| it.starts_with(line)),
                "{line}: {text}"
            );
        }
        assert!(
            text.contains("100 failures, largest 1.0 %, probes 0 of 0 covered"),
            "{text}"
        );
        let text = said(0.9995, &[]);
        assert!(
            !text.contains("is inside") && !text.contains("starts uniform"),
            "{text}"
        );
        // Known kinds have a line, and faults one for each kind.
        let mut known = sound.clone().with_known(&["side-swipe"]);
        known.impossible = 0;
        let text = report(vec![known]).to_string();
        assert!(
            text.contains(" 40.0 %  of kinds that known counterexamples show"),
            "{text}"
        );
        assert!(
            !text.contains("warning") && !text.contains("invalid"),
            "{text}"
        );
        assert_eq!([0.00999, 0.01].map(number), ["9.99e-3", "0.0100"]);
    }

    #[test]
    fn an_ego_that_is_not_repeatable_has_no_result() {
        let sound = weighted(&[round(0)], &natural());
        assert!(report(vec![sound.clone()]).is_result());
        let unrepeatable = EgoRisk {
            unrepeatable: Some(FaultCount {
                kind: crate::ego::FaultKind::KeptState,
                message: "keeps state".to_owned(),
                stderr: String::new(),
                first_start: 0,
                count: 1,
            }),
            ..sound.clone()
        };
        assert!(!report(vec![sound, unrepeatable]).is_result());
    }
}
