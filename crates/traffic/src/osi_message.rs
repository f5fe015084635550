//! Messages of the Open Simulation Interface, as far as recordings need them.
//!
//! Numbers and types of the fields are those of OSI 3.0 to 3.8. Other fields are skipped.
//! `osi_schema` describes the same fields for other readers.

use prost::Message;

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiTimestamp {
    #[prost(int64, optional, tag = "1")]
    pub(crate) seconds: Option<i64>,
    #[prost(uint32, optional, tag = "2")]
    pub(crate) nanos: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiVector {
    #[prost(double, optional, tag = "1")]
    pub(crate) x: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) y: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) z: Option<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiDimension {
    #[prost(double, optional, tag = "1")]
    pub(crate) length: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) width: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) height: Option<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiOrientation {
    #[prost(double, optional, tag = "1")]
    pub(crate) roll: Option<f64>,
    #[prost(double, optional, tag = "2")]
    pub(crate) pitch: Option<f64>,
    #[prost(double, optional, tag = "3")]
    pub(crate) yaw: Option<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiIdentifier {
    #[prost(uint64, optional, tag = "1")]
    pub(crate) value: Option<u64>,
}

/// State in the world: metres, radians, the centre of the box.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiBase {
    #[prost(message, optional, tag = "1")]
    pub(crate) dimension: Option<OsiDimension>,
    #[prost(message, optional, tag = "2")]
    pub(crate) position: Option<OsiVector>,
    #[prost(message, optional, tag = "3")]
    pub(crate) orientation: Option<OsiOrientation>,
    #[prost(message, optional, tag = "4")]
    pub(crate) velocity: Option<OsiVector>,
    #[prost(message, optional, tag = "5")]
    pub(crate) acceleration: Option<OsiVector>,
    #[prost(message, optional, tag = "6")]
    pub(crate) orientation_rate: Option<OsiOrientation>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiVehicleClassification {
    #[prost(int32, optional, tag = "1")]
    pub(crate) kind: Option<i32>,
    #[prost(int32, optional, tag = "5")]
    pub(crate) role: Option<i32>,
}

/// Places relative to the centre of the box, in the frame of the vehicle.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiVehicleAttributes {
    #[prost(message, optional, tag = "4")]
    pub(crate) bbcenter_to_rear: Option<OsiVector>,
    #[prost(message, optional, tag = "5")]
    pub(crate) bbcenter_to_front: Option<OsiVector>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiMovingObject {
    #[prost(message, optional, tag = "1")]
    pub(crate) id: Option<OsiIdentifier>,
    #[prost(message, optional, tag = "2")]
    pub(crate) base: Option<OsiBase>,
    #[prost(int32, optional, tag = "3")]
    pub(crate) kind: Option<i32>,
    #[prost(message, optional, tag = "5")]
    pub(crate) attributes: Option<OsiVehicleAttributes>,
    #[prost(message, optional, tag = "6")]
    pub(crate) vehicle: Option<OsiVehicleClassification>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiVersion {
    #[prost(uint32, optional, tag = "1")]
    pub(crate) major: Option<u32>,
    #[prost(uint32, optional, tag = "2")]
    pub(crate) minor: Option<u32>,
    #[prost(uint32, optional, tag = "3")]
    pub(crate) patch: Option<u32>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiGroundTruth {
    #[prost(message, optional, tag = "1")]
    pub(crate) version: Option<OsiVersion>,
    #[prost(message, optional, tag = "2")]
    pub(crate) timestamp: Option<OsiTimestamp>,
    #[prost(message, optional, tag = "3")]
    pub(crate) host_vehicle_id: Option<OsiIdentifier>,
    #[prost(message, repeated, tag = "5")]
    pub(crate) moving_objects: Vec<OsiMovingObject>,
    #[prost(string, optional, tag = "15")]
    pub(crate) map_reference: Option<String>,
}

/// Road of a recording, as omega-prime stores it.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiOpenDrive {
    #[prost(string, optional, tag = "1")]
    pub(crate) map_reference: Option<String>,
    #[prost(string, optional, tag = "2")]
    pub(crate) open_drive_xml_content: Option<String>,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiSensorView {
    #[prost(message, optional, tag = "2")]
    pub(crate) timestamp: Option<OsiTimestamp>,
    #[prost(message, optional, tag = "7")]
    pub(crate) global_ground_truth: Option<OsiGroundTruth>,
}
