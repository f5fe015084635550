//! Conditioning of an ado on the parameters of an ego, identified once and stored with the run.

use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::identify::{Identified, IdentifyError, IdentifyRequest, describes, identify};
use crate::adversary::other_members;
use crate::content_hash::{BLANK, check, fingerprint, seal, sha256};
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::Policy;
use crate::run_dir::{RunDir, RunError, make_dir, write_file};
use crate::sim::PlantKind;
use crate::world::{EgoSample, Family, SampleError, Scenario, TrainingEgos, file_bytes, file_text};

/// Number of runs that identify an ego if further runs are left to learn it from.
pub const RECORDED_RUNS: u64 = 10;

/// Smallest number of runs of an ego that a fit requires.
pub(crate) const LEAST_RUNS: u64 = 10;

/// Source of the parameters that a conditional ado receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContextSource {
    /// Nominal parameters for every ego.
    Nominal,
    /// Parameters in the world file.
    True,
    /// Parameters identified from this number of runs of each ego.
    Identified(u64),
}

/// Ado conditioned on an ego.
#[non_exhaustive]
pub struct ConditionedAdo {
    /// Policy. It receives the parameters if the ado is conditional.
    pub policy: Box<dyn Policy>,
    /// Policies for other members of the family, for [`crate::adversary::BestOfN`].
    pub others: Vec<Box<dyn Policy>>,
    /// Origin of the parameters, as in rows. `None`: the ado is not conditional.
    pub context: Option<&'static str>,
    /// Policy for the nominal ego, if the parameters are identified.
    pub nominal_policy: Option<Box<dyn Policy>>,
    /// Result of the identification, if the ego was identified.
    pub identified: Option<IdentifiedAs>,
}

impl ContextSource {
    /// Returns the source for the ado of a run with at most `runs` runs of each ego.
    ///
    /// `None`: the ado is not conditional.
    ///
    /// # Errors
    /// Returns an error if the run has no policy, or its file is damaged.
    pub fn of(
        run: &RunDir,
        runs: Option<NonZeroU64>,
    ) -> Result<Option<ContextSource>, ConditioningError> {
        run.policy_bundle()?;
        Ok(
            (run.manifest().against == TrainingEgos::Conditioned).then_some(
                match runs.map(NonZeroU64::get) {
                    None => ContextSource::Nominal,
                    Some(few) if few < RECORDED_RUNS + LEAST_RUNS => ContextSource::Identified(few),
                    _ => ContextSource::Identified(RECORDED_RUNS),
                },
            ),
        )
    }

    /// Returns the number of runs that identify an ego.
    pub fn runs(&self) -> u64 {
        match self {
            ContextSource::Identified(runs) => *runs,
            ContextSource::Nominal | ContextSource::True => 0,
        }
    }
}

/// Returns the ado of a run, conditioned on an ego.
///
/// `source` is `None` for an ado that is not conditional. `seed` is the seed of the runs
/// that identify the ego.
///
/// # Errors
/// Returns an error if the run has no policy, or the ego cannot be identified.
pub fn conditioned(
    run: &RunDir,
    source: Option<&ContextSource>,
    ego: &EgoUnderTest,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<ConditionedAdo, ConditioningError> {
    let Some(source) = source else {
        return Ok(ConditionedAdo {
            policy: run.policy()?,
            others: Vec::new(),
            context: None,
            nominal_policy: None,
            identified: None,
        });
    };
    let world = run.world()?;
    let (Some(family), Some(driving)) = (world.family(), ego.scenario().drive()) else {
        return Err(ConditioningError::NoFamily);
    };
    let spec = driving.spec();
    let nominal = family.nominal(spec.plant);
    let found = match *source {
        ContextSource::Identified(runs) => {
            identified(run, (&world, family), ego, (runs, seed), watch)?
        }
        ContextSource::Nominal | ContextSource::True => None,
    };
    let (member, context) = match (source, &found) {
        (ContextSource::True, _) => match family.member_of(spec) {
            Ok(member) => (member, "true"),
            Err(error) => {
                let name = ego.name();
                watch.note(&format!(
                    "`{name}`: {error}; the ado observes the nominal values"
                ));
                (nominal.clone(), "nominal")
            }
        },
        (_, Some(found)) => found.context(family, spec.plant)?,
        // After a stop no row is finished, so the parameters have no effect.
        (_, None) => (nominal.clone(), "nominal"),
    };
    if let Some(found) = &found {
        note_unexplained(ego, context, found, watch);
    }
    let nominal_policy = match context {
        "identified" => Some(run.conditioned_policy(&nominal)?),
        _ => None,
    };
    Ok(ConditionedAdo {
        policy: run.conditioned_policy(&member)?,
        others: other_members(run, family, spec.plant)?,
        context: Some(context),
        nominal_policy,
        identified: found,
    })
}

/// Notes the parameters that replace those of an ego that no member explains.
fn note_unexplained(ego: &EgoUnderTest, context: &str, found: &IdentifiedAs, watch: &Watch<'_>) {
    if found.explains {
        return;
    }
    let what = match context {
        "identified" => "the ado observes the parameters of this member",
        _ => "too far to describe it: the ado observes the nominal values",
    };
    watch.note(&format!(
        "`{}` is none of the family, its nearest member is {:.2} m away; {what}",
        ego.name(),
        found.residual_m
    ));
}

/// Nearest member of a family to an ego, and its residuals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct IdentifiedAs {
    /// Name of the ego, as in the rows.
    pub ego: String,
    /// Quantities of the family, in its order.
    pub parameters: Vec<FoundParameter>,
    /// Whether the member follows the ego about as closely as noise allows.
    pub explains: bool,
    /// Residual of the member: root mean square distance over all samples.
    ///
    /// A speed difference of 1 m/s counts like 1 m.
    pub residual_m: f64,
    /// Residual up to which a member explains the ego.
    pub bound_m: f64,
    /// Residual of the nominal ego.
    pub nominal_residual_m: f64,
    /// Influence of the ego's noise on the recorded runs. 0 without noise.
    pub noise_m: f64,
    /// Residuals of all independent fits.
    pub refits_m: Vec<f64>,
    /// Recorded runs of the ego.
    pub recorded: u64,
    /// Simulated runs of members.
    pub simulations: u64,
}

