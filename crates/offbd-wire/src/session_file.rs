//! Files of one session in the formats of other tools: reading them as samples and writing
//! them, piece by piece.
//!
//! All formats have the columns of the CSV file (`session_csv.rs`), as columns or as the
//! keys of messages. A format beside CSV and JSON needs a cargo feature of its own name;
//! without it the file is refused with a message that says so. Readers and writers hold a
//! bounded part of a session in memory. A file that ends too early or is damaged is an
//! error at the row where that is found: callers discard what they have read.

#[cfg(feature = "parquet")]
mod arrow;
mod byte_budget;
#[cfg(feature = "parquet")]
mod columns;
mod joined;
pub(crate) mod json;
mod line;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod mcap_file;
#[cfg(feature = "mcap")]
mod mcap_rows;
#[cfg(feature = "mcap")]
mod mcap_scene;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "parquet")]
mod parquet_pages;
mod shared_source;
#[cfg(feature = "parquet")]
mod trace_columns;
mod trace_writer;
#[cfg(feature = "xlsx")]
mod workbook_check;
#[cfg(feature = "xlsx")]
pub(crate) mod xlsx;

pub use joined::JoinedRows;
pub use trace_writer::TraceWriter;

use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};

use offbd_core::vocabulary::Sample;
use serde::{Deserialize, Serialize};

use super::foreign_file::{ForeignFileError, HEAD_BYTES, check_own};
use super::session_csv;
use super::table::{CsvError, NamedColumns, RowError, TableOptions, TableReader, encoding};
use super::telemetry::sample_view;

/// A format of session files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionFormat {
    Csv,
    /// JSON rows or columns (`session_file/json.rs`); written as `GET /sessions/{id}/telemetry`
    /// sends them.
    Json,
    Parquet,
    /// An Arrow stream; an Arrow file is read, too.
    Arrow,
    Mcap,
    /// An Excel workbook; only read.
    Xlsx,
}

impl SessionFormat {
    /// All formats; the first is the one by default.
    pub const ALL: [Self; 6] =
        [Self::Csv, Self::Json, Self::Parquet, Self::Arrow, Self::Mcap, Self::Xlsx];

    /// The formats that are written; the first is the one by default.
    pub const WRITTEN: [Self; 5] = [Self::Csv, Self::Json, Self::Parquet, Self::Arrow, Self::Mcap];

    /// The word on the command line, and the usual suffix of a file's name.
    #[must_use]
    pub const fn suffix(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json => "json",
            Self::Parquet => "parquet",
            Self::Arrow => "arrow",
            Self::Mcap => "mcap",
            Self::Xlsx => "xlsx",
        }
    }

    /// The media type.
    #[must_use]
    pub const fn media_type(self) -> &'static str {
        match self {
            Self::Csv => "text/csv",
            Self::Json => "application/json",
            Self::Parquet => "application/vnd.apache.parquet",
            Self::Arrow => "application/vnd.apache.arrow.stream",
            Self::Mcap => "application/vnd.mcap",
            Self::Xlsx => "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
        }
    }

    /// Checks that this build of offbd has the format.
    ///
    /// # Errors
    /// [`SessionFileError::NotBuilt`].
    pub const fn check(self) -> Result<(), SessionFileError> {
        match self {
            Self::Parquet | Self::Arrow if !cfg!(feature = "parquet") => Err(self.not_built()),
            Self::Mcap if !cfg!(feature = "mcap") => Err(self.not_built()),
            Self::Xlsx if !cfg!(feature = "xlsx") => Err(self.not_built()),
            _ => Ok(()),
        }
    }

    const fn not_built(self) -> SessionFileError {
        let feature = match self {
            Self::Mcap => "mcap",
            Self::Xlsx => "xlsx",
            _ => "parquet",
        };
        SessionFileError::NotBuilt { format: self, feature }
    }

    /// Returns the format of a file that begins with `head`; CSV unless a signature says
    /// otherwise.
    #[must_use]
    pub fn of(head: &[u8]) -> Self {
        const SIGNATURES: [(&[u8], SessionFormat); 5] = [
            (b"PAR1", SessionFormat::Parquet),
            (ARROW_FILE, SessionFormat::Arrow),
            (&[0xff; 4], SessionFormat::Arrow),
            (b"\x89MCAP0\r\n", SessionFormat::Mcap),
            (b"PK\x03\x04", SessionFormat::Xlsx),
        ];
        let found = SIGNATURES.iter().find(|(signature, _)| head.starts_with(signature));
        let text = if is_json(head) { Self::Json } else { Self::Csv };
        found.map_or(text, |(_, format)| *format)
    }
}

