//! Results of an estimation of risk, in JSON and in words.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use super::checks::{Checks, Refusal};
use super::natural_counts::NaturalCounts;
use super::pool::{RiskEstimate, Round, pooled};
use super::record::RiskRun;
use crate::world::EncounterRate;

/// Runs behind a risk, per ego.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RiskCost {
    /// Natural runs.
    pub natural: usize,
    /// Runs to find failures: random actions, counterexamples from elsewhere, a first round.
    pub exploring: usize,
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
        self.natural + self.exploring + self.surrogate + self.rounds
    }
}

/// Risk by kind of failure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModeRisk {
    /// Kind of failure: contact, and the state of the rules.
    pub mode: String,
    /// Share of the risk.
    pub share: f64,
    /// Probability per run.
    pub risk: RiskEstimate,
}

/// Risk of an ego, per run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EgoRisk {
    /// Name of the ego.
    pub ego: String,
    /// Probability that it fails. `None` if the estimate was refused.
    pub fails: Option<RiskEstimate>,
    /// That it fails, with every rule kept.
    pub fails_lawful: Option<RiskEstimate>,
    /// That it fails, given that every rule is kept.
    pub fails_given_lawful: Option<RiskEstimate>,
    /// That it fails where a driver model of UN R157 has no contact.
    pub fails_preventable: Option<RiskEstimate>,
    /// Shares of the kinds of failure, the greatest first.
    pub modes: Vec<ModeRisk>,
    /// Share of the risk of kinds that a counterexample from elsewhere has shown.
    pub known_share: Option<f64>,
    /// Checks. `None` if natural runs were counted.
    pub checks: Option<Checks>,
    /// Known counterexamples that the traffic model cannot produce.
    pub impossible: usize,
    /// Natural runs of equal width.
    pub crude_runs: Option<f64>,
    /// Likeliest failure of every kind.
    #[serde(skip)]
    pub(super) likeliest: Vec<RiskRun>,
    /// Estimate before the checks, to measure them.
    #[serde(skip)]
    pub(super) unchecked: Option<RiskEstimate>,
}

/// Result of [`RiskRequest::estimate`](super::RiskRequest::estimate).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
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
    /// Encounters by which a risk becomes a rate, if declared.
    pub exposure: Option<EncounterRate>,
    /// Risk per ego.
    pub egos: Vec<EgoRisk>,
    /// Ratio of the first ego's risk to the second's.
    pub ratio: Option<RiskEstimate>,
    /// Root mean square error of the surrogate of each ego, two seconds ahead, m.
    pub surrogate_errors_m: Vec<Option<f64>>,
    /// Runs.
    pub cost: RiskCost,
}

