//! The rows of a spreadsheet's sheet, gathered from its cells.

use super::SessionFileError;
use super::xlsx::CellValue;
use crate::session_csv::COLUMNS;
use crate::telemetry::{MAX_SEQ, shorten};
use offbd_core::vocabulary::Sample;

/// Most rows of a sheet: all that a spreadsheet has. A sheet with more is refused.
const MAX_ROWS: usize = 1 << 20;

/// Columns that are read: those of the CSV file, and the numbers of the samples.
const N_COLUMNS: usize = COLUMNS.len() + 1;
const SEQ: usize = COLUMNS.len();

const fn name(column: usize) -> &'static str {
    if column < SEQ { COLUMNS[column] } else { "seq" }
}

/// A row of a sheet.
pub(super) struct SheetRow {
    /// Counted from 0.
    index: u32,
    /// NaN where a cell is empty, because a million rows are in memory.
    values: [f64; N_COLUMNS],
    /// The first cell that is wrong, and why.
    wrong: Option<Box<str>>,
}

impl SheetRow {
    const fn new(index: u32) -> Self {
        Self { index, values: [f64::NAN; N_COLUMNS], wrong: None }
    }

    /// The number of the row, as the spreadsheet shows it.
    pub(super) fn number(&self) -> u64 {
        u64::from(self.index) + 1
    }

    /// The row as a sample, or which cell is wrong.
    pub(super) fn sample(self) -> Result<Sample, String> {
        if let Some(wrong) = self.wrong {
            return Err(wrong.into_string());
        }
        let present = |value: f64| (!value.is_nan()).then_some(value);
        let [t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m, seq] = self.values.map(present);
        let t_s = t_s.ok_or_else(|| format!("`{}` is empty", COLUMNS[0]))?;
        let whole = |seq: f64| {
            let is_whole = seq.fract() == 0.0 && (0.0..=MAX_SEQ as f64).contains(&seq);
            let reason = || format!("`seq`: `{seq}` is not a whole number of a sample");
            is_whole.then_some(seq as u64).ok_or_else(reason)
        };
        let seq = seq.map(whole).transpose()?;
        Ok(Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m })
    }
}

/// Gathers the cells of a sheet, which come row by row.
pub(super) struct SheetRows<'a> {
    sheet: &'a str,
    header_row: Option<u32>,
    /// Where the columns are.
    columns: [Option<u32>; N_COLUMNS],
    /// Whether the header has ended.
    has_header: bool,
    rows: Vec<SheetRow>,
}

impl<'a> SheetRows<'a> {
    pub(super) const fn new(sheet: &'a str) -> Self {
        let columns = [None; N_COLUMNS];
        Self { sheet, header_row: None, columns, has_header: false, rows: Vec::new() }
    }

    /// Takes the cell at row and column, both counted from 0.
    pub(super) fn cell(
        &mut self,
        (row, column): (u32, u32),
        value: CellValue<'_>,
    ) -> Result<(), SessionFileError> {
        if value == CellValue::Empty {
            return Ok(());
        }
        if *self.header_row.get_or_insert(row) == row {
            return self.header(column, value);
        }
        self.end_header()?;
        let Some(slot) = self.columns.iter().position(|at| *at == Some(column)) else {
            return Ok(());
        };
        let read = value.number(slot == 0);
        let row = self.row(row)?;
        match read {
            Ok(value) => row.values[slot] = value.unwrap_or(f64::NAN),
            Err(why) => {
                let (cell, name) = (cell_name(row.index, column), name(slot));
                let wrong = || shorten(&format!("cell {cell} (`{name}`): {why}")).into();
                row.wrong.get_or_insert_with(wrong);
            }
        }
        Ok(())
    }

    /// Ends the sheet.
    pub(super) fn end(mut self) -> Result<Vec<SheetRow>, SessionFileError> {
        self.end_header()?;
        Ok(self.rows)
    }

    /// Takes a cell of the header.
    fn header(&mut self, column: u32, value: CellValue<'_>) -> Result<(), SessionFileError> {
        let CellValue::Text(text) = value else { return Ok(()) };
        let Some(slot) = (0..N_COLUMNS).find(|&slot| text.trim() == name(slot)) else {
            return Ok(());
        };
        match self.columns[slot].replace(column) {
            Some(_) => Err(self.wrong(SessionFileError::TwoColumns(name(slot)))),
            None => Ok(()),
        }
    }

    /// Checks that the header has the columns of a session.
    fn end_header(&mut self) -> Result<(), SessionFileError> {
        if !self.has_header {
            let missing = COLUMNS.iter().zip(&self.columns).find(|(_, at)| at.is_none());
            if let Some((name, _)) = missing {
                return Err(self.wrong(SessionFileError::NoColumn(name)));
            }
            self.has_header = true;
        }
        Ok(())
    }

    fn wrong(&self, reason: impl ToString) -> SessionFileError {
        SessionFileError::Sheet { sheet: self.sheet.to_owned(), reason: reason.to_string() }
    }

    /// Returns the row with the index; adds it if it is new.
    fn row(&mut self, index: u32) -> Result<&mut SheetRow, SessionFileError> {
        if self.rows.last().is_none_or(|row| row.index != index) {
            if self.rows.len() == MAX_ROWS {
                return Err(self.wrong(format!("it has more than {MAX_ROWS} rows")));
            }
            self.rows.push(SheetRow::new(index));
        }
        let last = self.rows.len() - 1;
        Ok(&mut self.rows[last])
    }
}

/// The name of a cell, such as `D5`.
fn cell_name(row: u32, column: u32) -> String {
    let mut letters = Vec::new();
    let mut left = u64::from(column) + 1;
    while left > 0 {
        letters.push(char::from(b'A' + ((left - 1) % 26) as u8));
        left = (left - 1) / 26;
    }
    let letters: String = letters.into_iter().rev().collect();
    format!("{letters}{}", u64::from(row) + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_named_as_spreadsheets_do() {
        let names = [(0, 0), (4, 25), (9, 26), (0, 701), (0, 702)].map(|(r, c)| cell_name(r, c));
        assert_eq!(names, ["A1", "Z5", "AA10", "ZZ1", "AAA1"]);
    }
}
