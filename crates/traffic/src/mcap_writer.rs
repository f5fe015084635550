//! Writing of MCAP files: channels of messages in one chunk, with indexes.
//!
//! The file has all records that a reader needs for random access: indexes of the
//! messages and of the chunk, statistics, and a summary that repeats schemas and
//! channels. Numbers have their lowest byte first.

use crate::mcap::{MAGIC, crc32};

// Types of records.
const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const CHUNK_INDEX: u8 = 0x08;
const STATISTICS: u8 = 0x0b;
const METADATA: u8 = 0x0c;
const METADATA_INDEX: u8 = 0x0d;
const SUMMARY_OFFSET: u8 = 0x0e;
const DATA_END: u8 = 0x0f;

/// Pairs of names and values.
pub(crate) type Entries<'a> = &'a [(&'a str, &'a str)];

/// Channel with its messages in the order of time. All are protobuf.
pub(crate) struct McapChannel<'a> {
    pub topic: &'a str,
    /// Name of the message type, and its serialized `FileDescriptorSet`.
    pub schema: (&'a str, Vec<u8>),
    pub metadata: Entries<'a>,
    /// Times in nanoseconds, and serialized messages.
    pub messages: Vec<(u64, Vec<u8>)>,
}

/// Record in the making.
#[derive(Default)]
struct RecordFields(Vec<u8>);

