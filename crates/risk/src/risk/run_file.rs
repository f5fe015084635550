//! Runs as files of tensors.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::record::{RiskRun, RunEnd};
use crate::content_hash::sha256;
use crate::rl::{BundleError, TensorFile};
use crate::ron_file::file_bytes;
use crate::run_dir::RunError;

/// Length of the seal at the end of a file: a SHA-256 in hexadecimal digits.
const SEAL: usize = 64;

/// Runs that a file contains.
///
/// A name alone does not bind a file to its request, since files can be copied.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PieceId {
    /// Digest of the request.
    pub(super) request: String,
    /// Name of the ego's files.
    pub(super) ego: String,
    /// Seed of the draws.
    pub(super) seed: u64,
    /// Number of the batch, and the kind of its runs.
    pub(super) stage: u64,
    pub(super) content: String,
    /// Runs of the batch.
    pub(super) total: usize,
    /// First run of the piece.
    pub(super) first: usize,
    /// Runs of the piece.
    pub(super) runs: usize,
}

/// Content of a file that tensors cannot hold.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PieceMeta {
    piece: PieceId,
    ends: Vec<RunEnd>,
}

impl PieceId {
    /// Returns the differences of a stored piece from an expected one.
    fn differences(&self, expected: &PieceId) -> Vec<String> {
        let of = |it: &PieceId| {
            [
                ("request", it.request.clone()),
                ("ego", it.ego.clone()),
                ("seed", it.seed.to_string()),
                ("stage", format!("{}, {}", it.stage, it.content)),
                ("runs of the stage", it.total.to_string()),
                ("first run", it.first.to_string()),
                ("runs", it.runs.to_string()),
            ]
        };
        let pairs = of(self).into_iter().zip(of(expected));
        let differ = pairs.filter(|(found, expected)| found != expected);
        let words = differ
            .map(|((name, found), (_, expected))| format!("{name}: {found}, expected {expected}"));
        words.collect()
    }
}

fn damaged(path: &Path, why: impl ToString) -> RunError {
    RunError::Damaged {
        path: path.into(),
        why: why.to_string(),
    }
}

/// Returns the sealed bytes of runs, equal for equal runs.
///
/// # Errors
/// The runs do not fit into a file, whose name is `path`.
pub(super) fn bytes(piece: &PieceId, runs: &[RiskRun], path: &Path) -> Result<Vec<u8>, RunError> {
    let meta = serde_json::to_string(
        &(PieceMeta {
            piece: piece.clone(),
            ends: runs.iter().map(|run| run.end.clone()).collect(),
        }),
    )
    .map_err(|error| damaged(path, error))?;
    let mut file = TensorFile::new(meta);
    // Runs differ in length, so their joined tensors are cut by these sizes.
    let lengths = runs.iter().flat_map(|run| {
        let lengths = [
            run.shares.len(),
            run.actions.len(),
            run.inputs.len(),
            run.laws.len(),
            run.ratios.len(),
            // No length, but a number per run that has no tensor of its own.
            run.component,
        ];
        lengths.map(|it| it as u64)
    });
    let sizes: Vec<u64> = lengths.collect();
    file.put("sizes", &[runs.len(), 6], sizes);
    let noise: Vec<u64> = runs.iter().map(|run| run.noise).collect();
    file.put("noise", &[noise.len()], noise);
    let shares: Vec<f64> = runs.iter().flat_map(|run| run.shares.clone()).collect();
    file.put("shares", &[shares.len()], shares);
    let ratios: Vec<f64> = runs.iter().flat_map(|run| run.ratios.clone()).collect();
    file.put("ratios", &[ratios.len()], ratios);
    let actions: Vec<u32> = runs.iter().flat_map(|run| run.actions.clone()).collect();
    file.put("actions", &[actions.len()], actions);
    let inputs: Vec<f32> = runs.iter().flat_map(|run| run.inputs.clone()).collect();
    file.put("inputs", &[inputs.len()], inputs);
    let laws: Vec<f32> = runs.iter().flat_map(|run| run.laws.clone()).collect();
    file.put("laws", &[laws.len()], laws);
    let mut bytes = file.to_bytes().map_err(|error| damaged(path, error))?;
    // A flipped bit would change a weight, and with it the risk.
    let seal = sha256(&bytes);
    bytes.extend(seal.as_bytes());
    Ok(bytes)
}

