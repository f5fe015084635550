//! Leagues of egos and ados on egos of structures that no member trained against.
//!
//! A population of N members plays N simulations per start, so each baseline has N
//! simulations per start, too.

use std::path::Path;

use serde::{Deserialize, Serialize};

use brakecheck::adversary::Ado;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::population::{
    LeagueError, LeagueRequest, LeagueRound, PopulationDir, train_league,
};
use brakecheck::rl::Policy;
use brakecheck::run_dir::{RunDir, RunError};
use brakecheck::search::{Adversary, Cem, Hold, Search};
use brakecheck::stats::StartOutcome;
use brakecheck::training::TrainRequest;
use brakecheck::world::Scenario;
use brakecheck_report::report::table::TextTable;

use crate::trained_run;

/// Largest number of switches of the search that recall refers to.
const SWITCHES: usize = 2;
/// Number of starts solved by search from which recall enters the means.
const LEAST_SEARCHED: usize = 10;

/// League and equally many ordinary trainings.
pub struct LeagueStudy {
    league: Vec<(f64, Box<dyn Policy>)>,
    ordinary: Vec<Box<dyn Policy>>,
    /// Run whose counterexamples are replayed.
    first: RunDir,
    seed: u64,
}

/// Trainings of a study.
#[derive(Clone, Copy, Debug)]
pub struct LeagueTraining<'a> {
    /// World of the ordinary trainings.
    pub nominal: &'a Scenario,
    /// World of the league, which may leave out structures of the family of `nominal`.
    pub scenario: &'a Scenario,
    /// Seed of the league.
    pub seed: u64,
    /// Number of rounds after round 0.
    pub rounds: usize,
    /// Directory of the league.
    pub path: &'a Path,
    /// Directory of the ordinary trainings.
    pub runs: &'a Path,
}

/// Recall per adversary against an ego.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LeagueRow {
    /// Name of the ego.
    pub ego: String,
    /// Seed of the league.
    pub seed: u64,
    /// Number of members, and of simulations per start.
    pub members: usize,
    /// Starts that are not trivial.
    pub starts: usize,
    /// Starts that search solves.
    pub searched: usize,
    /// All members of the league, until one succeeds.
    pub union: f64,
    /// First half of the members.
    pub half: f64,
    /// One member per start, drawn from the equilibrium.
    pub mixture: f64,
    /// Best single member, chosen on these starts.
    pub best: f64,
    /// One ordinary training.
    pub one: f64,
    /// As many ordinary trainings, until one succeeds.
    pub ordinary: f64,
    /// As many nearest counterexamples of an ordinary training, replayed.
    pub replays: f64,
    /// Held random actions with as many simulations per start.
    pub held: f64,
    /// Cross-entropy search with as many simulations per start.
    pub cem: f64,
}

impl LeagueStudy {
    /// Trains a league and as many ordinary ados, or reads them. `None`: stopped.
    ///
    /// # Errors
    /// A training cannot begin, continue or end.
    pub fn trained(
        training: &LeagueTraining<'_>,
        watch: &Watch<'_>,
    ) -> Result<Option<LeagueStudy>, LeagueError> {
        let LeagueTraining {
            nominal,
            scenario,
            seed,
            rounds,
            path,
            runs,
        } = *training;
        // A repeated study continues where it was interrupted.
        let resume = PopulationDir::is_population(path);
        let member = TrainRequest {
            seed: Some(seed),
            ..TrainRequest::default()
        };
        let request = LeagueRequest::new(member, rounds);
        let played = train_league(scenario, path, &request, resume, watch)?;
        // Round 0 precedes the requested rounds, so a whole league has one more.
        let Some(last) = played.last().filter(|_| rounds < played.len()) else {
            return Ok(None);
        };
        let members = PopulationDir::open(path)?.members(played.len())?;
        let league: Result<_, RunError> = members
            .iter()
            .zip(&last.ado_mixture)
            .map(|(run, share)| Ok((*share, run.policy()?)))
            .collect();
        let mut ordinary = Vec::new();
        let mut first = None;
        // The seeds of the members, so that both have the same starts and first weights.
        for run in &members {
            let (path, _) = trained_run(nominal, run.manifest().seed, runs, watch)?;
            if watch.stopped() {
                return Ok(None);
            }
            let run = RunDir::open(&path)?;
            ordinary.push(run.policy()?);
            first = first.or(Some(run));
        }
        let league = league?;
        Ok(first.map(|first| LeagueStudy {
            league,
            ordinary,
            first,
            seed,
        }))
    }

