//! Play of some starts of a unit, with a row per start.

use std::ops::Range;

use super::error::CampaignError;
use super::plan::{Plan, PlannedAdo, Unit};
use super::row::StartRow;
use crate::adversary::{Ado, EvalRequest, eval};
use crate::experiment::{EgoUnderTest, EpisodeLoop, TestStarts, Watch, consent, leaf};
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::scene::{Dynamics, Start};
use crate::search::{Method, MethodSettings, SearchRequest, search};
use crate::severity::Impact;
use crate::stats::StartOutcome;
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::Scenario;

/// Unit with everything needed to play it.
pub(super) struct UnitContext<'a> {
    pub plan: &'a Plan,
    pub unit: &'a Unit,
    /// World of the file. Its own ego decides which starts are trivial.
    pub world: &'a Scenario,
    pub ego: EgoUnderTest,
    /// Trained ado of the unit, if any.
    pub ado: Option<LoadedAdo>,
}

/// Trained ado that was read.
pub(super) struct LoadedAdo {
    pub policy: Box<dyn Policy>,
    /// Seed of its training.
    pub seed: u64,
    /// SHA-256 of its file.
    pub sha256: String,
}

/// Rows of some starts, with their processor time.
pub(super) struct PlayedRows {
    pub rows: Vec<StartRow>,
    pub cpu_s: f64,
}

/// Outcome of a start, before a success is played again.
struct PlayedStart {
    outcome: StartOutcome,
    verdict: Option<Verdict>,
    contact: Option<f64>,
    simulations: u64,
    physics_steps: u64,
}

