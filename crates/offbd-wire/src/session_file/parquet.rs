//! Sessions as Parquet files.
//!
//! A file is written row group by row group, and read page by page. Before a file is read, the
//! sizes of its pages are checked (`parquet_pages.rs`).

use std::io::{self, Read, Seek};

use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, SchemaRef};
use bytes::Bytes;
use parquet::arrow::ArrowWriter;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader,
    ParquetRecordBatchReaderBuilder,
};
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::file::reader::{ChunkReader, Length};
use parquet::schema::types::ColumnPath;

use super::byte_budget::ByteBudget;
use super::columns::{self, BatchRows};
use super::parquet_pages;
use super::shared_source::{SharedSource, SourceFrom};
use super::{ColumnFile, SessionFileError, SessionFormat, SessionInfo, TextRows, guarded};
use crate::table::{
    Cells, JUDGED_ROWS, NamedColumns, RowFault, RowSource, TableOptions, TableReader,
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

/// A Parquet file whose columns are known.
pub(super) struct ParquetTable<S: Read + Seek + Send + 'static> {
    source: SharedSource<S>,
    metadata: ArrowReaderMetadata,
    columns: NamedColumns,
}

impl<S: Read + Seek + Send + 'static> ParquetTable<S> {
    /// Reads the names and the first values of the columns.
    pub(super) fn open(source: S) -> Result<Self, SessionFileError> {
        guarded(SessionFormat::Parquet, || Self::read(source))?
    }

    fn read(source: S) -> Result<Self, SessionFileError> {
        let source = SharedSource::new(source)?;
        check_footer(&source)?;
        let metadata = ArrowReaderMetadata::load(&source, ArrowReaderOptions::default());
        let metadata = metadata.map_err(damaged)?;
        let names = columns::names(metadata.schema());
        let columns = NamedColumns { names, first_rows: Vec::new() };
        let mut table = Self { source, metadata, columns };
        let mut budget = ByteBudget::of_file(table.source.n_bytes());
        let n_columns = table.columns.names.len();
        let first: Vec<Vec<String>> =
            (0..n_columns).map(|column| table.first_values(column, &mut budget)).collect();
        table.columns.first_rows = columns::rows_of(&first);
        Ok(table)
    }

    /// Returns the first values of a column; none if they are too large or damaged, which is an error
    /// if the column is read.
    fn first_values(&self, column: usize, budget: &mut ByteBudget) -> Vec<String> {
        let Some(group) = self.metadata.metadata().row_groups().first() else { return Vec::new() };
        if !columns::is_read(self.metadata.schema().field(column).data_type()) {
            return Vec::new();
        }
        let (mask, leaves) = self.projection(&[column]);
        if parquet_pages::check_group(&self.source, group, &leaves, budget).is_err() {
            return Vec::new();
        }
        let builder = self.builder().with_projection(mask).with_row_groups(vec![0]);
        let reader = builder.with_batch_size(JUDGED_ROWS).with_limit(JUDGED_ROWS).build();
        match reader.map(|mut reader| reader.next()) {
            Ok(Some(Ok(batch))) => columns::first_values(batch.column(0)),
            _ => Vec::new(),
        }
    }

    fn builder(&self) -> ParquetRecordBatchReaderBuilder<SharedSource<S>> {
        let (source, metadata) = (self.source.clone(), self.metadata.clone());
        ParquetRecordBatchReaderBuilder::new_with_metadata(source, metadata)
    }

    /// The mask of some columns, and the leaves that they have.
    fn projection(&self, wanted: &[usize]) -> (ProjectionMask, Vec<usize>) {
        let schema = self.metadata.parquet_schema();
        let mask = ProjectionMask::roots(schema, wanted.iter().copied());
        let leaves = (0..schema.num_columns()).filter(|&leaf| mask.leaf_included(leaf)).collect();
        (mask, leaves)
    }

    /// Opens the rows, of which the columns `wanted` are read, and checks the sizes of their pages.
    fn rows_of(&self, wanted: &[usize]) -> Result<ParquetRows, SessionFileError> {
        columns::check(self.metadata.schema(), wanted)?;
        let (mask, leaves) = self.projection(wanted);
        parquet_pages::check(&self.source, self.metadata.metadata(), &leaves)?;
        let reader = self.builder().with_projection(mask).with_batch_size(BATCH_ROWS).build();
        let place = |column: usize| wanted.iter().position(|wanted| *wanted == column);
        let places = (0..self.columns.names.len()).map(place).collect();
        Ok(ParquetRows { reader: Some(reader.map_err(damaged)?), rows: BatchRows::new(places) })
    }
}

impl<S: Read + Seek + Send + 'static> ColumnFile for ParquetTable<S> {
    fn columns(&self) -> &NamedColumns {
        &self.columns
    }

    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'static>, SessionFileError> {
        let rows = |wanted: &[usize]| {
            guarded(SessionFormat::Parquet, || self.rows_of(wanted)).and_then(|rows| rows)
        };
        TableReader::of_columns(&self.columns, options, rows).map(TextRows::of_columns)
    }
}

/// The rows of a Parquet file.
struct ParquetRows {
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
        self.rows.set(batch);
        Ok(true)
    }
}

impl RowSource<SessionFileError> for ParquetRows {
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault<SessionFileError>> {
        while !self.rows.next(cells) {
            let read = self.read();
            if !matches!(read, Ok(true)) {
                self.reader = None;
                return read.map_err(RowFault::Unreadable);
            }
        }
        Ok(true)
    }

    fn line(&self) -> u64 {
        self.rows.n_read()
    }
}

/// Checks that the file has an end, and that its footer is not too long.
fn check_footer<S: Read + Seek>(source: &SharedSource<S>) -> Result<(), SessionFileError> {
    let tail = source.read_at(source.n_bytes().saturating_sub(TAIL_BYTES), TAIL_BYTES as usize)?;
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

impl<S: Send> Length for SharedSource<S> {
    fn len(&self) -> u64 {
        self.n_bytes()
    }
}

impl<S: Read + Seek + Send> ChunkReader for SharedSource<S> {
    type T = io::BufReader<SourceFrom<S>>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        Ok(self.from(start))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let bytes = self.read_at(start, length)?;
        if bytes.len() < length {
            return Err(ParquetError::EOF(format!("{length} bytes are missing at byte {start}")));
        }
        Ok(bytes.into())
    }
}
