//! Rows of CSV files, with their lines.

use std::io::{BufRead, BufReader, Read};

use brakecheck_stl::table::{Decimals, DelimitedTable, TableError};
use csv::ByteRecord;

use crate::error::ReadError;

/// Characters of a header that an error shows.
const HEADER_SHOWN: usize = 500;

/// Opens a table, with the separator of the first line if none is given.
pub(crate) fn open_table<R: Read>(
    rows: R,
    delimiter: Option<char>,
    name: &str,
) -> Result<DelimitedTable<BufReader<R>>, ReadError> {
    // Files of gigabytes are read, so the buffer is larger than the default.
    let rows = BufReader::with_capacity(1 << 18, rows);
    DelimitedTable::open(rows, delimiter).map_err(|it| table_error(it, name))
}

pub(crate) fn table_error(error: TableError, name: &str) -> ReadError {
    let file = name.to_owned();
    match error {
        TableError::Io(source) => ReadError::File { file, source },
        TableError::Ragged { line, got, want } => ReadError::Fields {
            file,
            line,
            got: got as u64,
            want: want as u64,
        },
        other => ReadError::File {
            file,
            source: std::io::Error::other(other),
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
    // By characters: a cut inside one would panic.
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// CSV file whose columns are found by their names.
pub(crate) struct CsvTable<'a, R> {
    file: &'a str,
    table: DelimitedTable<R>,
    decimals: Decimals,
}

impl<'a> CsvTable<'a, ()> {
    pub(crate) fn open<R: Read>(
        rows: R,
        file: &'a str,
    ) -> Result<CsvTable<'a, BufReader<R>>, ReadError> {
        let table = open_table(rows, None, file)?;
        let decimals = table.decimals();
        Ok(CsvTable {
            file,
            table,
            decimals,
        })
    }
}

impl<R: BufRead> CsvTable<'_, R> {
    pub(crate) fn next(&mut self) -> Result<Option<ByteRecord>, ReadError> {
        let mut row = ByteRecord::new();
        let read = self.table.read(&mut row);
        let is_row = read.map_err(|error| table_error(error, self.file))?;
        Ok(is_row.then_some(row))
    }

    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        let mut header = self.table.names().iter();
        header.position(|it| it.eq_ignore_ascii_case(name))
    }

    pub(crate) fn field<'r>(&self, row: &'r ByteRecord, name: &str) -> Result<&'r [u8], ReadError> {
        let field = self.column(name).and_then(|at| row.get(at));
        field.ok_or_else(|| ReadError::MissingColumn {
            file: self.file.to_owned(),
            column: name.to_owned(),
            nearest: None,
            header: header_shown(self.table.names()),
        })
    }

    /// Returns a text, `None` without the column.
    pub(crate) fn text(&self, row: &ByteRecord, name: &str) -> Option<String> {
        let field = row.get(self.column(name)?)?;
        Some(String::from_utf8_lossy(field).into_owned())
    }

    pub(crate) fn required(&self, row: &ByteRecord, name: &str) -> Result<f64, ReadError> {
        let field = self.field(row, name)?;
        let value = self.decimals.number(field);
        value.ok_or_else(|| self.wrong(row, name))
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
