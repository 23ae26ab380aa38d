//! `/asyncapi.yaml`: the messages of the interface, as AsyncAPI 3.0: over the WebSocket, as
//! Server-Sent Events, and over MQTT and NATS.
//!
//! The schemas of messages are those of the OpenAPI description and named alike. Topics are
//! made by the functions that the buses use; the parameters of a query are those of the
//! operation in the OpenAPI description. Actions are those of the service: it `receive`s what
//! a device sends.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};
use utoipa::OpenApi;

use super::api::api;
use super::{description, stream};
use crate::wire::bus::{DeviceTopic, TopicStyle};
use crate::wire::{alarm, bus, service};

/// How a reference to a schema begins.
const SCHEMA: &str = "#/components/schemas/";

/// Paths of the OpenAPI description whose bodies are streams.
const STREAM: &str = "/api/v1/assets/{asset}/stream";
const EVENTS: &str = "/api/v1/events";

/// The schemas of messages; some of them are in no request or response.
#[derive(OpenApi)]
#[openapi(components(schemas(
    alarm::CommunicationEventView,
    bus::BatchAckView,
    bus::BatchMessageView,
    bus::BatchRefusalView,
    bus::CommunicationMessageView,
    bus::FaultMessageView,
    bus::HelloView,
    bus::PresenceWord,
    service::EventView,
    stream::StreamFrameView
)))]
struct Messages;

/// What may be sent on a channel.
struct Message {
    name: &'static str,
    /// Name of the schema.
    schema: &'static str,
    content_type: &'static str,
    summary: &'static str,
}

const JSON: &str = "application/json";

/// Every message.
const MESSAGES: [Message; 11] = [
    message("batch", "BatchMessage", JSON, "Samples; either document also as MessagePack"),
    message("batchAck", "BatchAck", JSON, "The batch is durable"),
    message("batchRefusal", "BatchRefusal", JSON, "Nothing of the batch was taken"),
    message("hello", "Hello", JSON, "What a device is"),
    message("presence", "PresenceWord", "text/plain", "Whether a device is connected"),
    message("fault", "FaultMessage", JSON, "A change of a fault code"),
    message("communication", "CommunicationMessage", JSON, "Data stay away, or are back"),
    message("cleared", NOTHING, "text/plain", "Removes the retained message"),
    message("frame", "StreamFrame", JSON, "An answer to a batch, or a state"),
    message("faultEvent", "Event", JSON, "Data of an event `fault`"),
    message("communicationEvent", "CommunicationEvent", JSON, "Data of an event `communication`"),
];

/// Stands for the schema of a message without a payload.
const NOTHING: &str = "";

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
enum Action {
    Receive,
    Send,
}

impl Action {
    const fn as_str(self) -> &'static str {
        match self {
            Self::Receive => "receive",
            Self::Send => "send",
        }
    }
}

/// A channel with its operations.
struct Channel {
    name: String,
    address: String,
    server: &'static str,
    summary: &'static str,
    bindings: Value,
    operations: Vec<Operation>,
}

/// The messages that go one way on a channel.
struct Operation {
    action: Action,
    messages: &'static [&'static str],
    /// Whether a bus keeps the last message for later subscribers.
    retained: bool,
    /// The channel and the messages of the answer.
    reply: Option<(String, &'static [&'static str])>,
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
fn http_channels(openapi: &Value) -> [Channel; 2] {
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

/// Returns the channels of a bus.
fn bus_channels(style: TopicStyle) -> Vec<Channel> {
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
    let summary = "Answers to batches; a request over NATS gets them as its reply too";
    channels.push(channel("ack", style.ack("{asset}"), summary, ack));
    let fault = Operation::new(Action::Send, &["fault", "communication", "cleared"]).retained();
    let summary = "The present state of each fault code; NATS alone keeps no message";
    channels.push(channel("fault", style.fault("{asset}", "{code}"), summary, fault));
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
            ("Birth: what a device tells after connecting", { receive(&["hello"]).retained() })
        }
        DeviceTopic::State => ("Presence: `online`; the last will of a device is `offline`", {
            receive(&["presence"]).retained()
        }),
    }
}