impl UnitContext<'_> {
    /// Plays some starts. `None`: stopped before the last of them.
    pub fn play(
        &self,
        which: Range<usize>,
        watch: &Watch<'_>,
    ) -> Result<Option<PlayedRows>, CampaignError> {
        consent(self.world, std::slice::from_ref(&self.ego))?;
        let seed = self.plan.starts.seed();
        let points = self.plan.starts.of(self.world, which.clone());
        let Some(starts) = self.judged(seed, points, watch) else {
            return Ok(None);
        };
        let (ended, episodes, cpu_s) = match &self.unit.ado {
            PlannedAdo::Search {
                method,
                switches,
                budget,
            } => {
                let settings = MethodSettings {
                    switches: Some(*switches),
                    stored: None,
                };
                let method = Method::named(method, &settings)?;
                self.searched((method, *budget), &starts, watch)
            }
            _ => self.evaluated(&starts, watch)?,
        };
        // A piece is complete or absent, so rows of a stopped run are dropped.
        if watch.stopped() {
            return Ok(None);
        }
        let rows = which.zip(starts.starts.iter()).enumerate();
        let rows = rows.map(|(nth, (start, (point, _)))| {
            let blank = self.blank(start, &point.0);
            match ended.get(nth).and_then(Option::as_ref) {
                // A trivial start has a row too, so every start of the plan appears once.
                None => blank,
                Some(ended) => self.told(blank, ended, episodes[nth].as_ref()),
            }
        });
        let rows = rows.collect();
        Ok(Some(PlayedRows { rows, cpu_s }))
    }

    /// Starts, with those left out at which the world's own ego fails by itself.
    ///
    /// Where that ego says nothing of others, as in imported scenes, each start is
    /// a question to the unit's ego, and none is left out. `None`: stopped.
    fn judged(
        &self,
        seed: u64,
        starts: Vec<(Start, u64)>,
        watch: &Watch<'_>,
    ) -> Option<TestStarts> {
        if !self.world.judges_each_ego() {
            return TestStarts::tried(self.world, seed, starts, watch);
        }
        let trivial = vec![false; starts.len()];
        Some(TestStarts {
            seed,
            starts,
            trivial,
        })
    }

    fn evaluated(
        &self,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Result<StartResults, CampaignError> {
        let scenario = self.ego.scenario();
        let request = EvalRequest {
            scenario,
            ego: self.ego.name(),
            ado: self.ado()?,
            starts,
        };
        let evaluated = eval(&request, watch);
        let ended: Vec<Option<PlayedStart>> = evaluated
            .outcomes
            .iter()
            .map(|outcome| {
                outcome.map(|outcome| PlayedStart {
                    outcome: StartOutcome::of(&outcome.verdict),
                    verdict: Some(outcome.verdict),
                    contact: outcome.closing_speed_mps,
                    simulations: outcome.simulations,
                    physics_steps: outcome.physics_steps,
                })
            })
            .collect();
        let again = |bench: &mut Testbench, index: usize| {
            let mut played = |bench: &mut Testbench, index| request.play(bench, index);
            evaluated.again(&request, bench, index, &mut played)
        };
        let episodes = self.again(&ended, &again, watch);
        Ok((ended, episodes, evaluated.row.cpu_s))
    }

    fn searched(
        &self,
        (method, budget): (Method<'_>, u64),
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> StartResults {
        let request = SearchRequest {
            scenario: self.ego.scenario(),
            ego: self.ego.name(),
            method,
            budget,
            starts,
        };
        let searched = search(&request, watch);
        let ended: Vec<Option<PlayedStart>> = searched
            .found
            .iter()
            .map(|found| {
                found.as_ref().map(|found| PlayedStart {
                    outcome: match (&found.actions, found.is_invalid()) {
                        (Some(_), _) => StartOutcome::Solved,
                        (None, true) => StartOutcome::Invalid,
                        (None, false) => StartOutcome::Held,
                    },
                    // A search has no verdict of its own, so robustness comes from the
                    // repeated run.
                    verdict: None,
                    contact: found.closing_speed_mps,
                    simulations: found.simulations,
                    physics_steps: found.physics_steps,
                })
            })
            .collect();
        let again = |bench: &mut Testbench, index: usize| {
            let (start, noise) = &starts.starts[index];
            let found = searched.found[index].as_ref();
            let actions = found.and_then(|found| found.actions.as_deref());
            let mut ado = Replay::holding(actions.unwrap_or_default());
            play(bench, start, *noise, &mut ado, Aftermath::Play)
        };
        let episodes = self.again(&ended, &again, watch);
        (ended, episodes, searched.row.cpu_s)
    }

    /// Plays every success again to record its details.
    fn again(
        &self,
        ended: &[Option<PlayedStart>],
        again: &(dyn Fn(&mut Testbench, usize) -> Episode + Sync),
        watch: &Watch<'_>,
    ) -> Vec<Option<SuccessDetails>> {
        let scenario = self.ego.scenario();
        // Only a few values are kept, because a piece may have many thousand episodes.
        EpisodeLoop::uncounted(watch).run(
            ended,
            || scenario.bench(),
            |bench, ended, turn| {
                let ended = ended.as_ref()?;
                if ended.outcome != StartOutcome::Solved {
                    return None;
                }
                let episode = again(bench, turn.index);
                // The reference drivers can judge only an episode that ends in contact.
                let judged = self.plan.preventability && episode.contact.is_some();
                let known = judged.then(|| scenario.preventability(&episode));
                Some(SuccessDetails {
                    robustness: episode.robustness,
                    leaf: leaf(scenario, &episode),
                    impact: episode.contact.as_ref().and_then(|touch| touch.impact),
                    preventable: known.and_then(|known| known.human_model_avoids()),
                    actions: episode.actions,
                })
            },
        )
    }

    fn ado(&self) -> Result<Ado<'_>, CampaignError> {
        Ok(match &self.unit.ado {
            // The neutral action depends on the world, so it is resolved here.
            PlannedAdo::Neutral => Ado::Constant(self.ego.scenario().world().spaces().neutral),
            PlannedAdo::Held => Ado::Held,
            PlannedAdo::Random => Ado::Random,
            PlannedAdo::Constant { action, .. } => Ado::Constant(*action),
            PlannedAdo::Script { actions, .. } => Ado::Script(actions),
            PlannedAdo::Search { .. } => {
                return Err(CampaignError::Fault("a search is no policy".to_owned()));
            }
            PlannedAdo::Trained { .. } | PlannedAdo::Training { .. } => match &self.ado {
                Some(ado) => Ado::Trained(&*ado.policy, ado.seed),
                None => return Err(CampaignError::Fault("the ado was not loaded".to_owned())),
            },
        })
    }

    /// Returns the row of a trivial start.
    fn blank(&self, start: usize, x: &[f64]) -> StartRow {
        StartRow {
            world: self.world.name().to_owned(),
            plant: plant_word(self.ego.scenario().plant()),
            ego: self.ego.name().to_owned(),
            ado: self.unit.ado.word(),
            train_seed: self.ado.as_ref().map(|ado| ado.seed),
            start: start as u64,
            x: x.to_vec(),
            outcome: StartOutcome::Trivial,
            robustness: None,
            rule: None,
            leaf: None,
            contact: false,
            closing_mps: None,
            kind: None,
            ego_delta_v_mps: None,
            injury_risk: None,
            preventable: None,
            simulations: 0,
            physics_steps: 0,
            actions: Vec::new(),
        }
    }

    fn told(
        &self,
        blank: StartRow,
        ended: &PlayedStart,
        success: Option<&SuccessDetails>,
    ) -> StartRow {
        let scenario = self.ego.scenario();
        let mut row = StartRow {
            outcome: ended.outcome,
            contact: ended.contact.is_some(),
            closing_mps: ended.contact,
            simulations: ended.simulations,
            physics_steps: ended.physics_steps,
            ..blank
        };
        match ended.verdict {
            Some(Verdict::Held { margin }) => row.robustness = Some(margin),
            Some(Verdict::Counterexample { by } | Verdict::Uncounted { by }) => {
                // The sign turns the depth of a violation into a robustness.
                row.robustness = Some(-by);
            }
            Some(Verdict::Foul { rule, .. }) => {
                let broken = scenario.rulebook().rules.get(rule);
                row.rule = broken.map(|rule| rule.name.clone());
            }
            Some(Verdict::Invalid) | None => {}
        }
        let Some(success) = success else {
            return row;
        };
        let impact = success.impact;
        row.robustness = Some(success.robustness);
        row.leaf = Some(success.leaf.clone());
        row.kind = impact.map(|impact| impact.kind);
        row.ego_delta_v_mps = impact.map(|impact| impact.ego_delta_v_mps);
        let risk = impact.and_then(|impact| impact.injury_risk());
        row.injury_risk = risk.map(|risk| risk.probability);
        row.preventable = success.preventable;
        row.actions.clone_from(&success.actions);
        row
    }
}

/// Details of a success.
struct SuccessDetails {
    robustness: f64,
    leaf: String,
    impact: Option<Impact>,
    preventable: Option<bool>,
    actions: Vec<usize>,
}

type StartResults = (Vec<Option<PlayedStart>>, Vec<Option<SuccessDetails>>, f64);

/// Returns the name of the plant as in rows of other verbs.
fn plant_word(plant: Dynamics) -> String {
    format!("{plant:?}")
}
