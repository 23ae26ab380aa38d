//! How a text file writes its table: separator, decimal sign, comments, what stands before the
//! rows. All of it is found in the first [`HEAD_BYTES`].

use std::collections::HashMap;

use super::cell::{self, DecimalSign};
use super::rows::Cells;
use super::unit::{self, TIME_WORDS};
use crate::session_csv::COLUMNS;

/// Bytes at the beginning of a file in which its table is looked for. Chosen: a preamble of a
/// thousand lines fits.
pub(super) const HEAD_BYTES: usize = 64 << 10;

/// Lines that are looked at.
const HEAD_LINES: usize = 1000;

/// Rows after the header by which a separator and units are judged. Chosen: enough that a line of text that
/// happens to have as many cells does not decide.
pub(crate) const JUDGED_ROWS: usize = 20;

/// Separators of columns. Blanks separate if none of the others makes a table that early.
const SEPARATORS: [u8; 4] = [b',', b';', b'\t', b'|'];

/// Beginnings of a comment.
const COMMENTS: [u8; 2] = *b"#%";

/// How a text file writes its table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Dialect {
    /// `b' '` if runs of blanks separate the columns.
    pub(crate) separator: u8,
    pub(crate) decimal: DecimalSign,
    /// The beginning of a line that is a comment, if there is one.
    pub(crate) comment: Option<u8>,
    /// The names of the columns; empty if the file has none.
    pub(crate) names: Vec<String>,
    /// Whether each cell has the name of its column before its value, as in `t:0.1 x:0.2`.
    pub(super) has_labels: bool,
    /// The units that a line below the names has, one for each column; empty without such a line.
    pub(crate) units: Vec<String>,
    /// Lines, and their bytes, before the first row.
    pub(super) n_lines: usize,
    pub(super) n_bytes: usize,
    /// Lines before the names that are neither blank nor a comment.
    pub(crate) n_preamble: usize,
    /// The first rows, at most [`JUDGED_ROWS`].
    pub(crate) first_rows: Vec<Vec<String>>,
}

impl Dialect {
    /// The columns of a table that is not a text.
    pub(crate) fn of_columns(columns: &NamedColumns) -> Self {
        let NamedColumns { names, first_rows } = columns;
        Self {
            separator: b',',
            decimal: DecimalSign::Point,
            comment: None,
            names: names.clone(),
            has_labels: false,
            units: Vec::new(),
            n_lines: 0,
            n_bytes: 0,
            n_preamble: 0,
            first_rows: first_rows.clone(),
        }
    }

    /// Number of columns.
    pub(crate) fn n_columns(&self) -> usize {
        self.names.len().max(self.first_rows.first().map_or(0, Vec::len))
    }

    /// Whether the columns have the names of quantities.
    pub(super) fn has_own_names(&self) -> bool {
        has_own_names(&self.names)
    }

    /// Whether the last column has words.
    pub(super) fn ends_with_words(&self) -> bool {
        let last = self.n_columns().saturating_sub(1);
        let is_word = |cell: &String| !cell::is_value(cell, self.decimal) && !cell::is_moment(cell);
        self.first_rows.iter().any(|row| row.get(last).is_some_and(is_word))
    }
}

/// The columns of a table that is not a text.
#[derive(Clone, Debug, Default)]
pub(crate) struct NamedColumns {
    /// Their names, whatever these are.
    pub(crate) names: Vec<String>,
    /// The first rows as text, at most [`JUDGED_ROWS`].
    pub(crate) first_rows: Vec<Vec<String>>,
}

/// A line of the head.
struct Line<'a> {
    text: &'a str,
    /// Bytes of the head up to its end, with the line end.
    end: usize,
}

/// Finds the table in `head`; `is_whole` if the file ends with it. `None` if no line has columns.
pub(super) fn detect(head: &[u8], is_whole: bool) -> Option<Dialect> {
    let lines = lines(head, is_whole);
    let comment = comment(&lines);
    let best = SEPARATORS
        .into_iter()
        .chain([b' '])
        .filter_map(|separator| Candidate::find(&lines, separator, comment))
        .reduce(|best, other| if other.rank() > best.rank() { other } else { best })?;
    Some(best.dialect(&lines, comment))
}

