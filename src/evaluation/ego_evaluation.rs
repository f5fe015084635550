//! Evaluation of all ados against an ego.

use super::evaluation_plan::{Evaluation, ExplainedCounterexample, FoundBy};
use crate::adversary::{
    Ado, AdoKind, Baselines, EvalRequest, Evaluated, GridPolicy, best_constant, best_then_brake,
    eval, explain_first,
};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::{AdversaryId, Row};
use crate::search::{Hold, SearchRequest, Switches, search};
use crate::surrogate::{AdaptedTo, LearnEgoRequest, learned};
use crate::sysid::ConditionedAdo;
use crate::training::retrained;

/// Evaluation of all ados against an ego, row by row.
pub(super) struct EgoEvaluation<'a> {
    pub asked: Evaluation<'a>,
    pub ego: &'a EgoUnderTest,
    pub ado: &'a ConditionedAdo,
    pub starts: &'a TestStarts,
    pub baselines: &'a Baselines,
    pub watch: &'a Watch<'a>,
    pub rows: Vec<Row>,
    pub reason: Option<ExplainedCounterexample>,
    pub adapted_to: Option<AdaptedTo>,
    pub found: Option<FoundBy>,
}

impl<'a> EgoEvaluation<'a> {
    pub fn play(&mut self) -> Result<(), EvaluationError> {
        for &kind in &self.baselines.ados {
            for ado in self.baselines.made(kind) {
                self.rows.push(self.evaluated(ado).row);
            }
            let row = self.one_ado(kind)?;
            self.rows.extend(row);
            // A fair baseline for a learned ego gets as many runs as learning takes.
            if kind == AdoKind::Hold && self.asked.runs.is_some() {
                let row = self.held_for_as_much();
                self.rows.push(row);
            }
        }
        // The adapted ado comes after the reused ado and the baselines that it must
        // exceed.
        if self.asked.learns() {
            let row = self.adapted()?;
            self.rows.extend(row);
        }
        // The search comes last, because every row is compared with it.
        if let Some(switches) = self.asked.search {
            let request = SearchRequest {
                scenario: self.ego.scenario(),
                ego: self.ego.name(),
                method: Switches(switches).into(),
                budget: 0,
                starts: self.starts,
            };
            let searched = search(&request, self.watch).row;
            for row in &mut self.rows {
                row.compare_with_search(&searched.solved);
            }
            self.rows.push(searched);
        }
        Ok(())
    }

    /// Plays an ado. `None`: it does not apply or has added its rows itself.
    fn one_ado(&mut self, kind: AdoKind) -> Result<Option<Row>, EvaluationError> {
        Ok(match kind {
            AdoKind::Heuristic | AdoKind::Replays => None,
            AdoKind::Trained | AdoKind::All => {
                let row = self.trained();
                self.rows.push(row);
                self.untold()
            }
            AdoKind::Random => Some(self.evaluated(Ado::Random).row),
            AdoKind::Hold => Some(self.evaluated(Ado::Held).row),
            AdoKind::Constant => {
                let (scenario, name) = (self.ego.scenario(), self.ego.name());
                Some(best_constant(scenario, name, self.starts, self.watch).row)
            }
            AdoKind::Switch => {
                let (scenario, name) = (self.ego.scenario(), self.ego.name());
                let best = best_then_brake(scenario, name, self.starts, self.watch);
                best.map(|best| best.row)
            }
            AdoKind::Retrained => self.retrained()?,
            AdoKind::Chaser => Some(self.by_rule(GridPolicy::Chaser)?.row),
            AdoKind::Optimal => {
                let evaluated = self.by_rule(GridPolicy::Optimal)?;
                let row = evaluated.row.clone();
                // Files are named after world and ego, so those of the trained ado take precedence.
                if !self.baselines.ados.contains(&AdoKind::Trained) {
                    self.found = Some(FoundBy::Optimal(evaluated));
                }
                Some(row)
            }
        })
    }

    /// Plays held random actions with the same number of runs of the ego.
    ///
    /// It is the number that learning the ego and playing every start takes.
    fn held_for_as_much(&self) -> Row {
        // Trivial starts are not played, so they take no runs.
        let trivial = &self.starts.trivial;
        let starts = trivial.iter().filter(|trivial| !**trivial).count() as u64;
        let spent = self.asked.granted() + starts * self.asked.tries;
        let request = SearchRequest {
            scenario: self.ego.scenario(),
            ego: self.ego.name(),
            method: Hold.into(),
            // Rounded up, so the baseline never gets fewer runs.
            budget: spent.div_ceil(starts.max(1)),
            starts: self.starts,
        };
        let mut row = search(&request, self.watch).row;
        row.ado = AdversaryId::Hold;
        row.method = format!(
            "at most {} runs per start, as many as adapting takes",
            request.budget
        );
        row
    }

