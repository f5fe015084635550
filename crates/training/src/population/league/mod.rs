//! League: a population of egos against a population of ados, by alternating responses.
//!
//! Round 0 has the nominal ego and an ado trained against it. Each later round solves
//! the matrix game of both populations, adds a best response of the ego, solves it again,
//! and adds a best response of the ado: a double oracle (McMahan, Gordon, Blum 2003) with
//! learned responses, or policy-space response oracles (Lanctot et al. 2017).
//!
//! The payoff is the recall of an ado on common starts: of those that a search solves
//! against the ego, the share that the ado solves. It is zero-sum, and unlike the success
//! it gives the ego nothing for being safe, only for being unlike the egos before it.
//!
//! ```text
//! RUN/members/000       ado of round 0, and so on
//! RUN/league.jsonl      a line per round: egos, payoffs, mixtures and responses
//! ```
//!
//! A round is recorded when its ado is trained. An interrupted round is begun again, with
//! the same responses, and its ado continues from its checkpoint.

// Paper: both sides respond to the same mixtures; here: one after the other, because the
// ado then trains against the latest ego.

mod ego_response;
mod error;
mod payoff;
mod round;

use std::path::Path;

use super::manifest::{PAYOFF_STARTS, RESPONSE_STARTS};
use super::{PopulationDir, PopulationOrigin};
use crate::experiment::{Watch, consent, consent_to_family};
use crate::rl::Policy;
use crate::run_dir::{Beginning, RequestedTraining, RunDifference, RunDir, RunError};
use crate::seed::derived_seed;
use crate::stats::row_gains;
use crate::training::train_loop::train;
use crate::training::{OptionClash, SessionError, TrainRequest};
use crate::world::Scenario;
use crate::world::family::EgoSample;
use ego_response::EgoResponse;
pub use error::LeagueError;
use payoff::{FreeDrive, LeagueEgo, PayoffStarts};
pub use round::{LeagueResponse, LeagueRound};

/// Request to train a league.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct LeagueRequest<'a> {
    /// Options of every training. `against`, `ego` and `from` must not be set.
    pub training: TrainRequest<'a>,
    /// Rounds after round 0. Each adds an ado, and an ego if there is a response.
    pub rounds: usize,
    /// Starts of the payoffs, 100 by default.
    pub payoff_starts: usize,
    /// Starts of the search for a response of the ego, 40 by default.
    pub response_starts: usize,
}

impl<'a> LeagueRequest<'a> {
    /// Requests a number of rounds.
    pub fn new(training: TrainRequest<'a>, rounds: usize) -> LeagueRequest<'a> {
        LeagueRequest {
            training,
            rounds,
            payoff_starts: PAYOFF_STARTS,
            response_starts: RESPONSE_STARTS,
        }
    }

    fn origin(&self) -> PopulationOrigin {
        PopulationOrigin::League {
            rounds: self.rounds,
            payoff_starts: self.payoff_starts,
            response_starts: self.response_starts,
        }
    }
}

/// Trains a league in a new directory, or continues one with `resume`.
///
/// Returns all recorded rounds, fewer than requested if stopped.
///
/// # Errors
/// The request does not fit the world or the directory, an ego does not run, or the disk
/// refuses.
pub fn train_league(
    world: &Scenario,
    path: &Path,
    request: &LeagueRequest<'_>,
    resume: bool,
    watch: &Watch<'_>,
) -> Result<Vec<LeagueRound>, LeagueError> {
    LeagueSession::begin(world, path, request, resume)?.train(watch)
}

/// League that was begun or opened again, before its training.
pub struct LeagueSession {
    scenario: Scenario,
    dir: PopulationDir,
    rounds: usize,
    payoff_starts: usize,
    response_starts: usize,
}

impl LeagueSession {
    /// Begins a league in a new directory, or opens one with `resume`.
    ///
    /// # Errors
    /// The request does not fit the world or the directory, or the disk refuses.
    pub fn begin(
        world: &Scenario,
        path: &Path,
        request: &LeagueRequest<'_>,
        resume: bool,
    ) -> Result<LeagueSession, LeagueError> {
        let scenario = scenario_of(world, request)?;
        let dir = if resume {
            resumed(path, &scenario, request)?
        } else {
            let seed = request.training.seed.unwrap_or(0);
            PopulationDir::create(path, &scenario, seed, request.origin(), request.rounds + 1)?
        };
        Ok(LeagueSession {
            scenario,
            dir,
            rounds: request.rounds,
            payoff_starts: request.payoff_starts,
            response_starts: request.response_starts,
        })
    }

