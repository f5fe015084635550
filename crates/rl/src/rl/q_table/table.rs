//! Action values by cell.

use std::collections::BTreeMap;

use super::settings::{Bins, QTableSettings};
use crate::rl::bundle::{BundleError, TensorFile};
use crate::rl::learner::LearnerKind;
use crate::rl::replay::check;

/// Cells in lexicographic order of their indices, with a row for each.
///
/// A sorted map, so that the order of visits never reaches the bytes.
pub(super) type CellRows = BTreeMap<Box<[u32]>, usize>;

/// Action values of every visited cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) observation: usize,
    pub(super) actions: usize,
    pub(super) neutral: usize,
    pub(super) bins: Vec<Bins>,
    pub(super) rows: CellRows,
    pub(super) values: Vec<f32>,
}

impl Table {
    /// Computes the cell of an observation.
    pub(super) fn cell(&self, obs: &[f32], cell: &mut Vec<u32>) {
        cell.clear();
        for (i, value) in obs.iter().enumerate() {
            // The last bins count for all further components, so that one entry serves all.
            let bins = self.bins[i.min(self.bins.len() - 1)];
            let share = (f64::from(*value) - bins.low) / (bins.high - bins.low);
            // A cast from float saturates, so numbers below the range fall into cell 0.
            let index = (share * f64::from(bins.count)) as u32;
            cell.push(index.min(bins.count - 1));
        }
    }

    pub(super) fn values(&self, obs: &[f32]) -> Option<&[f32]> {
        let mut cell = Vec::with_capacity(obs.len());
        self.cell(obs, &mut cell);
        let row = *self.rows.get(cell.as_slice())?;
        Some(&self.values[row * self.actions..(row + 1) * self.actions])
    }

    /// Writes rows in the order of their cells, independent of the visits.
    pub(super) fn save(&self, bundle: &mut TensorFile) {
        let cells: Vec<u32> = self.rows.keys().flatten().copied().collect();
        bundle.put("cells", &[self.rows.len(), self.observation], cells);
        // In the order of the cells, so that equal tables have equal bytes.
        let values = self.in_order(&self.values);
        bundle.put("values", &[self.rows.len(), self.actions], values);
        bundle.put("neutral", &[1], vec![self.neutral as u64]);
        let bins = self
            .bins
            .iter()
            .flat_map(|b| [b.low, b.high, f64::from(b.count)])
            .collect();
        bundle.put("bins", &[self.bins.len(), 3], bins);
    }

    pub(super) fn in_order<T: Copy>(&self, flat: &[T]) -> Vec<T> {
        let rows = self.rows.values();
        rows.flat_map(|row| &flat[row * self.actions..(row + 1) * self.actions])
            .copied()
            .collect()
    }

    pub(super) fn load(bundle: &TensorFile) -> Result<Table, BundleError> {
        let shape = |name: &str| bundle.shape(name).unwrap_or(&[]).to_vec();
        let (n, width) = match shape("cells")[..] {
            // A missing or misshapen tensor fails in `get` below, with its name.
            [n, width] => (n, width),
            _ => (0, 0),
        };
        let actions = shape("values").get(1).copied().unwrap_or(0);
        let cells = bundle.get::<u32>("cells", &[n, width])?;
        let values = bundle.get::<f32>("values", &[n, actions])?.to_vec();
        let neutral = bundle.one::<u64>("neutral")? as usize;
        check("the neutral action", neutral, actions)?;
        let bins: Vec<Bins> = bundle
            .rows::<f64>("bins", &[3])?
            .chunks_exact(3)
            .map(|b| Bins {
                low: b[0],
                high: b[1],
                count: b[2] as u32,
            })
            .collect();
        // Bins of a file are untrusted, so they pass the checks of a world file.
        let config = QTableSettings {
            bins,
            ..QTableSettings::default()
        };
        config.check().map_err(|error| BundleError::Mismatch {
            what: "a bin of the table",
            expected: error.help.clone(),
            found: error.what(),
        })?;
        // `chunks_exact` panics for a width of 0.
        let keys = cells.chunks_exact(width.max(1)).map(Box::from);
        let rows: CellRows = keys.zip(0..n).collect();
        // Repeated cells would leave fewer rows than values.
        if rows.len() != n {
            return Err(BundleError::Mismatch {
                what: "number of different cells",
                expected: n.to_string(),
                found: rows.len().to_string(),
            });
        }
        Ok(Table {
            observation: width,
            actions,
            neutral,
            bins: config.bins,
            rows,
            values,
        })
    }
}
