//! Inputs of a surrogate's networks at a sample.
//!
//! They combine features of the percept with the answers of similar stock controllers.

use std::sync::Arc;

use super::features::Features;
use super::fitted_model::{FittedModel, MODELS, StockModel};
use crate::ego::{Briefing, Percept};

/// Converter from percepts to the rows of a surrogate.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelInputs {
    features: Features,
    models: Vec<StockModel>,
    of: Arc<[FittedModel]>,
}

impl ModelInputs {
    /// Begins an episode with its first percept.
    pub fn begin(&mut self, alike: &Arc<[FittedModel]>, briefing: &Briefing, percept: &Percept) {
        self.features = Features::begin(percept);
        // Building controllers is slow, so the same surrogate reuses those of the last episode.
        if Arc::ptr_eq(&self.of, alike) {
            self.models.iter_mut().for_each(StockModel::reset)
        } else {
            let models = alike.iter().map(|like| like.model(briefing));
            self.models = models.collect();
            self.of = Arc::clone(alike);
        }
    }

    /// Writes the row of the next percept.
    pub fn read(&mut self, percept: &Percept, row: &mut Vec<f32>) {
        self.features.read(percept, row);
        let changes = self
            .models
            .iter_mut()
            .map(|model| model.change_mps2(percept));
        let row_of = changes.map(|change_mps2| change_mps2 as f32);
        // Missing controllers are padded with zeros, so every row has the same length.
        let rest = MODELS - self.of.len();
        row.extend(row_of.chain(std::iter::repeat_n(0.0, rest)));
    }
}
