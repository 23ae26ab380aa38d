//! Examples of bodies.
//!
//! All JSON bodies with the same schema have the same example. A page without an example, and a
//! list, show the example of one item.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use utoipa::openapi::example::ExampleBuilder;
use utoipa::openapi::path::Operation;
use utoipa::openapi::schema::{Array, ArrayItems, Schema};
use utoipa::openapi::{Components, Content, Ref, RefOr};

use super::{PAGE_SUFFIX, SCHEMAS};

/// The examples by the names of their schemas.
const EXAMPLES: &str = include_str!("examples.yaml");

/// Bodies of telemetry that are text: their media types and the names of their examples.
const TEXTS: [(&str, &str); 2] = [("text/csv", "CsvRows"), ("application/x-ndjson", "NdjsonRows")];

/// The examples of the description, by name.
pub(super) struct Examples(BTreeMap<String, Value>);

impl Examples {
    /// Returns the examples for a description with these schemas.
    pub(super) fn new(schemas: &BTreeMap<String, RefOr<Schema>>) -> Self {
        let mut all: BTreeMap<String, Value> = yaml_serde::from_str(EXAMPLES).unwrap_or_default();
        let pages = schemas.keys().filter_map(|name| {
            let item = all.get(name.strip_suffix(PAGE_SUFFIX)?)?;
            Some((name.clone(), json!({ "items": [item], "next": null })))
        });
        let pages: Vec<_> = pages.collect();
        all.extend(pages);
        Self(all)
    }

    /// Adds the examples to which bodies refer.
    pub(super) fn add_to(self, components: &mut Components) {
        let examples = self.0.into_iter().map(|(name, value)| {
            let example = ExampleBuilder::new().value(Some(value)).build();
            (name, RefOr::T(example))
        });
        components.examples.extend(examples);
    }

    /// Refers to the examples of the bodies of an operation.
    pub(super) fn attach(&self, operation: &mut Operation) {
        let body = operation.request_body.iter_mut().filter_map(|body| match body {
            RefOr::T(body) => Some(&mut body.content),
            RefOr::Ref(_) => None,
        });
        for (media_type, content) in body.flatten() {
            let text = TEXTS.iter().find(|(of, _)| of == media_type);
            self.attach_to(media_type, content, text.map(|(_, name)| *name));
        }
        for response in operation.responses.responses.values_mut() {
            let RefOr::T(response) = response else { continue };
            for (media_type, content) in &mut response.content {
                self.attach_to(media_type, content, None);
            }
        }
    }

    /// Refers to the example `name`, or to that of the schema of a JSON body.
    fn attach_to(&self, media_type: &str, content: &mut RefOr<Content>, name: Option<&str>) {
        let RefOr::T(content) = content else { return };
        if let Some(item) = content.schema.as_ref().and_then(item_name) {
            content.example = self.0.get(item).map(|example| json!([example]));
            return;
        }
        let of_schema = content.schema.as_ref().and_then(schema_name);
        let name = name.or_else(|| of_schema.filter(|_| media_type == "application/json"));
        if let Some((name, _)) = name.and_then(|name| self.0.get_key_value(name)) {
            let reference = Ref::new(format!("#/components/examples/{name}"));
            content.examples.insert("example".to_owned(), RefOr::Ref(reference));
        }
    }
}

/// Returns the name of the schema of the items, if `schema` is a list.
fn item_name(schema: &RefOr<Schema>) -> Option<&str> {
    let RefOr::T(Schema::Array(Array { items: ArrayItems::RefOrSchema(item), .. })) = schema else {
        return None;
    };
    schema_name(item)
}

/// Returns the name of the schema to which `schema` refers, perhaps beside null.
fn schema_name(schema: &RefOr<Schema>) -> Option<&str> {
    match schema {
        RefOr::Ref(reference) => reference.ref_location.strip_prefix(SCHEMAS),
        RefOr::T(Schema::OneOf(one)) => one.items.iter().find_map(schema_name),
        RefOr::T(_) => None,
    }
}
