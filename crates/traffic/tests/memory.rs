//! Memory of the readers: at most a constant, and a multiple of the file's size.
//!
//! The only test of this program, so that nothing else allocates beside it.

use std::fmt::Write;

use brakecheck_traffic::{
    ReadError, TrafficRecording, read_csv_guessed, read_mcap, read_osi, read_xosc,
};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bound of the memory: bytes for any file, and bytes per byte of it.
const ANY: usize = 100 << 20;
const PER_BYTE: usize = 250;

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Protocol buffers store seven bits per byte, the lowest first.
    while value > 0x7f {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// Field of a message.
fn nested(number: u64, content: &[u8]) -> Vec<u8> {
    [
        // Wire type 2: the length precedes the content.
        &varint(number << 3 | 2)[..],
        &varint(content.len() as u64),
        content,
    ]
    .concat()
}

/// The smallest message of objects that is read: without places, which are then 0.
fn message(second: u64, ids: impl Iterator<Item = u64>) -> Vec<u8> {
    let instant = nested(2, &[varint(1 << 3), varint(second)].concat());
    // An empty position, since proto3 leaves out zeros.
    let base = nested(2, &nested(2, &[]));
    let objects = ids.flat_map(|id| {
        let id = nested(1, &[varint(1 << 3), varint(id)].concat());
        nested(5, &[id, base.clone()].concat())
    });
    instant.into_iter().chain(objects).collect()
}

fn osi(message: &[u8]) -> Vec<u8> {
    // A file of OSI states the length of each message before it.
    [&(message.len() as u32).to_le_bytes()[..], message].concat()
}

fn record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind][..], &(content.len() as u64).to_le_bytes(), content].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// Records of a channel of ground truth with these messages.
fn records(messages: &[Vec<u8>]) -> Vec<u8> {
    let schema = [
        &[1, 0][..],
        &text("osi3.GroundTruth"),
        &text("protobuf"),
        &text(""),
    ];
    let channel = [&[1, 0, 1, 0][..], &text("t"), &text("protobuf"), &[0; 4]];
    let mut all = [record(3, &schema.concat()), record(4, &channel.concat())].concat();
    for message in messages {
        all.extend(record(5, &[&[1, 0][..], &[0; 20], message].concat()));
    }
    all
}

/// File of chunks, each of which announces a size.
fn mcap(chunks: &[(&str, u64, Vec<u8>)]) -> Vec<u8> {
    let mut file = b"\x89MCAP0\r\n".to_vec();
    for (compression, size, packed) in chunks {
        // Times of the first and last message, size, checksum (0: none) and compression.
        let head = [
            &[0; 16][..],
            &size.to_le_bytes(),
            &[0; 4],
            &text(compression),
        ];
        let length = (packed.len() as u64).to_le_bytes();
        file.extend(record(6, &[&head.concat()[..], &length, packed].concat()));
    }
    // The end of data, without a summary.
    file.extend(record(15, &[0; 4]));
    file
}

/// Chunk whose records are packed by zstd as far as they go.
fn zstd(records: &[u8]) -> (&'static str, u64, Vec<u8>) {
    let level = ruzstd::encoding::CompressionLevel::Fastest;
    let packed = ruzstd::encoding::compress_to_vec(records, level);
    ("zstd", records.len() as u64, packed)
}

/// Frame of zstd that says a byte of zeros `blocks` times 128 kB, in 4 bytes each.
fn zeros(blocks: u64) -> (&'static str, u64, Vec<u8>) {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, 0x58];
    for block in 1..=blocks {
        // Block type 1 repeats a single byte.
        let header = (128_u32 << 10) << 3 | 1 << 1 | u32::from(block == blocks);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.push(0);
    }
    ("zstd", blocks << 17, frame)
}

type Read = fn(&[u8]) -> Result<TrafficRecording, ReadError>;

