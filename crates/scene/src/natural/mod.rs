//! How natural ados drive, by a model of recorded traffic.
//!
//! [`AdoLimit`] leaves an ado only actions that real drivers take often enough, and
//! [`Naturalness`] states how rare an ado's driving was.
//!
//! Architecture Invariant: nothing here judges an ego or reads a rule.

pub mod behaviour;
pub mod limited_scene;
mod naturalness;
pub mod vehicle_meter;

use std::fmt::{self, Display, Formatter};
use std::sync::{Arc, LazyLock};

use serde::{Deserialize, Serialize};

use crate::content_hash;
use brakecheck_driver_model::TrafficModel;

pub use limited_scene::LimitedScene;
pub use naturalness::{Naturalness, NaturalnessOfRow, SuccessRarity};

/// Model of real drivers with a least rate of events for ados.
///
/// An action is allowed if the braking event or cut-in that it starts or continues is at
/// least as frequent among real drivers. The neutral action is always allowed.
#[derive(Clone, Debug)]
pub struct AdoLimit {
    /// Model of real drivers.
    pub model: Arc<TrafficModel>,
    /// Least rate of an event per 1,000 km.
    pub per_1000_km: f64,
}

/// Returns the shipped model of motorway traffic.
pub fn motorway() -> Arc<TrafficModel> {
    // Parsed once, since the model is large and every world has it by default.
    static MODEL: LazyLock<Arc<TrafficModel>> = LazyLock::new(|| TrafficModel::motorway().into());
    Arc::clone(&MODEL)
}

/// Traffic in which the ados of a world drive.
#[derive(Clone, Debug)]
pub struct DeclaredTraffic {
    /// Model of real drivers.
    pub model: Arc<TrafficModel>,
    /// Least rate of an ado's events per 1,000 km, if they are limited.
    pub per_1000_km: Option<f64>,
    /// True if the user named the model.
    pub is_declared: bool,
}

/// Traffic and limit of a training, as its run directory has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NaturalTraining {
    /// Least rate of an event per 1,000 km.
    pub per_1000_km: f64,
    /// RON text of the traffic model.
    pub traffic: String,
}

impl NaturalTraining {
    /// Returns those of some traffic, `None` without a limit.
    pub fn of(traffic: &DeclaredTraffic) -> Option<NaturalTraining> {
        traffic.per_1000_km.map(|per_1000_km| NaturalTraining {
            per_1000_km,
            traffic: traffic.model.to_ron(),
        })
    }
}

impl Display for NaturalTraining {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // By its hash, because the text is long and names may repeat.
        let model = content_hash::sha256(self.traffic.as_bytes());
        write!(
            f,
            "{} per 1,000 km in the traffic {}",
            self.per_1000_km,
            &model[..8]
        )
    }
}

impl Default for DeclaredTraffic {
    fn default() -> DeclaredTraffic {
        DeclaredTraffic {
            model: motorway(),
            per_1000_km: None,
            // The shipped traffic is a single motorway, so it counts only if the user
            // asks.
            is_declared: false,
        }
    }
}

impl DeclaredTraffic {
    /// Returns the limit on the ados, if there is one.
    pub fn limit(&self) -> Option<AdoLimit> {
        self.per_1000_km.map(|per_1000_km| AdoLimit {
            model: Arc::clone(&self.model),
            per_1000_km,
        })
    }

    /// Returns the naturalness of a row's successes, `None` if no traffic was named.
    pub fn of_row(&self, successes: &[&SuccessRarity]) -> Option<NaturalnessOfRow> {
        self.is_declared
            .then(|| NaturalnessOfRow::of(&self.model, self.per_1000_km, successes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_and_a_training_within_it_are_of_the_declared_traffic() {
        let free = DeclaredTraffic::default();
        assert!(free.limit().is_none() && NaturalTraining::of(&free).is_none());
        let limited = DeclaredTraffic {
            per_1000_km: Some(20.0),
            ..DeclaredTraffic::default()
        };
        let limit = limited.limit().expect("a limit");
        assert_eq!(limit.per_1000_km, 20.0);
        assert_eq!(limit.model.to_ron(), motorway().to_ron());
        let training = NaturalTraining::of(&limited).expect("a limit");
        assert_eq!(training.per_1000_km, 20.0);
        assert_eq!(training.traffic, motorway().to_ron());
    }

    #[test]
    fn rows_have_a_naturalness_only_if_traffic_was_named() {
        let traffic = |is_declared| DeclaredTraffic {
            is_declared,
            ..DeclaredTraffic::default()
        };
        assert_eq!(traffic(false).of_row(&[]), None);
        let empty = traffic(true).of_row(&[]).expect("declared");
        assert_eq!((empty.successes, empty.median), (0, None));
    }

    #[test]
    fn a_training_names_its_rate_and_its_traffic() {
        let of = |traffic: &str| {
            let training = NaturalTraining {
                per_1000_km: 20.0,
                traffic: traffic.to_owned(),
            };
            training.to_string()
        };
        let said = of("one");
        let digest = said.strip_prefix("20 per 1,000 km in the traffic ");
        assert_eq!(digest.map(str::len), Some(8), "{said}");
        assert_ne!(of("other"), said);
        // The limit of a declared model is of that model.
        let mut model = TrafficModel::motorway();
        model.name = "another".to_owned();
        let declared = DeclaredTraffic {
            model: Arc::new(model),
            per_1000_km: Some(5.0),
            is_declared: true,
        };
        assert_eq!(declared.limit().expect("a limit").model.name, "another");
        let row = declared.of_row(&[]).expect("declared");
        assert_eq!(row.limit_per_1000_km, Some(5.0));
    }
}
