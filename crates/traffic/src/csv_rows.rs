//! Records of CSV files, with their separators, headers and lines.

use std::io::{BufRead, BufReader, Read};

use csv::ByteRecord;

use crate::error::ReadError;

/// Characters of a header that an error shows.
const HEADER_SHOWN: usize = 500;

/// Returns a reader of records, with the separator of the first line if none is given.
pub(crate) fn csv_of<R: Read>(
    rows: R,
    delimiter: Option<char>,
    name: &str,
) -> Result<csv::Reader<BufReader<R>>, ReadError> {
    let mut rows = BufReader::with_capacity(1 << 18, rows);
    let start = rows.fill_buf().map_err(|source| ReadError::File {
        file: name.to_owned(),
        source,
    })?;
    let line = start
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let count = |sign: u8| line.iter().filter(|byte| **byte == sign).count();
    let known = delimiter.and_then(|it| u8::try_from(it).ok());
    let usual = [b',', b';', b'\t']
        .into_iter()
        .rev()
        .max_by_key(|sign| count(*sign));
    Ok(csv::ReaderBuilder::new()
        .buffer_capacity(1 << 18)
        // The default also ends a record at `\r`, and then counts lines of files with
        // `\r\n` one too low. The `\r` is trimmed with the blanks.
        .terminator(csv::Terminator::Any(b'\n'))
        .trim(csv::Trim::All)
        .delimiter(known.or(usual).unwrap_or(b','))
        .from_reader(rows))
}

pub(crate) fn header_of(
    reader: &mut csv::Reader<impl Read>,
    name: &str,
) -> Result<Vec<String>, ReadError> {
    let header = reader.byte_headers().map_err(|it| csv_error(it, name))?;
    let text = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
    let mut header: Vec<String> = header.iter().map(text).collect();
    if let Some(first) = header.first_mut() {
        // Spreadsheets write a byte order mark.
        *first = first.trim_start_matches('\u{feff}').to_owned();
    }
    Ok(header)
}

pub(crate) fn csv_error(error: csv::Error, name: &str) -> ReadError {
    let file = name.to_owned();
    match error.into_kind() {
        csv::ErrorKind::Io(source) => ReadError::File { file, source },
        csv::ErrorKind::UnequalLengths {
            pos,
            expected_len,
            len,
        } => ReadError::Fields {
            file,
            line: pos.map_or(0, |it| it.line()),
            got: len,
            want: expected_len,
        },
        other => ReadError::File {
            file,
            source: std::io::Error::other(format!("{other:?}")),
        },
    }
}

pub(crate) fn line_of(record: &ByteRecord) -> u64 {
    record.position().map_or(0, csv::Position::line)
}

/// Returns the beginning of a field for a message.
pub(crate) fn shown(field: &[u8]) -> String {
    beginning(&String::from_utf8_lossy(field), 40)
}

/// Returns a header for a message. The first line of another format may be the whole file.
pub(crate) fn header_shown(header: &[String]) -> String {
    beginning(&header.join(","), HEADER_SHOWN)
}

fn beginning(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// CSV file whose columns are found by their names.
pub(crate) struct CsvTable<'a, R> {
    file: &'a str,
    header: Vec<String>,
    reader: csv::Reader<R>,
}

impl<'a> CsvTable<'a, ()> {
    pub(crate) fn open<R: Read>(
        rows: R,
        file: &'a str,
    ) -> Result<CsvTable<'a, BufReader<R>>, ReadError> {
        let mut reader = csv_of(rows, None, file)?;
        let header = header_of(&mut reader, file)?;
        Ok(CsvTable {
            file,
            header,
            reader,
        })
    }
}

impl<R: Read> CsvTable<'_, R> {
    pub(crate) fn next(&mut self) -> Result<Option<ByteRecord>, ReadError> {
        let mut row = ByteRecord::new();
        let read = self.reader.read_byte_record(&mut row);
        let is_row = read.map_err(|error| csv_error(error, self.file))?;
        Ok(is_row.then_some(row))
    }

    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        let mut header = self.header.iter();
        header.position(|it| it.eq_ignore_ascii_case(name))
    }

    pub(crate) fn field<'r>(&self, row: &'r ByteRecord, name: &str) -> Result<&'r [u8], ReadError> {
        let field = self.column(name).and_then(|at| row.get(at));
        field.ok_or_else(|| ReadError::MissingColumn {
            file: self.file.to_owned(),
            column: name.to_owned(),
            nearest: None,
            header: header_shown(&self.header),
        })
    }

    /// Returns a text, `None` without the column.
    pub(crate) fn text(&self, row: &ByteRecord, name: &str) -> Option<String> {
        let field = row.get(self.column(name)?)?;
        Some(String::from_utf8_lossy(field).into_owned())
    }

    pub(crate) fn required(&self, row: &ByteRecord, name: &str) -> Result<f64, ReadError> {
        let field = self.field(row, name)?;
        let text = std::str::from_utf8(field).ok();
        let value = text.and_then(|it| it.trim().parse::<f64>().ok());
        let finite = value.filter(|it| it.is_finite());
        finite.ok_or_else(|| self.wrong(row, name))
    }

    /// Returns a number, `None` without the column.
    pub(crate) fn number(&self, row: &ByteRecord, name: &str) -> Result<Option<f64>, ReadError> {
        let is_there = self.column(name).is_some();
        is_there.then(|| self.required(row, name)).transpose()
    }

    pub(crate) fn wrong(&self, row: &ByteRecord, name: &str) -> ReadError {
        ReadError::Number {
            file: self.file.to_owned(),
            line: line_of(row),
            column: name.to_owned(),
            text: self.field(row, name).map(shown).unwrap_or_default(),
        }
    }
}
