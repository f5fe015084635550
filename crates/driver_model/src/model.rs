//! Naturalness models: how often real drivers do what.

use std::fmt::{self, Display, Formatter};
use std::io::Read;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::acceleration_model::AccelerationModel;
use crate::calibration_row::CalibrationRow;
use crate::starts::StartTable;
use crate::tail::EventTail;

/// Model of natural driving, fitted to recordings.
///
/// It holds parameters, counts and shares, and no recorded row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrafficModel {
    /// Road, place and time of the recordings.
    pub name: String,
    /// Recordings that the model was fitted to.
    pub sources: Vec<SourceFile>,
    /// Amount of recorded driving.
    pub exposure: Exposure,
    /// Ranges of recorded quantities.
    pub domain: Domain,
    /// Accelerations decision by decision.
    pub driver: AccelerationModel,
    /// Rate of braking events per 1,000 km by peak over one second, in m/s².
    pub braking_peak: EventTail,
    /// Rate of accelerations per 1,000 km by peak over one second, in m/s².
    ///
    /// `None` in models that were fitted without it.
    #[serde(default)]
    pub acceleration_peak: Option<EventTail>,
    /// Rate of braking events per 1,000 km by speed lost, in m/s.
    pub braking_loss: EventTail,
    /// Share of cut-ins by the deceleration that the follower needs, in m/s².
    pub cut_in_need: Option<EventTail>,
    /// Share of followed time by time gap and closing speed.
    pub starts: StartTable,
    /// Predictions of one half of the data for the other.
    pub calibration: Vec<CalibrationRow>,
}

/// Recording that a model was fitted to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceFile {
    /// Name of the file, or a reference to a publication.
    pub name: String,
    /// SHA-256 of its bytes, `None` for a publication.
    pub sha256: Option<String>,
}

impl SourceFile {
    /// Returns a named file with the SHA-256 of its bytes.
    ///
    /// # Errors
    /// The bytes cannot be read.
    pub fn of(name: &str, mut bytes: impl Read) -> std::io::Result<SourceFile> {
        let mut digest = Sha256::new();
        // In pieces, because recordings are larger than the memory.
        let mut buffer = vec![0; 1 << 16];
        loop {
            let read = bytes.read(&mut buffer)?;
            if read == 0 {
                break;
            }
            digest.update(&buffer[..read]);
        }
        let hash = digest.finalize();
        let digits = hash.iter().map(|byte| format!("{byte:02x}"));
        Ok(SourceFile {
            name: name.to_owned(),
            sha256: Some(digits.collect()),
        })
    }
}

/// Amount of recorded driving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exposure {
    /// Number of vehicles.
    pub vehicles: usize,
    /// Driven kilometres without interpolated samples.
    pub vehicle_km: f64,
    /// Braking events of at least 1 m/s².
    pub braking_events: usize,
    /// Cut-ins within 100 m of a follower.
    pub cut_ins: usize,
}

impl Exposure {
    /// Returns the cut-ins per 1,000 km.
    pub fn cut_ins_per_1000_km(&self) -> f64 {
        1000.0 * self.cut_ins as f64 / self.vehicle_km.max(1e-9)
    }
}

/// Ranges of recorded quantities. Beyond them a model has no data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Domain {
    /// Least and greatest speed in m/s.
    pub speed_mps: [f64; 2],
    /// Least and greatest mean acceleration of a decision in m/s².
    pub accel_mps2: [f64; 2],
    /// Greatest lateral speed of a cut-in at the line, in m/s.
    pub cut_in_lateral_mps: f64,
}

/// Error while fitting or reading a model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The recordings have too few events.
    #[error("{vehicle_km:.0} km with {events} braking events are too few to fit a model")]
    TooFew {
        /// Driven kilometres.
        vehicle_km: f64,
        /// Braking events.
        events: usize,
    },
    /// The text is not RON of a model.
    #[error("invalid traffic model at {0}")]
    Ron(#[from] ron::error::SpannedError),
}

impl ModelError {
    /// Returns the fix in the imperative.
    pub fn help(&self) -> &'static str {
        match self {
            ModelError::TooFew { .. } => "add recordings, or use the shipped model",
            ModelError::Ron(_) => "write it again with `brakecheck log FILE --fit traffic.ron`",
        }
    }
}

impl TrafficModel {
    /// Parses a model.
    ///
    /// # Errors
    /// The text is not RON of a model.
    pub fn parse(text: &str) -> Result<TrafficModel, ModelError> {
        Ok(ron::from_str(text)?)
    }

    /// Returns the shipped model of a German motorway.
    pub fn motorway() -> TrafficModel {
        let model = TrafficModel::parse(include_str!("../models/motorway.ron"));
        // Invariant: the shipped text parses, which a test checks.
        model.unwrap_or_else(|error| unreachable!("{error}"))
    }

    /// Returns the RON text of the model.
    pub fn to_ron(&self) -> String {
        let style = ron::ser::PrettyConfig::new()
            .depth_limit(3)
            .struct_names(true);
        // Invariant: the model consists of numbers, texts and lists.
        ron::ser::to_string_pretty(self, style).unwrap_or_default()
    }

    /// Returns the RON text of the model on one line.
    pub fn to_line(&self) -> String {
        // Invariant: as in `to_ron`.
        ron::ser::to_string(self).unwrap_or_default()
    }

    /// Returns the least rate per 1,000 km that the data supports.
    ///
    /// By the rule of three, an event that was never seen may occur this often.
    pub fn supported_per_1000_km(&self) -> f64 {
        // Three events per exposure are the 95 % bound without any event.
        3000.0 / self.exposure.vehicle_km.max(1e-9)
    }
}

impl Display for TrafficModel {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let it = &self.exposure;
        writeln!(
            f,
            "{}: {} vehicles, {:.0} km, {} braking events, {} cut-ins",
            self.name, it.vehicles, it.vehicle_km, it.braking_events, it.cut_ins
        )?;
        writeln!(
            f,
            "supports statements down to {:.1} per 1,000 km; rarer rates are extrapolated",
            self.supported_per_1000_km()
        )?;
        writeln!(f, "\nbraking, peak over 1 s   per 1,000 km")?;
        for size in [1.0, 2.0, 3.0, 4.0, 6.0] {
            let rate = self.braking_peak.rate_of(size);
            writeln!(f, "  {size} m/s²: {}", rate)?;
        }
        if let Some(peak) = &self.acceleration_peak {
            writeln!(f, "acceleration, peak over 1 s   per 1,000 km")?;
            for size in [1.0, 2.0, 3.0] {
                writeln!(f, "  {size} m/s²: {}", peak.rate_of(size))?;
            }
        }
        if let Some(need) = &self.cut_in_need {
            writeln!(
                f,
                "cut-ins, deceleration that the follower needs   share of cut-ins"
            )?;
            for size in [0.3, 1.0, 2.0] {
                writeln!(f, "  {size} m/s²: {}", need.rate_of(size))?;
            }
        }
        writeln!(
            f,
            "\none part of the data predicts the other   model / observed"
        )?;
        for row in &self.calibration {
            writeln!(f, "  {row}")?;
        }
        Ok(())
    }
}
