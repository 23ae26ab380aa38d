//! Tables of text, as programs and owners write them: any usual encoding, separator and decimal
//! sign, with comments, a preamble, a line of units, or without names. The samples come from
//! columns with the names of the quantities (`session_csv.rs`), or by a mapping
//! ([`ColumnMapping`]).
//!
//! An empty cell is a missing value, and so are `nan`, `NA`, `None`, `null` and `-`. An invalid row
//! is an error with its line number, and reading continues with the next row. A clock that starts
//! again, or a second header, begins another run.

mod cell;
mod clock;
mod columns;
mod dialect;
pub(crate) mod encoding;
mod expression;
pub(crate) mod guess;
mod own_names;
mod rows;
mod unit;

use std::io::{self, Cursor, Read};

pub(crate) use self::cell::DecimalSign;
pub use self::clock::starts_again;
pub(crate) use self::columns::{AXES, Axis};
pub(crate) use self::dialect::{Dialect, JUDGED_ROWS, NamedColumns};
pub(crate) use self::expression::Dimension;
pub use self::expression::{ColumnMapping, ColumnName, Expression, MappingError, Term};
pub(crate) use self::guess::nearest_of;
pub(crate) use self::rows::{Cells, RowFault, RowSource};

use self::clock::RowClock;
use self::columns::BoundMapping;
use self::rows::{RowLayout, Rows};
use offbd_core::vocabulary::{Brief, Sample};

/// The rates that a table without a time may have, rows a second. Chosen: from a row in a quarter of
/// an hour to the fastest converters.
pub const RATES_HZ: std::ops::RangeInclusive<f64> = 0.001..=1e6;

/// How a table is to be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TableOptions {
    /// The columns of the quantities; where it says nothing, the columns of their names.
    pub columns: ColumnMapping,
    /// Rows a second of a table without a time.
    pub rate_hz: Option<f64>,
    /// The columns of the rig's files, for a table that has them all; unless there are `columns`.
    pub of_rig: ColumnMapping,
}

impl TableOptions {
    /// Returns the options for files of a rig whose asset file has these `columns`.
    #[must_use]
    pub fn of_rig(self, columns: Option<&str>) -> Self {
        // The asset file has been checked.
        let of_rig = columns.and_then(|columns| columns.parse().ok()).unwrap_or_default();
        Self { of_rig, ..self }
    }

    /// Returns the options for a table.
    pub(crate) fn of_table(&self, dialect: &Dialect) -> Self {
        let mut own = self.clone();
        if own.columns.is_empty() && columns::has_all(dialect, &own.of_rig) {
            own.columns = std::mem::take(&mut own.of_rig);
        }
        own
    }
}

/// Why a file is not a table of samples.
#[derive(Debug, thiserror::Error)]
pub enum CsvError {
    #[error("no line has two or more columns, separated by commas, semicolons, tabs or blanks")]
    NoTable,
    #[error("there are no rows below the names of the columns")]
    NoRows,
    #[error("the table lacks the column `{name}`; it has {found}.{proposal}")]
    MissingColumn {
        name: &'static str,
        /// The columns that there are.
        found: String,
        /// A sentence that proposes a mapping, or nothing.
        proposal: String,
    },
    #[error(
        "the header names the column `{name}` twice; map one: `{name}=#{first}` or `{name}=#{second}`"
    )]
    DoubleColumn {
        name: &'static str,
        /// The numbers of the two, from 1.
        first: usize,
        second: usize,
    },
    #[error("the file is empty")]
    Empty,
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// The times are probably in another unit.
    #[error(
        "`t_s` is {}: is it in {unit}? Then map it: `t_s=t_s/{unit}`",
        Brief(*found)
    )]
    TimeUnit { found: f64, unit: &'static str },
    #[error("cannot read the header: {0}")]
    Header(#[from] io::Error),
}

/// Why a row is not a valid sample.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct RowError {
    /// Line number, from 1, counting the header.
    pub line: u64,
    pub reason: String,
}

/// A text whose table has been found.
pub(crate) struct OpenedTable<'a> {
    pub(crate) dialect: Dialect,
    pub(crate) encoding: &'static str,
    /// The rows, behind the header.
    rows: Box<dyn Read + Send + 'a>,
}

