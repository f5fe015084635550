//! Checks of `train_against`, from ranges in a world file to a family.

use indexmap::IndexMap;

use super::check;
use super::family::Family;
use super::quantity::{Quantity, Varied};
use super::structure::Structure;
use crate::ego::{Actuated, ControllerSpec, Parameter};
use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::ron_file::{did_you_mean, guessed, known_names};
use crate::scene::drive::{DriveSpec, EgoVariant};
use crate::sim::PlantKind;
use crate::world_file::{Change, FamilyFile};

/// Longest delay and widest noise of sensors, as for `sensors`.
const MAX_DELAY_S: f64 = 5.0;
const MAX_NOISE: f64 = 10.0;
/// Greatest weight of a plant.
const MAX_WEIGHT: u32 = 1000;

/// Reads the family of a world and reports its mistakes.
pub(super) fn family(
    problems: &mut Problems,
    path: &ValuePath,
    file: FamilyFile,
    spec: &DriveSpec,
    reuse: &IndexMap<String, Change>,
) -> Option<Family> {
    // Ranges refer to the named parameters of a stock controller.
    let Some(controller) = spec.ego.stock() else {
        let what = "a family needs a stock controller as the ego";
        problems.add(path, what, "here", None);
        return None;
    };
    let mut quantities = of_controller(problems, &path.to("ego"), &file.ego, &controller);
    let structures: Vec<Structure> = file
        .structures
        .0
        .iter()
        .filter_map(|(name, ranges)| {
            let place = path.to("structures").to(name);
            structure(problems, &place, name, ranges, reuse)
        })
        .collect();
    let sample_s = spec.clock.sample_s;
    let others = [
        // A delay is a whole number of samples, so its quantity has steps.
        (Varied::Delay, file.delay_s, (0.0, MAX_DELAY_S), sample_s),
        (
            Varied::PositionNoise,
            file.position_sd_m,
            (0.0, MAX_NOISE),
            0.0,
        ),
        (Varied::SpeedNoise, file.speed_sd_mps, (0.0, MAX_NOISE), 0.0),
        (Varied::Friction, file.friction, (0.01, 2.0), 0.0),
    ];
    for (varied, range, bounds, step) in others {
        let (Some(range), Some(nominal)) = (range, varied.read(spec)) else {
            continue;
        };
        let place = path.to(varied.name());
        if spec.environment.iter().any(|it| varied.is(it.quantity)) {
            let what = format!("the starts of this world draw `{}` already", varied.name());
            let help = "give it one number in the world, or leave it out of the family".to_owned();
            problems.add(&place, what, "drawn twice", Some(help));
            continue;
        }
        if range.0 < bounds.0 || bounds.1 < range.1 {
            let what = format!(
                "{} ..= {} reaches outside of {} ..= {}",
                range.0, range.1, bounds.0, bounds.1
            );
            problems.add(&place, what, "out of range", None);
            continue;
        }
        let quantity = Quantity {
            varied,
            lo: range.0,
            hi: range.1,
            nominal,
            step,
        };
        quantities.extend(sound(problems, &place, quantity));
    }
    let plants = plants(problems, path, &file, spec.plant);
    check::within(problems, &path.to("nominal"), file.nominal, 0.0, 1.0);
    let wide = check::learner(problems, &path.to("wide"), &file.wide);
    // Without other mistakes only: invalid quantities are missing here, and
    // were reported.
    if quantities.is_empty() && structures.is_empty() && problems.is_empty() {
        let what = "a family in which nothing varies";
        let help = "write `ego: { \"max_brake_mps2\": (4.0, 8.0) }`, or leave it out".to_owned();
        problems.add(path, what, "here", Some(help));
    }
    Some(Family {
        quantities,
        structures,
        plants,
        nominal_share: file.nominal,
        wide,
        mixture: Vec::new(),
        base: EgoVariant {
            controller,
            sensors: spec.sensors,
            friction: spec.road.friction(),
            plant: spec.plant,
        },
    })
}

/// Reads a controller of another structure, which is that of a changed ego.
fn structure(
    problems: &mut Problems,
    place: &ValuePath,
    name: &str,
    ranges: &Ordered<(f64, f64)>,
    reuse: &IndexMap<String, Change>,
) -> Option<Structure> {
    let Some(change) = reuse.get(name) else {
        let help = guessed(name, "known", reuse.keys().map(String::as_str));
        let what = format!("no ego `{name}` under `reuse`, where structures are described");
        problems.add(place, what, "unknown ego", Some(help));
        return None;
    };
    let Some(mut controller) = change.controller.clone() else {
        let what = format!("`{name}` keeps the world's own controller: it is no other structure");
        let help = "widen the ranges under `ego` of the family instead".to_owned();
        problems.add(place, what, "the world's own structure", Some(help));
        return None;
    };
    for (parameter, value) in &change.ego.0 {
        // Invariant: an unknown parameter is refused under `reuse`.
        let _ = controller.set(parameter, *value);
    }
    Some(Structure {
        name: name.to_owned(),
        quantities: of_controller(problems, place, ranges, &controller),
        controller,
    })
}

