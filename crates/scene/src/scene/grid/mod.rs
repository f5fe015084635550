//! The grid world of the paper's Sections I and V-A, assembled from data.
//!
//! An ego flees over an n×n map and an ado pursues it. Both move at once.
//! Details that the paper leaves open are fields of the world file: readings A
//! and B of docs/background/paper.md differ in the ego's behaviour at a wall ([`AtWall`]).
//!
//! The map is small enough for an exact solution: `grid_solver`
//! computes the best ado.

mod arena;
mod signals;
mod spec;

use std::sync::Arc;

use rand::RngExt;

pub use arena::{Arena, AtWall, Cell, Position};
pub use spec::position;
pub use spec::{GridSpec, Horizon, Starts, position_of, start_of};

use super::drive::SceneError;
use super::{
    AgentDescription, Axis, Clock, ContactEvent, Frame, Role, Scene, SceneGeometry, Start,
    StepOutcome,
};
use crate::rl::Spaces;
use crate::seed::StartKey;
use crate::sim::{BodyShape, Placement};
use crate::stl::BoundExpr;
use crate::trace::{Schema, SchemaError};
use signals::{PositionHistory, Source};

/// An assembled grid world: builds scenes that share all fixed data.
#[derive(Clone)]
pub struct GridWorld(Arc<GridLayout>);

struct GridLayout {
    spec: GridSpec,
    clock: Clock,
    schema: Arc<Schema>,
    sources: Vec<Source>,
    derived: Vec<BoundExpr>,
    observed: Vec<(usize, f64, f64)>,
    axes: Vec<Axis>,
    spaces: Spaces,
}

/// A grid scene in motion.
#[derive(Clone)]
pub struct GridScene {
    layout: Arc<GridLayout>,
    moment: PositionHistory,
    action: usize,
}

/// Returns the schema of a spec's traces: published signals, then derived ones.
///
/// # Errors
/// Two signals have the same name.
pub(crate) fn schema_of(spec: &GridSpec) -> Result<Schema, SchemaError> {
    let published = spec.published().into_iter().map(|offer| offer.signal);
    let derived = spec.derived.iter().map(|derived| derived.signal.clone());
    Schema::new(spec.clock().sample_s, published.chain(derived))
}

impl GridWorld {
    /// Assembles a world.
    ///
    /// # Errors
    /// Two signals share a name, or an expression or observation does not bind.
    pub fn new(spec: GridSpec) -> Result<GridWorld, SceneError> {
        let schema = schema_of(&spec)?;
        let bind = |derived: &super::Derived| {
            let bound = derived.expr.bind(&schema, &spec.constants);
            bound.map_err(|source| SceneError::Derived {
                name: derived.signal.name.clone(),
                source: Box::new(source),
            })
        };
        let derived = spec.derived.iter().map(bind).collect::<Result<_, _>>()?;
        let find = |observed: &super::Observed| match schema.position(&observed.name) {
            // The reciprocal, so that observations have the bits of
            // `Observed::scaled`.
            Some(position) => Ok((position, observed.mid, 1.0 / observed.half)),
            None => Err(SceneError::Observed {
                name: observed.name.clone(),
            }),
        };
        let observed: Vec<_> = spec.observe.iter().map(find).collect::<Result<_, _>>()?;
        Ok(GridWorld(Arc::new(GridLayout {
            clock: spec.clock(),
            schema: Arc::new(schema),
            sources: spec.published().iter().map(|offer| offer.source).collect(),
            derived,
            axes: spec.axes(),
            spaces: Spaces {
                observation: observed.len(),
                actions: spec.moves.len(),
                neutral: spec.neutral,
                parts: Vec::new(),
            },
            observed,
            spec,
        })))
    }

    /// Returns the spec it was assembled from.
    pub fn spec(&self) -> &GridSpec {
        &self.0.spec
    }

