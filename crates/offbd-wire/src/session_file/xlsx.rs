//! Sessions in spreadsheets (Excel's `.xlsx`): the first sheet, as the text that the spreadsheet
//! program would save it as, so that it is read as a text is (`table.rs`).
//!
//! A number may be a number or its text, a time a date or a time of day. The library reads a sheet
//! only as long as it borrows the workbook, so the text is in memory; how much the workbook may
//! take is checked before (`workbook_check.rs`).

use std::io::{Read, Seek};

use calamine::{DataRef, ExcelDateTime, Reader, Xlsx};
use jiff::Timestamp;

use super::line::{line_of, write_line};
use super::workbook_check::{self, damaged};
use super::{SessionFileError, SessionFormat, guarded};

/// The day 1970-01-01 as spreadsheets count days, from 1900 and from 1904 on.
const EPOCH_DAYS: [f64; 2] = [25_569.0, 24_107.0];

const SECONDS_PER_DAY: f64 = 86_400.0;

/// Most rows of a sheet: all that a spreadsheet has. A sheet with more is refused.
const MAX_ROWS: u32 = 1 << 20;

/// Most columns of a sheet: all that a spreadsheet has. A sheet with more is refused.
const MAX_COLUMNS: u32 = 1 << 14;

/// Longest text of a sheet, bytes. Chosen: a million rows of six numbers with all their digits.
const MAX_SHEET_BYTES: usize = 128 << 20;

fn wrong(sheet: &str, reason: impl ToString) -> SessionFileError {
    SessionFileError::Sheet { sheet: sheet.to_owned(), reason: reason.to_string() }
}

/// Returns the text of a cell.
fn cell_text(cell: &DataRef<'_>, is_1904: bool) -> String {
    match cell {
        DataRef::Empty => String::new(),
        DataRef::Int(value) => value.to_string(),
        DataRef::Float(value) => value.to_string(),
        DataRef::String(text) => line_of(text),
        DataRef::SharedString(text) => line_of(text),
        DataRef::DateTime(date) => moment(*date, is_1904),
        DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => text.clone(),
        DataRef::Bool(value) => value.to_string(),
        DataRef::Error(error) => error.to_string(),
    }
}

/// Returns a date or a time of day, to the microsecond that the fraction of a day resolves; seconds
/// for a duration of days.
fn moment(date: ExcelDateTime, is_1904: bool) -> String {
    let days = date.as_f64();
    let has_day = !date.is_duration() && days >= 1.0;
    let epoch = if has_day { EPOCH_DAYS[usize::from(is_1904)] } else { 0.0 };
    let micros = ((days - epoch) * SECONDS_PER_DAY * 1e6).round();
    let text = Timestamp::from_microsecond(micros as i64).map(|moment| moment.to_string());
    match text {
        Ok(text) if has_day => text,
        Ok(text) if (0.0..1.0).contains(&days) => {
            text.trim_start_matches("1970-01-01T").trim_end_matches('Z').to_owned()
        }
        _ => (micros / 1e6).to_string(),
    }
}

/// A sheet as a text.
pub(crate) struct Sheet {
    pub(crate) name: String,
    pub(crate) text: Vec<u8>,
}

/// Opens a workbook and returns its first sheet.
///
/// # Errors
/// [`SessionFileError`] if the workbook is damaged or too large.
pub(crate) fn sheet<S: Read + Seek>(mut source: S) -> Result<Sheet, SessionFileError> {
    guarded(SessionFormat::Xlsx, || {
        workbook_check::check(&mut source)?;
        source.rewind()?;
        let mut workbook = Xlsx::new(source).map_err(damaged)?;
        let name = workbook.sheet_names().into_iter().next();
        let name = name.ok_or_else(|| damaged("it has no sheet"))?;
        let text = text(&mut workbook, &name)?;
        Ok(Sheet { name, text })
    })?
}

fn text<S: Read + Seek>(workbook: &mut Xlsx<S>, sheet: &str) -> Result<Vec<u8>, SessionFileError> {
    let is_1904 = workbook.has_1904_epoch();
    let mut cells = workbook.worksheet_cells_reader(sheet).map_err(damaged)?;
    let mut lines = Lines { sheet, ..Lines::default() };
    while let Some(cell) = cells.next_cell().map_err(damaged)? {
        let value = cell_text(cell.get_value(), is_1904);
        if !value.is_empty() {
            lines.cell(cell.get_position(), &value)?;
        }
    }
    lines.end_row()?;
    Ok(lines.text)
}

/// The lines of a sheet, as its cells come row by row.
#[derive(Default)]
struct Lines<'a> {
    sheet: &'a str,
    text: Vec<u8>,
    /// The row and the cells of the line that is being gathered, both counted from 0.
    row: u32,
    cells: Vec<String>,
    /// Cells of the widest line so far. A sheet has no cells at the end of a row that lacks
    /// values; the line has them.
    width: usize,
}

impl Lines<'_> {
    fn cell(&mut self, (row, column): (u32, u32), value: &str) -> Result<(), SessionFileError> {
        if row >= MAX_ROWS {
            return Err(wrong(self.sheet, format!("it has more than {MAX_ROWS} rows")));
        }
        if column >= MAX_COLUMNS {
            return Err(wrong(self.sheet, format!("it has more than {MAX_COLUMNS} columns")));
        }
        while self.row < row {
            self.end_row()?;
            self.row += 1;
        }
        let column = column as usize;
        if self.cells.len() <= column {
            self.cells.resize(column + 1, String::new());
        }
        self.cells[column].push_str(value);
        Ok(())
    }

    /// Writes the line; an empty one for a row without cells, so that lines count rows.
    fn end_row(&mut self) -> Result<(), SessionFileError> {
        if !self.cells.is_empty() {
            self.width = self.width.max(self.cells.len());
            self.cells.resize(self.width, String::new());
            write_line(&mut self.text, self.cells.iter().map(String::as_str));
            self.cells.clear();
        } else {
            self.text.push(b'\n');
        }
        if self.text.len() > MAX_SHEET_BYTES {
            let limit = MAX_SHEET_BYTES as u64;
            return Err(SessionFileError::Expands { what: "the first sheet", limit });
        }
        Ok(())
    }
}
