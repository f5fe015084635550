//! What the signals of a driving scene can be, and which no ado can change.

use super::signals::schema_of;
use super::spec::DriveSpec;
use crate::stl::Interval;

/// A signal as it is before anything has happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Between what it stays in any run.
    pub range: Interval,
    /// Whether it is the same whatever the ados do.
    pub untouched: bool,
}

impl DriveSpec {
    /// Bounds of each signal, in the order of the schema.
    pub fn bounds(&self) -> Vec<Bounds> {
        let published = self.published();
        let mut bounds: Vec<Bounds> = published
            .iter()
            .map(|offer| Bounds {
                range: offer.source.range(self),
                untouched: offer.source.is_untouched(self),
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
}
