//! Reading of OSI traces in MCAP.
//!
//! An MCAP file is a magic, then records: a type, a length and fields, lowest byte first.
//! A chunk is a record that holds records, often compressed. Indexes and the summary at
//! the end are not needed.

use std::collections::HashMap;
use std::io::{BufReader, Read};

use crate::error::ReadError;
use crate::osi::{OsiKind, OsiTracks, read_bytes};
use crate::problem::{FilePlace, FileProblem};
use crate::recording::TrafficRecording;

/// Beginning and end of an MCAP file.
pub(crate) const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Greatest length of a record and of an unpacked chunk in bytes.
const MOST_BYTES: u64 = 1 << 27;

// Types of records.
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0f;

/// Reads an OSI trace in MCAP: `.mcap`. Errors call it by `name`.
///
/// Messages have the schema `osi3.GroundTruth` or `osi3.SensorView`. The first channel
/// with such a message is read, and messages of further ones are counted. Chunks are not
/// compressed, or compressed with lz4 or zstd.
///
/// # Errors
/// The file is not MCAP, ends early, or a message is invalid.
pub fn read_mcap(trace: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    let mut reader = BufReader::with_capacity(1 << 18, trace);
    let mut file = McapFile::new(name);
    let mut content = Vec::new();
    read_bytes(&mut reader, MAGIC.len() as u64, &mut content, name)?;
    if content != MAGIC {
        return Err(file.tracks.error(FilePlace::Whole, FileProblem::NotMcap));
    }
    let mut offset = MAGIC.len() as u64;
    loop {
        let place = FilePlace::Byte(offset);
        read_bytes(&mut reader, 9, &mut content, name)?;
        let mut head = Fields(&content);
        let (Some(kind), Some(length)) = (head.u8(), head.u64()) else {
            return Err(file.tracks.cut(place, content.len() as u64, 9));
        };
        if MOST_BYTES < length {
            return Err(file.tracks.error(place, FileProblem::TooLong(length)));
        }
        read_bytes(&mut reader, length, &mut content, name)?;
        if (content.len() as u64) < length {
            return Err(file.tracks.cut(place, content.len() as u64, length));
        }
        match kind {
            DATA_END => return file.finish(),
            CHUNK => file.chunk(&content, offset)?,
            _ => file.record(kind, &content, offset)?,
        }
        offset += 9 + length;
    }
}

/// Fields of a record, taken from the front.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn u8(&mut self) -> Option<u8> {
        Some(u8::from_le_bytes(self.array()?))
    }

    fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(self.array()?))
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.array()?))
    }

    fn text(&mut self) -> Option<String> {
        let length = usize::try_from(self.u32()?).ok()?;
        Some(String::from_utf8_lossy(self.bytes(length)?).into_owned())
    }
}

/// State of the reading.
struct McapFile<'a> {
    tracks: OsiTracks<'a>,
    /// Names of the schemas by their numbers.
    schemas: HashMap<u16, String>,
    /// Schema names and encodings of the channels by their numbers.
    channels: HashMap<u16, (String, String)>,
    /// Channel that is read.
    channel: Option<u16>,
    messages: u64,
}

