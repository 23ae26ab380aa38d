//! The messages that `asyncapi.yaml` describes, and whether a message is one of them.

use std::collections::{BTreeMap, BTreeSet};

use boon::{Compiler, SchemaIndex, Schemas};
use serde_json::{Map, Value, json};

/// Where the schemas are while they are compiled; nothing is read from there.
const PLACE: &str = "https://offbd.example/messages.json";

/// How a reference to a schema begins in the document.
const SCHEMA: &str = "#/components/schemas/";

/// What the name of a schema ends with that describes a part of the fields of an object.
const PART: &str = "+part";

/// The described messages of each channel, and those that were seen.
pub struct Described {
    schemas: Schemas,
    payloads: BTreeMap<String, SchemaIndex>,
    channels: BTreeMap<String, BTreeSet<String>>,
    seen: BTreeSet<(String, String)>,
}

impl Described {
    /// Reads the document.
    pub fn read() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/asyncapi.yaml");
        let text = std::fs::read_to_string(path).unwrap();
        let document: Value = yaml_serde::from_str(&text).unwrap();
        let mut definitions = definitions(&document);
        let messages = document["components"]["messages"].as_object().unwrap();
        for (name, message) in messages {
            definitions.insert(format!("{name}+payload"), closed(&message["payload"], false));
        }
        let (mut compiler, mut schemas) = (Compiler::new(), Schemas::new());
        compiler.add_resource(PLACE, json!({ "$defs": definitions })).unwrap();
        let mut payloads = BTreeMap::new();
        for name in messages.keys() {
            let place = format!("{PLACE}#/$defs/{name}+payload");
            payloads.insert(name.clone(), compiler.compile(&place, &mut schemas).unwrap());
        }
        let names = |channel: &Value| {
            channel["messages"].as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>()
        };
        let channels = document["channels"].as_object().unwrap().iter();
        let channels = channels.map(|(name, channel)| (name.clone(), names(channel))).collect();
        Self { schemas, payloads, channels, seen: BTreeSet::new() }
    }

    /// Takes note of a message, which must be exactly one of those of its channel; returns
    /// which one.
    #[track_caller]
    pub fn note(&mut self, channel: &str, message: &Value) -> String {
        let (mut fitting, mut errors) = (Vec::new(), String::new());
        for name in &self.channels[channel] {
            match self.schemas.validate(message, self.payloads[name]) {
                Ok(()) => fitting.push(name.clone()),
                Err(error) => errors += &format!("\nno {name}: {error}"),
            }
        }
        let [name] = &fitting[..] else {
            panic!("{channel}: {message}\nis described by {fitting:?}{errors}")
        };
        self.seen.insert((channel.to_owned(), name.clone()));
        name.clone()
    }

    /// Returns the messages of these channels that were not seen.
    pub fn unseen(&self, channels: &[&str]) -> Vec<(String, String)> {
        let all = channels.iter().flat_map(|&channel| {
            let names = self.channels[channel].iter();
            names.map(move |name| (channel.to_owned(), name.clone()))
        });
        all.filter(|message| !self.seen.contains(message)).collect()
    }

    /// Returns the names of all channels.
    pub fn channels(&self) -> Vec<&str> {
        self.channels.keys().map(String::as_str).collect()
    }
}

/// Returns the schemas of a document, each as the whole and as a part of an object.
pub fn definitions(document: &Value) -> Map<String, Value> {
    let schemas = document["components"]["schemas"].as_object().unwrap().iter();
    let both = |(name, schema): (&String, &Value)| {
        [(name.clone(), closed(schema, false)), (format!("{name}{PART}"), closed(schema, true))]
    };
    schemas.flat_map(both).collect()
}

/// Returns the object of a document that `value` is or refers to.
pub fn resolved<'a>(value: &'a Value, document: &'a Value) -> &'a Value {
    value["$ref"].as_str().map_or(value, |target| document.pointer(&target[1..]).unwrap())
}

/// Returns `schema` so that a field that it does not describe is an error, unless it `is_part`:
/// then it describes some of the fields of an object, and others describe the rest.
pub fn closed(schema: &Value, is_part: bool) -> Value {
    let Value::Object(keywords) = schema else { return schema.clone() };
    let is_object = ["properties", "allOf"].iter().any(|word| keywords.contains_key(*word));
    let mut result = Map::new();
    for (keyword, value) in keywords {
        let value = match (keyword.as_str(), value) {
            ("$ref", Value::String(target)) => {
                let name = target.strip_prefix(SCHEMA).unwrap();
                format!("#/$defs/{name}{}", if is_part { PART } else { "" }).into()
            }
            ("allOf" | "oneOf" | "anyOf", Value::Array(schemas)) => {
                schemas.iter().map(|schema| closed(schema, is_part || is_object)).collect()
            }
            ("properties", Value::Object(fields)) => {
                let field =
                    |(name, schema): (&String, &Value)| (name.clone(), closed(schema, false));
                fields.iter().map(field).collect::<Map<_, _>>().into()
            }
            ("items" | "additionalProperties", value) => closed(value, false),
            (_, value) => value.clone(),
        };
        result.insert(keyword.clone(), value);
    }
    if is_object && !is_part && !keywords.contains_key("additionalProperties") {
        result.insert("unevaluatedProperties".to_owned(), false.into());
    }
    result.into()
}

#[test]
fn a_field_that_is_not_described_is_noticed() {
    let mut described = Described::read();
    let answer = json!({ "id": "1", "accepted": 1, "duplicate": 0, "rejected": [], "late": [] });
    assert_eq!(described.note("ackMqtt", &answer), "batchAck");
    for (key, value) in [("more", json!(1)), ("accepted", json!("1")), ("late", json!([{}]))] {
        let mut wrong = answer.clone();
        wrong[key] = value;
        let noted = std::panic::catch_unwind(|| Described::read().note("ackMqtt", &wrong));
        assert!(noted.is_err(), "{key}");
    }
    assert_eq!(described.unseen(&["ackMqtt"]), [("ackMqtt".to_owned(), "batchRefusal".to_owned())]);
}
