//! The examples in `openapi.yaml`: every body that a person writes or reads has one, and each is as
//! its schema says. Every operation has a description.

use boon::{Compiler, Schemas};
use serde_json::{Value, json};

use crate::support::described::resolved;
use crate::support::described_answers::{SchemaTable, openapi, operations};
use crate::support::registration;

/// A body in the description: where it is, its media type, its schema and its examples.
struct ExampleBody {
    place: String,
    media_type: String,
    schema: Value,
    examples: Vec<Value>,
}

/// Returns the bodies of all requests, and of all responses.
fn bodies(document: &Value) -> (Vec<ExampleBody>, Vec<ExampleBody>) {
    let (mut requests, mut responses) = (Vec::new(), Vec::new());
    for (method, path, operation) in operations(document) {
        let place = format!("{method} {path}");
        requests.extend(contents(&place, &operation["requestBody"], document));
        for (status, response) in operation["responses"].as_object().unwrap() {
            let response = resolved(response, document);
            responses.extend(contents(&format!("{place} {status}"), response, document));
        }
    }
    (requests, responses)
}

fn contents(place: &str, body: &Value, document: &Value) -> Vec<ExampleBody> {
    let contents = body["content"].as_object().into_iter().flatten();
    let body = |(media_type, content): (&String, &Value)| {
        let named = content["examples"].as_object().into_iter().flat_map(|named| named.values());
        let named = named.map(|example| resolved(example, document)["value"].clone());
        ExampleBody {
            place: place.to_owned(),
            media_type: media_type.clone(),
            schema: content["schema"].clone(),
            examples: named.chain(content.get("example").cloned()).collect(),
        }
    };
    contents.map(body).collect()
}

#[test]
fn every_body_that_is_text_has_an_example() {
    let document = openapi();
    let (requests, responses) = bodies(&document);
    let is_binary = |body: &ExampleBody| {
        let is_file =
            body.schema["$ref"].as_str().is_some_and(|name| name.ends_with("/BinaryFile"));
        is_file || ["application/msgpack", "multipart/form-data"].contains(&&*body.media_type)
    };
    let lacking = requests.iter().filter(|body| body.examples.is_empty() && !is_binary(body));
    let lacking: Vec<_> = lacking.map(|body| (&body.place, &body.media_type)).collect();
    assert!(requests.len() > 15 && lacking.is_empty(), "{lacking:?}");
    let is_success = |body: &ExampleBody| {
        body.place.rsplit_once(' ').is_some_and(|(_, status)| status.starts_with('2'))
    };
    let read = responses.iter().filter(|body| body.media_type == "application/json");
    let (some, lacking): (Vec<_>, Vec<_>) =
        read.filter(|body| is_success(body)).partition(|body| !body.examples.is_empty());
    let lacking: Vec<_> = lacking.iter().map(|body| &body.place).collect();
    assert!(some.len() > 60 && lacking.is_empty(), "{lacking:#?}");
}

#[test]
fn every_operation_has_a_description_beside_its_summary() {
    let document = openapi();
    let is_empty = |text: &Value| text.as_str().is_none_or(str::is_empty);
    let all: Vec<_> = operations(&document).collect();
    let lacking: Vec<_> = all
        .iter()
        .filter(|(.., operation)| {
            is_empty(&operation["summary"]) || is_empty(&operation["description"])
        })
        .map(|(method, path, _)| (method, path))
        .collect();
    assert!(all.len() > 90 && lacking.is_empty(), "{lacking:#?}");
}

#[test]
fn every_example_is_as_its_schema_says() {
    let document = openapi();
    let mut table = SchemaTable::of(&document);
    let (requests, responses) = bodies(&document);
    let placed: Vec<_> = requests
        .into_iter()
        .chain(responses)
        .filter(|body| !body.examples.is_empty())
        .map(|body| (table.add(&body.schema), body))
        .collect();
    let (mut compiler, mut schemas) = (table.compiler(), Schemas::new());
    for (place, body) in placed {
        let schema = compiler.compile(&place, &mut schemas).unwrap();
        for example in &body.examples {
            let valid = schemas.validate(example, schema);
            assert!(valid.is_ok(), "{}: {example}\n{:#}", body.place, valid.unwrap_err());
        }
    }
}

/// As an editor checks an asset file.
#[test]
fn asset_files_are_as_their_schema_says() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/asset.schema.json");
    let schema = std::fs::read_to_string(path).unwrap();
    let (mut compiler, mut schemas) = (Compiler::new(), Schemas::new());
    let place = "https://offbd.example/asset.schema.json";
    compiler.add_resource(place, serde_json::from_str(&schema).unwrap()).unwrap();
    let schema = compiler.compile(place, &mut schemas).unwrap();
    let mut learnt = registration("a");
    learnt["$schema"] = "asset.schema.json".into();
    schemas.validate(&learnt, schema).unwrap();
    for wrong in [json!({}), json!({ "name": "a", "colour": 1 }), json!({ "name": "a", "ball": 1 })]
    {
        assert!(schemas.validate(&wrong, schema).is_err(), "{wrong}");
    }
}
