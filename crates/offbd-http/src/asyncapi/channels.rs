//! The channels, their operations and messages: what the AsyncAPI document is made of.

use serde_json::{Map, Value, json};

use offbd_wire::bus::{DeviceTopic, TopicStyle};

/// Paths of the OpenAPI description whose bodies are streams.
const STREAM: &str = "/api/v1/assets/{asset}/stream";
const EVENTS: &str = "/api/v1/events";

/// What may be sent on a channel.
pub(super) struct Message {
    pub(super) name: &'static str,
    /// Name of the schema.
    pub(super) schema: &'static str,
    pub(super) content_type: &'static str,
    pub(super) summary: &'static str,
}

pub(super) const JSON: &str = "application/json";
const CLOUD_EVENT: &str = "application/cloudevents+json";

/// Every message.
pub(super) const MESSAGES: [Message; 14] = [
    message("batch", "BatchMessage", JSON, "Samples; either document also as MessagePack"),
    message("batchAck", "BatchAck", JSON, "The batch is durable"),
    message("batchRefusal", "BatchRefusal", JSON, "Nothing of the batch was taken"),
    message("hello", "Hello", JSON, "What a device is"),
    message("presence", "PresenceWord", "text/plain", "Whether a device is connected"),
    message("fault", "FaultMessage", JSON, "A change of a fault code"),
    message("communication", "CommunicationMessage", JSON, "Data stay away, or are back"),
    message("cleared", NOTHING, "text/plain", "Removes the retained message"),
    message("faultMarker", "FaultMarker", JSON, "The event up to which all is published; retained"),
    message("faultQuestion", "FaultMarkerQuestion", JSON, "A question of offbd to itself"),
    message("frame", "StreamFrame", JSON, "An answer to a batch, or a state"),
    message("faultEvent", "Event", JSON, "Data of an event `fault`"),
    message("communicationEvent", "CommunicationEvent", JSON, "Data of an event `communication`"),
    message("notification", "Notification", CLOUD_EVENT, "A change, a reminder or a test"),
];

/// Stands for the schema of a message without a payload.
pub(super) const NOTHING: &str = "";

const fn message(
    name: &'static str,
    schema: &'static str,
    content_type: &'static str,
    summary: &'static str,
) -> Message {
    Message { name, schema, content_type, summary }
}

/// Who sends on a channel, seen from the service.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Action {
    Receive,
    Send,
}

impl Action {
    pub(super) const fn as_str(self) -> &'static str {
        match self {
            Self::Receive => "receive",
            Self::Send => "send",
        }
    }
}

/// A channel with its operations.
pub(super) struct Channel {
    pub(super) name: String,
    /// Empty if each receiver has its own.
    pub(super) address: String,
    pub(super) server: &'static str,
    pub(super) summary: &'static str,
    pub(super) bindings: Value,
    pub(super) operations: Vec<Operation>,
}

/// The messages that go one way on a channel.
pub(super) struct Operation {
    pub(super) action: Action,
    pub(super) messages: &'static [&'static str],
    /// Whether a bus keeps the last message for later subscribers.
    pub(super) retained: bool,
    /// The channel and the messages of the answer.
    pub(super) reply: Option<(String, &'static [&'static str])>,
}

impl Operation {
    const fn new(action: Action, messages: &'static [&'static str]) -> Self {
        Self { action, messages, retained: false, reply: None }
    }

    const fn retained(mut self) -> Self {
        self.retained = true;
        self
    }

    fn answered(self, channel: &str, messages: &'static [&'static str]) -> Self {
        Self { reply: Some((channel.to_owned(), messages)), ..self }
    }
}

/// Messages that answer a batch over a bus.
const ANSWERS: &[&str] = &["batchAck", "batchRefusal"];

/// Returns the channels of HTTP.
pub(super) fn http_channels(openapi: &Value) -> [Channel; 2] {
    let stream = [
        Operation::new(Action::Receive, &["batch"]).answered("stream", &["frame"]),
        Operation::new(Action::Send, &["frame", "fault", "communication"]),
    ];
    [
        Channel {
            name: "stream".to_owned(),
            address: STREAM.to_owned(),
            server: "websocket",
            summary: "A WebSocket for the telemetry of one rig, its events and its state",
            bindings: json!({ "ws": { "query": query(openapi, STREAM), "bindingVersion": "0.1.0" } }),
            operations: stream.into(),
        },
        Channel {
            name: "events".to_owned(),
            address: EVENTS.to_owned(),
            server: "http",
            summary: "Server-Sent Events. The first event, `begin`, has the id after which the \
                stream starts, and an empty object as data",
            bindings: Value::Null,
            operations: vec![Operation::new(Action::Send, &["faultEvent", "communicationEvent"])],
        },
    ]
}

