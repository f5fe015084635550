//! Changed grid worlds: another map, another horizon, or an ado that observes all.

use std::sync::Arc;

use super::grid::fits;
use super::language::{Judging, rulebook};
use super::{Change, ChangeError, GridScenario, Scenario};
use crate::scene::grid::{GridSpec, GridWorld};
use crate::scene::{Observed, World};

/// Returns the spec after a change, with T for the new horizon.
///
/// # Errors
///
/// Returns an error for a field of driving worlds, and for values that make no
/// game.
fn apply(spec: &GridSpec, change: &Change) -> Result<GridSpec, ChangeError> {
    let fail = |what: String, help: Option<String>, field: &str| ChangeError {
        what,
        help,
        place: vec![field.to_owned()],
    };
    // Fields of driving worlds are refused by name instead of being ignored.
    let driving = [
        ("ego", !change.ego.0.is_empty()),
        ("controller", change.controller.is_some()),
        ("ego_body", change.ego_body.is_some()),
        ("friction", change.friction.is_some()),
        ("plant", change.plant.is_some()),
        ("sensors", change.sensors.is_some()),
    ];
    if let Some((field, _)) = driving.iter().find(|(_, given)| *given) {
        let help = "a grid has: size, refine, ego_step, at_wall, horizon, starts".to_owned();
        return Err(fail(
            format!("a grid world has no `{field}`"),
            Some(help),
            field,
        ));
    }
    let mut spec = spec.clone();
    let Some(grid) = &change.grid else {
        return Ok(spec);
    };
    let arena = &mut spec.arena;
    arena.size = grid.size.unwrap_or(arena.size);
    arena.refine = grid.refine.unwrap_or(arena.refine);
    arena.ego_step = grid.ego_step.unwrap_or(arena.ego_step);
    arena.at_wall = grid.at_wall.unwrap_or(arena.at_wall);
    spec.horizon = grid.horizon.unwrap_or(spec.horizon);
    if let Some(starts) = &grid.starts {
        spec.starts = starts.clone();
    }
    // Checked after all fields are set, because their limits depend on each
    // other.
    fits(&spec).map_err(|misfit| fail(misfit.what, misfit.help, misfit.field))?;
    spec.constants
        .insert("T".to_owned(), f64::from(spec.steps()));
    Ok(spec)
}

impl Scenario {
    /// Returns the grid world with a change, and its formulas bound again.
    ///
    /// # Errors
    ///
    /// Returns an error if the change, or the formulas after it, do not fit.
    pub(super) fn with_grid(
        &self,
        world: &GridWorld,
        change: &Change,
    ) -> Result<Scenario, ChangeError> {
        let spec = apply(world.spec(), change)?;
        // Formulas contain T, which follows from the horizon.
        let mut names = self.names.clone();
        names.constants = spec.constants.clone();
        let misfit = |what: String| ChangeError {
            what,
            help: Some("formulas are bound anew to the changed horizon".to_owned()),
            place: vec!["horizon".to_owned()],
        };
        let world = GridWorld::new(spec).map_err(|error| misfit(error.to_string()))?;
        let rulebook = rulebook(
            world.schema(),
            &self.ego_spec,
            &self.rules,
            &names,
            Judging {
                judge: self.rulebook.judge,
                counts: self.rulebook.counts.clone(),
                reward: self.rulebook.reward,
            },
        );
        Ok(Scenario {
            rulebook: Arc::new(rulebook.map_err(|error| misfit(error.to_string()))?),
            world: World::Grid(world),
            names,
            ..self.clone()
        })
    }
}

impl GridScenario<'_> {
    /// Returns the world with an ado that observes both positions and the time left.
    ///
    /// The shipped ados observe a window. The optimal ado of a larger map
    /// requires the complete map.
    pub fn fully_observed(self) -> Scenario {
        let mut spec = self.world().spec().clone();
        // Positions are scaled to −1 ..= 1 over the map.
        let half = f64::from(spec.arena.size) / 2.0;
        let half_time = f64::from(spec.steps()) / 2.0;
        let names = [
            ("ego.x", half),
            ("ego.y", half),
            ("ado.x", half),
            ("ado.y", half),
            ("time_left", half_time),
        ];
        let observe = names.map(|(name, half)| Observed {
            name: name.to_owned(),
            mid: half,
            half,
        });
        spec.observe = observe.into();
        // Invariant: every grid publishes both positions and the time left.
        let world = GridWorld::new(spec);
        assert!(world.is_ok(), "they are signals of every grid");
        Scenario {
            world: World::Grid(world.unwrap_or_else(|_| self.world().clone())),
            ..Scenario::clone(&self)
        }
    }
}
