//! Which policy meets an ego: a conditional ado is told the ego's parameters.

use std::path::Path;

use super::{Failure, NamedEgo, failure, talk};
use crate::campaign::{
    AdaptRequest, Adapted, ENOUGH_SIMULATIONS, IdentifyRequest, Watch, adapt, identify, is_telling,
    other_members,
};
use crate::rl::Policy;
use crate::run::{IdentifiedEgo, IdentifiedEgos, RunDir};
use crate::scenario::{Against, Family, Member, Scenario};
use crate::sim::PlantKind;

/// Runs that are recorded of each ego for `--params identified`.
pub(super) const RECORDED_RUNS: usize = 10;

/// Whence a conditional ado knows the ego it meets.
pub(super) enum Params {
    /// It takes every ego for the nominal one.
    Nominal,
    /// It is told the parameters in the world file.
    True,
    /// Each ego is identified from recorded runs.
    Identified,
    /// The same, and then adapted by how the ado fares.
    Adapted,
    /// From a file that `identify` wrote.
    File(String, IdentifiedEgos),
}

/// An ado, ready to meet one ego.
pub(super) struct Playing {
    /// It.
    pub policy: Box<dyn Policy>,
    /// The same told of other egos, for `--tries`.
    pub others: Vec<Box<dyn Policy>>,
    /// What it was told, for rows; `None`: it is not told anything.
    pub told: Option<&'static str>,
}

impl Params {
    /// Reads `--params` for a run.
    pub(super) fn of(run: &RunDir, asked: Option<&str>) -> Result<Option<Params>, Failure> {
        let Some(asked) = asked else {
            return Ok(None);
        };
        let against = run.manifest().against;
        if against != Against::Conditional {
            return Err(Failure::input(
                format!(
                    "the ado in `{}` is {against}: it is not told parameters",
                    run.path().display()
                ),
                "leave out `--params`, or train with `--against conditional`",
            ));
        }
        Ok(Some(match asked {
            "nominal" => Params::Nominal,
            "true" => Params::True,
            "identified" => Params::Identified,
            "adapted" => Params::Adapted,
            file if file.ends_with(".ron") => {
                let path = Path::new(file);
                if !path.is_file() {
                    return Err(failure::wrong_kind(path, "file that `identify` wrote"));
                }
                let egos = IdentifiedEgos::load(path)?;
                if egos.world != run.manifest().world {
                    return Err(Failure::input(
                        format!("`{file}` is about egos of the world `{}`", egos.world),
                        "identify the ego with this run: `brakecheck identify RUN --ego … -o P.ron`",
                    ));
                }
                if egos.world_sha256 != run.manifest().world_sha256 {
                    talk::say(&format!(
                        "`{file}` was made with another version of the world `{}`: if its ego or \
                         its family changed, identify the egos again",
                        egos.world
                    ));
                }
                Params::File(file.to_owned(), egos)
            }
            other => {
                return Err(Failure::input(
                    format!("`--params {other}` is none of nominal, true, identified, adapted"),
                    "name one of them, or a RON file that `brakecheck identify -o` wrote",
                ));
            }
        }))
    }

