//! Sessions as Arrow streams, and read also as Arrow files: a file is a stream between
//! signatures, followed by an index that is not needed.
//!
//! Compressed streams are not read: their buffers state the size to reserve, without a limit.

use std::io::{self, Read, Seek, SeekFrom};

use arrow_array::RecordBatch;
use arrow_buffer::Buffer;
use arrow_ipc::reader::StreamDecoder;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::SchemaRef;

use super::columns::{self, BatchRows};
use super::shared_source::{SharedSource, SourceFrom};
use super::{
    ARROW_FILE, ColumnFile, SessionFileError, SessionFormat, SessionInfo, TextRows, guarded,
};
use crate::table::{Cells, NamedColumns, RowFault, RowSource, TableOptions, TableReader};
use offbd_core::vocabulary::Sample;

/// Bytes that are read at a time.
const READ_BYTES: usize = 64 << 10;

/// Longest record batch that is read, bytes; it is in memory as a whole. Chosen: 5 million
/// rows of a session. A longer one is refused.
const MAX_BATCH_BYTES: u64 = 256 << 20;

fn damaged(reason: impl ToString) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Arrow, reason: reason.to_string() }
}

fn unwritten(error: impl ToString) -> SessionFileError {
    SessionFileError::Write { format: SessionFormat::Arrow, reason: error.to_string() }
}

/// Writes an Arrow stream into memory, from where each call takes what is complete.
pub(super) struct ArrowEncoder {
    schema: SchemaRef,
    writer: StreamWriter<Vec<u8>>,
}

impl ArrowEncoder {
    /// Begins a stream of the samples of a session.
    pub(super) fn new(info: &SessionInfo) -> Result<Self, SessionFileError> {
        Self::of(columns::schema(info))
    }

    /// Begins a stream with the columns and the metadata of `schema`.
    pub(super) fn of(schema: SchemaRef) -> Result<Self, SessionFileError> {
        let writer = StreamWriter::try_new(Vec::new(), &schema).map_err(unwritten)?;
        Ok(Self { schema, writer })
    }

    pub(super) fn rows(&mut self, samples: &[Sample]) -> Result<Vec<u8>, SessionFileError> {
        self.write(&columns::batch(&self.schema, samples).map_err(unwritten)?)
    }

    pub(super) fn write(&mut self, batch: &RecordBatch) -> Result<Vec<u8>, SessionFileError> {
        self.writer.write(batch).map_err(unwritten)?;
        Ok(std::mem::take(self.writer.get_mut()))
    }

    pub(super) fn end(mut self) -> Result<Vec<u8>, SessionFileError> {
        self.writer.finish().map_err(unwritten)?;
        Ok(std::mem::take(self.writer.get_mut()))
    }
}

/// The last bytes of an Arrow file, after the length of its index.
const SIGNATURE: &[u8] = b"ARROW1";

/// The first bytes of each message of a stream.
const MESSAGE: &[u8] = &[0xff; 4];

/// Bytes at the end of an Arrow file: the length of its index and the signature.
const TAIL_BYTES: u64 = 10;

/// Where the stream in an Arrow file begins at most: programs align it to 8 or 64 bytes.
const LATEST_START: u64 = 64;

/// Returns the start and the end of the stream in an Arrow file; `None` if `source` is a stream itself.
fn stream_within<S: Read + Seek>(source: &mut S) -> Result<Option<(u64, u64)>, SessionFileError> {
    let mut head = Vec::with_capacity(ARROW_FILE.len());
    source.by_ref().take(ARROW_FILE.len() as u64).read_to_end(&mut head)?;
    if head != ARROW_FILE {
        return Ok(None);
    }
    let (mut start, mut mark) = (ARROW_FILE.len() as u64, Vec::new());
    source.by_ref().take(LATEST_START).read_to_end(&mut mark)?;
    let n_zeros = mark.iter().take_while(|byte| **byte == 0).count();
    start += n_zeros as u64;
    if !mark[n_zeros..].starts_with(MESSAGE) || start > LATEST_START {
        return Err(damaged("it has no stream, only an index; write it as an Arrow stream"));
    }
    let n_bytes = source.seek(SeekFrom::End(0))?;
    source.seek(SeekFrom::Start(n_bytes.saturating_sub(TAIL_BYTES)))?;
    let mut tail = Vec::new();
    source.by_ref().take(TAIL_BYTES).read_to_end(&mut tail)?;
    match tail.split_first_chunk::<4>() {
        Some((length, SIGNATURE)) => {
            let index = u64::from(u32::from_le_bytes(*length));
            Ok(Some((start, n_bytes.saturating_sub(TAIL_BYTES + index))))
        }
        _ => Err(damaged("it does not end with its signature")),
    }
}

/// An Arrow stream or file whose columns are known.
pub(super) struct ArrowTable<S> {
    source: SharedSource<S>,
    schema: SchemaRef,
    columns: NamedColumns,
}

