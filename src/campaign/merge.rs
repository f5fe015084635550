//! From pieces to one file: nothing is believed, everything is checked.

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Deserialize;
use serde_json::json;

use super::dir::PlanDir;
use super::error::CampaignError;
use super::piece;
use super::piece::{PIECES, PieceText, Unusable};
use super::plan::{CampaignPiece, PlannedAdo, Work};
use super::row::RowOutcome;
use super::summary::{CampaignSummary, Tally};
use crate::experiment::Watch;
use crate::run_dir::{RunError, WholeFile, make_dir, write_file};

/// Where the merged file and what is said of it are.
const MERGED: &str = "merged";
/// The merged file: a line of JSON per start.
const ROWS: &str = "rows.jsonl";
/// Pieces that are looked at side by side, at most, and so many rows: that is
/// what bounds the memory of a merge.
const BATCH: usize = 256;
const BATCH_ROWS: usize = 200_000;
/// Pieces that an error names, at most.
const NAMED: usize = 10;

/// A merged campaign.
#[derive(Debug)]
pub struct Merged {
    /// The merged file.
    pub path: PathBuf,
    /// Of that file: what two machines compare.
    pub sha256: String,
    /// Rows in it.
    pub rows: u64,
    /// Rates, gates and maps.
    pub summary: CampaignSummary,
}

/// What the summary takes of a row.
#[derive(Deserialize)]
struct Told {
    start: u64,
    outcome: RowOutcome,
    contact: bool,
    closing_mps: Option<f64>,
    preventable: Option<bool>,
    simulations: u64,
    physics_steps: u64,
}

impl PlanDir {
    /// Checks all pieces and writes them as one file, with a summary.
    ///
    /// The pieces may also lie in other directories of the same plan, copied
    /// from other machines; one that is in several must be the same in each. The
    /// file is the same bytes whatever the order in which pieces were made, how
    /// the campaign was cut, and on how many machines.
    ///
    /// # Errors
    /// Pieces are missing, damaged, of another plan, or twice and different:
    /// all are named, and nothing is written.
    pub fn merge(&self, others: &[PathBuf], watch: &Watch<'_>) -> Result<Merged, CampaignError> {
        self.refuse_strangers()?;
        let dir = self.dir.join(MERGED);
        make_dir(&dir)?;
        let path = dir.join(ROWS);
        let mut file = WholeFile::begin(&path)?;
        let mut tallies: Vec<Tally> = self.plan.units.iter().map(Tally::of).collect();
        let mut policies: Vec<Option<String>> = vec![None; self.plan.trainings.len()];
        let (mut wrong, mut rows) = (Vec::new(), 0u64);
        let pieces: Vec<CampaignPiece> = self.plan.pieces().collect();
        let mut seen = 0;
        for batch in batches(&pieces) {
            (watch.progress)(seen as u64, pieces.len() as u64);
            seen += batch.len();
            if watch.interrupted() {
                return Err(CampaignError::Interrupted);
            }
            let checked: Result<Vec<_>, RunError> = batch
                .par_iter()
                .map(|piece| self.checked(piece, others))
                .collect();
            for (piece, checked) in batch.iter().zip(checked?) {
                let (text, told) = match checked {
                    Ok(checked) => checked,
                    Err(why) => {
                        wrong.push((piece.number, why));
                        continue;
                    }
                };
                if let Some(why) = self.other_policy(piece, &text, &mut policies) {
                    wrong.push((piece.number, why));
                }
                if !wrong.is_empty() {
                    continue;
                }
                if let Work::Starts { unit, .. } = piece.work {
                    for told in told {
                        rows += 1;
                        tallies[unit].count(
                            told.start as usize,
                            told.outcome,
                            (told.contact, told.closing_mps),
                            told.preventable,
                            (told.simulations, told.physics_steps),
                        );
                    }
                    file.write(text.rows.as_bytes())?;
                }
            }
        }
        if !wrong.is_empty() {
            return Err(self.refused(&wrong));
        }
        let sha256 = file.finish()?;
        let summary = CampaignSummary::of(self, tallies);
        let told = json!({
            "campaign": self.plan.name,
            "brakecheck": self.plan.brakecheck,
            "rows": rows,
            "rows_sha256": sha256,
            "summary": summary,
        });
        let text = format!("{told:#}\n");
        write_file(&dir.join("summary.json"), text.as_bytes())?;
        Ok(Merged {
            path,
            sha256,
            rows,
            summary,
        })
    }

