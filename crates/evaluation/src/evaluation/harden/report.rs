//! Report of a hardening: candidates, their confirmation and the verdict.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use super::EgoParameter;
use super::candidate::EgoMeasurement;
use super::losses::{DrivingLoss, LossLimit};
use crate::run_dir::counted;
use crate::stats::{StartOutcome, clopper_pearson_upper, wilson};

/// Error of the one-sided bound on the failures of a candidate.
const ERROR: f64 = 0.05;
/// Slack of comparisons, so that rounding refutes nothing.
const ROUNDING: f64 = 1e-9;
/// Recall below which an ado trained anew has not shown that a candidate withstands.
const RELIABLE: f64 = 0.9;

/// Report of a hardening.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct HardenReport {
    /// Name of the world.
    pub world: String,
    /// Plant of all runs.
    pub plant: String,
    /// Name of the ego.
    pub ego: String,
    /// Origin of the traffic of the losses.
    pub traffic: String,
    /// Parameters that could change.
    pub parameters: Vec<EgoParameter>,
    /// Least reduction of the failures, as a share.
    pub reduction: f64,
    /// Failures of the ego as it is, on the starts of the search.
    pub searched: StartCount,
    /// Failures of the ego as it is, on sealed starts. `None`: interrupted before.
    pub sealed: Option<StartCount>,
    /// Trained ados with their runs, in the order of their training.
    pub ados: Vec<AdoRun>,
    /// Candidates, the smallest change first.
    pub candidates: Vec<HardenedEgo>,
    /// Changes that none is better than, on the starts of the search alone.
    pub front: Vec<FrontPoint>,
    /// Number of egos that were played.
    pub played: usize,
    /// Kept crashes of the recommended candidate.
    pub crashes: Option<KeptCrashes>,
    /// True if it was stopped before all was confirmed.
    pub interrupted: bool,
}

/// Change of the front of the search.
#[derive(Clone, Debug, Serialize)]
pub struct FrontPoint {
    /// Values that differ from the ego as it is, by parameter.
    pub values: BTreeMap<String, f64>,
    /// Size of the change: the sum of its shares of the ranges.
    pub size: f64,
    /// Starts of the search, and kept crashes, that fail.
    pub failing: usize,
    /// Greatest share of a loss's allowance that is used, 1 at its limit.
    pub loss: f64,
}

/// Trained ado and its run directory.
#[derive(Clone, Debug, Serialize)]
pub struct AdoRun {
    /// Name in this report.
    pub ado: String,
    /// Run directory.
    pub run: PathBuf,
}

/// Crashes that remain, kept as files.
#[derive(Clone, Debug, Serialize)]
pub struct KeptCrashes {
    /// Directory.
    pub dir: PathBuf,
    /// Number of files.
    pub files: usize,
    /// Number of starts from which the candidate fails.
    pub found: usize,
}

/// Failures among starts, with their interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StartCount {
    /// Starts from which the ego fails.
    pub failing: usize,
    /// Starts with a result.
    pub starts: usize,
    /// Starts on which the ego or the physics did not run.
    pub invalid: usize,
    /// Wilson's 95 % interval of the share.
    pub ci95: [f64; 2],
}

impl StartCount {
    /// Counts the outcomes of starts.
    pub(super) fn of(outcomes: &[StartOutcome]) -> StartCount {
        // Starts are counted without the runs in natural traffic.
        let measured = EgoMeasurement {
            outcomes: outcomes.to_vec(),
            runs: Vec::new(),
        };
        let invalid = |it: &&StartOutcome| **it == StartOutcome::Invalid;
        StartCount {
            failing: measured.failing(),
            starts: measured.valid(),
            invalid: outcomes.iter().filter(invalid).count(),
            ci95: wilson(measured.failing(), measured.valid()),
        }
    }

    /// Returns the share that fails, 0 without any start.
    pub fn share(&self) -> f64 {
        self.failing as f64 / self.starts.max(1) as f64
    }

    /// Returns whether at most this share fails. `None` without any start, which shows nothing.
    pub(super) fn is_at_most(&self, share: f64) -> Option<bool> {
        (self.starts > 0).then(|| self.share() <= share)
    }
}

