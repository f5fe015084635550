//! Payoffs of a league: the recall of an ado against an ego, on common starts.
//!
//! The starts are calibration starts, so neither a training nor a report sees them.

use crate::adversary::{Ado, eval};
use crate::experiment::{EgoError, EgoUnderTest, EpisodeLoop, TestStarts, Watch};
use crate::rl::Policy;
use crate::search::{SearchRequest, Switches, search};
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;
use crate::stats::StartOutcome;
use crate::testbench::{Aftermath, Constant, NoisyStart};
use crate::world::Scenario;
use crate::world::family::{EgoSample, Family};

/// Switches of action in the search that recall refers to.
///
/// Two switches cost 50 times as much, and a league searches hundreds of egos.
const SWITCHES: usize = 1;

/// World of a league and common starts, without those on which the nominal ego fails.
pub(super) struct PayoffStarts<'a> {
    pub(super) scenario: &'a Scenario,
    pub(super) family: &'a Family,
    starts: TestStarts,
}

/// Motion of an ego without an adversary.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FreeDrive {
    /// Share of the starts on which it fails by itself.
    pub(super) failures: f64,
    /// Mean speed, in m/s.
    pub(super) speed_mps: f64,
}

/// Ego of a league, with the starts that a search solves against it.
#[derive(Clone, Debug)]
pub(super) struct LeagueEgo {
    pub(super) member: EgoSample,
    ego: EgoUnderTest,
    searched: Vec<bool>,
}

impl<'a> PayoffStarts<'a> {
    /// Draws `count` starts of a calibration stream. `None`: stopped.
    pub(super) fn new(
        scenario: &'a Scenario,
        family: &'a Family,
        seed: u64,
        count: usize,
        watch: &Watch<'_>,
    ) -> Option<PayoffStarts<'a>> {
        let bench = scenario.bench();
        let draw = |index| {
            // Payoffs decide who is a member, so they leave the test starts alone.
            let key = StartKey {
                purpose: Purpose::Calibration,
                seed,
                index,
            };
            (bench.draw(key), bench.noise_of(key))
        };
        let drawn = (0..count as u64).map(draw).collect();
        let starts = TestStarts::tried(scenario, seed, drawn, watch)?;
        Some(PayoffStarts {
            scenario,
            family,
            starts: starts.first(count),
        })
    }

    /// Returns the plant of the league.
    pub(super) fn plant(&self) -> PlantKind {
        // Invariant: a world with a family is driven.
        self.scenario
            .plant()
            .plant()
            .unwrap_or(PlantKind::Kinematic)
    }

    /// Returns the number of starts.
    pub(super) fn len(&self) -> usize {
        self.starts.starts.len()
    }

    /// Returns a member of the family as an ego in the league's world.
    ///
    /// # Errors
    /// The member does not fit the world.
    pub(super) fn ego(&self, member: &EgoSample) -> Result<EgoUnderTest, EgoError> {
        let change = self.family.change(member);
        let help = "correct the ranges under `train_against`";
        EgoUnderTest::changed(self.scenario, "league", &change, help)
    }

    /// Drives an ego from every start with coasting ados. `None`: stopped.
    pub(super) fn drive_alone(&self, ego: &EgoUnderTest, watch: &Watch<'_>) -> Option<FreeDrive> {
        let scenario = ego.scenario();
        let spec = scenario.drive()?.spec();
        let name = &spec.agents[spec.egos().next()?].name;
        let signal = format!("{name}.speed");
        let neutral = scenario.world().spaces().neutral;
        let bench = || scenario.bench();
        let all = EpisodeLoop::uncounted(watch);
        let driven = all.run(&self.starts.starts, bench, |bench, start, turn| {
            let mut coasting = Constant(neutral);
            let from = NoisyStart::from(start);
            let episode = watch.play(bench, from, turn.index, &mut coasting, Aftermath::Skip);
            // Without the signal an ego seems to stand, and no response may rest on it.
            let speeds = episode.trace.signal(&signal).unwrap_or_default();
            let speed_mps = speeds.iter().sum::<f64>() / speeds.len().max(1) as f64;
            Some((episode.verdict.is_success(), speed_mps))
        });
        if watch.stopped() {
            return None;
        }
        let count = driven.len().max(1) as f64;
        let failures = driven.iter().flatten().filter(|(fails, _)| *fails).count();
        let speeds = driven.iter().flatten().map(|(_, speed_mps)| speed_mps);
        Some(FreeDrive {
            failures: failures as f64 / count,
            speed_mps: speeds.sum::<f64>() / count,
        })
    }

    /// Searches every start against an ego. `None`: stopped.
    pub(super) fn searched(
        &self,
        member: EgoSample,
        ego: EgoUnderTest,
        watch: &Watch<'_>,
    ) -> Option<LeagueEgo> {
        let request = SearchRequest {
            scenario: ego.scenario(),
            ego: ego.name(),
            method: Switches(SWITCHES).into(),
            // The number of switches alone limits this method.
            budget: 0,
            starts: &self.starts,
        };
        let found = search(&request, watch);
        let searched = solved(&found.row.solved);
        // A stopped search knows a part of the starts only.
        (!watch.stopped()).then_some(LeagueEgo {
            member,
            ego,
            searched,
        })
    }

    /// Returns the recall of a policy against an ego, in [0, 1]. `None`: stopped.
    ///
    /// It is 1 if search solves no start, so that such an ego is no response.
    pub(super) fn recall(
        &self,
        policy: &dyn Policy,
        ego: &LeagueEgo,
        watch: &Watch<'_>,
    ) -> Option<f64> {
        // The seed names a training in rows, of which payoffs keep none.
        let trained = Ado::Trained(policy, 0);
        let evaluated = eval(&ego.ego.against(trained, &self.starts), watch);
        // Starts that only the ado solves do not count, so that recall is at most 1.
        let pairs = solved(&evaluated.row.solved).into_iter().zip(&ego.searched);
        let both = pairs
            .filter(|(solved, searched)| *solved && **searched)
            .count();
        let searched = ego.searched.iter().filter(|searched| **searched).count();
        (!watch.stopped()).then(|| {
            if searched == 0 {
                1.0
            } else {
                both as f64 / searched as f64
            }
        })
    }
}

impl LeagueEgo {
    /// Returns the share of the starts that search solves.
    pub(super) fn searched_share(&self) -> f64 {
        let solved = self.searched.iter().filter(|searched| **searched).count();
        solved as f64 / self.searched.len().max(1) as f64
    }
}

fn solved(outcomes: &[StartOutcome]) -> Vec<bool> {
    let solved = outcomes.iter().map(|it| *it == StartOutcome::Solved);
    solved.collect()
}
