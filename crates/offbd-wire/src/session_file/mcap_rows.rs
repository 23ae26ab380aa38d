//! Reads the messages of one topic of an MCAP file, record by record: those with the schema of
//! samples, or else those of the only topic in JSON. Other topics are skipped; so is the index, which
//! is not needed.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read, Seek};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};

use super::byte_budget::ByteBudget;
use super::json::JsonMessages;
use super::mcap::SAMPLE_SCHEMA;
use super::shared_source::{SharedSource, SourceFrom};
use super::{ColumnFile, SessionFileError, SessionFormat, TextRows, guarded};
use crate::session_csv::COLUMNS;
use crate::table::{
    Cells, JUDGED_ROWS, NamedColumns, RowFault, RowSource, TableOptions, TableReader,
};

/// Longest record that is read, bytes; one is in memory at a time. Chosen: an attached file or
/// picture may be long, a sample has two hundred. A file with a longer one is refused.
const MAX_RECORD_BYTES: usize = 16 << 20;

/// Bytes before the contents of a record: what it is, and its length.
const RECORD_HEAD_BYTES: u64 = 9;

/// Messages in JSON by which the topic and its columns are found. Chosen: ten seconds at 100 Hz, so
/// that a key which is absent at first is known.
const FIRST_MESSAGES: usize = 1000;

/// Bytes of these messages at most, beside the last one. Chosen: a thousand of 4 KiB.
const FIRST_BYTES: usize = 4 << 20;

/// The column with the time at which a message was logged, ns.
const LOG_TIME: &str = "log_time";

fn damaged(error: &McapError) -> SessionFileError {
    SessionFileError::Damaged { format: SessionFormat::Mcap, reason: error.to_string() }
}

/// A message in JSON.
struct Message {
    channel: u16,
    log_time: u64,
    data: Vec<u8>,
}

/// The messages in JSON of an MCAP file.
struct Messages<S> {
    source: S,
    reader: LinearReader,
    schemas: BTreeSet<u16>,
    /// The topics of the channels with JSON, and whether they have the schema of samples.
    channels: BTreeMap<u16, (String, bool)>,
    budget: ByteBudget,
}

impl<S: Read> Messages<S> {
    fn new(source: S, n_bytes: u64) -> Self {
        let options = LinearReaderOptions::default()
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD_BYTES);
        Self {
            source,
            reader: LinearReader::new_with_options(options),
            schemas: BTreeSet::new(),
            channels: BTreeMap::new(),
            budget: ByteBudget::of_file(n_bytes),
        }
    }

    /// Returns the next message; `None` at the end of the file.
    fn next(&mut self) -> Result<Option<Message>, SessionFileError> {
        guarded(SessionFormat::Mcap, || self.read())?
    }

    fn read(&mut self) -> Result<Option<Message>, SessionFileError> {
        while let Some(event) = self.reader.next_event() {
            match event.map_err(|error| damaged(&error))? {
                LinearReadEvent::ReadRequest(n) => {
                    let n = self.source.read(self.reader.insert(n))?;
                    self.reader.notify_read(n);
                }
                LinearReadEvent::Record { data, opcode } => {
                    self.budget.spend(RECORD_HEAD_BYTES + data.len() as u64)?;
                    if !matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE) {
                        continue;
                    }
                    if opcode != op::MESSAGE && !has_whole_texts(opcode, data) {
                        let reason = "a text is longer than its record".to_owned();
                        return Err(SessionFileError::Damaged {
                            format: SessionFormat::Mcap,
                            reason,
                        });
                    }
                    let record = parse_record(opcode, data).map_err(|error| damaged(&error))?;
                    let message = note(&mut self.schemas, &mut self.channels, record);
                    if message.is_some() {
                        return Ok(message);
                    }
                }
            }
        }
        Ok(None)
    }
}

/// Whether the texts of a schema or a channel are within its record. The library reserves as much
/// memory as a text states, up to 4 GiB, before it reads the text.
fn has_whole_texts(opcode: u8, record: &[u8]) -> bool {
    let n_ids = if opcode == op::CHANNEL { 2 } else { 1 };
    let Some(mut rest) = record.get(2 * n_ids..) else { return false };
    if !(skip_text(&mut rest) && skip_text(&mut rest)) {
        return false;
    }
    if opcode != op::CHANNEL {
        return true;
    }
    // Pairs of texts, after the number of their bytes.
    let Some(mut pairs) = after_length(&mut rest) else { return false };
    while !pairs.is_empty() {
        if !(skip_text(&mut pairs) && skip_text(&mut pairs)) {
            return false;
        }
    }
    true
}

/// Takes a length and as many bytes from `rest`; `None` if it has fewer.
fn after_length<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, bytes) = rest.split_first_chunk()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    let (taken, left) = bytes.split_at_checked(length)?;
    *rest = left;
    Some(taken)
}

fn skip_text(rest: &mut &[u8]) -> bool {
    after_length(rest).is_some()
}

/// Notes which channels have JSON; returns a message of one of these.
fn note(
    schemas: &mut BTreeSet<u16>,
    channels: &mut BTreeMap<u16, (String, bool)>,
    record: Record<'_>,
) -> Option<Message> {
    match record {
        Record::Schema { header, .. } if header.name == SAMPLE_SCHEMA => {
            schemas.insert(header.id);
        }
        Record::Channel(channel) if channel.message_encoding == "json" => {
            let has_samples = schemas.contains(&channel.schema_id);
            channels.insert(channel.id, (channel.topic, has_samples));
        }
        Record::Message { header, data } if channels.contains_key(&header.channel_id) => {
            let (channel, log_time) = (header.channel_id, header.log_time);
            return Some(Message { channel, log_time, data: data.into_owned() });
        }
        _ => {}
    }
    None
}

