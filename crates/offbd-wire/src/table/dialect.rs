//! How a text file writes its table: separator, decimal sign, comments, what stands before the
//! rows. All of it is found in the first [`HEAD_BYTES`].

use super::cell;
use super::rows::Cells;

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
pub(super) struct Dialect {
    /// `b' '` if runs of blanks separate the columns.
    pub(super) separator: u8,
    pub(super) has_decimal_commas: bool,
    /// The beginning of a line that is a comment, if there is one.
    pub(super) comment: Option<u8>,
    /// The names of the columns; empty if the file has none.
    pub(super) names: Vec<String>,
    /// Whether each cell has the name of its column before its value, as in `t:0.1 x:0.2`.
    pub(super) has_labels: bool,
    /// The units that a line below the names has, one for each column; empty without such a line.
    pub(super) units: Vec<String>,
    /// Lines, and their bytes, before the first row.
    pub(super) n_lines: usize,
    pub(super) n_bytes: usize,
    /// Lines before the names that are neither blank nor a comment.
    pub(super) n_preamble: usize,
    /// The first rows, at most [`JUDGED_ROWS`].
    pub(super) first_rows: Vec<Vec<String>>,
}

impl Dialect {
    /// The columns of a table that is not a text.
    pub(super) fn of_columns(columns: &NamedColumns) -> Self {
        let NamedColumns { names, first_rows } = columns;
        Self {
            separator: b',',
            has_decimal_commas: false,
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
    pub(super) fn n_columns(&self) -> usize {
        self.names.len().max(self.first_rows.first().map_or(0, Vec::len))
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

/// Whether the row below the names has only words; a column without a name has no unit.
fn are_units(names: &[String], row: &[String], is_value: impl Fn(&String) -> bool) -> bool {
    let is_named = |i: usize| names.get(i).is_some_and(|name| !name.is_empty());
    row.iter().enumerate().all(|(i, cell)| match cell.is_empty() {
        true => !is_named(i),
        false => !is_value(cell) && !cell::is_moment(cell),
    })
}

/// Whether two rows have as many cells, but for an empty one behind the last separator of one.
fn is_as_wide(one: &[String], other: &[String]) -> bool {
    let (longer, n) = if one.len() > other.len() { (one, other.len()) } else { (other, one.len()) };
    longer.len() == n || longer.len() == n + 1 && longer[n].is_empty()
}

/// A table as one separator makes it.
struct Candidate {
    separator: u8,
    /// Index of the line with the names, or of the first row if there are none.
    start: usize,
    /// Whether the line at `start` is a comment whose text are the names.
    is_commented: bool,
    header: Vec<String>,
    /// Cells of the next rows, with the indices of their lines.
    rows: Vec<(usize, Vec<String>)>,
}

impl Candidate {
    /// Finds the first line that has as many cells, two at least, as the row after it.
    fn find(lines: &[Line<'_>], separator: u8, comment: Option<u8>) -> Option<Self> {
        let mark = comment.map(char::from);
        let is_comment = |text: &str| mark.is_some_and(|mark| text.trim_start().starts_with(mark));
        let rows: Vec<(usize, Vec<String>)> = lines
            .iter()
            .enumerate()
            .filter(|(_, line)| !is_blank(line.text) && !is_comment(line.text))
            .map(|(i, line)| (i, cells(line.text, separator)))
            .collect();
        let is_table = |i: usize| {
            let row = &rows[i].1;
            row.len() >= 2 && rows.get(i + 1).is_none_or(|(_, next)| is_as_wide(row, next))
        };
        let first = (0..rows.len()).find(|i| is_table(*i))?;
        let mut rest = rows.into_iter().skip(first);
        let (start, header) = rest.next()?;
        let rows = rest.take(JUDGED_ROWS).collect();
        let found = Self { separator, start, is_commented: false, header, rows };
        Some(found.with_commented_names(lines, &is_comment))
    }

    /// Takes the names from the last comment before the rows if the rows have none, as
    /// `numpy.savetxt` writes them.
    fn with_commented_names(
        mut self,
        lines: &[Line<'_>],
        is_comment: &dyn Fn(&str) -> bool,
    ) -> Self {
        if !self.header.iter().all(|cell| cell::is_value(cell, self.has_decimal_commas())) {
            return self;
        }
        let before = lines[..self.start].iter().rposition(|line| !is_blank(line.text));
        let Some(at) = before.filter(|at| is_comment(lines[*at].text)) else { return self };
        let text =
            lines[at].text.trim_start_matches(|c: char| c.is_whitespace() || "#%".contains(c));
        let names = cells(text, self.separator);
        if names.len() == self.header.len() && !names.iter().any(|n| cell::is_value(n, false)) {
            self.rows.insert(0, (self.start, std::mem::replace(&mut self.header, names)));
            (self.start, self.is_commented) = (at, true);
        }
        self
    }

    /// What decides between separators: a table that begins earlier, then a sign rather than
    /// blanks, then more rows of its width, more numbers, more columns.
    fn rank(&self) -> (usize, bool, usize, usize, usize) {
        let n = self.header.len();
        let n_even = self.rows.iter().filter(|(_, row)| is_as_wide(&self.header, row)).count();
        let has_commas = self.has_decimal_commas();
        let is_number = |cell: &&String| cell::is_value(cell, has_commas);
        let n_numbers = self.rows.iter().flat_map(|(_, row)| row).filter(is_number).count();
        (usize::MAX - self.start, self.separator != b' ', n_even, n_numbers, n)
    }

    /// Whether commas are decimal signs: some number has one, and no number has a point.
    fn has_decimal_commas(&self) -> bool {
        if self.separator == b',' {
            return false;
        }
        let all = || self.rows.iter().flat_map(|(_, row)| row).chain(&self.header);
        let has = |sign: char| {
            all().any(|cell| {
                cell.contains(sign) && cell::number(&cell.replacen(sign, ".", 1)).is_some()
            })
        };
        has(',') && !has('.')
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
        let has_decimal_commas = self.has_decimal_commas();
        let is_value = |cell: &String| cell::is_value(cell, has_decimal_commas);
        let n_preamble = lines[..self.start].iter().filter(|line| {
            let first = line.text.trim_start().bytes().next();
            !is_blank(line.text) && (first.is_none() || first != comment)
        });
        let n_preamble = n_preamble.count();
        let is_named = labels.is_none() && (self.is_commented || !self.header.iter().all(is_value));
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
            has_decimal_commas,
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
    use super::*;

    fn of(text: &str) -> Dialect {
        detect(text.as_bytes(), true).unwrap()
    }

    #[test]
    fn separators_and_decimal_signs_are_found() {
        for (text, separator, commas) in [
            ("t,x,y\n0,1,2\n1,2,3\n", b',', false),
            ("t;x;y\n0,01;1,5;2\n0,02;2,5;3\n", b';', true),
            ("t;x;y\n0.01;1.5;2\n0.02;2.5;3\n", b';', false),
            ("t;x;y\n0;1;2\n1;2;3\n", b';', false),
            ("t\tx\ty\n0,01\t1\t2\n", b'\t', true),
            ("t | x | y\n0 | 1 | 2\n", b'|', false),
            ("  t  x   y\n 0  1 2\n", b' ', false),
            ("t_s;cmd,note;x\n0,1;2;3\n0,2;2;3\n", b';', true),
        ] {
            let found = of(text);
            assert_eq!((found.separator, found.has_decimal_commas), (separator, commas), "{text}");
            assert_eq!(found.names.len(), 3, "{text}");
            assert_eq!(found.n_lines, 1);
        }
    }

    #[test]
    fn names_before_each_value_are_found() {
        for text in [
            "t:0.1 qx:-0.2 x:nan\nt:0.2 qx:0 x:1e-3\n",
            "ready\nt:0.1,qx:-0.2,x:\nt:0.2,qx:0,x:1\n",
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
