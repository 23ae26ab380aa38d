//! JSON schemas of single types, taken from the description of the interface.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use serde_json::{Map, Value, json};

/// How a reference begins in the description.
const COMPONENT: &str = "#/components/schemas/";

/// The schemas of the description. They never change while the process runs.
static SCHEMAS: OnceLock<Value> = OnceLock::new();

/// Returns the schema of the type that the description calls `name`, with all that it refers to
/// in `$defs`. OpenAPI 3.1 has the schemas of JSON Schema 2020-12.
pub(super) fn of(name: &str) -> Value {
    let schemas = SCHEMAS.get_or_init(|| {
        let document = serde_json::to_value(crate::openapi()).unwrap_or_default();
        document.pointer("/components/schemas").cloned().unwrap_or_default()
    });
    let (mut definitions, mut seen) = (Map::new(), BTreeSet::new());
    let mut open = vec![name.to_owned()];
    while let Some(name) = open.pop() {
        if seen.insert(name.clone()) {
            let mut schema = schemas[&name].clone();
            localise(&mut schema, &mut open);
            definitions.insert(name, schema);
        }
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$ref": format!("#/$defs/{name}"),
        "$defs": definitions,
    })
}

/// Makes the references in `schema` local, and notes the names that they refer to.
fn localise(schema: &mut Value, names: &mut Vec<String>) {
    match schema {
        Value::Object(fields) => {
            if let Some(Value::String(reference)) = fields.get_mut("$ref")
                && let Some(name) = reference.strip_prefix(COMPONENT)
            {
                names.push(name.to_owned());
                *reference = format!("#/$defs/{name}");
            }
            fields.values_mut().for_each(|value| localise(value, names));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| localise(item, names)),
        _ => {}
    }
}
