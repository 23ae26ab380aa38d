//! Sessions as Parquet files.
//!
//! A file is written row group by row group, and read page by page. Before a file is read, the
//! sizes of its pages are checked (`parquet_pages.rs`).

use std::io::{self, Read, Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::file::reader::{ChunkReader, Length};
use parquet::schema::types::ColumnPath;

use super::columns::{self, BatchRows, SchemaIndices};
use super::parquet_pages;
use super::{
    RowPlace, SessionFileError, SessionFormat, SessionInfo, SessionRowError, SessionRows, guarded,
};
use offbd_core::vocabulary::Sample;

/// Rows in a row group, which is in memory, compressed, until it is complete.
const ROW_GROUP_ROWS: usize = 131_072;

/// Size of the pages of a file with many columns, bytes. Chosen: some 10 000 rows.
const WIDE_PAGE_BYTES: usize = 64 << 10;

/// Rows that are decoded at a time.
const BATCH_ROWS: usize = 8192;

/// Longest footer of a file that is read, bytes. Chosen: that of a session with a thousand row
/// groups has half a megabyte. A longer one is refused.
const MAX_FOOTER_BYTES: u64 = 8 << 20;

/// The signature at the end of a file.
const SIGNATURE: &[u8] = b"PAR1";

/// Bytes at the end of a file: the length of the footer, and the signature.
const TAIL_BYTES: u64 = 8;

fn damaged(reason: impl ToString) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Parquet, reason: reason.to_string() }
}

fn unwritten(error: impl ToString) -> SessionFileError {
    SessionFileError::Write { format: SessionFormat::Parquet, reason: error.to_string() }
}

/// Writes a Parquet file into memory, from where each call takes what is complete.
pub(super) struct ParquetEncoder {
    schema: SchemaRef,
    writer: ArrowWriter<Vec<u8>>,
}

impl ParquetEncoder {
    /// Begins a file of the samples of a session.
    pub(super) fn new(info: &SessionInfo) -> Result<Self, SessionFileError> {
        let properties = WriterProperties::builder()
            // Times and numbers do not repeat.
            .set_column_dictionary_enabled(ColumnPath::from("t_s"), false)
            .set_column_encoding(ColumnPath::from("t_s"), Encoding::BYTE_STREAM_SPLIT)
            .set_column_dictionary_enabled(ColumnPath::from("seq"), false)
            .set_column_encoding(ColumnPath::from("seq"), Encoding::DELTA_BINARY_PACKED);
        Self::of(columns::schema(info), info.entries(), properties)
    }

    /// Begins a file of many columns, most of which do not repeat, with the metadata `entries`.
    /// Pages are small, because each column has one in memory, and no dictionaries.
    pub(super) fn wide(
        schema: SchemaRef,
        entries: impl Iterator<Item = (impl Into<String>, impl Into<String>)>,
    ) -> Result<Self, SessionFileError> {
        let properties = WriterProperties::builder()
            .set_dictionary_enabled(false)
            .set_data_page_size_limit(WIDE_PAGE_BYTES);
        Self::of(schema, entries, properties)
    }

    fn of(
        schema: SchemaRef,
        entries: impl Iterator<Item = (impl Into<String>, impl Into<String>)>,
        properties: WriterPropertiesBuilder,
    ) -> Result<Self, SessionFileError> {
        let metadata = entries.map(|(key, value)| KeyValue::new(key.into(), value.into()));
        let properties = properties
            .set_created_by(concat!("offbd ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_max_row_group_row_count(Some(ROW_GROUP_ROWS))
            .set_key_value_metadata(Some(metadata.collect()))
            .build();
        // The types are those that readers choose by themselves.
        let options =
            ArrowWriterOptions::new().with_properties(properties).with_skip_arrow_metadata(true);
        let writer = ArrowWriter::try_new_with_options(Vec::new(), schema.clone(), options);
        Ok(Self { schema, writer: writer.map_err(unwritten)? })
    }

    pub(super) fn rows(&mut self, samples: &[Sample]) -> Result<Vec<u8>, SessionFileError> {
        self.write(&columns::batch(&self.schema, samples).map_err(unwritten)?)
    }

    pub(super) fn write(&mut self, batch: &RecordBatch) -> Result<Vec<u8>, SessionFileError> {
        self.writer.write(batch).map_err(unwritten)?;
        Ok(std::mem::take(self.writer.inner_mut()))
    }

    pub(super) fn end(mut self) -> Result<Vec<u8>, SessionFileError> {
        self.writer.finish().map_err(unwritten)?;
        Ok(std::mem::take(self.writer.inner_mut()))
    }
}

/// Opens a Parquet file and checks its columns and the sizes of its pages.
pub(super) fn rows<S: Read + Seek + Send + 'static>(
    source: S,
) -> Result<ParquetRows, SessionFileError> {
    guarded(SessionFormat::Parquet, || open(source))?
}

fn open<S: Read + Seek + Send + 'static>(source: S) -> Result<ParquetRows, SessionFileError> {
    let source = SharedSource::new(source)?;
    source.check_footer()?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(source.clone()).map_err(damaged)?;
    let indices = SchemaIndices::of(builder.schema())?;
    let mask = ProjectionMask::roots(builder.parquet_schema(), indices.all());
    let leaves =
        (0..builder.parquet_schema().num_columns()).filter(|&leaf| mask.leaf_included(leaf));
    parquet_pages::check(&source, builder.metadata(), &leaves.collect::<Vec<_>>())?;
    let reader = builder.with_projection(mask).with_batch_size(BATCH_ROWS).build();
    Ok(ParquetRows { reader: Some(reader.map_err(damaged)?), rows: BatchRows::new() })
}

