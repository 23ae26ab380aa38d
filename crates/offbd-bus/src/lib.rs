//! Devices over NATS and MQTT.
//!
//! A batch takes the same path as one by HTTP: it is parsed, submitted to the service and
//! acknowledged after its commit, with the same document, on the topic `…/ack` of the asset.
//! Nothing is acknowledged before. A batch that cannot be taken gets a refusal there, with
//! the seconds after which the device sends it again if that can help. A device keeps a
//! batch until its acknowledgement, and sends it again after some seconds of silence;
//! samples that were stored already count as duplicates. So nothing is lost if a message, the
//! broker or the service is lost.
//!
//! - `intake`: messages to batches, batches to answers;
//! - `faults`: the events of the service to retained messages;
//! - `batch_id`: the id of a batch that is refused;
//! - `held`: batches that cannot be settled at present, while their bus keeps them;
//! - `presence`: which devices are connected;
//! - `nats`: a NATS server, with `callout`, by which it asks for the rights of a device, and
//!   `settings`, the check of its settings;
//! - `mqtt`: an MQTT broker, with `puback`, the order of its acknowledgements, and
//!   `mqtt_publisher`, by which faults go there; `marker` finds out which of them it has kept, and
//!   `dialer` shortens what is too long.
//!
//! Contains no SQL and no engines, and reads no configuration.

// Without a bus nobody uses what both have in common.
#![cfg_attr(not(any(feature = "nats", feature = "mqtt")), allow(dead_code))]

mod batch_id;
#[cfg(feature = "nats")]
mod callout;
#[cfg(feature = "mqtt")]
mod dialer;
mod faults;
mod held;
mod intake;
#[cfg(feature = "mqtt")]
mod marker;
#[cfg(feature = "mqtt")]
pub mod mqtt;
#[cfg(feature = "mqtt")]
mod mqtt_publisher;
#[cfg(feature = "nats")]
pub mod nats;
mod presence;
#[cfg(feature = "mqtt")]
mod puback;
#[cfg(feature = "nats")]
mod settings;

use std::time::Duration;

use offbd_http::MessageOutcome;

/// Interval between two attempts to connect.
const RETRY_INTERVAL: Duration = Duration::from_secs(2);

/// Longest time to send one message; then it is dropped, and the device sends its batch again.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// Messages that wait to be parsed. When there are more, a batch is refused with 429; over
/// MQTT at QoS 1 the connection is made again, and the broker repeats them.
const MAX_QUEUED: usize = 4096;

/// Batches of one bus that are submitted and not yet answered; at the limit no further
/// message is parsed.
const MAX_PENDING: usize = 1024;

/// Bytes of messages that wait to be parsed, or to be tried again; at the limit as for
/// [`MAX_QUEUED`].
const MAX_QUEUED_BYTES: usize = 64 << 20;

/// Counts messages of a bus by what became of them.
fn count(bus: &'static str, outcome: MessageOutcome, n: u64) {
    let labels = [("bus", bus), ("outcome", outcome.as_str())];
    metrics::counter!("offbd_bus_messages_total", &labels).increment(n);
}
