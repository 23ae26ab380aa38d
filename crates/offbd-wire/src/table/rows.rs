//! The rows of a table: cells, and of a text the number of each line.

use std::io::{self, BufRead, BufReader, Read};

use super::cell;
use crate::session_file::SessionFileError;

/// Longest row, bytes. Chosen: a row has a hundred, and other columns are rarely long.
const MAX_ROW_BYTES: usize = 1 << 20;

/// Bytes that are read at a time.
const BLOCK_BYTES: usize = 64 << 10;

/// The cells of a row.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    bytes: Vec<u8>,
    /// Start and end of each cell in `bytes`.
    ranges: Vec<(usize, usize)>,
    /// The cells that are finite numbers and not text; none of a text file.
    numbers: Vec<Option<f64>>,
}

impl Cells {
    /// Begins a row of a table that is not a text.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.ranges.clear();
        self.numbers.clear();
    }

    /// Appends a number; one that is not finite is text.
    pub(crate) fn push_number(&mut self, value: f64) {
        if !value.is_finite() {
            return self.push_text(&value.to_string());
        }
        let end = self.bytes.len();
        self.ranges.push((end, end));
        self.numbers.push(Some(value));
    }

    /// Appends a text, which is a missing value if it is empty.
    pub(crate) fn push_text(&mut self, text: &str) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(text.as_bytes());
        self.ranges.push((start, self.bytes.len()));
        self.numbers.push(None);
    }

    /// Returns a cell as text.
    pub(crate) fn text(&self, column: usize) -> String {
        let text = || String::from_utf8_lossy(self.get(column).unwrap_or_default()).into_owned();
        self.number(column).map_or_else(text, |number| number.to_string())
    }

    /// Returns the number in a cell that is not text.
    pub(super) fn number(&self, column: usize) -> Option<f64> {
        self.numbers.get(column).copied().flatten()
    }

    pub(super) fn get(&self, column: usize) -> Option<&[u8]> {
        self.ranges.get(column).map(|(start, end)| &self.bytes[*start..*end])
    }

    pub(super) fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Removes from each cell the name of its column before the value.
    ///
    /// # Errors
    /// The reason, if a cell does not begin with the name or there are more or fewer cells.
    pub(super) fn strip_labels(&mut self, names: &[String]) -> Result<(), String> {
        // Behind the last separator may be an empty cell.
        if let Some((start, end)) = self.ranges.last()
            && self.ranges.len() == names.len() + 1
            && cell::bare(&self.bytes[*start..*end]).is_empty()
        {
            self.ranges.pop();
        }
        if self.ranges.len() != names.len() {
            return Err(format!("{} values instead of {}", self.ranges.len(), names.len()));
        }
        for (range, name) in self.ranges.iter_mut().zip(names) {
            let text = std::str::from_utf8(&self.bytes[range.0..range.1]).unwrap_or_default();
            match cell::labelled(text).filter(|(label, _)| label == name) {
                Some((_, value)) => range.0 = range.1 - value.len(),
                None => return Err(format!("`{}` is not `{name}:VALUE`", text.trim())),
            }
        }
        Ok(())
    }

    /// Splits `bytes` at `separator`, or at blanks if that is one.
    pub(super) fn split(&mut self, separator: u8) {
        self.ranges.clear();
        if self.bytes.contains(&b'"') {
            return self.split_quoted(separator);
        }
        let mut start = 0;
        for (end, byte) in self.bytes.iter().chain([&separator]).enumerate() {
            let is_blank = separator == b' ' && matches!(byte, b' ' | b'\t');
            if *byte != separator && !is_blank {
                continue;
            }
            if separator != b' ' || end > start {
                self.ranges.push((start, end));
            }
            start = end + 1;
        }
    }

    fn split_quoted(&mut self, separator: u8) {
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .flexible(true)
            .from_reader(self.bytes.as_slice());
        let mut record = csv::ByteRecord::new();
        if !matches!(reader.read_byte_record(&mut record), Ok(true)) {
            record.clear();
        }
        let mut start = 0;
        let kept = record.iter().filter(|cell| separator != b' ' || !cell.is_empty());
        let mut bytes = Vec::with_capacity(self.bytes.len());
        for cell in kept {
            // Quotes after a blank are not a part of the cell.
            let bare = cell::bare(cell);
            let cell = bare.strip_prefix(b"\"").and_then(|c| c.strip_suffix(b"\"")).unwrap_or(bare);
            bytes.extend_from_slice(cell);
            self.ranges.push((start, bytes.len()));
            start = bytes.len();
        }
        self.bytes = bytes;
    }
}