/// Finds the table in `source`.
///
/// # Errors
/// [`CsvError::NoTable`]; [`CsvError::Header`] if `source` cannot be read.
pub(crate) fn find_table<'a>(
    mut source: impl Read + Send + 'a,
) -> Result<OpenedTable<'a>, CsvError> {
    let mut raw = Vec::new();
    source.by_ref().take(dialect::HEAD_BYTES as u64).read_to_end(&mut raw)?;
    let (encoding, mark) = encoding::detect(&raw);
    raw.drain(..mark);
    let has_lines = raw.contains(&b'\n');
    let mut text = encoding::as_utf8(Cursor::new(raw).chain(source), encoding);
    if !has_lines {
        text = Box::new(encoding::WithLines(text));
    }
    let mut head = Vec::new();
    text.by_ref().take(dialect::HEAD_BYTES as u64).read_to_end(&mut head)?;
    let is_whole = head.len() < dialect::HEAD_BYTES;
    let is_empty = is_whole && cell::bare(&head).is_empty();
    let none = if is_empty { CsvError::Empty } else { CsvError::NoTable };
    let dialect = dialect::detect(&head, is_whole).ok_or(none)?;
    head.drain(..dialect.n_bytes);
    Ok(OpenedTable {
        dialect,
        encoding: encoding.name(),
        rows: Box::new(Cursor::new(head).chain(text)),
    })
}

/// Checks the times of the column `t_s` of a table, unless `options` say where the time is.
fn check_time_unit(dialect: &Dialect, options: &TableOptions) -> Result<(), CsvError> {
    let is_named = options.columns.expressions[0].is_none() && options.rate_hz.is_none();
    guess::wrong_time_unit(dialect).filter(|_| is_named).map_or(Ok(()), Err)
}

/// Reads samples row by row, in the order of the file, which fails with `E`.
pub struct TableReader<'a, E = io::Error> {
    rows: Box<dyn RowSource<E> + 'a>,
    /// Why the rest of the file cannot be read.
    fault: Option<E>,
    dialect: Dialect,
    mapping: BoundMapping,
    clock: RowClock,
    cells: Cells,
}

impl<'a> TableReader<'a> {
    /// Opens a batch, whose rows may be of any time.
    ///
    /// # Errors
    /// [`CsvError`] if a column is missing or repeated, or `source` cannot be read.
    pub fn batch(source: impl Read + Send + 'a, options: &TableOptions) -> Result<Self, CsvError> {
        let table = find_table(source)?;
        let options = &options.of_table(&table.dialect);
        Self::new(table, options, false)
    }

    /// Opens a recording. A counter that wraps goes on; a clock that starts again, and a second
    /// header, begin another [run](Self::n_runs).
    ///
    /// # Errors
    /// [`CsvError`] if a column is missing or repeated, `source` cannot be read, or the times are
    /// probably not in seconds.
    pub fn recording(
        source: impl Read + Send + 'a,
        options: &TableOptions,
    ) -> Result<Self, CsvError> {
        Self::of_text(source, options)
    }
}

impl<'a, E: From<io::Error>> TableReader<'a, E> {
    /// As [`TableReader::recording`], for any error of the file.
    ///
    /// # Errors
    /// As of [`TableReader::recording`].
    pub(crate) fn of_text(
        source: impl Read + Send + 'a,
        options: &TableOptions,
    ) -> Result<Self, CsvError> {
        let table = find_table(source)?;
        let options = &options.of_table(&table.dialect);
        check_time_unit(&table.dialect, options)?;
        Self::new(table, options, true)
    }

    fn new(
        table: OpenedTable<'a>,
        options: &TableOptions,
        is_recording: bool,
    ) -> Result<Self, CsvError> {
        let OpenedTable { dialect, rows, .. } = table;
        let mapping = BoundMapping::new(&dialect, options)?;
        let layout = RowLayout {
            separator: dialect.separator,
            comment: dialect.comment,
            n_cells: if dialect.names.is_empty() {
                dialect.n_columns()
            } else {
                dialect.names.len()
            },
            may_have_more: dialect.ends_with_words(),
        };
        let rows = Rows::new(rows, layout, dialect.n_lines);
        Ok(Self::of(Box::new(rows), dialect, mapping, is_recording))
    }
}