/// Changed ego that was found, with its confirmation.
#[derive(Clone, Debug, Serialize)]
pub struct HardenedEgo {
    /// File with the change.
    pub file: PathBuf,
    /// Values that differ from the ego as it is, by parameter.
    pub values: BTreeMap<String, f64>,
    /// Size of the change: the sum of its shares of the ranges.
    pub size: f64,
    /// Failures on the starts of the search.
    pub searched: StartCount,
    /// Result on sealed starts. `None`: not confirmed.
    pub confirmation: Option<Confirmation>,
    /// Verdict.
    pub verdict: HardenVerdict,
    /// Reasons of a verdict other than confirmed.
    pub reasons: Vec<String>,
}

/// Verdict on a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HardenVerdict {
    /// It meets all conditions on sealed starts, against an ado trained anew.
    Confirmed,
    /// It misses a condition.
    Refuted,
    /// Something is missing that would show it.
    Unknown,
}

impl HardenVerdict {
    /// Returns the word in tables.
    pub fn word(self) -> &'static str {
        match self {
            HardenVerdict::Confirmed => "confirmed",
            HardenVerdict::Refuted => "refuted",
            HardenVerdict::Unknown => "unknown",
        }
    }
}

/// Result of a candidate on sealed starts and draws.
#[derive(Clone, Debug, Serialize)]
pub struct Confirmation {
    /// Failures against all ados, that of its own training included.
    pub sealed: StartCount,
    /// Kept crashes that still fail, and those with an answer.
    pub kept: Option<[usize; 2]>,
    /// Reduction of the failures, as a share of those of the ego as it is.
    pub reduction: f64,
    /// Reduction at least, by the one-sided 95 % bound of Clopper and Pearson.
    pub reduction_at_least: f64,
    /// Ado that was trained against this candidate.
    pub new_ado: NewAdo,
    /// Losses in natural traffic.
    pub losses: Vec<LossResult>,
}

/// Ado that was trained against a candidate.
#[derive(Clone, Debug, Serialize)]
pub struct NewAdo {
    /// Name in this report.
    pub ado: String,
    /// Decisions of the training.
    pub decisions: u64,
    /// Sealed starts from which it alone makes the candidate fail. `None`: not played.
    pub failing: Option<usize>,
    /// Starts of its calibration that a search solves, and all of them.
    pub search: Option<[u64; 2]>,
    /// Share of those that the ado solves, too. `None`: too few.
    pub recall: Option<f64>,
}

/// Loss of a candidate in natural traffic that no search has seen.
#[derive(Clone, Debug, Serialize)]
pub struct LossResult {
    /// Measure.
    pub measure: String,
    /// Value of the ego as it is. `None` here and below: not defined, as without runs.
    pub own: Option<f64>,
    /// Value of the candidate.
    pub value: Option<f64>,
    /// Greatest allowed value.
    pub at_most: Option<f64>,
    /// Limit as it was given.
    pub limit: LossLimit,
    /// 95 % interval of the ratio of both values. `None`: not defined.
    pub ratio_ci95: Option<[f64; 2]>,
    /// Runs behind the values.
    pub runs: usize,
}

impl LossResult {
    /// Returns the loss in runs that both egos have.
    pub(super) fn of(
        nth: usize,
        loss: &DrivingLoss,
        measured: &EgoMeasurement,
        own: &EgoMeasurement,
    ) -> LossResult {
        let [one, own] = measured.paired(own, nth);
        let own_value = loss.value(&own);
        LossResult {
            measure: loss.name.clone(),
            own: own_value,
            value: loss.value(&one),
            at_most: own_value.map(|own| loss.limit.of(own)),
            limit: loss.limit,
            ratio_ci95: loss.ratio_between(&one, &own),
            runs: one.len(),
        }
    }

    /// Returns whether the limit is kept. `None`: nothing was observed that would show it.
    pub fn is_kept(&self) -> Option<bool> {
        let (value, at_most) = self.value.zip(self.at_most).filter(|_| self.runs > 0)?;
        Some(value <= at_most)
    }
}

