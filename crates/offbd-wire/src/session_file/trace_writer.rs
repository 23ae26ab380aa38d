//! Writes the trace of a session as a table: Parquet or an Arrow stream.

use super::{SessionFileError, SessionFormat, SessionInfo};
use crate::trace::{ThresholdsView, TraceView};

/// Writes a trace piece by piece. Each call returns the next bytes of the file.
pub struct TraceWriter(Box<dyn TraceEncoder>);

/// A format of traces, with a bounded part of the trace in memory.
trait TraceEncoder: Send {
    fn rows(&mut self, trace: &TraceView) -> Result<Vec<u8>, SessionFileError>;
    fn end(self: Box<Self>) -> Result<Vec<u8>, SessionFileError>;
}

impl TraceWriter {
    /// The formats of traces.
    pub const FORMATS: [SessionFormat; 2] = [SessionFormat::Parquet, SessionFormat::Arrow];

    /// Begins the file of a session that is judged with `thresholds`, which become part of its
    /// metadata.
    ///
    /// # Errors
    /// [`SessionFileError::NotBuilt`]; [`SessionFileError::NotWritten`] for another format;
    /// [`SessionFileError::Write`].
    pub fn new(
        format: SessionFormat,
        info: &SessionInfo,
        thresholds: &[ThresholdsView],
    ) -> Result<Self, SessionFileError> {
        format.check()?;
        match format {
            #[cfg(feature = "parquet")]
            SessionFormat::Parquet => columns::parquet(info, thresholds).map(Self),
            #[cfg(feature = "parquet")]
            SessionFormat::Arrow => columns::arrow(info, thresholds).map(Self),
            _ => Err(SessionFileError::NotWritten(format)),
        }
    }

    /// Appends the moments of `trace`.
    ///
    /// # Errors
    /// [`SessionFileError::Write`].
    pub fn rows(&mut self, trace: &TraceView) -> Result<Vec<u8>, SessionFileError> {
        self.0.rows(trace)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`SessionFileError::Write`].
    pub fn end(self) -> Result<Vec<u8>, SessionFileError> {
        self.0.end()
    }
}

#[cfg(feature = "parquet")]
mod columns {
    use std::io;

    use arrow_schema::SchemaRef;

    use super::{SessionFileError, SessionFormat, SessionInfo, TraceEncoder, TraceView};
    use crate::session_file::arrow::ArrowEncoder;
    use crate::session_file::parquet::ParquetEncoder;
    use crate::session_file::trace_columns;
    use crate::trace::ThresholdsView;

    /// An encoder, and the schema of what it writes.
    struct Table<E> {
        schema: SchemaRef,
        encoder: E,
    }

    /// The metadata of a session, and the thresholds.
    fn entries(
        info: &SessionInfo,
        thresholds: &[ThresholdsView],
    ) -> Result<Vec<(String, String)>, SessionFileError> {
        let thresholds = serde_json::to_string(thresholds).map_err(io::Error::from)?;
        let owned = |(key, value): (&str, &str)| (key.to_owned(), value.to_owned());
        let last = ("offbd.thresholds".to_owned(), thresholds);
        Ok(info.entries().map(owned).chain([last]).collect())
    }

    pub(super) fn parquet(
        info: &SessionInfo,
        thresholds: &[ThresholdsView],
    ) -> Result<Box<dyn TraceEncoder>, SessionFileError> {
        let entries = entries(info, thresholds)?;
        let schema = trace_columns::schema(info, &entries);
        let encoder = ParquetEncoder::wide(schema.clone(), entries.into_iter())?;
        Ok(Box::new(Table { schema, encoder }))
    }

    pub(super) fn arrow(
        info: &SessionInfo,
        thresholds: &[ThresholdsView],
    ) -> Result<Box<dyn TraceEncoder>, SessionFileError> {
        let schema = trace_columns::schema(info, &entries(info, thresholds)?);
        let encoder = ArrowEncoder::of(schema.clone())?;
        Ok(Box::new(Table { schema, encoder }))
    }

    impl TraceEncoder for Table<ParquetEncoder> {
        fn rows(&mut self, trace: &TraceView) -> Result<Vec<u8>, SessionFileError> {
            let batch = trace_columns::batch(&self.schema, trace);
            self.encoder.write(&batch.map_err(|e| unwritten(SessionFormat::Parquet, &e))?)
        }

        fn end(self: Box<Self>) -> Result<Vec<u8>, SessionFileError> {
            self.encoder.end()
        }
    }

    impl TraceEncoder for Table<ArrowEncoder> {
        fn rows(&mut self, trace: &TraceView) -> Result<Vec<u8>, SessionFileError> {
            let batch = trace_columns::batch(&self.schema, trace);
            self.encoder.write(&batch.map_err(|e| unwritten(SessionFormat::Arrow, &e))?)
        }

        fn end(self: Box<Self>) -> Result<Vec<u8>, SessionFileError> {
            self.encoder.end()
        }
    }

    fn unwritten(format: SessionFormat, reason: &arrow_schema::ArrowError) -> SessionFileError {
        SessionFileError::Write { format, reason: reason.to_string() }
    }
}
