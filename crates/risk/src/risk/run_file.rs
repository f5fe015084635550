//! Runs as files of tensors.

use std::path::Path;

use super::record::{RiskRun, RunEnd};
use crate::content_hash::sha256;
use crate::rl::{BundleError, TensorFile};
use crate::ron_file::file_bytes;
use crate::run_dir::RunError;

/// Length of the seal at the end of a file: a SHA-256 in hexadecimal digits.
const SEAL: usize = 64;

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
pub(super) fn bytes(runs: &[RiskRun], path: &Path) -> Result<Vec<u8>, RunError> {
    // Ends contain words, which no tensor can hold.
    let ends: Vec<&RunEnd> = runs.iter().map(|run| &run.end).collect();
    let meta = serde_json::to_string(&ends).map_err(|error| damaged(path, error))?;
    let mut file = TensorFile::new(meta);
    // Runs differ in length, so their joined tensors are cut by these sizes.
    let sizes = runs.iter().flat_map(|run| {
        let lengths = [
            run.shares.len(),
            run.actions.len(),
            run.inputs.len(),
            run.laws.len(),
            run.ratios.len(),
            run.component,
        ];
        lengths.map(|it| it as u64)
    });
    let sizes: Vec<u64> = sizes.collect();
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

/// Reads runs. `None`: there is no such file.
///
/// # Errors
/// The file cannot be read, or is damaged.
pub(super) fn read(path: &Path) -> Result<Option<Vec<RiskRun>>, RunError> {
    if !path.exists() {
        return Ok(None);
    }
    let bytes = file_bytes(path).map_err(|error| damaged(path, error))?;
    let sealed = bytes.split_at_checked(bytes.len().saturating_sub(SEAL));
    let sealed = sealed.filter(|(content, seal)| sha256(content).as_bytes() == *seal);
    let (content, _) = sealed.ok_or_else(|| damaged(path, "its hash differs"))?;
    let file = TensorFile::from_bytes(content).map_err(|error| damaged(path, error))?;
    let ends: Vec<RunEnd> =
        serde_json::from_str(file.meta()).map_err(|error| damaged(path, error))?;
    let runs = runs_of(&file, ends).map_err(|error| damaged(path, error))?;
    let runs = runs.ok_or_else(|| damaged(path, "its tensors do not fit each other"))?;
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
            preventable: Some(false),
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
                fault: Some(Fault::error("x")),
            }),
        ];
        let dir = std::env::temp_dir().join(format!("brakecheck-runs-{}", std::process::id()));
        std::fs::create_dir_all(&dir).expect("a directory");
        let path = dir.join("a.runs");
        let bytes = bytes(&runs, &path).expect("fits");
        std::fs::write(&path, &bytes).expect("written");
        assert_eq!(read(&path).expect("sound"), Some(runs));
        std::fs::write(&path, &bytes[..bytes.len() - 4]).expect("written");
        assert!(read(&path).is_err());
        for at in [0, bytes.len() / 2, bytes.len() - 1] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            std::fs::write(&path, &flipped).expect("written");
            assert!(read(&path).is_err(), "byte {at}");
        }
        assert_eq!(read(&dir.join("b.runs")).expect("none"), None);
        // A piece of natural runs without a failure has no decisions.
        let bytes = super::bytes(std::slice::from_ref(&empty), &path).expect("fits");
        std::fs::write(&path, &bytes).expect("written");
        assert_eq!(read(&path).expect("sound"), Some(vec![empty]));
        std::fs::remove_dir_all(&dir).expect("removed");
    }
}