/// Returns the channel of notifications, whose receivers are set in the service.
pub(super) fn webhook_channel() -> Channel {
    Channel {
        name: "webhook".to_owned(),
        address: String::new(),
        server: "receiver",
        summary: "Notifications of a channel, signed per Standard Webhooks, posted to its URL",
        bindings: Value::Null,
        operations: vec![Operation::new(Action::Send, &["notification"])],
    }
}

const MARKER: &str = "By which offbd finds out, after it has connected, whether the broker has lost \
    retained faults. Nobody else needs it";

const STATE: &str = "Whether a process of offbd is connected: `online`; its last will is `offline`. \
    `client` is the name by which the broker knows it. Only with `mqtt.state`";

const MARK: Operation = Operation::new(Action::Send, &["faultMarker"]);

/// Returns the channels of a bus.
pub(super) fn bus_channels(style: TopicStyle) -> Vec<Channel> {
    let (server, suffix) = match style {
        TopicStyle::Mqtt => ("mqtt", "Mqtt"),
        TopicStyle::Nats => ("nats", "Nats"),
    };
    let channel = |name: &str, address: String, summary, operation| Channel {
        name: format!("{name}{suffix}"),
        address,
        server,
        summary,
        bindings: Value::Null,
        operations: vec![operation],
    };
    let of_device = |topic: DeviceTopic| {
        let (summary, operation) = device_operation(topic, &format!("ack{suffix}"));
        channel(topic.as_str(), style.topic(&["{asset}", topic.as_str()]), summary, operation)
    };
    let mut channels: Vec<Channel> = DeviceTopic::ALL.into_iter().map(of_device).collect();
    let ack = Operation::new(Action::Send, ANSWERS);
    let summary = "Answers to batches; a request over NATS gets them as its reply too, if its reply \
         subject is below `_INBOX.`";
    channels.push(channel("ack", style.ack("{asset}"), summary, ack));
    let fault = Operation::new(Action::Send, &["fault", "communication", "cleared"]).retained();
    let summary = "The present state of each fault code; NATS alone keeps no message";
    channels.push(channel("fault", style.fault("{asset}", "{code}"), summary, fault));
    if style == TopicStyle::Mqtt {
        let mut marker = channel("faultMarker", style.marker(), MARKER, MARK.retained());
        marker.operations.push(Operation::new(Action::Receive, &["faultMarker", "faultQuestion"]));
        channels.push(marker);
        let state = Operation::new(Action::Send, &["presence"]).retained();
        channels.push(channel("serviceState", style.service_state("{client}"), STATE, state));
    }
    channels
}

/// Returns what a device publishes on `topic`; `ack` is the channel of the answers.
fn device_operation(topic: DeviceTopic, ack: &str) -> (&'static str, Operation) {
    let receive = |messages| Operation::new(Action::Receive, messages);
    match topic {
        DeviceTopic::Telemetry => (
            "Batches. A device keeps one until its acknowledgement, and sends it again after some \
             seconds of silence and after connecting",
            receive(&["batch"]).answered(ack, ANSWERS),
        ),
        DeviceTopic::Hello => {
            ("Birth: what a device tells after connecting", receive(&["hello"]).retained())
        }
        DeviceTopic::State => (
            "Presence: `online`; the last will of a device is `offline`",
            receive(&["presence"]).retained(),
        ),
    }
}

/// Returns the schema of the query parameters of `GET path`.
pub(super) fn query(openapi: &Value, path: &str) -> Value {
    let parameters = openapi["paths"][path]["get"]["parameters"].as_array();
    let of_query = |parameter: &&Value| parameter["in"] == "query";
    let property = |parameter: &Value| {
        let mut schema = parameter["schema"].clone();
        schema["description"] = parameter["description"].clone();
        (parameter["name"].as_str().unwrap_or_default().to_owned(), schema)
    };
    let properties: Map<String, Value> =
        parameters.into_iter().flatten().filter(of_query).map(property).collect();
    json!({ "type": "object", "properties": properties })
}

/// Parameters of addresses.
pub(super) const PARAMETERS: [(&str, &str); 3] = [
    ("asset", "Name of the asset; in topics, `.` is written `=2E`"),
    ("client", "Name by which the broker knows a process of offbd: `mqtt.client_id`"),
    ("code", "Fault code"),
];

/// The servers, at their usual ports on this machine.
pub(super) fn servers() -> Value {
    let login = json!([{ "$ref": "#/components/securitySchemes/login" }]);
    let token = json!([{ "$ref": "#/components/securitySchemes/token" }]);
    json!({
        "websocket": { "host": "127.0.0.1:8087", "protocol": "ws", "security": token },
        "http": { "host": "127.0.0.1:8087", "protocol": "http", "security": token },
        "mqtt": { "host": "127.0.0.1:1883", "protocol": "mqtt", "security": login },
        "receiver": { "host": "hooks.example", "protocol": "https" },
        "nats": { "host": "127.0.0.1:4222", "protocol": "nats", "security": login },
    })
}