/// The rows of a Parquet file.
pub(super) struct ParquetRows {
    /// `None` after the end, or an error.
    reader: Option<ParquetRecordBatchReader>,
    rows: BatchRows,
}

impl ParquetRows {
    /// Reads the next rows; returns whether there are any.
    fn read(&mut self) -> Result<bool, SessionFileError> {
        let unreadable = |e: ArrowError| damaged(e);
        let next = || self.reader.as_mut().and_then(Iterator::next).transpose();
        let batch = guarded(SessionFormat::Parquet, next)?;
        let Some(batch) = batch.map_err(unreadable)? else { return Ok(false) };
        self.rows.set(batch)?;
        Ok(true)
    }
}

impl Iterator for ParquetRows {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(row) = self.rows.next() {
                return Some(row);
            }
            match self.read() {
                Ok(true) => {}
                Ok(false) => {
                    self.reader = None;
                    return None;
                }
                Err(error) => {
                    self.reader = None;
                    return Some(Err(SessionRowError::Unreadable(error)));
                }
            }
        }
    }
}

impl SessionRows for ParquetRows {
    fn place(&self) -> RowPlace {
        self.rows.place()
    }
}

/// A source that several readers read at their own positions.
pub(super) struct SharedSource<S> {
    source: Arc<Mutex<S>>,
    n_bytes: u64,
}

impl<S> Clone for SharedSource<S> {
    fn clone(&self) -> Self {
        Self { source: self.source.clone(), n_bytes: self.n_bytes }
    }
}

impl<S: Read + Seek> SharedSource<S> {
    pub(super) fn new(mut source: S) -> io::Result<Self> {
        let n_bytes = source.seek(SeekFrom::End(0))?;
        Ok(Self { source: Arc::new(Mutex::new(source)), n_bytes })
    }

    pub(super) const fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Reads up to `n` bytes from `start` on; fewer only at the end of the source.
    pub(super) fn read_at(&self, start: u64, n: usize) -> io::Result<Vec<u8>> {
        let mut source = self.source.lock().unwrap_or_else(PoisonError::into_inner);
        let n = (n as u64).min(self.n_bytes.saturating_sub(start));
        source.seek(SeekFrom::Start(start))?;
        let mut bytes = Vec::with_capacity(usize::try_from(n).unwrap_or_default());
        source.by_ref().take(n).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    /// Checks that the file has an end, and that its footer is not too long.
    fn check_footer(&self) -> Result<(), SessionFileError> {
        let tail = self.read_at(self.n_bytes.saturating_sub(TAIL_BYTES), TAIL_BYTES as usize)?;
        let Some((length, SIGNATURE)) = tail.split_first_chunk::<4>() else {
            return Err(damaged("it does not end with its signature"));
        };
        let found = u64::from(u32::from_le_bytes(*length));
        if found > MAX_FOOTER_BYTES {
            let what = "the footer";
            return Err(SessionFileError::TooLarge { what, found, limit: MAX_FOOTER_BYTES });
        }
        Ok(())
    }
}

impl<S: Send> Length for SharedSource<S> {
    fn len(&self) -> u64 {
        self.n_bytes
    }
}

impl<S: Read + Seek + Send> ChunkReader for SharedSource<S> {
    type T = io::BufReader<SourceFrom<S>>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        Ok(io::BufReader::new(SourceFrom { source: self.clone(), at: start }))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let bytes = self.read_at(start, length)?;
        if bytes.len() < length {
            return Err(ParquetError::EOF(format!("{length} bytes are missing at byte {start}")));
        }
        Ok(bytes.into())
    }
}

/// A source from a position on.
pub(super) struct SourceFrom<S> {
    source: SharedSource<S>,
    at: u64,
}

impl<S: Read + Seek> Read for SourceFrom<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.source.read_at(self.at, buffer.len())?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }
}
