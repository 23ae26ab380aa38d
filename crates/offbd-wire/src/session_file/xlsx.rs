//! Sessions in spreadsheets (Excel's `.xlsx`): the first sheet, whose first row with cells is
//! the header of the CSV file.
//!
//! A number may be a number or its text. A time may be a date, which counts from 1970 in UTC, or
//! a time of day, which counts from midnight. The library reads a sheet only as long as it
//! borrows the workbook, so all rows are read at once; how much that may be is checked before
//! (`workbook_check.rs`).

use std::io::{Read, Seek};
use std::vec;

use calamine::{DataRef, ExcelDateTime, Reader, Xlsx};

use super::sheet_rows::{SheetRow, SheetRows};
use super::workbook_check;
use super::{
    RejectedRow, RowPlace, SessionFileError, SessionFormat, SessionRowError, SessionRows, guarded,
};
use crate::table::parse_number;
use offbd_core::vocabulary::Sample;

/// The day 1970-01-01 as spreadsheets count days, from 1900 and from 1904 on.
const EPOCH_DAYS: [f64; 2] = [25_569.0, 24_107.0];

const SECONDS_PER_DAY: f64 = 86_400.0;

pub(super) fn damaged(reason: impl ToString) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Xlsx, reason: reason.to_string() }
}

/// The value of a cell; text is borrowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CellValue<'a> {
    Empty,
    Number(f64),
    /// Seconds since 1970 in UTC, or since midnight.
    Time(f64),
    Text(&'a str),
    /// Anything else, by what it is.
    Other(&'static str),
}

impl<'a> CellValue<'a> {
    fn of(cell: &'a DataRef<'a>, is_1904: bool) -> Self {
        match cell {
            DataRef::Empty => Self::Empty,
            DataRef::Int(value) => Self::Number(*value as f64),
            DataRef::Float(value) => Self::Number(*value),
            DataRef::String(text) => Self::Text(text),
            DataRef::SharedString(text) => Self::Text(text),
            DataRef::DateTime(date) => Self::Time(seconds(*date, is_1904)),
            DataRef::DateTimeIso(_) | DataRef::DurationIso(_) => Self::Other("a date as text"),
            DataRef::Bool(_) => Self::Other("a truth value"),
            DataRef::Error(_) => Self::Other("an error"),
        }
    }

    /// The value as a quantity, or as a time if `is_time`; `None` if the cell is empty.
    pub(super) fn number(self, is_time: bool) -> Result<Option<f64>, String> {
        match self {
            Self::Empty => Ok(None),
            Self::Number(value) if value.is_finite() => Ok(Some(value)),
            Self::Number(value) => Err(format!("`{value}` is not finite")),
            Self::Time(value) if is_time && value.is_finite() => Ok(Some(value)),
            Self::Time(_) => Err("a date is not a number".to_owned()),
            Self::Text(text) => parse_number(text.as_bytes()),
            Self::Other(what) => Err(format!("{what} is not a number")),
        }
    }
}

/// The seconds of a date, to the microsecond that the fraction of a day resolves.
fn seconds(date: ExcelDateTime, is_1904: bool) -> f64 {
    let days = date.as_f64();
    let has_day = !date.is_duration() && days >= 1.0;
    let epoch = if has_day { EPOCH_DAYS[usize::from(is_1904)] } else { 0.0 };
    ((days - epoch) * SECONDS_PER_DAY * 1e6).round() / 1e6
}

/// Opens a workbook and reads its first sheet.
pub(super) fn rows<S: Read + Seek>(mut source: S) -> Result<XlsxRows, SessionFileError> {
    guarded(SessionFormat::Xlsx, || {
        workbook_check::check(&mut source)?;
        source.rewind()?;
        let mut workbook = Xlsx::new(source).map_err(damaged)?;
        let sheet = workbook.sheet_names().into_iter().next();
        let sheet = sheet.ok_or_else(|| damaged("it has no sheet"))?;
        let rows = read(&mut workbook, &sheet)?.into_iter();
        Ok(XlsxRows { sheet, rows, row: 0 })
    })?
}

fn read<S: Read + Seek>(
    workbook: &mut Xlsx<S>,
    sheet: &str,
) -> Result<Vec<SheetRow>, SessionFileError> {
    let is_1904 = workbook.has_1904_epoch();
    let mut cells = workbook.worksheet_cells_reader(sheet).map_err(damaged)?;
    let mut rows = SheetRows::new(sheet);
    while let Some(cell) = cells.next_cell().map_err(damaged)? {
        rows.cell(cell.get_position(), CellValue::of(cell.get_value(), is_1904))?;
    }
    rows.end()
}

/// The rows of the first sheet.
pub(super) struct XlsxRows {
    sheet: String,
    rows: vec::IntoIter<SheetRow>,
    /// The number of the row read last, as the spreadsheet shows it.
    row: u64,
}

impl Iterator for XlsxRows {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        let row = self.rows.next()?;
        self.row = row.number();
        let place = self.place();
        Some(row.sample().map_err(|reason| {
            let reason = format!("sheet `{}`, {reason}", self.sheet);
            SessionRowError::Rejected(RejectedRow { place, reason })
        }))
    }
}

impl SessionRows for XlsxRows {
    fn place(&self) -> RowPlace {
        RowPlace::Row(self.row)
    }
}
