//! Learned egos in the run directory of the ado.

use std::path::PathBuf;
use std::sync::Arc;

use super::fit::MEMBERS;
use super::learn::{LearnEgoRequest, LearnedEgo, LearnedFrom, learn_ego};
use super::model::{OUTPUTS, Surrogate};
use crate::content_hash::sha256;
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::nn::Mlp;
use crate::rl::{BundleError, TensorFile, load_policy_for};
use crate::run_dir::{RunDir, RunError, make_dir, write_file};
use crate::sysid::{DIR, place_of};
use crate::world::Scenario;
use crate::world::file_bytes;

/// Tensor with a whole bundle: the policy trained in the surrogate.
const TRAINED_ON: &str = "trained_on";
/// Tensor with the SHA-256 of the bundle without it, as digits.
const SEAL: &str = "seal";

/// Returns the stored learned ego of a request, or learns and stores it.
///
/// Only egos that are described by files are stored. Returns `None` as [`learn_ego`]
/// does.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub(crate) fn learned(
    run: &RunDir,
    ego: &EgoUnderTest,
    request: &LearnEgoRequest<'_>,
    watch: &Watch<'_>,
) -> Result<Option<LearnedEgo>, RunError> {
    let Some(path) = path_of(run, ego, request) else {
        return Ok(learn_ego(request, watch));
    };
    if let Ok(bytes) = file_bytes(&path) {
        let (name, path) = (ego.name(), path.display());
        match read(&bytes, request.ego) {
            Ok(kept) => {
                watch.note(&format!("`{name}`: learned before ({path})"));
                return Ok(Some(kept));
            }
            // A damaged file is no reason to stop, because the ego can be learned again.
            Err(error) => watch.note(&format!("{path}: {error}; learned anew")),
        }
    }
    let found = learn_ego(request, watch);
    if let Some(found) = &found {
        make_dir(&run.path().join(DIR))?;
        let bytes = written(found).map_err(|error| RunError::Damaged {
            path: path.clone(),
            why: error.to_string(),
        })?;
        write_file(&path, &bytes)?;
    }
    Ok(found)
}

/// Returns the file of a request. Its name depends on the ado as well.
fn path_of(run: &RunDir, ego: &EgoUnderTest, request: &LearnEgoRequest<'_>) -> Option<PathBuf> {
    let asked = serde_json::json!({
        "learned_for_policy_sha256": run.manifest().policy_sha256,
        "runs": request.runs,
        "seed": request.seed,
        "unknown": request.unknown,
        "learns_on": request.kept.is_some(),
    });
    place_of(run, ego, &asked).map(|place| place.with_extension("safetensors"))
}

fn written(learned: &LearnedEgo) -> Result<Vec<u8>, BundleError> {
    let from = serde_json::to_string(&learned.from).map_err(|error| BundleError::Format {
        why: error.to_string(),
    })?;
    let surrogate = &*learned.surrogate;
    let width = surrogate.mean.len();
    let mut bundle = TensorFile::new(from);
    bundle.put("mean", &[width], surrogate.mean.clone());
    bundle.put("inverse_sd", &[width], surrogate.inverse_sd.clone());
    bundle.put("unit", &[2], surrogate.unit.to_vec());
    bundle.put("range_mps2", &[2], surrogate.range_mps2.to_vec());
    for (i, member) in surrogate.members.iter().enumerate() {
        member.save(&format!("member/{i}"), &mut bundle);
    }
    if let Some(policy) = &learned.trained_on {
        let bytes = policy.to_bytes()?;
        bundle.put(TRAINED_ON, &[bytes.len()], bytes);
    }
    let seal = sha256(&bundle.to_bytes()?).into_bytes();
    bundle.put(SEAL, &[seal.len()], seal);
    bundle.to_bytes()
}

/// Returns the bundle if its seal matches, so any flipped bit is detected.
fn unsealed(bytes: &[u8]) -> Result<TensorFile, BundleError> {
    let sealed = TensorFile::from_bytes(bytes)?;
    let says = sealed.rows::<u8>(SEAL, &[])?.to_vec();
    let bundle = sealed.without(SEAL);
    let found = sha256(&bundle.to_bytes()?);
    if found.as_bytes() == says {
        Ok(bundle)
    } else {
        Err(BundleError::Mismatch {
            what: "its SHA-256",
            expected: String::from_utf8_lossy(&says).into_owned(),
            found,
        })
    }
}

fn read(bytes: &[u8], world: &Scenario) -> Result<LearnedEgo, BundleError> {
    let bundle = unsealed(bytes)?;
    let from: LearnedFrom =
        serde_json::from_str(bundle.meta()).map_err(|error| BundleError::Format {
            why: error.to_string(),
        })?;
    let members = (0..MEMBERS).map(|i| Mlp::load(&format!("member/{i}"), &bundle));
    let members: Vec<Mlp> = members.collect::<Result<_, _>>()?;
    let width = super::surrogate_sim::width_of(world);
    for member in &members {
        // A file of another version may have other inputs, so the shape is checked on reading.
        if member.ends() != [width, OUTPUTS] {
            return Err(BundleError::Mismatch {
                what: "the surrogate",
                expected: format!("{width} inputs and {OUTPUTS} outputs"),
                found: format!("{:?}", member.ends()),
            });
        }
    }
    let unit = bundle.get::<f64>("unit", &[2])?;
    let range = bundle.get::<f64>("range_mps2", &[2])?;
    let surrogate = Surrogate {
        mean: bundle.get("mean", &[width])?.to_vec(),
        inverse_sd: bundle.get("inverse_sd", &[width])?.to_vec(),
        unit: [unit[0], unit[1]],
        range_mps2: [range[0], range[1]],
        alike: from.alike.clone().into(),
        members,
        brake: from.brake,
    };
    let trained_on = match bundle.shape(TRAINED_ON) {
        Some(_) => Some(TensorFile::from_bytes(bundle.rows::<u8>(TRAINED_ON, &[])?)?),
        None => None,
    };
    if let Some(policy) = &trained_on {
        // Loading once here reports a damaged policy before any start is planned.
        load_policy_for(&world.spaces(), policy)?;
    }
    Ok(LearnedEgo {
        surrogate: Arc::new(surrogate),
        trained_on: trained_on.map(Arc::new),
        from,
    })
}