/// Reads ranges over the parameters of a controller.
fn of_controller(
    problems: &mut Problems,
    path: &ValuePath,
    ranges: &Ordered<(f64, f64)>,
    controller: &Actuated<ControllerSpec>,
) -> Vec<Quantity> {
    let parameters = controller.parameters();
    let mut quantities = Vec::new();
    for (name, &(lo, hi)) in &ranges.0 {
        let place = path.to(name);
        let Some(parameter) = parameters.iter().find(|p| p.name == name) else {
            let known: Vec<&str> = parameters.iter().map(|p| p.name).collect();
            unknown(problems, &place, name, controller.controller.kind(), &known);
            continue;
        };
        quantities.extend(of_ego(problems, &place, lo, hi, parameter));
    }
    quantities
}

fn unknown(problems: &mut Problems, place: &ValuePath, name: &str, kind: &str, known: &[&str]) {
    let list = known_names("parameters", known.iter().copied());
    let help = match did_you_mean(name, known.iter().copied()) {
        Some(guess) => format!("{guess} — {list}"),
        None => list,
    };
    let what = format!("`{kind}` has no parameter `{name}`");
    problems.add(place, what, "not a parameter of the ego", Some(help));
}

fn of_ego(
    problems: &mut Problems,
    place: &ValuePath,
    lo: f64,
    hi: f64,
    parameter: &Parameter,
) -> Option<Quantity> {
    if lo < parameter.at_least {
        let what = format!(
            "`{}` begins at {lo}, below {}",
            parameter.name, parameter.at_least
        );
        problems.add(place, what, "too small", None);
        return None;
    }
    let quantity = Quantity {
        varied: Varied::Ego(parameter.name.to_owned()),
        lo,
        hi,
        nominal: parameter.value,
        step: 0.0,
    };
    sound(problems, place, quantity)
}

/// Checks a range: it rises, contains the nominal value and ends on whole steps.
fn sound(problems: &mut Problems, place: &ValuePath, quantity: Quantity) -> Option<Quantity> {
    let Quantity {
        lo, hi, nominal, ..
    } = quantity;
    if hi <= lo {
        let what = format!("the range ({lo}, {hi}) does not rise");
        let help = format!("write the lesser value first: ({hi}, {lo})");
        // An empty range is not reversed, so it gets no advice.
        problems.add(place, what, "reversed or empty", (hi < lo).then_some(help));
        return None;
    }
    // Many members are nominal in a quantity, so its range must contain that
    // value.
    if !quantity.contains(nominal) {
        let what = format!("the range ({lo}, {hi}) leaves out {nominal}, the nominal value");
        let help = format!(
            "the world's own ego belongs to its family: write ({}, {})",
            lo.min(nominal),
            hi.max(nominal)
        );
        problems.add(place, what, "without the nominal ego", Some(help));
        return None;
    }
    let off = [lo, hi]
        .into_iter()
        // Multiples of a decimal step are only whole up to rounding.
        .find(|end| (quantity.fit(*end) - end).abs() > 1e-9);
    if let Some(end) = off {
        let what = format!("{end} is no multiple of `sample_s` = {}", quantity.step);
        let help = "an ego sees whole samples".to_owned();
        problems.add(place, what, "between two samples", Some(help));
        return None;
    }
    Some(quantity)
}

fn plants(
    problems: &mut Problems,
    path: &ValuePath,
    file: &FamilyFile,
    own: PlantKind,
) -> Vec<(PlantKind, u32)> {
    let Some(weights) = &file.plants else {
        // Without weights, training uses the plant of the world.
        return vec![(own, 1)];
    };
    let weighted = weights
        .iter()
        .map(|(name, weight)| ((*name).into(), *weight));
    let plants: Vec<(PlantKind, u32)> = weighted.collect();
    if plants.is_empty()
        || plants
            .iter()
            .any(|(_, weight)| !(1..=MAX_WEIGHT).contains(weight))
    {
        let what = "each plant of a family has a weight above 0".to_owned();
        let help = format!("write `plants: {{ Kinematic: 4, Rigid: 1 }}`, {MAX_WEIGHT} at most");
        problems.add(&path.to("plants"), what, "here", Some(help));
    }
    plants
}
