//! Coverage of the worlds of a campaign by its finished pieces.

use super::dir::PlanDir;
use super::error::CampaignError;
use super::piece::{Unusable, path_of};
use super::plan::{CampaignPiece, Work};
use super::row::StartRow;
use crate::coverage::{
    Coverage, CoveredEpisode, EpisodeOrigin, RULED_EPISODES, RuleBound, observed,
};
use crate::experiment::{Watch, consent};
use crate::run_dir::RunError;
use crate::scene::Start;
use crate::stats::StartOutcome;
use crate::testbench::{Aftermath, Replay, play};
use crate::world::Scenario;

/// Coverage of a campaign.
#[derive(Clone, Debug)]
pub struct CampaignCoverage {
    /// Coverage of each world with a finished piece.
    pub worlds: Vec<Coverage>,
    /// Finished pieces that play starts.
    pub pieces: usize,
    /// Pieces that play starts.
    pub of: usize,
}

impl PlanDir {
    /// Measures the coverage by the finished pieces, a coverage per world.
    ///
    /// Failures are played again. All other starts are tries, of which only the row is
    /// known: rules are evaluated on failures, and on starts where a rule was broken.
    /// `None`: stopped.
    ///
    /// # Errors
    /// Returns an error if a piece is damaged or foreign, or an ego may not be started.
    pub fn coverage(&self, watch: &Watch<'_>) -> Result<Option<CampaignCoverage>, CampaignError> {
        let count = self.plan().worlds.len();
        let mut episodes: Vec<Vec<CoveredEpisode>> = vec![Vec::new(); count];
        let (mut pieces, mut of) = (0, 0);
        for piece in self.plan().pieces() {
            let Work::Starts { unit, .. } = piece.work else {
                continue;
            };
            of += 1;
            let Some(rows) = self.rows_to_cover(&piece)? else {
                continue;
            };
            pieces += 1;
            let Some(seen) = self.covered(unit, &rows, watch)? else {
                return Ok(None);
            };
            // Egos of a world share its ranges of starts, so their episodes cover the
            // same space.
            episodes[self.plan().units[unit].world].extend(seen);
        }
        let units = &self.plan().units;
        let worlds = episodes
            .into_iter()
            .enumerate()
            .filter_map(|(world, seen)| {
                let unit = units.iter().find(|unit| unit.world == world)?;
                // A world without a finished piece is absent, because 0 % would look like
                // a result.
                (!seen.is_empty()).then(|| Coverage::of(self.played(unit), &seen))
            });
        Ok(Some(CampaignCoverage {
            worlds: worlds.collect(),
            pieces,
            of,
        }))
    }

    /// Observes the rows of a unit. `None`: stopped.
    fn covered(
        &self,
        unit: usize,
        rows: &[StartRow],
        watch: &Watch<'_>,
    ) -> Result<Option<Vec<CoveredEpisode>>, CampaignError> {
        let planned = &self.plan().units[unit];
        let (world, ego) = (self.world(planned), self.ego(planned)?);
        consent(world, std::slice::from_ref(&ego))?;
        let is_failure = |row: &&StartRow| row.outcome == StartOutcome::Solved;
        let failures: Vec<&StartRow> = rows.iter().filter(is_failure).collect();
        let seen = observed(
            ego.scenario(),
            &failures,
            EpisodeOrigin::Drawn,
            RULED_EPISODES,
            watch,
            |bench, row, _| {
                let at = row.start as usize;
                let starts = self.plan().starts.of(world, at..at + 1);
                let (start, noise) = starts.first()?;
                let mut replay = Replay::holding(&row.actions);
                Some(play(bench, start, *noise, &mut replay, Aftermath::Play))
            },
        );
        let others = rows.iter().filter_map(|row| unfailing(ego.scenario(), row));
        Ok(seen.map(|seen| seen.into_iter().chain(others).collect()))
    }

    /// Reads the rows of a piece. `None`: it is not there yet.
    fn rows_to_cover(&self, piece: &CampaignPiece) -> Result<Option<Vec<StartRow>>, CampaignError> {
        let path = path_of(self.path(), piece.number);
        let damaged = |why: String| RunError::Damaged {
            path: path.clone(),
            why,
        };
        let text = match self.read(piece)? {
            Ok(text) => text,
            Err(Unusable::Missing) => return Ok(None),
            Err(Unusable::Damaged(why)) => return Err(damaged(why).into()),
            Err(Unusable::Foreign) => {
                return Err(damaged("it is of another plan, world or program".to_owned()).into());
            }
        };
        let parsed = text.rows.lines().map(serde_json::from_str);
        let rows = parsed.collect::<Result<Vec<StartRow>, _>>();
        Ok(Some(rows.map_err(|error| damaged(error.to_string()))?))
    }
}

/// Returns a start without a failure as a try. `None`: it was left out or did not run.
fn unfailing(scenario: &Scenario, row: &StartRow) -> Option<CoveredEpisode> {
    let is_try = matches!(
        row.outcome,
        StartOutcome::Held | StartOutcome::RuleViolation | StartOutcome::Uncounted
    );
    let is_broken = |name: &String| row.rule.as_ref() == Some(name);
    let rules = scenario.rulebook().rules.iter().map(|rule| {
        // The row knows only the most important of the broken rules.
        is_broken(&rule.name).then_some(RuleBound {
            margin: None,
            is_broken: true,
            forbids_other: None,
        })
    });
    is_try.then(|| CoveredEpisode {
        origin: EpisodeOrigin::Drawn,
        start: Start(row.x.clone()),
        failure: None,
        rules: rules.collect(),
    })
}
