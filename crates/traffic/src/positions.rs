//! Positions of the columns of a map in a header.

use crate::column_map::{ClassColumns, ColumnMap, SizeColumns, VectorColumns};
use crate::error::ReadError;
use crate::recording::Class;

/// Positions of the columns of a map in a header.
pub(crate) struct Positions {
    pub(crate) time: usize,
    pub(crate) id: usize,
    pub(crate) x: usize,
    pub(crate) y: usize,
    pub(crate) heading: Option<usize>,
    pub(crate) velocity: Vec<usize>,
    pub(crate) acceleration: Vec<usize>,
    pub(crate) size: Option<(usize, usize)>,
    pub(crate) shares: Vec<(usize, Class)>,
    pub(crate) code: Option<usize>,
    pub(crate) interpolated: Option<usize>,
}

impl Positions {
    pub(crate) fn new(
        header: &[String],
        file: &str,
        map: &ColumnMap,
    ) -> Result<Positions, ReadError> {
        let at = |column: &str| {
            let like = |it: &&(usize, &String)| it.1.eq_ignore_ascii_case(column);
            let named: Vec<(usize, &String)> = header.iter().enumerate().collect();
            let mut exact = named.iter().filter(|it| it.1 == column);
            let mut found = named.iter().filter(like);
            match (exact.next(), exact.next(), found.next(), found.next()) {
                (Some((at, _)), None, ..) | (None, None, Some((at, _)), None) => Ok(*at),
                (None, None, None, _) => Err(missing(header, file, column)),
                _ => Err(ReadError::TwoColumns {
                    file: file.to_owned(),
                    column: column.to_owned(),
                }),
            }
        };
        let vector = |columns: &VectorColumns| match columns {
            VectorColumns::Derived => Ok(Vec::new()),
            VectorColumns::Components(x, y) => Ok(vec![at(x)?, at(y)?]),
            VectorColumns::Magnitude(along) => Ok(vec![at(along)?]),
        };
        let optional = |column: Option<&String>| column.map(|it| at(it)).transpose();
        Ok(Positions {
            time: at(map.time.column())?,
            id: at(&map.id)?,
            x: at(&map.x)?,
            y: at(&map.y)?,
            heading: optional(map.heading.as_ref().map(|it| &it.column))?,
            velocity: vector(&map.velocity)?,
            acceleration: vector(&map.acceleration)?,
            size: match &map.size {
                SizeColumns::Columns { length, width } => Some((at(length)?, at(width)?)),
                SizeColumns::Fixed { .. } | SizeColumns::ByClass => None,
            },
            shares: match &map.class {
                ClassColumns::Shares(shares) => {
                    let shares = shares.iter();
                    let placed = shares.map(|(column, class)| Ok((at(column)?, *class)));
                    placed.collect::<Result<_, _>>()?
                }
                _ => Vec::new(),
            },
            code: match &map.class {
                ClassColumns::Codes { column, .. } | ClassColumns::Words(column) => {
                    Some(at(column)?)
                }
                _ => None,
            },
            interpolated: optional(map.interpolated.as_ref())?,
        })
    }
}

fn missing(header: &[String], file: &str, column: &str) -> ReadError {
    let likeness = |it: &&String| strsim::jaro_winkler(it, column);
    let nearest = header
        .iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    ReadError::MissingColumn {
        file: file.to_owned(),
        column: column.to_owned(),
        nearest: nearest.filter(|it| likeness(it) > 0.7).cloned(),
        header: crate::csv_rows::header_shown(header),
    }
}
