//! Tables of text: names in the first line, then a line per row.
//!
//! Traces and recordings are read here, so that both have the same notations: fields
//! between commas, semicolons or tabs, comments that begin with `#`, names in such a
//! comment as numpy writes them, byte order marks, and any end of line. Decimals may have
//! a comma where commas do not separate fields.

use std::cell::Cell;
use std::io::{BufRead, Chain, Cursor, Read};

use csv::{ByteRecord, Terminator};

pub use crate::instant::{because_of_calendar, calendar_range, parse_iso};

/// Error in the notation of a table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// The text cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The text has two bytes per character.
    #[error("the text is UTF-16: save it as UTF-8")]
    Utf16,
    /// A row has more or fewer fields than the header.
    #[error("line {line}: {got} values for {want} columns")]
    Ragged {
        /// Number of the line, from 1.
        line: u64,
        /// Number of fields.
        got: usize,
        /// Number of names.
        want: usize,
    },
    /// The text is not CSV.
    #[error("{0}")]
    Csv(String),
}

/// Largest number of bytes that are read for the notation.
const MOST_HEAD: usize = 1 << 20;

/// Text whose first bytes are already read, without a mark before the first line.
type Unmarked<R> = Chain<Cursor<Vec<u8>>, R>;

/// Table of text with its names.
#[derive(Debug)]
pub struct DelimitedTable<R> {
    reader: csv::Reader<Unmarked<R>>,
    names: Vec<String>,
    decimals: Decimals,
}

impl<R: BufRead> DelimitedTable<R> {
    /// Reads the names, by default with the separator that most of their line consists of.
    ///
    /// # Errors
    /// The text cannot be read, or is UTF-16.
    pub fn open(mut text: R, delimiter: Option<char>) -> Result<DelimitedTable<R>, TableError> {
        let mut head = read_head(&mut text)?;
        let Notation {
            mark,
            is_announced,
            delimiter,
            has_comments,
            terminator,
            names,
        } = Notation::of(&head, delimiter)?;
        head.drain(..mark);
        if is_announced {
            // A `#` replaces the first letter of `sep=`, so the reader counts the line
            // as a comment.
            head[0] = b'#';
        }
        let mut reader = csv::ReaderBuilder::new()
            .buffer_capacity(1 << 18)
            // Rows of other lengths reach `read`, which cuts a last separator or names
            // the line.
            .flexible(true)
            .trim(csv::Trim::All)
            .terminator(terminator)
            .delimiter(delimiter)
            .comment(has_comments.then_some(b'#'))
            .has_headers(names.is_none())
            .from_reader(Cursor::new(head).chain(text));
        let mut names = match names {
            Some(names) => names,
            None => names_of(reader.byte_headers().map_err(csv_error)?.iter()),
        };
        // A separator behind the last name begins no column.
        if names.len() > 1 && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        Ok(DelimitedTable {
            reader,
            names,
            decimals: Decimals {
                may_be_commas: delimiter != b',',
                sign: Cell::new(None),
            },
        })
    }

    /// Returns the names of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Returns the notation of decimals, which the numbers of the table share.
    pub fn decimals(&self) -> Decimals {
        self.decimals.clone()
    }

    /// Reads the next row with a field per name. Returns false at the end.
    ///
    /// # Errors
    /// The row has more or fewer fields than names, or the text cannot be read.
    pub fn read(&mut self, row: &mut ByteRecord) -> Result<bool, TableError> {
        let want = self.names.len();
        while self.reader.read_byte_record(row).map_err(csv_error)? {
            let got = row.len();
            let is_blank = |field: usize| row[field].is_empty();
            if got == want {
                return Ok(true);
            }
            // A separator behind the last value begins no field.
            if got == want + 1 && is_blank(want) {
                row.truncate(want);
                return Ok(true);
            }
            if got > 1 || !is_blank(0) {
                let line = row.position().map_or(0, csv::Position::line);
                return Err(TableError::Ragged { line, got, want });
            }
        }
        Ok(false)
    }
}

/// Sign in the decimals of a table, which is the same in all of its numbers.
#[derive(Clone, Debug)]
pub struct Decimals {
    may_be_commas: bool,
    sign: Cell<Option<char>>,
}

