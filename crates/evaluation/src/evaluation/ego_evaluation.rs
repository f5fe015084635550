//! Evaluation of all ados against an ego.

use super::evaluation_plan::{Evaluation, ExplainedCounterexample};
use crate::adversary::{Ado, Baselines, EvalRequest, GridPolicy};
use crate::evaluation::error::EvaluationError;
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::rl::Policy;
use crate::run_dir::{AdversaryId, Row};
use crate::search::{Adversary, ExperimentCell, Guided, GuidingPolicy, Hold, PlayerParts, Search};
use crate::surrogate::{AdaptedTo, LearnEgoRequest, learned};
use crate::training::retrained;
use crate::world::Repeats;

/// Evaluation of all ados against an ego, row by row.
pub(super) struct EgoEvaluation<'a> {
    pub evaluation: Evaluation<'a>,
    pub ego: &'a EgoUnderTest,
    pub policy: &'a dyn Policy,
    pub starts: &'a TestStarts,
    pub baselines: &'a Baselines,
    pub watch: &'a Watch<'a>,
    pub rows: Vec<Row>,
    pub reason: Option<ExplainedCounterexample>,
    pub adapted_to: Option<AdaptedTo>,
    /// Cell whose counterexamples are kept.
    pub found: Option<ExperimentCell>,
}

impl<'a> EgoEvaluation<'a> {
    pub(super) fn play(&mut self) -> Result<(), EvaluationError> {
        for id in self.evaluation.ados {
            if let Some(policy) = GridPolicy::of(id) {
                self.on_grid(policy)?;
                continue;
            }
            match id {
                AdversaryId::Trained => {
                    self.trained();
                    self.guided();
                    self.sampled();
                }
                AdversaryId::Without { .. } => self.without(id),
                AdversaryId::Alone { .. } => self.alone(id),
                AdversaryId::Retrained => self.retrained()?,
                // A fair baseline for a learned ego gets as many runs as learning takes.
                AdversaryId::Hold => {
                    self.add(&Ado::Hold);
                    if let Some(runs) = self.evaluation.runs {
                        self.held_for_as_much(runs.get());
                    }
                }
                other => {
                    let parts = PlayerParts {
                        policy: Some((self.policy, self.evaluation.run.manifest().seed)),
                        heuristic: self.baselines.heuristic.as_ref(),
                        stored: self.baselines.stored.as_ref(),
                    };
                    if let Some(player) = parts.player(other)? {
                        self.add(&*player);
                    }
                }
            }
        }
        // The adapted ado comes after the reused ado and the baselines that it must
        // exceed.
        if let Some(runs) = self.evaluation.runs {
            self.adapted(runs.get())?;
        }
        // The search comes last, because every row is compared with it.
        if let Some(switches) = self.evaluation.search {
            self.add(&Search::switches(switches));
            Row::compare_with_last(&mut self.rows);
        }
        Ok(())
    }

    fn row(&self, adversary: &dyn Adversary) -> Option<Row> {
        let cell = adversary.play(self.ego, self.starts, self.watch)?;
        Some(cell.row)
    }

    fn add(&mut self, adversary: &dyn Adversary) {
        self.rows.extend(self.row(adversary));
    }

    /// Plays held random actions with the same number of runs of the ego.
    ///
    /// It is the number that learning the ego and playing every start takes.
    fn held_for_as_much(&mut self, runs: u64) {
        // Trivial starts are not played, so they take no runs.
        let trivial = &self.starts.trivial;
        let starts = trivial.iter().filter(|trivial| !**trivial).count() as u64;
        let spent = runs + starts * self.evaluation.tries;
        // Rounded up, so the baseline never gets fewer runs.
        let budget = spent.div_ceil(starts.max(1));
        let row = self.row(&Search {
            method: Hold.into(),
            budget,
        });
        self.rows.extend(row.map(|row| Row {
            ado: AdversaryId::Hold,
            method: format!("at most {budget} runs per start, as many as adapting takes"),
            ..row
        }));
    }

