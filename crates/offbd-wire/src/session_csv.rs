//! The session file: CSV with the columns `t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m` in any order
//! and optionally `seq`; other columns are ignored.
//!
//! An empty field is a missing value. An invalid row is an error with its line number, and
//! reading continues with the next row.

use std::io::{self, Read, Write};

use offbd_core::vocabulary::Sample;

/// The columns of a session file, in the order in which they are written.
pub const COLUMNS: [&str; 5] = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"];

/// Why a file is not a session file.
#[derive(Debug, thiserror::Error)]
pub enum CsvError {
    #[error("the header lacks the column `{0}`; required: t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m")]
    MissingColumn(&'static str),
    #[error("the header names the column `{0}` twice")]
    DoubleColumn(&'static str),
    #[error("cannot read the header: {0}")]
    Header(#[from] csv::Error),
}

/// Why a row is not a valid sample.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct RowError {
    /// Line number, from 1, counting the header.
    pub line: u64,
    pub reason: String,
}

/// Index of each column in the file.
#[derive(Clone, Copy, Debug)]
struct ColumnIndices {
    columns: [usize; COLUMNS.len()],
    seq: Option<usize>,
}

impl ColumnIndices {
    fn of(header: &csv::ByteRecord) -> Result<Self, CsvError> {
        let at = |name: &'static str| {
            let mut found =
                (0..header.len()).filter(|&i| header[i].trim_ascii() == name.as_bytes());
            match (found.next(), found.next()) {
                (Some(_), Some(_)) => Err(CsvError::DoubleColumn(name)),
                (first, _) => Ok(first),
            }
        };
        let mut columns = [0; COLUMNS.len()];
        for (slot, name) in columns.iter_mut().zip(COLUMNS) {
            *slot = at(name)?.ok_or(CsvError::MissingColumn(name))?;
        }
        Ok(Self { columns, seq: at("seq")? })
    }
}

/// Longest row, bytes. Chosen: a row has a hundred, and other columns are rarely long.
const MAX_ROW_BYTES: usize = 1 << 20;

/// A source that fails if a row is too long to be read into memory, as it is if a quotation
/// mark is not closed.
struct RowLimit<R> {
    source: R,
    /// Bytes that may be read until the next row begins.
    left: usize,
}

impl<R: Read> Read for RowLimit<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            let reason = "a row is longer than 1 MiB; the rest of the file is not read";
            return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
        }
        let most = buffer.len().min(self.left);
        let n = self.source.read(&mut buffer[..most])?;
        self.left -= n;
        Ok(n)
    }
}

/// Reads samples row by row, in the order of the file.
pub struct SessionCsvReader<R> {
    csv: csv::Reader<RowLimit<R>>,
    indices: ColumnIndices,
    record: csv::ByteRecord,
}

impl<R: Read> SessionCsvReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// [`CsvError`] if a column is missing or repeated, or `source` cannot be read.
    pub fn new(source: R) -> Result<Self, CsvError> {
        let source = RowLimit { source, left: MAX_ROW_BYTES };
        let mut csv = csv::ReaderBuilder::new().flexible(true).from_reader(source);
        let mut header = csv.byte_headers()?.clone();
        if let Some(first) = header.get(0)
            && let Some(rest) = first.strip_prefix(b"\xef\xbb\xbf")
        {
            let fields = std::iter::once(rest).chain(header.iter().skip(1));
            header = fields.collect();
        }
        let indices = ColumnIndices::of(&header)?;
        Ok(Self { csv, indices, record: csv::ByteRecord::new() })
    }

    /// Returns the line number of the row read last, from 1, counting the header.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    fn sample(&self) -> Result<Sample, RowError> {
        let line = self.line();
        let fail = |reason: String| RowError { line, reason };
        let field = |column: usize| {
            let bytes = self.record.get(self.indices.columns[column]);
            let bytes = bytes.ok_or_else(|| fail(format!("no field `{}`", COLUMNS[column])))?;
            parse_number(bytes).map_err(|e| fail(format!("`{}`: {e}", COLUMNS[column])))
        };
        let seq = match self.indices.seq.and_then(|i| self.record.get(i)).map(<[u8]>::trim_ascii) {
            None | Some(b"") => None,
            Some(bytes) => Some(
                std::str::from_utf8(bytes)
                    .ok()
                    .and_then(|s| s.parse().ok())
                    .ok_or_else(|| fail("`seq` is not a whole number".to_owned()))?,
            ),
        };
        Ok(Sample {
            seq,
            t_s: field(0)?.ok_or_else(|| fail("`t_s` is empty".to_owned()))?,
            cmd_qx_rad: field(1)?,
            cmd_qy_rad: field(2)?,
            x_m: field(3)?,
            y_m: field(4)?,
        })
    }
}

/// Parses the number in a field; `None` if the field is empty.
pub(super) fn parse_number(field: &[u8]) -> Result<Option<f64>, String> {
    let field = field.trim_ascii();
    if field.is_empty() {
        return Ok(None);
    }
    let text = std::str::from_utf8(field).map_err(|_| "not UTF-8".to_owned())?;
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if value.is_finite() { Ok(Some(value)) } else { Err(format!("`{text}` is not finite")) }
}

