//! Writing of OSI traces in MCAP.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::{MessageHeader, Metadata};
use mcap::{McapResult, WriteOptions};
use prost::Message;

use crate::osi_message::{
    OsiBase, OsiDimension, OsiGroundTruth, OsiIdentifier, OsiMovingObject, OsiOpenDrive,
    OsiOrientation, OsiTimestamp, OsiVector, OsiVehicleAttributes, OsiVehicleClassification,
    OsiVersion,
};
use crate::osi_schema;
use crate::recording::Class;

/// Version of OSI whose fields are written, and of the rules for its MCAP files.
const OSI: (u32, u32, u32) = (3, 7, 0);
const OSI_TEXT: &str = "3.7.0";
const FILE_VERSION: &str = "3.8.0";
/// Version of protobuf whose encoding is written.
const PROTOBUF: &str = "3.21.0";
/// Topics of the moving objects and of the road.
const TOPIC: &str = "GroundTruth";
const MAP_TOPIC: &str = "ground_truth_map";

/// Road users of an episode over time, to write as an OSI trace.
#[derive(Clone, Debug, Default)]
pub struct OsiTrace {
    /// Description of the file.
    pub description: String,
    /// Bodies of all road users. They are numbered from 1 in this order.
    pub bodies: Vec<OsiBody>,
    /// Position of the ego among the bodies.
    pub ego: usize,
    /// Instants in the order of time.
    pub frames: Vec<OsiFrame>,
    /// Name and text of the road as OpenDRIVE, if there is one.
    pub open_drive: Option<(String, String)>,
}

/// Body of a road user.
#[derive(Clone, Debug)]
pub struct OsiBody {
    /// Class, from which the type of the object follows.
    pub class: Class,
    /// Length, width and height.
    pub size_m: [f64; 3],
    /// Axles. `None` for a road user without axles.
    pub axles: Option<OsiAxles>,
}

/// Places of the axles of a body.
#[derive(Clone, Copy, Debug)]
pub struct OsiAxles {
    /// Distance of the rear axle ahead of the centre.
    pub rear_m: f64,
    /// Distance of the front axle ahead of the centre.
    pub front_m: f64,
    /// Height of the centres of the wheels above the ground.
    pub height_m: f64,
}

/// State of all road users at one instant.
#[derive(Clone, Debug)]
pub struct OsiFrame {
    /// Time since the start, in nanoseconds.
    pub time_ns: u64,
    /// States in the order of the bodies.
    pub states: Vec<OsiState>,
}

/// State of a body: its centre in the world frame, x forward, y left, z up.
#[derive(Clone, Copy, Debug, Default)]
pub struct OsiState {
    /// Centre of the box.
    pub centre_m: [f64; 3],
    /// Roll, pitch and yaw, applied in the order yaw, pitch, roll.
    pub roll_pitch_yaw_rad: [f64; 3],
    /// Velocity of the centre.
    pub velocity_mps: [f64; 3],
    /// Acceleration of the centre.
    pub accel_mps2: [f64; 3],
    /// Turning rate, counter-clockwise.
    pub yaw_rate_rad_per_s: f64,
}

/// Returns a trace of the Open Simulation Interface in MCAP, one message per instant.
///
/// The messages are `osi3.GroundTruth` of OSI 3.7 in the topic `GroundTruth`. The road is
/// an `osi3.MapAsamOpenDrive` in the topic `ground_truth_map`, which omega-prime reads.
/// Equal traces give equal bytes. [`read_mcap`](crate::read_mcap) reads the file.
pub fn write_osi(trace: &OsiTrace) -> Vec<u8> {
    // Invariant: writing into memory does not fail, and two channels are few.
    trace.write().unwrap_or_default()
}

/// Returns texts by their names, as MCAP has its metadata.
fn entries(entries: &[(&str, &str)]) -> BTreeMap<String, String> {
    let entries = entries.iter();
    entries
        .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
        .collect()
}

