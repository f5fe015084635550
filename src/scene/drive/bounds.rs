//! What the signals of a driving scene can be, and which no ado can change.

use super::light::LightDrive;
use super::schema_of;
use super::script::Script;
use super::signals::{Between, Field, Lamp, Source, TTC_CAP_S};
use super::spec::{Drive, DriveSpec};
use crate::sim::BodyKind;
use crate::stl::Interval;

/// A signal as it is before anything has happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Between what it stays in any run.
    pub range: Interval,
    /// Whether it is the same whatever the ados do.
    pub untouched: bool,
}

/// Vehicles do not reverse, but may roll back while they settle.
const SLOWEST_MPS: f64 = -1.0;
/// Nobody starts faster than 100 m/s.
const FASTEST_MPS: f64 = 200.0;

impl DriveSpec {
    /// Bounds of each signal, in the order of the schema.
    pub fn bounds(&self) -> Vec<Bounds> {
        let published = self.published();
        let mut bounds: Vec<Bounds> = published
            .iter()
            .map(|offer| Bounds {
                range: self.range_of(offer.source),
                untouched: self.is_untouched(offer.source),
            })
            .collect();
        let Ok(schema) = schema_of(self) else {
            return bounds;
        };
        for derived in &self.derived {
            let mut ranges: Vec<Interval> = bounds.iter().map(|known| known.range).collect();
            ranges.resize(schema.len(), Interval::ANY);
            let bound = derived.expr.bind(&schema, &self.constants);
            let range = bound.map_or(Interval::ANY, |expr| expr.range(&ranges));
            let names = derived.expr.signals();
            let mut positions = names.iter().filter_map(|name| schema.position(name));
            let untouched = positions.all(|i| bounds.get(i).is_some_and(|known| known.untouched));
            bounds.push(Bounds { range, untouched });
        }
        bounds
    }

    fn range_of(&self, source: Source) -> Interval {
        let within = |lo: f64, hi: f64| Interval { lo, hi };
        let horizon_s = self.clock.horizon_s;
        match source {
            Source::Time | Source::TimeLeft => within(0.0, horizon_s),
            Source::Contact => within(0.0, 1.0),
            Source::Agent(i, Field::Speed) => match &self.agents[i].body.kind {
                BodyKind::Vehicle(_) => within(SLOWEST_MPS, FASTEST_MPS),
                BodyKind::Walker(_) => Interval::ANY,
            },
            Source::Agent(_, Field::Lane) => within(0.0, self.road.lanes() as f64 - 1.0),
            Source::Agent(..) => Interval::ANY,
            Source::Pair(_, _, between) => match between {
                Between::Gap | Between::Distance => within(0.0, f64::INFINITY),
                Between::Ttc => within(0.0, TTC_CAP_S),
                Between::Contact => within(0.0, 1.0),
                Between::Headway | Between::Lateral => Interval::ANY,
            },
            Source::Light(_, lamp) => match lamp {
                Lamp::Green | Lamp::Yellow | Lamp::Red => within(0.0, 1.0),
                Lamp::Phase => within(0.0, 2.0),
                Lamp::PhaseTime => within(0.0, horizon_s),
            },
            Source::Line(..) => Interval::ANY,
        }
    }

    fn is_untouched(&self, source: Source) -> bool {
        let agent = |i: usize| match &self.agents[i].drive {
            Drive::Scripted(Script::Idm(_)) => false,
            Drive::Scripted(_) => true,
            Drive::Ego(_) | Drive::Ado { .. } | Drive::Trained(_) => false,
        };
        match source {
            Source::Time | Source::TimeLeft => true,
            Source::Contact => false,
            Source::Agent(i, _) | Source::Line(i, _) => agent(i),
            Source::Pair(i, j, _) => agent(i) && agent(j),
            Source::Light(l, _) => matches!(self.lights[l].drive, LightDrive::Schedule(_)),
        }
    }
}
