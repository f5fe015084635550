//! Who an ego is, for a conditional ado: identified once, and kept with the run.

use serde::{Deserialize, Serialize};

use super::error::ConditioningError;
use super::identification_cache::{DIR, place_of};
use super::identify::{Identified, identify, is_telling};
use super::recording::IdentifyRequest;
use crate::content_hash::{BLANK, check, seal};
use crate::experiment::{EgoUnderTest, Watch};
use crate::run_dir::{RunDir, RunError, make_dir, write_file};
use crate::sim::PlantKind;
use crate::world::file_text;
use crate::world::{EgoSample, Family, Scenario};

/// An ego as the nearest member of a family, and how far that is to be trusted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IdentifiedAs {
    /// Name of the ego, as rows call it.
    pub ego: String,
    /// Every quantity of the family, in its order.
    pub parameters: Vec<FoundParameter>,
    /// Whether the member follows the ego about as closely as noise allows.
    pub explains: bool,
    /// How far the member stays from the ego: the root of the mean square over all
    /// samples, 1 m/s in speed counting like 1 m.
    pub residual_m: f64,
    /// The residual up to which a member explains the ego.
    pub bound_m: f64,
    /// How far the nominal ego stays from it.
    pub nominal_residual_m: f64,
    /// How far its noise may move the recorded runs; 0 without any.
    pub noise_m: f64,
    /// The residuals of all independent fits.
    pub refits_m: Vec<f64>,
    /// Runs recorded of the ego.
    pub recorded: u64,
    /// Runs simulated of members.
    pub simulations: u64,
}

/// A quantity of a family, as it was found of an ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundParameter {
    /// Its name, with its unit.
    pub name: String,
    /// That of the nearest member.
    pub fitted: f64,
    /// Standard deviation over independent fits.
    pub spread: f64,
    /// Whether it does not show in the runs, and is nominal.
    pub hidden: bool,
    /// The one of the world's own ego.
    pub nominal: f64,
    /// Least and most of the family.
    pub range: [f64; 2],
}

impl IdentifiedAs {
    fn of(ego: &str, family: &Family, found: &Identified) -> IdentifiedAs {
        let quantities = family.quantities.iter().enumerate();
        let parameters = quantities.map(|(i, quantity)| FoundParameter {
            name: quantity.varied.name().to_owned(),
            fitted: found.member.values[i],
            spread: found.spread[i],
            hidden: found.hidden[i],
            nominal: quantity.nominal,
            range: [quantity.lo, quantity.hi],
        });
        IdentifiedAs {
            ego: ego.to_owned(),
            parameters: parameters.collect(),
            explains: found.explains(),
            residual_m: found.residual_m,
            bound_m: found.bound_m(),
            nominal_residual_m: found.nominal_residual_m,
            noise_m: found.noise_m,
            refits_m: found.refits_m.clone(),
            recorded: found.recorded,
            simulations: found.simulations,
        }
    }

    /// What a conditional ado is to be told of it: the nearest member, or the nominal
    /// values if that says nothing of it ([`is_telling`]).
    pub(super) fn told(
        &self,
        family: &Family,
        plant: PlantKind,
    ) -> Result<(EgoSample, &'static str), ConditioningError> {
        if !is_telling(self.explains, self.residual_m, self.nominal_residual_m) {
            return Ok((family.nominal(plant), "nominal"));
        }
        let values = self.parameters.iter().map(|p| (p.name.clone(), p.fitted));
        let member = family.member_named(&values.collect(), plant);
        // It was found in this family, or read from a file under its hash.
        let member = member.map_err(ConditioningError::NoMember)?;
        Ok((member, "identified"))
    }
}

/// What a run keeps of an ego.
#[derive(Serialize, Deserialize)]
struct IdentificationRecord {
    sha256: String,
    identified: IdentifiedAs,
}

impl IdentificationRecord {
    fn read(text: &str) -> Result<IdentifiedAs, String> {
        let kept: IdentificationRecord =
            serde_json::from_str(text).map_err(|error| error.to_string())?;
        check(text, &kept.sha256)?;
        Ok(kept.identified)
    }

    fn written(found: &IdentifiedAs) -> Result<String, serde_json::Error> {
        let kept = IdentificationRecord {
            sha256: BLANK.to_owned(),
            identified: found.clone(),
        };
        Ok(seal(&serde_json::to_string_pretty(&kept)?))
    }
}

/// Who an ego is, from so many runs of it under a seed: as the run keeps it, or found
/// now and kept there. `None`: stopped from outside.
///
/// # Errors
/// It cannot be identified, or the disk refuses.
pub(super) fn identified(
    run: &RunDir,
    world: &Scenario,
    ego: &EgoUnderTest,
    (runs, seed): (u64, u64),
    watch: &Watch<'_>,
) -> Result<Option<IdentifiedAs>, ConditioningError> {
    let asked = serde_json::json!({ "identified_from": runs, "seed": seed });
    let place = place_of(run, ego, &asked).map(|place| place.with_extension("json"));
    if let Some(place) = &place
        && let Ok(text) = file_text(place)
    {
        let (name, place) = (ego.name(), place.display());
        match IdentificationRecord::read(&text) {
            Ok(kept) => {
                watch.note(&format!("`{name}`: identified before ({place})"));
                return Ok(Some(kept));
            }
            Err(error) => watch.note(&format!("{place}: {error}; identified anew")),
        }
    }
    let request = IdentifyRequest {
        world,
        ego: ego.scenario(),
        runs: runs as usize,
        at_most: runs,
        seed,
        fixed: &[],
    };
    let Some(found) = identify(&request, &watch.quiet())? else {
        return Ok(None);
    };
    let family = world.family();
    let family = family.ok_or(ConditioningError::NoFamily)?;
    let found = IdentifiedAs::of(ego.name(), family, &found);
    if let Some(place) = &place {
        let text = IdentificationRecord::written(&found).map_err(|error| RunError::Damaged {
            path: place.clone(),
            why: error.to_string(),
        })?;
        make_dir(&run.path().join(DIR))?;
        write_file(place, text.as_bytes())?;
    }
    Ok(Some(found))
}