    /// Plays all adversaries against an ego. `None`: stopped.
    ///
    /// # Errors
    /// The stored counterexamples cannot be read.
    pub fn evaluate(
        &self,
        nominal: &Scenario,
        ego: &EgoUnderTest,
        starts: usize,
        start_seed: u64,
        watch: &Watch<'_>,
    ) -> Result<Option<LeagueRow>, RunError> {
        // Starts are those of the nominal ego, so that results of all egos are
        // comparable.
        let Some(starts) = test_starts(nominal, start_seed, starts, watch) else {
            return Ok(None);
        };
        let play = |adversary: &dyn Adversary| solved(adversary, ego, &starts, watch);
        let budget = self.league.len() as u64;
        let stored = self.first.counterexamples()?;
        let trained = |policy: &dyn Policy| play(&Ado::Trained(policy, self.seed));
        let searched = play(&Search::switches(SWITCHES));
        let league: Vec<Vec<bool>> = self.league.iter().map(|(_, it)| trained(&**it)).collect();
        let ordinary: Vec<Vec<bool>> = self.ordinary.iter().map(|it| trained(&**it)).collect();
        let held = play(&Search {
            method: Hold.into(),
            budget,
        });
        let cem = play(&Search {
            method: Cem::default().into(),
            budget,
        });
        let replays = play(&Ado::Replays(&stored, self.league.len()));
        if watch.stopped() {
            return Ok(None);
        }
        let recall = |solved: &[bool]| {
            let both = searched.iter().zip(solved).filter(|(a, b)| **a && **b);
            let all = searched.iter().filter(|searched| **searched).count();
            both.count() as f64 / all.max(1) as f64
        };
        let each: Vec<f64> = league.iter().map(|solved| recall(solved)).collect();
        let shares = self.league.iter().map(|(share, _)| share);
        Ok(Some(LeagueRow {
            ego: ego.name().to_owned(),
            seed: self.seed,
            members: self.league.len(),
            starts: starts.trivial.iter().filter(|trivial| !**trivial).count(),
            searched: searched.iter().filter(|searched| **searched).count(),
            union: recall(&any(&league)),
            half: recall(&any(&league[..league.len().div_ceil(2)])),
            // In the mean, a member that is drawn per start has this recall.
            mixture: shares
                .zip(&each)
                .map(|(share, recall)| share * recall)
                .sum(),
            best: each.iter().copied().fold(0.0, f64::max),
            one: recall(&ordinary[0]),
            ordinary: recall(&any(&ordinary)),
            replays: recall(&replays),
            held: recall(&held),
            cem: recall(&cem),
        }))
    }
}

/// Returns the starts that an adversary solves, of all starts.
fn solved(
    adversary: &dyn Adversary,
    ego: &EgoUnderTest,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Vec<bool> {
    let cell = adversary.play(ego, starts, watch);
    let outcomes = cell.map(|cell| cell.row.solved).unwrap_or_default();
    let solved = outcomes.iter().map(|it| *it == StartOutcome::Solved);
    solved.collect()
}

/// Returns the union of solved starts.
fn any(solved: &[Vec<bool>]) -> Vec<bool> {
    let starts = solved.first().map_or(0, Vec::len);
    let union = |start: usize| solved.iter().any(|solved| solved[start]);
    (0..starts).map(union).collect()
}

/// Heading of a column, and its number in a row.
type LeagueColumn = (&'static str, fn(&LeagueRow) -> f64);

/// Recalls of a row, with the headings of their columns.
const COLUMNS: [LeagueColumn; 10] = [
    ("league, all", |row| row.union),
    ("first half", |row| row.half),
    ("mixture, 1", |row| row.mixture),
    ("best member, 1", |row| row.best),
    ("one training, 1", |row| row.one),
    ("N trainings", |row| row.ordinary),
    ("N replays", |row| row.replays),
    ("held random, N", |row| row.held),
    ("CEM, N", |row| row.cem),
    ("searched", |row| row.searched as f64),
];

/// Formats the rows as a Markdown table, with means per league and over all leagues.
pub fn league_markdown(world: &str, rows: &[LeagueRow]) -> String {
    let heading = ["ego", "league"]
        .map(str::to_owned)
        .into_iter()
        .chain(COLUMNS.map(|(name, _)| name.to_owned()));
    let line = |name: String, seed: String, cells: Vec<f64>| {
        let cells = cells.into_iter().map(|recall| format!("{recall:.2}"));
        [name, seed]
            .into_iter()
            .chain(cells)
            .collect::<Vec<String>>()
    };
    let mut lines: Vec<Vec<String>> = Vec::new();
    for row in rows {
        let cells = COLUMNS.iter().map(|(_, of)| of(row)).collect();
        lines.push(line(row.ego.clone(), row.seed.to_string(), cells));
    }
    let mut seeds: Vec<u64> = rows.iter().map(|row| row.seed).collect();
    // Rows of a league are adjacent.
    seeds.dedup();
    let mut all = vec![0.0; COLUMNS.len()];
    for seed in &seeds {
        let means = means(rows, *seed);
        for (all, mean) in all.iter_mut().zip(&means) {
            *all += mean / seeds.len() as f64;
        }
        lines.push(line("mean".to_owned(), seed.to_string(), means));
    }
    lines.push(line("mean".to_owned(), "all".to_owned(), all));
    let members = rows.first().map_or(0, |row| row.members);
    format!(
        "`{world}`: recall of the starts that a search with at most {SWITCHES} switches solves. \
         N = {members} members play N simulations per start. Means are over egos of which \
         search solves {LEAST_SEARCHED} starts or more.\n\n{}",
        TextTable::new(heading, lines).to_markdown()
    )
}

/// Returns the mean of each column over the egos with enough searched starts.
fn means(rows: &[LeagueRow], seed: u64) -> Vec<f64> {
    let counted: Vec<&LeagueRow> = rows
        .iter()
        .filter(|row| row.seed == seed)
        .filter(|row| row.searched >= LEAST_SEARCHED)
        .collect();
    let mean = |of: fn(&LeagueRow) -> f64| {
        counted.iter().map(|row| of(row)).sum::<f64>() / counted.len().max(1) as f64
    };
    COLUMNS.iter().map(|(_, of)| mean(*of)).collect()
}

/// Formats the rounds of a league as a Markdown table.
pub fn rounds_markdown(league: &str, rounds: &[LeagueRound]) -> String {
    let heading = ["round", "recall", "ego gain", "ado gain", "exploitability"];
    let text = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
    let lines = rounds.iter().map(|round| {
        vec![
            round.round.to_string(),
            text(Some(round.value)),
            text(round.ego_response.map(|it| it.gain)),
            text(round.ado_response.map(|it| it.gain)),
            text(round.exploitability),
        ]
    });
    let table = TextTable::new(heading.map(str::to_owned), lines).to_markdown();
    format!("`{league}`:\n\n{table}\n")
}
