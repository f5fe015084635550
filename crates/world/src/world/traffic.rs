//! Traffic with whose drivers the ados of a world are compared.

use std::sync::Arc;

use brakecheck_driver_model::TrafficModel;

use super::Scenario;
use crate::natural::{DeclaredTraffic, Naturalness, SuccessRarity};
use crate::testbench::Episode;
use crate::world_file::DeclaredTrafficFile;

impl Scenario {
    /// Returns the world in declared traffic, with which the ados are compared.
    pub fn in_traffic(&self, model: Arc<TrafficModel>) -> Scenario {
        let traffic = DeclaredTraffic {
            model,
            is_declared: true,
            ..self.traffic.clone()
        };
        Scenario {
            traffic,
            ..self.clone()
        }
    }

    /// Returns the world with ados whose driving is not rarer than a rate.
    ///
    /// The rate is of events per 1,000 km among the drivers of the traffic model.
    pub fn naturally(&self, per_1000_km: f64) -> Scenario {
        let traffic = DeclaredTraffic {
            per_1000_km: Some(per_1000_km),
            is_declared: true,
            ..self.traffic.clone()
        };
        Scenario {
            traffic,
            ..self.clone()
        }
    }

    /// Returns the traffic of the world.
    pub fn traffic(&self) -> &DeclaredTraffic {
        &self.traffic
    }

    /// Returns the declared laws of the starts and of the ados' actions.
    pub fn declared_laws(&self) -> Option<&DeclaredTrafficFile> {
        self.laws.as_deref()
    }

    /// Returns the rarest driving of an ado in an episode, up to its verdict.
    ///
    /// `None` if no ado drives a vehicle.
    pub fn rarity_of(&self, episode: &Episode) -> Option<SuccessRarity> {
        let world = self.drive()?.world().at_start(&episode.start);
        SuccessRarity::of(&self.traffic.model, &world, &episode.trace, episode.judged)
    }

    /// Returns how natural the ados drove in an episode.
    ///
    /// `None` if no traffic was named: the shipped model is five minutes of one motorway,
    /// so only the user can choose it.
    pub fn naturalness_of(&self, episode: &Episode) -> Option<Naturalness> {
        if !self.traffic.is_declared {
            return None;
        }
        let rarity = self.rarity_of(episode)?;
        Some(rarity.naturalness(&self.traffic.model))
    }
}