fn lines(head: &[u8], is_whole: bool) -> Vec<Line<'_>> {
    let mut lines = Vec::new();
    let mut start = 0;
    while start < head.len() && lines.len() < HEAD_LINES {
        let length = head[start..].iter().position(|b| *b == b'\n');
        let end = match length {
            Some(length) => start + length + 1,
            None if is_whole => head.len(),
            None => break,
        };
        // A line that is not UTF-8 is not a header; its rows are reported when they are read.
        let text = std::str::from_utf8(&head[start..end]).unwrap_or("\u{fffd}");
        lines.push(Line { text: text.trim_end_matches(['\r', '\n']), end });
        start = end;
    }
    lines
}

fn is_blank(text: &str) -> bool {
    text.trim_matches(['\0', ' ', '\t']).is_empty()
}

fn comment(lines: &[Line<'_>]) -> Option<u8> {
    let first = |line: &Line<'_>| line.text.trim_start().bytes().next();
    let starts = |mark: u8| lines.iter().any(|line| first(line) == Some(mark));
    COMMENTS.into_iter().find(|mark| starts(*mark))
}

/// Returns the cells of a line.
fn cells(text: &str, separator: u8) -> Vec<String> {
    let mut cells = Cells::from(text);
    cells.split(separator);
    let cell = |i: usize| cells.get(i).map(|cell| bare(&String::from_utf8_lossy(cell)).to_owned());
    (0..cells.len()).filter_map(cell).collect()
}

/// Returns a cell without blanks, zeros and the quotes that follow blanks around it.
fn bare(cell: &str) -> &str {
    let cell = cell.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).unwrap_or(cell).trim()
}

/// Whether a cell begins as a number does, such as `0.1 s` and `13:51:00`.
fn starts_as_number(cell: &str) -> bool {
    let cell = cell.trim_start_matches(['+', '-', '[', '(']);
    cell.starts_with(|c: char| c.is_ascii_digit())
}

/// Whether a row has values and not names: its first cell is one, and at least half of all.
fn are_values(row: &[String], sign: DecimalSign) -> bool {
    let is_value = |cell: &&String| cell::is_value(cell, sign) || starts_as_number(cell);
    let filled = || row.iter().filter(|cell| !cell.is_empty());
    filled().next().is_none_or(|cell| is_value(&cell))
        && 2 * filled().filter(is_value).count() >= filled().count()
}

/// Whether a name has a word for the time.
fn says_time(name: &str) -> bool {
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| TIME_WORDS.iter().any(|known| word.eq_ignore_ascii_case(known)))
}

/// Whether a row has the names of the time and of another quantity.
fn has_own_names(row: &[String]) -> bool {
    let has = |name: &str| row.iter().any(|cell| cell.eq_ignore_ascii_case(name));
    let [time, others @ ..] = &COLUMNS;
    has(time) && others.iter().any(|name| has(name))
}

/// Whether the row below the names has only words; a column without a name has no unit.
fn are_units(names: &[String], row: &[String], is_value: impl Fn(&String) -> bool) -> bool {
    let is_named = |i: usize| names.get(i).is_some_and(|name| !name.is_empty());
    row.iter().enumerate().all(|(i, cell)| match cell.is_empty() {
        true => !is_named(i),
        false => !is_value(cell) && !starts_as_number(cell),
    })
}

/// Whether two rows have as many cells, but for an empty one behind the last separator of one.
fn is_as_wide(one: &[String], other: &[String]) -> bool {
    let (longer, n) = if one.len() > other.len() { (one, other.len()) } else { (other, one.len()) };
    longer.len() == n || longer.len() == n + 1 && longer[n].is_empty()
}

/// Returns how many of the rows after each row are as wide as it.
fn n_as_wide_after(rows: &[(usize, Vec<String>)]) -> Vec<usize> {
    // Rows by their width, and those of them with an empty last cell.
    let (mut all, mut open) = (HashMap::<usize, usize>::new(), HashMap::<usize, usize>::new());
    let mut counts = vec![0; rows.len()];
    for (count, (_, row)) in counts.iter_mut().zip(rows).rev() {
        let (n, is_open) = (row.len(), row.last().is_some_and(String::is_empty));
        let of = |counted: &HashMap<usize, usize>, n: usize| counted.get(&n).copied().unwrap_or(0);
        let shorter = if is_open && n > 0 { of(&all, n - 1) } else { 0 };
        *count = of(&all, n) + of(&open, n + 1) + shorter;
        *all.entry(n).or_default() += 1;
        *open.entry(n).or_default() += usize::from(is_open);
    }
    counts
}

