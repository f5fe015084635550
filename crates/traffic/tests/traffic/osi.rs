//! OSI traces as recordings.
//!
//! The files in `tests/data` are synthetic: a car, a bicycle and a pedestrian at twelve
//! instants. ASAM's own messages and the `mcap` package for Python wrote them. The other
//! traces are written here, field by field, from the published numbers.

use brakecheck_traffic::{Class, ReadError, TrafficRecording, read_mcap, read_osi};

const GT_OSI: &[u8] = include_bytes!("../data/gt.osi");
const SV_OSI: &[u8] = include_bytes!("../data/sv.osi");
const PLAIN: &[u8] = include_bytes!("../data/gt_none.mcap");
const LZ4: &[u8] = include_bytes!("../data/gt_lz4.mcap");
const ZSTD: &[u8] = include_bytes!("../data/sv_zstd.mcap");

type Read = fn(&[u8]) -> Result<TrafficRecording, ReadError>;

fn osi(bytes: &[u8]) -> Result<TrafficRecording, ReadError> {
    read_osi(bytes, "drive.osi")
}

fn mcap(bytes: &[u8]) -> Result<TrafficRecording, ReadError> {
    read_mcap(bytes, "drive.mcap")
}

fn good(read: Read, bytes: &[u8]) -> TrafficRecording {
    read(bytes).unwrap_or_else(|it| panic!("{it}"))
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 0x7f {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// Field of an integer, an enum or a Boolean.
fn int(number: u64, value: u64) -> Vec<u8> {
    [varint(number << 3), varint(value)].concat()
}

fn double(number: u64, value: f64) -> Vec<u8> {
    [varint(number << 3 | 1), value.to_le_bytes().to_vec()].concat()
}

/// Field of a message or of bytes.
fn nested(number: u64, parts: &[Vec<u8>]) -> Vec<u8> {
    let content = parts.concat();
    [
        varint(number << 3 | 2),
        varint(content.len() as u64),
        content,
    ]
    .concat()
}

/// Vehicle of 4 m × 2 m at (x, y) whose type has the code `kind`.
fn vehicle(id: u64, [x, y]: [f64; 2], kind: u64) -> Vec<Vec<u8>> {
    let size = nested(1, &[double(1, 4.0), double(2, 2.0), double(3, 1.5)]);
    let position = nested(2, &[double(1, x), double(2, y), double(3, 0.7)]);
    let base = nested(2, &[size, position]);
    let kind = nested(6, &[int(1, kind), int(5, 2)]);
    vec![nested(1, &[int(1, id)]), base, int(3, 2), kind]
}

fn ground_truth(time_ns: u64, objects: &[Vec<Vec<u8>>]) -> Vec<u8> {
    let version = nested(1, &[int(1, 3), int(2, 7)]);
    let time = nested(
        2,
        &[
            int(1, time_ns / 1_000_000_000),
            int(2, time_ns % 1_000_000_000),
        ],
    );
    let objects: Vec<Vec<u8>> = objects.iter().map(|it| nested(5, it)).collect();
    [version, time, objects.concat()].concat()
}

fn trace(messages: &[Vec<u8>]) -> Vec<u8> {
    let message = |it: &Vec<u8>| [&(it.len() as u32).to_le_bytes()[..], it].concat();
    messages.iter().flat_map(message).collect()
}

/// A car that drives to the north with 10 m/s, at the given instants.
fn drive(instants_ms: &[u64]) -> Vec<Vec<u8>> {
    let message = |ms: &u64| {
        let place = [5.0, 0.01 * *ms as f64];
        ground_truth(
            1_700_000_000_000_000_000 + ms * 1_000_000,
            &[vehicle(8, place, 4)],
        )
    };
    instants_ms.iter().map(message).collect()
}

#[test]
fn traces_of_other_writers_have_the_motion_that_was_written() {
    let traces: [(&str, Read, &[u8]); 5] = [
        ("gt.osi", osi, GT_OSI),
        ("sv.osi", osi, SV_OSI),
        ("gt_none.mcap", mcap, PLAIN),
        ("gt_lz4.mcap", mcap, LZ4),
        ("sv_zstd.mcap", mcap, ZSTD),
    ];
    for (name, read, bytes) in traces {
        let recording = good(read, bytes);
        assert_eq!(recording.origin_m, [1000.0, 2000.0], "{name}");
        assert!((recording.dt_s - 0.04).abs() < 1e-9, "{name}");
        assert_eq!(
            (recording.counts.rows, recording.counts.unknown_class),
            (36, 0)
        );
        let [car, bicycle, pedestrian] = &recording.tracks[..] else {
            panic!("{name}: {} tracks", recording.tracks.len());
        };
        let kinds = [car.class, bicycle.class, pedestrian.class];
        assert_eq!(
            kinds,
            [Class::Car, Class::Bicycle, Class::Pedestrian],
            "{name}"
        );
        assert_eq!(
            [&*car.id, &*bicycle.id],
            ["1", "9223372036854775813"],
            "{name}"
        );
        let heading_rad = 30.0_f64.to_radians();
        let (sin, cos) = heading_rad.sin_cos();
        for i in 0..12 {
            let t = 0.04 * i as f64;
            let way_m = 20.0 * t - 0.5 * t * t;
            let pairs = [
                (car.length_m, 4.5),
                (bicycle.width_m, 0.6),
                (car.x_m[i], way_m * cos),
                (car.y_m[i], way_m * sin),
                (car.heading_rad[i], heading_rad),
                (car.speed_mps[i], 20.0 - t),
                (car.accel_mps2[i], -1.0),
                (bicycle.x_m[i], 10.0),
                (bicycle.y_m[i], 10.0 + 5.0 * t),
                (bicycle.speed_mps[i], 5.0),
                (pedestrian.x_m[i], 20.0 - 1.5 * t),
            ];
            for (k, (a, b)) in pairs.into_iter().enumerate() {
                assert!(
                    (a - b).abs() < 1e-6,
                    "{name}, row {i}, value {k}: {a} and {b}"
                );
            }
        }
    }
}

#[test]
fn what_is_not_recorded_is_derived_and_irregular_instants_are_counted() {
    let recording = good(osi, &trace(&drive(&[0, 100, 170, 300, 400, 1500, 1600])));
    assert_eq!(recording.counts.off_grid, 1);
    assert_eq!(recording.counts.holes_split, 1);
    let track = &recording.tracks[0];
    assert_eq!((track.len(), track.class), (5, Class::Car));
    assert!((track.heading_rad[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    for i in 0..5 {
        assert!((track.y_m[i] - i as f64).abs() < 1e-6, "{}", track.y_m[i]);
        assert!(
            (track.speed_mps[i] - 10.0).abs() < 1e-6,
            "{}",
            track.speed_mps[i]
        );
    }
}

#[test]
fn types_of_objects_are_classes() {
    let kinds = [
        (2, Class::Car),
        (5, Class::Car),
        (6, Class::Van),
        (7, Class::Truck),
        (8, Class::Trailer),
        (9, Class::Trailer),
        (10, Class::Motorcycle),
        (11, Class::Bicycle),
        (12, Class::Truck),
        (15, Class::Pedestrian),
        (16, Class::Truck),
        (99, Class::Other),
    ];
    let object = |(i, (kind, _)): (usize, &(u64, Class))| vehicle(i as u64, [0.0, 0.0], *kind);
    let objects: Vec<Vec<Vec<u8>>> = kinds.iter().enumerate().map(object).collect();
    let messages = [0, 100_000_000].map(|ns| ground_truth(ns, &objects));
    let recording = good(osi, &trace(&messages));
    for (track, (kind, class)) in recording.tracks.iter().zip(&kinds) {
        assert_eq!(track.class, *class, "type {kind}");
    }
    assert_eq!(recording.counts.unknown_class, 2);
    // An object without a size has that of its class.
    let mut object = vehicle(1, [0.0, 0.0], 7);
    object[1] = nested(2, &[nested(2, &[double(1, 1.0)])]);
    let messages = [0, 100_000_000].map(|ns| ground_truth(ns, std::slice::from_ref(&object)));
    let recording = good(osi, &trace(&messages));
    assert_eq!(recording.tracks[0].length_m, Class::Truck.usual_size_m()[0]);
    assert_eq!(recording.counts.assumed_sizes, 1);
}

/// Record of MCAP.
fn record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// Records of two channels of ground truth, the second on the same instants.
fn two_channels() -> Vec<u8> {
    let schema = [
        &[1, 0][..],
        &text("osi3.GroundTruth"),
        &text("protobuf"),
        &text(""),
    ]
    .concat();
    let channel = |id: u8| {
        let empty = 0_u32.to_le_bytes();
        let parts = [
            &[id, 0, 1, 0][..],
            &text("/topic"),
            &text("protobuf"),
            &empty,
        ];
        record(0x04, &parts.concat())
    };
    let message =
        |id: u8, message: &[u8]| record(0x05, &[&[id, 0][..], &[0; 20], message].concat());
    let mut records = [record(0x03, &schema), channel(4), channel(5)].concat();
    for it in drive(&[0, 100, 200]) {
        records.extend(message(4, &it));
        records.extend(message(5, &it));
    }
    records
}

fn file(records: &[u8]) -> Vec<u8> {
    let header = record(0x01, &[text(""), text("")].concat());
    let end = record(0x0f, &[0; 4]);
    [b"\x89MCAP0\r\n", &header[..], records, &end].concat()
}

fn chunk(records: &[u8], size: u64, checksum: u32, compression: &str) -> Vec<u8> {
    let head = [&[0; 16][..], &size.to_le_bytes(), &checksum.to_le_bytes()].concat();
    let length = (records.len() as u64).to_le_bytes();
    record(
        0x06,
        &[&head, &text(compression)[..], &length, records].concat(),
    )
}

#[test]
fn one_channel_is_read_and_the_messages_of_others_are_counted() {
    let records = two_channels();
    let packed = lz4_of(&records);
    for bytes in [
        file(&records),
        file(&chunk(&records, records.len() as u64, 0, "")),
        file(&chunk(&packed, records.len() as u64, 0, "lz4")),
    ] {
        let recording = good(mcap, &bytes);
        assert_eq!((recording.tracks.len(), recording.tracks[0].len()), (1, 3));
        assert_eq!(recording.counts.other_messages, 3);
    }
}

/// Frame of lz4 with one block that is not compressed.
fn lz4_of(bytes: &[u8]) -> Vec<u8> {
    // Independent blocks of up to 64 kB, no checksums. The last byte is that of the header.
    let head = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
    let length = (bytes.len() as u32 | 0x8000_0000).to_le_bytes();
    [&head[..], &length, bytes, &[0; 4]].concat()
}

#[test]
fn every_mistake_has_its_message_its_byte_and_a_fix() {
    let sensor_data = nested(5, &[int(1, 3)]);
    let without_time = nested(5, &vehicle(1, [0.0, 0.0], 4));
    let without_id = ground_truth(0, &[vehicle(1, [0.0, 0.0], 4)[1..].to_vec()]);
    let nowhere = ground_truth(0, &[vec![nested(1, &[int(1, 1)])]]);
    let infinite = ground_truth(0, &[vehicle(1, [f64::INFINITY, 0.0], 4)]);
    let first = drive(&[0]).remove(0);
    let second = 4 + first.len();
    let after = |message: Vec<u8>| trace(&[first.clone(), message]);
    let records = two_channels();
    let size = records.len() as u64;
    let cases: Vec<(Read, Vec<u8>, String, &str)> = vec![
        (
            osi,
            after(without_time),
            format!("`drive.osi`, message 2 at byte {second}: the message has no `timestamp`"),
            "fill the field",
        ),
        (
            osi,
            after(without_id),
            format!("`drive.osi`, message 2 at byte {second}: a moving object has no `id`"),
            "fill the field",
        ),
        (
            osi,
            after(nowhere),
            format!("`drive.osi`, message 2 at byte {second}: moving object 1 has no `base`"),
            "fill the field",
        ),
        (
            osi,
            after(infinite),
            format!(
                "`drive.osi`, message 2 at byte {second}: `base.position` of `moving object 1` is \
                 not a finite number: `inf`"
            ),
            "write a number",
        ),
        (
            osi,
            after(vec![0xff; 12]),
            format!("`drive.osi`, message 2 at byte {second}: invalid protobuf: "),
            "osi3.GroundTruth",
        ),
        (
            osi,
            trace(&[sensor_data]),
            "`drive.osi`: no moving object in osi3.GroundTruth or osi3.SensorView (the".to_owned(),
            "osi3.SensorView with global_ground_truth",
        ),
        (
            osi,
            trace(&[first.clone(), first.clone()]),
            "`drive.osi`: road user `8` has two rows at 0.000 s".to_owned(),
            "remove one of the rows",
        ),
        (
            osi,
            b"time,id,x,y\n1,2,3,4\n".to_vec(),
            "`drive.osi`, message 1 at byte 0: a length of 1701669236 bytes".to_owned(),
            "name an OSI trace",
        ),
        (
            osi,
            Vec::new(),
            "`drive.osi`: no moving object".to_owned(),
            "record",
        ),
        (
            mcap,
            b"PK\x03\x04".to_vec(),
            "`drive.mcap`: the file does not begin".to_owned(),
            ".osi",
        ),
        (
            mcap,
            file(&chunk(&records, size, 7, "")),
            "`drive.mcap`, byte 25: the checksum of the chunk".to_owned(),
            "mcap recover",
        ),
        (
            mcap,
            file(&chunk(&records, size + 1, 0, "")),
            format!(
                "`drive.mcap`, byte 25: the file ends early: {size} of {} bytes",
                size + 1
            ),
            "mcap recover",
        ),
        (
            mcap,
            file(&chunk(&records, size, 0, "brotli")),
            "`drive.mcap`, byte 25: chunks compressed with `brotli` are not read".to_owned(),
            "mcap compress --compression lz4",
        ),
        (
            mcap,
            file(&record(0x05, &[4, 0])),
            "`drive.mcap`, byte 25: an MCAP record of type 0x05 is too short".to_owned(),
            "mcap recover",
        ),
        (
            mcap,
            file(
                &records
                    .clone()
                    .into_iter()
                    .map(|it| if it == b'G' { b'D' } else { it })
                    .collect::<Vec<u8>>(),
            ),
            "`drive.mcap`: no moving object in osi3.GroundTruth or osi3.SensorView (schemas: \
             osi3.DroundTruth)"
                .to_owned(),
            "record osi3.GroundTruth",
        ),
    ];
    for (read, bytes, message, fix) in cases {
        let error = read(&bytes).expect_err(&message);
        assert!(
            error.to_string().starts_with(&message),
            "{error}\n{message}"
        );
        assert!(error.help().contains(fix), "{}", error.help());
    }
}

#[test]
fn a_trace_that_ends_early_is_refused_and_damage_is_no_panic() {
    let ends = {
        let mut ends = vec![0];
        while let Some(head) = GT_OSI
            .get(*ends.last().expect("one")..)
            .and_then(|it| it.get(..4))
        {
            let length = u32::from_le_bytes(head.try_into().expect("four"));
            ends.push(ends.last().expect("one") + 4 + length as usize);
        }
        ends
    };
    let files: [(Read, &[u8]); 5] = [
        (osi, GT_OSI),
        (osi, SV_OSI),
        (mcap, PLAIN),
        (mcap, LZ4),
        (mcap, ZSTD),
    ];
    for (read, bytes) in files {
        for cut in (1..bytes.len()).step_by(97) {
            let Ok(recording) = read(&bytes[..cut]) else {
                continue;
            };
            // Only behind a whole message, or in the summary of MCAP.
            let is_whole = bytes[0] != 0x89 && ends.contains(&cut);
            let is_summary = bytes[0] == 0x89 && recording.counts.rows == 36;
            assert!(is_whole || is_summary, "cut at {cut}");
        }
        let mut damaged = bytes.to_vec();
        for at in (0..bytes.len()).step_by(97).chain(0..64) {
            for byte in [0x00, 0x01, 0x7f, 0x80, 0xff] {
                let old = std::mem::replace(&mut damaged[at], byte);
                let _ = read(&damaged);
                damaged[at] = old;
            }
        }
    }
    let cut = &GT_OSI[..ends[3] + 40];
    let error = osi(cut).expect_err("cut");
    let want = ends[4] - ends[3] - 4;
    let message = format!(
        "`drive.osi`, message 4 at byte {}: the file ends early: 36 of {want} bytes are left",
        ends[3]
    );
    assert_eq!(error.to_string(), message);
    // The fix works.
    assert!(error.help().contains("head -c OFFSET"), "{}", error.help());
    assert_eq!(good(osi, &GT_OSI[..ends[3]]).counts.rows, 9);
}