    /// Plays the rounds that are not recorded yet, and returns all recorded ones.
    ///
    /// # Errors
    /// An ego does not run or does not fail from any start, or the disk refuses.
    pub fn train(self, watch: &Watch<'_>) -> Result<Vec<LeagueRound>, LeagueError> {
        let LeagueSession {
            scenario,
            dir,
            rounds,
            payoff_starts,
            response_starts,
        } = self;
        let family = scenario.family().ok_or_else(|| no_family(&scenario))?;
        let seed = dir.manifest().seed;
        let stream = |number: u64| derived_seed(seed, number);
        // Batches of payoffs are short, and a bar for each would only flicker.
        let quiet = watch.quiet();
        watch.phase("drawing the starts of the payoffs");
        let starts =
            |number, count| PayoffStarts::new(&scenario, family, stream(number), count, &quiet);
        let payoff = starts(1, payoff_starts);
        // A response is searched on starts of its own, so that payoffs do not flatter it.
        let response = starts(2, response_starts);
        let (Some(payoff), Some(response)) = (payoff, response) else {
            return Ok(LeagueRound::all(&dir)?);
        };
        // Over no start at all, every recall would be perfect.
        if payoff.len() == 0 || response.len() == 0 {
            return Err(LeagueError::NoStarts);
        }
        let mut league = League {
            rounds: LeagueRound::all(&dir)?,
            dir,
            payoff: &payoff,
            response: &response,
            policies: Vec::new(),
            egos: Vec::new(),
        };
        league.play(rounds, watch)?;
        Ok(league.rounds)
    }
}

/// Returns the world with the options of the trainings, all against its own structure.
fn scenario_of(world: &Scenario, request: &LeagueRequest<'_>) -> Result<Scenario, LeagueError> {
    let training = &request.training;
    // The league chooses egos and first policies by itself.
    if training.ego.is_some() || training.from.is_some() || !training.against.is_nominal() {
        return Err(LeagueError::Options);
    }
    // The likeliest crashes are those of one ego, and a league has many.
    if training.traffic.is_some() {
        return Err(SessionError::Options(OptionClash::TrafficAndMany).into());
    }
    let world = training.leaving_out(world)?;
    // The structures are left out already and cannot be removed again.
    let without = TrainRequest {
        leave_out: None,
        ..*training
    };
    let scenario = without.world(&world)?;
    if scenario.family().is_none() {
        return Err(no_family(&scenario));
    }
    consent(&scenario, &[])?;
    // A response may be any member of the family, so consent must cover all of them.
    let all = scenario.training_against_mixture(Vec::new());
    consent_to_family(all.as_ref().unwrap_or(&scenario))?;
    Ok(scenario)
}

fn no_family(world: &Scenario) -> LeagueError {
    LeagueError::NoFamily {
        world: world.name().to_owned(),
    }
}

/// Opens a league that was begun with the same options.
///
/// The trainings compare their own options.
fn resumed(
    path: &Path,
    scenario: &Scenario,
    request: &LeagueRequest<'_>,
) -> Result<PopulationDir, LeagueError> {
    let dir = PopulationDir::resume(path)?;
    let manifest = dir.manifest();
    let origin = request.origin();
    // Without a seed in the request, the league keeps its own.
    let seed = request.training.seed.unwrap_or(manifest.seed);
    let compared = [
        ("process", text(&manifest.origin), text(&origin)),
        ("seed", manifest.seed.to_string(), seed.to_string()),
        (
            "plant",
            manifest.plant.to_string(),
            scenario.plant().to_string(),
        ),
    ];
    let differ = compared.into_iter().filter(|(_, begun, now)| begun != now);
    let differences: Vec<RunDifference> = differ
        .map(|(what, begun, now)| RunDifference {
            what: what.to_owned(),
            begun,
            now,
        })
        .collect();
    if differences.is_empty() {
        return Ok(dir);
    }
    Err(LeagueError::Run(RunError::Differs {
        path: path.into(),
        differences,
    }))
}

fn text(origin: &PopulationOrigin) -> String {
    // Invariant: an origin is words and numbers.
    serde_json::to_string(origin).unwrap_or_default()
}

/// League that is being played.
struct League<'a> {
    dir: PopulationDir,
    rounds: Vec<LeagueRound>,
    payoff: &'a PayoffStarts<'a>,
    response: &'a PayoffStarts<'a>,
    policies: Vec<Box<dyn Policy>>,
    egos: Vec<LeagueEgo>,
}

