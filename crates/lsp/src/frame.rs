//! Frames of the protocol: header lines, an empty line, and a JSON text.
//!
//! Nothing that a client writes allocates more than [`MAX_BYTES`].

use std::io::{self, BufRead, Read, Write};

/// Greatest size of a message, in bytes: a world of the greatest size, with escapes.
pub const MAX_BYTES: u64 = 8 << 20;
/// Greatest length of a header line.
const MAX_LINE_BYTES: u64 = 1024;
/// Greatest number of header lines, of which the protocol has two.
const MAX_LINES: usize = 16;

/// Frame that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The header has no usable length, so the next frame cannot be found.
    #[error("bad header: {0}")]
    Header(String),
    /// The message is too large, and was skipped.
    #[error("a message of {bytes} bytes, of at most {MAX_BYTES}")]
    TooLarge {
        /// Length in the header.
        bytes: u64,
    },
    /// The input ended within a frame.
    #[error("the input ends within a message")]
    Cut,
    /// The input cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl FrameError {
    /// Returns whether the next frame can be read.
    pub fn is_skipped(&self) -> bool {
        matches!(self, FrameError::TooLarge { .. })
    }
}

/// Reads the next message. `None` at the end of the input.
///
/// # Errors
///
/// Returns an error if the header is bad, the message too large, or the input ends early.
pub fn read_frame(input: &mut impl BufRead) -> Result<Option<Vec<u8>>, FrameError> {
    let mut length = None;
    for count in 0.. {
        // A client that sends only headers would never reach a message.
        if count == MAX_LINES {
            let what = format!("more than {MAX_LINES} lines");
            return Err(FrameError::Header(what));
        }
        let Some(line) = header_line(input)? else {
            return if count == 0 {
                // The end between two frames is the regular end.
                Ok(None)
            } else {
                Err(FrameError::Cut)
            };
        };
        if line.is_empty() {
            break;
        }
        // Other headers, such as `Content-Type`, are allowed and without effect.
        if let Some(bytes) = content_length(&line)? {
            length = Some(bytes);
        }
    }
    match length {
        Some(bytes) => body(input, bytes).map(Some),
        None => Err(FrameError::Header("no `Content-Length`".to_owned())),
    }
}

/// Reads a header line without its end. `None` at the end of the input.
fn header_line(input: &mut impl BufRead) -> Result<Option<Vec<u8>>, FrameError> {
    let mut line = Vec::new();
    input
        .by_ref()
        // A line without an end would be read into memory without a bound.
        .take(MAX_LINE_BYTES)
        .read_until(b'\n', &mut line)?;
    if line.is_empty() {
        return Ok(None);
    }
    if line.pop() != Some(b'\n') {
        // The line may be too long, or the input may have ended.
        return Err(if line.len() as u64 + 1 == MAX_LINE_BYTES {
            FrameError::Header(format!("a line of more than {MAX_LINE_BYTES} bytes"))
        } else {
            FrameError::Cut
        });
    }
    // The protocol asks for `\r\n`, and a lone `\n` is accepted.
    if line.last() == Some(&b'\r') {
        line.pop();
    }
    Ok(Some(line))
}

/// Length in a header line, if it states one.
fn content_length(line: &[u8]) -> Result<Option<u64>, FrameError> {
    // Only for the message: a header that is no UTF-8 has no length that
    // counts.
    let text = String::from_utf8_lossy(line);
    let Some((name, number)) = text.split_once(':') else {
        return Err(FrameError::Header(format!("`{text}` has no `:`")));
    };
    if !name.trim().eq_ignore_ascii_case("Content-Length") {
        return Ok(None);
    }
    let value = number.trim();
    // `parse` alone would allow a sign.
    let digits = value.bytes().all(|byte| byte.is_ascii_digit());
    match value.parse() {
        Ok(bytes) if digits => Ok(Some(bytes)),
        _ => Err(FrameError::Header(format!("`{value}` is no length"))),
    }
}

fn body(input: &mut impl BufRead, bytes: u64) -> Result<Vec<u8>, FrameError> {
    if bytes > MAX_BYTES {
        // Skipped, so that the next message is found.
        io::copy(&mut input.by_ref().take(bytes), &mut io::sink())?;
        return Err(FrameError::TooLarge { bytes });
    }
    // No capacity in advance: the header may promise bytes that never come.
    let mut message = Vec::new();
    input.by_ref().take(bytes).read_to_end(&mut message)?;
    if (message.len() as u64) < bytes {
        return Err(FrameError::Cut);
    }
    Ok(message)
}

/// Writes a message and flushes it.
///
/// # Errors
///
/// Returns an error if the output cannot be written.
pub fn write_frame(output: &mut impl Write, message: &str) -> io::Result<()> {
    // The length is in bytes, as the protocol counts it.
    write!(output, "Content-Length: {}\r\n\r\n{message}", message.len())?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Option<Vec<u8>>, FrameError> {
        read_frame(&mut io::Cursor::new(bytes))
    }

    #[test]
    fn frames_are_read_as_they_are_written() {
        let mut written = Vec::new();
        write_frame(&mut written, "{\"é\":1}").expect("written");
        write_frame(&mut written, "[]").expect("written");
        let mut input = io::Cursor::new(written);
        let mut next = || read_frame(&mut input).expect("sound");
        assert_eq!(next().as_deref(), Some("{\"é\":1}".as_bytes()));
        assert_eq!(next().as_deref(), Some(&b"[]"[..]));
        assert_eq!(next(), None);
    }

    #[test]
    fn bad_frames_are_errors() {
        let long = format!("A: {}\r\n", "x".repeat(5000));
        let many = "A: b\r\n".repeat(20);
        let cases: [(&[u8], &str); 12] = [
            (b"Content-Length: 5\r\n\r\n[]", "within"),
            (b"Content-Length: 5\r\n", "within"),
            (b"Content-Len", "within"),
            (b"\r\n[]", "no `Content-Length`"),
            (b"Content-Length: -1\r\n\r\n", "no length"),
            (b"Content-Length: +1\r\n\r\n", "no length"),
            (b"Content-Length: 99999999999999999999\r\n\r\n", "no length"),
            (b"Content-Length: 9999999999\r\n\r\n[]", "of at most"),
            (b"Content-Length 1\r\n\r\n", "has no `:`"),
            (b"\xff\xfe: 1\r\n\r\n", "no `Content-Length`"),
            (long.as_bytes(), "a line of more"),
            (many.as_bytes(), "more than 16 lines"),
        ];
        for (bytes, part) in cases {
            let error = read(bytes).expect_err(part).to_string();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn a_message_that_is_too_large_is_skipped() {
        let bytes = MAX_BYTES as usize + 1;
        let mut input = format!("Content-Length: {bytes}\r\n\r\n{}", "x".repeat(bytes));
        input.push_str("Content-Length: 2\r\n\r\n[]");
        let mut input = io::Cursor::new(input);
        let error = read_frame(&mut input).expect_err("too large");
        assert!(error.is_skipped(), "{error}");
        let next = read_frame(&mut input).expect("sound");
        assert_eq!(next.as_deref(), Some(&b"[]"[..]));
    }
}
