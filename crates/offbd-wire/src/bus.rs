//! Topics and messages of devices over NATS and MQTT.
//!
//! An MQTT topic `offbd/v1/{asset}/telemetry` is the NATS subject
//! `offbd.v1.{asset}.telemetry`. A `.` in the name of an asset separates levels of a subject,
//! so that it is written `=2E` in both. Telemetry has the documents of
//! [`super::telemetry`]; its acknowledgement is that of HTTP.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::alarm::CommunicationEventView;
use super::service::EventView;
use super::telemetry::{AckView, ColumnsView, RowsView};

/// The first levels of every topic.
const ROOT: [&str; 2] = ["offbd", "v1"];

/// The level of offbd's own topic. No asset has it: `=` is in no name.
const SERVICE_LEVEL: &str = "=service";

/// The subject below which NATS clients receive the replies to their requests.
pub const INBOX: &str = "_INBOX";

/// Longest name of an asset, bytes, as in the asset file.
const NAME_BYTES: usize = 128;

/// How the levels of a topic are separated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopicStyle {
    /// `offbd/v1/…`.
    Mqtt,
    /// `offbd.v1.…`.
    Nats,
}

impl TopicStyle {
    const fn separator(self) -> &'static str {
        match self {
            Self::Mqtt => "/",
            Self::Nats => ".",
        }
    }

    /// Returns the topic with these levels below `offbd/v1`.
    #[must_use]
    pub fn topic(self, levels: &[&str]) -> String {
        [&ROOT, levels].concat().join(self.separator())
    }

    /// Returns the topic of acknowledgements for the device of `asset`.
    #[must_use]
    pub fn ack(self, asset: &str) -> String {
        self.topic(&[&encoded(asset), "ack"])
    }

    /// Returns the topic of the present state of a fault code of `asset`.
    #[must_use]
    pub fn fault(self, asset: &str, code: &str) -> String {
        self.topic(&[&encoded(asset), "fault", code])
    }

    /// Returns the topic on which offbd notes which events it has published.
    #[must_use]
    pub fn marker(self) -> String {
        self.topic(&[SERVICE_LEVEL, "faults"])
    }

    /// Returns the topic on which a process of the service, which the broker knows as `client`,
    /// says whether it is connected.
    #[must_use]
    pub fn service_state(self, client: &str) -> String {
        self.topic(&[SERVICE_LEVEL, client, "state"])
    }

    /// Parses a topic that a device publishes on.
    ///
    /// # Errors
    /// [`TopicError`] if the topic is another one, or does not have the name of an asset.
    pub fn parse(self, topic: &str) -> Result<(String, DeviceTopic), TopicError> {
        let foreign = || TopicError::Foreign { topic: shortened(topic) };
        let levels: Vec<&str> = topic.split(self.separator()).collect();
        let [root, version, level, kind] = levels[..] else { return Err(foreign()) };
        if [root, version] != ROOT {
            return Err(foreign());
        }
        let kind = DeviceTopic::ALL.into_iter().find(|topic| topic.as_str() == kind);
        Ok((decoded(level)?, kind.ok_or_else(foreign)?))
    }
}

/// What a device publishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceTopic {
    /// A batch of samples.
    Telemetry,
    /// A [`HelloView`], retained.
    Hello,
    /// A [`PresenceWord`], retained; `offline` is the device's last will.
    State,
}

impl DeviceTopic {
    /// Every topic of a device.
    pub const ALL: [Self; 3] = [Self::Telemetry, Self::Hello, Self::State];

    /// Returns the last level of the topic.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Telemetry => "telemetry",
            Self::Hello => "hello",
            Self::State => "state",
        }
    }
}

/// Why a topic is not one of a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopicError {
    #[error(
        "`{topic}` is not offbd/v1/ASSET/telemetry, offbd/v1/ASSET/hello or offbd/v1/ASSET/state"
    )]
    Foreign { topic: String },
    #[error(
        "`{level}` is not the name of an asset: 1 to {NAME_BYTES} letters, digits, `-` or `_`, \
         and `=2E` for `.`"
    )]
    Name { level: String },
}

fn shortened(text: &str) -> String {
    text.chars().take(NAME_BYTES).collect()
}

/// Returns the name of an asset as a level of a topic.
#[must_use]
pub fn encoded(asset: &str) -> String {
    asset.replace('.', "=2E")
}

/// Returns the name of the asset that a level of a topic stands for.
///
/// # Errors
/// [`TopicError::Name`] if no asset can have this name.
pub fn decoded(level: &str) -> Result<String, TopicError> {
    let name = level.replace("=2E", ".");
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    let is_name = !level.contains('.') && name.chars().all(plain);
    if is_name && (1..=NAME_BYTES).contains(&name.len()) && name != "." && name != ".." {
        return Ok(name);
    }
    Err(TopicError::Name { level: shortened(level) })
}

/// Returns the NATS subject below which the devices of an asset receive replies. `level` is the
/// encoded name of the asset, or `*` for all assets.
#[must_use]
pub fn inbox(level: &str) -> String {
    [INBOX, ROOT[0], level].join(".")
}

/// Returns the NATS subject below which offbd receives replies itself.
#[must_use]
pub fn service_inbox() -> String {
    inbox(SERVICE_LEVEL)
}

/// Returns whether `subject` is a single NATS subject below `parent`: one without wildcards and
/// empty levels.
#[must_use]
pub fn is_below(subject: &str, parent: &str) -> bool {
    let rest = subject.strip_prefix(parent).and_then(|rest| rest.strip_prefix('.'));
    rest.is_some_and(|rest| rest.split('.').all(|level| !matches!(level, "" | "*" | ">")))
}