impl League<'_> {
    /// Plays until the requested rounds are recorded, or `watch` stops it.
    fn play(&mut self, rounds: usize, watch: &Watch<'_>) -> Result<(), LeagueError> {
        let plant = self.payoff.plant();
        let nominal = self.payoff.family.nominal(plant);
        let known = self.rounds.last().map(|last| last.egos.clone());
        for member in known.unwrap_or_else(|| vec![nominal]) {
            let Some(ego) = self.opponent(member, watch)? else {
                return Ok(());
            };
            self.egos.push(ego);
        }
        for run in self.dir.members(self.rounds.len())? {
            self.policies.push(run.policy()?);
        }
        // The constraints on a response are relative to the nominal ego.
        let ego = self.response.ego(&self.response.family.nominal(plant))?;
        let Some(drive) = self.response.drive_alone(&ego, &watch.quiet()) else {
            return Ok(());
        };
        while self.rounds.len() <= rounds {
            let number = self.rounds.len() as u64;
            watch.note(&format!("round {number} of {rounds}"));
            let Some(round) = self.round(number, drive, watch)? else {
                return Ok(());
            };
            round.record(&mut self.dir)?;
            self.rounds.push(round);
        }
        if !self.dir.manifest().finished {
            self.dir.finish()?;
        }
        Ok(())
    }

    /// Plays a round. `None`: stopped.
    fn round(
        &mut self,
        number: u64,
        nominal: FreeDrive,
        watch: &Watch<'_>,
    ) -> Result<Option<LeagueRound>, LeagueError> {
        let mut now = match self.rounds.last() {
            Some(last) => LeagueRound {
                round: number,
                ego_response: None,
                ado_response: None,
                exploitability: None,
                ..last.clone()
            },
            // Against the nominal ego alone, before there is an ado.
            None => LeagueRound {
                ego_mixture: vec![1.0],
                ..LeagueRound::of(0, self.payoff.len(), self.members(), Vec::new())
            },
        };
        if number > 0 {
            match self.with_ego_response(&now, nominal, watch)? {
                Some(extended) => now = extended,
                None if watch.stopped() => return Ok(None),
                None => watch.note("no member of the family keeps the constraints"),
            }
        }
        if !self.train_ado(&now, watch)? {
            return Ok(None);
        }
        let policy = self.policies.len() - 1;
        let Some(row) = self.row(policy, watch) else {
            return Ok(None);
        };
        // The gain refers to the mixture that the ado trained against, not to the new
        // one.
        let response = row_gains(std::slice::from_ref(&row), &now.ego_mixture)[0];
        let (mixture, ego_response) = (now.value, now.ego_response);
        let mut payoffs = now.payoffs;
        payoffs.push(row);
        let mut round = LeagueRound::of(number, self.payoff.len(), now.egos, payoffs);
        round.ego_response = ego_response;
        if number > 0 {
            let gain = response - mixture;
            round.ado_response = Some(LeagueResponse {
                mixture,
                response,
                gain,
            });
            let ego_gain = ego_response.map_or(0.0, |ego| ego.gain);
            // A mixture is a response to itself, without a gain.
            round.exploitability = Some(gain.max(0.0) + ego_gain.max(0.0));
        }
        Ok(Some(round))
    }

    /// Returns the round with a best response of the ego.
    ///
    /// `None`: stopped, or no member of the family keeps the constraints.
    fn with_ego_response(
        &mut self,
        now: &LeagueRound,
        nominal: FreeDrive,
        watch: &Watch<'_>,
    ) -> Result<Option<LeagueRound>, LeagueError> {
        watch.phase("searching a response of the ego");
        let policies = self.policies.iter().map(|policy| &**policy);
        let ados = now.ado_mixture.iter().copied().zip(policies);
        let search = EgoResponse {
            starts: self.response,
            // A negligible share costs as many episodes as a large one.
            ados: ados.filter(|(share, _)| *share > 0.01).collect(),
            nominal,
        };
        let key = [self.dir.manifest().seed, now.round];
        let Some(member) = search.search(key, &watch.quiet()) else {
            return Ok(None);
        };
        let Some(ego) = self.opponent(member, watch)? else {
            return Ok(None);
        };
        let quiet = watch.quiet();
        let policies = self.policies.iter();
        let column: Option<Vec<f64>> = policies
            .map(|policy| self.payoff.recall(&**policy, &ego, &quiet))
            .collect();
        let Some(column) = column else {
            return Ok(None);
        };
        let pairs = column.iter().zip(&now.ado_mixture);
        let response: f64 = pairs.map(|(recall, share)| recall * share).sum();
        // Only now, because a stopped response must leave the egos as they were.
        self.egos.push(ego);
        let mut payoffs = now.payoffs.clone();
        for (row, recall) in payoffs.iter_mut().zip(column) {
            row.push(recall);
        }
        Ok(Some(LeagueRound {
            ego_response: Some(LeagueResponse {
                mixture: now.value,
                response,
                gain: now.value - response,
            }),
            ..LeagueRound::of(now.round, self.payoff.len(), self.members(), payoffs)
        }))
    }

    /// Trains the ado of a round against its egos. Returns false if stopped.
    ///
    /// It continues the ado that does best against them.
    fn train_ado(&mut self, now: &LeagueRound, watch: &Watch<'_>) -> Result<bool, LeagueError> {
        let number = self.policies.len();
        let scenario = self.payoff.scenario;
        let against = scenario.training_against_mixture(now.opponents());
        // The first ado is that of an ordinary training.
        let opponent = against.filter(|_| number > 0);
        let against = opponent.as_ref().unwrap_or(scenario);
        let path = self.dir.member_path(number);
        let gains = row_gains(&now.payoffs, &now.ego_mixture);
        // In round 0 there is none, so the first ado begins from nothing.
        let nearest = (0..number).max_by(|a, b| gains[*a].total_cmp(&gains[*b]));
        let from = nearest
            .map(|nearest| RunDir::open(&self.dir.member_path(nearest)))
            .transpose()?
            .map(|run| run.policy_bundle())
            .transpose()?;
        // Streams 1 and 2 are those of the payoffs and of the responses.
        let seed = derived_seed(self.dir.manifest().seed, 3 + number as u64);
        let mut run = match RunDir::resume(&path) {
            Err(RunError::NotARun { .. }) => {
                let with = Beginning {
                    from: from.as_ref(),
                    ..Beginning::default()
                };
                RunDir::begin(&path, against, seed, with)?
            }
            opened => opened?,
        };
        // A stored run has no consent, which was checked for the whole league.
        run.allow_programs(scenario.may_start_programs());
        // Under another mixture, the continued ado would be no response.
        run.must_be_of(RequestedTraining {
            scenario: against,
            seed,
            ego: None,
        })?;
        if train(against, &mut run, watch)?.interrupted {
            return Ok(false);
        }
        // A process may have been killed after the member and before its round.
        if number == self.dir.manifest().members.len() {
            self.dir.add_member()?;
        }
        self.policies.push(run.policy()?);
        Ok(true)
    }

    /// Returns the recall of a policy against every ego. `None`: stopped.
    fn row(&self, policy: usize, watch: &Watch<'_>) -> Option<Vec<f64>> {
        watch.phase("playing the payoffs");
        let quiet = watch.quiet();
        let egos = self.egos.iter();
        egos.map(|ego| self.payoff.recall(&*self.policies[policy], ego, &quiet))
            .collect()
    }

    /// Returns a member as an ego of the payoffs. `None`: stopped.
    fn opponent(
        &self,
        member: EgoSample,
        watch: &Watch<'_>,
    ) -> Result<Option<LeagueEgo>, LeagueError> {
        let ego = self.payoff.ego(&member)?;
        Ok(self.payoff.searched(member, ego, &watch.quiet()))
    }

    fn members(&self) -> Vec<EgoSample> {
        self.egos.iter().map(|ego| ego.member.clone()).collect()
    }
}

#[cfg(test)]
mod tests;
