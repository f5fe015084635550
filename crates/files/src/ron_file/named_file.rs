//! Files that somebody names: read whole, or refused before they block or fill
//! the memory.

use std::fs::{self, File};
use std::io::{Error, ErrorKind, Read, Result};
use std::path::Path;

/// The largest file that is read: far above checkpoints and recorded traces.
const MAX_BYTES: u64 = 4 << 30;
/// Where a shell puts the pipes that it opened itself. Their other end is there.
const OPENED: [&str; 3] = ["/dev/fd", "/dev/stdin", "/proc/self/fd"];

/// Opens an ordinary file, or a pipe of the shell's (`<(…)`).
///
/// A pipe that has a name waits for its writer without end, and a device may
/// never end. Both are refused, whatever way leads to them.
pub fn open_file(path: &Path) -> Result<File> {
    // Before it is opened, since opening a pipe with a name waits for its writer.
    let kind = fs::metadata(path)?;
    if !kind.is_file() && !kind.is_dir() && !is_of_shell(path) {
        return Err(no_file());
    }
    let file = File::open(path)?;
    // The name may lead elsewhere by now, so what was opened decides.
    let kind = file.metadata()?;
    if kind.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a directory"));
    }
    if kind.is_file() || (is_pipe(&kind) && is_of_shell(path)) {
        return Ok(file);
    }
    Err(no_file())
}

fn no_file() -> Error {
    let why = "it is no ordinary file: a pipe, a socket or a device";
    Error::new(ErrorKind::InvalidInput, why)
}

/// Returns true for the name of a pipe that the shell opened.
///
/// A longer way, such as `/dev/fd/../zero`, leads anywhere.
fn is_of_shell(path: &Path) -> bool {
    let Some(text) = path.to_str() else {
        return false;
    };
    OPENED.iter().any(|place| {
        let rest = text.strip_prefix(place);
        let number = |rest: &str| {
            let digits = rest.strip_prefix('/').unwrap_or(rest);
            digits.bytes().all(|byte| byte.is_ascii_digit())
        };
        rest.is_some_and(number)
    })
}

#[cfg(unix)]
fn is_pipe(kind: &fs::Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    let kind = kind.file_type();
    // A terminal and `/dev/null` as standard input are devices that end.
    kind.is_fifo() || kind.is_socket() || kind.is_char_device()
}

#[cfg(not(unix))]
fn is_pipe(_: &fs::Metadata) -> bool {
    true
}

/// The bytes of a file.
pub fn file_bytes(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = open_file(path)?;
    let size = file.metadata().map_or(0, |about| about.len());
    // A file that is known to be too large is not read at all.
    if size <= MAX_BYTES {
        // A file may grow while it is read, and a pipe has no size.
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    }
    if size.max(bytes.len() as u64) > MAX_BYTES {
        let why = format!("it is larger than {MAX_BYTES} bytes");
        return Err(Error::new(ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// The text of a file.
pub fn file_text(path: &Path) -> Result<String> {
    String::from_utf8(file_bytes(path)?).map_err(|error| {
        let why = format!("byte {} is not UTF-8", error.utf8_error().valid_up_to());
        Error::new(ErrorKind::InvalidData, why)
    })
}
