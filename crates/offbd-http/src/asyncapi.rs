//! `/asyncapi.yaml`: the messages of the interface, as AsyncAPI 3.0: over the WebSocket, as
//! Server-Sent Events and webhooks, and over MQTT and NATS.
//!
//! The schemas of messages are those of the OpenAPI description and named alike. Topics are
//! made by the functions that the buses use; the parameters of a query are those of the
//! operation in the OpenAPI description. Actions are those of the service: it `receive`s what
//! a device sends.

mod channels;

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};
use utoipa::OpenApi;

use self::channels::{
    Channel, JSON, MESSAGES, Message, NOTHING, Operation, PARAMETERS, bus_channels, http_channels,
    query, servers, webhook_channel,
};
use super::api::api;
use super::{description, stream};
use offbd_wire::bus::TopicStyle;
use offbd_wire::{alarm, bus, notification, service};

/// How a reference to a schema begins.
const SCHEMA: &str = "#/components/schemas/";

/// The schemas of messages; some of them are in no request or response.
#[derive(OpenApi)]
#[openapi(components(schemas(
    alarm::CommunicationEventView,
    bus::BatchAckView,
    bus::BatchMessageView,
    bus::BatchRefusalView,
    bus::CommunicationMessageView,
    bus::FaultMarkerQuestionView,
    bus::FaultMarkerView,
    bus::FaultMessageView,
    bus::HelloView,
    bus::PresenceWord,
    notification::NotificationView,
    service::EventView,
    stream::StreamFrameView
)))]
struct Messages;

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
        "address": (!channel.address.is_empty()).then_some(&channel.address),
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
    if channel.server == "receiver" {
        object["bindings"] = json!({ "http": { "method": "POST", "bindingVersion": "0.3.0" } });
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

/// Returns the AsyncAPI document.
fn asyncapi() -> Value {
    let mut openapi = api().split().1;
    openapi.merge(Messages::openapi());
    let openapi = serde_json::to_value(description::complete(openapi)).unwrap_or_default();
    let channels: Vec<Channel> = http_channels(&openapi)
        .into_iter()
        .chain([webhook_channel()])
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