impl<'a> McapFile<'a> {
    fn new(name: &'a str) -> McapFile<'a> {
        McapFile {
            tracks: OsiTracks::new(name),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            channel: None,
            messages: 0,
        }
    }

    /// Reads the records of a chunk.
    fn chunk(&mut self, content: &[u8], offset: u64) -> Result<(), ReadError> {
        let error = |problem| self.tracks.error(FilePlace::Byte(offset), problem);
        let records = unpacked(content).map_err(error)?;
        let mut rest = Fields(&records);
        while !rest.0.is_empty() {
            let head = rest.u8().zip(rest.u64());
            let record = head.and_then(|(kind, length)| {
                Some((kind, rest.bytes(usize::try_from(length).ok()?)?))
            });
            let Some((kind, record)) = record else {
                let problem = FileProblem::Record(CHUNK);
                return Err(self.tracks.error(FilePlace::Byte(offset), problem));
            };
            self.record(kind, record, offset)?;
        }
        Ok(())
    }

    /// Reads a record that is no chunk. Others than those of messages are skipped.
    fn record(&mut self, kind: u8, content: &[u8], offset: u64) -> Result<(), ReadError> {
        let read = match kind {
            SCHEMA => self.schema(content),
            CHANNEL => self.channel(content),
            MESSAGE => return self.message(content, offset),
            _ => Some(()),
        };
        let short = || {
            let problem = FileProblem::Record(kind);
            self.tracks.error(FilePlace::Byte(offset), problem)
        };
        read.ok_or_else(short)
    }

    fn schema(&mut self, content: &[u8]) -> Option<()> {
        let mut fields = Fields(content);
        let (id, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(id, name);
        Some(())
    }

    fn channel(&mut self, content: &[u8]) -> Option<()> {
        let mut fields = Fields(content);
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (_topic, encoding) = (fields.text()?, fields.text()?);
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        self.channels.insert(id, (schema, encoding));
        Some(())
    }

    fn message(&mut self, content: &[u8], offset: u64) -> Result<(), ReadError> {
        let mut fields = Fields(content);
        // The sequence number and the times of logging and publishing are not needed.
        let channel = fields.u16();
        let (Some(channel), Some(_)) = (channel, fields.bytes(20)) else {
            let problem = FileProblem::Record(MESSAGE);
            return Err(self.tracks.error(FilePlace::Byte(offset), problem));
        };
        let Some(kind) = self.kind_of(channel) else {
            return Ok(());
        };
        if *self.channel.get_or_insert(channel) != channel {
            self.tracks.counts.other_messages += 1;
            return Ok(());
        }
        self.tracks.kind = Some(kind);
        self.messages += 1;
        let number = self.messages;
        self.tracks
            .push(fields.0, FilePlace::Message { number, offset })
    }

    fn kind_of(&self, channel: u16) -> Option<OsiKind> {
        let (schema, encoding) = self.channels.get(&channel)?;
        match (&**schema, &**encoding) {
            ("osi3.GroundTruth", "protobuf") => Some(OsiKind::GroundTruth),
            ("osi3.SensorView", "protobuf") => Some(OsiKind::SensorView),
            _ => None,
        }
    }

    fn finish(self) -> Result<TrafficRecording, ReadError> {
        if self.channel.is_some() {
            return self.tracks.finish();
        }
        let mut found: Vec<&str> = self.schemas.values().map(|it| &**it).collect();
        found.sort_unstable();
        let found = format!("schemas: {}", found.join(", "));
        let problem = FileProblem::NoGroundTruth(found);
        Err(self.tracks.error(FilePlace::Whole, problem))
    }
}

/// Returns the records of a chunk.
fn unpacked(content: &[u8]) -> Result<Vec<u8>, FileProblem> {
    let mut fields = Fields(content);
    let mut parts = || {
        let _span = fields.bytes(16)?;
        let (size, checksum, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
        let length = usize::try_from(fields.u64()?).ok()?;
        Some((size, checksum, compression, fields.bytes(length)?))
    };
    let (size, checksum, compression, packed) = parts().ok_or(FileProblem::Record(CHUNK))?;
    if MOST_BYTES < size {
        return Err(FileProblem::TooLong(size));
    }
    let records = match &*compression {
        "" => packed.to_vec(),
        "lz4" => read_all(lz4_flex::frame::FrameDecoder::new(packed), size)?,
        "zstd" => {
            let failed = |error: String| FileProblem::Decompress(error);
            let decoder = ruzstd::decoding::StreamingDecoder::new(packed);
            read_all(decoder.map_err(|error| failed(error.to_string()))?, size)?
        }
        _ => return Err(FileProblem::Compression(compression)),
    };
    if records.len() as u64 != size {
        let got = records.len() as u64;
        return Err(FileProblem::Cut { got, want: size });
    }
    // A checksum of 0 is none.
    if checksum != 0 && checksum != crc32(&records) {
        return Err(FileProblem::Checksum);
    }
    Ok(records)
}

/// Reads a decompressor up to one byte more than expected.
fn read_all(decoder: impl Read, size: u64) -> Result<Vec<u8>, FileProblem> {
    let mut records = Vec::new();
    let read = decoder.take(size + 1).read_to_end(&mut records);
    read.map_err(|error| FileProblem::Decompress(error.to_string()))?;
    Ok(records)
}

/// Returns the CRC-32 of zip and Ethernet.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    let table: [u32; 256] = std::array::from_fn(|i| {
        (0..8).fold(i as u32, |rest, _| (rest >> 1) ^ (0xedb8_8320 * (rest & 1)))
    });
    let step = |crc: u32, byte: &u8| (crc >> 8) ^ table[((crc ^ u32::from(*byte)) & 0xff) as usize];
    !bytes.iter().fold(!0, step)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_checksum_is_that_of_the_catalogue() {
        assert_eq!(super::crc32(b"123456789"), 0xcbf4_3926);
    }
}