impl EgoRisk {
    /// Adds the share of kinds that counterexamples from elsewhere have shown, if any.
    pub(super) fn with_known(self, known: &[&str]) -> EgoRisk {
        let of_known = self.modes.iter();
        let of_known = of_known.filter(|it| known.contains(&it.mode.as_str()));
        let share = of_known.map(|it| it.share).sum();
        EgoRisk {
            known_share: (!known.is_empty() && self.fails.is_some()).then_some(share),
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

    /// Returns the risk by the counts of natural runs.
    pub(super) fn counted(ego: &str, natural: &NaturalCounts) -> EgoRisk {
        let counted = |hits: usize| RiskEstimate::counted(hits, natural.inside());
        let (hits, lawful) = (natural.failures(), natural.lawful);
        let rate = natural.lawful_rate();
        let mut modes = natural.modes.clone();
        modes.sort_by(|_, a, _, b| b.cmp(a));
        let modes = modes.into_iter().map(|(mode, count)| ModeRisk {
            mode,
            share: count as f64 / hits.max(1) as f64,
            risk: counted(count),
        });
        EgoRisk {
            ego: ego.to_owned(),
            fails: Some(counted(hits)),
            fails_lawful: Some(counted(lawful)),
            fails_given_lawful: (0 < rate.hits).then(|| counted(lawful).over(&rate).at_most_one()),
            fails_preventable: Some(counted(natural.preventable)),
            modes: modes.collect(),
            known_share: None,
            checks: None,
            impossible: 0,
            crude_runs: Some(natural.inside() as f64),
            likeliest: Vec::new(),
            unchecked: Some(counted(hits)),
        }
    }

    /// Pools weighted runs.
    ///
    /// `inside` is the share of the law of starts inside X_init. `lawful` is the rate of
    /// natural runs that keep every rule.
    pub(super) fn weighted(
        ego: &str,
        (rounds, inside): (&[Round], &RiskEstimate),
        (mut checks, impossible): (Checks, usize),
        lawful: &RiskEstimate,
        likeliest: Vec<RiskRun>,
    ) -> EgoRisk {
        // The bound is of all draws, but risks refer to starts inside.
        checks.bound = (checks.bound / inside.probability).min(1.0);
        let mut risk = EgoRisk {
            ego: ego.to_owned(),
            fails: None,
            fails_lawful: None,
            fails_given_lawful: None,
            fails_preventable: None,
            modes: Vec::new(),
            impossible,
            known_share: None,
            crude_runs: None,
            checks: None,
            likeliest,
            unchecked: pooled(rounds, |_| true).map(|it| it.over(inside)),
        };
        // A refused estimate has no number that could be quoted.
        if checks.refusals.is_empty() {
            risk.read(rounds, inside, lawful);
        }
        risk.checks = Some(checks);
        risk
    }

    fn read(&mut self, rounds: &[Round], inside: &RiskEstimate, lawful: &RiskEstimate) {
        // Draws outside X_init are in every mean, but risks refer to starts inside.
        let per_start = |it: RiskEstimate| it.over(inside);
        let Some(all) = pooled(rounds, |_| true).map(per_start) else {
            return;
        };
        let with_rules = pooled(rounds, |it| it.lawful).map(per_start);
        self.fails = Some(all);
        self.fails_lawful = with_rules;
        self.fails_given_lawful = with_rules
            .filter(|_| 0 < lawful.hits)
            .map(|it| it.over(lawful).at_most_one());
        // Only some failures are assessed, so their share is carried over to all.
        let assessed = pooled(rounds, |it| it.preventable.is_some());
        let prevented = pooled(rounds, |it| it.preventable == Some(true));
        self.fails_preventable = assessed
            .zip(prevented)
            .map(|(assessed, it)| it.scaled(all.probability / assessed.probability));
        let mut modes: Vec<&str> = Vec::new();
        for failure in rounds.iter().flat_map(|round| &round.failures) {
            if !modes.contains(&failure.mode.as_str()) {
                modes.push(&failure.mode);
            }
        }
        let modes = modes.into_iter().filter_map(|mode| {
            let risk = per_start(pooled(rounds, |it| it.mode == mode)?);
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

/// Returns the estimate of an ego as if no check had refused it.
pub fn unchecked_estimate(risk: &EgoRisk) -> Option<RiskEstimate> {
    risk.unchecked
}

impl RiskReport {
    /// Returns whether every ego has a result.
    pub fn is_result(&self) -> bool {
        self.egos.iter().all(|ego| ego.refusals().is_empty())
    }

    fn readings(&self, f: &mut Formatter<'_>, ego: &EgoRisk) -> fmt::Result {
        let rows = [
            ("fails", ego.fails),
            ("  and lawful", ego.fails_lawful),
            ("  given lawful", ego.fails_given_lawful),
            ("  and preventable", ego.fails_preventable),
        ];
        writeln!(f, "{:24}probability    95 % interval          ESS", ego.ego)?;
        for (name, risk) in rows {
            match risk {
                Some(risk) => writeln!(
                    f,
                    "{name:24}{:<15}{:<23}{:.0}",
                    number(risk.probability),
                    interval(&risk),
                    risk.ess
                )?,
                None => writeln!(f, "{name:24}none observed")?,
            }
        }
        for mode in &ego.modes {
            writeln!(
                f,
                "{:5.1} %  {:.1e}  {}",
                100.0 * mode.share,
                mode.risk.probability,
                mode.mode
            )?;
        }
        if let Some(share) = ego.known_share {
            let share = 100.0 * share;
            writeln!(f, "{share:5.1} %  of kinds that known counterexamples show")?;
        }
        if let (Some(exposure), Some(risk)) = (self.exposure, ego.fails) {
            let rate = risk.scaled(exposure.encounters());
            writeln!(
                f,
                "{} encounters {}: {} failures, {}",
                exposure.encounters(),
                exposure.unit(),
                number(rate.probability),
                interval(&rate)
            )?;
        }
        Ok(())
    }

    fn checked(&self, f: &mut Formatter<'_>, checks: &Checks) -> fmt::Result {
        let k = checks
            .pareto_k
            .map_or("none".to_owned(), |k| format!("{k:.2}"));
        let unseen = checks.unseen_share.unwrap_or(0.0).min(1.0);
        let [covered, probes] = checks.probes;
        writeln!(
            f,
            "whatever the proposals missed: at most {}, of {} natural runs",
            number(checks.bound),
            self.cost.natural
        )?;
        writeln!(
            f,
            "checks    k̂ {k}, unseen weights {:.1} %, {} failures, largest {:.1} %, probes {covered} of {probes} \
             covered, natural failures {}, beyond {}",
            100.0 * unseen,
            checks.hits,
            100.0 * checks.greatest_share,
            checks.natural_failures,
            checks.natural_beyond
        )
    }

    fn origin(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, {}, runs of {} s, traffic: {}",
            self.world, self.plant, self.horizon_s, self.traffic
        )?;
        if !self.uniform_axes.is_empty() {
            let axes = self.uniform_axes.join(", ");
            writeln!(
                f,
                "starts uniform over the world's ranges, without a law: {axes}"
            )?;
        }
        // Nearly all of a law is usually inside, which needs no remark.
        if self.inside < 0.999 {
            let share = 100.0 * self.inside;
            writeln!(
                f,
                "{share:.1} % of the law of starts is inside the world's ranges"
            )?;
        }
        Ok(())
    }

    /// Writes what the result supports, since a risk is easy to overstate.
    fn claims(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let claim = if self.is_result() {
            "in this traffic model, on this plant, the ego fails in this share of runs"
        } else {
            "in this traffic model, on this plant, the ego fails at most as often as the bound"
        };
        writeln!(f, "you may say      {claim}")?;
        writeln!(
            f,
            "you may not say  a rate on the road, safe below it, or better by two intervals \
             (docs/background/claims.md)"
        )
    }

    fn runs(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let RiskCost {
            natural,
            exploring,
            rounds,
            surrogate,
            learning,
            ..
        } = self.cost;
        write!(
            f,
            "\nruns per ego: {natural} natural, {exploring} exploring, {rounds} in rounds"
        )?;
        if 0 < surrogate {
            write!(f, ", {surrogate} for its surrogate, {learning} in it")?;
        } else if 0 < learning {
            write!(f, ", {learning} on another plant")?;
        }
        writeln!(f)
    }
}

impl Display for RiskReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.origin(f)?;
        for ego in &self.egos {
            writeln!(f)?;
            if ego.refusals().is_empty() {
                self.readings(f, ego)?;
            } else {
                writeln!(f, "{}: no result", ego.ego)?;
            }
            match &ego.checks {
                Some(checks) => self.checked(f, checks)?,
                None => writeln!(f, "counted among {} natural runs", self.cost.natural)?,
            }
            if 0 < ego.impossible {
                let n = ego.impossible;
                writeln!(
                    f,
                    "warning: {n} known counterexamples have probability 0 here"
                )?;
            }
            if let Some(crude) = ego.crude_runs.filter(|_| ego.is_weighted()) {
                writeln!(
                    f,
                    "counting alone would need {crude:.1e} runs for this width"
                )?;
            }
        }
        if let Some(ratio) = &self.ratio {
            writeln!(
                f,
                "\nratio of `{}` to `{}`: {:.2}, {:.2} … {:.2}",
                self.egos[0].ego,
                self.egos[1].ego,
                ratio.probability,
                ratio.interval[0],
                ratio.interval[1]
            )?;
        }
        self.runs(f)?;
        self.claims(f)
    }
}

fn number(value: f64) -> String {
    // Small risks need an exponent, and larger numbers compare better without.
    if value < 0.01 {
        format!("{value:.2e}")
    } else {
        format!("{value:.4}")
    }
}

fn interval(risk: &RiskEstimate) -> String {
    format!(
        "{} … {}",
        number(risk.interval[0]),
        number(risk.interval[1])
    )
}

#[cfg(test)]
mod tests {
    use super::super::natural_counts::JUDGED;
    use super::super::record::{EgoFailure, RunEnd};
    use super::*;

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
        let later = [RunEnd::Failed(failure), RunEnd::Held { lawful: None }];
        let later = later.into_iter().cycle().take(1000);
        let mut natural = NaturalCounts::default();
        natural.add(judged.chain(later).map(RiskRun::ending).collect());
        let rate = natural.lawful_rate();
        assert_eq!((rate.probability, rate.hits), (0.9, 900));
        // 500 failures, of which none is lawful: nothing to divide, but no NaN either.
        let counted = EgoRisk::counted("ego", &natural);
        let given = counted.fails_given_lawful.expect("a rate");
        assert_eq!((given.probability, given.interval[0]), (0.0, 0.0));
        assert!(
            0.0 < given.interval[1] && given.interval[1] < 0.01,
            "{given:?}"
        );
        let fails = counted.fails.expect("counted");
        assert_eq!((fails.hits, fails.probability), (500, 0.25));
    }
}
