//! Entities of OpenSCENARIO: their classes and bounding boxes.

use crate::raw::{RawReference, RawTrack};
use crate::recording::Class;

/// Class and box of an entity, as far as the file has them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct XoscEntity {
    pub(crate) class: Option<Class>,
    /// Length and width in metres.
    pub(crate) size_m: Option<[f64; 2]>,
    /// Box centre ahead and to the left of the reference point.
    pub(crate) centre_m: [f64; 2],
}

impl XoscEntity {
    /// Returns an empty track with the class and the box.
    ///
    /// Without a box the positions are taken as those of the box centre.
    pub(crate) fn track(&self, id: &str) -> RawTrack {
        let mut track = RawTrack {
            id: id.as_bytes().to_vec(),
            ..RawTrack::default()
        };
        track.shares[self.class.unwrap_or_default() as usize] = 1.0;
        if let Some([length_m, width_m]) = self.size_m {
            track.size_m = Some([length_m, width_m]);
            track.reference = RawReference::CentreAt {
                ahead_m: self.centre_m[0],
                left_m: self.centre_m[1],
            };
        }
        track
    }
}

/// Returns the class of a `vehicleCategory`.
pub(crate) fn class_of_vehicle(category: &str) -> Option<Class> {
    Some(match category {
        "car" => Class::Car,
        "van" => Class::Van,
        "truck" | "bus" => Class::Truck,
        "motorbike" => Class::Motorcycle,
        "bicycle" => Class::Bicycle,
        "wheelchair" => Class::Pedestrian,
        "trailer" | "semitrailer" => Class::Trailer,
        "train" | "tram" => Class::Other,
        _ => return None,
    })
}

/// Returns the class that the names of a catalog and its entry suggest.
pub(crate) fn class_of_catalog(catalog: &str, entry: &str) -> Option<Class> {
    let is_pedestrian = || catalog.to_ascii_lowercase().contains("pedestrian");
    class_of_words(entry).or_else(|| is_pedestrian().then_some(Class::Pedestrian))
}

/// Returns the class of the first word that names one, such as that of `veh_passenger`.
pub(crate) fn class_of_words(text: &str) -> Option<Class> {
    let text = text.to_ascii_lowercase();
    let mut words = text.split(|it: char| !it.is_ascii_alphabetic());
    words.find_map(|word| {
        Some(match word {
            "pedestrian" | "pedestrians" | "person" | "walker" | "ped" => Class::Pedestrian,
            "bicycle" | "bike" | "cyclist" | "bicyclist" | "cycle" => Class::Bicycle,
            "motorbike" | "motorcycle" | "motorcyclist" | "moped" | "scooter" => Class::Motorcycle,
            "car" | "sedan" | "suv" | "passenger" | "taxi" | "automobile" => Class::Car,
            "van" | "delivery" => Class::Van,
            "truck" | "lorry" | "bus" | "coach" | "hgv" => Class::Truck,
            "trailer" | "semitrailer" => Class::Trailer,
            "tram" | "train" | "animal" => Class::Other,
            _ => return None,
        })
    })
}
