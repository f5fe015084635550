//! Worlds: their content and their egos.

use std::path::PathBuf;

use brakecheck::experiment::{in_named_traffic, on_plant};
use brakecheck::scene::World;
use brakecheck::serving::actions_of;
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck::world_file::{self, WorldFile};
use pyo3::prelude::*;
use serde_json::json;

use crate::convert::objects;
use crate::ego::egos;
use crate::error::{failed, raised, wrong};

/// Checked world of `brakecheck.World`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
#[derive(Clone)]
pub(crate) struct RawWorld(pub(crate) Scenario);

/// Returns the plant of a name: 3D and rigid, or 2D in closed form.
pub(crate) fn plant_of(word: &str) -> PyResult<PlantKind> {
    word.parse().map_err(|_| {
        wrong(
            format!("`plant={word:?}` is not known"),
            "known: kinematic, rigid",
        )
    })
}

#[pymethods]
impl RawWorld {
    /// Reads a world file, or takes a shipped world by its name.
    #[staticmethod]
    fn load(file: PathBuf, allow_programs: bool) -> PyResult<RawWorld> {
        let world = Scenario::find(&file).map_err(failed)?;
        Ok(RawWorld(world.allow_programs(allow_programs)))
    }

    /// Checks the text of a world file.
    #[staticmethod]
    fn parse(name: &str, text: &str) -> PyResult<RawWorld> {
        Ok(RawWorld(Scenario::parse(name, text).map_err(failed)?))
    }

    /// Returns the text of a world from JSON in the form of the schema.
    #[staticmethod]
    fn text_of(value: &str) -> PyResult<String> {
        let world: WorldFile = serde_json::from_str(value).map_err(|error| {
            wrong(
                format!("the value is no world: {error}"),
                "`brakecheck check --schema` prints the form of worlds",
            )
        })?;
        let text = world_file::text(&world);
        text.map_err(|error| raised("FaultError", error.to_string()))
    }

    /// Returns the world as JSON in the form of the schema, in the order of the file.
    fn value(&self) -> PyResult<String> {
        let world = world_file::parse(self.0.name(), self.0.text()).map_err(failed)?;
        serde_json::to_string(&world).map_err(|error| raised("FaultError", error.to_string()))
    }

    /// Returns the names of the shipped worlds.
    #[staticmethod]
    fn shipped() -> Vec<&'static str> {
        Scenario::shipped_names().collect()
    }

    /// Returns the same world on another plant, or with another ego.
    fn with_parts(
        &self,
        plant: Option<&str>,
        ego: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<RawWorld> {
        let mut world = self.0.clone();
        if let Some(plant) = plant {
            world = on_plant(&world, plant_of(plant)?).map_err(failed)?;
        }
        match &egos(&world, ego)?[..] {
            [one] => Ok(RawWorld(one.scenario().clone())),
            _ => Err(wrong("`all` is more than one ego", "name one of them")),
        }
    }

    /// Returns the same world in a traffic model, with a limit on the rarity of its ados.
    fn in_traffic(&self, traffic: Option<&str>, natural: Option<f64>) -> PyResult<RawWorld> {
        // Written so that NaN is refused, too.
        if natural.is_some_and(|rate| !(rate > 0.0 && rate.is_finite())) {
            return Err(wrong(
                format!("`natural={natural:?}` is no rate"),
                "a rate per 1,000 km is a number above 0",
            ));
        }
        let world = in_named_traffic(&self.0, traffic).map_err(failed)?;
        Ok(RawWorld(match natural {
            Some(rate) => world.naturally(rate),
            None => world,
        }))
    }

    /// Returns the text of the file.
    #[getter]
    fn text(&self) -> &str {
        self.0.text()
    }

    /// Returns its description, as `check --json` would.
    fn about<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let world = &self.0;
        let clock = world.world().clock();
        let signals: Vec<_> = world.signals();
        // Observations carry no unit, so it is that of the signal of their name.
        let unit = |name: &str| {
            let found = signals.iter().find(|(signal, _)| signal.name == name);
            found.map_or(String::new(), |(signal, _)| signal.unit.to_string())
        };
        let observed = world.world().observed().iter().map(|observed| {
            json!({
                "name": observed.name, "unit": unit(&observed.name),
                "low": observed.mid - observed.half, "high": observed.mid + observed.half,
            })
        });
        let start_axes = world.axes();
        let axes = start_axes.iter().map(
            |axis| json!({ "name": axis.name, "unit": axis.unit, "low": axis.lo, "high": axis.hi }),
        );
        let spaces = world.world().spaces();
        let listed = signals.iter().map(|(signal, held)| {
            json!({
                "name": signal.name, "unit": signal.unit, "about": signal.about,
                "kind": signal.kind, "held": held.word(),
            })
        });
        let rules = world.rules().iter().map(|rule| {
            json!({
                "name": rule.name, "ado": rule.ado, "priority": rule.priority,
                "formula": rule.formula.to_string(), "requirement": rule.requirement,
            })
        });
        let warnings = world.warnings().iter().map(|warning| &warning.what);
        objects(
            py,
            &json!({
                "name": world.name(), "question": world.question(), "source": world.source(),
                "plant": world.plant(), "ego_spec": world.ego_spec().to_string(),
                "rules": rules.collect::<Vec<_>>(), "egos": world.reuse().keys().collect::<Vec<_>>(),
                "learners": world.learners().keys().collect::<Vec<_>>(),
                "observation": observed.collect::<Vec<_>>(),
                "actions": (0..spaces.actions).map(|a| world.action_label(a)).collect::<Vec<_>>(),
                "commands": (0..spaces.actions).map(|a| actions_of(world.world(), a)).collect::<Vec<_>>(),
                "neutral": spaces.neutral, "ados": ados(world), "axes": axes.collect::<Vec<_>>(),
                "signals": listed.collect::<Vec<_>>(), "warnings": warnings.collect::<Vec<_>>(),
                "horizon_s": clock.horizon_s, "decision_s": clock.decision_s,
                "sample_s": clock.sample_s, "decisions": clock.decisions(),
                "own_ego": world.own_ego(),
            }),
        )
    }
}

/// Returns every ado with its own actions, in the order of a joint action. The first
/// ado counts fastest.
fn ados(world: &Scenario) -> Vec<serde_json::Value> {
    match world.world() {
        World::Drive(drive) => {
            let sets = drive.spec().action_sets().map(|(name, actions, neutral)| {
                let labels: Vec<_> = (0..actions.len()).map(|a| actions.label(a)).collect();
                json!({ "name": name, "actions": labels, "neutral": neutral })
            });
            sets.collect()
        }
        World::Grid(grid) => {
            let spaces = grid.spaces();
            let labels: Vec<_> = (0..spaces.actions).map(|a| world.action_label(a)).collect();
            vec![json!({ "name": "ado", "actions": labels, "neutral": spaces.neutral })]
        }
    }
}
