//! Worlds that can be laid out as a structure of arrays.

use std::sync::Arc;

use crate::rulebook::{Rulebook, RunsJudge};
use crate::scene::World;
use crate::scene::drive::{Agent, Drive, DriveLayout, SignalReading};
use crate::sim::{Ground, PlantKind};
use crate::world::Scenario;

/// Signal that somebody reads.
#[derive(Clone, Copy)]
pub(super) struct PublishedSignal {
    /// Position in a row.
    pub(super) position: usize,
    pub(super) source: SignalReading,
    /// True for the gap of two bodies, which the plant measures.
    pub(super) is_gap: bool,
}

/// Data of a world that all of its environments share.
#[derive(Clone)]
pub(super) struct LaneWorld {
    pub(super) layout: Arc<DriveLayout>,
    pub(super) rulebook: Arc<Rulebook>,
    /// Signals that somebody reads.
    pub(super) published: Vec<PublishedSignal>,
    /// Positions of the signals that have to be finite, derived ones included.
    pub(super) checked: Vec<usize>,
    pub(super) ground: Ground,
    /// Samples of a full episode.
    pub(super) samples: usize,
    pub(super) samples_per_decision: usize,
}

/// Quantities that are finite in every sound run.
///
/// Others are checked for it at every sample, even if nobody reads them.
const ALWAYS_FINITE: [&str; 6] = ["time_left", "contact", "x", "y", "heading", "speed"];

impl LaneWorld {
    /// Returns the data of a world, `None` if it needs test benches.
    ///
    /// `rows` has the positions of signals that rows contain besides.
    pub(super) fn of(world: &Scenario, rows: &[usize]) -> Option<LaneWorld> {
        let World::Drive(drive) = world.world() else {
            return None;
        };
        let layout = Arc::clone(&drive.0);
        let rulebook = Arc::new(world.rulebook().clone());
        let samples = layout.spec.clock.samples();
        // A limit depends on the course of the episode, which test benches follow.
        let is_limited = world.traffic().limit().is_some();
        let fits = !is_limited && has_constant_surroundings(&layout) && has_only_vehicles(&layout);
        // Rulebooks that judge whole traces have no judge of runs.
        if !fits || RunsJudge::new(&rulebook, samples, 1).is_none() {
            return None;
        }
        let published = published(&layout, &rulebook, rows);
        // Arithmetic on finite signals may give NaN or ∞, so every derived one is
        // checked.
        let derived = layout.sources.len()..layout.schema.len();
        let checked = published.iter().map(|it| it.position);
        Some(LaneWorld {
            checked: checked.chain(derived).collect(),
            published,
            ground: Ground {
                friction: layout.spec.road.friction(),
            },
            samples,
            samples_per_decision: layout.spec.clock.samples_per_decision(),
            rulebook,
            layout,
        })
    }
}

/// Returns whether nothing but the vehicles changes, and no start changes the world.
fn has_constant_surroundings(layout: &DriveLayout) -> bool {
    let spec = &layout.spec;
    // Rigid bodies are rapier's, which steps one world at a time.
    spec.plant == PlantKind::Kinematic
        && spec.lights.is_empty()
        && spec.weather.is_none()
        && spec.road_ado.is_none()
        && !spec.has_slopes()
        && spec.wind.is_none()
        && spec.environment.is_empty()
        && spec.parameters.is_empty()
}

/// Returns whether all road users are vehicles, without plans and trained ados, and
/// the ego is one of this crate.
fn has_only_vehicles(layout: &DriveLayout) -> bool {
    let spec = &layout.spec;
    let is_simple = |agent: &Agent| {
        let drives = match &agent.drive {
            Drive::Ego => true,
            Drive::Ado { base, .. } => base.is_none(),
            Drive::Scripted(script) => !script.is_on_foot(),
            Drive::Planned(_) | Drive::Trained(_) => false,
        };
        drives && agent.body.vehicle().is_some()
    };
    spec.agents.iter().all(is_simple) && !spec.ego.is_foreign()
}

/// Returns the signals that rules, expressions or the observation read.
fn published(layout: &DriveLayout, rulebook: &Rulebook, rows: &[usize]) -> Vec<PublishedSignal> {
    let mut read = vec![false; layout.schema.len()];
    let rules = rulebook.rules.iter().map(|rule| &rule.monitor);
    let formulas = rules.chain([&rulebook.spec]);
    let derived = layout.derived.iter().flat_map(|expr| expr.signals());
    let all = formulas.flat_map(|monitor| monitor.signals());
    let in_rows = rows.iter().copied();
    for signal in all
        .chain(derived)
        .chain(layout.observed.positions())
        .chain(in_rows)
    {
        read[signal] = true;
    }
    let sources = layout.sources.iter().copied().enumerate();
    let published = sources.map(|(position, source)| PublishedSignal {
        position,
        source,
        is_gap: source.quantity.name == "gap",
    });
    let is_needed = |it: &PublishedSignal| {
        read[it.position] || !ALWAYS_FINITE.contains(&it.source.quantity.name)
    };
    published.filter(is_needed).collect()
}
