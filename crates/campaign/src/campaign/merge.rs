//! Merge of pieces to a file, with a check of every piece.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::PoisonError;

use rayon::prelude::*;
use serde_json::json;

use super::dir::{PLAN, PlanDir};
use super::error::CampaignError;
use super::piece;
use super::piece::{PIECES, PieceText, Unusable};
use super::plan::{CampaignPiece, Work};
use super::row::SummaryFields;
use super::summary::CampaignSummary;
use super::unit_counts::UnitCounts;
use crate::experiment::Watch;
use crate::run_dir::{
    ProgramContents, RunError, WholeFile, bind_programs, joined_programs, make_dir,
    remove_empty_dir, stored_programs, write_file,
};

/// Directory of the merged file and its summary.
const MERGED: &str = "merged";
/// Name of the merged file, with a line of JSON per start.
const ROWS: &str = "rows.jsonl";
/// Largest number of pieces and of rows in memory at a time.
const BATCH: usize = 256;
const BATCH_ROWS: usize = 200_000;
/// Largest number of pieces named in an error.
const NAMED: usize = 10;

/// Merged campaign.
#[derive(Debug)]
pub struct Merged {
    /// Path of the merged file.
    pub path: PathBuf,
    /// SHA-256 of that file, for a comparison between machines.
    pub sha256: String,
    /// Number of rows.
    pub rows: u64,
    /// Rates, gates and maps.
    pub summary: CampaignSummary,
}

impl PlanDir {
    /// Checks all pieces and writes them as one file, with a summary.
    ///
    /// Pieces may also lie in other directories of the same plan, copied from other machines.
    /// Copies of a piece must be identical.
    /// The bytes of the file do not depend on the order, the cut or the number of machines.
    ///
    /// # Errors
    /// Returns an error that names all missing, damaged, foreign or contradictory pieces.
    /// Nothing is written then, and an earlier merge stays.
    pub fn merge(&self, others: &[PathBuf], watch: &Watch<'_>) -> Result<Merged, CampaignError> {
        refuse_places_without_pieces(others)?;
        self.refuse_strangers()?;
        let programs = self.joined_programs(others)?;
        let dir = self.dir.join(MERGED);
        make_dir(&dir)?;
        let merged = self.merge_into(&dir, &programs, others, watch);
        if merged.is_err() {
            // The reason of the refusal matters more than an empty directory that stays.
            let _ = remove_empty_dir(&dir);
        }
        merged
    }

    /// Returns the programs of the pieces in all places.
    ///
    /// The plan is bound to them after the merge only. Bound before, it would keep programs
    /// of pieces that are refused, and run no other ones.
    fn joined_programs(&self, others: &[PathBuf]) -> Result<ProgramContents, RunError> {
        let known = self.programs.lock();
        let mut programs = known.unwrap_or_else(PoisonError::into_inner).clone();
        for place in others {
            if let Some(theirs) = stored_programs(place)? {
                programs = joined_programs(&self.dir, &programs, &theirs)?;
            }
        }
        Ok(programs)
    }