impl OsiTrace {
    fn write(&self) -> McapResult<Vec<u8>> {
        // All messages are in one chunk, which every reader can read without a decompressor.
        let mut file = WriteOptions::new()
            .library(concat!("brakecheck ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .chunk_size(None)
            .create(Cursor::new(Vec::new()))?;
        file.write_metadata(&Metadata {
            name: "net.asam.osi.trace".to_owned(),
            metadata: entries(&[
                ("version", FILE_VERSION),
                ("min_osi_version", OSI_TEXT),
                ("max_osi_version", OSI_TEXT),
                ("min_protobuf_version", PROTOBUF),
                ("max_protobuf_version", PROTOBUF),
                ("description", &self.description),
                ("data_sources", "brakecheck"),
            ]),
        })?;
        let mut described = entries(&[
            ("net.asam.osi.trace.channel.osi_version", OSI_TEXT),
            ("net.asam.osi.trace.channel.protobuf_version", PROTOBUF),
            ("net.asam.osi.trace.channel.description", "all road users"),
        ]);
        let schema = osi_schema::ground_truth();
        let schema = file.add_schema("osi3.GroundTruth", "protobuf", &schema)?;
        let channel = file.add_channel(schema, TOPIC, "protobuf", &described)?;
        // The description is of the road users, and not of the road.
        described.remove("net.asam.osi.trace.channel.description");
        // Before the first message, since MCAP announces a channel before its
        // messages.
        let mut road = match &self.open_drive {
            Some((name, text)) => {
                let schema = osi_schema::open_drive();
                let schema = file.add_schema("osi3.MapAsamOpenDrive", "protobuf", &schema)?;
                let road = OsiOpenDrive {
                    map_reference: Some(name.clone()),
                    open_drive_xml_content: Some(text.clone()),
                };
                let channel = file.add_channel(schema, MAP_TOPIC, "protobuf", &described)?;
                Some((channel, road.encode_to_vec()))
            }
            None => None,
        };
        for frame in &self.frames {
            let header = |channel_id: u16| MessageHeader {
                channel_id,
                sequence: 0,
                log_time: frame.time_ns,
                publish_time: frame.time_ns,
            };
            let message = self.message(frame).encode_to_vec();
            file.write_to_known_channel(&header(channel), &message)?;
            // The road does not change, so it is stated at the first instant only.
            if let Some((channel, road)) = road.take() {
                file.write_to_known_channel(&header(channel), &road)?;
            }
        }
        file.finish()?;
        Ok(file.into_inner().into_inner())
    }

    /// Returns the message of an instant.
    fn message(&self, frame: &OsiFrame) -> OsiGroundTruth {
        let objects = self.bodies.iter().zip(&frame.states).zip(1..);
        let (major, minor, patch) = OSI;
        OsiGroundTruth {
            version: Some(OsiVersion {
                major: Some(major),
                minor: Some(minor),
                patch: Some(patch),
            }),
            timestamp: Some(OsiTimestamp {
                // Whole nanoseconds are split without rounding.
                seconds: Some((frame.time_ns / 1_000_000_000) as i64),
                nanos: Some((frame.time_ns % 1_000_000_000) as u32),
            }),
            // Numbers begin with 1, because proto3 readers take 0 for a
            // missing value.
            host_vehicle_id: Some(id(self.ego as u64 + 1)),
            moving_objects: objects
                .map(|((body, state), number)| body.message(state, number))
                .collect(),
            map_reference: self.open_drive.as_ref().map(|(name, _)| name.clone()),
        }
    }
}

impl OsiBody {
    /// Returns the object of a state.
    fn message(&self, state: &OsiState, number: u64) -> OsiMovingObject {
        let [length_m, width_m, height_m] = self.size_m;
        let (kind, vehicle) = osi_type(self.class);
        OsiMovingObject {
            id: Some(id(number)),
            base: Some(OsiBase {
                dimension: Some(OsiDimension {
                    length: Some(length_m),
                    width: Some(width_m),
                    height: Some(height_m),
                }),
                position: Some(vector(state.centre_m)),
                orientation: Some(orientation(state.roll_pitch_yaw_rad)),
                velocity: Some(vector(state.velocity_mps)),
                acceleration: Some(vector(state.accel_mps2)),
                orientation_rate: Some(orientation([0.0, 0.0, state.yaw_rate_rad_per_s])),
            }),
            kind: Some(kind),
            attributes: self.axles.map(|axles| {
                // Places of axles are relative to the centre of the box, half
                // its height above the ground.
                let up_m = axles.height_m - 0.5 * height_m;
                OsiVehicleAttributes {
                    bbcenter_to_rear: Some(vector([axles.rear_m, 0.0, up_m])),
                    bbcenter_to_front: Some(vector([axles.front_m, 0.0, up_m])),
                }
            }),
            vehicle: vehicle.map(|kind| OsiVehicleClassification {
                kind: Some(kind),
                // A civil vehicle.
                role: Some(2),
            }),
        }
    }
}

/// Returns the type of an object and, for a vehicle, its kind.
///
/// They are the inverse of those that [`read_osi`](crate::read_osi) reads.
fn osi_type(class: Class) -> (i32, Option<i32>) {
    match class {
        Class::Pedestrian => (3, None),
        Class::Other => (1, None),
        Class::Car => (2, Some(4)),
        Class::Van => (2, Some(6)),
        Class::Truck => (2, Some(7)),
        Class::Trailer => (2, Some(9)),
        Class::Motorcycle => (2, Some(10)),
        Class::Bicycle => (2, Some(11)),
    }
}

fn id(value: u64) -> OsiIdentifier {
    OsiIdentifier { value: Some(value) }
}

fn vector([x, y, z]: [f64; 3]) -> OsiVector {
    OsiVector {
        x: Some(x),
        y: Some(y),
        z: Some(z),
    }
}

fn orientation([roll, pitch, yaw]: [f64; 3]) -> OsiOrientation {
    OsiOrientation {
        roll: Some(roll),
        pitch: Some(pitch),
        yaw: Some(yaw),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_mcap;

    /// Two bodies, of which one moves by 2 m and the other turns, at steps of 0.1 s.
    fn trace() -> OsiTrace {
        let body = |class| OsiBody {
            class,
            size_m: [4.5, 1.8, 1.5],
            axles: Some(OsiAxles {
                rear_m: -1.4,
                front_m: 1.3,
                height_m: 0.33,
            }),
        };
        let frame = |i: u64| {
            let x_m = 2.0 * i as f64;
            let driven = OsiState {
                centre_m: [10.0 + x_m, -3.5, 0.75],
                velocity_mps: [20.0, 0.0, 0.0],
                ..OsiState::default()
            };
            let turned = OsiState {
                centre_m: [40.0, 3.5, 0.75],
                roll_pitch_yaw_rad: [0.0, 0.0, 0.1 * i as f64],
                ..OsiState::default()
            };
            OsiFrame {
                time_ns: 100_000_000 * i,
                states: vec![driven, turned],
            }
        };
        OsiTrace {
            description: "two bodies".to_owned(),
            bodies: vec![body(Class::Car), body(Class::Truck)],
            ego: 0,
            frames: (0..31).map(frame).collect(),
            open_drive: Some(("road.xodr".to_owned(), "<OpenDRIVE/>".to_owned())),
        }
    }

    #[test]
    fn a_written_trace_is_read_with_its_places_and_classes() {
        let bytes = write_osi(&trace());
        let recording = read_mcap(&bytes[..], "trace.mcap").expect("a recording");
        assert_eq!(recording.tracks.len(), 2);
        let driven = &recording.tracks[0];
        assert_eq!(driven.class, Class::Car);
        assert_eq!(recording.tracks[1].class, Class::Truck);
        assert!((driven.length_m - 4.5).abs() < 1e-9);
        assert!((recording.duration_s() - 3.0).abs() < 1e-9);
        let last = driven.x_m.len() - 1;
        assert!((driven.x_m[last] - driven.x_m[0] - 60.0).abs() < 1e-6);
    }

    #[test]
    fn axles_are_at_the_height_of_the_wheels() {
        let trace = trace();
        let object = trace.bodies[0].message(&trace.frames[0].states[0], 1);
        let attributes = object.attributes.expect("axles");
        let of = |it: Option<OsiVector>| it.map(|it| (it.x, it.z)).expect("a vector");
        // The centre is 0.75 m above the ground, and the wheels have a radius of 0.33 m.
        let up_m = Some(0.33 - 0.75);
        assert_eq!(of(attributes.bbcenter_to_rear), (Some(-1.4), up_m));
        assert_eq!(of(attributes.bbcenter_to_front), (Some(1.3), up_m));
    }

    #[test]
    fn the_records_are_where_the_indexes_say() {
        let bytes = write_osi(&trace());
        let number = |at: usize| {
            let bytes = bytes[at..at + 8].try_into().expect("8 bytes");
            u64::from_le_bytes(bytes) as usize
        };
        // The footer is 29 bytes before the magic at the end: kind, length, two offsets.
        let footer = bytes.len() - 8 - 29;
        assert_eq!(bytes[footer], 0x02);
        let (summary_at, offsets_at) = (number(footer + 9), number(footer + 17));
        // The summary begins with a schema, and the first offset names that group.
        assert_eq!((bytes[summary_at], bytes[offsets_at]), (0x03, 0x0e));
        assert_eq!(bytes[offsets_at + 9], 0x03);
        assert_eq!(number(offsets_at + 10), summary_at);
        assert_eq!(write_osi(&trace()), bytes);
    }
}
