//! Play of some starts of a unit, with a row per start.

use std::ops::Range;

use super::error::CampaignError;
use super::plan::{Plan, Unit};
use super::row::StartRow;
use crate::experiment::{
    EgoUnderTest, EpisodeLoop, TestStarts, TrivialStarts, Watch, check_repeatability, leaf,
};
use crate::preventability::Avoidability;
use crate::rl::Policy;
use crate::rulebook::Verdict;
use crate::scene::AfterContact;
use crate::search::{Adversary, ExperimentCell, PlayerParts, StartResult};
use crate::severity::Impact;
use crate::stats::StartOutcome;
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

impl UnitContext<'_> {
    /// Plays some starts, of which the known trivial ones are not played again.
    ///
    /// `None`: stopped before the last of them.
    pub(super) fn play(
        &self,
        which: Range<usize>,
        trivial: TrivialStarts,
        watch: &Watch<'_>,
    ) -> Result<Option<PlayedRows>, CampaignError> {
        let seed = self.plan.starts.seed();
        let points = self.plan.starts.of(self.world, which.clone());
        // If the world's own ego does not represent others, as in imported scenes, no start
        // is left out.
        let trivial = if self.world.judges_each_ego() {
            TrivialStarts {
                known: vec![Some(false); points.len()],
                ..TrivialStarts::default()
            }
        } else {
            let Some(played) = trivial.play(self.world, &points, watch) else {
                return Ok(None);
            };
            played
        };
        let trivial_s = trivial.cpu_s;
        let starts = TestStarts::new(seed, points, trivial);
        let Some(cell) = self.adversary()?.play(&self.ego, &starts, watch) else {
            return Ok(None);
        };
        let details = self.details(&cell, watch);
        // A finding is in the log of faults, and the piece is then no result.
        check_repeatability(&self.ego, &starts, [], watch);
        // A piece is complete or absent, so rows of a stopped run are dropped.
        if watch.stopped() {
            return Ok(None);
        }
        let rows = which
            .zip(&starts.starts)
            .zip(cell.results.iter().zip(details))
            .map(|((start, (point, _)), (result, details))| {
                let blank = self.blank(start, &point.0);
                match result {
                    // A trivial start has a row too, so every start of the plan appears once.
                    None => blank,
                    Some(result) => self.filled(blank, result, details),
                }
            });
        Ok(Some(PlayedRows {
            rows: rows.collect(),
            cpu_s: trivial_s + cell.row.cpu_s,
        }))
    }

    /// Plays every success again to record its details.
    fn details(&self, cell: &ExperimentCell, watch: &Watch<'_>) -> Vec<Option<SuccessDetails>> {
        let scenario = self.ego.scenario();
        // Only a few values are kept, because a piece may have many thousand episodes.
        EpisodeLoop::uncounted(watch).run(
            &cell.results,
            || scenario.bench(),
            |bench, result, turn| {
                if result.as_ref()?.outcome != StartOutcome::Solved {
                    return None;
                }
                let episode = cell.replay(bench, turn.index);
                // The reference drivers can judge only an episode that ends in contact.
                let judged = self.plan.preventability && episode.contact.is_some();
                let known = judged.then(|| scenario.preventability(&episode));
                Some(SuccessDetails {
                    robustness: episode.robustness,
                    leaf: leaf(scenario, &episode),
                    impact: episode.contact.as_ref().and_then(|touch| touch.impact),
                    after_contact: episode.after_contact,
                    avoidability: known.map_or(Avoidability::Unknown, |known| known.avoidability()),
                    actions: episode.actions,
                })
            },
        )
    }

    fn adversary(&self) -> Result<Box<dyn Adversary + '_>, CampaignError> {
        let parts = PlayerParts {
            policy: self.ado.as_ref().map(|ado| (&*ado.policy, ado.seed)),
            ..PlayerParts::default()
        };
        let player = parts.player(&self.unit.ado.id)?;
        player.ok_or_else(|| CampaignError::Fault("the ado was not loaded".to_owned()))
    }

    /// Returns the row of a trivial start.
    fn blank(&self, start: usize, x: &[f64]) -> StartRow {
        StartRow {
            world: self.world.name().to_owned(),
            plant: self.ego.scenario().plant(),
            ego: self.ego.name().to_owned(),
            ado: self.unit.ado.id.to_string(),
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
            after_contact: None,
            preventable: None,
            unavoidable: None,
            simulations: 0,
            physics_steps: 0,
            actions: Vec::new(),
        }
    }

    /// Returns the row of a start that was played.
    fn filled(
        &self,
        blank: StartRow,
        result: &StartResult,
        success: Option<SuccessDetails>,
    ) -> StartRow {
        let scenario = self.ego.scenario();
        let mut row = StartRow {
            outcome: result.outcome,
            contact: result.closing_speed_mps.is_some(),
            closing_mps: result.closing_speed_mps,
            simulations: result.simulations,
            physics_steps: result.physics_steps,
            ..blank
        };
        match result.verdict {
            Some(Verdict::Held { margin }) => row.robustness = Some(margin),
            Some(Verdict::Counterexample { by } | Verdict::Uncounted { by }) => {
                // The sign turns the depth of a violation into a robustness.
                row.robustness = Some(-by);
            }
            Some(Verdict::Foul { rule, .. }) => {
                let broken = scenario.rulebook().rules.get(rule);
                row.rule = broken.map(|rule| rule.name.clone());
            }
            // A search has no verdict, so its robustness is that of the repeated run.
            Some(Verdict::Invalid) | None => {}
        }
        let Some(success) = success else {
            return row;
        };
        let impact = success.impact;
        row.robustness = Some(success.robustness);
        row.leaf = Some(success.leaf);
        row.kind = impact.map(|impact| impact.kind);
        row.ego_delta_v_mps = impact.map(|impact| impact.ego_delta_v_mps);
        let risk = impact.and_then(|impact| impact.injury_risk());
        row.injury_risk = risk.map(|risk| risk.probability);
        row.after_contact = success.after_contact;
        row.preventable = success.avoidability.preventable();
        row.unavoidable = success.avoidability.unavoidable();
        row.actions = success.actions;
        row
    }
}

/// Details of a success.
struct SuccessDetails {
    robustness: f64,
    leaf: String,
    impact: Option<Impact>,
    after_contact: Option<AfterContact>,
    avoidability: Avoidability,
    actions: Vec<usize>,
}