impl<S: Read + Seek + Send + 'static> ArrowTable<S> {
    /// Reads the schema and the first record batch.
    pub(super) fn open(source: S) -> Result<Self, SessionFileError> {
        let source = SharedSource::new(source)?;
        let mut batches = Batches::new(source.from(0))?;
        let first = batches.next()?;
        let schema = batches.decoder.schema().ok_or_else(|| damaged("it has no schema"))?;
        let values = |batch: RecordBatch| {
            let arrays = batch.columns().iter();
            arrays.map(|array| columns::first_values(array)).collect::<Vec<_>>()
        };
        let first_rows = columns::rows_of(&first.map_or(Vec::new(), values));
        let columns = NamedColumns { names: columns::names(&schema), first_rows };
        Ok(Self { source, schema, columns })
    }

    fn rows_of(&self, wanted: &[usize]) -> Result<ArrowRows<S>, SessionFileError> {
        columns::check(&self.schema, wanted)?;
        let place = |column: usize| wanted.contains(&column).then_some(column);
        let places = (0..self.columns.names.len()).map(place).collect();
        let batches = Batches::new(self.source.from(0))?;
        Ok(ArrowRows { batches: Some(batches), rows: BatchRows::new(places) })
    }
}

impl<S: Read + Seek + Send + 'static> ColumnFile for ArrowTable<S> {
    fn columns(&self) -> &NamedColumns {
        &self.columns
    }

    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'static>, SessionFileError> {
        let rows = |wanted: &[usize]| self.rows_of(wanted);
        TableReader::of_columns(&self.columns, options, rows).map(TextRows::of_columns)
    }
}

/// The rows of an Arrow stream or file.
struct ArrowRows<S: Read + Seek> {
    /// `None` after the end, or an error.
    batches: Option<Batches<io::BufReader<SourceFrom<S>>>>,
    rows: BatchRows,
}

impl<S: Read + Seek + Send> RowSource<SessionFileError> for ArrowRows<S> {
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault<SessionFileError>> {
        while !self.rows.next(cells) {
            match self.batches.as_mut().map_or(Ok(None), Batches::next) {
                Ok(Some(batch)) => self.rows.set(batch),
                end => {
                    self.batches = None;
                    return end.map(|_| false).map_err(RowFault::Unreadable);
                }
            }
        }
        Ok(true)
    }

    fn line(&self) -> u64 {
        self.rows.n_read()
    }
}

/// The record batches of an Arrow stream or file.
struct Batches<S> {
    source: S,
    /// Bytes of the stream that are not read yet, at most.
    left: u64,
    is_file: bool,
    decoder: StreamDecoder,
    unread: Buffer,
    /// Bytes since the last record batch.
    n_bytes: u64,
}

impl<S: Read + Seek> Batches<S> {
    fn new(mut source: S) -> Result<Self, SessionFileError> {
        let within = stream_within(&mut source)?;
        let start = within.map_or(0, |(start, _)| start);
        source.seek(SeekFrom::Start(start))?;
        Ok(Self {
            source,
            left: within.map_or(u64::MAX, |(start, end)| end.saturating_sub(start)),
            is_file: within.is_some(),
            decoder: StreamDecoder::new(),
            unread: Buffer::from_vec(Vec::<u8>::new()),
            n_bytes: 0,
        })
    }
}

impl<S: Read> Batches<S> {
    /// Returns the next record batch; `None` at the end.
    fn next(&mut self) -> Result<Option<RecordBatch>, SessionFileError> {
        loop {
            if self.unread.is_empty() {
                let mut bytes = Vec::with_capacity(READ_BYTES);
                let most = self.left.min(READ_BYTES as u64);
                self.source.by_ref().take(most).read_to_end(&mut bytes)?;
                self.left -= bytes.len() as u64;
                if bytes.is_empty() {
                    return self.check_end().map(|()| None);
                }
                self.n_bytes += bytes.len() as u64;
                self.unread = Buffer::from_vec(bytes);
            }
            let (decoder, unread) = (&mut self.decoder, &mut self.unread);
            match guarded(SessionFormat::Arrow, || decoder.decode(unread))? {
                Ok(Some(batch)) => {
                    self.n_bytes = self.unread.len() as u64;
                    return Ok(Some(batch));
                }
                // Something follows the end of the stream.
                Err(_) if self.decoder.finish().is_ok() => return Ok(None),
                Err(error) => return Err(damaged(error)),
                Ok(None) if self.n_bytes > MAX_BATCH_BYTES => {
                    let (found, limit) = (self.n_bytes, MAX_BATCH_BYTES);
                    return Err(SessionFileError::TooLarge {
                        what: "a record batch",
                        found,
                        limit,
                    });
                }
                Ok(None) => {}
            }
        }
    }

    /// Checks that the source, of which nothing is left, has the mark at the end of a stream.
    fn check_end(&mut self) -> Result<(), SessionFileError> {
        self.decoder.finish().map_err(damaged)?;
        if self.is_file {
            // Its end is known from its last bytes, and not each program writes the mark.
            return Ok(());
        }
        // Only after the mark does the decoder refuse any further byte.
        match self.decoder.decode(&mut Buffer::from_vec(vec![0_u8])) {
            Err(_) => Ok(()),
            Ok(_) => Err(damaged("it has no mark of its end")),
        }
    }
}