    /// Sees to it that the parameters of all egos are there, before the first
    /// one is played.
    pub(super) fn check(&self, run: &RunDir, egos: &[NamedEgo]) -> Result<(), Failure> {
        let Params::File(file, known) = self else {
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

/// The ado of a run, told of an ego what `params` says.
pub(super) fn playing(
    run: &RunDir,
    params: Option<&Params>,
    ego: &NamedEgo,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<Playing, Failure> {
    let Some(params) = params else {
        return Ok(Playing {
            policy: run.policy()?,
            others: Vec::new(),
            told: None,
        });
    };
    let world = run.world()?;
    let (Some(family), Some(spec)) = (world.family(), ego.scenario.drive()) else {
        return Err(Failure::fault("a conditional ado without a family", None));
    };
    let nominal = || (family.nominal(spec.plant), "nominal");
    let (members, told) = match params {
        Params::Nominal => alone(nominal()),
        Params::True => alone(match family.member_of(spec) {
            Ok(member) => (member, "true"),
            Err(error) => {
                talk::say(&format!("`{}`: {error}; told the nominal values", ego.name));
                nominal()
            }
        }),
        Params::Identified => alone(identified(&world, family, ego, seed, watch)?),
        Params::Adapted => {
            let (first, told) = identified(&world, family, ego, seed, watch)?;
            let budget = (ENOUGH_SIMULATIONS, seed);
            match adapted(run, family, ego, &first, budget, &watch.quiet())? {
                Some(found) => {
                    say_adapted(family, ego, &found, told);
                    let members = std::iter::once(found.member).chain(found.others);
                    (members.collect(), "adapted")
                }
                // Stopped: no row of this ego will be finished either.
                None => (vec![first], told),
            }
        }
        Params::File(file, egos) => in_file(run, family, ego, file, egos)?,
    };
    let mut policies = run.policies_told(&members)?.into_iter();
    let Some(policy) = policies.next() else {
        return Err(Failure::fault(
            "a conditional ado that is told nothing",
            None,
        ));
    };
    let mut others: Vec<_> = policies.collect();
    let drawn = other_members(run, family, spec.plant)?;
    let most = drawn.len();
    others.extend(drawn);
    others.truncate(most);
    Ok(Playing {
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
    ego: &NamedEgo,
    first: &Member,
    (simulations, seed): (u64, u64),
    watch: &Watch<'_>,
) -> Result<Option<Adapted>, Failure> {
    let request = AdaptRequest {
        run,
        family,
        ego: &ego.scenario,
        first,
        simulations,
        seed,
    };
    Ok(adapt(&request, watch)?)
}

fn identified(
    world: &Scenario,
    family: &Family,
    ego: &NamedEgo,
    seed: u64,
    watch: &Watch<'_>,
) -> Result<(Member, &'static str), Failure> {
    let request = IdentifyRequest {
        world,
        ego: &ego.scenario,
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
    say_stranger(ego, told, found.explains(), found.residual_m);
    Ok((member, told))
}

fn in_file(
    run: &RunDir,
    family: &Family,
    ego: &NamedEgo,
    file: &str,
    egos: &IdentifiedEgos,
) -> Result<(Vec<Member>, &'static str), Failure> {
    let (found, member, adapted_members) = held(family, ego, file, egos)?;
    let plant = member.plant;
    if let Some(adapted) = &found.adapted {
        // Another policy may be best told something else.
        if run.manifest().policy_sha256.as_deref() == Some(&*adapted.policy_sha256) {
            return Ok((adapted_members, "adapted"));
        }
        talk::say(&format!(
            "`{}` in `{file}` was adapted to another policy: here the ado is told what was identified",
            ego.name
        ));
    }
    let told = match is_telling(found.explains, found.residual_m, found.nominal_residual_m) {
        true => (member, "identified"),
        false => (family.nominal(plant), "nominal"),
    };
    say_stranger(ego, told.1, found.explains, found.residual_m);
    Ok(alone(told))
}

/// What a file holds of an ego: the entry, the member identified, and those
/// that the ado is best told, if they were looked for.
fn held<'a>(
    family: &Family,
    ego: &NamedEgo,
    file: &str,
    egos: &'a IdentifiedEgos,
) -> Result<(&'a IdentifiedEgo, Member, Vec<Member>), Failure> {
    let Some(found) = egos.egos.get(&ego.name) else {
        let known: Vec<&str> = egos.egos.keys().map(String::as_str).collect();
        return Err(Failure::input(
            format!("`{file}` does not hold the parameters of `{}`", ego.name),
            format!("it holds those of: {}", known.join(", ")),
        ));
    };
    if found
        .change
        .as_ref()
        .is_some_and(|then| *then != ego.change)
    {
        return Err(Failure::input(
            format!("`{}` is another ego than the one in `{file}`", ego.name),
            "it was changed since it was identified: identify it again",
        ));
    }
    let plant = plant_of(ego)?;
    let named = |values| {
        family.member_named(values, plant).map_err(|error| {
            Failure::input(
                format!("`{file}`, ego `{}`: {error}", ego.name),
                "it was made with another family: identify the ego again with this run",
            )
        })
    };
    let adapted = found.adapted.iter();
    let adapted = adapted.flat_map(|it| std::iter::once(&it.parameters).chain(&it.others));
    let adapted = adapted.map(named).collect::<Result<_, _>>()?;
    Ok((found, named(&found.parameters)?, adapted))
}

fn plant_of(ego: &NamedEgo) -> Result<PlantKind, Failure> {
    let plant = ego.scenario.plant().plant();
    plant.ok_or_else(|| Failure::fault("an ego on no plant", None))
}

/// Says what an ado is told of an ego, and what it cost to know.
fn say_adapted(family: &Family, ego: &NamedEgo, found: &Adapted, otherwise: &str) {
    let told = match found.is_better {
        true => family.in_words(&found.member),
        false => format!("the {otherwise} parameters, none being clearly better"),
    };
    talk::say(&format!(
        "`{}`: the ado is told {told} (once, after {} simulations of the ego)",
        ego.name, found.simulations
    ));
}

/// Says of an ego that no member explains what the ado is told instead.
fn say_stranger(ego: &NamedEgo, told: &str, explains: bool, residual_m: f64) {
    if explains {
        return;
    }
    let what = match told {
        "identified" => "the ado is told its nearest member",
        _ => "which says nothing of it: the ado is told the nominal values",
    };
    talk::say(&format!(
        "`{}` is none of the family, its nearest member is {residual_m:.2} m away; {what}",
        ego.name
    ));
}
