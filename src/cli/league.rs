//! Leagues of egos and ados in `train --league`.

use std::path::Path;

use serde_json::json;

use super::common::{finished, print_json, table_of};
use super::failure::{Exit, Failure};
use super::progress;
use super::terminal::{self, Common};
use crate::experiment::Audience;
use crate::population::{LeagueResponse, LeagueRound, LeagueSession, PopulationDir};
use crate::run_dir::counted;

/// Trains a league of some rounds that was begun or opened again.
pub(super) fn train(
    session: LeagueSession,
    path: &Path,
    requested: usize,
    common: &Common,
    audience: Option<&dyn Audience>,
) -> Result<Exit, Failure> {
    let bar = progress::bar(common, "");
    let watch = bar.watch().shown_to(audience);
    let rounds = session.train(&watch)?;
    drop(bar);
    // Round 0 precedes the requested rounds, so a whole league has one more.
    if rounds.len() <= requested {
        terminal::note(&format!(
            "stopped after {} of {}; go on with the same command and `--resume` in {}",
            rounds.len().saturating_sub(1),
            counted(requested, "round"),
            path.display(),
        ));
        // Without an interruption only faults of an ego end a league early.
        return Ok(finished(Exit::Fault));
    }
    if common.json {
        // The training writes the manifest that is printed, so it is read afterwards.
        let dir = PopulationDir::open(path)?;
        print_json(&json!({
            "run": path.display().to_string(),
            "population": dir.manifest(),
            "rounds": rounds,
        }))?;
    } else {
        terminal::data(&rounds_table(&rounds))?;
        terminal::note(&format!("kept in {}", path.display()));
    }
    Ok(finished(Exit::Done))
}

fn rounds_table(rounds: &[LeagueRound]) -> String {
    let gain = |response: &Option<LeagueResponse>| {
        response.map_or("–".to_owned(), |it| format!("{:+.3}", it.gain))
    };
    let header = [
        "round",
        "egos",
        "ados",
        "recall",
        "ego gain",
        "ado gain",
        "exploitability",
    ];
    let lines = rounds.iter().map(|round| {
        [
            round.round.to_string(),
            round.egos.len().to_string(),
            round.payoffs.len().to_string(),
            format!("{:.3}", round.value),
            gain(&round.ego_response),
            gain(&round.ado_response),
            round
                .exploitability
                .map_or("–".to_owned(), |it| format!("{it:.3}")),
        ]
    });
    table_of(header, lines)
}