impl Decimals {
    /// Returns a finite number, `None` for anything else.
    ///
    /// Numbers with a comma are `None` in a table with a number with a point, since
    /// one of both signs would then separate thousands.
    pub fn number(&self, field: &[u8]) -> Option<f64> {
        let text = std::str::from_utf8(field).ok()?.trim();
        let sign = text.find([',', '.']).map(|at| text.as_bytes()[at] as char);
        let value: f64 = match sign {
            // A second comma separates thousands and stays, so the number is refused.
            Some(',') if self.may_be_commas => text.replacen(',', ".", 1).parse().ok()?,
            _ => text.parse().ok()?,
        };
        let known = self.sign.get();
        if self.may_be_commas && sign.is_some() {
            if known.is_some() && known != sign {
                return None;
            }
            self.sign.set(sign);
        }
        value.is_finite().then_some(value)
    }
}

/// Byte order mark of UTF-8.
const MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads the lines that show the notation: up to the names and the beginning of a row.
///
/// A read of a pipe returns the bytes that were written so far, so it may end inside the
/// names.
fn read_head(text: &mut impl BufRead) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut scan = HeadScan::default();
    while head.len() < MOST_HEAD && !scan.shows_notation(&head) {
        let read = text.fill_buf()?;
        if read.is_empty() {
            break;
        }
        head.extend_from_slice(read);
        let length = read.len();
        text.consume(length);
    }
    Ok(head)
}

/// Search for the names in a growing text, which goes on where it ended.
///
/// A new search for each of many short reads would take time with the square of the header.
#[derive(Default)]
struct HeadScan {
    /// Number of bytes that were looked at.
    scanned: usize,
    /// First byte of the line that is not complete.
    line: usize,
    /// True if the names are complete.
    has_names: bool,
}

impl HeadScan {
    /// Returns true if the names are there as a whole, and enough of the line after them.
    fn shows_notation(&mut self, head: &[u8]) -> bool {
        while let Some(&byte) = head.get(self.scanned) {
            let at = self.scanned;
            self.scanned += 1;
            if matches!(byte, b'\n' | b'\r') {
                let line = &head[self.line..at];
                let is_first = std::mem::replace(&mut self.line, at + 1) == 0;
                let mark = if is_first { MARK } else { b"" };
                let text = String::from_utf8_lossy(line.strip_prefix(mark).unwrap_or(line));
                let line = text.trim_start();
                if line.is_empty() {
                    continue;
                }
                // Only its values distinguish a row that begins with `#` from a comment,
                // so it has to be complete.
                if self.has_names {
                    return true;
                }
                self.has_names = !line.starts_with('#') && !line.starts_with("sep=");
            } else if self.has_names && byte.is_ascii_graphic() && head[self.line] != b'#' {
                // The names are complete where another line begins.
                return true;
            }
        }
        false
    }
}

/// Returns the lines that are not blank.
fn lines_of(text: &str) -> impl Iterator<Item = &str> {
    text.split(['\n', '\r']).filter(|it| !it.trim().is_empty())
}

/// Notation of a table, from its first lines.
struct Notation {
    /// Bytes of a mark before the first line.
    mark: usize,
    /// True if the first line announces the separator.
    is_announced: bool,
    delimiter: u8,
    has_comments: bool,
    terminator: Terminator,
    /// Names in a comment.
    names: Option<Vec<String>>,
}

impl Notation {
    fn of(start: &[u8], delimiter: Option<char>) -> Result<Notation, TableError> {
        if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
            return Err(TableError::Utf16);
        }
        let mark = if start.starts_with(MARK) {
            MARK.len()
        } else {
            0
        };
        let text = String::from_utf8_lossy(&start[mark..]);
        let mut lines = lines_of(&text);
        // Spreadsheets announce the separator: `sep=;`. As a comment the line is counted.
        let announced = announced(&text);
        if announced.is_some() {
            lines.next();
        }
        let mut last_comment = None;
        let mut first = lines.next().unwrap_or_default();
        while first.trim_start().starts_with('#') {
            last_comment = Some(first);
            first = lines.next().unwrap_or_default();
        }
        let of_file = delimiter.and_then(|it| u8::try_from(it).ok());
        let given = of_file.or(announced);
        let commented = last_comment.and_then(|it| commented_names(it, first, given));
        let delimiter = match &commented {
            Some((delimiter, _)) => *delimiter,
            None => given.unwrap_or_else(|| usual_delimiter(first)),
        };
        let fields = |line: &str| fields_of(line, delimiter);
        // An identity such as `#12` begins no comment.
        let is_row = |line: &str| {
            let values = fields(line);
            let is_long = values.len() == fields(first).len();
            // The first field begins with `#`, so it never looks like a value.
            line.starts_with('#') && is_long && values.iter().skip(1).any(|it| is_value(it))
        };
        Ok(Notation {
            mark,
            is_announced: announced.is_some(),
            delimiter,
            has_comments: !lines.next().is_some_and(is_row),
            // The usual terminator counts lines of files with `\r\n` one too low.
            terminator: if text.contains('\n') {
                Terminator::Any(b'\n')
            } else {
                Terminator::CRLF
            },
            names: commented.map(|it| it.1),
        })
    }
}

