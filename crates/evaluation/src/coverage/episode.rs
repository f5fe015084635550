//! Episode, as coverage counts it.

use serde::Serialize;

use crate::crashes::AdoDigit;
use crate::experiment::{FailureKind, violated};
use crate::rulebook::{JudgeKind, Verdict};
use crate::scene::Start;
use crate::scene::drive::EgoDrive;
use crate::stl::Scratch;
use crate::testbench::{Aftermath, Episode, Testbench};
use crate::world::Scenario;

/// Origin of an episode, which decides what its absence of a failure shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EpisodeOrigin {
    /// Played from a drawn start and counted whatever its outcome: a try.
    Drawn,
    /// Stored because the ego fails in it. It is no try.
    Stored,
}

/// Episode with what it shows of the specification and the rules.
#[derive(Clone, Debug, PartialEq)]
pub struct CoveredEpisode {
    /// Origin.
    pub origin: EpisodeOrigin,
    /// Start, a value per axis of X_init.
    pub start: Start,
    /// Failure of the ego with all rules kept. `None`: it does not fail so.
    pub failure: Option<CoveredFailure>,
    /// Bound by each rule, in the order of the rulebook. `None`: it was not evaluated.
    ///
    /// An empty list is the same as `None` for every rule.
    pub rules: Vec<Option<RuleBound>>,
}

/// Failure of an ego, with what decides it.
#[derive(Clone, Debug, PartialEq)]
pub struct CoveredFailure {
    /// Kind of the failure.
    pub kind: FailureKind,
    /// Sub-formulas of ψ_ego from the whole to the deciding leaf.
    pub path: Vec<String>,
}

/// Evidence that a rule bounds an ado in an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuleBound {
    /// Robustness of the rule over the judged samples. `None`: it is not above 0, or infinite.
    pub margin: Option<f64>,
    /// Whether the episode ended because the rule was broken.
    pub is_broken: bool,
    /// Whether another action of one ado would have broken it before the next decision.
    ///
    /// `None`: unknown, as with an ego that is a program, or for a rule that looks further
    /// ahead than a decision.
    pub forbids_other: Option<bool>,
}

/// Observer of the episodes of one world, one per worker.
pub struct EpisodeObserver<'a> {
    scenario: &'a Scenario,
    bench: Testbench,
    digits: Vec<AdoDigit>,
    scratch: Scratch,
    /// Whether episodes can branch, and a branch is judged before the end.
    branches: bool,
}

impl<'a> EpisodeObserver<'a> {
    /// Creates the observer of episodes of a world.
    pub fn new(scenario: &'a Scenario) -> EpisodeObserver<'a> {
        let is_foreign = scenario.ego().is_some_and(EgoDrive::is_foreign);
        let is_judged_late = scenario.rulebook().judge == JudgeKind::WholeRun;
        EpisodeObserver {
            scenario,
            bench: scenario.bench(),
            digits: AdoDigit::all(scenario),
            scratch: Scratch::default(),
            // A program cannot be copied, and a judge of whole runs finds no
            // broken rule at a branch.
            branches: !is_foreign && !is_judged_late,
        }
    }

    /// Observes an episode of the world, its rules only if asked to.
    ///
    /// `None`: the episode is invalid and shows nothing.
    pub fn observe(
        &mut self,
        episode: &Episode,
        origin: EpisodeOrigin,
        with_rules: bool,
    ) -> Option<CoveredEpisode> {
        // An episode that did not run shows nothing about rules or failures.
        if episode.verdict == Verdict::Invalid {
            return None;
        }
        let failure = episode
            .verdict
            .is_success()
            .then(|| failure(self.scenario, episode));
        Some(CoveredEpisode {
            origin,
            start: episode.start.clone(),
            failure,
            // Other actions are simulated for the rules, which costs far more than the
            // verdict.
            rules: if with_rules {
                self.bounds(episode)
            } else {
                Vec::new()
            },
        })
    }

    fn bounds(&mut self, episode: &Episode) -> Vec<Option<RuleBound>> {
        let forbidden = self.forbidden(episode);
        // Samples after the verdict are no evidence on a rule.
        let judged = episode.judged_trace();
        let decision = self.bench.clock().samples_per_decision();
        let rules = self.scenario.rulebook().rules.iter().enumerate();
        let bounds = rules.map(|(position, rule)| {
            let margin = rule.monitor.robustness(&judged, &mut self.scratch);
            RuleBound {
                // A rule that later samples can still satisfy is not near its bound.
                margin: (margin > 0.0 && margin.is_finite()).then_some(margin),
                is_broken: episode.broken_rules.contains(&position),
                // A rule with a long window may be broken after the next decision only.
                forbids_other: forbidden
                    .as_ref()
                    .map(|found| found[position])
                    // A rule that was seen broken is certain, however far it looks ahead.
                    .filter(|found| *found || rule.monitor.inner_window_samples() <= decision),
            }
        });
        bounds.map(Some).collect()
    }

    /// Returns which rules another action of one ado would have broken at some decision.
    fn forbidden(&mut self, episode: &Episode) -> Option<Vec<bool>> {
        let mut found = vec![false; self.scenario.rulebook().rules.len()];
        if !self.branches {
            // The program cannot branch here, which is unknown and not the same as
            // unbroken.
            return None;
        }
        let bench = &mut self.bench;
        // Only decisions before the verdict can be changed, so the motion after it is not
        // needed.
        bench.begin(&episode.start, episode.noise, Aftermath::Skip);
        for &action in &episode.actions {
            // With every rule found, further branches would add nothing.
            if bench.is_done() || found.iter().all(|found| *found) {
                break;
            }
            let allowed = bench.allowed();
            // A masked action was no alternative of the ado.
            let may = |other: &usize| allowed.as_ref().is_none_or(|allowed| allowed[*other]);
            // One ado deviates at a time, since joint deviations grow exponentially with
            // the ados.
            let others = self.digits.iter().flat_map(|digit| digit.others(action));
            for other in others.filter(may) {
                let mut branch = bench.branch()?;
                branch.decide(other);
                for &rule in branch.broken_rules() {
                    found[rule] = true;
                }
                bench.rejoin(branch);
            }
            bench.decide(action);
        }
        Some(found)
    }
}

/// Returns the failure in an episode that is a success of the ados.
fn failure(scenario: &Scenario, episode: &Episode) -> CoveredFailure {
    let explanation = scenario
        .rulebook()
        .spec
        .explain(&violated(scenario, episode));
    CoveredFailure {
        kind: FailureKind::of(scenario, episode),
        path: explanation
            .path
            .into_iter()
            .map(|step| step.formula)
            .collect(),
    }
}

/// Returns whether an item is among `most` of `count` items that are evenly spread.
pub fn evenly_spread(index: usize, count: usize, most: usize) -> bool {
    // Rounding down cuts the list into `most` runs of nearly equal length, each with one
    // pick.
    count <= most || (index + 1) * most / count > index * most / count
}