impl From<&str> for Cells {
    fn from(line: &str) -> Self {
        Self { bytes: line.as_bytes().to_vec(), ..Self::default() }
    }
}

/// Why a row of a table has no cells.
#[derive(Debug)]
pub(crate) enum RowFault {
    /// The row is rejected for this reason, and the next one can be read.
    Rejected(String),
    /// The rest of the file cannot be read, so that nothing of it may be kept.
    Unreadable(SessionFileError),
}

/// The rows of a table, one after the other.
pub(crate) trait RowSource: Send {
    /// Reads the next row; false at the end.
    ///
    /// # Errors
    /// [`RowFault`].
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault>;

    /// The number of the line, or of the row, that was read last, from 1.
    fn line(&self) -> u64;
}

/// Whether a quotation mark is open, as in CSV (RFC 4180, section 2): one that begins a cell opens
/// it, two within it are a character, and one within a cell that has not begun so is a character.
#[derive(Default)]
struct Quotes {
    is_open: bool,
    /// Whether the byte before has closed it.
    is_closed: bool,
    /// Whether the byte before is within a cell.
    is_within: bool,
}

impl Quotes {
    fn read(&mut self, bytes: &[u8], separator: u8) {
        for byte in bytes {
            let is_quote = *byte == b'"';
            let opens = is_quote && (self.is_closed || !self.is_within);
            self.is_closed = self.is_open && is_quote;
            self.is_open = if self.is_open { !is_quote } else { opens };
            self.is_within = *byte != separator;
        }
    }
}

/// Reads the rows of a text.
pub(super) struct Rows<'a> {
    source: BufReader<Box<dyn Read + Send + 'a>>,
    separator: u8,
    comment: Option<u8>,
    /// Number of the line read last, from 1.
    last_line: u64,
    /// Number of the first line of the row read last.
    line: u64,
    is_over: bool,
}

impl<'a> Rows<'a> {
    /// Reads `source`, which begins after `n_lines` lines.
    pub(super) fn new(
        source: Box<dyn Read + Send + 'a>,
        separator: u8,
        comment: Option<u8>,
        n_lines: usize,
    ) -> Self {
        let source = BufReader::with_capacity(BLOCK_BYTES, source);
        let line = n_lines as u64;
        Self { source, separator, comment, line, last_line: line, is_over: false }
    }

    /// Reads a line, and those after it if a quotation mark is not closed.
    fn row(&mut self, row: &mut Vec<u8>) -> io::Result<()> {
        row.clear();
        let mut quotes = Quotes::default();
        loop {
            let start = row.len();
            let room = (MAX_ROW_BYTES + 1).saturating_sub(start);
            let n = self.source.by_ref().take(room as u64).read_until(b'\n', row)?;
            if row.len() > MAX_ROW_BYTES {
                let reason = "a row is longer than 1 MiB; the rest of the file is not read";
                return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
            }
            self.is_over = n == 0;
            self.last_line += u64::from(n > 0);
            quotes.read(&row[start..], self.separator);
            let is_comment =
                || self.comment.is_some() && cell::bare(row).first().copied() == self.comment;
            if self.is_over || !quotes.is_open || is_comment() {
                break;
            }
        }
        while matches!(row.last(), Some(b'\n' | b'\r')) {
            row.pop();
        }
        Ok(())
    }
}

impl RowSource for Rows<'_> {
    /// Reads the next row that is neither blank nor a comment. The rows end where the source
    /// cannot be read any further.
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault> {
        while !self.is_over {
            self.line = self.last_line + 1;
            if let Err(error) = self.row(&mut cells.bytes) {
                self.is_over = true;
                return Err(RowFault::Rejected(error.to_string()));
            }
            let bare = cell::bare(&cells.bytes);
            if !bare.is_empty() && bare.first().copied() != self.comment {
                cells.split(self.separator);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The number of the line at which the row read last begins.
    fn line(&self) -> u64 {
        self.line
    }
}