    fn merge_into(
        &self,
        dir: &Path,
        programs: &ProgramContents,
        others: &[PathBuf],
        watch: &Watch<'_>,
    ) -> Result<Merged, CampaignError> {
        let path = dir.join(ROWS);
        // The file appears under its name only after `finish`, so a failed merge leaves none.
        let mut file = WholeFile::begin(&path)?;
        let mut tallies: Vec<UnitCounts> = self.plan.units.iter().map(UnitCounts::of).collect();
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
            // The parallel map keeps the order of the plan, on which the hash of the
            // file depends.
            let checked: Result<Vec<_>, RunError> = batch
                .par_iter()
                .map(|piece| self.checked(piece, programs, others))
                .collect();
            for (piece, checked) in batch.iter().zip(checked?) {
                let (text, starts) = match checked {
                    Ok(checked) => checked,
                    Err(why) => {
                        wrong.push((piece.number, why));
                        continue;
                    }
                };
                if let Some(why) = self.other_policy(piece, &text, &mut policies) {
                    wrong.push((piece.number, why));
                }
                // After the first error the remaining pieces are only checked, so that
                // all mistakes are named.
                if !wrong.is_empty() {
                    continue;
                }
                if let Work::Starts { unit, .. } = piece.work {
                    for start in starts {
                        rows += 1;
                        tallies[unit].count(&start);
                    }
                    file.write(text.rows.as_bytes())?;
                }
            }
        }
        if !wrong.is_empty() {
            return Err(self.refused(&wrong));
        }
        // The hash covers the rows in plan order, which no machine or cut changes.
        let sha256 = file.finish()?;
        let summary = CampaignSummary::of(self, tallies);
        let summary_file = json!({
            "campaign": self.plan.name,
            "brakecheck": self.plan.brakecheck,
            "rows": rows,
            "rows_sha256": sha256,
            "summary": summary,
        });
        let text = format!("{summary_file:#}\n");
        write_file(&dir.join("summary.json"), text.as_bytes())?;
        bind_programs(&self.dir, programs, false)?;
        let known = self.programs.lock();
        known
            .unwrap_or_else(PoisonError::into_inner)
            .clone_from(programs);
        Ok(Merged {
            path,
            sha256,
            rows,
            summary,
        })
    }

    /// Reads a piece from every place that has it and checks the copies.
    fn checked(
        &self,
        piece: &CampaignPiece,
        programs: &ProgramContents,
        others: &[PathBuf],
    ) -> Result<Result<(PieceText, Vec<SummaryFields>), String>, RunError> {
        let question = self.question_with(&piece.work, programs);
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
                        "foreign: `{}` has one of another plan, world, program or version",
                        place.display()
                    )));
                }
            };
            // A file may be renamed, and its heading then has another number.
            if text.heading.piece != piece.number {
                let is = text.heading.piece;
                return Ok(Err(format!("foreign: its file holds piece {is}")));
            }
            match &found {
                Some(known) if *known != text => {
                    return Ok(Err(format!(
                        "there twice with different content, the second in `{}`: an ego or a machine is not deterministic",
                        place.display()
                    )));
                }
                Some(_) => {}
                None => found = Some(text),
            }
        }
        // Missing is reported only if no place has the piece.
        let Some(text) = found else {
            return Ok(Err("missing".to_owned()));
        };
        Ok(self.rows_of(piece, &text.rows).map(|starts| (text, starts)))
    }

    /// Parses the rows of a piece and checks that they are its starts in order.
    fn rows_of(&self, piece: &CampaignPiece, rows: &str) -> Result<Vec<SummaryFields>, String> {
        let lines = rows.lines().map(serde_json::from_str);
        let parsed: Vec<SummaryFields> = lines
            .collect::<Result<_, _>>()
            .map_err(|error| format!("damaged: {error}"))?;
        let expected = match &piece.work {
            // A training has no rows.
            Work::Training(_) => 0..0,
            Work::Starts { starts, .. } => starts.clone(),
        };
        let is = parsed.iter().map(|row| row.start);
        if is.eq(expected.clone().map(|start| start as u64)) {
            Ok(parsed)
        } else {
            Err(format!(
                "damaged: it has not just the starts {} to {}",
                expected.start, expected.end
            ))
        }
    }

    /// Checks that a piece was played with the policy that its training made.
    fn other_policy(
        &self,
        piece: &CampaignPiece,
        text: &PieceText,
        policies: &mut [Option<String>],
    ) -> Option<String> {
        let hash = &text.heading.policy_sha256;
        match &piece.work {
            Work::Training(training) => {
                // Trainings have the lowest numbers, so their hashes are known before use.
                policies[*training].clone_from(hash);
                None
            }
            Work::Starts { unit, .. } => {
                let training = self.plan.units[*unit].ado.training?;
                // A missing training piece is among the errors already.
                let trained = policies[training].as_ref()?;
                (hash.as_ref() != Some(trained)).then(|| {
                    format!("foreign: it was played with another ado than piece {training} trained")
                })
            }
        }
    }

    /// Refuses files among the pieces that do not belong to this plan.
    fn refuse_strangers(&self) -> Result<(), CampaignError> {
        let mut strangers = Vec::new();
        // Without the directory there are no strangers, and its pieces are reported as
        // missing.
        let dirs = fs::read_dir(self.dir.join(PIECES))
            .into_iter()
            .flatten()
            .flatten();
        for dir in dirs {
            for entry in fs::read_dir(dir.path()).into_iter().flatten().flatten() {
                let path = entry.path();
                let name = entry.file_name().to_string_lossy().into_owned();
                // Files of costs lie beside the pieces and are no pieces.
                let Some(stem) = name.strip_suffix(".jsonl") else {
                    continue;
                };
                let number = stem.parse::<usize>().ok();
                let known = number.filter(|number| *number < self.plan.len());
                // The path is compared too, since a piece may lie in the wrong subdirectory.
                if known.map(|number| piece::path_of(&self.dir, number)) != Some(path.clone()) {
                    strangers.push(path.display().to_string());
                }
            }
        }
        // Directory order depends on the file system, so the list is sorted.
        strangers.sort();
        if strangers.is_empty() {
            Ok(())
        } else {
            Err(CampaignError::Strangers {
                files: listed(&strangers),
            })
        }
    }

    fn refused(&self, wrong: &[(usize, String)]) -> CampaignError {
        let named: Vec<String> = wrong
            .iter()
            .map(|(number, why)| format!("piece {number} is {why}"))
            .collect();
        CampaignError::Unmergeable {
            wrong: wrong.len(),
            pieces: self.plan.len(),
            listed: listed(&named),
            some_are_wrong: wrong.iter().any(|(_, why)| why != "missing"),
        }
    }
}