/// Returns the schema of the query parameters of `GET path`.
fn query(openapi: &Value, path: &str) -> Value {
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

fn channel_object(channel: &Channel) -> Value {
    let mut parameters = Map::new();
    for (name, description) in PARAMETERS {
        if channel.address.contains(&format!("{{{name}}}")) {
            parameters.insert(name.to_owned(), json!({ "description": description }));
        }
    }
    let names = channel.operations.iter().flat_map(|operation| operation.messages.iter());
    let messages: Map<String, Value> = names
        .map(|&name| (name.to_owned(), reference(&format!("#/components/messages/{name}"))))
        .collect();
    let mut object = json!({
        "address": channel.address,
        "summary": channel.summary,
        "servers": [reference(&format!("#/servers/{}", channel.server))],
        "messages": messages,
    });
    if !parameters.is_empty() {
        object["parameters"] = parameters.into();
    }
    if !channel.bindings.is_null() {
        object["bindings"] = channel.bindings.clone();
    }
    object
}

/// Parameters of addresses.
const PARAMETERS: [(&str, &str); 2] =
    [("asset", "Name of the asset; in topics, `.` is written `=2E`"), ("code", "Fault code")];

fn reference(target: &str) -> Value {
    json!({ "$ref": target })
}

fn message_references(channel: &str, names: &[&str]) -> Value {
    let message = |name: &&str| reference(&format!("#/channels/{channel}/messages/{name}"));
    names.iter().map(message).collect()
}

/// Returns the name and the object of an operation.
fn operation_object(channel: &Channel, operation: &Operation, openapi: &Value) -> (String, Value) {
    let action = operation.action.as_str();
    let mut object = json!({
        "action": action,
        "channel": reference(&format!("#/channels/{}", channel.name)),
        "messages": message_references(&channel.name, operation.messages),
    });
    if let Some((reply, messages)) = &operation.reply {
        object["reply"] = json!({
            "channel": reference(&format!("#/channels/{reply}")),
            "messages": message_references(reply, messages),
        });
    }
    if channel.server == "mqtt" {
        let mqtt = json!({ "retain": operation.retained, "bindingVersion": "0.2.0" });
        object["bindings"] = json!({ "mqtt": mqtt });
    }
    if channel.server == "http" {
        let query = query(openapi, &channel.address);
        let http = json!({ "method": "GET", "query": query, "bindingVersion": "0.3.0" });
        object["bindings"] = json!({ "http": http });
    }
    let (first, rest) = channel.name.split_at(1);
    (format!("{action}{}{rest}", first.to_ascii_uppercase()), object)
}

fn message_object(message: &Message) -> Value {
    let payload = match message.schema {
        NOTHING => json!({ "const": "" }),
        schema => reference(&format!("{SCHEMA}{schema}")),
    };
    json!({
        "name": message.name,
        "summary": message.summary,
        "contentType": message.content_type,
        "payload": payload,
    })
}

/// Returns the schemas of all messages and those that they refer to.
fn used_schemas(openapi: &Value) -> Map<String, Value> {
    let all = &openapi["components"]["schemas"];
    let mut used = Map::new();
    let mut open: BTreeSet<String> = MESSAGES
        .iter()
        .filter(|message| message.schema != NOTHING)
        .map(|message| message.schema.to_owned())
        .collect();
    while let Some(name) = open.pop_first() {
        if !used.contains_key(&name) {
            references(&all[&name], &mut open);
            used.insert(name.clone(), all[&name].clone());
        }
    }
    used
}

/// Adds the names of the schemas to which `schema` refers.
fn references(schema: &Value, names: &mut BTreeSet<String>) {
    match schema {
        Value::Object(fields) => {
            let target = fields.get("$ref").and_then(Value::as_str);
            names.extend(target.and_then(|target| target.strip_prefix(SCHEMA)).map(str::to_owned));
            fields.values().for_each(|value| references(value, names));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, names)),
        _ => {}
    }
}