    /// Returns the clocks.
    pub fn clock(&self) -> &Clock {
        &self.0.clock
    }

    /// Returns the schema of the published signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.0.schema
    }

    /// Returns the expressions of the derived signals, bound to the rows of this world.
    pub fn derived_exprs(&self) -> &[BoundExpr] {
        &self.0.derived
    }

    /// Returns the shapes of the ado's observation and action.
    pub fn spaces(&self) -> &Spaces {
        &self.0.spaces
    }

    /// Returns a scene at rest. Call `reset` before use.
    pub fn scene(&self) -> GridScene {
        let corner = Cell { x: 0, y: 0 };
        let both = Position {
            ego: corner,
            ado: corner,
        };
        GridScene {
            layout: Arc::clone(&self.0),
            moment: PositionHistory {
                now: both,
                before: both,
                step: 0,
                steps: self.spec().steps(),
            },
            action: self.spec().neutral,
        }
    }

    /// Marks the observed numbers that follow from the current position alone.
    ///
    /// Times and speeds do not. A derived signal does if all signals in it do.
    pub fn positional(&self) -> Vec<bool> {
        let spec = self.spec();
        let offers = spec.catalogue();
        let plain = |name: &str| {
            let mut found = offers.iter().filter(|offer| offer.signal.name == name);
            found
                .next()
                .is_some_and(|offer| offer.source.is_positional())
        };
        let mut known: Vec<(&str, bool)> = Vec::new();
        for derived in &spec.derived {
            let of = |name: &str| {
                // Derived signals may use earlier ones, which take precedence
                // by name.
                let earlier = known.iter().find(|(other, _)| *other == name);
                earlier.map_or_else(|| plain(name), |(_, positional)| *positional)
            };
            let positional = derived.expr.signals().into_iter().all(of);
            known.push((&derived.signal.name, positional));
        }
        let observed = spec.observe.iter().map(|observed| {
            let derived = known.iter().find(|(name, _)| *name == observed.name);
            derived.map_or_else(|| plain(&observed.name), |(_, positional)| *positional)
        });
        observed.collect()
    }
}

impl GridScene {
    /// Writes the ado's observation at a position after `step` steps.
    ///
    /// Both agents count as having stood still in the step before.
    pub fn observe_at(&mut self, both: Position, step: u32, obs: &mut [f32]) {
        let mut row = vec![0.0; self.layout.schema.len()];
        self.place(both);
        self.moment.step = step;
        self.publish(&mut row);
        self.observe(&row, obs);
    }

    /// Writes the sample after `step` steps, of which the last led from `before` to `now`.
    pub fn sample_at(&mut self, [before, now]: [Position; 2], step: u32, row: &mut [f64]) {
        self.moment.before = before;
        self.moment.now = now;
        self.moment.step = step;
        self.publish(row);
    }

    /// Places both agents at t = 0.
    fn place(&mut self, both: Position) {
        self.moment.now = both;
        self.moment.before = both;
        self.moment.step = 0;
    }

    fn touch(&self) -> ContactEvent {
        let arena = &self.layout.spec.arena;
        let Position { ego, ado } = self.moment.now;
        let apart = |both: Position| f64::from(both.ego.manhattan(both.ado));
        let closed = apart(self.moment.before) - apart(self.moment.now);
        let middle = |a: i32, b: i32| (f64::from(a + b) / 2.0 + 0.5) / f64::from(arena.refine);
        ContactEvent {
            between: ("ego".to_owned(), "ado".to_owned()),
            time_s: f64::from(self.moment.step),
            closing_speed_mps: closed / f64::from(arena.refine),
            // The middle between both cells: they need not be equal on a
            // refined map.
            point_m: [middle(ego.x, ado.x), middle(ego.y, ado.y), 0.0],
            impact: None,
        }
    }
}

impl Scene for GridScene {
    fn schema(&self) -> &Arc<Schema> {
        &self.layout.schema
    }