/// Returns the separator and the names of a comment that has one for each value below.
fn commented_names(comment: &str, first: &str, given: Option<u8>) -> Option<(u8, Vec<String>)> {
    // Between semicolons and tabs, commas are those of decimals.
    let usual = [b';', b'\t', b','];
    let mut signs = usual
        .into_iter()
        .filter(|it| given.is_none_or(|sign| sign == *it));
    let with = |delimiter: u8| {
        let names = fields_of(comment.trim_start().trim_start_matches('#'), delimiter);
        let values = fields_of(first, delimiter);
        // A single column fits every separator, so only the comma counts for it.
        let fits = names.len() == values.len() && (names.len() > 1 || delimiter == b',');
        let are_names = !names.iter().any(|it| is_value(it));
        let is_header = fits && are_names && values.iter().any(|it| is_value(it));
        is_header.then_some((delimiter, names))
    };
    signs.find_map(with)
}

fn fields_of(line: &str, delimiter: u8) -> Vec<String> {
    let parts = line.split(char::from(delimiter));
    parts.map(|it| it.trim().to_owned()).collect()
}

/// Returns true for a number, a truth value or an instant.
pub fn is_value(field: &str) -> bool {
    let field = field.trim().trim_matches('"').to_ascii_lowercase();
    let is_number = |it: &str| it.replacen(',', ".", 1).parse::<f64>().is_ok();
    field == "true" || field == "false" || is_number(&field) || parse_iso(&field).is_some()
}

/// Returns the separator that a first line such as `sep=;` announces.
fn announced(text: &str) -> Option<u8> {
    let line = text.lines().next()?.strip_prefix("sep=")?;
    match line.as_bytes() {
        [sign] => Some(*sign),
        _ => None,
    }
}

fn usual_delimiter(line: &str) -> u8 {
    let parts: Vec<&str> = line.split('"').collect();
    // An odd number of quotes leaves an even number of parts, and quotes nothing.
    let step = if parts.len().is_multiple_of(2) { 1 } else { 2 };
    let outside = || parts.iter().step_by(step).flat_map(|part| part.bytes());
    let count = |sign: &u8| outside().filter(|byte| byte == sign).count();
    // Of signs that are equally frequent the last one.
    let known = [b'\t', b';', b','].into_iter().max_by_key(count);
    known.unwrap_or(b',')
}

fn names_of<'a>(fields: impl Iterator<Item = &'a [u8]>) -> Vec<String> {
    fields
        .map(|it| String::from_utf8_lossy(it).trim().to_owned())
        .collect()
}