/// The servers, at their usual ports on this machine.
fn servers() -> Value {
    let login = json!([{ "$ref": "#/components/securitySchemes/login" }]);
    let token = json!([{ "$ref": "#/components/securitySchemes/token" }]);
    json!({
        "websocket": { "host": "127.0.0.1:8087", "protocol": "ws", "security": token },
        "http": { "host": "127.0.0.1:8087", "protocol": "http", "security": token },
        "mqtt": { "host": "127.0.0.1:1883", "protocol": "mqtt", "security": login },
        "nats": { "host": "127.0.0.1:4222", "protocol": "nats", "security": login },
    })
}

/// Returns the AsyncAPI document.
fn asyncapi() -> Value {
    let mut openapi = api().split().1;
    openapi.merge(Messages::openapi());
    let openapi = serde_json::to_value(description::complete(openapi)).unwrap_or_default();
    let channels: Vec<Channel> = http_channels(&openapi)
        .into_iter()
        .chain(bus_channels(TopicStyle::Mqtt))
        .chain(bus_channels(TopicStyle::Nats))
        .collect();
    let operations: Map<String, Value> = channels
        .iter()
        .flat_map(|channel| channel.operations.iter().map(move |operation| (channel, operation)))
        .map(|(channel, operation)| operation_object(channel, operation, &openapi))
        .collect();
    let objects: Map<String, Value> =
        channels.iter().map(|channel| (channel.name.clone(), channel_object(channel))).collect();
    let messages: Map<String, Value> =
        MESSAGES.iter().map(|item| (item.name.to_owned(), message_object(item))).collect();
    json!({
        "asyncapi": "3.0.0",
        "info": {
            "title": "offbd",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Messages of offbd. Its requests and responses are in `openapi.yaml`.",
        },
        "defaultContentType": JSON,
        "servers": servers(),
        "channels": objects,
        "operations": operations,
        "components": {
            "messages": messages,
            "schemas": used_schemas(&openapi),
            "securitySchemes": {
                "token": { "type": "http", "scheme": "bearer" },
                "login": { "type": "userPassword" },
            },
        },
    })
}

/// Returns the AsyncAPI document as YAML, as committed in `asyncapi.yaml`.
#[must_use]
pub fn asyncapi_yaml() -> String {
    yaml_serde::to_string(&asyncapi()).unwrap_or_else(|error| format!("# {error}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reference_has_a_target() {
        fn check(value: &Value, document: &Value) {
            match value {
                Value::Object(fields) => {
                    if let Some(target) = fields.get("$ref").and_then(Value::as_str) {
                        let found = document.pointer(&target[1..]);
                        assert!(found.is_some_and(|found| !found.is_null()), "{target}");
                    }
                    fields.values().for_each(|value| check(value, document));
                }
                Value::Array(items) => items.iter().for_each(|item| check(item, document)),
                _ => {}
            }
        }
        let document = asyncapi();
        check(&document, &document);
    }

    #[test]
    fn shared_schemas_are_those_of_the_openapi_description() {
        let openapi = serde_json::to_value(super::super::openapi()).unwrap();
        let shared = &openapi["components"]["schemas"];
        let used = asyncapi()["components"]["schemas"].clone();
        let used = used.as_object().unwrap();
        let n_shared = used.keys().filter(|name| shared.get(name).is_some()).count();
        assert!(n_shared > 10, "{n_shared}");
        for (name, schema) in used {
            assert!(shared.get(name).is_none_or(|shared| shared == schema), "{name}");
        }
    }

    #[test]
    fn the_query_of_a_stream_is_described() {
        let channel = &asyncapi()["channels"]["stream"];
        let state = &channel["bindings"]["ws"]["query"]["properties"]["state"];
        assert!(state["description"].as_str().is_some_and(|text| text.contains("Hz")), "{state}");
    }
}