impl Confirmation {
    /// Fills in the reductions, against the ego as it is.
    pub(super) fn reduced_from(self, own: StartCount) -> Confirmation {
        // The bound is on the candidate alone, whose failures are few and decide.
        let at_most = clopper_pearson_upper(self.sealed.failing, self.sealed.starts, ERROR);
        // Without a failure of the ego as it is, nothing is reduced.
        let reduction = |share: f64| match own.failing {
            0 => 0.0,
            _ => 1.0 - share / own.share(),
        };
        Confirmation {
            reduction: reduction(self.sealed.share()),
            // A bound above the failures of the ego as it is shows no reduction.
            reduction_at_least: reduction(at_most).max(0.0),
            ..self
        }
    }

    /// Returns the verdict, with the reasons of any other than confirmed.
    pub(super) fn verdict(&self, own: StartCount, wanted: f64) -> (HardenVerdict, Vec<String>) {
        let mut refuted = Vec::new();
        let mut unknown = Vec::new();
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        if own.failing == 0 {
            unknown.push("the ego as it is fails from no sealed start".to_owned());
        } else if self.sealed.starts == 0 {
            unknown.push("the changed ego has a result from no sealed start".to_owned());
        } else if self.reduction < wanted - ROUNDING {
            refuted.push(format!(
                "failures fall by {} only, on sealed starts",
                percent(self.reduction)
            ));
        }
        // The rates leave out starts on which the ego did not run.
        if self.sealed.invalid > 0 {
            let starts = counted(self.sealed.invalid, "sealed start");
            unknown.push(format!("the ego or the physics did not run from {starts}"));
        }
        if let Some([failing, answered]) = self.kept {
            if failing as f64 > (1.0 - wanted) * answered as f64 + ROUNDING {
                let crashes = counted(answered, "kept crash");
                refuted.push(format!("it still fails in {failing} of {crashes}"));
            } else if answered == 0 {
                unknown.push("no kept crash gives an answer".to_owned());
            }
        }
        if let Some([solved, starts]) = self.new_ado.search {
            if starts == 0 {
                unknown.push("no start of the new training was searched".to_owned());
            }
            let share = solved as f64 / starts.max(1) as f64;
            // The training has other starts than the seal, so shares are
            // compared and not counts.
            if own.failing > 0 && share > (1.0 - wanted) * own.share() + ROUNDING {
                let starts = counted(starts, "start");
                refuted.push(format!(
                    "a search makes it fail from {solved} of {starts} of the new training"
                ));
            }
        }
        if let Some(recall) = self.new_ado.recall.filter(|it| *it < RELIABLE) {
            unknown.push(format!(
                "the new ado solves {} of the starts that a search solves: raise `--decisions`",
                percent(recall)
            ));
        }
        for loss in &self.losses {
            match (loss.is_kept(), loss.value, loss.at_most) {
                (Some(true), ..) => {}
                (Some(false), Some(value), Some(at_most)) => {
                    let measure = &loss.measure;
                    refuted.push(format!("`{measure}` is {value:.3}, above {at_most:.3}"));
                }
                _ => unknown.push(format!("`{}` has no value", loss.measure)),
            }
        }
        // A missed condition outweighs everything that is not known.
        match (refuted.is_empty(), unknown.is_empty()) {
            (true, true) => (HardenVerdict::Confirmed, Vec::new()),
            (false, _) => (HardenVerdict::Refuted, refuted),
            (true, false) => (HardenVerdict::Unknown, unknown),
        }
    }
}

impl HardenReport {
    /// Returns the smallest confirmed change.
    pub fn confirmed(&self) -> Option<&HardenedEgo> {
        let mut all = self.candidates.iter();
        all.find(|it| it.verdict == HardenVerdict::Confirmed)
    }

    /// Returns the position of the smallest confirmed change, or of the smallest at all.
    pub(super) fn recommended(&self) -> Option<usize> {
        let mut all = self.candidates.iter();
        let confirmed = all.position(|it| it.verdict == HardenVerdict::Confirmed);
        // Candidates are ordered by size, so the first is the smallest.
        confirmed.or((!self.candidates.is_empty()).then_some(0))
    }