/// Whether a table may begin with row `i`: it has two cells or more, and the next row as many, or it
/// is a row of values that is cut short.
fn begins_table(rows: &[(usize, Vec<String>)], i: usize) -> bool {
    let row = &rows[i].1;
    let is_text = |cell: &String| !cell.contains(char::is_control);
    let is_cut = |next: &[String]| next.len() < row.len() && are_values(next, DecimalSign::Either);
    row.len() >= 2
        && row.iter().all(is_text)
        && rows.get(i + 1).is_none_or(|(_, next)| is_as_wide(row, next) || is_cut(next))
}

/// Returns the decimal sign of the numbers in a table. A comma is one if some number has it where no
/// thousands separator can be, and no number has a point.
fn decimal_sign<'a>(rows: impl Iterator<Item = &'a [String]>) -> DecimalSign {
    let (mut has_points, mut has_grouped_points) = (false, false);
    // For each column: numbers with a comma, those that may be thousands, and others.
    let mut columns: Vec<[usize; 3]> = Vec::new();
    for row in rows {
        columns.resize(columns.len().max(row.len()), [0; 3]);
        for (cell, [commas, grouped, plain]) in row.iter().zip(&mut columns) {
            if cell::is_grouped(cell, ',') {
                *grouped += 1;
            } else if cell::is_grouped(cell, '.') {
                has_grouped_points = true;
            } else if cell.contains(',') {
                *commas += usize::from(cell::is_value(cell, DecimalSign::Comma));
            } else if cell::number(cell).is_some() {
                *plain += usize::from(!cell.contains('.'));
                has_points |= cell.contains('.');
            }
        }
    }
    let has_commas =
        columns.iter().any(|[commas, grouped, plain]| *commas > 0 || *grouped > 0 && *plain == 0);
    let has_thousands = columns.iter().any(|[_, grouped, _]| *grouped > 0);
    match (has_points, has_commas) {
        (true, _) => DecimalSign::Point,
        (false, true) => DecimalSign::Comma,
        (false, false) if has_grouped_points || has_thousands => DecimalSign::Point,
        (false, false) => DecimalSign::Either,
    }
}

/// A table as one separator makes it.
struct Candidate {
    separator: u8,
    decimal: DecimalSign,
    /// Index of the line with the names, or of the first row if there are none.
    start: usize,
    /// Rows of the head that are as wide as the line at `start`.
    n_even: usize,
    /// Whether the line at `start` is a comment whose text are the names.
    is_commented: bool,
    header: Vec<String>,
    /// Cells of the next rows, with the indices of their lines.
    rows: Vec<(usize, Vec<String>)>,
}

