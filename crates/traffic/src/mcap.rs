//! OSI traces in MCAP.
//!
//! The crate `mcap` frames the records. Its decompressors are libraries in C, so chunks come
//! whole from it and are unpacked here. Its parser allocates what the length of a text says,
//! so the few fields are read here, too.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{BufReader, Read};

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

use crate::error::ReadError;
use crate::osi::{OsiKind, OsiTracks, read_bytes};
use crate::problem::{FilePlace, FileProblem};
use crate::recording::TrafficRecording;

/// Greatest length of a record and of an unpacked chunk in bytes.
const MOST_BYTES: usize = 1 << 27;
/// Bytes of a record before its content: its type and its length.
const HEAD: u64 = 9;
/// Bytes that the chunks of a file unpack to at most: a constant, and those per byte of
/// the file. Frames that repeat a whole map are packed to a hundredth.
const UNPACKED: u64 = 1 << 24;
const UNPACKED_PER_BYTE: u64 = 1000;

/// Reads an OSI trace in MCAP: `.mcap`. Errors call it by `name`.
///
/// Messages have the schema `osi3.GroundTruth` or `osi3.SensorView`. The first channel
/// with such a message is read, and messages of further ones are counted. Chunks are not
/// compressed, or compressed with lz4 or zstd.
///
/// # Errors
/// The file is not MCAP, ends early, unpacks to far more than it is, or a message is invalid.
pub fn read_mcap(trace: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    let mut trace = BufReader::with_capacity(1 << 18, trace);
    let mut file = McapFile::new(name);
    let mut magic = Vec::new();
    read_bytes(&mut trace, MAGIC.len() as u64, &mut magic, name)?;
    if magic != MAGIC {
        return Err(file.tracks.error(FilePlace::Whole, FileProblem::NotMcap));
    }
    file.tracks.bytes = MAGIC.len() as u64;
    file.records(&mut trace, None)?;
    file.finish()
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
    name: &'a str,
    tracks: OsiTracks<'a>,
    /// Names of the schemas by their numbers.
    schemas: HashMap<u16, String>,
    /// Schema names and encodings of the channels by their numbers.
    channels: HashMap<u16, (String, String)>,
    /// Channel that is read.
    channel: Option<u16>,
    messages: u64,
    /// Bytes of all unpacked chunks.
    unpacked: u64,
}

impl<'a> McapFile<'a> {
    fn new(name: &'a str) -> McapFile<'a> {
        McapFile {
            name,
            tracks: OsiTracks::new(name),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            channel: None,
            messages: 0,
            unpacked: 0,
        }
    }

    /// Reads records up to the end of the data of a file, or all of the chunk at a byte.
    ///
    /// Indexes and the summary behind the data are not needed.
    fn records(&mut self, bytes: &mut impl Read, chunk: Option<u64>) -> Result<(), ReadError> {
        // Chunks come whole, because the decompressors of the crate are not
        // built in.
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_emit_chunks(true)
            .with_record_length_limit(MOST_BYTES);
        let mut reader = LinearReader::new_with_options(options);
        let (mut content, mut want) = (Vec::new(), HEAD);
        while let Some(event) = reader.next_event() {
            // Records in a chunk have no offset of their own in the file.
            let place = FilePlace::Byte(chunk.unwrap_or(self.tracks.bytes));
            match event {
                Ok(LinearReadEvent::ReadRequest(more)) => {
                    want = more as u64;
                    // A record may announce more than there is, so memory follows the bytes.
                    read_bytes(bytes, want, &mut content, self.name)?;
                    let got = content.len() as u64;
                    // Nothing at all is a regular end, which the reader
                    // judges.
                    if got > 0 && got < want {
                        return Err(self.tracks.cut(place, got, want));
                    }
                    reader.insert(content.len()).copy_from_slice(&content);
                    reader.notify_read(content.len());
                }
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    let offset = chunk.unwrap_or(self.tracks.bytes);
                    if chunk.is_none() {
                        self.tracks.bytes += HEAD + data.len() as u64;
                    }
                    // The summary behind it repeats schemas and channels, and
                    // its indexes are not needed.
                    if opcode == op::DATA_END {
                        return Ok(());
                    }
                    self.record(opcode, data, offset, chunk.is_some())?;
                }
                Err(error) => {
                    let problem = match error {
                        McapError::UnexpectedEof => FileProblem::Cut { got: 0, want },
                        McapError::RecordTooLarge { len, .. } => FileProblem::TooLong(len),
                        other => FileProblem::Mcap(other.to_string()),
                    };
                    return Err(self.tracks.error(place, problem));
                }
            }
        }
        if chunk.is_some() {
            return Ok(());
        }
        // Without the record that ends the data the file was not written to its end.
        let place = FilePlace::Byte(self.tracks.bytes);
        Err(self.tracks.cut(place, 0, HEAD))
    }