/// Names, readers and files, with a part of the error. It is empty for a file that is read.
fn hostile() -> Vec<(&'static str, Read, Vec<u8>, &'static str)> {
    let read_osi: Read = |it| read_osi(it, "a.osi");
    let read_mcap: Read = |it| read_mcap(it, "a.mcap");
    let read_csv: Read = |it| read_csv_guessed(it, "a.csv").map(|it| it.0);
    let read_xosc: Read = |it| read_xosc(it, "a.xosc");
    // Field 5 without content, a million times.
    let empty_objects: Vec<u8> = [0x2a, 0].repeat(1 << 20);
    // A message that announces 128 MB and has none.
    let mut cut = record(5, &[]);
    cut[1..9].copy_from_slice(&(1_u64 << 27).to_le_bytes());
    // As many objects as a motorway never has, in each of 300 messages.
    let again: Vec<Vec<u8>> = (0..300).map(|i| message(i, 0..4000)).collect();
    let others = message(0, 0..1_500_000);
    let mut uneven = "time,id,x,y\n".to_owned();
    for i in 0..20_000 {
        // Half of the steps are 0.0005 s, and half of them nearly half a second.
        let time_s = f64::from(i / 2) * 0.5 + f64::from(i % 2) * 0.0005;
        let _ = writeln!(uneven, "{time_s},a,{i},0");
    }
    let mut actors = "<OpenSCENARIO><ManeuverGroup><Actors>".to_owned();
    for i in 0..20_000 {
        let _ = write!(actors, "<EntityRef entityRef='{i}'/>");
    }
    actors += "</Actors><Event><Trajectory><Polyline>";
    for i in 0..20_000 {
        let place = "<Position><WorldPosition x='0' y='0'/></Position>";
        let _ = write!(actors, "<Vertex time='{i}'>{place}</Vertex>");
    }
    actors += "</Polyline></Trajectory></Event></ManeuverGroup></OpenSCENARIO>";
    // The name of a schema announces 4 GB.
    let name = record(3, &[1, 0, 0xff, 0xff, 0xff, 0xff, 0x61]);
    let name = [b"\x89MCAP0\r\n", &name[..]].concat();
    let none = [b"\x89MCAP0\r\n", &cut[..]].concat();
    let packed = |messages: &[Vec<u8>]| mcap(&[zstd(&records(messages))]);
    vec![
        (
            "objects of two bytes",
            read_osi,
            osi(&empty_objects),
            "no `timestamp`",
        ),
        (
            "a length without bytes",
            read_osi,
            vec![0xff, 0xff, 0xff, 0x0f, 1],
            "ends early",
        ),
        (
            "a text without bytes",
            read_mcap,
            name,
            "too short for its fields",
        ),
        ("a record without bytes", read_mcap, none, "ends early"),
        (
            "zeros of 128 MB",
            read_mcap,
            mcap(&[zeros(1023)]),
            "unpacks to 134086656 bytes",
        ),
        (
            "zeros in many chunks",
            read_mcap,
            mcap(&vec![zeros(120); 400]),
            "ends early",
        ),
        (
            "a size without bytes",
            read_mcap,
            mcap(&[("lz4", 1 << 27, vec![0; 9])]),
            "unpacks to",
        ),
        (
            "packed objects of two bytes",
            read_mcap,
            packed(&[empty_objects]),
            "no `timestamp`",
        ),
        (
            "packed road users",
            read_mcap,
            packed(&[others]),
            "moving objects in the first",
        ),
        // A second per row and 4,000 road users: what is whole is read.
        ("packed rows", read_mcap, packed(&again), ""),
        (
            "uneven instants",
            read_csv,
            uneven.into_bytes(),
            "too uneven",
        ),
        (
            "many entities on a line",
            read_xosc,
            actors.into_bytes(),
            "more than 100 entities",
        ),
    ]
}

#[test]
fn hostile_files_take_bounded_memory() {
    for (what, read, file, part) in hostile() {
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let error = read(&file).err();
        let peak = MEMORY.peak_usage() - before;
        let size = file.len();
        let said = error.map(|it| it.to_string()).unwrap_or_default();
        println!("{what}: {size} bytes, {} kB, {said}", peak >> 10);
        assert!(
            said.contains(part) && part.is_empty() == said.is_empty(),
            "{what}: {said}"
        );
        assert!(
            peak <= ANY + PER_BYTE * size,
            "{what}: {peak} for {size} bytes"
        );
    }
}