/// Reads the runs of a piece. `None`: there is no such file.
///
/// # Errors
/// The file cannot be read, is damaged, or contains another piece.
pub(super) fn read(expected: &PieceId, path: &Path) -> Result<Option<Vec<RiskRun>>, RunError> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = file_bytes(path).map_err(|error| damaged(path, error))?;
    // Checked before anything is parsed, so that no damaged length is ever used.
    let sealed = bytes
        .split_at_checked(bytes.len().saturating_sub(SEAL))
        .filter(|(content, seal)| sha256(content).as_bytes() == *seal);
    let (content, _) = sealed.ok_or_else(|| damaged(path, "its hash differs"))?;
    let file = TensorFile::from_bytes(content).map_err(|error| damaged(path, error))?;
    let meta: PieceMeta =
        serde_json::from_str(file.meta()).map_err(|error| damaged(path, error))?;
    let differences = meta.piece.differences(expected);
    // Another request may have left its runs under the same name.
    if !differences.is_empty() {
        return Err(RunError::OtherPiece {
            path: path.into(),
            differences,
        });
    }
    // The identity only claims a number of runs, which the ends must have.
    if meta.ends.len() != expected.runs {
        return Err(damaged(path, "its number of runs differs"));
    }
    let runs = runs_of(&file, meta.ends)
        .map_err(|error| damaged(path, error))?
        .ok_or_else(|| damaged(path, "its tensors do not fit each other"))?;
    Ok(Some(runs))
}

fn runs_of(file: &TensorFile, ends: Vec<RunEnd>) -> Result<Option<Vec<RiskRun>>, BundleError> {
    let sizes: &[u64] = file.get("sizes", &[ends.len(), 6])?;
    let noise: &[u64] = file.get("noise", &[ends.len()])?;
    let mut shares: &[f64] = file.rows("shares", &[])?;
    let mut ratios: &[f64] = file.rows("ratios", &[])?;
    let mut actions: &[u32] = file.rows("actions", &[])?;
    let mut inputs: &[f32] = file.rows("inputs", &[])?;
    let mut laws: &[f32] = file.rows("laws", &[])?;
    let mut runs = Vec::with_capacity(ends.len());
    for ((end, noise), sizes) in ends.into_iter().zip(noise).zip(sizes.chunks(6)) {
        let size = |at: usize| sizes[at] as usize;
        // A closure, so that `?` leaves this run and not the function.
        let run = (|| {
            Some(RiskRun {
                shares: taken(&mut shares, size(0))?,
                noise: *noise,
                actions: taken(&mut actions, size(1))?,
                inputs: taken(&mut inputs, size(2))?,
                laws: taken(&mut laws, size(3))?,
                component: size(5),
                ratios: taken(&mut ratios, size(4))?,
                end,
            })
        })();
        let Some(run) = run else {
            return Ok(None);
        };
        runs.push(run);
    }
    Ok(Some(runs))
}

/// Removes the first numbers of a list and returns them.
fn taken<T: Clone>(list: &mut &[T], count: usize) -> Option<Vec<T>> {
    let (first, rest) = list.split_at_checked(count)?;
    *list = rest;
    Some(first.to_vec())
}

#[cfg(test)]
mod tests {
    use super::super::record::EgoFailure;
    use super::*;
    use crate::ego::Fault;