    fn request(&self) -> EvalRequest<'a> {
        let ado = Ado::Trained(self.policy, self.evaluation.run.manifest().seed);
        self.ego.against(ado, self.starts)
    }

    /// Plays the trained ado once per start.
    fn trained(&mut self) {
        let ado = Ado::Trained(self.policy, self.evaluation.run.manifest().seed);
        let Some(cell) = ado.play(self.ego, self.starts, self.watch) else {
            return;
        };
        self.reason = cell
            .explain_first()
            .map(|(start, explanation)| ExplainedCounterexample {
                ego: self.ego.name().to_owned(),
                start,
                requirement: self.ego.scenario().requirement.clone(),
                explanation,
            });
        self.rows.push(Row {
            warning: self.evaluation.run.warning(),
            ..cell.row.clone()
        });
        self.found = Some(cell);
    }

    /// Searches every start by the trained ado's proposals, if several tries are requested.
    fn guided(&mut self) {
        // A single try is the run of the trained ado, which has its row already.
        if self.evaluation.tries <= 1 {
            return;
        }
        let search = Search {
            method: Guided(GuidingPolicy(self.policy)).into(),
            budget: self.evaluation.tries,
        };
        let Some(cell) = search.play(self.ego, self.starts, self.watch) else {
            return;
        };
        self.rows.push(Row {
            train_seed: Some(self.evaluation.run.manifest().seed),
            ..cell.row.clone()
        });
        // Its first run is the trained ado's, so it solves these starts, too.
        self.found = Some(cell);
    }

    /// Plays the trained ado with actions drawn at a temperature, if requested.
    fn sampled(&mut self) {
        let Some(sampling) = self.evaluation.sampling else {
            return;
        };
        // Each draw is a run of the start, which is solved if any of them succeeds.
        let ego = self
            .ego
            .in_world(self.ego.scenario().repeating_starts(Repeats {
                runs: sampling.draws,
                gate: 1,
            }));
        let seed = self.evaluation.run.manifest().seed;
        let ado = Ado::Sampled(self.policy, seed, sampling.temperature);
        if let Some(cell) = ado.play(&ego, self.starts, self.watch) {
            self.rows.push(cell.row);
        }
    }

    /// Plays the trained ado without one of several: one of its own, or a placed one.
    fn without(&mut self, id: &AdversaryId) {
        let (world, seed) = (self.ego.scenario(), self.evaluation.run.manifest().seed);
        let Some(left_out) = id.left_out() else {
            return;
        };
        let own = world.spaces().parts.iter();
        if own
            .map(|part| part.name.as_str())
            .any(|name| name == left_out)
        {
            self.add(&Ado::Without(self.policy, seed, left_out));
            return;
        }
        // A placed ado has no part in the joint action, so its idling is a change of the
        // world.
        let others = self
            .ego
            .in_world(world.with_idle_ados(|ado| ado == left_out));
        let cell = Ado::Trained(self.policy, seed).play(&others, self.starts, self.watch);
        self.rows.extend(cell.map(|cell| Row {
            ado: id.clone(),
            ..cell.row
        }));
    }

    /// Plays one of the trained ados alone.
    fn alone(&mut self, id: &AdversaryId) {
        let seed = self.evaluation.run.manifest().seed;
        if let Some(ado) = id.only() {
            self.add(&Ado::Alone(self.policy, seed, ado));
        }
    }

    /// Plays the ado that plans in a surrogate of this ego, unless stopped.
    fn adapted(&mut self, runs: u64) -> Result<(), EvaluationError> {
        let evaluation = self.evaluation;
        let policy = self.policy;
        let kept = evaluation.run.policy_bundle()?;
        // A surrogate is of a driver, and a grid has none.
        let Some(driving) = self.ego.scenario().drive() else {
            return Ok(());
        };
        let request = LearnEgoRequest::new(evaluation.nominal, driving, policy, runs)
            .bundle(&kept)
            .unknown(evaluation.unknown)
            .seed(self.starts.seed);
        self.watch.phase(&format!("learning {}", self.ego.name()));
        // Learning has phases of its own, which would hide the progress of the evaluation.
        let quiet = self.watch.quiet();
        let Some(ego) = learned(evaluation.run, self.ego, &request, &quiet)? else {
            return Ok(());
        };
        self.watch
            .phase(&format!("planning against {}", self.ego.name()));
        let adapted = ego.eval(&self.request(), policy, evaluation.tries, self.watch);
        let (name, world) = (self.ego.name(), self.ego.scenario());
        self.adapted_to = Some(AdaptedTo::of(name, world, &ego.from, &adapted));
        let cell = ExperimentCell::evaluated(self.ego, self.starts, adapted.evaluated)
            .with_judged_contacts(self.watch);
        self.rows.push(cell.row.clone());
        self.found = Some(ExperimentCell {
            // The planner is the trained ado with a surrogate, and files name the ado.
            adversary: AdversaryId::Trained,
            ..cell
        });
        Ok(())
    }

    /// Plays an ado trained for this ego. The nominal ego has the trained ado already.
    fn retrained(&mut self) -> Result<(), EvaluationError> {
        // The ado of the run was trained for the own ego already.
        let Some(changed) = self.ego.as_changed() else {
            return Ok(());
        };
        let run = self.evaluation.run;
        let Some(own) = retrained(run, &changed, self.ego.scenario(), &self.watch.unnumbered())?
        else {
            return Ok(());
        };
        let policy = own.policy()?;
        let ado = Ado::Trained(&*policy, run.manifest().seed);
        let method = own.scenario()?.learner.name().to_lowercase();
        self.rows.extend(self.row(&ado).map(|row| Row {
            ado: AdversaryId::Retrained,
            method,
            // Its training is another than that of the run, and may have learned less.
            warning: own.warning(),
            ..row
        }));
        Ok(())
    }

    /// Plays a rule of grid worlds, whose counterexamples are kept if none are trained.
    fn on_grid(&mut self, rule: GridPolicy) -> Result<(), EvaluationError> {
        // These ados use both positions, so they play in the fully observed world.
        let (whole, policy) = rule.policy(self.ego)?;
        let cell = rule.ado(&policy).play(&whole, self.starts, self.watch);
        self.rows.extend(cell.iter().map(|cell| cell.row.clone()));
        // Files are named after world and ego, so those of the trained ado take precedence.
        let is_optimal = matches!(rule, GridPolicy::Optimal);
        if is_optimal && !self.evaluation.ados.contains(&AdversaryId::Trained) {
            self.found = cell;
        }
        Ok(())
    }
}