    /// Returns whether the ego as it is fails from no start of the search.
    pub fn is_without_failure(&self) -> bool {
        !self.interrupted && self.searched.failing == 0 && self.searched.starts > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(failing: usize, starts: usize) -> StartCount {
        StartCount {
            failing,
            starts,
            invalid: 0,
            ci95: wilson(failing, starts),
        }
    }

    fn confirmation(failing: usize) -> Confirmation {
        let own = count(100, 200);
        Confirmation {
            sealed: count(failing, 200),
            kept: None,
            reduction: 0.0,
            reduction_at_least: 0.0,
            new_ado: NewAdo {
                ado: "ado-1".to_owned(),
                decisions: 1000,
                failing: Some(2),
                search: Some([2, 100]),
                recall: None,
            },
            losses: vec![LossResult {
                measure: "braking".to_owned(),
                own: Some(1.0),
                value: Some(1.05),
                at_most: Some(1.1),
                limit: LossLimit::TimesOwn(1.1),
                ratio_ci95: None,
                runs: 100,
            }],
        }
        .reduced_from(own)
    }

    fn verdict(change: fn(&mut Confirmation)) -> HardenVerdict {
        let mut confirmation = confirmation(2);
        change(&mut confirmation);
        confirmation.verdict(count(100, 200), 0.9).0
    }

    #[test]
    fn an_ego_that_never_ran_does_not_withstand() {
        assert_eq!(count(0, 0).is_at_most(0.1), None);
        assert_eq!(count(10, 100).is_at_most(0.1), Some(true));
        assert_eq!(count(11, 100).is_at_most(0.1), Some(false));
    }

    #[test]
    fn every_missed_condition_refutes_and_every_gap_is_unknown() {
        use HardenVerdict::{Confirmed, Refuted, Unknown};
        assert_eq!(verdict(|_| {}), Confirmed);
        assert_eq!(verdict(|it| it.reduction = 0.89), Refuted);
        assert_eq!(verdict(|it| it.losses[0].value = Some(1.11)), Refuted);
        assert_eq!(verdict(|it| it.kept = Some([2, 10])), Refuted);
        assert_eq!(verdict(|it| it.kept = Some([1, 10])), Confirmed);
        assert_eq!(verdict(|it| it.new_ado.search = Some([6, 100])), Refuted);
        assert_eq!(verdict(|it| it.sealed.starts = 0), Unknown);
        assert_eq!(verdict(|it| it.sealed.invalid = 1), Unknown);
        assert_eq!(verdict(|it| it.kept = Some([0, 0])), Unknown);
        assert_eq!(verdict(|it| it.new_ado.recall = Some(0.8)), Unknown);
        assert_eq!(verdict(|it| it.losses[0].value = None), Unknown);
        assert_eq!(verdict(|it| it.losses[0].at_most = None), Unknown);
        assert_eq!(verdict(|it| it.new_ado.search = Some([0, 0])), Unknown);
        assert_eq!(verdict(|it| it.losses[0].runs = 0), Unknown);
        // An ego that never fails is not hardened by anything.
        let none = confirmation(0).verdict(count(0, 200), 0.9);
        assert_eq!(none.0, Unknown);
        assert_eq!(none.1, ["the ego as it is fails from no sealed start"]);
        let mut without = confirmation(0);
        without.sealed = count(0, 0);
        let (_, why) = without.verdict(count(100, 200), 0.9);
        assert_eq!(why, ["the changed ego has a result from no sealed start"]);
    }

    #[test]
    fn a_reduction_has_a_bound_that_few_starts_make_weak() {
        let found = confirmation(2);
        assert!((found.reduction - 0.98).abs() < 1e-12);
        assert!(found.reduction_at_least < 0.95 && found.reduction_at_least > 0.9);
        let none = confirmation(0);
        assert_eq!(none.reduction, 1.0);
        // 1 - (1 - 0.05^(1/200)) / 0.5.
        assert!(
            (none.reduction_at_least - 0.970_266).abs() < 1e-4,
            "{none:?}"
        );
    }
}
