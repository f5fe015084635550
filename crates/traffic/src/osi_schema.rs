//! Descriptors of the OSI messages that are written.
//!
//! MCAP files describe their messages, so that readers need no code of OSI. The
//! descriptors have the names, numbers and types of OSI 3.7, and only the fields that
//! [`write_osi`](crate::write_osi) fills.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
    FileDescriptorProto, FileDescriptorSet,
};

/// Returns the serialized description of `osi3.GroundTruth`.
pub(crate) fn ground_truth() -> Vec<u8> {
    file(
        "osi_groundtruth.proto",
        vec![
            message(
                "InterfaceVersion",
                &[
                    "version_major: u32 = 1",
                    "version_minor: u32 = 2",
                    "version_patch: u32 = 3",
                ],
            ),
            message("Timestamp", &["seconds: i64 = 1", "nanos: u32 = 2"]),
            message("Identifier", &["value: u64 = 1"]),
            message("Vector3d", &["x: f64 = 1", "y: f64 = 2", "z: f64 = 3"]),
            message(
                "Dimension3d",
                &["length: f64 = 1", "width: f64 = 2", "height: f64 = 3"],
            ),
            message(
                "Orientation3d",
                &["roll: f64 = 1", "pitch: f64 = 2", "yaw: f64 = 3"],
            ),
            message(
                "BaseMoving",
                &[
                    "dimension: Dimension3d = 1",
                    "position: Vector3d = 2",
                    "orientation: Orientation3d = 3",
                    "velocity: Vector3d = 4",
                    "acceleration: Vector3d = 5",
                    "orientation_rate: Orientation3d = 6",
                ],
            ),
            moving_object(),
            message(
                "GroundTruth",
                &[
                    "version: InterfaceVersion = 1",
                    "timestamp: Timestamp = 2",
                    "host_vehicle_id: Identifier = 3",
                    "moving_object: [MovingObject] = 5",
                    "map_reference: str = 15",
                ],
            ),
        ],
    )
}

/// Returns the serialized description of `osi3.MapAsamOpenDrive`.
pub(crate) fn open_drive() -> Vec<u8> {
    let fields = ["map_reference: str = 1", "open_drive_xml_content: str = 2"];
    let map = message("MapAsamOpenDrive", &fields);
    file("osi_mapasamopendrive.proto", vec![map])
}

fn moving_object() -> DescriptorProto {
    let mut classification = message(
        "VehicleClassification",
        &[
            "type: enum MovingObject.VehicleClassification.Type = 1",
            "role: enum MovingObject.VehicleClassification.Role = 5",
        ],
    );
    classification.enum_type = vec![
        choices(
            "Type",
            &[
                ("TYPE_UNKNOWN", 0),
                ("TYPE_OTHER", 1),
                ("TYPE_CAR", 4),
                ("TYPE_VAN", 6),
                ("TYPE_HEAVY_TRUCK", 7),
                ("TYPE_TRAILER", 9),
                ("TYPE_MOTORCYCLE", 10),
                ("TYPE_BICYCLE", 11),
            ],
        ),
        choices(
            "Role",
            &[("ROLE_UNKNOWN", 0), ("ROLE_OTHER", 1), ("ROLE_CIVIL", 2)],
        ),
    ];
    let mut object = message(
        "MovingObject",
        &[
            "id: Identifier = 1",
            "base: BaseMoving = 2",
            "type: enum MovingObject.Type = 3",
            "vehicle_attributes: MovingObject.VehicleAttributes = 5",
            "vehicle_classification: MovingObject.VehicleClassification = 6",
        ],
    );
    object.nested_type = vec![
        message(
            "VehicleAttributes",
            &[
                "bbcenter_to_rear: Vector3d = 4",
                "bbcenter_to_front: Vector3d = 5",
            ],
        ),
        classification,
    ];
    object.enum_type = vec![choices(
        "Type",
        &[
            ("TYPE_UNKNOWN", 0),
            ("TYPE_OTHER", 1),
            ("TYPE_VEHICLE", 2),
            ("TYPE_PEDESTRIAN", 3),
            ("TYPE_ANIMAL", 4),
        ],
    )];
    object
}

fn file(name: &str, messages: Vec<DescriptorProto>) -> Vec<u8> {
    let file = FileDescriptorProto {
        name: Some(name.to_owned()),
        package: Some("osi3".to_owned()),
        message_type: messages,
        // As in OSI, whose fields are optional and state their presence.
        syntax: Some("proto2".to_owned()),
        ..FileDescriptorProto::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

/// Returns a message of fields, each as `name: type = number`.
fn message(name: &str, fields: &[&str]) -> DescriptorProto {
    DescriptorProto {
        name: Some(name.to_owned()),
        field: fields.iter().filter_map(|text| field(text)).collect(),
        ..DescriptorProto::default()
    }
}

/// Returns a field. `None` for a text of another form, which no caller has.
fn field(text: &str) -> Option<FieldDescriptorProto> {
    let (name, rest) = text.split_once(": ")?;
    let (kind, number) = rest.split_once(" = ")?;
    let repeated = kind.strip_prefix('[').and_then(|it| it.strip_suffix(']'));
    let enumeration = kind.strip_prefix("enum ");
    let (kind, type_name) = match kind {
        "u32" => (Type::Uint32, None),
        "u64" => (Type::Uint64, None),
        "i64" => (Type::Int64, None),
        "f64" => (Type::Double, None),
        "str" => (Type::String, None),
        other => match (repeated, enumeration) {
            (Some(of), _) => (Type::Message, Some(of)),
            (None, Some(of)) => (Type::Enum, Some(of)),
            (None, None) => (Type::Message, Some(other)),
        },
    };
    let label = match repeated {
        Some(_) => Label::Repeated,
        None => Label::Optional,
    };
    Some(FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number.parse().ok()?),
        label: Some(label.into()),
        r#type: Some(kind.into()),
        // The leading dot makes the name absolute, so that no reader resolves
        // it.
        type_name: type_name.map(|it| format!(".osi3.{it}")),
        ..FieldDescriptorProto::default()
    })
}

fn choices(name: &str, values: &[(&str, i32)]) -> EnumDescriptorProto {
    let value = |(name, number): &(&str, i32)| EnumValueDescriptorProto {
        name: Some((*name).to_owned()),
        number: Some(*number),
        options: None,
    };
    EnumDescriptorProto {
        name: Some(name.to_owned()),
        value: values.iter().map(value).collect(),
        ..EnumDescriptorProto::default()
    }
}
