//! Which policy meets an ego: a conditional ado is told the ego's parameters.

use std::path::Path;

use super::adapt::{AdaptRequest, Adapted, ENOUGH_SIMULATIONS, adapt};
use super::ego_under_test::EgoUnderTest;
use super::error::CampaignError;
use super::identify::{IdentifyRequest, identify, is_telling};
use super::replay::wrong_kind;
use super::tries::other_members;
use super::watch::Watch;
use crate::rl::Policy;
use crate::run::{IdentifiedEgo, IdentifiedEgos, RunDir};
use crate::scenario::{Against, Family, Member, Scenario};
use crate::sim::PlantKind;

/// Runs of an ego that are recorded to identify it, unless told otherwise.
pub const RECORDED_RUNS: usize = 10;

/// Whence a conditional ado knows the ego it meets.
#[derive(Clone, Debug)]
pub enum ContextSource {
    /// It takes every ego for the nominal one.
    Nominal,
    /// It is told the parameters in the world file.
    True,
    /// Each ego is identified from recorded runs.
    Identified,
    /// The same, and then adapted by how the ado fares.
    Adapted,
    /// From a file of identified egos: its name, and what it holds.
    File(String, IdentifiedEgos),
}

/// An ado, ready to meet one ego.
pub struct ConditionedAdo {
    /// Its policy; a conditional one is told what it takes the ego for.
    pub policy: Box<dyn Policy>,
    /// The same told of other egos, for [`super::Tries`].
    pub others: Vec<Box<dyn Policy>>,
    /// What it was told, as rows have it; `None`: it is not told anything.
    pub told: Option<&'static str>,
}

impl ContextSource {
    /// What `asked` means for a run: `nominal`, `true`, `identified`, `adapted`,
    /// or a RON file that `identify` wrote; nothing for an ado that is told nothing.
    /// An ado that learns every ego from so many `runs` identifies it if nothing is
    /// asked for.
    ///
    /// # Errors
    /// The ado is told something and nothing was asked for, or the other way
    /// round, or there is no such source.
    pub fn find(
        run: &RunDir,
        asked: Option<&str>,
        runs: u64,
        watch: &Watch<'_>,
    ) -> Result<Option<ContextSource>, CampaignError> {
        let learns = 0 < runs && run.manifest().against == Against::Conditional;
        let Some(asked) = asked.or(learns.then_some("identified")) else {
            // A conditional ado refuses here to be played untold.
            run.policy()?;
            return Ok(None);
        };
        let manifest = run.manifest();
        if manifest.against != Against::Conditional {
            return Err(CampaignError::request(
                format!(
                    "the ado in `{}` is {}: it is not told parameters",
                    run.path().display(),
                    manifest.against
                ),
                "leave out `--params`, or train with `--against conditional`",
            ));
        }
        Ok(Some(match asked {
            "nominal" => ContextSource::Nominal,
            "true" => ContextSource::True,
            "identified" => ContextSource::Identified,
            "adapted" => ContextSource::Adapted,
            file if file.ends_with(".ron") => ContextSource::read(run, file, watch)?,
            other => {
                return Err(CampaignError::request(
                    format!("`--params {other}` is none of nominal, true, identified, adapted"),
                    "name one of them, or a RON file that `brakecheck identify -o` wrote",
                ));
            }
        }))
    }

    fn read(run: &RunDir, file: &str, watch: &Watch<'_>) -> Result<ContextSource, CampaignError> {
        let path = Path::new(file);
        if !path.is_file() {
            return Err(wrong_kind(path, "file that `identify` wrote"));
        }
        let egos = IdentifiedEgos::load(path)?;
        if egos.world != run.manifest().world {
            return Err(CampaignError::request(
                format!("`{file}` is about egos of the world `{}`", egos.world),
                "identify the ego with this run: `brakecheck identify RUN --ego … -o P.ron`",
            ));
        }
        if egos.world_sha256 != run.manifest().world_sha256 {
            watch.note(&format!(
                "`{file}` was made with another version of the world `{}`: if its ego or its \
                 family changed, identify the egos again",
                egos.world
            ));
        }
        Ok(ContextSource::File(file.to_owned(), egos))
    }

