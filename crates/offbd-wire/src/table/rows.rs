//! The rows of a text, line by line: cells, and the number of each line.

use std::io::{self, BufRead, BufReader, Read};

use super::cell;

/// Longest row, bytes. Chosen: a row has a hundred, and other columns are rarely long.
const MAX_ROW_BYTES: usize = 1 << 20;

/// Bytes that are read at a time.
const BLOCK_BYTES: usize = 64 << 10;

/// The cells of a row.
#[derive(Debug, Default)]
pub(super) struct Cells {
    bytes: Vec<u8>,
    /// Start and end of each cell in `bytes`.
    ranges: Vec<(usize, usize)>,
}

impl Cells {
    pub(super) fn get(&self, column: usize) -> Option<&[u8]> {
        self.ranges.get(column).map(|(start, end)| &self.bytes[*start..*end])
    }

    pub(super) fn len(&self) -> usize {
        self.ranges.len()
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
        Self { bytes: line.as_bytes().to_vec(), ranges: Vec::new() }
    }
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

/// Reads rows.
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

    /// The number of the line at which the row read last begins, from 1.
    pub(super) const fn line(&self) -> u64 {
        self.line
    }

    /// Reads the next row that is neither blank nor a comment; false at the end.
    ///
    /// # Errors
    /// The reason why the source cannot be read on; then the rows are over.
    pub(super) fn next(&mut self, cells: &mut Cells) -> io::Result<bool> {
        while !self.is_over {
            self.line = self.last_line + 1;
            if let Err(error) = self.row(&mut cells.bytes) {
                self.is_over = true;
                return Err(error);
            }
            let bare = cell::bare(&cells.bytes);
            if !bare.is_empty() && bare.first().copied() != self.comment {
                cells.split(self.separator);
                return Ok(true);
            }
        }
        Ok(false)
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