impl fmt::Display for SessionFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Csv => "CSV",
            Self::Json => "JSON",
            Self::Parquet => "Parquet",
            Self::Arrow => "Arrow",
            Self::Mcap => "MCAP",
            Self::Xlsx => "Excel",
        })
    }
}

/// Whether a file that begins with `head` is a JSON document with rows or columns.
fn is_json(head: &[u8]) -> bool {
    let head = encoding::decoded(head);
    let mut bytes = head.iter().filter(|byte| !byte.is_ascii_whitespace());
    match bytes.next() {
        Some(b'{') => true,
        // A column may be named `[s]`.
        Some(b'[') => bytes.next().is_some_and(|byte| b"{[\"".contains(byte)),
        _ => false,
    }
}

/// The first bytes of an Arrow file, which is a stream between signatures.
const ARROW_FILE: &[u8] = b"ARROW1\0\0";

/// Why a file cannot be read or written as a session.
#[derive(Debug, thiserror::Error)]
pub enum SessionFileError {
    #[error(transparent)]
    Csv(#[from] CsvError),
    #[error(
        "this build of offbd has no {format}; build it with `cargo build --features {feature}`"
    )]
    NotBuilt { format: SessionFormat, feature: &'static str },
    #[error(transparent)]
    Foreign(#[from] ForeignFileError),
    #[error("{0} files are only read, not written")]
    NotWritten(SessionFormat),
    /// The column is not numeric; `found` is its type.
    #[error("the column `{column}` has the type {found}, not a number")]
    NotANumber { column: String, found: String },
    /// The first sheet of a workbook is not a session.
    #[error("sheet `{sheet}`: {reason}")]
    Sheet { sheet: String, reason: String },
    /// A file that is a part of a recording and cannot be read, or does not continue the others.
    #[error("{file}: {reason}")]
    Part { file: String, reason: String },
    #[error("the JSON document is not a recording: {0}")]
    Json(String),
    /// An MCAP file without a topic of the schema, or with several others.
    #[error(
        "the file has no topic with JSON messages of the schema `{schema}`, and {found}; a \
         recording is read from one topic"
    )]
    NoTopic { schema: &'static str, found: String },
    #[error("the file cannot be read: {0}")]
    Io(#[from] io::Error),
    #[error("the {format} file is damaged, or was not written to its end: {reason}")]
    Damaged { format: SessionFormat, reason: String },
    /// A part of the file that must be in memory as a whole is too large.
    #[error("{what} of the file has {found} bytes; at most {limit} are read")]
    TooLarge { what: &'static str, found: u64, limit: u64 },
    #[error("{what} has more than {limit} bytes; at most that many are read")]
    TooLong { what: &'static str, limit: u64 },
    /// What is decompressed or kept of the file is too much.
    #[error("{what} expands to more than {limit} bytes; at most that many are read")]
    Expands { what: &'static str, limit: u64 },
    #[error("the recording cannot be written as {format}: {reason}")]
    Write { format: SessionFormat, reason: String },
}

/// Runs a part of a library's reader, whose panic means that the file contradicts itself.
fn guarded<T>(format: SessionFormat, read: impl FnOnce() -> T) -> Result<T, SessionFileError> {
    IS_GUARDED.set(true);
    let read = std::panic::catch_unwind(std::panic::AssertUnwindSafe(read));
    IS_GUARDED.set(false);
    read.map_err(|_| {
        let reason = "its contents contradict each other".to_owned();
        SessionFileError::Damaged { format, reason }
    })
}

thread_local! {
    static IS_GUARDED: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Whether a panic of this thread means that a file is damaged, which its reader reports. A hook
/// for panics has nothing to report then.
#[must_use]
pub fn is_guarded() -> bool {
    IS_GUARDED.get()
}

/// Where in a file a row is, counted from 1; lines count the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RowPlace {
    Line(u64),
    Row(u64),
}

impl fmt::Display for RowPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Row(n) => write!(f, "row {n}"),
        }
    }
}

/// A row of a recording that is rejected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RejectedRow {
    pub place: RowPlace,
    pub reason: String,
}

