//! Archive of failures: the worst known failure of every cell (MAP-Elites).
//!
//! Mouret and Clune, "Illuminating search spaces by mapping elites", arXiv:1504.04909,
//! 2015. An archived failure is a start of a training and the ados' actions from it, so
//! it is played again bit for bit.

use std::collections::BTreeMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::experiment::descending;
use crate::run_dir::{CellCount, FailureCell};

/// Known failures of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArchivedFailure {
    /// Cell of the failure.
    pub cell: FailureCell,
    /// Index of its start in the stream of training starts.
    pub index: u64,
    /// Actions of the ados, of which the last is held.
    pub actions: Vec<usize>,
    /// Contact, injury risk, closing speed in m/s and depth of the violation.
    pub severity: [f64; 4],
    /// Number of failures that were seen in the cell.
    pub failures: u64,
}

/// Archive of the worst failure of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FailureArchive {
    cells: BTreeMap<FailureCell, ArchivedFailure>,
    failures: u64,
}

impl FailureArchive {
    /// Returns the number of occupied cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Returns whether no cell is occupied.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Returns the number of failures that were inserted.
    pub fn failures(&self) -> u64 {
        self.failures
    }

    /// Returns the failures in the order of their cells.
    pub fn iter(&self) -> impl Iterator<Item = &ArchivedFailure> {
        self.cells.values()
    }

    /// Counts failures in their cell, which keeps the worst. The first of equals stays.
    pub fn insert(&mut self, found: ArchivedFailure) {
        self.failures += found.failures;
        match self.cells.get_mut(&found.cell) {
            Some(known) => {
                // The count belongs to the cell, whichever failure represents it.
                let failures = known.failures + found.failures;
                if descending(&found.severity, &known.severity).is_lt() {
                    *known = found;
                }
                known.failures = failures;
            }
            None => {
                self.cells.insert(found.cell.clone(), found);
            }
        }
    }

    /// Draws two failures and returns that of the rarer cell. `None` if there are none.
    pub(super) fn rare(&self, dice: &mut ChaCha8Rng) -> Option<&ArchivedFailure> {
        // A tournament of two favours rare cells without excluding frequent ones.
        let mut draw = || {
            self.cells
                .values()
                // An empty range would panic. Over one place, the draw of an empty
                // archive finds nothing.
                .nth(dice.random_range(0..self.len().max(1)))
        };
        let (one, other) = (draw()?, draw()?);
        Some(if other.failures < one.failures {
            other
        } else {
            one
        })
    }

    /// Returns the number of failures of each cell.
    pub fn counts(&self) -> Vec<CellCount> {
        let counts = self.cells.values().map(|known| CellCount {
            cell: known.cell.clone(),
            failures: known.failures,
        });
        counts.collect()
    }

    /// Returns the text of its file: a JSON object per line.
    ///
    /// # Errors
    /// A number is not finite.
    pub(super) fn to_text(&self) -> Result<String, serde_json::Error> {
        // Cells are ordered, so equal archives have equal bytes.
        let lines: Vec<String> = self
            .cells
            .values()
            .map(serde_json::to_string)
            .collect::<Result<_, _>>()?;
        Ok(lines.iter().map(|line| format!("{line}\n")).collect())
    }

    /// Reads the text of its file.
    ///
    /// # Errors
    /// A line is invalid.
    pub(super) fn from_text(text: &str) -> Result<FailureArchive, serde_json::Error> {
        let mut archive = FailureArchive::default();
        for line in text.lines() {
            archive.insert(serde_json::from_str(line)?);
        }
        Ok(archive)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::CellFailure;
    use crate::seed::generator;
    use crate::severity::CrashKind;

    fn failure(partner: &str, index: u64, closing_mps: f64) -> ArchivedFailure {
        ArchivedFailure {
            cell: FailureCell {
                failure: CellFailure::contact(partner, CrashKind::HeadOn, 1.0),
                necessary: None,
            },
            index,
            actions: vec![2, 2],
            severity: [1.0, 0.0, closing_mps, 0.1],
            failures: 1,
        }
    }

    #[test]
    fn a_cell_keeps_its_worst_failure_and_counts_all() {
        let mut archive = FailureArchive::default();
        for (index, mps) in [(0, 1.0), (1, 1.5), (2, 1.2), (3, 1.5)] {
            archive.insert(failure("car", index, mps));
        }
        archive.insert(failure("truck", 4, 0.1));
        let kept: Vec<(u64, u64)> = archive.iter().map(|it| (it.index, it.failures)).collect();
        assert_eq!(kept, [(1, 4), (4, 1)]);
        assert_eq!((archive.len(), archive.failures()), (2, 5));
        let text = archive.to_text().expect("finite");
        assert_eq!(FailureArchive::from_text(&text).expect("a text"), archive);
    }

    #[test]
    fn rare_cells_are_drawn_more_often() {
        let mut archive = FailureArchive::default();
        assert!(archive.rare(&mut generator("dice", &[])).is_none());
        (0..9).for_each(|index| archive.insert(failure("car", index, 1.0)));
        archive.insert(failure("truck", 9, 1.0));
        let mut dice = generator("dice", &[]);
        let rare = (0..4000).filter(|_| archive.rare(&mut dice).is_some_and(|it| it.index == 9));
        // Three of the four pairs contain the rare cell. Without rarity it is one half.
        let rare = rare.count();
        assert!((2800..3200).contains(&rare), "{rare}");
    }
}
