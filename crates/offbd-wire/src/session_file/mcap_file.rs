//! Writes an MCAP file into memory: messages of topics, in JSON or in protobuf.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::mem;
use std::sync::{Arc, Mutex, PoisonError};

use foxglove::{Encode, Schema};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::{NoSeek, Writer};
use mcap::{Attachment, WriteOptions};
use serde::Serialize;

use super::{SessionFileError, SessionFormat, SessionInfo};

/// A topic of a file: its name, and the schema of its messages.
#[derive(Clone, Copy)]
pub(super) struct Topic {
    pub(super) name: &'static str,
    pub(super) schema: fn() -> Option<Schema>,
}

/// The schema of messages in JSON.
pub(super) fn json_schema(name: &str, document: &'static str) -> Option<Schema> {
    Some(Schema::new(name, "jsonschema", document.as_bytes()))
}

pub(super) fn unwritten(error: impl ToString) -> SessionFileError {
    SessionFileError::Write { format: SessionFormat::Mcap, reason: error.to_string() }
}

/// The file that is being written, with the channels of its topics.
pub(super) struct McapFile {
    writer: Writer<NoSeek<SharedBytes>>,
    written: SharedBytes,
    /// The channel of each topic, and the number of its messages.
    channels: BTreeMap<&'static str, (u16, u32)>,
    message: Vec<u8>,
}

impl McapFile {
    /// Begins a file with `info` as metadata and the asset file attached.
    pub(super) fn new(info: &SessionInfo) -> Result<Self, SessionFileError> {
        let written = SharedBytes::default();
        let options = WriteOptions::new()
            .library(concat!("offbd ", env!("CARGO_PKG_VERSION")))
            .compression_threads(0)
            .disable_seeking(true);
        let mut writer = options.create(NoSeek::new(written.clone())).map_err(unwritten)?;
        let entries = info.entries().map(|(key, value)| (key.to_owned(), value.to_owned()));
        let metadata = Metadata { name: "offbd".to_owned(), metadata: entries.collect() };
        writer.write_metadata(&metadata).map_err(unwritten)?;
        if let Some(asset) = &info.asset_file {
            let attachment = Attachment {
                log_time: 0,
                create_time: 0,
                name: "asset.json".to_owned(),
                media_type: "application/json".to_owned(),
                data: asset.as_bytes().into(),
            };
            writer.attach(&attachment).map_err(unwritten)?;
        }
        Ok(Self { writer, written, channels: BTreeMap::new(), message: Vec::new() })
    }

    /// Returns the channel of `topic`, with the number of its next message; adds it if it is
    /// new.
    pub(super) fn add(&mut self, topic: Topic) -> Result<&mut (u16, u32), SessionFileError> {
        use std::collections::btree_map::Entry;
        match self.channels.entry(topic.name) {
            Entry::Occupied(known) => Ok(known.into_mut()),
            Entry::Vacant(new) => {
                let schema = (topic.schema)().ok_or_else(|| unwritten("a topic has no schema"))?;
                let encoding = match schema.encoding.as_str() {
                    "jsonschema" => "json",
                    other => other,
                };
                let writer = &mut self.writer;
                let channel = writer
                    .add_schema(&schema.name, &schema.encoding, &schema.data)
                    .and_then(|id| writer.add_channel(id, topic.name, encoding, &BTreeMap::new()));
                Ok(new.insert((channel.map_err(unwritten)?, 0)))
            }
        }
    }

    /// Appends a message in JSON of `topic` at `t_s` on the device's clock.
    pub(super) fn json(
        &mut self,
        topic: Topic,
        t_s: f64,
        content: &impl Serialize,
    ) -> Result<(), SessionFileError> {
        self.append(topic, t_s, |message| {
            Ok(serde_json::to_writer(message, content).map_err(io::Error::from)?)
        })
    }

    /// Appends one of Foxglove's messages.
    pub(super) fn foxglove(
        &mut self,
        topic: Topic,
        t_s: f64,
        content: &impl Encode,
    ) -> Result<(), SessionFileError> {
        self.append(topic, t_s, |message| content.encode(message).map_err(unwritten))
    }

    fn append(
        &mut self,
        topic: Topic,
        t_s: f64,
        encode: impl FnOnce(&mut Vec<u8>) -> Result<(), SessionFileError>,
    ) -> Result<(), SessionFileError> {
        let (channel_id, n) = self.add(topic)?;
        let (channel_id, sequence) = (*channel_id, mem::replace(n, n.wrapping_add(1)));
        let time = nanoseconds(t_s);
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.message.clear();
        encode(&mut self.message)?;
        self.writer.write_to_known_channel(&header, &self.message).map_err(unwritten)
    }

    /// Ends the file, and returns its last bytes.
    pub(super) fn end(mut self) -> Result<Vec<u8>, SessionFileError> {
        self.writer.finish().map_err(unwritten)?;
        Ok(self.take())
    }

    /// Takes what is complete.
    pub(super) fn take(&self) -> Vec<u8> {
        mem::take(&mut self.written.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The time of a message, ns since the zero of the device's clock.
pub(super) fn nanoseconds(t_s: f64) -> u64 {
    // The conversion saturates at both ends.
    (t_s * 1e9).round() as u64
}

/// The bytes that the library has written and the caller has not taken.
#[derive(Clone, Default)]
struct SharedBytes(Arc<Mutex<Vec<u8>>>);

impl Write for SharedBytes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