impl fmt::Display for RejectedRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.reason)
    }
}

/// Why the next row is not a sample.
#[derive(Debug, thiserror::Error)]
pub enum SessionRowError {
    /// The row is rejected, and the next one can be read.
    #[error("{0}")]
    Rejected(RejectedRow),
    /// The rest of the file cannot be read, so that nothing of it may be kept.
    #[error(transparent)]
    Unreadable(SessionFileError),
}

/// The rows of a session file, in its order. After an [`SessionRowError::Unreadable`] the
/// rows end.
pub trait SessionRows: Iterator<Item = Result<Sample, SessionRowError>> + Send {
    /// The place of the row read last.
    fn place(&self) -> RowPlace;

    /// The number of runs that have begun, from 1: a clock that starts again and a second header begin
    /// another one.
    fn n_runs(&self) -> usize {
        1
    }
}

/// Opens the session file `source`. Without `format` its first bytes say what it is. `options` say
/// which columns are read.
///
/// # Errors
/// [`SessionFileError`] if this build does not read the format, a column is missing or has
/// another type, or the file is damaged.
pub fn open<S: Read + Seek + Send + 'static>(
    mut source: S,
    format: Option<SessionFormat>,
    options: &TableOptions,
) -> Result<Box<dyn SessionRows>, SessionFileError> {
    let mut head = Vec::new();
    source.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    check_own(&head)?;
    // Programs declare any file as a text; a signature says more.
    let format = match SessionFormat::of(&head) {
        SessionFormat::Csv => format.unwrap_or(SessionFormat::Csv),
        found => found,
    };
    if format == SessionFormat::Csv {
        // A pipe cannot go back to its start.
        let source = io::Cursor::new(head).chain(source);
        return Ok(Box::new(TextRows::new(TextKind::Text, source, options)?));
    }
    if format == SessionFormat::Json {
        let table = json::table(io::Cursor::new(head).chain(source))?;
        return Ok(Box::new(TextRows::new(table.kind(), io::Cursor::new(table.text), options)?));
    }
    source.seek(SeekFrom::Start(0))?;
    match format {
        #[cfg(feature = "xlsx")]
        SessionFormat::Xlsx => {
            let xlsx::Sheet { name, text } = xlsx::sheet(source)?;
            Ok(Box::new(TextRows::new(TextKind::Sheet(name), io::Cursor::new(text), options)?))
        }
        _ => Ok(Box::new(column_file(source, format)?.rows(options)?)),
    }
}

/// Opens a file whose columns have names and types.
///
/// # Errors
/// [`SessionFileError`] if this build does not read the format, or the file is damaged.
pub(crate) fn column_file<S: Read + Seek + Send + 'static>(
    source: S,
    format: SessionFormat,
) -> Result<Box<dyn ColumnFile>, SessionFileError> {
    match format {
        #[cfg(feature = "parquet")]
        SessionFormat::Parquet => Ok(Box::new(parquet::ParquetTable::open(source)?)),
        #[cfg(feature = "parquet")]
        SessionFormat::Arrow => Ok(Box::new(arrow::ArrowTable::open(source)?)),
        #[cfg(feature = "mcap")]
        SessionFormat::Mcap => Ok(Box::new(mcap_rows::McapTable::open(source)?)),
        _ => Err(format.not_built()),
    }
}