impl Candidate {
    /// Finds the line with the names of the time and of another quantity. Without one, finds the line
    /// after which most rows have as many cells, two at least; of several the first.
    fn find(lines: &[Line<'_>], separator: u8, comment: Option<u8>) -> Option<Self> {
        let mark = comment.map(char::from);
        let is_comment = |text: &str| mark.is_some_and(|mark| text.trim_start().starts_with(mark));
        let rows: Vec<(usize, Vec<String>)> = lines
            .iter()
            .enumerate()
            .filter(|(_, line)| !is_blank(line.text) && !is_comment(line.text))
            .map(|(i, line)| (i, cells(line.text, separator)))
            .collect();
        let n_after = n_as_wide_after(&rows);
        let most = (0..rows.len()).filter(|i| begins_table(&rows, *i));
        let most = most.max_by_key(|i| (n_after[*i], usize::MAX - i));
        let own = rows.iter().position(|(_, row)| has_own_names(row));
        let first = own.or(most)?;
        let n_even = n_after[first] + 1;
        let n_below = n_after.get(first + 1).map_or(0, |n| n + 1);
        let decimal = decimal_sign(rows[first..].iter().map(|(_, row)| row.as_slice()));
        let mut rest = rows.into_iter().skip(first.saturating_sub(1));
        let before = if first > 0 { rest.next() } else { None };
        let (start, header) = rest.next()?;
        let rows = rest.take(JUDGED_ROWS).collect();
        let found = Self { separator, decimal, start, n_even, is_commented: false, header, rows };
        let is_next = |at: usize| lines[at + 1..start].iter().all(|line| is_blank(line.text));
        let before = before.filter(|(at, _)| is_next(*at));
        Some(found.with_commented_names(lines, &is_comment).with_row_names(before, n_below))
    }

    /// Gives the first column an empty name if its cells count the rows from 1 and the line of names has
    /// no name for it, as R's `write.table` writes them. That line is the one at `start`, followed by
    /// `n_below` even rows, or the one `before` it.
    fn with_row_names(mut self, before: Option<(usize, Vec<String>)>, n_below: usize) -> Self {
        let counts = |rows: &mut dyn Iterator<Item = &Vec<String>>, n: usize| {
            let is_next =
                |(i, row): (usize, &Vec<String>)| row.len() == n && row[0].parse() == Ok(i + 1);
            rows.enumerate().all(is_next)
        };
        if !self.rows.is_empty() && !are_values(&self.header, self.decimal) {
            // Behind the last separator may be an empty cell.
            let is_even = self.rows.iter().all(|(_, row)| is_as_wide(&self.header, row));
            let mut rows = self.rows.iter().map(|(_, row)| row);
            if !is_even && counts(&mut rows, self.header.len() + 1) {
                self.header.insert(0, String::new());
                self.n_even = n_below + 1;
            }
            return self;
        }
        let are_names = |(_, names): &(usize, Vec<String>)| {
            let mut rows =
                std::iter::once(&self.header).chain(self.rows.iter().map(|(_, row)| row));
            names.iter().any(|name| says_time(name))
                && !are_values(names, self.decimal)
                && counts(&mut rows, names.len() + 1)
        };
        if let Some((at, mut names)) = before.filter(are_names) {
            names.insert(0, String::new());
            self.rows.insert(0, (self.start, std::mem::replace(&mut self.header, names)));
            self.start = at;
        }
        self
    }

    /// Takes the names from the last comment before the rows if the rows have none, as
    /// `numpy.savetxt` writes them; from the one before it if the last has units.
    fn with_commented_names(
        mut self,
        lines: &[Line<'_>],
        is_comment: &dyn Fn(&str) -> bool,
    ) -> Self {
        let is_filled = |cell: &&String| !cell.is_empty();
        let is_value = |cell: &String| cell::is_value(cell, self.decimal) || cell::is_moment(cell);
        if !self.header.iter().filter(is_filled).any(is_value) {
            return self;
        }
        let named = |before: usize| -> Option<(usize, Vec<String>)> {
            let at = lines[..before].iter().rposition(|line| !is_blank(line.text))?;
            let text = lines[at].text.trim_start();
            let text = text.strip_prefix(['#', '%']).filter(|_| is_comment(text))?;
            // A column may be named by the mark alone.
            let is_even = |names: &Vec<String>| names.len() == self.header.len();
            let text = text.trim_start_matches(['#', '%', ' ', '\t']);
            let names = Some(cells(text, self.separator)).filter(is_even)?;
            (!names.iter().filter(is_filled).any(is_value)).then_some((at, names))
        };
        let Some((mut at, mut names)) = named(self.start) else { return self };
        let mut units = None;
        if names.iter().all(|name| unit::is_unit(name))
            && let Some((before, own)) = named(at)
        {
            units = Some((at, std::mem::replace(&mut names, own)));
            at = before;
        }
        self.rows.insert(0, (self.start, std::mem::replace(&mut self.header, names)));
        if let Some(units) = units {
            self.rows.insert(0, units);
        }
        (self.start, self.is_commented) = (at, true);
        self
    }

    /// What decides between separators: names of quantities, then more rows of the table's width, a
    /// table that begins earlier, a sign rather than blanks, a larger share of numbers, more columns.
    fn rank(&self) -> impl PartialOrd + use<> {
        let cells = || self.rows.iter().flat_map(|(_, row)| row);
        let n_numbers = cells().filter(|cell| cell::is_value(cell, self.decimal)).count();
        let share = 1000 * n_numbers / cells().count().max(1);
        let (is_own, is_sign) = (has_own_names(&self.header), self.separator != b' ');
        (is_own, self.n_even, usize::MAX - self.start, is_sign, share, self.header.len())
    }

    /// Takes the names from the cells, if each of a column begins with the same one.
    fn take_labels(&mut self) -> Option<Vec<String>> {
        let parts = |row: &[String]| -> Option<(Vec<String>, Vec<String>)> {
            let parts = row.iter().map(|cell| cell::labelled(cell));
            let owned = |(label, value): (&str, &str)| (label.to_owned(), value.to_owned());
            Some(
                parts
                    .map(|parts| parts.map(owned))
                    .collect::<Option<Vec<_>>>()?
                    .into_iter()
                    .unzip(),
            )
        };
        let (labels, first) = parts(&self.header)?;
        let rows = self.rows.iter().map(|(line, row)| {
            let (own, values) = parts(row)?;
            (own == labels).then_some((*line, values))
        });
        self.rows = rows.collect::<Option<_>>()?;
        self.header = first;
        Some(labels)
    }

    fn dialect(mut self, lines: &[Line<'_>], comment: Option<u8>) -> Dialect {
        let labels = self.take_labels();
        let sign = self.decimal;
        let is_value = |cell: &String| cell::is_value(cell, sign);
        let n_preamble = lines[..self.start].iter().filter(|line| {
            let first = line.text.trim_start().bytes().next();
            !is_blank(line.text) && (first.is_none() || first != comment)
        });
        let n_preamble = n_preamble.count();
        let is_named = labels.is_none() && (self.is_commented || !are_values(&self.header, sign));
        let mut rows = self.rows;
        let mut units = Vec::new();
        let mut before = self.start + usize::from(is_named);
        if !is_named {
            rows.insert(0, (self.start, self.header.clone()));
        } else if let Some((line, row)) = rows.first()
            && is_as_wide(&self.header, row)
            && are_units(&self.header, row, is_value)
        {
            before = line + 1;
            units = rows.remove(0).1;
        }
        Dialect {
            separator: self.separator,
            decimal: sign,
            comment,
            has_labels: labels.is_some(),
            names: if is_named { self.header } else { labels.unwrap_or_default() },
            units,
            n_lines: before,
            n_bytes: before.checked_sub(1).map_or(0, |last| lines[last].end),
            n_preamble,
            first_rows: rows.into_iter().map(|(_, row)| row).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::DecimalSign::{Comma, Either, Point};
    use super::*;

    fn of(text: &str) -> Dialect {
        detect(text.as_bytes(), true).unwrap()
    }

    #[test]
    fn separators_and_decimal_signs_are_found() {
        for (text, separator, decimal) in [
            ("t,x,y\n0,1,2\n1,2,3\n", b',', Either),
            ("t;x;y\n0,01;1,5;2\n0,02;2,5;3\n", b';', Comma),
            ("t;x;y\n0.01;1.5;2\n0.02;2.5;3\n", b';', Point),
            ("t;x;y\n0;1;2\n1;2;3\n", b';', Either),
            ("t\tx\ty\n0,01\t1\t2\n", b'\t', Comma),
            ("t | x | y\n0 | 1 | 2\n", b'|', Either),
            ("  t  x   y\n 0  1 2\n", b' ', Either),
            ("t_s;cmd,note;x\n0,1;2;3\n0,2;2;3\n", b';', Comma),
            ("t,x,y\n0,\"0,5\",1\n1,\"1,5\",2\n", b',', Comma),
            // Thousands begin where numbers of three digits end; three decimals are everywhere.
            ("t;x;y\n999;0;0\n1,000;0;0\n", b';', Point),
            ("t;x;y\n1,999;0;0\n2,000;0;0\n", b';', Comma),
            ("t;x;y\n999;0,5;0\n1.000;0,5;0\n", b';', Comma),
            ("t;x;y\n0,998;0;0\n0,999;0;0\n1,000;0;0\n", b';', Comma),
        ] {
            let found = of(text);
            assert_eq!((found.separator, found.decimal), (separator, decimal), "{text}");
            assert_eq!(found.names.len(), 3, "{text}");
            assert_eq!(found.n_lines, 1);
        }
    }

    #[test]
    fn names_before_each_value_are_found() {
        for text in [
            "t:0.1 qx:-0.2 x:nan\nt:0.2 qx:0 x:1e-3\n",
            "ready\nt:0.1,qx:-0.2,x:\nt:0.2,qx:0,x:1\n",
            "Rig: 3\nt: 0.1 qx: -0.2 x: nan\nt: 0.2 qx: 0 x: 1e-3\n",
            "t = 0.1; qx = -0.2; x = 3\nt = 0.2; qx = 0; x = 4\n",
        ] {
            let found = of(text);
            assert!(found.has_labels, "{text}");
            assert_eq!(found.names, ["t", "qx", "x"], "{text}");
            assert_eq!(found.first_rows[0][..2], ["0.1", "-0.2"], "{text}");
            assert_eq!(found.first_rows.len(), 2, "{text}");
        }
        for text in
            ["t:s,x:m\n0,1\n", "13:51:00,1\n13:51:01,2\n", "t:0,x:1\nt:0,y:1\n", "t:0 x:1\nt:0 1\n"]
        {
            assert!(!of(text).has_labels, "{text}");
        }
    }

    /// The first two are what R's `write.table` writes of a data frame, with and without quotes.
    #[test]
    fn names_of_rows_have_no_name() {
        for text in [
            "\"t\" \"x\"\n\"1\" 0 0.25\n\"2\" 0.01 NA\n",
            "t x\n1 0 0.25\n2 0.01 NA\n",
            "t_s\tx_m\n1\t0\t0.25\n2\t0.01\tNA\n",
        ] {
            let found = of(text);
            assert_eq!(found.names.len(), 3, "{text}");
            assert_eq!((&*found.names[0], &found.names[1][..1]), ("", "t"), "{text}");
            assert_eq!(found.first_rows.len(), 2, "{text}");
            assert_eq!(found.first_rows[1], ["2", "0.01", "NA"], "{text}");
            assert_eq!((found.n_lines, found.n_preamble), (1, 0), "{text}");
        }
        // The first row is not counted; the others have no more cells; the line above does not name a time.
        assert_eq!(of("t,x\n0,1,7\n1,2,7\n").names.len(), 0);
        let found = of("n,t,x\n1,0,2,\n2,1,3,\n");
        assert_eq!((&*found.names[0], found.first_rows[1].len()), ("n", 4));
        assert_eq!(of("a log\n1 0 2\n2 1 3\n").names.len(), 0);
        let found = of("Rig 3,run 7\n# n,t,x\n1,0,2\n2,1,3\n");
        assert_eq!(found.names, ["n", "t", "x"]);
    }

    #[test]
    fn what_stands_before_the_rows_is_skipped() {
        let found = of("Rig 3, run 7\nDate: Monday\n\nt,x\ns,mm\n# begun\n0,1\n1,2\n");
        assert_eq!(found.names, ["t", "x"]);
        assert_eq!(found.units, ["s", "mm"]);
        assert_eq!((found.n_lines, found.n_bytes, found.n_preamble), (5, 36, 2));
        assert_eq!(found.comment, Some(b'#'));
        for text in ["t,x\n0,1,\n1,2,\n", "t,x,\n0,1\n1,2\n", "t,x,\ns,m,\n0,1,\n"] {
            let found = of(text);
            assert_eq!(found.names[..2], ["t", "x"], "{text}");
            assert_eq!(found.first_rows[0][..2], ["0", "1"], "{text}");
        }
        let found = of("# offbd\n# t x\n0 1\n1 2\n");
        assert_eq!((found.names, found.n_lines), (vec!["t".to_owned(), "x".to_owned()], 2));
        let found = of("1879.0\t1988.0\n1940.0\t2083.0\n");
        assert_eq!((found.names.len(), found.n_lines), (0, 0));
        assert_eq!(found.first_rows.len(), 2);
        let found = of("time,x\n2026-02-20 13:51:00,n\n");
        assert!(found.units.is_empty());
        assert!(detect(b"one\ntwo\n", true).is_none());
        assert!(detect(b"", true).is_none());
    }
}