/// What a device tells about itself after it has connected. Further fields are ignored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HelloView {
    /// Version of the device's program.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub firmware: Option<String>,
    /// Axes that the device has: `x`, `y`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<String>,
    /// Units of what it sends, such as `m` and `rad`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub units: Vec<String>,
    /// Rate of its samples, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
}

/// Whether a device is connected, as plain text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum PresenceWord {
    Online,
    Offline,
}

impl PresenceWord {
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Online => "online",
            Self::Offline => "offline",
        }
    }

    /// Returns the word that `payload` is; `None` for anything else.
    #[must_use]
    pub fn of_bytes(payload: &[u8]) -> Option<Self> {
        match payload.trim_ascii() {
            b"online" | b"\"online\"" => Some(Self::Online),
            b"offline" | b"\"offline\"" => Some(Self::Offline),
            _ => None,
        }
    }
}

/// A batch as a device sends it in one message.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct BatchMessageView {
    /// Comes back with the acknowledgement.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    #[serde(flatten)]
    pub batch: BatchView,
}

/// The samples of a batch.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[serde(untagged)]
pub enum BatchView {
    Rows(RowsView),
    Columns(ColumnsView),
}

/// The acknowledgement of a batch that is durable: that of HTTP, with the `id` of the batch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BatchAckView {
    /// The id of the batch, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    #[serde(flatten)]
    pub ack: AckView,
}

/// The answer to a batch of which nothing was taken: a problem (RFC 9457) as of HTTP.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct BatchRefusalView {
    /// The id of the batch, if it has one and could be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// URI of the problem type.
    #[serde(rename = "type")]
    pub kind: String,
    /// Summary of the problem type.
    pub title: String,
    /// The status that HTTP would have answered.
    pub status: u16,
    /// Explanation of this occurrence.
    pub detail: String,
    /// JSON pointer to the invalid element of the payload.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
    /// Seconds after which the same batch is to be sent again; absent if that cannot help.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_s: Option<u64>,
}

/// A change of a fault as it is published: an event of the service with its number.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct FaultMessageView {
    /// Number of the event, which rises; a message with a number seen before is a repetition.
    pub event: i64,
    #[serde(flatten)]
    pub change: EventView,
}

/// A change of whether data of a rig arrive as it is published: an event of the service with
/// its number.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CommunicationMessageView {
    /// Number of the event, which rises; a message with a number seen before is a repetition.
    pub event: i64,
    #[serde(flatten)]
    pub change: CommunicationEventView,
}

/// What offbd notes for itself at an MQTT broker, retained: without it the broker has lost the
/// retained messages, and with a number that is too low the latest of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FaultMarkerView {
    /// Number of an event; it and all before it have been published.
    pub published: i64,
}

/// What offbd sends to itself through an MQTT broker: when it arrives, a marker that the broker
/// has kept has arrived before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FaultMarkerQuestionView {
    /// Is different in each question.
    pub question: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_topic_is_that_of_a_device_or_the_reason_names_it() {
        let parse = |topic: &str| TopicStyle::Mqtt.parse(topic);
        assert_eq!(parse("offbd/v1/a=2Eb/hello"), Ok(("a.b".to_owned(), DeviceTopic::Hello)));
        for topic in [
            "offbd/v1/a/ack",
            "offbd/v1/a",
            "offbd/v2/a/telemetry",
            "offbd/v1/a/b/telemetry",
            "x/v1/a/telemetry",
            "",
        ] {
            assert!(matches!(parse(topic), Err(TopicError::Foreign { .. })), "{topic}");
        }
        for level in ["", "+", "#", "a b", "a=2F", "a.b", "=2E", "=2E=2E", "ä", "*", ">"] {
            let topic = format!("offbd/v1/{level}/telemetry");
            let error = parse(&topic).unwrap_err();
            assert_eq!(error, TopicError::Name { level: level.to_owned() });
        }
        assert!(parse(&format!("offbd/v1/{}/state", "a".repeat(129))).is_err());
        assert!(decoded(SERVICE_LEVEL).is_err());
    }

    proptest! {
        #[test]
        fn every_name_is_one_level_and_comes_back(name in "[A-Za-z0-9._-]{1,128}") {
            prop_assume!(name != "." && name != "..");
            for style in [TopicStyle::Mqtt, TopicStyle::Nats] {
                let topic = style.topic(&[&encoded(&name), "telemetry"]);
                prop_assert_eq!(style.parse(&topic), Ok((name.clone(), DeviceTopic::Telemetry)));
            }
        }

        #[test]
        fn a_reply_is_below_the_inbox_of_one_asset_at_most(
            [asset, other] in ["[ab.]{1,3}", "[ab.]{1,3}"],
            rest in "[ab.*>]{0,5}",
        ) {
            let inbox_of = |asset: &str| inbox(&encoded(asset));
            let subject = format!("{}.{rest}", inbox_of(&asset));
            let levels = || rest.split('.');
            let is_single = levels().all(|level| !["", "*", ">"].contains(&level));
            prop_assert_eq!(is_below(&subject, &inbox_of(&asset)), is_single);
            prop_assert_eq!(is_below(&subject, INBOX), is_single);
            prop_assert_eq!(is_below(&subject, &inbox_of(&other)), is_single && asset == other);
            prop_assert!(!is_below(&subject, &service_inbox()));
        }

        #[test]
        fn no_topic_panics(topic in ".{0,300}") {
            let _ = TopicStyle::Nats.parse(&topic);
            let _ = TopicStyle::Mqtt.parse(&topic);
        }
    }
}