    /// Sees to it that the parameters of all egos are there, before the first
    /// one is played.
    ///
    /// # Errors
    /// They are not, or are of another ego.
    pub(super) fn check(&self, run: &RunDir, egos: &[EgoUnderTest]) -> Result<(), CampaignError> {
        let ContextSource::File(file, known) = self else {
            return Ok(());
        };
        let world = run.world()?;
        let Some(family) = world.family() else {
            return Ok(());
        };
        let mut egos = egos.iter();
        egos.try_for_each(|ego| held(family, ego, file, known).map(drop))
    }
}

/// The ado of a run, told of an ego what `source` says.
///
/// `source` is `None` for an ado that is not conditional. `seed` is that of the
/// runs with which an ego is identified or adapted to.
///
/// # Errors
/// The run has no policy, or the ego cannot be identified.
pub fn conditioned(
    run: &RunDir,
    source: Option<&ContextSource>,
    ego: &EgoUnderTest,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<ConditionedAdo, CampaignError> {
    let Some(source) = source else {
        return Ok(ConditionedAdo {
            policy: run.policy()?,
            others: Vec::new(),
            told: None,
        });
    };
    let world = run.world()?;
    let (Some(family), Some(spec)) = (world.family(), ego.scenario().drive()) else {
        return Err(CampaignError::Fault(
            "a conditional ado without a family".to_owned(),
        ));
    };
    let nominal = || (family.nominal(spec.plant), "nominal");
    let (members, told) = match source {
        ContextSource::Nominal => alone(nominal()),
        ContextSource::True => alone(match family.member_of(spec) {
            Ok(member) => (member, "true"),
            Err(error) => {
                let name = ego.name();
                watch.note(&format!("`{name}`: {error}; told the nominal values"));
                nominal()
            }
        }),
        ContextSource::Identified => alone(identified(&world, family, ego, seed, watch)?),
        ContextSource::Adapted => {
            let (first, told) = identified(&world, family, ego, seed, watch)?;
            let budget = (ENOUGH_SIMULATIONS, seed);
            match adapted(run, family, ego, &first, budget, &watch.quiet())? {
                Some(found) => {
                    say_adapted(family, ego, (&found, told), watch);
                    let members = std::iter::once(found.member).chain(found.others);
                    (members.collect(), "adapted")
                }
                // Stopped: no row of this ego will be finished either.
                None => (vec![first], told),
            }
        }
        ContextSource::File(file, egos) => in_file(run, family, ego, (file, egos), watch)?,
    };
    let mut policies = run.policies_told(&members)?.into_iter();
    let Some(policy) = policies.next() else {
        return Err(CampaignError::Fault(
            "a conditional ado that is told nothing".to_owned(),
        ));
    };
    let mut others: Vec<_> = policies.collect();
    let drawn = other_members(run, family, spec.plant)?;
    let most = drawn.len();
    others.extend(drawn);
    others.truncate(most);
    Ok(ConditionedAdo {
        policy,
        others,
        told: Some(told),
    })
}

/// One member only.
fn alone((member, told): (Member, &'static str)) -> (Vec<Member>, &'static str) {
    (vec![member], told)
}

/// What the ado is best told of an ego, by how it fares with so many
/// simulations of a seed. `None`: stopped.
pub(super) fn adapted(
    run: &RunDir,
    family: &Family,
    ego: &EgoUnderTest,
    first: &Member,
    (simulations, seed): (u64, u64),
    watch: &Watch<'_>,
) -> Result<Option<Adapted>, CampaignError> {
    let request = AdaptRequest {
        run,
        family,
        ego: ego.scenario(),
        first,
        simulations,
        seed,
    };
    Ok(adapt(&request, watch)?)
}

fn identified(
    world: &Scenario,
    family: &Family,
    ego: &EgoUnderTest,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<(Member, &'static str), CampaignError> {
    let request = IdentifyRequest {
        world,
        ego: ego.scenario(),
        runs: RECORDED_RUNS,
        seed,
        fixed: &[],
    };
    let found = identify(&request, &watch.quiet())?;
    let Some(found) = found else {
        // Stopped: no row of this ego will be finished either.
        return Ok((family.nominal(plant_of(ego)?), "nominal"));
    };
    let (member, told) = found.told(family);
    say_stranger(ego, told, (found.explains(), found.residual_m), watch);
    Ok((member, told))
}

fn in_file(
    run: &RunDir,
    family: &Family,
    ego: &EgoUnderTest,
    (file, egos): (&str, &IdentifiedEgos),
    watch: &Watch<'_>,
) -> Result<(Vec<Member>, &'static str), CampaignError> {
    let (found, member, adapted_members) = held(family, ego, file, egos)?;
    let plant = member.plant;
    if let Some(adapted) = &found.adapted {
        // Another policy may be best told something else.
        if run.manifest().policy_sha256.as_deref() == Some(&*adapted.policy_sha256) {
            return Ok((adapted_members, "adapted"));
        }
        watch.note(&format!(
            "`{}` in `{file}` was adapted to another policy: here the ado is told what was identified",
            ego.name()
        ));
    }
    let told = match is_telling(found.explains, found.residual_m, found.nominal_residual_m) {
        true => (member, "identified"),
        false => (family.nominal(plant), "nominal"),
    };
    say_stranger(ego, told.1, (found.explains, found.residual_m), watch);
    Ok(alone(told))
}

/// What a file holds of an ego: the entry, the member identified, and those
/// that the ado is best told, if they were looked for.
fn held<'a>(
    family: &Family,
    ego: &EgoUnderTest,
    file: &str,
    egos: &'a IdentifiedEgos,
) -> Result<(&'a IdentifiedEgo, Member, Vec<Member>), CampaignError> {
    let Some(found) = egos.egos.get(ego.name()) else {
        let known: Vec<&str> = egos.egos.keys().map(String::as_str).collect();
        return Err(CampaignError::request(
            format!("`{file}` does not hold the parameters of `{}`", ego.name()),
            format!("it holds those of: {}", known.join(", ")),
        ));
    };
    if found
        .change
        .as_ref()
        .is_some_and(|then| then != ego.change())
    {
        return Err(CampaignError::request(
            format!("`{}` is another ego than the one in `{file}`", ego.name()),
            "it was changed since it was identified: identify it again",
        ));
    }
    let plant = plant_of(ego)?;
    let named = |values| {
        family.member_named(values, plant).map_err(|error| {
            CampaignError::request(
                format!("`{file}`, ego `{}`: {error}", ego.name()),
                "it was made with another family: identify the ego again with this run",
            )
        })
    };
    let adapted = found.adapted.iter();
    let adapted = adapted.flat_map(|it| std::iter::once(&it.parameters).chain(&it.others));
    let adapted = adapted.map(named).collect::<Result<_, _>>()?;
    Ok((found, named(&found.parameters)?, adapted))
}

fn plant_of(ego: &EgoUnderTest) -> Result<PlantKind, CampaignError> {
    let plant = ego.scenario().plant().plant();
    plant.ok_or_else(|| CampaignError::Fault("an ego on no plant".to_owned()))
}

/// Says what an ado is told of an ego, and what it cost to know.
fn say_adapted(
    family: &Family,
    ego: &EgoUnderTest,
    (found, otherwise): (&Adapted, &str),
    watch: &Watch<'_>,
) {
    let told = match found.is_better {
        true => family.in_words(&found.member),
        false => format!("the {otherwise} parameters, none being clearly better"),
    };
    watch.note(&format!(
        "`{}`: the ado is told {told} (once, after {} simulations of the ego)",
        ego.name(),
        found.simulations
    ));
}

/// Says of an ego that no member explains what the ado is told instead.
fn say_stranger(
    ego: &EgoUnderTest,
    told: &str,
    (explains, residual_m): (bool, f64),
    watch: &Watch<'_>,
) {
    if explains {
        return;
    }
    let what = match told {
        "identified" => "the ado is told its nearest member",
        _ => "which says nothing of it: the ado is told the nominal values",
    };
    watch.note(&format!(
        "`{}` is none of the family, its nearest member is {residual_m:.2} m away; {what}",
        ego.name()
    ));
}
