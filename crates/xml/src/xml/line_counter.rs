//! Bytes of a text with their lines, within the limit of a part.

use std::io::{self, BufRead, BufReader, Read};

/// Greatest length in bytes of a tag, a text or a comment.
///
/// The parser keeps a part in memory as a whole, whatever the length of the file.
pub(super) const MAX_PART_BYTES: usize = 16 << 20;

/// Reader that counts lines, and the bytes of the current part.
pub(super) struct LineCounter<R> {
    inner: BufReader<R>,
    /// Line of the next byte, from 1.
    pub(super) line: u64,
    /// Bytes since the begin of the part.
    pub(super) part_bytes: usize,
}

impl<R: Read> LineCounter<R> {
    pub(super) fn new(inner: R) -> LineCounter<R> {
        LineCounter {
            // Recordings have hundreds of megabytes, and small reads would dominate their
            // time.
            inner: BufReader::with_capacity(1 << 18, inner),
            line: 1,
            part_bytes: 0,
        }
    }
}

impl<R: Read> Read for LineCounter<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let got = self.fill_buf()?.read(into)?;
        self.consume(got);
        Ok(got)
    }
}

impl<R: Read> BufRead for LineCounter<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.part_bytes > MAX_PART_BYTES {
            // Checked between two fills of the buffer, so a part may exceed it by one.
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        let passed = &self.inner.buffer()[..amount];
        self.line += passed.iter().filter(|byte| **byte == b'\n').count() as u64;
        self.part_bytes += amount;
        self.inner.consume(amount);
    }
}