/// Quantity of a family, fitted to an ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct FoundParameter {
    /// Name of the quantity, with its unit.
    pub name: String,
    /// Value of the nearest member.
    pub fitted: f64,
    /// Standard deviation over independent fits.
    pub spread: f64,
    /// Whether the runs do not show it, so that `fitted` is nominal.
    pub hidden: bool,
    /// Value of the world's own ego.
    pub nominal: f64,
    /// Smallest and largest value in the family.
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

    /// Returns the parameters for a conditional ado, with their origin.
    ///
    /// They are those of the member, or nominal if the member does not describe the ego
    /// ([`describes`]).
    fn context(
        &self,
        family: &Family,
        plant: PlantKind,
    ) -> Result<(EgoSample, &'static str), ConditioningError> {
        if !describes(self.explains, self.residual_m, self.nominal_residual_m) {
            return Ok((family.nominal(plant), "nominal"));
        }
        let values = self.parameters.iter().map(|p| (p.name.clone(), p.fitted));
        let member = family.member_named(&values.collect(), plant);
        // The values come from this family or from a sealed file, so this is a bug if it fails.
        let member = member.map_err(ConditioningError::NoMember)?;
        Ok((member, "identified"))
    }
}

/// Identified ego in the run directory.
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

/// Returns the stored identification of an ego, or identifies the ego and stores it.
///
/// `None`: stopped from outside.
///
/// # Errors
/// Returns an error if the ego cannot be identified, or a file cannot be written.
fn identified(
    run: &RunDir,
    (world, family): (&Scenario, &Family),
    ego: &EgoUnderTest,
    (runs, seed): (u64, u64),
    watch: &Watch<'_>,
) -> Result<Option<IdentifiedAs>, ConditioningError> {
    let key = serde_json::json!({ "identified_from": runs, "seed": seed });
    let place = place_of(run, ego, &key).map(|place| place.with_extension("json"));
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
    let request = IdentifyRequest::new(world, ego.scenario(), runs as usize)
        .at_most(runs)
        .seed(seed);
    let Some(found) = identify(&request, &watch.quiet())? else {
        return Ok(None);
    };
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

/// Directory of learned egos in a run.
pub(crate) const DIR: &str = "learned";

/// Returns the path, without extension, of the result of a request about an ego.
///
/// The name is a hash of everything that the result depends on: the version, the world,
/// the ego, its plant and, for a program, the files that its command names.
/// `None`: the controller is in no file, and the next controller may differ.
pub(crate) fn place_of(run: &RunDir, ego: &EgoUnderTest, key: &Value) -> Option<PathBuf> {
    if ego.is_own() {
        return None;
    }
    let program = ego.scenario().program();
    let files = program.iter().flat_map(|program| &program.command);
    let files = files.filter_map(|path| file_bytes(Path::new(path)).ok());
    let files: Vec<String> = files.map(|bytes| sha256(&bytes)).collect();
    let name = fingerprint(&json!({
        "brakecheck": env!("CARGO_PKG_VERSION"),
        "world_sha256": run.manifest().world_sha256,
        "change": ego.change(),
        "plant": ego.scenario().plant(),
        "files_sha256": files,
        "asked": key,
    }));
    let name = name[..16].to_owned();
    Some(run.path().join(DIR).join(name))
}

/// Error of conditioning an ado on an ego.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConditioningError {
    /// The ado is not conditional.
    #[error("the ado in `{}` takes no parameters", run.display())]
    NotConditional {
        /// Directory of the run.
        run: PathBuf,
    },
    /// The parameters describe no member of the family.
    #[error("{error}")]
    Misfit {
        /// Error of a missing, unknown or excessive parameter.
        error: SampleError,
        /// Parameters of the ado, in order.
        known: Vec<String>,
    },
    /// The world of a conditional ado has no family, which is a bug of this program.
    #[error("a conditional ado without a family")]
    NoFamily,
    /// The identified member is not in the family, which is a bug of this program.
    #[error("{0}")]
    NoMember(SampleError),
    /// The ego cannot be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The run has no policy, or its files are damaged.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl ConditioningError {
    /// Returns the fix. `None`: a wrapped error has its own.
    pub fn help(&self) -> Option<String> {
        match self {
            ConditioningError::NotConditional { .. } => {
                Some("leave `--tell` out, or train with `--against conditional`".to_owned())
            }
            ConditioningError::Misfit { known, .. } => {
                Some(format!("the ado observes: {}", known.join(", ")))
            }
            ConditioningError::NoFamily
            | ConditioningError::NoMember(_)
            | ConditioningError::Identify(_)
            | ConditioningError::Run(_) => None,
        }
    }
}
