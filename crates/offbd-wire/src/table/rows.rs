//! The rows of a table: cells, and of a text the number of each line.

use std::io::{self, BufRead, BufReader, Read};

use super::cell::{self, DecimalSign};

/// Longest row that is kept, bytes. Chosen: a row has a hundred, and other columns are rarely long.
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
            // A blank after a colon is within `x: 0.1`.
            let follows_colon = is_blank && end > start && self.bytes[end - 1] == b':';
            if *byte != separator && !is_blank || follows_colon && end < self.bytes.len() {
                continue;
            }
            if separator != b' ' || end > start {
                self.ranges.push((start, end));
            }
            start = end + 1;
        }
    }

    /// Splits a row with quotation marks, which are taken off the cells that begin with one.
    fn split_quoted(&mut self, separator: u8) {
        let mut quotes = Quotes::default();
        let mut bytes = Vec::with_capacity(self.bytes.len());
        let (mut start, mut from) = (0, 0);
        for (at, byte) in self.bytes.iter().chain([&separator]).enumerate() {
            let is_blank = separator == b' ' && matches!(byte, b' ' | b'\t');
            let ends = (*byte == separator || is_blank) && !quotes.is_open;
            if ends || at == self.bytes.len() {
                let cell = &self.bytes[from..at];
                if separator != b' ' || !cell.is_empty() {
                    push_unquoted(&mut bytes, cell);
                    self.ranges.push((start, bytes.len()));
                    start = bytes.len();
                }
                from = at + 1;
            }
            quotes.read(&[*byte], if is_blank { *byte } else { separator });
        }
        self.bytes = bytes;
    }
}

/// Appends a cell without the quotation marks and blanks around it; two marks within are one.
fn push_unquoted(bytes: &mut Vec<u8>, cell: &[u8]) {
    let bare = cell::bare(cell);
    let Some(inner) = bare.strip_prefix(b"\"") else { return bytes.extend_from_slice(bare) };
    let mut is_second = false;
    for byte in inner {
        is_second = *byte == b'"' && !is_second;
        if !is_second {
            bytes.push(*byte);
        }
    }
}

impl From<&str> for Cells {
    fn from(line: &str) -> Self {
        Self { bytes: line.as_bytes().to_vec(), ..Self::default() }
    }
}

/// Why a row of a table has no cells; `E` is why a file cannot be read.
#[derive(Debug)]
pub(crate) enum RowFault<E> {
    /// The row is rejected for this reason, and the next one can be read.
    Rejected(String),
    /// The rest of the file cannot be read, so that nothing of it may be kept.
    Unreadable(E),
}

/// The rows of a table, one after the other, of a file that fails with `E`.
pub(crate) trait RowSource<E>: Send {
    /// Reads the next row; false at the end.
    ///
    /// # Errors
    /// [`RowFault`].
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault<E>>;

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

/// How the rows of a text are written.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowLayout {
    pub(super) separator: u8,
    /// The beginning of a line that is a comment, if there is one.
    pub(super) comment: Option<u8>,
    /// Cells of a row.
    pub(super) n_cells: usize,
    /// Whether a row may have more cells, since the last column has words, which may have the
    /// separator.
    pub(super) may_have_more: bool,
}

/// Reads the rows of a text.
pub(super) struct Rows<'a> {
    source: BufReader<Box<dyn Read + Send + 'a>>,
    layout: RowLayout,
    /// A line that was read after one whose quotation mark is never closed.
    next_line: Option<Vec<u8>>,
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
        layout: RowLayout,
        n_lines: usize,
    ) -> Self {
        let source = BufReader::with_capacity(BLOCK_BYTES, source);
        let line = n_lines as u64;
        Self { source, layout, next_line: None, line, last_line: line, is_over: false }
    }

    /// Appends a line with its end; of one that is longer than a row, the rest is skipped.
    fn read_line(&mut self, row: &mut Vec<u8>) -> io::Result<()> {
        if let Some(line) = self.next_line.take() {
            row.extend_from_slice(&line);
            self.last_line += 1;
            return Ok(());
        }
        let room = (MAX_ROW_BYTES + 1).saturating_sub(row.len());
        let n = self.source.by_ref().take(room as u64).read_until(b'\n', row)?;
        if row.len() > MAX_ROW_BYTES && row.last() != Some(&b'\n') {
            self.source.skip_until(b'\n')?;
        }
        self.is_over = n == 0;
        self.last_line += u64::from(n > 0);
        Ok(())
    }

    /// Reads a line, and those after it if a quotation mark is not closed.
    fn row<E: From<io::Error>>(&mut self, row: &mut Vec<u8>) -> Result<(), RowFault<E>> {
        row.clear();
        let mut quotes = Quotes::default();
        loop {
            let start = row.len();
            if let Err(error) = self.read_line(row) {
                self.is_over = true;
                return Err(RowFault::Unreadable(error.into()));
            }
            if row.len() > MAX_ROW_BYTES {
                return Err(RowFault::Rejected("a row is longer than 1 MiB".to_owned()));
            }
            quotes.read(&row[start..], self.layout.separator);
            let is_comment = self.layout.comment.is_some()
                && cell::bare(row).first().copied() == self.layout.comment;
            if !quotes.is_open || is_comment {
                break;
            }
            if self.is_over || start > 0 && self.is_row(&row[start..]) {
                if !self.is_over {
                    self.next_line = Some(row.split_off(start));
                    self.last_line -= 1;
                }
                self.is_over = false;
                return Err(RowFault::Rejected("a quotation mark is never closed".to_owned()));
            }
        }
        while matches!(row.last(), Some(b'\n' | b'\r')) {
            row.pop();
        }
        Ok(())
    }

    /// Whether a line within a quotation mark is a row: it has as many cells, and begins with a value.
    fn is_row(&self, line: &[u8]) -> bool {
        let mut cells = Cells { bytes: line.to_vec(), ..Cells::default() };
        cells.split(self.layout.separator);
        let first = cells.text(0);
        let first = first.trim();
        let is_value = cell::is_value(first, DecimalSign::Either) || cell::is_moment(first);
        let is_even = (self.layout.n_cells..=self.layout.n_cells + 1).contains(&cells.len());
        is_even && !first.is_empty() && is_value
    }

    /// Returns why a row with these cells would be misread.
    fn misfit<E>(&self, cells: &Cells) -> Option<RowFault<E>> {
        let n = self.layout.n_cells;
        let is_filled = |i: usize| cells.get(i).is_some_and(|cell| !cell::bare(cell).is_empty());
        let has_more = !self.layout.may_have_more && (n..cells.len()).any(is_filled);
        has_more.then(|| {
            let found = cells.len();
            let hint = if self.layout.separator == b',' {
                "; numbers with decimal commas or thousands separators need quotes, or another separator"
            } else {
                ""
            };
            RowFault::Rejected(format!("{found} cells instead of {n}{hint}"))
        })
    }
}

impl<E: From<io::Error>> RowSource<E> for Rows<'_> {
    /// Reads the next row that is neither blank nor a comment.
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault<E>> {
        while !self.is_over {
            self.line = self.last_line + 1;
            self.row(&mut cells.bytes)?;
            let bare = cell::bare(&cells.bytes);
            if !bare.is_empty() && bare.first().copied() != self.layout.comment {
                cells.split(self.layout.separator);
                return self.misfit(cells).map_or(Ok(true), Err);
            }
        }
        Ok(false)
    }

    /// The number of the line at which the row read last begins.
    fn line(&self) -> u64 {
        self.line
    }
}