    fn evaluated(&self, ado: Ado<'_>) -> Evaluated {
        eval(&self.ego.met_by(ado, self.starts), self.watch)
    }

    /// Plays a conditional ado with nominal parameters, without a run of the ego.
    fn untold(&self) -> Option<Row> {
        let policy = self.ado.nominal_policy.as_deref()?;
        let mut row = self
            .evaluated(Ado::Trained(policy, self.asked.run.manifest().seed))
            .row;
        row.ado = AdversaryId::ZeroShot;
        row.context = Some("nominal".to_owned());
        Some(row)
    }

    /// Plays the trained ado, with several tries per start if requested.
    fn trained(&mut self) -> Row {
        let request = self.asked.trained(self.ego, self.ado, self.starts);
        let (found, mut row) = if 1 < self.asked.tries {
            let tried = self.asked.several(request, self.ado).run(self.watch);
            let row = tried.evaluated.row.clone();
            (FoundBy::Tries(tried), row)
        } else {
            let evaluated = eval(&request, self.watch);
            // The explanation is made for the plain evaluation only, without tries.
            let explained = explain_first(&request, &evaluated);
            self.reason = explained.map(|(start, explanation)| ExplainedCounterexample {
                ego: self.ego.name().to_owned(),
                start,
                requirement: self.ego.scenario().requirement.clone(),
                explanation,
            });
            let row = evaluated.row.clone();
            (FoundBy::Trained(evaluated), row)
        };
        self.found = Some(found);
        row.context = self.ado.context.map(str::to_owned);
        row.warning = self.asked.run.warning();
        row
    }

    /// Plays the ado that plans in a surrogate of this ego. `None`: stopped.
    fn adapted(&mut self) -> Result<Option<Row>, EvaluationError> {
        let asked = self.asked;
        let policy = &*self.ado.policy;
        // Runs that identified the ego's parameters are runs of the ego too.
        let identified_from = asked.identified_from();
        let kept = asked.run.policy_bundle()?;
        let runs = asked.granted() - identified_from;
        let request = LearnEgoRequest::new(asked.nominal, self.ego.scenario(), policy, runs)
            .bundle(&kept)
            .unknown(asked.unknown)
            .seed(self.starts.seed);
        self.watch.phase(&format!("learning {}", self.ego.name()));
        // Learning has phases of its own, which would hide the progress of the evaluation.
        let quiet = self.watch.quiet();
        let Some(ego) = learned(asked.run, self.ego, &request, &quiet)? else {
            return Ok(None);
        };
        self.watch
            .phase(&format!("planning against {}", self.ego.name()));
        let request = asked.trained(self.ego, self.ado, self.starts);
        let adapted = ego.eval(&request, policy, asked.tries, self.watch);
        let row = adapted.evaluated.row.clone();
        let whom = (self.ego.name(), self.ego.scenario());
        let told = AdaptedTo::of(whom, &ego.from, identified_from, &adapted);
        self.adapted_to = Some(told);
        self.found = Some(FoundBy::Adapted(adapted));
        Ok(Some(row))
    }

    /// Plays an ado trained for this ego. The nominal ego has the trained ado already.
    fn retrained(&self) -> Result<Option<Row>, EvaluationError> {
        let Some(changed) = self.ego.as_changed() else {
            return Ok(None);
        };
        let run = self.asked.run;
        let Some(own) = retrained(run, &changed, self.ego.scenario(), &self.watch.unnumbered())?
        else {
            return Ok(None);
        };
        let policy = own.policy()?;
        let mut row = self
            .evaluated(Ado::Trained(&*policy, run.manifest().seed))
            .row;
        row.ado = AdversaryId::Retrained;
        row.method = own.scenario()?.learner.name().to_lowercase();
        Ok(Some(row))
    }

    fn by_rule(&self, rule: GridPolicy) -> Result<Evaluated, EvaluationError> {
        // These ados use both positions, so they play in the fully observed world.
        let (whole, policy) = rule.policy(self.ego)?;
        let request = EvalRequest {
            scenario: &whole,
            ado: rule.ado(&policy),
            ..self.ego.met_by(Ado::Random, self.starts)
        };
        Ok(eval(&request, self.watch))
    }
}