    fn spaces(&self) -> &Spaces {
        &self.layout.spaces
    }

    fn clock(&self) -> &Clock {
        &self.layout.clock
    }

    fn axes(&self) -> &[Axis] {
        &self.layout.axes
    }

    fn draw(&self, key: StartKey) -> Start {
        let spec = &self.layout.spec;
        let mut rng = key.generator(&spec.world, "start");
        // A world with listed starts draws from its list only, so that no
        // episode begins outside X_init.
        if let Starts::Pairs(pairs) = &spec.starts
            && !pairs.is_empty()
        {
            let (ego, ado) = pairs[rng.random_range(0..pairs.len())];
            return start_of(position(ego, ado));
        }
        let mut cell = || spec.arena.cell(rng.random_range(0..spec.arena.cells()));
        loop {
            let both = Position {
                ego: cell(),
                ado: cell(),
            };
            // Invariant: a map has at least two cells a side, so this ends.
            if !spec.arena.touching(both) {
                return start_of(both);
            }
        }
    }

    fn reset(&mut self, start: &Start, _noise: u64) {
        let both = position_of(start, &self.layout.spec.arena);
        self.place(both);
        self.action = self.layout.spec.neutral;
    }

    fn decide(&mut self, action: usize) {
        self.action = action;
    }

    fn advance(&mut self) -> StepOutcome {
        let spec = &self.layout.spec;
        let next = spec.arena.next(self.moment.now, spec.moves[self.action]);
        self.moment.before = self.moment.now;
        self.moment.now = next;
        self.moment.step += 1;
        if spec.arena.touching(next) {
            StepOutcome::Contact(self.touch())
        } else {
            StepOutcome::Going
        }
    }

    fn publish(&self, row: &mut [f64]) {
        let layout = &self.layout;
        for (value, source) in row.iter_mut().zip(&layout.sources) {
            *value = self.moment.value(&layout.spec.arena, *source);
        }
        // A derived signal may mention earlier derived ones, so they are
        // evaluated in order into the same row.
        let published = layout.sources.len();
        for (i, expr) in layout.derived.iter().enumerate() {
            row[published + i] = expr.eval(row);
        }
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        for (value, &(position, mid, per_half)) in obs.iter_mut().zip(&self.layout.observed) {
            // The one cast from signals to observations (see ARCHITECTURE.md).
            *value = ((row[position] - mid) * per_half) as f32;
        }
    }

    fn stage(&self) -> SceneGeometry {
        let arena = &self.layout.spec.arena;
        let side = 1.0 / f64::from(arena.refine);
        let agent = |name: &str, role| AgentDescription {
            name: name.to_owned(),
            role,
            body: "cell".to_owned(),
            size_m: [side; 3],
            shape: BodyShape::Box,
            colour: [128; 3],
            on_foot: false,
        };
        let size = f64::from(arena.size);
        let lines = (0..=arena.size).map(f64::from).flat_map(|at| {
            let across = vec![[0.0, at, 0.0], [size, at, 0.0]];
            let along = vec![[at, 0.0, 0.0], [at, size, 0.0]];
            [across, along]
        });
        SceneGeometry {
            agents: vec![agent("ego", Role::Ego), agent("ado", Role::Ado)],
            lane_borders_m: lines.collect(),
            side_roads_m: Vec::new(),
            lights: Vec::new(),
        }
    }

    fn frame(&self) -> Frame {
        let side = 1.0 / f64::from(self.layout.spec.arena.refine);
        let placement = |cell: Cell| {
            let [x_m, y_m] = [cell.x, cell.y].map(|at| (f64::from(at) + 0.5) * side);
            Placement::upright([x_m, y_m, side / 2.0], 0.0)
        };
        let Position { ego, ado } = self.moment.now;
        Frame {
            placements: vec![placement(ego), placement(ado)],
            phases: Vec::new(),
            seen: None,
        }
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(self.clone()))
    }
}