impl RecordFields {
    fn u16(mut self, value: u16) -> RecordFields {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn u32(mut self, value: u32) -> RecordFields {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn u64(mut self, value: u64) -> RecordFields {
        self.0.extend(value.to_le_bytes());
        self
    }

    fn byte(mut self, value: u8) -> RecordFields {
        self.0.push(value);
        self
    }

    /// Adds bytes as they are.
    fn raw(mut self, bytes: &[u8]) -> RecordFields {
        self.0.extend(bytes);
        self
    }

    /// Adds bytes behind their length.
    fn bytes(self, bytes: &[u8]) -> RecordFields {
        // Invariant: no text and no list of a trace has 4 GB.
        let length = bytes.len() as u32;
        self.u32(length).raw(bytes)
    }

    fn text(self, text: &str) -> RecordFields {
        self.bytes(text.as_bytes())
    }

    fn entries(self, entries: Entries<'_>) -> RecordFields {
        let all = entries
            .iter()
            .fold(RecordFields::default(), |all, (name, value)| {
                all.text(name).text(value)
            });
        self.bytes(&all.0)
    }
}

/// Appends a record and returns its offset and its whole length.
fn record(file: &mut Vec<u8>, kind: u8, fields: RecordFields) -> (u64, u64) {
    let offset = file.len() as u64;
    file.push(kind);
    file.extend((fields.0.len() as u64).to_le_bytes());
    file.extend(fields.0);
    (offset, file.len() as u64 - offset)
}

/// Returns an MCAP file of channels, with a record of metadata of the given name.
///
/// Schemas and channels are numbered from 1 in the order of `channels`.
pub(crate) fn mcap(channels: &[McapChannel<'_>], (name, metadata): (&str, Entries<'_>)) -> Vec<u8> {
    let mut file = MAGIC.to_vec();
    let library = concat!("brakecheck ", env!("CARGO_PKG_VERSION"));
    record(
        &mut file,
        HEADER,
        RecordFields::default().text("").text(library),
    );
    let described = RecordFields::default().text(name).entries(metadata);
    let (metadata_at, metadata_length) = record(&mut file, METADATA, described);
    let chunk = Chunk::of(channels);
    let indexed = chunk.write(&mut file);
    // The data section ends here: everything before is under this checksum.
    let checksum = crc32(&file);
    record(&mut file, DATA_END, RecordFields::default().u32(checksum));

    let summary_at = file.len() as u64;
    let mut groups = Vec::new();
    let mut group = |file: &mut Vec<u8>, kind: u8, records: Vec<RecordFields>| {
        let from = file.len() as u64;
        for fields in records {
            record(file, kind, fields);
        }
        groups.push((kind, from, file.len() as u64 - from));
    };
    group(&mut file, SCHEMA, numbered(channels, schema));
    group(&mut file, CHANNEL, numbered(channels, channel));
    group(&mut file, STATISTICS, vec![chunk.statistics(channels)]);
    group(&mut file, CHUNK_INDEX, vec![indexed]);
    let index = RecordFields::default()
        .u64(metadata_at)
        .u64(metadata_length);
    group(&mut file, METADATA_INDEX, vec![index.text(name)]);
    let offsets_at = file.len() as u64;
    for (kind, from, length) in groups {
        let offset = RecordFields::default().byte(kind).u64(from).u64(length);
        record(&mut file, SUMMARY_OFFSET, offset);
    }
    // The checksum of the summary covers the footer up to the checksum itself.
    let footer = RecordFields::default().u64(summary_at).u64(offsets_at);
    let mut covered = file[summary_at as usize..].to_vec();
    covered.push(FOOTER);
    covered.extend(20_u64.to_le_bytes());
    covered.extend(&footer.0);
    record(&mut file, FOOTER, footer.u32(crc32(&covered)));
    file.extend(MAGIC);
    file
}

/// Returns a record per channel, with its number.
fn numbered<'a>(
    channels: &'a [McapChannel<'a>],
    fields: impl Fn(u16, &McapChannel<'_>) -> RecordFields,
) -> Vec<RecordFields> {
    (1..).zip(channels).map(|(id, it)| fields(id, it)).collect()
}

fn schema(id: u16, channel: &McapChannel<'_>) -> RecordFields {
    let (name, descriptors) = &channel.schema;
    let fields = RecordFields::default().u16(id).text(name).text("protobuf");
    fields.bytes(descriptors)
}

fn channel(id: u16, channel: &McapChannel<'_>) -> RecordFields {
    let fields = RecordFields::default().u16(id).u16(id).text(channel.topic);
    fields.text("protobuf").entries(channel.metadata)
}

/// Records of all channels, with the place of every message.
struct Chunk {
    records: Vec<u8>,
    /// Time and offset of the messages of each channel.
    places: Vec<Vec<(u64, u64)>>,
}

impl Chunk {
    fn of(channels: &[McapChannel<'_>]) -> Chunk {
        let mut records = Vec::new();
        for (kind, described) in [
            (SCHEMA, numbered(channels, schema)),
            (CHANNEL, numbered(channels, channel)),
        ] {
            for fields in described {
                record(&mut records, kind, fields);
            }
        }
        // In the order of time, those of the first channel first.
        let mut messages: Vec<(u64, usize, &[u8])> = Vec::new();
        for (nth, channel) in channels.iter().enumerate() {
            let own = channel.messages.iter();
            messages.extend(own.map(|(time_ns, message)| (*time_ns, nth, &message[..])));
        }
        messages.sort_by_key(|(time_ns, nth, _)| (*time_ns, *nth));
        let mut places = vec![Vec::new(); channels.len()];
        for (time_ns, nth, message) in messages {
            let fields = RecordFields::default().u16(nth as u16 + 1).u32(0);
            let fields = fields.u64(time_ns).u64(time_ns).raw(message);
            let (offset, _) = record(&mut records, MESSAGE, fields);
            places[nth].push((time_ns, offset));
        }
        Chunk { records, places }
    }

    /// Returns the first and the last time.
    fn span_ns(&self) -> (u64, u64) {
        let times = || self.places.iter().flatten().map(|(time_ns, _)| *time_ns);
        (times().min().unwrap_or(0), times().max().unwrap_or(0))
    }

    /// Appends the chunk with the indexes of its messages, and returns its own index.
    fn write(&self, file: &mut Vec<u8>) -> RecordFields {
        let (from_ns, to_ns) = self.span_ns();
        let size = self.records.len() as u64;
        let chunk = RecordFields::default().u64(from_ns).u64(to_ns).u64(size);
        let chunk = chunk.u32(crc32(&self.records)).text("").u64(size);
        let (chunk_at, chunk_length) = record(file, CHUNK, chunk.raw(&self.records));
        let indexes_at = file.len() as u64;
        let mut offsets = RecordFields::default();
        for (id, places) in (1..).zip(&self.places) {
            let entries = places
                .iter()
                .fold(RecordFields::default(), |all, (time, offset)| {
                    all.u64(*time).u64(*offset)
                });
            let index = RecordFields::default().u16(id).bytes(&entries.0);
            let (at, _) = record(file, MESSAGE_INDEX, index);
            offsets = offsets.u16(id).u64(at);
        }
        let indexes_length = file.len() as u64 - indexes_at;
        let index = RecordFields::default().u64(from_ns).u64(to_ns);
        let index = index.u64(chunk_at).u64(chunk_length).bytes(&offsets.0);
        index.u64(indexes_length).text("").u64(size).u64(size)
    }

    fn statistics(&self, channels: &[McapChannel<'_>]) -> RecordFields {
        let (from_ns, to_ns) = self.span_ns();
        let counts = || self.places.iter().map(|places| places.len() as u64);
        let per_channel = (1..)
            .zip(counts())
            .fold(RecordFields::default(), |all, (id, count)| {
                all.u16(id).u64(count)
            });
        let statistics = RecordFields::default().u64(counts().sum());
        let statistics = statistics
            .u16(channels.len() as u16)
            .u32(channels.len() as u32);
        // No attachment, one record of metadata and one chunk.
        let statistics = statistics.u32(0).u32(1).u32(1).u64(from_ns).u64(to_ns);
        statistics.bytes(&per_channel.0)
    }
}