/// What a table was in the file.
#[derive(Clone, Debug)]
pub(crate) enum TextKind {
    /// The file, whose rows are known by their lines.
    Text,
    /// Rows, of which the first comes after this many lines.
    Rows { n_before: u64 },
    /// The sheet of this name.
    Sheet(String),
}

/// A file whose columns have names and types, and that can be read more than once.
pub(crate) trait ColumnFile {
    /// The names of the columns and the first rows.
    fn columns(&self) -> &NamedColumns;

    /// Opens the rows by `options`.
    ///
    /// # Errors
    /// [`SessionFileError`] if a column is missing or has another type, or the file is damaged.
    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'static>, SessionFileError>;
}

/// The rows of a text, or of another file that is read as one.
pub(crate) struct TextRows<'a> {
    kind: TextKind,
    rows: TableReader<'a, SessionFileError>,
}

impl<'a> TextRows<'a> {
    /// Reads a text by `options`.
    ///
    /// # Errors
    /// [`SessionFileError::Csv`], or [`SessionFileError::Sheet`] of a sheet.
    pub(crate) fn new(
        kind: TextKind,
        source: impl Read + Send + 'a,
        options: &TableOptions,
    ) -> Result<Self, SessionFileError> {
        match (TableReader::of_text(source, options), kind) {
            (Ok(rows), kind) => Ok(Self { kind, rows }),
            (Err(error), TextKind::Sheet(sheet)) => {
                Err(SessionFileError::Sheet { sheet, reason: error.to_string() })
            }
            (Err(error), _) => Err(error.into()),
        }
    }

    /// Reads a table with names and types.
    const fn of_columns(rows: TableReader<'a, SessionFileError>) -> Self {
        Self { kind: TextKind::Rows { n_before: 0 }, rows }
    }

    fn place_of(&self, line: u64) -> RowPlace {
        match self.kind {
            TextKind::Text => RowPlace::Line(line),
            TextKind::Rows { n_before } => RowPlace::Row(line.saturating_sub(n_before)),
            TextKind::Sheet(_) => RowPlace::Row(line),
        }
    }
}

impl Iterator for TextRows<'_> {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        let Some(row) = self.rows.next() else {
            return self.rows.take_fault().map(|error| Err(SessionRowError::Unreadable(error)));
        };
        Some(row.map_err(|RowError { line, reason }| {
            let reason = match &self.kind {
                TextKind::Sheet(name) => format!("sheet `{name}`, {reason}"),
                TextKind::Text | TextKind::Rows { .. } => reason,
            };
            SessionRowError::Rejected(RejectedRow { place: self.place_of(line), reason })
        }))
    }
}

impl SessionRows for TextRows<'_> {
    fn place(&self) -> RowPlace {
        self.place_of(self.rows.line())
    }

    fn n_runs(&self) -> usize {
        self.rows.n_runs()
    }
}

/// Times of a device's clock, s, that are seconds since 1970: from 2000 to 2100. A clock that counts
/// from the start of the device would have to run for 30 years.
const UNIX_TIMES_S: std::ops::Range<f64> = 946_684_800.0..4_102_444_800.0;

/// Returns the absolute time of `t_s` on the device's clock, µs since 1970; `None` if that does not
/// count from 1970.
fn unix_micros(t_s: f64) -> Option<i64> {
    UNIX_TIMES_S.contains(&t_s).then(|| (t_s * 1e6).round() as i64)
}

