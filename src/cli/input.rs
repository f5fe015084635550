//! Standard input as a file, named `-`.

use std::fs::File;
use std::io::{self, Error, ErrorKind, IsTerminal, Read, Result};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::builder::{PathBufValueParser, TypedValueParser};

use super::terminal;
use crate::ron_file::{file_text, open_file};

/// Name of standard input.
const STDIN: &str = "-";
/// Most bytes of standard input that are read, because they stay in memory.
const MOST_BYTES: u64 = 1 << 30;
/// Bytes that show the format.
const HEAD: usize = 4096;

/// Set once standard input was read, as a property of the process.
static IS_READ: AtomicBool = AtomicBool::new(false);

/// Returns whether a path names standard input.
pub(super) fn is_stdin(path: &Path) -> bool {
    // Compared as a whole, so that a file of this name can be given as `./-`.
    path == Path::new(STDIN)
}

/// Parser of a file or a directory that is read later, but must exist now.
pub(super) fn existing_path() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        // Checked while parsing, so that a wrong path costs no computation.
        if path.exists() {
            Ok(path)
        } else {
            Err("there is no such file or directory: name another")
        }
    })
}

/// Returns the text of a file, or of standard input.
///
/// # Errors
/// It cannot be read, is no UTF-8, or is too large.
pub(super) fn text(path: &Path) -> Result<String> {
    if !is_stdin(path) {
        return file_text(path);
    }
    String::from_utf8(stdin_bytes()?).map_err(|error| {
        let why = format!("byte {} is not UTF-8", error.utf8_error().valid_up_to());
        Error::new(ErrorKind::InvalidData, why)
    })
}

/// File, or standard input as it was read.
#[derive(Debug)]
pub(super) enum Opened {
    File(File),
    Stdin(io::Cursor<Vec<u8>>),
}

impl Opened {
    /// Returns the ending of the format that standard input begins with.
    ///
    /// `None` for a file, whose name has the ending, and for rows of text.
    pub(super) fn format(&self) -> Option<&'static str> {
        let Opened::Stdin(bytes) = self else {
            return None;
        };
        let head = bytes.get_ref().get(..HEAD).unwrap_or(bytes.get_ref());
        // The head may end within a character, or be binary.
        let text = String::from_utf8_lossy(head);
        // Some editors write a byte order mark before the first element.
        let is_xml = text
            .trim_start_matches('\u{feff}')
            .trim_start()
            .starts_with('<');
        // The first five of the eight magic bytes of MCAP.
        if head.starts_with(b"\x89MCAP") {
            Some("mcap")
        } else if is_osi(bytes.get_ref()) {
            Some("osi")
        } else if is_xml && text.contains("<OpenSCENARIO") {
            // OpenSCENARIO is XML, too, so it is recognized before any other XML.
            Some("xosc")
        } else if is_xml {
            Some("xml")
        } else {
            None
        }
    }
}

/// Returns whether bytes begin with a message behind its length, as OSI traces do.
fn is_osi(bytes: &[u8]) -> bool {
    let Some((length, rest)) = bytes.split_first_chunk() else {
        return false;
    };
    // OSI traces state a length in four bytes, the lowest first.
    let length = u32::from_le_bytes(*length);
    // The least length that four characters of a text would be, such as tabs.
    let is_text = length >= u32::from_le_bytes(*b"\t\t\t\t");
    length > 0 && !is_text && length as usize <= rest.len()
}

impl Read for Opened {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize> {
        match self {
            Opened::File(file) => file.read(buffer),
            Opened::Stdin(bytes) => bytes.read(buffer),
        }
    }
}

/// Opens a file, or reads standard input.
///
/// # Errors
/// It cannot be read, or standard input is too large.
pub(super) fn open(path: &Path) -> Result<Opened> {
    if is_stdin(path) {
        Ok(Opened::Stdin(io::Cursor::new(stdin_bytes()?)))
    } else {
        Ok(Opened::File(open_file(path)?))
    }
}

fn stdin_bytes() -> Result<Vec<u8>> {
    // A second reader would take the end of the input for an empty file.
    if IS_READ.swap(true, Ordering::Relaxed) {
        return Err(Error::other("standard input was read already"));
    }
    let stdin = io::stdin();
    if stdin.is_terminal() {
        // Without a note the command would seem to hang.
        terminal::note("reading standard input: Ctrl-D ends it");
    }
    let mut bytes = Vec::new();
    // One byte more shows that the limit is exceeded.
    stdin.lock().take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MOST_BYTES {
        let why = format!("it is larger than {MOST_BYTES} bytes");
        return Err(Error::new(ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_standard_input_select_its_format() {
        let format = |bytes: &[u8]| Opened::Stdin(io::Cursor::new(bytes.to_vec())).format();
        let cases: [(&[u8], Option<&str>); 7] = [
            (b"\x89MCAP0\r\n", Some("mcap")),
            (b"<?xml?><OpenSCENARIO>", Some("xosc")),
            (b"<fcd-export>", Some("xml")),
            // A message of three bytes, and the length of the next one.
            (b"\x03\0\0\0\x0a\x01\x08\x03\0\0\0", Some("osi")),
            (b"time,id,x,y\n0.0,1,2.0,3.0\n", None),
            // A message that is cut off is no sign of a trace.
            (b"\x09\0\0\0\x0a", None),
            (b"", None),
        ];
        for (bytes, expected) in cases {
            assert_eq!(format(bytes), expected, "{bytes:?}");
        }
    }
}