    /// Whether a piece is there and right, in every place that has it.
    fn checked(
        &self,
        piece: &CampaignPiece,
        others: &[PathBuf],
    ) -> Result<Result<(PieceText, Vec<Told>), String>, RunError> {
        let question = self.plan.question(&piece.work);
        let mut found: Option<PieceText> = None;
        let places = std::iter::once(self.dir.as_path()).chain(others.iter().map(PathBuf::as_path));
        for place in places {
            let text = match piece::read(place, piece.number, &question)? {
                Ok(text) => text,
                Err(Unusable::Missing) => continue,
                Err(Unusable::Damaged(why)) => {
                    return Ok(Err(format!("damaged in `{}`: {why}", place.display())));
                }
                Err(Unusable::Foreign) => {
                    return Ok(Err(format!(
                        "foreign: `{}` has one of another plan, world or version",
                        place.display()
                    )));
                }
            };
            if text.heading.piece != piece.number {
                let is = text.heading.piece;
                return Ok(Err(format!("foreign: its file holds piece {is}")));
            }
            match &found {
                Some(known) if *known != text => {
                    return Ok(Err(format!(
                        "there twice, and different in `{}`: an ego or a machine does not answer twice alike",
                        place.display()
                    )));
                }
                Some(_) => {}
                None => found = Some(text),
            }
        }
        let Some(text) = found else {
            return Ok(Err("missing".to_owned()));
        };
        Ok(self.rows_of(piece, &text.rows).map(|told| (text, told)))
    }

    /// The rows of a piece, if they are those of its starts in order.
    fn rows_of(&self, piece: &CampaignPiece, rows: &str) -> Result<Vec<Told>, String> {
        let told: Result<Vec<Told>, _> = rows.lines().map(serde_json::from_str).collect();
        let told: Vec<Told> = told.map_err(|error| format!("damaged: {error}"))?;
        let asked = match &piece.work {
            Work::Training(_) => 0..0,
            Work::Starts { starts, .. } => starts.clone(),
        };
        let is = told.iter().map(|row| row.start);
        match is.eq(asked.clone().map(|start| start as u64)) {
            true => Ok(told),
            false => Err(format!(
                "damaged: it has not just the starts {} to {}",
                asked.start, asked.end
            )),
        }
    }

    /// Whether a piece was played with another ado than the training's piece made.
    fn other_policy(
        &self,
        piece: &CampaignPiece,
        text: &PieceText,
        policies: &mut [Option<String>],
    ) -> Option<String> {
        let hash = &text.heading.policy_sha256;
        match &piece.work {
            Work::Training(training) => {
                policies[*training].clone_from(hash);
                None
            }
            Work::Starts { unit, .. } => {
                let PlannedAdo::Training { training } = self.plan.units[*unit].ado else {
                    return None;
                };
                let trained = policies[training].as_ref()?;
                (hash.as_ref() != Some(trained)).then(|| {
                    format!("foreign: it was played with another ado than piece {training} trained")
                })
            }
        }
    }

    /// Files among the pieces that are none of this plan.
    fn refuse_strangers(&self) -> Result<(), CampaignError> {
        let mut strangers = Vec::new();
        let dirs = fs::read_dir(self.dir.join(PIECES))
            .into_iter()
            .flatten()
            .flatten();
        for dir in dirs {
            for entry in fs::read_dir(dir.path()).into_iter().flatten().flatten() {
                let path = entry.path();
                let name = entry.file_name().to_string_lossy().into_owned();
                let Some(stem) = name.strip_suffix(".jsonl") else {
                    continue;
                };
                let number = stem.parse::<usize>().ok();
                let known = number.filter(|number| *number < self.plan.len());
                if known.map(|number| piece::path_of(&self.dir, number)) != Some(path.clone()) {
                    strangers.push(path.display().to_string());
                }
            }
        }
        strangers.sort();
        match strangers.is_empty() {
            true => Ok(()),
            false => Err(CampaignError::Strangers {
                files: listed(&strangers),
            }),
        }
    }

    fn refused(&self, wrong: &[(usize, String)]) -> CampaignError {
        let named = wrong
            .iter()
            .map(|(number, why)| format!("piece {number} is {why}"));
        let named: Vec<String> = named.collect();
        CampaignError::Unmergeable {
            wrong: wrong.len(),
            pieces: self.plan.len(),
            listed: listed(&named),
            some_are_wrong: wrong.iter().any(|(_, why)| why != "missing"),
        }
    }
}

/// Pieces in order, a few at a time.
fn batches(mut pieces: &[CampaignPiece]) -> impl Iterator<Item = &[CampaignPiece]> {
    std::iter::from_fn(move || {
        let mut rows = 0;
        let fits = |piece: &&CampaignPiece| {
            let is_first = rows == 0;
            rows += piece.rows().max(1);
            is_first || rows <= BATCH_ROWS
        };
        let length = pieces.iter().take(BATCH).take_while(fits).count();
        let (batch, rest) = pieces.split_at(length);
        pieces = rest;
        (!batch.is_empty()).then_some(batch)
    })
}

/// The first of many, and how many more there are.
fn listed(all: &[String]) -> String {
    let mut lines: Vec<String> = all.iter().take(NAMED).cloned().collect();
    if NAMED < all.len() {
        lines.push(format!("and {} more", all.len() - NAMED));
    }
    lines.join("\n")
}

/// Where the page of a merged campaign is.
pub(super) fn page_of(dir: &Path) -> PathBuf {
    dir.join(MERGED).join("report.html")
}