    /// Reads a record. Others than those of messages are skipped, and so is their damage.
    fn record(
        &mut self,
        opcode: u8,
        content: &[u8],
        offset: u64,
        is_in_chunk: bool,
    ) -> Result<(), ReadError> {
        let place = FilePlace::Byte(offset);
        let mut fields = Fields(content);
        let read = match opcode {
            op::SCHEMA => self.schema(&mut fields),
            op::CHANNEL => self.channel(&mut fields),
            // The sequence number and the times of logging and publishing are not needed.
            op::MESSAGE => match (fields.u16(), fields.bytes(20)) {
                (Some(channel), Some(_)) => return self.message(channel, fields.0, offset),
                _ => None,
            },
            // A chunk in a chunk would be a way to unpack without end.
            op::CHUNK if !is_in_chunk => {
                let records = self
                    .unpacked(fields)
                    .map_err(|problem| self.tracks.error(place, problem))?;
                return self.records(&mut &*records, Some(offset));
            }
            _ => Some(()),
        };
        read.ok_or_else(|| self.tracks.error(place, FileProblem::Record(opcode)))
    }

    fn schema(&mut self, fields: &mut Fields<'_>) -> Option<()> {
        let (id, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(id, name);
        Some(())
    }

    fn channel(&mut self, fields: &mut Fields<'_>) -> Option<()> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (_topic, encoding) = (fields.text()?, fields.text()?);
        // An unknown schema has an empty name, which no message kind has.
        let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
        self.channels.insert(id, (schema, encoding));
        Some(())
    }

    fn message(&mut self, channel: u16, message: &[u8], offset: u64) -> Result<(), ReadError> {
        let Some(kind) = self.kind_of(channel) else {
            return Ok(());
        };
        if *self.channel.get_or_insert(channel) != channel {
            self.tracks.counts.other_messages += 1;
            return Ok(());
        }
        // The schema states the type, so it is not guessed from the contents.
        self.tracks.kind = Some(kind);
        self.messages += 1;
        let number = self.messages;
        self.tracks
            .push(message, FilePlace::Message { number, offset })
    }

    fn kind_of(&self, channel: u16) -> Option<OsiKind> {
        let (schema, encoding) = self.channels.get(&channel)?;
        match (&**schema, &**encoding) {
            ("osi3.GroundTruth", "protobuf") => Some(OsiKind::GroundTruth),
            ("osi3.SensorView", "protobuf") => Some(OsiKind::SensorView),
            _ => None,
        }
    }

    /// Returns the records of a chunk.
    fn unpacked<'c>(&mut self, mut fields: Fields<'c>) -> Result<Cow<'c, [u8]>, FileProblem> {
        let mut parts = || {
            let _span = fields.bytes(16)?;
            let (size, checksum, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
            let length = usize::try_from(fields.u64()?).ok()?;
            Some((size, checksum, compression, fields.bytes(length)?))
        };
        let (size, checksum, compression, packed) =
            parts().ok_or(FileProblem::Record(op::CHUNK))?;
        if size > MOST_BYTES as u64 {
            return Err(FileProblem::TooLong(size));
        }
        // Summed before unpacking, so that a bomb is refused and not built.
        self.unpacked += size;
        if self.unpacked > UNPACKED + UNPACKED_PER_BYTE * self.tracks.bytes {
            let packed = packed.len() as u64;
            return Err(FileProblem::Unpacks { packed, size });
        }
        let records = match &*compression {
            "" => Cow::Borrowed(packed),
            "lz4" => read_all(lz4_flex::frame::FrameDecoder::new(packed), size)?,
            "zstd" => {
                let decoder = ruzstd::decoding::StreamingDecoder::new(packed);
                let failed = |error: &dyn ToString| FileProblem::Decompress(error.to_string());
                read_all(decoder.map_err(|error| failed(&error))?, size)?
            }
            other => return Err(FileProblem::Compression(other.to_owned())),
        };
        if records.len() as u64 != size {
            let got = records.len() as u64;
            return Err(FileProblem::Cut { got, want: size });
        }
        // A checksum of 0 is none.
        if checksum != 0 && checksum != crc32fast::hash(&records) {
            return Err(FileProblem::Checksum);
        }
        Ok(records)
    }

    fn finish(self) -> Result<TrafficRecording, ReadError> {
        if self.channel.is_some() {
            return self.tracks.finish();
        }
        let mut found: Vec<&str> = self.schemas.values().map(|it| &**it).collect();
        // The hash order differs from run to run, and messages must not.
        found.sort_unstable();
        let found = format!("schemas: {}", found.join(", "));
        let problem = FileProblem::NoGroundTruth(found);
        Err(self.tracks.error(FilePlace::Whole, problem))
    }
}

/// Reads a decompressor up to one byte more than expected.
fn read_all(decoder: impl Read, size: u64) -> Result<Cow<'static, [u8]>, FileProblem> {
    let mut records = Vec::new();
    // One byte more shows that a chunk is larger than it states.
    let read = decoder.take(size + 1).read_to_end(&mut records);
    read.map_err(|error| FileProblem::Decompress(error.to_string()))?;
    Ok(Cow::Owned(records))
}