/// What a file says about its session, beside the samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionInfo {
    /// The session's name.
    pub session: String,
    /// The time at which the service opened the session, RFC 3339.
    pub opened_at: Option<String>,
    /// Time of a sample, s on the device's clock. If it is a time since 1970, the tables have a
    /// column with the absolute time.
    pub first_t_s: Option<f64>,
    /// The asset file that the session is judged with.
    pub asset_file: Option<String>,
    pub calibration_id: Option<String>,
    /// The verdict hash of the session, if it has ended.
    pub verdict_hash: Option<String>,
}

impl SessionInfo {
    /// Keys and values, for the metadata of a file.
    fn entries(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let entries = [
            ("offbd.session", Some(self.session.as_str())),
            ("offbd.version", Some(env!("CARGO_PKG_VERSION"))),
            ("offbd.opened_at", self.opened_at.as_deref()),
            ("offbd.asset_file", self.asset_file.as_deref()),
            ("offbd.calibration_id", self.calibration_id.as_deref()),
            ("offbd.verdict_hash", self.verdict_hash.as_deref()),
        ];
        entries.into_iter().filter_map(|(key, value)| Some((key, value?)))
    }
}

/// Writes the samples of one session. Each call returns the next bytes of the file.
pub struct SessionWriter(Encoding);

enum Encoding {
    Csv {
        with_seq: bool,
    },
    Json {
        is_first: bool,
    },
    #[cfg(feature = "parquet")]
    Parquet(Box<parquet::ParquetEncoder>),
    #[cfg(feature = "parquet")]
    Arrow(Box<arrow::ArrowEncoder>),
    #[cfg(feature = "mcap")]
    Mcap(Box<mcap::McapEncoder>),
}

