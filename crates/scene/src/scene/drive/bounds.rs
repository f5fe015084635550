//! Static bounds of the signals of a driving scene.

use super::signals::schema_of;
use super::spec::DriveSpec;
use crate::stl::Interval;

/// Bounds of a signal before any episode runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Interval that contains the signal in every run.
    pub range: Interval,
    /// True if no ado can change the signal.
    pub untouched: bool,
}

impl DriveSpec {
    /// Returns the bounds of each signal, in the order of the schema.
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
            // Signals derived later are not bounded yet and may take any value.
            let mut ranges: Vec<Interval> = bounds.iter().map(|known| known.range).collect();
            ranges.resize(schema.len(), Interval::ANY);
            let bound = derived.expr.bind(&schema, &self.constants);
            // Binding errors are reported when the world is assembled. An
            // unbounded range is safe here.
            let range = bound.map_or(Interval::ANY, |expr| expr.range(&ranges));
            let names = derived.expr.signals();
            let mut positions = names.iter().filter_map(|name| schema.position(name));
            let untouched = positions.all(|i| bounds.get(i).is_some_and(|known| known.untouched));
            bounds.push(Bounds { range, untouched });
        }
        bounds
    }
}
