//! Conversion from rows of signals to observations.

use crate::scene::Observed;
use crate::trace::Schema;

/// Observed signals of a row, with their scales.
#[derive(Clone, Debug)]
pub struct Observation(Vec<Scaled>);

/// An observed signal: `(value − mid) · per_half`.
#[derive(Clone, Copy, Debug)]
struct Scaled {
    position: usize,
    mid: f64,
    per_half: f64,
}

impl Observation {
    /// Binds the observed signals to rows of a schema.
    ///
    /// # Errors
    /// The name of the first signal that the schema lacks.
    pub(super) fn bind<'a>(
        observed: &'a [Observed],
        schema: &Schema,
    ) -> Result<Observation, &'a str> {
        let scaled = observed.iter().map(|observed| {
            let position = schema.position(&observed.name);
            Ok(Scaled {
                position: position.ok_or(observed.name.as_str())?,
                mid: observed.mid,
                per_half: observed.per_half(),
            })
        });
        scaled.collect::<Result<_, _>>().map(Observation)
    }

    /// Returns the positions of the observed signals in a row.
    pub fn positions(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|scaled| scaled.position)
    }

    /// Returns the number of observed signals.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Writes the observation of a row, given as its value at each position.
    #[inline]
    pub fn read(&self, row: impl Fn(usize) -> f64, obs: &mut [f32]) {
        for (value, scaled) in obs.iter_mut().zip(&self.0) {
            // The one cast from signals to observations (see ARCHITECTURE.md).
            *value = ((row(scaled.position) - scaled.mid) * scaled.per_half) as f32;
        }
    }
}
