//! The committed descriptions of the interface equal those generated from the code, and do not
//! contradict themselves.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use offbd_wire::problem::{PROBLEM_TYPE, PROBLEM_TYPES};
use serde_json::Value;

#[test]
fn openapi_yaml_equals_the_generated_description() {
    compare("openapi.yaml", &offbd_http::openapi_yaml());
}

#[test]
fn asyncapi_yaml_equals_the_generated_description() {
    compare("asyncapi.yaml", &offbd_http::asyncapi_yaml());
}

#[test]
fn the_schema_of_asset_files_equals_the_generated_one() {
    compare("docs/asset.schema.json", &offbd_http::asset_schema());
}

#[test]
fn the_page_of_problems_equals_the_table_of_problem_types() {
    compare("docs/operations/problems.md", &problems());
}

fn compare(file: &str, generated: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file);
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(&path, generated).expect("the description is writable");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == generated,
        "{file} is out of date; refresh it with\n    UPDATE_OPENAPI=1 cargo test --package offbd-http --test description\n"
    );
}

/// Returns the page with all types of problems.
fn problems() -> String {
    let mut page = format!(
        "# Problems\n\nWhat the service, and the edge agent, answer instead of a result: \
         `application/problem+json`\n(RFC 9457). `type` is `{PROBLEM_TYPE}` and one of the types \
         below, `detail` says what\nhappened this time, and `instance` is the id of the request \
         in the log. Programs decide by `type`\nor `status`; the wording of the rest may \
         change.\n\n| status | type | when, and what to do |\n| --- | --- | --- |\n"
    );
    for kind in PROBLEM_TYPES {
        writeln!(page, "| {} | `{}` | {} |", kind.status, kind.slug, kind.advice).unwrap();
    }
    page
}

fn parsed(yaml: &str) -> Value {
    yaml_serde::from_str(yaml).unwrap()
}

/// Fields of an object that a part of it does not permit would make every object invalid.
#[test]
fn no_part_of_an_object_excludes_the_fields_of_another_part() {
    for document in [offbd_http::openapi_yaml(), offbd_http::asyncapi_yaml()] {
        let document = parsed(&document);
        let mut found = Vec::new();
        contradictions(&document, &document, &mut found);
        assert!(found.is_empty(), "{found:#?}");
    }
}

#[test]
fn a_part_that_excludes_the_fields_of_another_part_is_found() {
    let yaml = |closed: &str| {
        parsed(&format!(
            "{{a: {{additionalProperties: {closed}, properties: {{x: {{}}}}}}, \
              b: {{allOf: [{{$ref: '#/a'}}, {{required: [y], properties: {{y: {{}}}}}}]}}}}"
        ))
    };
    for (closed, n) in [("true", 0), ("false", 1)] {
        let (document, mut found) = (yaml(closed), Vec::new());
        contradictions(&document, &document, &mut found);
        assert_eq!(found.len(), n, "{found:?}");
    }
}

/// Adds every `allOf` below `schema` of which a closed part lacks a field of another part.
fn contradictions(schema: &Value, document: &Value, found: &mut Vec<String>) {
    if let Some(parts) = schema.get("allOf").and_then(Value::as_array) {
        let parts: Vec<&Value> = parts.iter().map(|part| resolved(part, document)).collect();
        let all: BTreeSet<&String> = parts.iter().flat_map(|part| fields(part)).collect();
        let is_closed = |part: &&&Value| part["additionalProperties"] == false;
        let lacks = |part: &&Value| !all.is_subset(&fields(part));
        if parts.iter().filter(is_closed).any(lacks) {
            found.push(schema["description"].to_string());
        }
    }
    match schema {
        Value::Object(fields) => fields.values().for_each(|v| contradictions(v, document, found)),
        Value::Array(items) => items.iter().for_each(|v| contradictions(v, document, found)),
        _ => {}
    }
}

fn resolved<'a>(schema: &'a Value, document: &'a Value) -> &'a Value {
    match schema["$ref"].as_str() {
        Some(target) => document.pointer(&target[1..]).unwrap(),
        None => schema,
    }
}

fn fields(schema: &Value) -> BTreeSet<&String> {
    schema["properties"].as_object().into_iter().flat_map(|fields| fields.keys()).collect()
}