fn csv_error(error: csv::Error) -> TableError {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => TableError::Io(error),
        other => TableError::Csv(format!("{other:?}")),
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn read(text: impl BufRead) -> Result<(Vec<String>, Vec<Vec<f64>>), TableError> {
        let mut table = DelimitedTable::open(text, None)?;
        let decimals = table.decimals();
        let (mut row, mut rows) = (ByteRecord::new(), Vec::new());
        while table.read(&mut row)? {
            let values = row.iter().map(|it| decimals.number(it).unwrap_or(f64::NAN));
            rows.push(values.collect());
        }
        Ok((table.names, rows))
    }

    #[test]
    fn usual_notations_are_the_same_table() {
        for text in [
            "t,x\n0,1.5\n1,2.5\n",
            "t,x\r\n0,1.5\r\n1,2.5\r\n",
            "t,x\r0,1.5\r1,2.5\r",
            "\u{feff}t,x\n0,1.5\n1,2.5",
            "t;x\n0;1.5\n1;2.5\n",
            "t;x\n0;1,5\n1;2,5\n",
            "sep=;\nt;x\n0;1,5\n1;2,5\n",
            "\u{feff}sep=,\r\nt,x\r\n0,1.5\r\n1,2.5\r\n",
            "t\tx\n0\t1.5\n1\t2.5\n",
            "# t\tx\n0,0\t1,5\n1,0\t2,5\n",
            "t,x,\n0,1.5,\n1,2.5,\n",
            "t,x\n0,1.5,\n1,2.5\n\n   \n",
            "\"t\",\"x\"\n\"0\",\"1.5\"\n1,2.5\n",
            "# made by a logger\nt,x\n# s,m\n0,1.5\n1,2.5\n# end\n",
            "# made by numpy\n# t,x\n0,1.5\n1,2.5\n",
            "#t;x\n0;1,5\n1;2,5\n",
        ] {
            let (names, rows) = read(text.as_bytes()).expect(text);
            assert_eq!(names, ["t", "x"], "{text:?}");
            assert_eq!(rows, [[0.0, 1.5], [1.0, 2.5]], "{text:?}");
        }
    }

    #[test]
    fn a_pipe_that_gives_few_bytes_is_the_same_table() {
        for text in [
            "t;x, m;y\n0;1,5;2\n1;2,5;3\n",
            "\u{feff}sep=;\r\nt;x, m;y\r\n0;1,5;2\r\n1;2,5;3\r\n",
            "# made, by, a logger\n# t;x, m;y\n0;1,5;2\n1;2,5;3\n",
            "t\tx, m\ty\r0\t1.5\t2\r1\t2.5\t3\r",
        ] {
            for bytes in 1..text.len() {
                let pipe = BufReader::with_capacity(bytes, text.as_bytes());
                let (names, rows) = read(pipe).expect(text);
                assert_eq!(names, ["t", "x, m", "y"], "{text:?} in reads of {bytes}");
                assert_eq!(rows, [[0.0, 1.5, 2.0], [1.0, 2.5, 3.0]], "{text:?}");
            }
        }
        let pipe = BufReader::with_capacity(1, &b"id,x\n#1,2\n#2,3\n"[..]);
        assert_eq!(read(pipe).expect("rows").1.len(), 2);
    }

    #[test]
    fn a_long_header_is_searched_once_however_short_the_reads_are() {
        let names = (0..140_000).map(|i| format!("c{i}"));
        let names = names.collect::<Vec<String>>().join(",");
        // With a search per read this would take minutes.
        let text = format!("{names}\n1{}\n", ",1".repeat(139_999));
        let pipe = BufReader::with_capacity(1, text.as_bytes());
        let (read_names, rows) = read(pipe).expect("a table");
        assert_eq!((read_names.len(), rows.len()), (140_000, 1));
        let mut scan = HeadScan::default();
        assert!(!scan.shows_notation(b"t,x\n"));
        // The names are known, so what is written in their place matters no more.
        assert!(scan.shows_notation(b"#,#\n0"));
        assert_eq!(scan.scanned, 5);
    }

    #[test]
    fn unclear_notations_are_refused() {
        let error = |text: &[u8]| read(text).expect_err("refused").to_string();
        assert_eq!(error(b"t,x\n0,1\n1\n"), "line 3: 1 values for 2 columns");
        assert_eq!(
            error(b"# c\nt,x\n0,1,5\n"),
            "line 3: 3 values for 2 columns"
        );
        assert_eq!(error(b"sep=;\nt;x\n0\n"), "line 3: 1 values for 2 columns");
        assert!(error(b"\xff\xfet\0,\0x\0").contains("UTF-16"));
        // One of both signs separates thousands.
        let (_, rows) = read(&b"t;x\n0;1,500\n1;2.5\n"[..]).expect("rows");
        assert!(rows[1][1].is_nan(), "{rows:?}");
        let (_, rows) = read(&b"t;x\n0;1.500,5\n"[..]).expect("rows");
        assert!(rows[0][1].is_nan(), "{rows:?}");
    }

    #[test]
    fn separators_in_quotes_separate_nothing() {
        let (names, rows) = read(&b"t,\"x; m; \"\"y\"\"\"\n0,1.5\n"[..]).expect("rows");
        assert_eq!(names, ["t", "x; m; \"y\""]);
        assert_eq!(rows, [[0.0, 1.5]]);
        // An inch is no quote.
        let (names, _) = read(&b"t;x in \";y\n0;1;2\n"[..]).expect("rows");
        assert_eq!(names.len(), 3);
    }

    #[test]
    fn identities_with_a_number_sign_are_rows() {
        let (names, rows) = read(&b"id,x\n#1,2\n#2,3\n"[..]).expect("rows");
        assert_eq!((names.len(), rows.len()), (2, 2));
    }
}