    #[test]
    fn stored_runs_are_read_with_the_same_bits_and_damage_is_an_error() {
        let failure = EgoFailure {
            mode: "rear-end of ego and ado, lawful".to_owned(),
            lawful: true,
            preventable: Some(super::super::record::DriverAnswer::Fails),
        };
        let run = |end| RiskRun {
            shares: vec![0.1, 1.0 / 3.0],
            noise: u64::MAX - 5,
            actions: vec![1, 2],
            inputs: vec![0.5, -0.25, 0.125, 3.0],
            laws: vec![0.1, 0.9, 1.0, 0.0],
            component: 2,
            ratios: vec![1.0, 1e-300, 2.5e7],
            end,
        };
        let empty = RiskRun {
            shares: Vec::new(),
            actions: Vec::new(),
            inputs: Vec::new(),
            laws: Vec::new(),
            ..run(RunEnd::Outside)
        };
        let runs = vec![
            run(RunEnd::Failed(failure)),
            empty.clone(),
            run(RunEnd::Invalid {
                fault: Fault::error("x"),
            }),
        ];
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("a.runs");
        let three = piece(3);
        let bytes = bytes(&three, &runs, &path).expect("fits");
        std::fs::write(&path, &bytes).expect("written");
        assert_eq!(read(&three, &path).expect("sound"), Some(runs));
        std::fs::write(&path, &bytes[..bytes.len() - 4]).expect("written");
        assert!(read(&three, &path).is_err());
        for at in [0, bytes.len() / 2, bytes.len() - 1] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            std::fs::write(&path, &flipped).expect("written");
            assert!(read(&three, &path).is_err(), "byte {at}");
        }
        assert_eq!(
            read(&three, &dir.path().join("b.runs")).expect("none"),
            None
        );
        // A piece of natural runs without a failure has no decisions.
        let one = piece(1);
        let bytes = super::bytes(&one, std::slice::from_ref(&empty), &path).expect("fits");
        std::fs::write(&path, &bytes).expect("written");
        assert_eq!(read(&one, &path).expect("sound"), Some(vec![empty]));
    }

    fn piece(runs: usize) -> PieceId {
        PieceId {
            request: "digest".to_owned(),
            ego: "0-nominal".to_owned(),
            seed: 3,
            stage: 2,
            content: "round".to_owned(),
            total: 5000,
            first: 500,
            runs,
        }
    }

    #[test]
    fn a_piece_of_other_runs_is_refused_by_name() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("a.runs");
        let run = RiskRun::ending(RunEnd::Outside);
        let own = piece(2);
        let stored = |piece: &PieceId, runs: usize| {
            let runs = vec![run.clone(); runs];
            std::fs::write(&path, bytes(piece, &runs, &path).expect("fits")).expect("written");
            read(&own, &path)
        };
        assert!(stored(&own, 2).is_ok());
        let others = [
            (
                "request: other, expected digest",
                PieceId {
                    request: "other".to_owned(),
                    ..own.clone()
                },
            ),
            (
                "ego: 1-weak, expected 0-nominal",
                PieceId {
                    ego: "1-weak".to_owned(),
                    ..own.clone()
                },
            ),
            (
                "seed: 4, expected 3",
                PieceId {
                    seed: 4,
                    ..own.clone()
                },
            ),
            (
                "stage: 1, round, expected 2, round",
                PieceId {
                    stage: 1,
                    ..own.clone()
                },
            ),
            (
                "stage: 2, natural, expected",
                PieceId {
                    content: "natural".to_owned(),
                    ..own.clone()
                },
            ),
            (
                "runs of the stage: 6000, expected 5000",
                PieceId {
                    total: 6000,
                    ..own.clone()
                },
            ),
            (
                "first run: 0, expected 500",
                PieceId {
                    first: 0,
                    ..own.clone()
                },
            ),
            (
                "runs: 1, expected 2",
                PieceId {
                    runs: 1,
                    ..own.clone()
                },
            ),
        ];
        for (says, other) in others {
            let error = stored(&other, 2).expect_err(says);
            let found = error.to_string();
            assert!(found.contains(says) && found.contains("a.runs"), "{found}");
            assert!(error.help().is_some_and(|help| help.contains("delete")));
        }
        // A header that does not fit its own runs.
        assert!(matches!(stored(&own, 1), Err(RunError::Damaged { .. })));
    }
}
