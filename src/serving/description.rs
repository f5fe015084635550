//! Description of a served world: its ado, its signals and its rules.

use indexmap::IndexMap;
use serde_json::{Value, json};

use super::{PROTOCOL, actions_of, number};
use crate::scene::drive::{Drive, DriveSpec};
use crate::scene::{Derived, World};
use crate::world::Scenario;
use crate::world_file::OriginFile;

/// Describes a world and the player of its ados to the simulator.
pub(super) fn hello(scenario: &Scenario, ado: &str) -> Value {
    let world = scenario.world();
    let clock = world.clock();
    let actions = (0..world.spaces().actions).map(|action| {
        json!({
            "label": world.action_label(action),
            "ados": actions_of(world, action),
        })
    });
    let rules = scenario
        .rules()
        .iter()
        .map(|rule| json!({ "name": rule.name, "stl": rule.formula.to_string() }));
    let drive = drive(world);
    let (signals, constants) = derivation(world);
    json!({
        "protocol": PROTOCOL,
        "program": concat!("brakecheck ", env!("CARGO_PKG_VERSION")),
        "world": scenario.name(),
        "ado": ado,
        "origin": scenario.origin.as_ref().map(origin),
        "sample_s": clock.sample_s,
        "decision_s": clock.decision_s,
        "horizon_s": clock.horizon_s,
        "observe": observed(world),
        "derived": derived(signals),
        // Expressions of derived signals use them, and a simulator may compute these
        // itself.
        "constants": constants,
        "agents": drive.map(agents),
        "ego_spec": scenario.ego_spec().to_string(),
        "rules": rules.collect::<Vec<_>>(),
        "actions": actions.collect::<Vec<_>>(),
        "neutral": world.spaces().neutral,
    })
}

/// Returns the pose of the world's origin in its road file, with every field.
fn origin(origin: &OriginFile) -> Value {
    json!({
        "file": origin.file, "x_m": origin.x_m, "y_m": origin.y_m, "z_m": origin.z_m,
        "heading_rad": origin.heading_rad,
    })
}

fn drive(world: &World) -> Option<&DriveSpec> {
    match world {
        World::Drive(world) => Some(world.spec()),
        // A grid has no agents with bodies that a simulator could move.
        World::Grid(_) => None,
    }
}

/// Returns the observed signals with their ranges.
fn observed(world: &World) -> Vec<Value> {
    let signals = world.signals();
    let observed = world.observed().iter().map(|observed| {
        let mut known = signals.iter().map(|(signal, _)| signal);
        let signal = known.find(|signal| signal.name == observed.name);
        json!({
            "name": observed.name,
            "unit": signal.map(|signal| &signal.unit),
            "about": signal.map(|signal| &signal.about),
            "low": observed.mid - observed.half,
            "high": observed.mid + observed.half,
        })
    });
    observed.collect()
}

/// Returns the derived signals of a world, and the constants of their expressions.
fn derivation(world: &World) -> (&[Derived], &IndexMap<String, f64>) {
    match world {
        World::Drive(world) => (&world.spec().derived[..], &world.spec().constants),
        World::Grid(world) => (&world.spec().derived[..], &world.spec().constants),
    }
}

/// Describes the signals that the world computes from others, with their expressions.
fn derived(signals: &[Derived]) -> Vec<Value> {
    let derived = signals.iter().map(|derived| {
        json!({
            "name": derived.signal.name,
            "unit": derived.signal.unit,
            "expr": derived.expr.to_string(),
        })
    });
    derived.collect()
}

/// Returns the agents with the sizes of their bodies.
fn agents(spec: &DriveSpec) -> Vec<Value> {
    let agents = spec.agents.iter().map(|agent| {
        let role = match agent.drive {
            Drive::Ego => "ego",
            Drive::Ado { .. } => "ado",
            // No action of the served ados moves these, whoever trained them.
            Drive::Trained(_) | Drive::Scripted(_) | Drive::Planned(_) => "traffic",
        };
        let body = &agent.body;
        json!({
            "name": agent.name, "role": role, "on_foot": body.is_on_foot(),
            "length_m": body.length_m, "width_m": body.width_m, "height_m": body.height_m,
        })
    });
    agents.collect()
}

/// Returns the given signals as numbers, and the derived ones that they determine.
///
/// # Errors
/// A value is neither a number nor a truth value.
pub(super) fn with_derived(
    scenario: &Scenario,
    given: &IndexMap<String, Value>,
) -> Result<IndexMap<String, f64>, String> {
    let world = scenario.world();
    let mut known = IndexMap::new();
    let schema = world.schema();
    let names: Vec<&str> = schema.signals().iter().map(|it| it.name.as_str()).collect();
    // An unknown column stays 0, and no expression with an unknown signal is evaluated.
    let mut row = vec![0.0; names.len()];
    let position = |name: &str| names.iter().position(|it| *it == name);
    let observed = |name: &str| world.observed().iter().any(|it| it.name == name);
    for (name, value) in given {
        let column = position(name);
        // Other keys are ignored, whatever they are.
        if column.is_none() && !observed(name) {
            continue;
        }
        let value = number(name, value)?;
        if let Some(column) = column {
            row[column] = value;
        }
        known.insert(name.clone(), value);
    }
    let bound = match world {
        World::Drive(drive) => drive.derived_exprs(),
        World::Grid(grid) => grid.derived_exprs(),
    };
    let (signals, constants) = derivation(world);
    // A derived signal may read those before it.
    for (derived, bound) in signals.iter().zip(bound) {
        let name = derived.signal.name.as_str();
        let mut reads = derived.expr.signals().into_iter();
        let is_known = |it: &str| known.contains_key(it) || constants.contains_key(it);
        // The simulator may compute a derived signal itself, and its value counts then.
        if known.contains_key(name) || !reads.all(is_known) {
            continue;
        }
        let value = bound.eval(&row);
        if let Some(column) = position(name) {
            row[column] = value;
        }
        known.insert(name.to_owned(), value);
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::Aftermath;

    #[test]
    fn derived_signals_of_a_grid_follow_from_the_given_ones() {
        let scenario = Scenario::shipped("grid").expect("shipped").expect("sound");
        let mut bench = scenario.bench();
        let key = StartKey {
            purpose: Purpose::Test,
            seed: 0,
            index: 0,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        bench.begin(&start, noise, Aftermath::Skip);
        let value = |name: &str| bench.trace().signal(name).expect("published")[0];
        let (derived, _) = derivation(scenario.world());
        let is_derived = |name: &str| derived.iter().any(|it| it.signal.name == name);
        let schema = scenario.world().schema();
        let names = schema.signals().iter().map(|it| it.name.clone());
        let given: IndexMap<String, Value> = names
            .filter(|name| !is_derived(name))
            .map(|name| (name.clone(), json!(value(&name))))
            .collect();
        let known = with_derived(&scenario, &given).expect("numbers");
        assert!(!derived.is_empty());
        for derived in derived {
            let name = derived.signal.name.as_str();
            assert_eq!(known.get(name), Some(&value(name)), "{name}");
        }
    }
}