impl<'a, E> TableReader<'a, E> {
    /// Opens a recording that is not a text; `rows` opens its rows, of which these columns are read.
    ///
    /// # Errors
    /// As of [`TableReader::recording`], and those of `rows`.
    pub(crate) fn of_columns<R: RowSource<E> + 'a>(
        columns: &NamedColumns,
        options: &TableOptions,
        rows: impl FnOnce(&[usize]) -> Result<R, E>,
    ) -> Result<Self, E>
    where
        E: From<CsvError>,
    {
        let dialect = Dialect::of_columns(columns);
        let options = &options.of_table(&dialect);
        check_time_unit(&dialect, options)?;
        let mapping = BoundMapping::new(&dialect, options)?;
        let rows = Box::new(rows(&mapping.columns())?);
        Ok(Self::of(rows, dialect, mapping, true))
    }

    fn of(
        rows: Box<dyn RowSource<E> + 'a>,
        dialect: Dialect,
        mapping: BoundMapping,
        is_recording: bool,
    ) -> Self {
        let clock = RowClock::new(is_recording);
        Self { rows, fault: None, dialect, mapping, clock, cells: Cells::default() }
    }

    /// The names of the columns that are not read; none where a mapping says which are.
    pub fn unread(&self) -> impl Iterator<Item = &str> {
        let read = self.mapping.columns();
        let names = self.dialect.names.iter().enumerate().filter(|_| !self.mapping.is_given);
        names.filter(move |(i, _)| !read.contains(i)).map(|(_, name)| name.as_str())
    }

    /// Takes the reason why the rest of the file could not be read, after the last row.
    pub(crate) fn take_fault(&mut self) -> Option<E> {
        self.fault.take()
    }

    /// Returns the line number of the row read last, from 1, counting the header.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.rows.line()
    }

    /// The number of runs that have begun, from 1.
    #[must_use]
    pub fn n_runs(&self) -> usize {
        self.clock.n_runs()
    }

    fn sample(&mut self) -> Result<Sample, RowError> {
        let line = self.line();
        let fail = |reason: String| RowError { line, reason };
        if self.dialect.has_labels {
            self.cells.strip_labels(&self.dialect.names).map_err(fail)?;
        }
        let sign = self.dialect.decimal;
        let t_s = self.clock.next(&self.mapping.time, &self.cells, sign).map_err(fail)?;
        let value = |quantity: usize| match &self.mapping.quantities[quantity] {
            None => Ok(None),
            Some(columns) => columns.value(&self.cells, sign).map_err(fail),
        };
        let seq = self.mapping.seq.map_or(Ok(None), |column| self.seq(column)).map_err(fail)?;
        let [cmd_qx_rad, cmd_qy_rad, x_m, y_m] = [value(0)?, value(1)?, value(2)?, value(3)?];
        self.clock.note(t_s);
        Ok(Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m })
    }

    /// The number of the sample, which data frames with missing ones keep as a floating-point number.
    fn seq(&self, column: usize) -> Result<Option<u64>, String> {
        let number = self.cells.number(column).map(|number| number.to_string());
        let bytes = number.as_ref().map_or_else(|| self.cells.get(column), |n| Some(n.as_bytes()));
        match bytes.map(cell::bare) {
            None => Ok(None),
            Some(bytes) => match std::str::from_utf8(bytes) {
                Ok(text) if cell::is_missing(text) => Ok(None),
                text => text
                    .ok()
                    .and_then(|text| text.strip_suffix(".0").unwrap_or(text).parse().ok())
                    .map(Some)
                    .ok_or_else(|| "`seq` is not a whole number".to_owned()),
            },
        }
    }

    /// Whether the row repeats the header.
    fn is_header(&self) -> bool {
        let names = &self.dialect.names;
        let is_name = |(i, name): (usize, &String)| {
            self.cells
                .get(i)
                .is_some_and(|cell| cell::bare(cell).eq_ignore_ascii_case(name.as_bytes()))
        };
        // The names of rows have no name.
        let n_unnamed = names.iter().take_while(|name| name.is_empty()).count();
        let are = |names: &[String]| {
            self.cells.len() == names.len() && names.iter().enumerate().all(is_name)
        };
        !names.is_empty() && (are(names) || n_unnamed == 1 && are(&names[1..]))
    }
}

impl<E> Iterator for TableReader<'_, E> {
    type Item = Result<Sample, RowError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.rows.next(&mut self.cells) {
                Ok(true) if self.is_header() => self.clock.restart(),
                Ok(true) => return Some(self.sample()),
                Ok(false) => return None,
                Err(RowFault::Rejected(reason)) => {
                    return Some(Err(RowError { line: self.line(), reason }));
                }
                Err(RowFault::Unreadable(error)) => {
                    self.fault = Some(error);
                    return None;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