/// An MCAP file whose topic and columns are known.
pub(super) struct McapTable<S> {
    source: SharedSource<S>,
    columns: NamedColumns,
    topic: RowTopic,
}

/// Which messages are rows.
#[derive(Clone)]
enum RowTopic {
    /// Those with the schema of samples.
    Samples,
    Named(String),
}

impl RowTopic {
    /// Finds the topic of the rows.
    fn of(channels: &BTreeMap<u16, (String, bool)>) -> Result<Self, SessionFileError> {
        if channels.values().any(|(_, has_samples)| *has_samples) {
            return Ok(Self::Samples);
        }
        let topics: BTreeSet<&str> = channels.values().map(|(topic, _)| topic.as_str()).collect();
        let mut list = topics.iter();
        let found = match (list.next(), list.next()) {
            (Some(only), None) => return Ok(Self::Named((*only).to_owned())),
            (None, _) => "no other topic in JSON".to_owned(),
            (Some(_), Some(_)) => {
                let topics: Vec<String> = topics.iter().map(|topic| format!("`{topic}`")).collect();
                format!("several other topics in JSON, {}", topics.join(", "))
            }
        };
        Err(SessionFileError::NoTopic { schema: SAMPLE_SCHEMA, found })
    }

    fn has(&self, (topic, has_samples): &(String, bool)) -> bool {
        match self {
            Self::Samples => *has_samples,
            Self::Named(name) => topic == name,
        }
    }

    /// The columns that are known before the first message.
    fn names(&self) -> Vec<&'static str> {
        match self {
            Self::Samples => COLUMNS.into_iter().chain(["seq"]).collect(),
            Self::Named(_) => Vec::new(),
        }
    }
}

impl<S: Read + Seek + Send + 'static> McapTable<S> {
    /// Finds the topic, and reads the first messages.
    pub(super) fn open(source: S) -> Result<Self, SessionFileError> {
        let source = SharedSource::new(source)?;
        let mut messages = Messages::new(source.from(0), source.n_bytes());
        let (mut first, mut n_bytes) = (Vec::new(), 0);
        while first.len() < FIRST_MESSAGES
            && n_bytes < FIRST_BYTES
            && let Some(message) = messages.next()?
        {
            n_bytes += message.data.len();
            first.push(message);
        }
        let topic = RowTopic::of(&messages.channels)?;
        let mut json = JsonMessages::new(&topic.names());
        let mut rows: Vec<(Vec<String>, String)> = Vec::new();
        first.retain(|message| topic.has(&messages.channels[&message.channel]));
        for Message { log_time, data, .. } in &first {
            if let Ok(cells) = json.read(data)
                && rows.len() < JUDGED_ROWS
            {
                rows.push((cells.to_vec(), log_time.to_string()));
            }
        }
        let mut names = json.names().to_vec();
        let row = |(mut cells, log_time): (Vec<String>, String)| {
            cells.resize(names.len(), String::new());
            cells.push(log_time);
            cells
        };
        let first_rows = rows.into_iter().map(row).collect();
        names.push(LOG_TIME.to_owned());
        let columns = NamedColumns { names, first_rows };
        Ok(Self { source, columns, topic })
    }
}

impl<S: Read + Seek + Send + 'static> ColumnFile for McapTable<S> {
    fn columns(&self) -> &NamedColumns {
        &self.columns
    }

    fn rows(&mut self, options: &TableOptions) -> Result<TextRows<'static>, SessionFileError> {
        let names: Vec<&str> = self.columns.names.iter().map(String::as_str).collect();
        // The last column is the time of the log.
        let names = names.split_last().map_or(&[][..], |(_, names)| names);
        let rows = |_: &[usize]| {
            Ok(McapRows {
                n_names: names.len(),
                messages: Some(Messages::new(self.source.from(0), self.source.n_bytes())),
                topic: self.topic.clone(),
                json: JsonMessages::new(names),
                n_read: 0,
            })
        };
        TableReader::of_columns(&self.columns, options, rows).map(TextRows::of_columns)
    }
}

/// The rows of an MCAP file.
struct McapRows<S: Read + Seek> {
    /// `None` after an error.
    messages: Option<Messages<io::BufReader<SourceFrom<S>>>>,
    topic: RowTopic,
    json: JsonMessages,
    /// The values of a message that have a column.
    n_names: usize,
    n_read: u64,
}

impl<S: Read + Seek + Send> RowSource<SessionFileError> for McapRows<S> {
    fn next(&mut self, cells: &mut Cells) -> Result<bool, RowFault<SessionFileError>> {
        while let Some(messages) = &mut self.messages {
            let message = match messages.next() {
                Ok(Some(message)) => message,
                end => {
                    self.messages = None;
                    return end.map(|_| false).map_err(RowFault::Unreadable);
                }
            };
            if !self.topic.has(&messages.channels[&message.channel]) {
                continue;
            }
            self.n_read += 1;
            let row = self.json.read(&message.data).map_err(RowFault::Rejected)?;
            cells.clear();
            for i in 0..self.n_names {
                cells.push_text(row.get(i).map_or("", String::as_str));
            }
            cells.push_text(&message.log_time.to_string());
            return Ok(true);
        }
        Ok(false)
    }

    fn line(&self) -> u64 {
        self.n_read
    }
}
