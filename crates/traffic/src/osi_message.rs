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

/// Instant of a ground truth or of a sensor view, which have it in the same field.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct OsiInstant {
    #[prost(message, optional, tag = "2")]
    pub(crate) timestamp: Option<OsiTimestamp>,
}

/// Field of the moving objects in a ground truth.
pub(crate) const MOVING_OBJECTS: usize = 5;
/// Field of the ground truth in a sensor view.
pub(crate) const GLOBAL_GROUND_TRUTH: usize = 7;

/// Contents of one field of nested messages, in their order.
///
/// A decoder of the whole message would make 500 bytes of an object of two.
pub(crate) struct NestedFields<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> NestedFields<'a> {
    /// Looks for the fields with this number in a message.
    pub(crate) fn of(message: &'a [u8], number: usize) -> NestedFields<'a> {
        NestedFields {
            rest: message,
            number,
        }
    }

    /// Takes a number of variable length.
    fn varint(&mut self) -> Result<usize, String> {
        prost::decode_length_delimiter(&mut self.rest).map_err(|error| error.to_string())
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let split = self.rest.split_at_checked(count);
        let (taken, rest) = split.ok_or("a field is longer than its message")?;
        self.rest = rest;
        Ok(taken)
    }

    /// Takes a field. Its content is `None` if it is another one.
    fn field(&mut self) -> Result<Option<&'a [u8]>, String> {
        let key = self.varint()?;
        match key & 7 {
            // The wire types of protobuf: 0 varint, 1 eight bytes, 2 with a
            // length, 5 four bytes.
            0 => self.varint().map(|_| None),
            1 => self.bytes(8).map(|_| None),
            2 => {
                let length = self.varint()?;
                let content = self.bytes(length)?;
                Ok((key >> 3 == self.number).then_some(content))
            }
            5 => self.bytes(4).map(|_| None),
            // Groups (3 and 4) are deprecated, and OSI has none.
            kind => Err(format!("a field of the wire type {kind}")),
        }
    }
}

impl<'a> Iterator for NestedFields<'a> {
    type Item = Result<&'a [u8], String>;

    fn next(&mut self) -> Option<Result<&'a [u8], String>> {
        while !self.rest.is_empty() {
            match self.field() {
                Ok(None) => {}
                Ok(Some(content)) => return Some(Ok(content)),
                Err(error) => {
                    // After an error the position is unknown, so the iteration
                    // ends.
                    self.rest = &[];
                    return Some(Err(error));
                }
            }
        }
        None
    }
}
