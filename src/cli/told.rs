//! Which policy meets an ego: a conditional ado is told the ego's parameters.

use std::path::Path;

use super::{Failure, NamedEgo, failure, talk};
use crate::campaign::{IdentifyRequest, Watch, identify, is_telling, other_members};
use crate::rl::Policy;
use crate::run::{IdentifiedEgos, RunDir};
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
                Params::File(file.to_owned(), egos)
            }
            other => {
                return Err(Failure::input(
                    format!("`--params {other}` is none of nominal, true, identified"),
                    "name one of them, or a RON file that `brakecheck identify -o` wrote",
                ));
            }
        }))
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
    let (member, told) = match params {
        Params::Nominal => nominal(),
        Params::True => match family.member_of(spec) {
            Ok(member) => (member, "true"),
            Err(error) => {
                talk::say(&format!("`{}`: {error}; told the nominal values", ego.name));
                nominal()
            }
        },
        Params::Identified => identified(&world, family, ego, seed, watch)?,
        Params::File(file, egos) => in_file(family, ego, file, egos)?,
    };
    Ok(Playing {
        policy: run.policy_told(&member)?,
        others: other_members(run, family, spec.plant)?,
        told: Some(told),
    })
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
    let quiet = Watch {
        progress: &|_, _| {},
        stop: watch.stop,
    };
    let found = identify(&request, &quiet)?;
    let Some(found) = found else {
        // Stopped: no row of this ego will be finished either.
        return Ok((family.nominal(plant_of(ego)?), "nominal"));
    };
    let (member, told) = found.told(family);
    say_stranger(ego, told, found.explains(), found.residual_m);
    Ok((member, told))
}

fn in_file(
    family: &Family,
    ego: &NamedEgo,
    file: &str,
    egos: &IdentifiedEgos,
) -> Result<(Member, &'static str), Failure> {
    let Some(found) = egos.egos.get(&ego.name) else {
        let known: Vec<&str> = egos.egos.keys().map(String::as_str).collect();
        return Err(Failure::input(
            format!("`{file}` does not hold the parameters of `{}`", ego.name),
            format!("it holds those of: {}", known.join(", ")),
        ));
    };
    let plant = plant_of(ego)?;
    let member = family
        .member_named(&found.parameters, plant)
        .map_err(|error| {
            Failure::input(
                format!("`{file}`, ego `{}`: {error}", ego.name),
                "it was made with another family: identify the ego again with this run",
            )
        })?;
    let told = match is_telling(found.explains, found.residual_m, found.nominal_residual_m) {
        true => (member, "identified"),
        false => (family.nominal(plant), "nominal"),
    };
    say_stranger(ego, told.1, found.explains, found.residual_m);
    Ok(told)
}

fn plant_of(ego: &NamedEgo) -> Result<PlantKind, Failure> {
    let plant = ego.scenario.plant().plant();
    plant.ok_or_else(|| Failure::fault("an ego on no plant", None))
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