impl<R: Read> Iterator for SessionCsvReader<R> {
    type Item = Result<Sample, RowError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.csv.get_mut().left = MAX_ROW_BYTES;
        match self.csv.read_byte_record(&mut self.record) {
            Ok(true) => Some(self.sample()),
            Ok(false) => None,
            Err(e) => {
                let line = self.csv.position().line();
                Some(Err(RowError { line, reason: e.to_string() }))
            }
        }
    }
}

/// Writes samples with a header, and with the column `seq` if any sample has one. Numbers
/// are written such that reading them returns the same bits.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write<W: Write>(mut sink: W, samples: &[Sample]) -> io::Result<()> {
    let with_seq = samples.iter().any(|s| s.seq.is_some());
    write_header(&mut sink, with_seq)?;
    write_rows(&mut sink, samples, with_seq)
}

/// Writes only the header.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write_header<W: Write>(mut sink: W, with_seq: bool) -> io::Result<()> {
    if with_seq {
        write!(sink, "seq,")?;
    }
    writeln!(sink, "{}", COLUMNS.join(","))
}

/// Writes only the rows.
///
/// # Errors
/// [`io::Error`] if `sink` fails.
pub fn write_rows<W: Write>(mut sink: W, samples: &[Sample], with_seq: bool) -> io::Result<()> {
    for sample in samples {
        if with_seq {
            write!(sink, "{},", sample.seq.map(|s| s.to_string()).unwrap_or_default())?;
        }
        write!(sink, "{}", sample.t_s)?;
        for value in [sample.cmd_qx_rad, sample.cmd_qy_rad, sample.x_m, sample.y_m] {
            match value {
                Some(value) => write!(sink, ",{value}")?,
                None => write!(sink, ",")?,
            }
        }
        writeln!(sink)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Vec<Result<Sample, RowError>> {
        SessionCsvReader::new(text.as_bytes()).unwrap().collect()
    }

    #[test]
    fn columns_may_have_any_order_and_unknown_ones_are_ignored() {
        let rows = read("y_m,note,t_s,cmd_qy_rad,x_m,cmd_qx_rad\n,hello,1.5,,0.25,-0.1\n");
        let wanted =
            Sample { t_s: 1.5, cmd_qx_rad: Some(-0.1), x_m: Some(0.25), ..Sample::default() };
        assert_eq!(rows, [Ok(wanted)]);
    }

    #[test]
    fn a_row_that_is_too_long_is_not_held_in_memory() {
        let start = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,0,0\n1,0,0,0,\"";
        for rest in ["0", "0\n"] {
            let rest = rest.as_bytes().repeat(8 << 20);
            let mut reader = SessionCsvReader::new(start.as_bytes().chain(&rest[..])).unwrap();
            assert!(reader.next().unwrap().is_ok());
            let error = reader.next().unwrap().unwrap_err();
            assert!(error.reason.contains("longer than 1 MiB"), "{error}");
            assert!(reader.next().is_none());
        }
        let header = SessionCsvReader::new(io::repeat(b'a'));
        assert!(matches!(header, Err(CsvError::Header(_))));
    }

    #[test]
    fn an_invalid_row_is_reported_with_its_line_and_the_next_row_is_read() {
        let rows = read(
            "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,abc,0\n1,0\n2,0,0,NaN,0\n,0,0,0,0\n4,0,0,0,0\n",
        );
        let errors: Vec<String> =
            rows.iter().filter_map(|r| r.as_ref().err()).map(ToString::to_string).collect();
        assert_eq!(
            errors,
            [
                "line 2: `x_m`: `abc` is not a number",
                "line 3: no field `cmd_qy_rad`",
                "line 4: `x_m`: `NaN` is not finite",
                "line 5: `t_s` is empty",
            ]
        );
        assert_eq!(rows[4].as_ref().unwrap().t_s, 4.0);
    }

    #[test]
    fn a_header_with_a_missing_or_repeated_column_is_rejected() {
        let error = SessionCsvReader::new("t_s,x_m,y_m,cmd_qx_rad\n".as_bytes()).err().unwrap();
        assert!(error.to_string().contains("`cmd_qy_rad`"), "{error}");
        let error = SessionCsvReader::new("t_s,t_s,x_m,y_m,cmd_qx_rad,cmd_qy_rad\n".as_bytes())
            .err()
            .unwrap();
        assert!(error.to_string().contains("twice"), "{error}");
        assert!(SessionCsvReader::new(&b""[..]).is_err());
    }

    fn finite() -> impl Strategy<Value = f64> {
        proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO
    }

    proptest! {
        #[test]
        fn written_samples_are_read_back_bit_for_bit(
            rows in proptest::collection::vec(
                (proptest::option::of(0..u64::MAX), finite(), proptest::array::uniform4(proptest::option::of(finite()))),
                0..20,
            )
        ) {
            let samples: Vec<Sample> = rows.into_iter().map(|(seq, t_s, [a, b, c, d])| Sample {
                seq, t_s, cmd_qx_rad: a, cmd_qy_rad: b, x_m: c, y_m: d,
            }).collect();
            let mut text = Vec::new();
            write(&mut text, &samples).unwrap();
            let back: Vec<Sample> = SessionCsvReader::new(text.as_slice()).unwrap().map(Result::unwrap).collect();
            prop_assert_eq!(back.len(), samples.len());
            for (a, b) in back.iter().zip(&samples) {
                prop_assert_eq!(format!("{:?}", a), format!("{:?}", b));
            }
        }
    }
}
