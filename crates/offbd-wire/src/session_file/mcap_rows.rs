//! Reads the samples of an MCAP file, record by record, from the topics with the schema of
//! samples. Other topics are skipped; so is the index, which is not needed.

use std::collections::BTreeSet;
use std::io::{Read, Seek, SeekFrom};

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};

use super::byte_budget::ByteBudget;
use super::mcap::SAMPLE_SCHEMA;
use super::{
    RejectedRow, RowPlace, SessionFileError, SessionFormat, SessionRowError, SessionRows, guarded,
};
use crate::telemetry;
use offbd_core::vocabulary::Sample;

/// Longest record that is read, bytes; one is in memory at a time. Chosen: an attached file or
/// picture may be long, a sample has two hundred. A file with a longer one is refused.
const MAX_RECORD_BYTES: usize = 16 << 20;

/// Bytes before the contents of a record: what it is, and its length.
const RECORD_HEAD_BYTES: u64 = 9;

fn damaged(error: &McapError) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Mcap, reason: error.to_string() }
}

/// The samples of an MCAP file.
pub(super) struct McapRows<S> {
    source: S,
    reader: LinearReader,
    schemas: BTreeSet<u16>,
    channels: BTreeSet<u16>,
    budget: ByteBudget,
    n_read: u64,
    has_ended: bool,
}

impl<S: Read + Seek> McapRows<S> {
    pub(super) fn new(mut source: S) -> Result<Self, SessionFileError> {
        let budget = ByteBudget::of_file(source.seek(SeekFrom::End(0))?);
        source.rewind()?;
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD_BYTES);
        Ok(Self {
            source,
            reader: LinearReader::new_with_options(options),
            schemas: BTreeSet::new(),
            channels: BTreeSet::new(),
            budget,
            n_read: 0,
            has_ended: false,
        })
    }
}

impl<S: Read> McapRows<S> {
    /// Reads up to the next message that should be a sample; `None` at the end of the file.
    fn advance(&mut self) -> Result<Option<Result<Sample, String>>, SessionFileError> {
        while let Some(event) = self.reader.next_event() {
            match event.map_err(|error| damaged(&error))? {
                LinearReadEvent::ReadRequest(n) => {
                    let n = self.source.read(self.reader.insert(n))?;
                    self.reader.notify_read(n);
                }
                LinearReadEvent::Record { data, opcode } => {
                    self.budget.spend(RECORD_HEAD_BYTES + data.len() as u64)?;
                    let record = parse_record(opcode, data).map_err(|error| damaged(&error))?;
                    if let Some(row) = note(&mut self.schemas, &mut self.channels, &record) {
                        return Ok(Some(row));
                    }
                }
            }
        }
        if self.channels.is_empty() {
            return Err(SessionFileError::NoTopic(SAMPLE_SCHEMA));
        }
        Ok(None)
    }
}

/// Notes which channels have samples; returns the sample of a message of one of these.
fn note(
    schemas: &mut BTreeSet<u16>,
    channels: &mut BTreeSet<u16>,
    record: &Record<'_>,
) -> Option<Result<Sample, String>> {
    match record {
        Record::Schema { header, .. } if header.name == SAMPLE_SCHEMA => {
            schemas.insert(header.id);
        }
        Record::Channel(channel)
            if schemas.contains(&channel.schema_id) && channel.message_encoding == "json" =>
        {
            channels.insert(channel.id);
        }
        Record::Message { header, data } if channels.contains(&header.channel_id) => {
            return Some(telemetry::json_row(data));
        }
        _ => {}
    }
    None
}

impl<S: Read> Iterator for McapRows<S> {
    type Item = Result<Sample, SessionRowError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_ended {
            return None;
        }
        let row = guarded(SessionFormat::Mcap, || self.advance()).and_then(|row| row);
        self.has_ended = !matches!(row, Ok(Some(_)));
        match row {
            Ok(row) => {
                self.n_read += u64::from(row.is_some());
                let place = RowPlace::Row(self.n_read);
                let rejected = |reason| SessionRowError::Rejected(RejectedRow { place, reason });
                row.map(|row| row.map_err(rejected))
            }
            Err(error) => Some(Err(SessionRowError::Unreadable(error))),
        }
    }
}

impl<S: Read + Send> SessionRows for McapRows<S> {
    fn place(&self) -> RowPlace {
        RowPlace::Row(self.n_read)
    }
}