impl SessionWriter {
    /// Begins a file; in CSV with the column `seq` if `with_seq`. Returns the first bytes.
    ///
    /// # Errors
    /// [`SessionFileError::NotBuilt`]; [`SessionFileError::Write`].
    pub fn new(
        format: SessionFormat,
        info: &SessionInfo,
        with_seq: bool,
    ) -> Result<(Self, Vec<u8>), SessionFileError> {
        let (encoding, start) = match format {
            SessionFormat::Csv => {
                let mut start = Vec::new();
                session_csv::write_header(&mut start, with_seq)?;
                (Encoding::Csv { with_seq }, start)
            }
            SessionFormat::Json => {
                let name = serde_json::to_string(&info.session).map_err(io::Error::from)?;
                let start = format!(r#"{{"session":{name},"samples":["#).into_bytes();
                (Encoding::Json { is_first: true }, start)
            }
            #[cfg(feature = "parquet")]
            SessionFormat::Parquet => {
                (Encoding::Parquet(Box::new(parquet::ParquetEncoder::new(info)?)), Vec::new())
            }
            #[cfg(feature = "parquet")]
            SessionFormat::Arrow => {
                (Encoding::Arrow(Box::new(arrow::ArrowEncoder::new(info)?)), Vec::new())
            }
            #[cfg(feature = "mcap")]
            SessionFormat::Mcap => {
                (Encoding::Mcap(Box::new(mcap::McapEncoder::new(info)?)), Vec::new())
            }
            _ => {
                format.check()?;
                return Err(SessionFileError::NotWritten(format));
            }
        };
        Ok((Self(encoding), start))
    }

    /// Appends samples.
    ///
    /// # Errors
    /// [`SessionFileError::Write`].
    pub fn rows(&mut self, samples: &[Sample]) -> Result<Vec<u8>, SessionFileError> {
        let mut bytes = Vec::new();
        match &mut self.0 {
            Encoding::Csv { with_seq } => {
                session_csv::write_rows(&mut bytes, samples, *with_seq)?;
            }
            Encoding::Json { is_first } => {
                for sample in samples {
                    if !std::mem::take(is_first) {
                        bytes.push(b',');
                    }
                    serde_json::to_writer(&mut bytes, &sample_view(sample))
                        .map_err(io::Error::from)?;
                }
            }
            #[cfg(feature = "parquet")]
            Encoding::Parquet(encoder) => bytes = encoder.rows(samples)?,
            #[cfg(feature = "parquet")]
            Encoding::Arrow(encoder) => bytes = encoder.rows(samples)?,
            #[cfg(feature = "mcap")]
            Encoding::Mcap(encoder) => bytes = encoder.rows(samples)?,
        }
        Ok(bytes)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`SessionFileError::Write`].
    pub fn end(self) -> Result<Vec<u8>, SessionFileError> {
        match self.0 {
            Encoding::Csv { .. } => Ok(Vec::new()),
            Encoding::Json { .. } => Ok(b"]}".to_vec()),
            #[cfg(feature = "parquet")]
            Encoding::Parquet(encoder) => encoder.end(),
            #[cfg(feature = "parquet")]
            Encoding::Arrow(encoder) => encoder.end(),
            #[cfg(feature = "mcap")]
            Encoding::Mcap(encoder) => encoder.end(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_and_csv_are_told_apart() {
        for (head, format) in [
            (&b"\n [{\"t_s\": 0}]"[..], SessionFormat::Json),
            (b"{\"t_s\": [0]}", SessionFormat::Json),
            (b"[[0, 1]]", SessionFormat::Json),
            (b"[s],[m]\n0,1\n", SessionFormat::Csv),
        ] {
            assert_eq!(SessionFormat::of(head), format, "{head:?}");
        }
    }

    /// Windows PowerShell writes UTF-16, other programs the code page of Windows.
    #[test]
    fn json_is_read_in_the_encodings_of_texts() {
        let text = "[{\"t_s\": 0, \"cmd_qy_rad\": 0.5, \"x_m\": 0.25, \"größe\": 1}]";
        let wide = |bytes: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(bytes).collect();
        let (little, big): (Vec<u8>, Vec<u8>) = (wide(u16::to_le_bytes), wide(u16::to_be_bytes));
        let narrow = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        for (bytes, name) in [
            (text.as_bytes().to_vec(), "UTF-8"),
            ([&b"\xff\xfe"[..], &little].concat(), "UTF-16 LE with a mark"),
            ([&b"\xfe\xff"[..], &big].concat(), "UTF-16 BE with a mark"),
            (little, "UTF-16 LE"),
            (big, "UTF-16 BE"),
            (narrow, "Windows-1252"),
        ] {
            assert_eq!(SessionFormat::of(&bytes), SessionFormat::Json, "{name}");
            let rows = open(io::Cursor::new(bytes), None, &TableOptions::default()).unwrap();
            let samples: Vec<Sample> = rows.map(Result::unwrap).collect();
            assert_eq!(samples.len(), 1, "{name}");
            assert_eq!((samples[0].cmd_qy_rad, samples[0].x_m), (Some(0.5), Some(0.25)), "{name}");
        }
    }

    #[test]
    fn files_of_other_programs_are_named_whatever_they_are_declared_to_be() {
        let zip = [&b"PK\x03\x04"[..], &[0; 26], b"log.csv"].concat();
        for (bytes, told) in
            [(b"\x1f\x8b\x08 gzip".to_vec(), "a gzip file"), (zip.clone(), "a zip file")]
        {
            let options = TableOptions::default();
            let error =
                open(io::Cursor::new(bytes.clone()), Some(SessionFormat::Csv), &options).err();
            assert!(error.unwrap().to_string().contains(told), "{told}");
            let error = crate::telemetry::csv(&bytes, &options, 10).unwrap_err();
            assert!(error.to_string().contains(told), "{error}");
        }
        let list = br#"[{"t_s":0,"cmd_qy_rad":0,"x_m":0.1}]"#;
        let rows = open(io::Cursor::new(list), Some(SessionFormat::Csv), &TableOptions::default());
        assert_eq!(rows.unwrap().count(), 1);
    }
}