/// Refuses directories without a plan and without pieces, such as a misspelled name.
fn refuse_places_without_pieces(places: &[PathBuf]) -> Result<(), CampaignError> {
    // Only the pieces may have been copied, without their plan.
    let is_other = |place: &&PathBuf| !place.join(PLAN).is_file() && !place.join(PIECES).is_dir();
    match places.iter().find(is_other) {
        Some(place) => Err(CampaignError::NoPieces { dir: place.clone() }),
        None => Ok(()),
    }
}

/// Splits the pieces, in order, into batches.
fn batches(mut pieces: &[CampaignPiece]) -> impl Iterator<Item = &[CampaignPiece]> {
    std::iter::from_fn(move || {
        let mut rows = 0;
        let fits = |piece: &&CampaignPiece| {
            // A piece larger than the limit forms a batch of its own.
            let is_first = rows == 0;
            // Trainings have no rows but cost a file each.
            rows += piece.rows().max(1);
            is_first || rows <= BATCH_ROWS
        };
        let length = pieces.iter().take(BATCH).take_while(fits).count();
        let (batch, rest) = pieces.split_at(length);
        pieces = rest;
        (!batch.is_empty()).then_some(batch)
    })
}

/// Lists the first items and the number of further items.
fn listed(all: &[String]) -> String {
    let mut lines: Vec<String> = all.iter().take(NAMED).cloned().collect();
    if all.len() > NAMED {
        lines.push(format!("and {} more", all.len() - NAMED));
    }
    lines.join("\n")
}

/// Returns the path of the page of a merged campaign.
pub(super) fn page_of(dir: &Path) -> PathBuf {
    dir.join(MERGED).join("report.html")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Plan;
    use crate::run_dir::{PROGRAMS, ProgramContent};

    /// Every path below a directory, in order.
    fn paths(dir: &Path) -> Vec<PathBuf> {
        let mut all = Vec::new();
        for entry in fs::read_dir(dir).expect("a directory").flatten() {
            all.push(entry.path());
            if entry.path().is_dir() {
                all.extend(paths(&entry.path()));
            }
        }
        all.sort();
        all
    }

    #[test]
    fn a_merge_that_is_refused_changes_nothing() {
        let scratch = tempfile::tempdir().expect("scratch");
        let file = scratch.path().join("small.ron");
        let text = r#"Campaign(name: "small", worlds: [(file: "acc")], ados: [Neutral], starts: Drawn(count: 4, seed: 9))"#;
        fs::write(&file, text).expect("written");
        let (ours, theirs) = (scratch.path().join("ours"), scratch.path().join("theirs"));
        let watch = Watch::unwatched();
        let cut = Plan::make(&file, Some(1000.0), false, &watch).expect("sound");
        cut.expect("not stopped").write(&ours).expect("planned");
        // Another machine has the programs of pieces that are not copied yet.
        fs::create_dir_all(theirs.join(PIECES)).expect("made");
        let content = ProgramContent {
            sha256: "0".repeat(64),
            command: vec!["ego".to_owned()],
            files: Default::default(),
            not_covered: Vec::new(),
        };
        let programs = [("nominal in acc".to_owned(), content)].into();
        bind_programs(&theirs, &programs, false).expect("bound");
        let before = paths(&ours);
        let plan = PlanDir::open(&ours, false, 0.0).expect("planned");
        let error = plan.merge(&[theirs], &watch).expect_err("no pieces");
        assert!(error.to_string().contains("cannot be merged"), "{error}");
        assert_eq!(paths(&ours), before);
        assert!(!ours.join(PROGRAMS).exists());
        assert_eq!(
            *plan.programs.lock().expect("unpoisoned"),
            ProgramContents::new()
        );
    }
}
